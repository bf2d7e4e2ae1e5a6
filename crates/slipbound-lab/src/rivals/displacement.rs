//! The simplest rule: displacement of the markers in contact.

use super::detector::Detector;
use super::reference::{LEAST_COUNT, Reference};
use slipbound::monitor::{SlipMonitor, SlipReport};

/// Mean displacement, in pitches, above which it raises an alarm. Ours, see docs/eval.md.
const THRESHOLD_PITCH: f64 = 0.15;

/// Score: mean displacement length of the markers in contact since the reference, in pitches.
#[derive(Debug, Clone, Default)]
pub struct Displacement {
    reference: Reference,
}

impl Detector for Displacement {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        let moved = self.reference.moved(monitor, report);
        if moved.len() < LEAST_COUNT {
            return 0.0;
        }
        let sum_px: f64 = moved.iter().map(|m| m.by_px.length()).sum();
        sum_px / moved.len() as f64 / monitor.sensor().pitch_px
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_PITCH
    }

    fn restart(&mut self) {
        self.reference.restart();
    }
}
