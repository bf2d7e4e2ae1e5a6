//! Reads the image of a message, of any known schema, into a frame.

use super::{cdr, foxglove};
use crate::source::decode_image;
use slipbound::image::SizePx;
use slipbound::pixels::{bgr, yuyv};
use slipbound::port::{FrameBuffer, PixelFormat};

/// The supported image schemas.
pub const SCHEMAS: [&str; 4] = [foxglove::COMPRESSED, foxglove::RAW, cdr::COMPRESSED, cdr::RAW];

/// Width and height beyond which a message counts as damaged: the largest a sensor file may state.
const MAX_SIDE_PX: u64 = 8192;

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
    let (width, height) = picture.size;
    if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
        return Err(format!("expected an image of 1 to {MAX_SIDE_PX} px, got {width}x{height}"));
    }
    into.size = SizePx::new(width as usize, height as usize);
    if picture.row_bytes > 16 * MAX_SIDE_PX {
        return Err(format!("expected rows of at most {} bytes, got {}", 16 * MAX_SIDE_PX, picture.row_bytes));
    }
    let row_bytes = picture.row_bytes as usize;
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
