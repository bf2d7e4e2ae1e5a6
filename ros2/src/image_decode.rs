//! Image messages -> frames of the library.

use crate::msg::{CompressedImage, Header, Image};
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, PixelFormat};
use slipbound_rig::source::decode_image;

/// An image as it was received.
#[derive(Debug, Clone)]
pub enum ReceivedImage {
    /// A JPEG or PNG file.
    Compressed(CompressedImage),
    /// Pixels.
    Raw(Image),
}

impl ReceivedImage {
    /// Its header.
    pub fn header(&self) -> &Header {
        match self {
            ReceivedImage::Compressed(image) => &image.header,
            ReceivedImage::Raw(image) => &image.header,
        }
    }

    /// Decodes it as frame number `seq`; its time is the header's stamp. On a failure, with the reason as text, number
    /// and time are set all the same.
    pub fn decode(self, seq: u64, into: &mut FrameBuffer) -> Result<(), String> {
        into.seq = seq;
        into.time_ns = self.header().stamp.ns();
        into.clock = if into.time_ns.is_some() { Clock::Container } else { Clock::Unknown };
        match self {
            ReceivedImage::Compressed(image) => {
                into.encoded = image.data;
                decode_image(into)
            }
            ReceivedImage::Raw(image) => {
                into.encoded.clear();
                unpack(&image, into)
            }
        }
    }
}

/// Rows of pixels without gaps, as grey or red, green, blue.
fn unpack(image: &Image, into: &mut FrameBuffer) -> Result<(), String> {
    let (format, swaps) = match image.encoding.as_str() {
        "mono8" | "8UC1" => (PixelFormat::Gray, false),
        "rgb8" => (PixelFormat::Rgb, false),
        "bgr8" | "8UC3" => (PixelFormat::Rgb, true), // 8UC3 is OpenCV's type, blue first
        other => return Err(format!("expected encoding rgb8, bgr8, mono8, 8UC1 or 8UC3, got `{other}`")),
    };
    let (width, height, step) = (image.width as usize, image.height as usize, image.step as usize);
    let row_bytes = width * format.bytes_per_pixel();
    let needed = step.checked_mul(height).filter(|_| step >= row_bytes && row_bytes > 0 && height > 0);
    let rows = needed.and_then(|bytes| image.data.get(..bytes)).ok_or_else(|| {
        let got = image.data.len();
        format!("expected {height} rows of at least {row_bytes} bytes, got step {step} and {got} bytes in all")
    })?;
    into.pixels.clear();
    for row in rows.chunks_exact(step) {
        into.pixels.extend_from_slice(&row[..row_bytes]);
    }
    if swaps {
        into.pixels.chunks_exact_mut(3).for_each(|pixel| pixel.swap(0, 2));
    }
    (into.format, into.size) = (format, SizePx::new(width, height));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::Time;

    fn image(encoding: &str, step: u32, data: &[u8]) -> ReceivedImage {
        let header = Header { stamp: Time { sec: 3, nanosec: 5 }, frame_id: "left".into() };
        let encoding = encoding.into();
        ReceivedImage::Raw(Image { header, height: 2, width: 1, encoding, is_bigendian: 0, step, data: data.to_vec() })
    }

    #[test]
    fn rows_lose_their_gaps_and_blue_comes_last() {
        let mut frame = FrameBuffer::default();
        image("bgr8", 4, &[1, 2, 3, 0, 4, 5, 6, 0]).decode(9, &mut frame).expect("whole");
        assert_eq!((frame.seq, frame.time_ns), (9, Some(3_000_000_005)));
        assert_eq!((frame.pixels.as_slice(), frame.size), (&[3, 2, 1, 6, 5, 4][..], SizePx::new(1, 2)));
        image("mono8", 1, &[7, 8]).decode(10, &mut frame).expect("whole");
        assert_eq!((frame.pixels.as_slice(), frame.format), (&[7, 8][..], PixelFormat::Gray));
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_number_and_time() {
        for (encoding, step, data) in [
            ("bgr8", 3, &[1, 2, 3, 4, 5][..]),
            ("rgb8", 2, &[0; 9]),
            ("mono16", 2, &[0; 4]),
            ("rgb8", u32::MAX, &[0; 9]),
        ] {
            let mut frame = FrameBuffer::default();
            let why = image(encoding, step, data).decode(4, &mut frame).expect_err("refused");
            assert!(why.starts_with("expected "), "{why}");
            assert_eq!((frame.seq, frame.time_ns), (4, Some(3_000_000_005)));
        }
        let cut = CompressedImage { data: vec![0xFF, 0xD8, 0xFF], ..CompressedImage::default() };
        let mut frame = FrameBuffer::default();
        let why = ReceivedImage::Compressed(cut).decode(1, &mut frame).expect_err("torn");
        assert!(why.contains("JPEG"), "{why}");
        assert_eq!(frame.time_ns, None, "a stamp of zero is none");
    }
}
