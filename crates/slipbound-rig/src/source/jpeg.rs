//! Strict JPEG: an image is complete or it is torn.
//!
//! ```text
//!   FFD8 | FFE0 APP0 | FFDB DQT | FFC0 SOF | FFC4 DHT | FFDA SOS | entropy coded ... | FFD9
//!                                            ^ many UVC cameras leave it out: the standard tables are put in
//! ```

use super::picture_size::checked_size;
use slipbound::port::{FrameBuffer, PixelFormat};
use std::borrow::Cow;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// Width and height beyond which a header counts as damaged: the largest a sensor file may state.
const MAX_SIDE_PX: usize = 8192;

/// Whether the bytes begin as a JPEG does.
pub(super) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8])
}

/// Decodes a complete JPEG into `into.pixels`; the error says what is wrong with it.
pub(super) fn decode(bytes: &[u8], into: &mut FrameBuffer) -> Result<(), String> {
    let layout = layout(bytes)?;
    if !layout.ends {
        return Err(format!("JPEG cut off: {} bytes without an end-of-image marker", bytes.len()));
    }
    let bytes = if layout.has_huffman_tables { Cow::Borrowed(bytes) } else { with_standard_tables(bytes, layout.scan) };
    let text = |e: zune_jpeg::errors::DecodeErrors| format!("JPEG: {e:?}");
    let options =
        DecoderOptions::default().set_strict_mode(true).set_max_width(MAX_SIDE_PX).set_max_height(MAX_SIDE_PX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes.as_ref()), options);
    decoder.decode_headers().map_err(text)?;
    let (format, colours) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (PixelFormat::Gray, ColorSpace::Luma),
        _ => (PixelFormat::Rgb, ColorSpace::RGB),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(colours));
    let info = decoder.info().ok_or("JPEG: no header")?;
    let size = checked_size(usize::from(info.width), usize::from(info.height)).map_err(|why| format!("JPEG: {why}"))?;
    into.pixels.resize(size.area() * format.bytes_per_pixel(), 0);
    decoder.decode_into(&mut into.pixels).map_err(text)?;
    into.format = format;
    into.size = size;
    Ok(())
}

/// What the segments of a JPEG state before anything is decoded.
struct Layout {
    /// Offset of the first start-of-scan marker.
    scan: usize,
    /// Whether a Huffman table comes before it.
    has_huffman_tables: bool,
    /// Whether an end-of-image marker follows it. The decoder alone would accept a cut in the last rows.
    ends: bool,
}

/// Walks the segments up to the first scan.
fn layout(bytes: &[u8]) -> Result<Layout, String> {
    if !is_jpeg(bytes) {
        return Err(format!("not a JPEG: begins with {:02X?}", &bytes[..bytes.len().min(4)]));
    }
    let cut = |at: usize| format!("JPEG cut off in its header: {at} bytes");
    let mut at = 2;
    let mut has_huffman_tables = false;
    loop {
        let [marker, code] = *bytes.get(at..).and_then(|b| b.first_chunk()).ok_or_else(|| cut(bytes.len()))?;
        if marker != 0xFF {
            return Err(format!("JPEG: expected a marker at byte {at}, got {marker:02X}"));
        }
        match code {
            0xFF => at += 1,               // fill byte
            0x01 | 0xD0..=0xD8 => at += 2, // markers without a length
            0xD9 => return Err("JPEG ends before its image".into()),
            0xDA => {
                let ends = bytes[at..].windows(2).any(|pair| pair == [0xFF, 0xD9]);
                return Ok(Layout { scan: at, has_huffman_tables, ends });
            }
            _ => {
                has_huffman_tables |= code == 0xC4;
                let length = bytes.get(at + 2..).and_then(|b| b.first_chunk()).ok_or_else(|| cut(bytes.len()))?;
                at += 2 + usize::from(u16::from_be_bytes(*length));
            }
        }
    }
}

/// The same JPEG with the standard Huffman tables (ITU-T T.81, annex K.3) in front of its scan.
fn with_standard_tables(bytes: &[u8], scan: usize) -> Cow<'_, [u8]> {
    let mut out = Vec::with_capacity(bytes.len() + 420);
    out.extend_from_slice(&bytes[..scan]);
    for (class_and_id, counts, values) in [
        (0x00, &DC_LUMA_COUNTS, &DC_VALUES[..]),
        (0x10, &AC_LUMA_COUNTS, &AC_LUMA_VALUES[..]),
        (0x01, &DC_CHROMA_COUNTS, &DC_VALUES[..]),
        (0x11, &AC_CHROMA_COUNTS, &AC_CHROMA_VALUES[..]),
    ] {
        let length = 2 + 1 + counts.len() + values.len();
        out.extend_from_slice(&[0xFF, 0xC4, (length >> 8) as u8, length as u8, class_and_id]);
        out.extend_from_slice(counts);
        out.extend_from_slice(values);
    }
    out.extend_from_slice(&bytes[scan..]);
    Cow::Owned(out)
}

