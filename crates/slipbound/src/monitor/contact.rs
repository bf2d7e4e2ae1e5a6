//! Step 1: imprint -> contact region.
//!
//! ```text
//!   fabric skin: the pressed weave has edges           smooth gel: shading differs from the rest frame
//!   flat --Canny--> edges --close, erode, dilate-->    cells - rest cells --fill, close, outline-->
//!                                      \_____ region _____/
//!                                              | empty
//!                       markers that moved, with their neighbours --> region
//! ```

mod displaced;
mod illumination;
mod shading;

pub(super) use illumination::illumination;

use crate::image::Mask;
use crate::monitor::imprint::Imprint;
use crate::monitor::report::Marker;
use crate::monitor::rest::{Rest, RestKind};
use crate::pixels::canny::Canny;
use crate::pixels::components::Components;
use crate::pixels::morphology::{Element, Morphology};
use crate::plane::Vec2;
use crate::sensor::{EdgeBand, Sensor, Skin};
use crate::setting::{SettingError, within};
use displaced::DisplacedContact;
use serde::{Deserialize, Serialize};
use shading::ShadingContact;

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
    pub(super) fn check(&self) -> Result<(), SettingError> {
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

/// An unpressed weave that is near the camera or well lit also shows edges in places. After closing and erosion, pieces
/// made of them are small, or have an edge density below this share of that of the largest piece.
const LEAST_PIECE_PITCH: f64 = 0.5;
const WEAK_PIECE_FRACTION: f64 = 0.6;

/// The contact region of a fabric skin: the paper's edges and morphology.
#[derive(Debug, Clone)]
struct TextureContact {
    bands: Vec<EdgeBand>,
    canny: Canny,
    morphology: Morphology,
    close: Element,
    erode: Element,
    dilate: Element,
    edges: Mask,
    work: Mask,
    hidden: Option<Mask>,
    components: Components,
    least_piece_px2: usize,
    removes_weak: bool,
}

impl TextureContact {
    fn new(sensor: &Sensor, settings: &ContactSettings) -> Self {
        let size = sensor.rectified_px();
        let side = |pitch: f64| (pitch * sensor.pitch_px).round().max(1.0) as usize;
        TextureContact {
            bands: sensor.edge_bands.clone(),
            canny: Canny::new(size),
            morphology: Morphology::new(size),
            close: Element::rect(side(settings.close_pitch), side(settings.close_pitch)),
            erode: Element::rect(side(settings.erode_pitch), side(settings.erode_pitch)),
            dilate: Element::ellipse(side(settings.dilate_pitch), side(settings.dilate_pitch)),
            edges: Mask::new(size),
            work: Mask::new(size),
            hidden: None,
            components: Components::new(size),
            least_piece_px2: (LEAST_PIECE_PITCH * LEAST_PIECE_PITCH * sensor.pitch_px * sensor.pitch_px).round()
                as usize,
            removes_weak: settings.drop_weak_pieces,
        }
    }

    /// Writes the region; returns the share of edge pixels in it.
    fn find(&mut self, flat: &[u8], seen: Option<&Mask>, region: &mut Mask) -> f64 {
        self.find_with(flat, seen, self.removes_weak, region)
    }

    /// The same; `remove_weak`: whether weak pieces are dropped.
    fn find_with(&mut self, flat: &[u8], seen: Option<&Mask>, remove_weak: bool, region: &mut Mask) -> f64 {
        let size = region.size();
        let mut from = 0;
        for band in &self.bands {
            let to = (band.rows_to_fraction * size.height as f64).round() as usize;
            self.canny.run(flat, from..to, band.low_levels, band.high_levels, &mut self.edges);
            from = to;
        }
        let edges = self.edges.words_mut();
        if let Some(seen) = seen {
            edges.iter_mut().zip(seen.words()).for_each(|(e, s)| *e &= s);
        }
        if let Some(hidden) = &self.hidden {
            edges.iter_mut().zip(hidden.words()).for_each(|(e, h)| *e &= !h);
        }
        self.morphology.close(&self.edges, &self.close, &mut self.work);
        self.morphology.erode(&self.work, &self.erode, region);
        if remove_weak {
            self.components.remove_weak(region, &self.edges, self.least_piece_px2, WEAK_PIECE_FRACTION);
        }
        self.morphology.dilate(region, &self.dilate, &mut self.work);
        region.copy_from(&self.work);
        let inside: u32 = self.edges.words().iter().zip(region.words()).map(|(e, r)| (e & r).count_ones()).sum();
        f64::from(inside) / region.area_px2().max(1) as f64
    }

    /// Hides, in all later frames, what looks like contact in this image of a finger at rest.
    fn hide(&mut self, flat: &[u8], seen: Option<&Mask>) {
        let mut region = Mask::new(self.edges.size());
        self.find_with(flat, seen, false, &mut region);
        self.hidden = (region.area_px2() > 0).then_some(region);
    }
}

#[derive(Debug, Clone)]
enum RegionFinder {
    Texture(Box<TextureContact>),
    Shading(Box<ShadingContact>),
}

/// Share of edge pixels in a pressed weave at full strength: threads of three to six pixels give one edge pixel in
/// five.
const FULL_EDGE_SHARE: f64 = 0.2;

/// Which marker positions are known to be those of the untouched finger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Untouched {
    /// The rest positions.
    AtRest,
    /// None yet: the rest frame and all images since show a contact.
    Unseen,
    /// That contact has ended: the current ones, until something touches.
    Now,
}

