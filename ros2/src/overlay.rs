//! Overlay images, drawn on a separate thread so that no report waits for them.

use crate::msg::{CompressedImage, Header};
use jpeg_encoder::{ColorType, Encoder};
use ros2_client::Publisher;
use slipbound::image::SizePx;
use slipbound::monitor::{Reason, SlipMonitor, SlipReport};
use slipbound::port::FrameBuffer;
use slipbound_rig::overlay::Overlay;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// Largest JPEG, bytes: with its header it fits into one UDP datagram's worth of fragments that best effort seldom
/// loses.
pub const MOST_BYTES: usize = 64_000;

/// Qualities tried in order, then again at half the size.
const QUALITIES: [u8; 4] = [80, 60, 40, 25];

struct Job {
    header: Header,
    /// None where it is torn.
    frame: Option<FrameBuffer>,
    report: SlipReport,
    monitor: SlipMonitor,
}

/// Draws the newest image whenever it is free.
pub struct OverlayThread {
    to: SyncSender<Box<Job>>,
    free: Receiver<()>,
}

impl OverlayThread {
    /// A thread that publishes here. It ends when this is dropped.
    pub fn new(publisher: Publisher<CompressedImage>) -> Self {
        let (to, jobs) = sync_channel::<Box<Job>>(1);
        let (is_free, free) = sync_channel(1);
        let _ = is_free.send(()); // there is room for one
        thread::spawn(move || {
            let mut drawn: Option<Overlay> = None;
            for job in jobs {
                let Job { header, frame, report, monitor } = *job;
                let overlay = drawn.get_or_insert_with(|| Overlay::new(monitor.sensor()));
                let frame = frame.as_ref().and_then(|frame| frame.frame().ok());
                overlay.draw(frame.as_ref(), &report, &monitor);
                if let Some(data) = encode(overlay.rgb(), overlay.size()) {
                    let _ = publisher.publish(CompressedImage { header, format: "jpeg".into(), data }); // best effort
                }
                if is_free.send(()).is_err() {
                    return;
                }
            }
        });
        OverlayThread { to, free }
    }

    /// Shows an image that has just been judged, if the last one has been drawn. `frame` is the one before where it is torn.
    pub fn show(&mut self, header: Header, frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) {
        if self.free.try_recv().is_ok() {
            let frame = (report.reason != Some(Reason::Torn)).then(|| frame.clone());
            let job = Job { header, frame, report: *report, monitor: monitor.clone() };
            let _ = self.to.try_send(Box::new(job)); // the thread is gone: nothing is shown
        }
    }
}

/// A JPEG of at most [`MOST_BYTES`]; None if that is impossible.
pub fn encode(mut rgb: Vec<u8>, mut size: SizePx) -> Option<Vec<u8>> {
    while size.width > 0 && size.height > 0 {
        for quality in QUALITIES {
            let mut jpeg = Vec::new();
            let (width, height) = (u16::try_from(size.width).ok()?, u16::try_from(size.height).ok()?);
            Encoder::new(&mut jpeg, quality).encode(&rgb, width, height, ColorType::Rgb).ok()?;
            if jpeg.len() <= MOST_BYTES {
                return Some(jpeg);
            }
        }
        (rgb, size) = halved(&rgb, size);
    }
    None
}

/// Means of two by two pixels.
fn halved(rgb: &[u8], size: SizePx) -> (Vec<u8>, SizePx) {
    let half = SizePx::new(size.width / 2, size.height / 2);
    let at = |x: usize, y: usize, c: usize| u32::from(rgb[(y * size.width + x) * 3 + c]);
    let mut out = Vec::with_capacity(half.width * half.height * 3);
    for y in 0..half.height {
        for x in 0..half.width {
            for c in 0..3 {
                let sum = at(2 * x, 2 * y, c) + at(2 * x + 1, 2 * y, c) + at(2 * x, 2 * y + 1, c);
                out.push(((sum + at(2 * x + 1, 2 * y + 1, c) + 2) / 4) as u8);
            }
        }
    }
    (out, half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound_rig::source::decode_image;

    /// Noise is the worst case for JPEG.
    #[test]
    fn noise_is_halved_until_it_fits() {
        let size = SizePx::new(1280, 720);
        let mut state = 1u32;
        let rgb: Vec<u8> = std::iter::repeat_with(|| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .take(size.width * size.height * 3)
        .collect();
        let jpeg = encode(rgb, size).expect("fits");
        assert!(jpeg.len() <= MOST_BYTES, "{}", jpeg.len());
        let mut frame = FrameBuffer { encoded: jpeg, ..FrameBuffer::default() };
        decode_image(&mut frame).expect("whole");
        assert!(frame.size.width < size.width && frame.size.width * 9 == frame.size.height * 16, "{}", frame.size);
    }
}
