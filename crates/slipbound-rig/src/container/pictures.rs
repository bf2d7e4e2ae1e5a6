//! Reads the image of a message, of any known schema, into a frame.

use super::{cdr, foxglove};
use crate::source::{checked_size, decode_image};
use slipbound::pixels::{bgr, yuyv};
use slipbound::port::{FrameBuffer, PixelFormat};

/// The supported image schemas.
pub const SCHEMAS: [&str; 4] = [foxglove::COMPRESSED, foxglove::RAW, cdr::COMPRESSED, cdr::RAW];

/// Puts the image of a message into `into` and returns its time, ns; the error says why it is torn.
pub fn read(schema: &str, encoding: &str, message: &[u8], into: &mut FrameBuffer) -> Result<Option<u64>, String> {
    into.encoded.clear();
    let picture = match (schema, encoding) {
        (foxglove::COMPRESSED | foxglove::RAW, "protobuf") => foxglove::read(schema, message),
        (cdr::COMPRESSED | cdr::RAW, "cdr") => cdr::read(schema, message),
        _ => return Err(format!("expected {schema} in protobuf (foxglove) or CDR (ROS 2), got `{encoding}`")),
    };
    let picture =
        picture.ok_or_else(|| format!("expected a message {schema}, got {} bytes that are none", message.len()))?;
    if schema == foxglove::COMPRESSED || schema == cdr::COMPRESSED {
        into.encoded.extend_from_slice(picture.bytes);
        decode_image(into)?;
        return Ok(picture.stamp_ns);
    }
    let [width_px, height_px, row_bytes] =
        [picture.size.0, picture.size.1, picture.row_bytes].map(|count| usize::try_from(count).unwrap_or(usize::MAX));
    into.size = checked_size(width_px, height_px)?;
    if row_bytes > picture.bytes.len() {
        return Err(format!("expected rows of at most {} bytes, the image's, got {row_bytes}", picture.bytes.len()));
    }
    let words = |e: slipbound::image::ImageError| e.to_string();
    into.format = if picture.encoding == "mono8" { PixelFormat::Gray } else { PixelFormat::Rgb };
    into.pixels.resize(into.size.area() * into.format.bytes_per_pixel(), 0);
    match picture.encoding {
        "mono8" => copy_rows::<1>(picture.bytes, into, row_bytes),
        "rgb8" => copy_rows::<3>(picture.bytes, into, row_bytes),
        "bgr8" => bgr::to_rgb(picture.bytes, into.size, row_bytes, &mut into.pixels).map_err(words),
        "yuyv" | "yuv422_yuy2" => yuyv::to_rgb(picture.bytes, into.size, row_bytes, &mut into.pixels).map_err(words),
        other => Err(format!("expected pixels as mono8, rgb8, bgr8 or yuyv, got `{other}`")),
    }?;
    Ok(picture.stamp_ns)
}

fn copy_rows<const CHANNELS: usize>(bytes: &[u8], into: &mut FrameBuffer, row_bytes: usize) -> Result<(), String> {
    let rows = slipbound::image::Interleaved::<CHANNELS>::with_stride(bytes, into.size, row_bytes);
    let rows = rows.map_err(|e| e.to_string())?;
    into.pixels.clear();
    (0..into.size.height).for_each(|y| into.pixels.extend_from_slice(rows.row(y)));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    /// The limit is that of every other decoder, and is checked before a buffer is allocated.
    #[test]
    fn a_message_that_says_too_many_pixels_makes_no_buffer() {
        let read_back = |width_px, height_px| {
            let (size, pixels) = (SizePx::new(width_px, height_px), vec![7; 6]);
            let (schema, bytes) = foxglove::write(&FrameBuffer { pixels, size, ..FrameBuffer::default() }, "left", 0);
            let mut into = FrameBuffer::default();
            let why = read(schema, "protobuf", &bytes, &mut into).expect_err("refused");
            (why, into.pixels.capacity())
        };
        for side_px in [60_000, 5_800] {
            let expected = format!("expected 1 to 33554432 pixels, got {side_px} x {side_px}");
            assert_eq!(read_back(side_px, side_px), (expected, 0));
        }
        let (why, _) = read_back(10_000, 2);
        assert!(why.contains("expected rows of at most 6 bytes"), "long, but not too many pixels: {why}");
    }
}