// Number of codes of 1 to 16 bits (tables K.3 to K.6), then their values.
const DC_LUMA_COUNTS: [u8; 16] = [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0];
const DC_CHROMA_COUNTS: [u8; 16] = [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0];
const DC_VALUES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
const AC_LUMA_COUNTS: [u8; 16] = [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7D];
const AC_CHROMA_COUNTS: [u8; 16] = [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77];
#[rustfmt::skip]
const AC_LUMA_VALUES: [u8; 162] = [
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71,
    0x14, 0x32, 0x81, 0x91, 0xA1, 0x08, 0x23, 0x42, 0xB1, 0xC1, 0x15, 0x52, 0xD1, 0xF0, 0x24, 0x33, 0x62, 0x72,
    0x82, 0x09, 0x0A, 0x16, 0x17, 0x18, 0x19, 0x1A, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x34, 0x35, 0x36, 0x37,
    0x38, 0x39, 0x3A, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4A, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59,
    0x5A, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6A, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7A, 0x83,
    0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8A, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9A, 0xA2, 0xA3,
    0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9, 0xAA, 0xB2, 0xB3, 0xB4, 0xB5, 0xB6, 0xB7, 0xB8, 0xB9, 0xBA, 0xC2, 0xC3,
    0xC4, 0xC5, 0xC6, 0xC7, 0xC8, 0xC9, 0xCA, 0xD2, 0xD3, 0xD4, 0xD5, 0xD6, 0xD7, 0xD8, 0xD9, 0xDA, 0xE1, 0xE2,
    0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9, 0xEA, 0xF1, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7, 0xF8, 0xF9, 0xFA,
];
#[rustfmt::skip]
const AC_CHROMA_VALUES: [u8; 162] = [
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22,
    0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xA1, 0xB1, 0xC1, 0x09, 0x23, 0x33, 0x52, 0xF0, 0x15, 0x62, 0x72, 0xD1,
    0x0A, 0x16, 0x24, 0x34, 0xE1, 0x25, 0xF1, 0x17, 0x18, 0x19, 0x1A, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x35, 0x36,
    0x37, 0x38, 0x39, 0x3A, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4A, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58,
    0x59, 0x5A, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6A, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7A,
    0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8A, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9A,
    0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9, 0xAA, 0xB2, 0xB3, 0xB4, 0xB5, 0xB6, 0xB7, 0xB8, 0xB9, 0xBA,
    0xC2, 0xC3, 0xC4, 0xC5, 0xC6, 0xC7, 0xC8, 0xC9, 0xCA, 0xD2, 0xD3, 0xD4, 0xD5, 0xD6, 0xD7, 0xD8, 0xD9, 0xDA,
    0xE2, 0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9, 0xEA, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7, 0xF8, 0xF9, 0xFA,
];

#[cfg(test)]
mod tests {
    use super::*;
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    use slipbound::image::SizePx;

    /// A scene with detail in every row, so that a lost row shows.
    fn picture(colour: ColorType, channels: usize) -> Vec<u8> {
        let pixels: Vec<u8> = (0..64 * 48 * channels).map(|i| ((i * 7) % 251) as u8 ^ (i / 97) as u8).collect();
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, 85);
        encoder.set_sampling_factor(SamplingFactor::F_1_1);
        encoder.encode(&pixels, 64, 48, colour).expect("encodes");
        jpeg
    }

    fn decoded(bytes: &[u8]) -> Result<FrameBuffer, String> {
        let mut frame = FrameBuffer::default();
        decode(bytes, &mut frame).map(|()| frame)
    }

    #[test]
    fn colour_and_grey_keep_their_kind() {
        let colour = decoded(&picture(ColorType::Rgb, 3)).expect("whole");
        assert_eq!((colour.format, colour.size, colour.pixels.len()), (PixelFormat::Rgb, SizePx::new(64, 48), 9216));
        let grey = decoded(&picture(ColorType::Luma, 1)).expect("whole");
        assert_eq!((grey.format, grey.size, grey.pixels.len()), (PixelFormat::Gray, SizePx::new(64, 48), 3072));
    }

    #[test]
    fn cut_anywhere_it_is_torn() {
        let whole = picture(ColorType::Rgb, 3);
        for cut in 0..whole.len() {
            assert!(decoded(&whole[..cut]).is_err(), "cut at {cut} of {} passed as whole", whole.len());
        }
        let reason = decoded(&whole[..whole.len() * 2 / 3]).expect_err("torn");
        assert!(reason.contains("cut off") && reason.contains("end-of-image"), "{reason}");
    }

    #[test]
    fn zeros_after_the_end_do_no_harm() {
        let mut padded = picture(ColorType::Rgb, 3);
        let whole = decoded(&padded).expect("whole").pixels;
        padded.extend_from_slice(&[0; 100]); // as UVC cameras fill their buffers
        assert_eq!(decoded(&padded).expect("whole").pixels, whole);
    }

    #[test]
    fn missing_huffman_tables_are_the_standard_ones() {
        let whole = picture(ColorType::Rgb, 3);
        let mut bare = whole[..2].to_vec();
        let mut at = 2;
        while whole[at + 1] != 0xDA {
            let end = at + 2 + usize::from(u16::from_be_bytes([whole[at + 2], whole[at + 3]]));
            if whole[at + 1] != 0xC4 {
                bare.extend_from_slice(&whole[at..end]);
            }
            at = end;
        }
        bare.extend_from_slice(&whole[at..]);
        assert!(bare.len() + 400 < whole.len(), "no table was taken out");
        assert_eq!(decoded(&bare).expect("decodes").pixels, decoded(&whole).expect("whole").pixels);
    }
}
