//! What the fingers feel of the ground: how far it has turned the object in them, and how far it pushes the object.
//!
//! ```text
//!   both   --o--o-----o--o--     Each set of fingers has its own mean. A set that returns after a short absence
//!   left   -------o-----------   continues from its own values; a new set, or one absent for long, from those of
//!   right  ----------o--------   the last set: a jump between the means is no motion of the object.
//! ```

use crate::hand::{FINGERS_MOST, HandReport, Health};
use crate::smoothing;

/// The push of the ground is measured against its mean over this time, s: on one edge the object still hangs in the
/// fingers, and rotation and gel creep cause slow changes.
const CREEP_S: f64 = 1.0;

/// Longest absence after which a set of fingers continues from its own values, ns.
pub(super) const AWAY_NS: u64 = 300_000_000;

/// Number of sets stored: both fingers, either, and one spare.
pub(super) const SETS_COUNT: usize = 4;

/// Which fingers contribute to the means, and whether they could be separated.
pub(super) type Fingers = ([Health; FINGERS_MOST], bool);

/// The set of fingers behind a report.
pub(super) fn fingers_of(hand: &HandReport) -> Fingers {
    (hand.health, hand.separated)
}

/// The last values of a set of fingers, and their references.
#[derive(Debug, Clone, Copy)]
struct GroundEstimate {
    fingers: Fingers,
    seen_ns: u64,
    pivot_rad: f64,
    along_mm: f64,
    /// Rotation while the object hung, rad.
    hanging_rad: f64,
    /// Mean shear along over [`CREEP_S`], mm, and when it was last updated, ns; None before the first call of
    /// `push_mm`.
    mean: Option<(f64, u64)>,
}

impl GroundEstimate {
    fn turned_rad(&self) -> f64 {
        self.pivot_rad - self.hanging_rad
    }

    fn push_mm(&self) -> Option<f64> {
        self.mean.map(|(mean_mm, _)| mean_mm - self.along_mm)
    }
}

/// What the fingers feel of the ground.
#[derive(Debug, Clone, Default)]
pub(super) struct Ground {
    /// The newest first.
    estimates: [Option<GroundEstimate>; SETS_COUNT],
}

impl Ground {
    /// How far the object has turned in the fingers since it hung, rad; None where they do not feel it.
    pub fn turned_rad(&mut self, now_ns: u64, hand: &HandReport) -> Option<f64> {
        let (along_mm, pivot_rad) = (hand.shear_mm?.along, hand.pivot_rad?);
        let fingers = fingers_of(hand);
        let last = self.estimates[0];
        let of_these =
            self.estimates.iter().position(|estimate| estimate.is_some_and(|estimate| estimate.fingers == fingers));
        self.estimates[..=of_these.unwrap_or(SETS_COUNT - 1)].rotate_right(1);
        let own = self.estimates[0].filter(|estimate| {
            let is_last = last.is_some_and(|last| last.fingers == fingers);
            estimate.fingers == fingers && (is_last || now_ns.saturating_sub(estimate.seen_ns) <= AWAY_NS)
        });
        // A set without a mean yet takes over the push of the last set.
        let mean = last
            .and_then(|last| last.mean.zip(last.push_mm()))
            .map(|((_, seen_ns), push_mm)| (along_mm + push_mm, seen_ns));
        let estimate = GroundEstimate {
            fingers,
            seen_ns: now_ns,
            pivot_rad,
            along_mm,
            hanging_rad: own.map_or(pivot_rad - last.map_or(0.0, |last| last.turned_rad()), |own| own.hanging_rad),
            mean: own.and_then(|own| own.mean).or(mean),
        };
        self.estimates[0] = Some(estimate);
        Some(estimate.turned_rad())
    }

    /// How far the ground has pushed the object against the fingers within about [`CREEP_S`], mm, by the last values.
    /// `stands`: the wrist stands while the push is being confirmed, and the mean is frozen.
    pub fn push_mm(&mut self, now_ns: u64, stands: bool) -> f64 {
        let Some(estimate) = &mut self.estimates[0] else { return 0.0 };
        let (mean_mm, seen_ns) = estimate.mean.unwrap_or((estimate.along_mm, now_ns));
        let elapsed_s = now_ns.saturating_sub(seen_ns) as f64 * 1e-9;
        let creep_fraction = if stands { 0.0 } else { smoothing::weight(elapsed_s, CREEP_S) };
        let next_mm = mean_mm + creep_fraction * (estimate.along_mm - mean_mm);
        estimate.mean = Some((next_mm, now_ns));
        mean_mm - estimate.along_mm
    }
}
