//! What an overlay shows besides the report.

use slipbound::image::Mask;
use slipbound::monitor::{Marker, SlipMonitor};
use slipbound::pixels::morphology::Element;
use slipbound::sensor::Sensor;

/// The results on a frame, borrowed from the monitor that has just judged it, or from a copy.
#[derive(Debug, Clone, Copy)]
pub struct OverlayInput<'a> {
    /// The facts of the finger at the size of its frames.
    pub sensor: &'a Sensor,
    /// Every marker after the frame.
    pub markers: &'a [Marker],
    /// The contact region, rectified.
    pub contact_region: &'a Mask,
    /// The structuring element that erodes the contact region to the inner one; None without contact.
    pub inner_erosion: Option<&'a Element>,
    /// The margin at which incipient slip is reported; None where the markers over the threshold decide.
    pub alarm_margin: Option<f64>,
}

impl<'a> From<&'a SlipMonitor> for OverlayInput<'a> {
    fn from(monitor: &'a SlipMonitor) -> Self {
        OverlayInput {
            sensor: monitor.sensor(),
            markers: monitor.markers(),
            contact_region: monitor.contact_region(),
            inner_erosion: monitor.inner_erosion(),
            alarm_margin: monitor.settings().slip.alarm_margin(),
        }
    }
}
