//! A picture twice: whole, as a PNG file, and small, as a JPEG for the page.

use crate::run::error::Error;
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use slipbound::image::Rgb;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use tiny_skia::{FilterQuality, Pixmap, PixmapPaint, PremultipliedColorU8, Transform};

/// A picture in the page is at most this wide.
const PAGE_WIDTH_PX: f32 = 1000.0;
/// JPEG quality in the page.
const PAGE_QUALITY: u8 = 80;

/// Writes the PNG; answers the JPEG.
pub(in crate::run) fn write(path: &Path, rgb: Rgb<'_>) -> Result<Vec<u8>, Error> {
    let size = rgb.size();
    let bytes: Vec<u8> = (0..size.height).flat_map(|y| rgb.row(y)).copied().collect();
    let failed = |source| Error::Write { path: path.to_owned(), source };
    let refused = |why: String| Error::Encode { path: path.to_owned(), why };
    let file = BufWriter::new(File::create(path).map_err(failed)?);
    let mut encoder = png::Encoder::new(file, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    let written = encoder.write_header().and_then(|mut w| {
        w.write_image_data(&bytes)?;
        w.finish()
    });
    written.map_err(|e| match e {
        png::EncodingError::IoError(source) => failed(source),
        other => refused(other.to_string()),
    })?;
    let (bytes, width, height) = smaller(&bytes, size.width as u32, size.height as u32)
        .ok_or_else(|| refused(format!("cannot scale a picture of {}x{} px", size.width, size.height)))?;
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, PAGE_QUALITY);
    encoder.set_sampling_factor(SamplingFactor::F_1_1); // thin coloured arrows
    let sides = u16::try_from(width).and_then(|width| Ok((width, u16::try_from(height)?)));
    let (width, height) = sides.map_err(|_| refused(format!("{width}x{height} px are too many for a JPEG")))?;
    encoder.encode(&bytes, width, height, ColorType::Rgb).map_err(|e| refused(e.to_string()))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;
    use zune_core::bytestream::ZCursor;
    use zune_jpeg::JpegDecoder;

    #[test]
    fn the_file_is_whole_and_the_page_gets_a_smaller_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, size) = (folder.path().join("a.png"), SizePx::new(2000, 30));
        let bytes: Vec<u8> = [200, 100, 50].repeat(size.area());
        let jpeg = write(&path, Rgb::new(&bytes, size).expect("whole")).expect("writes");
        let file = std::io::BufReader::new(File::open(&path).expect("opens"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("fits")];
        reader.next_frame(&mut pixels).expect("decodes");
        assert_eq!(pixels, bytes);
        let mut decoder = JpegDecoder::new(ZCursor::new(jpeg.as_slice()));
        let pixels = decoder.decode().expect("a JPEG");
        assert_eq!(decoder.dimensions(), Some((1000, 15)));
        let middle = &pixels[3 * (7 * 1000 + 500)..][..3];
        assert!(middle.iter().zip([200u8, 100, 50]).all(|(got, wanted)| got.abs_diff(wanted) <= 3), "{middle:?}");
    }
}
