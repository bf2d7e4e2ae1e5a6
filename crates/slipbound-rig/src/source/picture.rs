//! Decodes one encoded image. The content decides the format, not the name of the file.

use super::jpeg;
use super::picture_size::checked_size;
use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, PixelFormat};

/// Decodes `into.encoded`, a JPEG or PNG image, into `into.pixels`; the error says what is wrong with it.
pub fn decode(into: &mut FrameBuffer) -> Result<(), String> {
    let encoded = std::mem::take(&mut into.encoded);
    let done = if encoded.is_empty() {
        Err("empty: zero bytes".into())
    } else if jpeg::is_jpeg(&encoded) {
        jpeg::decode(&encoded, into)
    } else if encoded.starts_with(b"\x89PNG") {
        decode_png(&encoded, into)
    } else {
        Err(format!("neither JPEG nor PNG: begins with {:02X?}", &encoded[..encoded.len().min(4)]))
    };
    into.encoded = encoded;
    done
}

/// Encodes `into.pixels` as a PNG into `into.encoded`, fast rather than small; the error says why that fails.
pub(super) fn encode(into: &mut FrameBuffer) -> Result<(), String> {
    let text = |e: png::EncodingError| format!("PNG: {e}");
    let side =
        |px: usize| u32::try_from(px).map_err(|_| format!("PNG: expected an image of fewer pixels, got {}", into.size));
    let mut encoded = std::mem::take(&mut into.encoded);
    let mut encoder = png::Encoder::new(&mut encoded, side(into.size.width)?, side(into.size.height)?);
    encoder.set_color(match into.format {
        PixelFormat::Gray => png::ColorType::Grayscale,
        PixelFormat::Rgb => png::ColorType::Rgb,
    });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&into.pixels)).map_err(text)?;
    into.encoded = encoded;
    Ok(())
}

/// Decodes a PNG: palettes spread out, 16 bits reduced to 8, transparency dropped.
fn decode_png(bytes: &[u8], into: &mut FrameBuffer) -> Result<(), String> {
    let text = |e: png::DecodingError| format!("PNG: {e}");
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(bytes), png::Limits { bytes: 512 << 20 });
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(text)?;
    let header = reader.info();
    checked_size(header.width as usize, header.height as usize).map_err(|why| format!("PNG: {why}"))?;
    let bytes_count = reader.output_buffer_size().ok_or("PNG: larger than memory")?;
    into.pixels.resize(bytes_count, 0);
    let info = reader.next_frame(&mut into.pixels).map_err(text)?;
    into.pixels.truncate(info.buffer_size());
    into.size = SizePx::new(info.width as usize, info.height as usize);
    let (format, stored) = match info.color_type {
        png::ColorType::Grayscale => (PixelFormat::Gray, 1),
        png::ColorType::GrayscaleAlpha => (PixelFormat::Gray, 2),
        png::ColorType::Rgba => (PixelFormat::Rgb, 4),
        png::ColorType::Rgb | png::ColorType::Indexed => (PixelFormat::Rgb, 3),
    };
    into.format = format;
    drop_last_channel(&mut into.pixels, stored, format.bytes_per_pixel());
    Ok(())
}

/// Closes the gaps that a dropped transparency channel leaves.
fn drop_last_channel(pixels: &mut Vec<u8>, stored: usize, kept: usize) {
    if stored == kept {
        return;
    }
    let count = pixels.len() / stored;
    for i in 0..count {
        pixels.copy_within(i * stored..i * stored + kept, i * kept);
    }
    pixels.truncate(count * kept);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png_of(colour: png::ColorType, depth: png::BitDepth, bytes: &[u8]) -> FrameBuffer {
        let mut encoded = Vec::new();
        let mut encoder = png::Encoder::new(&mut encoded, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.write_header().and_then(|mut w| w.write_image_data(bytes)).expect("writes");
        FrameBuffer { encoded, ..FrameBuffer::default() }
    }

    #[test]
    fn every_kind_of_png_becomes_grey_or_rgb_bytes() {
        use png::{BitDepth::*, ColorType::*};
        for (colour, depth, bytes, format, expected) in [
            (Grayscale, Eight, vec![1, 2], PixelFormat::Gray, vec![1, 2]),
            (GrayscaleAlpha, Eight, vec![1, 9, 2, 9], PixelFormat::Gray, vec![1, 2]),
            (Grayscale, Sixteen, vec![1, 0, 2, 0], PixelFormat::Gray, vec![1, 2]),
            (Rgb, Eight, vec![1, 2, 3, 4, 5, 6], PixelFormat::Rgb, vec![1, 2, 3, 4, 5, 6]),
            (Rgba, Eight, vec![1, 2, 3, 9, 4, 5, 6, 9], PixelFormat::Rgb, vec![1, 2, 3, 4, 5, 6]),
        ] {
            let mut frame = png_of(colour, depth, &bytes);
            decode(&mut frame).expect("decodes");
            assert_eq!((frame.format, frame.size), (format, SizePx::new(2, 1)), "{colour:?}");
            assert_eq!(frame.pixels, expected, "{colour:?} {depth:?}");
        }
    }

    /// A header alone that states a huge size is refused before a buffer is allocated.
    #[test]
    fn a_header_that_says_too_many_pixels_makes_no_buffer() {
        for side_px in [60_000u32, 5_800] {
            let mut frame = png_of(png::ColorType::Rgb, png::BitDepth::Eight, &[9; 6]);
            frame.encoded[16..20].copy_from_slice(&side_px.to_be_bytes());
            frame.encoded[20..24].copy_from_slice(&side_px.to_be_bytes());
            let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&frame.encoded[12..29]);
            frame.encoded[29..33].copy_from_slice(&crc.to_be_bytes());
            let why = decode(&mut frame).expect_err("refused");
            assert!(why.contains(&format!("pixels, got {side_px} x {side_px}")), "{why}");
            assert_eq!(frame.pixels.capacity(), 0);
        }
        for (width_px, height_px) in [(0, 5), (5, 0), (usize::MAX, 2), (1 << 25, 2)] {
            assert!(checked_size(width_px, height_px).is_err());
        }
        assert!(checked_size(8192, 4096).is_ok());
    }

    #[test]
    fn a_cut_png_and_other_bytes_are_torn() {
        let whole = png_of(png::ColorType::Rgb, png::BitDepth::Eight, &[9; 6]);
        let mut cut = FrameBuffer { encoded: whole.encoded[..whole.encoded.len() - 20].to_vec(), ..whole };
        assert!(decode(&mut cut).expect_err("torn").starts_with("PNG"));
        cut.encoded = b"GIF89a".to_vec();
        assert!(decode(&mut cut).expect_err("torn").contains("neither JPEG nor PNG"));
        cut.encoded.clear();
        assert_eq!(decode(&mut cut).expect_err("torn"), "empty: zero bytes");
    }
}
