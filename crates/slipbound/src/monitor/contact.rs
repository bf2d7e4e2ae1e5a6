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
/// `off_area_fraction` now and then: it ends when it has been below for this time, ...
const START_MISSED_NS: u64 = 100_000_000;
/// ... or, where frames carry no times, for this many frames, ...
const START_MISSED_FRAMES_COUNT: u32 = 3;
/// ... or in one frame that shows less than this share of that area, in however many pieces.
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

/// What is known of the contact after a frame, besides its region.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactState {
    frames_above_count: u32,
    frames_below_count: u32,
    /// Time of the last frame that was not below, ns.
    last_above_ns: Option<u64>,
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
    /// Area of the region, px2.
    pub(super) area_px2: usize,
    /// Its middle, px; None while nothing touches and where only displacement shows the contact, because that region
    /// moves with the markers.
    pub(super) middle_px: Option<Vec2>,
    /// Strength of the imprint, 0 to 1. Smooth gel: 0 at the change that counts as contact, 1 at twice that. Fabric:
    /// the share of edge pixels divided by that of a pressed weave.
    pub(super) strength: f64,
}

impl ContactState {
    /// Counts the frames in a row in which a contact may begin, and end. A `duplicate` is no other frame in which one
    /// begins.
    fn count_frame(&mut self, above: bool, below: bool, time_ns: Option<u64>, duplicate: bool) {
        self.frames_above_count = if above { self.frames_above_count + u32::from(!duplicate) } else { 0 };
        self.frames_below_count = if below { self.frames_below_count + 1 } else { 0 };
        if !below {
            self.last_above_ns = time_ns;
        }
    }

    /// Whether a contact since the rest frame has been too small for so long that it is over.
    fn is_below_for_long(&self, time_ns: Option<u64>) -> bool {
        match self.last_above_ns.zip(time_ns).and_then(|(then_ns, now_ns)| now_ns.checked_sub(then_ns)) {
            Some(since_ns) => since_ns > START_MISSED_NS,
            None => self.frames_below_count >= START_MISSED_FRAMES_COUNT,
        }
    }
}

/// Changes in an image besides the region, px2.
#[derive(Debug, Clone, Copy, Default)]
struct Changed {
    /// Area of all changes that count: more than the region for a light touch; 0 where that is not known.
    area_px2: f64,
    /// Area of those that are each too small for a contact.
    small_px2: f64,
}

