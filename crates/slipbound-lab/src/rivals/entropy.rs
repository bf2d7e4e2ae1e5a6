//! Entropy of the displacement field, after Yuan, Li, Srinivasan and Adelson (ICRA 2015): while the whole contact
//! sticks the markers move alike and the histogram of their displacement is narrow; partial slip spreads it.

use super::detector::Detector;
use super::reference::{LEAST_COUNT, Reference};
use slipbound::monitor::{SlipMonitor, SlipReport};

/// Width of a bin in pitches. Ours: the paper states none; some five times the noise of a marker.
const BIN_PITCH: f64 = 0.05;

/// Entropy in nats above which it raises an alarm. Ours, see docs/eval.md.
const THRESHOLD_NATS: f64 = 1.6;

/// Number of bins; longer displacements count in the last one.
const BINS_COUNT: usize = 64;

/// Score: entropy in nats of the histogram of displacement lengths of the markers in contact. A marker is shared
/// between the two nearest bins, so that the score does not jump.
#[derive(Debug, Clone, Default)]
pub struct Entropy {
    reference: Reference,
}

/// Entropy in nats of the histogram of some lengths in bins.
fn entropy_nats(lengths_bins: impl Iterator<Item = f64>) -> f64 {
    let mut bins = [0.0; BINS_COUNT];
    let mut count = 0.0;
    for length in lengths_bins {
        let place = length.clamp(0.0, (BINS_COUNT - 2) as f64);
        let (low, part) = (place as usize, place.fract());
        bins[low] += 1.0 - part;
        bins[low + 1] += part;
        count += 1.0;
    }
    bins.iter().filter(|bin| **bin > 0.0).map(|bin| -(bin / count) * libm::log(bin / count)).sum()
}

impl Detector for Entropy {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        let bin_px = BIN_PITCH * monitor.sensor().pitch_px;
        let moved = self.reference.moved(monitor, report);
        if moved.len() < LEAST_COUNT {
            return 0.0;
        }
        entropy_nats(moved.iter().map(|m| m.by_px.length() / bin_px))
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_NATS
    }

    fn restart(&mut self) {
        self.reference.restart();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_that_move_alike_have_no_entropy_and_two_kinds_have_that_of_a_coin() {
        assert_eq!(entropy_nats([3.0; 20].into_iter()), 0.0);
        let two = entropy_nats([3.0, 9.0].into_iter().cycle().take(20));
        assert!((two - std::f64::consts::LN_2).abs() < 1e-12, "{two}");
        let even = entropy_nats((0..50).map(f64::from));
        assert!((even - libm::log(50.0)).abs() < 1e-12, "{even}");
    }
}
