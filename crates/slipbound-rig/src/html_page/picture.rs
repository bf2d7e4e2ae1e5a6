//! An image small enough for a page.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use tiny_skia::{FilterQuality, Pixmap, PixmapPaint, PremultipliedColorU8, Transform};

/// An image in the page is at most this wide.
const PAGE_WIDTH_PX: f32 = 1000.0;
/// JPEG quality in the page.
const PAGE_QUALITY: u8 = 80;

/// A JPEG for the page of red, green and blue in rows without gaps. The error says why there is none.
pub(crate) fn jpeg(rgb: &[u8], width: u32, height: u32) -> Result<Vec<u8>, String> {
    let (bytes, width, height) =
        smaller(rgb, width, height).ok_or_else(|| format!("cannot scale a picture of {width}x{height} px"))?;
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, PAGE_QUALITY);
    encoder.set_sampling_factor(SamplingFactor::F_1_1); // thin coloured arrows
    let sides = u16::try_from(width).and_then(|width| Ok((width, u16::try_from(height)?)));
    let (width, height) = sides.map_err(|_| format!("{width}x{height} px are too many for a JPEG"))?;
    encoder.encode(&bytes, width, height, ColorType::Rgb).map_err(|e| e.to_string())?;
    Ok(jpeg)
}

/// At most [`PAGE_WIDTH_PX`] wide; None for a size that there is no memory for.
fn smaller(rgb: &[u8], width: u32, height: u32) -> Option<(Vec<u8>, u32, u32)> {
    let scale = (PAGE_WIDTH_PX / width as f32).min(1.0);
    if scale == 1.0 {
        return Some((rgb.to_vec(), width, height));
    }
    let mut whole = Pixmap::new(width, height)?;
    for (to, from) in whole.pixels_mut().iter_mut().zip(rgb.as_chunks::<3>().0) {
        *to = PremultipliedColorU8::from_rgba(from[0], from[1], from[2], 255)?;
    }
    let mut small = Pixmap::new((width as f32 * scale).round() as u32, ((height as f32 * scale) as u32).max(1))?;
    let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
    small.draw_pixmap(0, 0, whole.as_ref(), &paint, Transform::from_scale(scale, scale), None);
    let bytes = small.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    Some((bytes, small.width(), small.height()))
}