/// Step 1, with its contact state.
#[derive(Debug, Clone)]
pub(super) struct Contact {
    settings: ContactSettings,
    finder: RegionFinder,
    displaced: Option<DisplacedContact>,
    /// The region; empty while nothing touches.
    pub(super) region: Mask,
    pub(super) state: ContactState,
    /// Both as they were before the last frame.
    before: (Mask, ContactState),
    /// Whether the markers are those of a frame that shows the finger.
    knows_markers: bool,
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
        let state = ContactState {
            frames_above_count: 0,
            frames_below_count: 0,
            last_above_ns: None,
            starts_in_contact: rest.kind == RestKind::InContact,
            held_unseen: rest.kind == RestKind::InContact && sensor.skin == Skin::Smooth,
            untouched: Untouched::AtRest,
            touches: rest.kind == RestKind::InContact,
            by_displacement: false,
            area_px2: 0,
            middle_px: None,
            strength: 0.0,
        };
        Contact {
            displaced: DisplacedContact::new(sensor, settings.displaced_pitch, &rest_px),
            settings: settings.clone(),
            finder,
            region: Mask::new(size),
            state,
            before: (Mask::new(size), state),
            knows_markers: true,
        }
    }

    /// Finds the region in a frame. `markers`: as they were last seen; `duplicate`: whether the image is the one before.
    pub(super) fn find(&mut self, imprint: &Imprint, markers: &[Marker], time_ns: Option<u64>, duplicate: bool) {
        std::mem::swap(&mut self.region, &mut self.before.0);
        self.before.1 = self.state;
        if let Some(displaced) = &mut self.displaced {
            displaced.begin_frame();
        }
        let ContactSettings { on_area_fraction, off_area_fraction, .. } = self.settings;
        let changed = self.measure(imprint, markers);
        let share = self.share(changed.area_px2);
        let lasts = self.state.touches && !self.state.by_displacement && share >= off_area_fraction;
        let seen = share > on_area_fraction || lasts;
        if seen && std::mem::take(&mut self.state.starts_in_contact) {
            self.state.untouched = Untouched::Unseen;
        }
        self.update_displaced(seen, markers);
        self.state.strength = self.state.strength.clamp(0.0, 1.0);
        // Changes elsewhere do not belong to a contact that only displacement shows.
        let by_picture = seen || self.displaced.is_none();
        let share = self.share(if by_picture { changed.area_px2 } else { 0.0 });
        let (above, below) = (share > on_area_fraction, share < off_area_fraction);
        self.state.count_frame(above, below, time_ns, duplicate);
        let missed = self.is_missed(share.max(self.share(changed.small_px2)), time_ns);
        self.update_state(seen, missed, share);
        let as_at_start = self.state.held_unseen && self.is_as_at_start();
        self.state.held_unseen &= seen || missed || as_at_start;
        if !self.state.touches {
            self.region.clear();
            self.state.area_px2 = 0;
            self.state.strength = 0.0;
        }
        self.state.middle_px = if self.state.by_displacement { None } else { self.region.middle_px() };
    }

    /// Confirms the last frame, which shows the finger: where a contact since the rest frame has ended in it, a weave
    /// looks as it does when it is free. `is_new`: whether the region was found in it.
    pub(super) fn confirm_frame(&mut self, is_new: bool) {
        self.knows_markers = true;
        if !is_new {
            return;
        }
        let ends_start = self.before.1.untouched == Untouched::Unseen && self.state.untouched == Untouched::Now;
        if let (true, RegionFinder::Texture(texture)) = (ends_start, &mut self.finder) {
            texture.end_start();
        }
    }

    /// Returns to the contact as it was before the last frame, which turned out to show no finger. `is_new`: whether the
    /// region was found in it.
    pub(super) fn forget_frame(&mut self, is_new: bool) {
        self.knows_markers = false;
        if !is_new {
            return;
        }
        std::mem::swap(&mut self.region, &mut self.before.0);
        self.state = self.before.1;
        if let Some(displaced) = &mut self.displaced {
            displaced.forget_frame();
        }
        if let RegionFinder::Shading(shading) = &mut self.finder {
            shading.forget_frame();
        }
    }

    /// Measures region, area and strength in the image alone.
    fn measure(&mut self, imprint: &Imprint, markers: &[Marker]) -> Changed {
        let changed;
        (self.state.strength, changed) = match &mut self.finder {
            RegionFinder::Texture(texture) => {
                let edges = texture.find(imprint, &mut self.region);
                (edges / FULL_EDGE_SHARE, Changed::default())
            }
            RegionFinder::Shading(shading) => {
                let level = self.settings.change_levels;
                let share = self.settings.change_fraction as f32;
                let places = markers.iter().map(|m| m.now);
                let change = shading.find(&imprint.cells, places, level as f32, share, &mut self.region);
                let changed = Changed { area_px2: change.changed_px2, small_px2: change.small_px2 };
                (change.mean_levels / level - 1.0, changed)
            }
        };
        self.state.area_px2 = self.region.area_px2();
        changed
    }

    /// Share of the gel in view that the region takes, or that has changed, whichever is larger.
    fn share(&self, changed_px2: f64) -> f64 {
        (self.state.area_px2 as f64).max(changed_px2) / self.region.size().area() as f64
    }

    /// Where the image shows no contact (`seen`), the markers that are displaced may.
    fn update_displaced(&mut self, seen: bool, markers: &[Marker]) {
        let Some(displaced) = &mut self.displaced else { return };
        if seen {
            displaced.reset_baseline(markers);
        } else if self.before.1.by_displacement && !self.knows_markers {
            // What they showed before stays until they are seen again.
            self.region.copy_from(&self.before.0);
            (self.state.strength, self.state.area_px2) = (self.before.1.strength, self.before.1.area_px2);
        } else if self.state.untouched == Untouched::AtRest {
            self.state.strength = displaced.find(markers, &mut self.region);
            self.state.area_px2 = self.region.area_px2();
        }
    }

    /// Whether a contact since the rest frame is only missed in this frame. `shown`: share of the gel in view that shows
    /// something of it.
    fn is_missed(&self, shown: f64, time_ns: Option<u64>) -> bool {
        self.state.untouched == Untouched::Unseen
            && shown >= START_GONE_SHARE * self.settings.off_area_fraction
            && !self.state.is_below_for_long(time_ns)
    }

    /// Whether the finger is touched, how that is known, and what is known of the untouched finger.
    fn update_state(&mut self, seen: bool, missed: bool, share: f64) {
        let state = &mut self.state;
        let off = share < self.settings.off_area_fraction;
        state.touches = match state.touches {
            true => !off || missed,
            false => state.frames_above_count >= self.settings.on_frames_count,
        };
        state.by_displacement = state.touches && !seen && !off && self.displaced.is_some();
        state.untouched = match state.untouched {
            Untouched::Unseen if !state.touches => Untouched::Now,
            Untouched::Now if state.touches => Untouched::AtRest,
            known => known,
        };
    }

    /// Whether the finger shows for the first time how it is untouched, and nothing begins to touch it.
    pub(super) fn is_free_for_the_first_time(&self) -> bool {
        self.state.untouched == Untouched::Now && self.state.frames_above_count == 0
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
        markers.min(self.state.strength).min(1.0)
    }

    pub(super) fn unsure(&self, quality: f64) -> bool {
        quality < self.settings.unsure_below_quality
    }
}
