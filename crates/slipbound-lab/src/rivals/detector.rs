//! Interface of every rival.

use slipbound::monitor::{SlipMonitor, SlipReport};

/// Detects from the monitor's results whether slip is near.
pub trait Detector: Send {
    /// Judges the frame that the monitor has just processed: the score, a finite number.
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64;

    /// The score above which it raises the alarm.
    fn threshold(&self) -> f64;

    /// Makes the last frame seen its reference, as the paper takes its reference once the object is held.
    fn restart(&mut self);

    /// Whether a frame with this score raises the alarm.
    fn alarms(&self, score: f64, report: &SlipReport) -> bool {
        let _ = report;
        score > self.threshold()
    }
}