/// Step 1, with its contact state.
#[derive(Debug, Clone)]
pub(super) struct Contact {
    settings: ContactSettings,
    finder: RegionFinder,
    displaced: Option<DisplacedContact>,
    frames_above_count: u32,
    starts_in_contact: bool,
    /// Whether an object has been held since the rest frame whose imprint on the smooth gel is too faint for a region:
    /// until a region shows, or the image differs from the first one.
    pub(super) held_unseen: bool,
    /// Displacement from rest shows contact only at [`Untouched::AtRest`].
    pub(super) untouched: Untouched,
    /// Whether something touches.
    pub(super) touches: bool,
    /// Whether only displacement shows the contact.
    pub(super) by_displacement: bool,
    /// The region; empty while nothing touches.
    pub(super) region: Mask,
    /// Its area in px.
    pub(super) area_px2: usize,
    /// Its middle, px; None while nothing touches and where only displacement shows the contact, because that region
    /// moves with the markers.
    pub(super) middle_px: Option<Vec2>,
    /// Strength of the imprint, 0 to 1. Smooth gel: 0 at the change that counts as contact, 1 at twice that. Fabric:
    /// the share of edge pixels divided by that of a pressed weave.
    pub(super) strength: f64,
}

impl Contact {
    pub(super) fn new(sensor: &Sensor, settings: &ContactSettings, imprint: &Imprint, rest: &Rest) -> Self {
        let size = sensor.rectified_px();
        let finder = match sensor.skin {
            Skin::Fabric => {
                let mut texture = TextureContact::new(sensor, settings);
                // Deviation: D3 rest edges hidden
                if settings.hide_rest_edges && rest.kind == RestKind::Unloaded {
                    texture.hide(&rest.flat, imprint.seen());
                }
                RegionFinder::Texture(Box::new(texture))
            }
            // Deviation: D4 smooth gels
            Skin::Smooth => {
                let least_px = settings.off_area_fraction * size.area() as f64;
                let (cells, covered) = (&rest.cells, &rest.cells_covered);
                let (close, rim) = (settings.smooth_close_pitch, settings.rim_fraction);
                let shading = ShadingContact::new(sensor, &imprint.cells, cells, covered, close, rim, least_px);
                RegionFinder::Shading(Box::new(shading))
            }
        };
        let rest_px: Vec<_> = rest.markers.iter().map(|m| m.position).collect();
        Contact {
            displaced: DisplacedContact::new(sensor, settings.displaced_pitch, &rest_px),
            by_displacement: false,
            settings: settings.clone(),
            finder,
            frames_above_count: 0,
            starts_in_contact: rest.kind == RestKind::InContact,
            held_unseen: rest.kind == RestKind::InContact && sensor.skin == Skin::Smooth,
            untouched: Untouched::AtRest,
            touches: rest.kind == RestKind::InContact,
            region: Mask::new(size),
            area_px2: 0,
            middle_px: None,
            strength: 0.0,
        }
    }

