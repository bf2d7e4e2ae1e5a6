//! Settings of step 1.

use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Settings of step 1. Lengths are in marker pitches, areas in shares of the rectified image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ContactSettings {
    /// Contact begins when the region is larger than this. The released code: 3072 of 327 x 320 px.
    pub on_area_fraction: f64,
    /// Contact ends when the region is smaller than this. The released code: 600 px.
    pub off_area_fraction: f64,
    /// Contact begins with this many frames in a row above the area. The released code: 4.
    pub on_frames_count: u32,
    /// Fabric: side of the square that joins edges. The released code: 6 px at a pitch of 15.2 px.
    pub close_pitch: f64,
    /// Fabric: side of the square that removes thinner structures, such as markers. The released code: 11 px.
    pub erode_pitch: f64,
    /// Fabric: diameter of the ellipse that restores the size of the region. The released code: 25 px, which makes the
    /// region half a pitch too wide on all sides; the overlap with simulated contacts is best at 8 to 10 px.
    pub dilate_pitch: f64,
    /// Fabric: whether regions that look like contact in the rest frame (a scratch, a reflection) are ignored.
    pub hide_rest_edges: bool,
    /// Fabric: whether the edge thresholds follow the brightness of the image since rest, as the contrast of the weave
    /// does.
    pub follow_light: bool,
    /// Fabric: whether small and weak pieces of the region are dropped; noise on an unpressed weave causes them.
    pub drop_weak_pieces: bool,
    /// Smooth gel: change of a cell's colour, in its most changed channel, that counts as contact.
    pub change_levels: f64,
    /// Smooth gel: a cell must also reach this share of the strongest change. An imprint reflects light onto the gel
    /// around it: on a GelSlim 3.0, a change of 100 levels under a ball comes with 20 around it.
    pub change_fraction: f64,
    /// Smooth gel: gaps of this width inside the region are closed: the rim of a flat object is visible, its middle
    /// hardly.
    pub smooth_close_pitch: f64,
    /// Smooth gel: the region ends where the change falls below this share of the strongest change within half of
    /// `smooth_close_pitch`. Areas that it encloses together with one side of the view, or with two opposite sides,
    /// belong to it. The slope of the gel is largest at the rim of a contact and decreases outwards. Zero: the region
    /// is wherever the change counts as contact.
    pub rim_fraction: f64,
    /// Where the image shows no contact, markers displaced by more than this, together with their neighbours, show one:
    /// a flat face over the whole pad has no visible rim. Zero: the image alone decides, as in the paper.
    pub displaced_pitch: f64,
    /// Number of markers in contact from which the patch is large enough for full quality.
    pub full_markers_count: u32,
    /// Below this quality the state is `unsure`.
    pub unsure_below_quality: f64,
    /// Minimum time between two updates of the region while something touches, ms: every third frame of a camera at 90
    /// Hz. Zero: every frame.
    pub period_ms: f64,
}

impl Default for ContactSettings {
    fn default() -> Self {
        let released_px = 327.0 * 320.0;
        ContactSettings {
            on_area_fraction: 3072.0 / released_px,
            off_area_fraction: 600.0 / released_px,
            on_frames_count: 4,
            close_pitch: 6.0 / 15.2,
            erode_pitch: 11.0 / 15.2,
            // Deviation: D12 tighter region
            dilate_pitch: 10.0 / 15.2,
            hide_rest_edges: true,
            // Deviation: D22 thresholds follow the light
            follow_light: true,
            // Deviation: D19 weak pieces dropped
            drop_weak_pieces: true,
            change_levels: 6.0,
            change_fraction: 0.25,
            smooth_close_pitch: 1.2,
            rim_fraction: 0.5,
            // Deviation: D18 displaced markers are contact
            displaced_pitch: 0.03,
            full_markers_count: 12,
            unsure_below_quality: 0.35,
            period_ms: 25.0,
        }
    }
}

impl ContactSettings {
    pub(in crate::monitor) fn check(&self) -> Result<(), SettingError> {
        within("contact.on_area_fraction", self.on_area_fraction, 0.0, 1.0)?;
        within("contact.off_area_fraction", self.off_area_fraction, 0.0, self.on_area_fraction)?;
        within("contact.on_frames_count", f64::from(self.on_frames_count), 1.0, 1000.0)?;
        within("contact.close_pitch", self.close_pitch, 0.0, 10.0)?;
        within("contact.erode_pitch", self.erode_pitch, 0.0, 10.0)?;
        within("contact.dilate_pitch", self.dilate_pitch, 0.0, 10.0)?;
        within("contact.change_levels", self.change_levels, 0.5, 255.0)?;
        within("contact.change_fraction", self.change_fraction, 0.0, 0.5)?;
        within("contact.smooth_close_pitch", self.smooth_close_pitch, 0.0, 10.0)?;
        within("contact.rim_fraction", self.rim_fraction, 0.0, 0.8)?;
        within("contact.displaced_pitch", self.displaced_pitch, 0.0, 10.0)?;
        within("contact.full_markers_count", f64::from(self.full_markers_count), 1.0, 1000.0)?;
        within("contact.unsure_below_quality", self.unsure_below_quality, 0.0, 1.0)?;
        within("contact.period_ms", self.period_ms, 0.0, 1000.0)
    }
}
