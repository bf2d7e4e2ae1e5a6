//! Strict JPEG: an image is complete or it is torn.
//!
//! ```text
//!   FFD8 | FFE0 APP0 | FFDB DQT | FFC0 SOF | FFC4 DHT | FFDA SOS | entropy coded ... | FFD9
//!                                            ^ many UVC cameras leave it out: the standard tables are put in
//!                                                                                    ^ one bits are put in
//! ```
//!
//! A camera that loses a packet leaves out a piece of the entropy-coded data, and the end marker follows all the same.
//! The decoder would fill up what is missing with grey. No Huffman code consists of one bits only (ITU-T T.81, C.2), so
//! with such bits in front of the end marker a decoder that needs more data meets an invalid code. Restart markers are
//! counted. Not noticed: a loss of a few bytes that happens to leave as many blocks, a loss between two restart markers,
//! and one inside a progressive JPEG, which cameras do not send.

use super::picture_size::checked_size;
use slipbound::port::{FrameBuffer, PixelFormat};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

/// Any side a header can state: the number of pixels is limited, before anything is decoded.
const MOST_SIDE_PX: usize = u16::MAX as usize;

/// Whether the bytes begin as a JPEG does.
pub(super) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8])
}

/// Decodes a complete JPEG into `into.pixels`; the error says what is wrong with it.
pub(super) fn decode(bytes: &[u8], into: &mut FrameBuffer) -> Result<(), String> {
    let layout = layout(bytes)?;
    let bytes = prepared(bytes, &layout);
    let text = |e: DecodeErrors| format!("JPEG: {}", in_words(&e));
    let options =
        DecoderOptions::default().set_strict_mode(true).set_max_width(MOST_SIDE_PX).set_max_height(MOST_SIDE_PX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes.as_slice()), options);
    decoder.decode_headers().map_err(text)?;
    let (format, colours) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (PixelFormat::Gray, ColorSpace::Luma),
        _ => (PixelFormat::Rgb, ColorSpace::RGB),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(colours));
    let info = decoder.info().ok_or("JPEG: no header")?;
    let size = checked_size(usize::from(info.width), usize::from(info.height)).map_err(|why| format!("JPEG: {why}"))?;
    into.pixels.resize(size.area() * format.bytes_per_pixel(), 0);
    let damaged = |e: DecodeErrors| format!("JPEG: damaged, or a piece is missing ({})", in_words(&e));
    decoder.decode_into(&mut into.pixels).map_err(damaged)?;
    into.format = format;
    into.size = size;
    Ok(())
}

/// The EXIF orientation that a JPEG states: 1 for an upright image, 2 to 8 for one to be mirrored or turned.
pub(super) fn orientation(bytes: &[u8]) -> Option<u16> {
    let mut decoder = JpegDecoder::new(ZCursor::new(bytes));
    decoder.decode_headers().ok()?;
    stated_orientation(decoder.exif()?)
}