    /// Finds the region in a frame. `markers`: as they were last seen.
    pub(super) fn find(&mut self, imprint: &Imprint, markers: &[Marker]) {
        let changed_px2;
        (self.strength, changed_px2) = match &mut self.finder {
            RegionFinder::Texture(texture) => {
                let edges = texture.find(&imprint.flat, imprint.seen(), &mut self.region);
                (edges / FULL_EDGE_SHARE, None)
            }
            RegionFinder::Shading(shading) => {
                let level = self.settings.change_levels;
                let share = self.settings.change_fraction as f32;
                let places = markers.iter().map(|m| m.now);
                let (mean, changed_px2) = shading.find(&imprint.cells, places, level as f32, share, &mut self.region);
                (mean / level - 1.0, Some(changed_px2))
            }
        };
        let on = self.settings.on_area_fraction;
        let whole_px2 = self.region.size().area() as f64;
        self.area_px2 = self.region.area_px2();
        // A light touch changes more of the gel than it touches.
        let of_region = |area_px2: usize| (area_px2 as f64).max(changed_px2.unwrap_or(0.0)) / whole_px2;
        let share = of_region(self.area_px2);
        let seen = share > on || (self.touches && !self.by_displacement && share >= self.settings.off_area_fraction);
        self.held_unseen = self.held_unseen && !seen && self.is_as_at_start();
        if seen && std::mem::take(&mut self.starts_in_contact) {
            self.untouched = Untouched::Unseen;
        }
        if let Some(displaced) = &mut self.displaced {
            if seen {
                displaced.reset_baseline(markers);
            } else if self.untouched == Untouched::AtRest {
                self.strength = displaced.find(markers, &mut self.region);
                self.area_px2 = self.region.area_px2();
            }
        }
        self.strength = self.strength.clamp(0.0, 1.0);
        // Changes elsewhere do not belong to a contact that only displacement shows.
        let by_picture = seen || self.displaced.is_none();
        let share = if by_picture { of_region(self.area_px2) } else { self.area_px2 as f64 / whole_px2 };
        self.frames_above_count = if share > on { self.frames_above_count + 1 } else { 0 };
        if self.touches {
            self.touches = share >= self.settings.off_area_fraction;
        } else {
            self.touches = self.frames_above_count >= self.settings.on_frames_count;
        }
        self.by_displacement = self.touches && !seen && self.displaced.is_some();
        self.untouched = match self.untouched {
            Untouched::Unseen if !self.touches => Untouched::Now,
            Untouched::Now if self.touches => Untouched::AtRest,
            known => known,
        };
        if !self.touches {
            self.region.clear();
            self.area_px2 = 0;
            self.strength = 0.0;
        }
        self.middle_px = if self.by_displacement { None } else { self.region.middle_px() };
    }

    /// Whether less of a smooth gel than a contact needs has changed since the first frame. Half the change that counts
    /// as contact: the imprint itself was fainter than that.
    fn is_as_at_start(&mut self) -> bool {
        let RegionFinder::Shading(shading) = &mut self.finder else { return false };
        let level = (self.settings.change_levels / 2.0) as f32;
        shading.changed_since_start_fraction(level) <= self.settings.on_area_fraction
    }

    /// Quality of the patch, 0 to 1: the smaller of its share of markers and its strength.
    pub(super) fn quality(&self, markers_in_contact_count: u32) -> f64 {
        let markers = f64::from(markers_in_contact_count) / f64::from(self.settings.full_markers_count);
        markers.min(self.strength).min(1.0)
    }

    pub(super) fn unsure(&self, quality: f64) -> bool {
        quality < self.settings.unsure_below_quality
    }
}

/// Dilation, in pitches, with which `bare_sharpness` of sensor files is measured, whatever the settings.
const SHARPNESS_DILATE_PITCH: f64 = 18.0 / 15.2;

/// Share of the image that looks like pressed weave, without a rest frame; for fabric skins only.
pub(super) fn texture_share(sensor: &Sensor, settings: &ContactSettings, imprint: &Imprint) -> f64 {
    let settings = ContactSettings { dilate_pitch: SHARPNESS_DILATE_PITCH, ..settings.clone() };
    let mut texture = TextureContact::new(sensor, &settings);
    let mut region = Mask::new(imprint.size());
    // All pieces count, as for `bare_sharpness` of a sensor.
    texture.find_with(&imprint.flat, imprint.seen(), false, &mut region);
    region.area_px2() as f64 / imprint.size().area() as f64
}
