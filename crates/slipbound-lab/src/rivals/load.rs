//! The rule that uses load alone: tangential load over an assumed friction.

use super::detector::Detector;
use slipbound::monitor::{FEATURE_NAMES, SlipMonitor, SlipReport};

/// Used fraction above which it raises an alarm: that of the shipped verdict (deviation D16).
const THRESHOLD_FRACTION: f64 = 0.5;

/// Score: force and torque from all markers over what the grip force can hold at a friction coefficient of 0.6,
/// dimensionless (the feature `load`, see [`FEATURE_NAMES`]); 0 without a grip force or a contact.
///
/// It measures load, not slip: correct at a friction of 0.6, late at a lower one, a false alarm at a higher one.
#[derive(Debug, Clone, Copy, Default)]
pub struct Load;

impl Detector for Load {
    fn see(&mut self, monitor: &SlipMonitor, _: &SlipReport) -> f64 {
        let load = FEATURE_NAMES.iter().position(|name| *name == "load");
        let value = load.zip(monitor.features()).map(|(at, features)| features[at]);
        value.filter(|value| value.is_finite()).unwrap_or(0.0)
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_FRACTION
    }

    /// A load needs no reference.
    fn restart(&mut self) {}
}
