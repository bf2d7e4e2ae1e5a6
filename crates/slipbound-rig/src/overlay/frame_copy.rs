//! A frame and its results, copied so that another thread can draw them.

use super::drawing::Overlay;
use super::input::OverlayInput;
use slipbound::image::Mask;
use slipbound::monitor::{Marker, SlipReport};
use slipbound::pixels::morphology::Element;
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;
use std::mem;

/// A frame and its results. The buffers of the images are used again.
#[derive(Debug, Default)]
pub(crate) struct FrameCopy {
    results: Option<Results>,
    is_whole: bool,
    frame: FrameBuffer,
    /// The image as it stands in a file.
    pub encoded: Vec<u8>,
    /// Why it could not be encoded.
    pub refused: Option<String>,
}

#[derive(Debug)]
struct Results {
    report: SlipReport,
    sensor: Sensor,
    markers: Vec<Marker>,
    contact_region: Mask,
    inner_erosion: Option<Element>,
    alarm_margin: Option<f64>,
}

impl FrameCopy {
    /// Copies a frame, None when it did not arrive whole, and what was found on it.
    pub fn take(&mut self, frame: Option<&FrameBuffer>, report: &SlipReport, found: &OverlayInput<'_>) {
        self.is_whole = frame.is_some();
        if let Some(frame) = frame {
            let mut pixels = mem::take(&mut self.frame.pixels);
            pixels.clear();
            pixels.extend_from_slice(&frame.pixels);
            self.frame = FrameBuffer { pixels, format: frame.format, size: frame.size, ..FrameBuffer::default() };
        }
        self.results = Some(Results {
            report: *report,
            sensor: found.sensor.clone(),
            markers: found.markers.to_vec(),
            contact_region: found.contact_region.clone(),
            inner_erosion: found.inner_erosion.cloned(),
            alarm_margin: found.alarm_margin,
        });
    }

    /// Draws it.
    pub fn draw(&self, overlay: &mut Overlay) {
        let Some(results) = &self.results else { return };
        let Results { report, sensor, markers, contact_region, inner_erosion, alarm_margin } = results;
        let (inner_erosion, alarm_margin) = (inner_erosion.as_ref(), *alarm_margin);
        let found = OverlayInput { sensor, markers, contact_region, inner_erosion, alarm_margin };
        let whole = self.is_whole.then(|| self.frame.frame().ok()).flatten();
        overlay.draw(whole.as_ref(), report, found);
    }

    /// Number of the frame; 0 before one was taken.
    pub fn seq(&self) -> u64 {
        self.results.as_ref().map_or(0, |results| results.report.seq)
    }
}
