//! What every rival is.

use slipbound::monitor::{SlipMonitor, SlipReport};

/// Whatever says from the monitor's findings whether slip is near.
pub trait Detector: Send {
    /// Judges a frame that the monitor has just seen: the score, a finite number.
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64;

    /// The score above which it raises the alarm.
    fn threshold(&self) -> f64;

    /// Counts from the frame it has seen last, as when the paper takes its reference once the object is held.
    fn restart(&mut self);

    /// Whether a frame with this score raises the alarm.
    fn alarms(&self, score: f64, report: &SlipReport) -> bool {
        let _ = report;
        score > self.threshold()
    }
}