/// The same from its EXIF data: the byte order, 42, and the place of a list of entries, each a tag, a type, a count and
/// a value.
fn stated_orientation(exif: &[u8]) -> Option<u16> {
    const TAG: u16 = 0x0112;
    let is_little = exif.starts_with(b"II");
    let u16_at = |at: usize| {
        let bytes = *exif.get(at..)?.first_chunk()?;
        Some(if is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    };
    let list = *exif.get(4..)?.first_chunk()?;
    let list = if is_little { u32::from_le_bytes(list) } else { u32::from_be_bytes(list) } as usize;
    let entries = (0..usize::from(u16_at(list)?)).map(|number| list + 2 + 12 * number);
    entries.into_iter().find(|at| u16_at(*at) == Some(TAG)).and_then(|at| u16_at(at + 8))
}

/// The decoder's reason, without the quotes that it puts round some.
fn in_words(e: &DecodeErrors) -> String {
    format!("{e:?}").trim_matches('"').to_owned()
}

/// One bits in front of the end marker, with the zero bytes that have to follow a byte of ones: more than a decoder
/// reads ahead.
const ONES: [u8; 32] = {
    let mut bytes = [0xFF; 32];
    let mut i = 1;
    while i < bytes.len() {
        bytes[i] = 0;
        i += 2;
    }
    bytes
};

/// What a JPEG consists of.
#[derive(Default)]
struct Layout {
    /// Offset of the first start-of-scan marker; 0 before it.
    scan: usize,
    /// Offset of the end-of-image marker.
    end: usize,
    /// Whether a Huffman table comes before the first scan.
    has_huffman_tables: bool,
    /// MCUs between restart markers; 0: there are none.
    restart_interval: usize,
    /// Components in the frame header, and MCUs of a scan of all of them.
    components_count: usize,
    mcus_count: usize,
}

impl Layout {
    /// Reads a frame header: precision, height, width, then of each component its name, sampling and table.
    fn see_frame_header(&mut self, header: &[u8]) -> Result<(), String> {
        let Some((&[_, h0, h1, w0, w1, count], components)) = header.split_first_chunk() else {
            return Err(format!("JPEG: expected a frame header of 6 bytes and more, got {}", header.len()));
        };
        let samplings = components.chunks_exact(3).map(|c| (usize::from(c[1] >> 4), usize::from(c[1] & 15)));
        // In an image of one component an MCU is a block, whatever sampling is stated.
        let (across, down) = match count {
            1 => (1, 1),
            _ => samplings.fold((1, 1), |most, s| (most.0.max(s.0), most.1.max(s.1))),
        };
        let [height, width] = [[h0, h1], [w0, w1]].map(|px| usize::from(u16::from_be_bytes(px)));
        checked_size(width, height).map_err(|why| format!("JPEG: {why}"))?;
        self.components_count = count.into();
        self.mcus_count = width.div_ceil(8 * across) * height.div_ceil(8 * down);
        Ok(())
    }

    /// Offset of the marker after the scan whose data begin at `from`. Its restart markers count from 0 to 7 again and
    /// again, and none is missing.
    fn scan_end(&mut self, bytes: &[u8], from: usize, components_count: usize) -> Result<usize, String> {
        let mut restarts_count = 0;
        let mut marker = None;
        for (at, pair) in bytes.windows(2).enumerate().skip(from).filter(|(_, pair)| pair[0] == 0xFF) {
            match pair[1] {
                0x00 => marker = None,
                0xFF => marker = marker.or(Some(at)), // fill byte
                0xD0..=0xD7 => {
                    let number = usize::from(pair[1] - 0xD0);
                    if number != restarts_count % 8 {
                        let expected = restarts_count % 8;
                        return Err(format!("JPEG: expected restart marker {expected} at byte {at}, got {number}"));
                    }
                    (restarts_count, marker) = (restarts_count + 1, None);
                }
                _ => {
                    let is_known = self.restart_interval > 0 && components_count == self.components_count;
                    let expected = self.mcus_count.saturating_sub(1).checked_div(self.restart_interval).unwrap_or(0);
                    // One more is no loss: some encoders also write one at the end.
                    if is_known && restarts_count > 0 && !(expected..=expected + 1).contains(&restarts_count) {
                        return Err(format!("JPEG: expected {expected} restart markers, got {restarts_count}"));
                    }
                    return Ok(marker.unwrap_or(at));
                }
            }
        }
        Err(format!("JPEG cut off: {} bytes without an end-of-image marker", bytes.len()))
    }
}

/// Walks the segments and scans up to the end of the image; the error says what is missing.
fn layout(bytes: &[u8]) -> Result<Layout, String> {
    if !is_jpeg(bytes) {
        return Err(format!("not a JPEG: begins with {:02X?}", &bytes[..bytes.len().min(4)]));
    }
    let mut layout = Layout::default();
    let mut at = 2;
    loop {
        let part = if layout.scan == 0 { "in its header" } else { "between its scans" };
        let cut = || format!("JPEG cut off {part}: {} bytes", bytes.len());
        let [marker, code] = *bytes.get(at..).and_then(|b| b.first_chunk()).ok_or_else(cut)?;
        if marker != 0xFF {
            return Err(format!("JPEG: expected a marker at byte {at}, got {marker:02X}"));
        }
        match code {
            0xFF => at += 1,               // fill byte
            0x01 | 0xD0..=0xD8 => at += 2, // markers without a length
            0xD9 if layout.scan == 0 => return Err("JPEG ends before its image".into()),
            0xD9 => {
                layout.end = at;
                return Ok(layout);
            }
            _ => {
                let length = bytes.get(at + 2..).and_then(|b| b.first_chunk()).ok_or_else(cut)?;
                let next = at + 2 + usize::from(u16::from_be_bytes(*length));
                let segment = bytes.get(at + 4..next).ok_or_else(cut)?;
                match code {
                    0xC4 => layout.has_huffman_tables |= layout.scan == 0,
                    0xC0..=0xC2 => layout.see_frame_header(segment)?,
                    0xDA if layout.scan == 0 => layout.scan = at,
                    0xDD => {
                        layout.restart_interval = segment.first_chunk().map_or(0, |n| u16::from_be_bytes(*n)).into()
                    }
                    _ => {}
                }
                at = match code {
                    0xDA => layout.scan_end(bytes, next, segment.first().copied().unwrap_or(0).into())?,
                    _ => next,
                };
            }
        }
    }
}

/// The JPEG up to its end, with the standard Huffman tables (ITU-T T.81, annex K.3) in front of its scan if it has none,
/// and one bits in front of its end.
fn prepared(bytes: &[u8], layout: &Layout) -> Vec<u8> {
    let mut out = Vec::with_capacity(layout.end + 500);
    out.extend_from_slice(&bytes[..layout.scan]);
    if !layout.has_huffman_tables {
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
    }
    out.extend_from_slice(&bytes[layout.scan..layout.end]);
    out.extend_from_slice(&ONES);
    out.extend_from_slice(&[0xFF, 0xD9]);
    out
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

    /// As where a server ends what arrived with an end marker, and where a camera loses a packet.
    #[test]
    fn with_bytes_missing_inside_its_image_it_is_torn() {
        for (sampling, colour, channels, restart_interval) in [
            (SamplingFactor::F_1_1, ColorType::Rgb, 3, 0),
            (SamplingFactor::F_2_1, ColorType::Rgb, 3, 0),
            (SamplingFactor::F_2_2, ColorType::Rgb, 3, 4),
            (SamplingFactor::F_1_1, ColorType::Luma, 1, 0),
            (SamplingFactor::F_1_1, ColorType::Luma, 1, 3),
        ] {
            let name = format!("{sampling:?} {colour:?}, restarts {restart_interval}");
            let level = |i: usize| (128.0 + 40.0 * (i as f64 * 0.013).sin() + 30.0 * (i as f64 * 0.0007).cos()) as u8;
            let pixels: Vec<u8> = (0..128 * 96 * channels).map(|i| level(i) ^ (i / 3 % 4) as u8).collect();
            let mut whole = Vec::new();
            let mut encoder = Encoder::new(&mut whole, 85);
            encoder.set_sampling_factor(sampling);
            if restart_interval > 0 {
                encoder.set_restart_interval(restart_interval);
            }
            encoder.encode(&pixels, 128, 96, colour).expect("encodes");
            decoded(&whole).unwrap_or_else(|why| panic!("{name}: {why}"));
            if restart_interval > 0 {
                let restarts_count = whole.windows(2).filter(|b| b[0] == 0xFF && (0xD0..=0xD7).contains(&b[1])).count();
                let one_more = [0xFF, 0xD0 + (restarts_count % 8) as u8, 0xFF, 0xD9];
                decoded(&[&whole[..whole.len() - 2], &one_more].concat()).expect("one at the end is no loss");
            }
            let (first, last) = (layout(&whole).expect("whole").scan + 30, whole.len() - 2);
            let (mut cut_count, mut lost_count, mut passed_count) = (0, 0, 0);
            for place in (first..last).step_by(7) {
                cut_count += 1;
                let ended = [&whole[..place], &[0xFF, 0xD9]].concat();
                assert!(decoded(&ended).is_err(), "{name}: cut at {place} of {last}");
                if place + 200 < last {
                    lost_count += 1;
                    passed_count += u32::from(decoded(&[&whole[..place], &whole[place + 200..]].concat()).is_ok());
                }
            }
            assert!(cut_count > 50 && 20 * passed_count <= lost_count, "{name}: {passed_count} of {lost_count} passed");
        }
    }

    #[test]
    fn a_header_that_says_too_many_pixels_is_refused() {
        let mut huge = picture(ColorType::Rgb, 3);
        let header = huge.windows(2).position(|pair| pair == [0xFF, 0xC0]).expect("a frame header");
        huge[header + 5..header + 9].copy_from_slice(&[0xEA, 0x60, 0xEA, 0x60]);
        assert_eq!(decoded(&huge).expect_err("refused"), "JPEG: expected 1 to 33554432 pixels, got 60000 x 60000");
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
