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
mod settings;
mod shading;
mod texture;

pub(super) use illumination::illumination;
#[cfg(test)]
pub(super) use illumination::tests as illumination_tests;
pub use settings::ContactSettings;

use crate::image::Mask;
use crate::monitor::imprint::Imprint;
use crate::monitor::report::Marker;
use crate::monitor::rest::{Rest, RestKind};
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};
use displaced::DisplacedContact;
use shading::ShadingContact;
use texture::TextureContact;
pub(super) use texture::{IMPRINT_RATIO, texture_share};

/// A contact since the rest frame is seen against a guess of the bare gel, so that a faint one falls below
/// `off_area_fraction` in single frames: it ends with this many such frames in a row, or with one below this share of
/// that area.
const START_MISSED_FRAMES_COUNT: u32 = 3;
const START_GONE_SHARE: f64 = 0.25;

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
    frames_below_count: u32,
    starts_in_contact: bool,
    /// Whether an object has been held since the rest frame whose imprint on the smooth gel may be too faint for a
    /// region: until the image shows no region and differs from the first one.
    pub(super) held_unseen: bool,
    /// Displacement from rest shows contact only at [`Untouched::AtRest`].
    pub(super) untouched: Untouched,
    /// Whether something touches.
    pub(super) touches: bool,
    /// Whether only displacement shows the contact.
    pub(super) by_displacement: bool,
    /// The region; empty while nothing touches.
    pub(super) region: Mask,
    /// Its area, px2.
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
            Skin::Fabric => RegionFinder::Texture(Box::new(TextureContact::from_rest(sensor, settings, imprint, rest))),
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
            frames_below_count: 0,
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
        let changed_px2 = self.measure(imprint, markers);
        let share = self.share(changed_px2);
        let seen = share > self.settings.on_area_fraction
            || (self.touches && !self.by_displacement && share >= self.settings.off_area_fraction);
        let as_at_start = self.held_unseen && self.is_as_at_start();
        self.held_unseen = self.held_unseen && (seen || as_at_start);
        if seen && std::mem::take(&mut self.starts_in_contact) {
            self.untouched = Untouched::Unseen;
        }
        self.update_displaced(seen, markers);
        self.strength = self.strength.clamp(0.0, 1.0);
        // Changes elsewhere do not belong to a contact that only displacement shows.
        let by_picture = seen || self.displaced.is_none();
        let share = self.share(if by_picture { changed_px2 } else { 0.0 });
        self.count_frames(share);
        self.update_state(seen, share);
        if !self.touches {
            self.region.clear();
            self.area_px2 = 0;
            self.strength = 0.0;
        }
        self.middle_px = if self.by_displacement { None } else { self.region.middle_px() };
    }

    /// Measures region, area and strength in the image alone. Returns how much of the gel has changed, px2: more than
    /// the region for a light touch; 0 where that is not known.
    fn measure(&mut self, imprint: &Imprint, markers: &[Marker]) -> f64 {
        let changed_px2;
        (self.strength, changed_px2) = match &mut self.finder {
            RegionFinder::Texture(texture) => {
                let edges = texture.find(imprint, &mut self.region);
                (edges / FULL_EDGE_SHARE, 0.0)
            }
            RegionFinder::Shading(shading) => {
                let level = self.settings.change_levels;
                let share = self.settings.change_fraction as f32;
                let places = markers.iter().map(|m| m.now);
                let (mean, changed_px2) = shading.find(&imprint.cells, places, level as f32, share, &mut self.region);
                (mean / level - 1.0, changed_px2)
            }
        };
        self.area_px2 = self.region.area_px2();
        changed_px2
    }

    /// Share of the gel in view that the region takes, or that has changed, whichever is larger.
    fn share(&self, changed_px2: f64) -> f64 {
        (self.area_px2 as f64).max(changed_px2) / self.region.size().area() as f64
    }

    /// Where the image shows no contact (`seen`), the markers that are displaced may.
    fn update_displaced(&mut self, seen: bool, markers: &[Marker]) {
        let Some(displaced) = &mut self.displaced else { return };
        if seen {
            displaced.reset_baseline(markers);
        } else if self.untouched == Untouched::AtRest {
            self.strength = displaced.find(markers, &mut self.region);
            self.area_px2 = self.region.area_px2();
        }
    }

    /// Counts the frames in a row in which a contact may begin, and end.
    fn count_frames(&mut self, share: f64) {
        let ContactSettings { on_area_fraction, off_area_fraction, .. } = self.settings;
        self.frames_above_count = if share > on_area_fraction { self.frames_above_count + 1 } else { 0 };
        self.frames_below_count = if share < off_area_fraction { self.frames_below_count + 1 } else { 0 };
    }

    /// Whether the finger is touched, how that is known, and what is known of the untouched finger.
    fn update_state(&mut self, seen: bool, share: f64) {
        let off_fraction = self.settings.off_area_fraction;
        let off = share < off_fraction;
        let missed = self.untouched == Untouched::Unseen
            && self.frames_below_count < START_MISSED_FRAMES_COUNT
            && share >= START_GONE_SHARE * off_fraction;
        self.touches = match self.touches {
            true => !off || missed,
            false => self.frames_above_count >= self.settings.on_frames_count,
        };
        self.by_displacement = self.touches && !seen && !off && self.displaced.is_some();
        self.untouched = match self.untouched {
            Untouched::Unseen if !self.touches => {
                if let RegionFinder::Texture(texture) = &mut self.finder {
                    texture.end_start();
                }
                Untouched::Now
            }
            Untouched::Now if self.touches => Untouched::AtRest,
            known => known,
        };
    }

    /// Whether the finger shows for the first time how it is untouched, and nothing begins to touch it.
    pub(super) fn is_free_for_the_first_time(&self) -> bool {
        self.untouched == Untouched::Now && self.frames_above_count == 0
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
