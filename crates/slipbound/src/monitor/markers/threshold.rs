//! The paper's marker finder: flat image -> dark blobs, by local thresholds learned from the rest frame.

use crate::image::{Mask, SizePx};
use crate::pixels::components::Components;
use crate::pixels::dots::Spot;
use crate::pixels::morphology::{Element, Morphology};
use crate::pixels::threshold::{below_level, below_levels};
use crate::plane::Vec2;

/// Where the rest image is below the first level (after closing), pixels below the second belong to a marker (released
/// code).
const LOCAL_LEVELS: [(u8, u8); 3] = [(70, 80), (40, 50), (10, 20)];
/// Elsewhere, pixels below this level belong to a marker.
const LEVEL: u8 = 90;

#[derive(Debug, Clone)]
pub(super) struct ThresholdFinder {
    levels: Vec<u8>,
    morphology: Morphology,
    components: Components,
    mask: Mask,
    work: Mask,
    join: Element,
    grow: Element,
    around: Element,
    least_area_px2: usize,
    spots: Vec<Spot>,
}

/// Pitch in the released code, px, and the side of its largest structuring element, px.
const PAPER_PITCH_PX: f64 = 15.2;
const AROUND_PX: f64 = 45.0;
/// That side in pitches.
pub(in crate::monitor) const THRESHOLD_REACH_PITCH: f64 = AROUND_PX / PAPER_PITCH_PX;

impl ThresholdFinder {
    pub(super) fn new(size: SizePx, pitch_px: f64) -> Self {
        // Sides are in px of the released code.
        let side = |px: f64| (px / PAPER_PITCH_PX * pitch_px).round().max(1.0) as usize;
        ThresholdFinder {
            levels: vec![LEVEL; size.area()],
            morphology: Morphology::new(size),
            components: Components::new(size),
            mask: Mask::new(size),
            work: Mask::new(size),
            join: Element::rect(side(2.0), side(2.0)),
            grow: Element::rect(side(5.0), side(5.0)),
            around: Element::ellipse(side(AROUND_PX), side(AROUND_PX)),
            least_area_px2: (9.0 * (pitch_px / PAPER_PITCH_PX) * (pitch_px / PAPER_PITCH_PX)).round() as usize,
            spots: Vec::with_capacity(size.area() / 4 + size.width + size.height),
        }
    }

    /// Sets the local thresholds.
    pub(super) fn learn(&mut self, flat_at_rest: &[u8]) {
        let width = self.mask.size().width;
        self.levels.fill(LEVEL);
        for (below, level) in LOCAL_LEVELS {
            below_level(flat_at_rest, below, &mut self.mask);
            self.morphology.close(&self.mask, &self.around, &mut self.work);
            for (i, out) in self.levels.iter_mut().enumerate() {
                if self.work.get((i % width) as isize, (i / width) as isize) {
                    *out = level;
                }
            }
        }
    }

    /// The blobs of a frame. Their contrast is not measured: it is the same for all.
    pub(super) fn run(&mut self, flat: &[u8]) -> &[Spot] {
        below_levels(flat, &self.levels, &mut self.mask);
        self.morphology.close(&self.mask, &self.join, &mut self.work);
        self.morphology.dilate(&self.work, &self.grow, &mut self.mask);
        self.spots.clear();
        for blob in self.components.label(&self.mask) {
            if blob.area_px2 >= self.least_area_px2 {
                self.spots
                    .push(Spot { position: Vec2::new(blob.centroid_px.x, blob.centroid_px.y), response_levels: 1.0 });
            }
        }
        &self.spots
    }
}
