//! Frames as JPEG: every frame is encoded and decoded again, as in a recording.

use jpeg_encoder::{ImageBuffer, JpegColorType, SamplingFactor};
use slipbound::image::SizePx;
use slipbound::pixels::wide::wide;
use slipbound::port::{FrameBuffer, PixelFormat, SourceError, SourceErrorKind};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;

/// Encodes and decodes frames of one size.
#[derive(Debug, Clone, Copy)]
pub struct Codec {
    size: SizePx,
    quality: u8,
}

impl Codec {
    /// `quality`: 1 to 100. The size is at most 65535 px along each side.
    pub fn new(size: SizePx, quality: u8) -> Self {
        Codec { size, quality }
    }

    /// Rows of RGB pixels to a JPEG. Colour has half the resolution along x (4:2:2), as USB cameras send it. Fails if
    /// there are fewer pixels than the size requires.
    pub fn encode(&self, rgb: &[u8], into: &mut Vec<u8>) -> Result<(), SourceError> {
        let SizePx { width, height } = self.size;
        let expected = 3 * self.size.area();
        if rgb.len() != expected {
            let why = format!("JPEG: expected {expected} bytes of RGB, got {}", rgb.len());
            return Err(SourceError::new(SourceErrorKind::Format, why));
        }
        into.clear();
        let mut encoder = jpeg_encoder::Encoder::new(into, self.quality);
        encoder.set_sampling_factor(SamplingFactor::F_2_1);
        let side = |px: usize| u16::try_from(px).map_err(|e| SourceError::new(SourceErrorKind::Format, e));
        let picture = Paired { rgb, width: side(width)?, height: side(height)? };
        encoder.encode_image(picture).map_err(|e| SourceError::new(SourceErrorKind::Format, e))
    }

    /// `into.encoded` to `into.pixels`. Fails if it is not a JPEG of this size.
    pub fn decode(&self, into: &mut FrameBuffer) -> Result<(), SourceError> {
        let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
        let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(into.encoded.as_slice()), options);
        into.pixels.resize(3 * self.size.area(), 0);
        decoder
            .decode_into(&mut into.pixels)
            .map_err(|error| SourceError::new(SourceErrorKind::Format, format!("JPEG: {error:?}")))?;
        into.format = PixelFormat::Rgb;
        into.size = self.size;
        Ok(())
    }
}

/// RGB as luma and chroma; both pixels of a pair have the chroma of their mean.
///
/// The encoder then keeps the first chroma sample of each pair. Without pairing it would keep that of the left pixel,
/// and all colour would be shifted half a pixel to the right, because decoders place the sample in the middle of the
/// pair. The encoder's own averaging has the same result, with a division for every value.
struct Paired<'a> {
    rgb: &'a [u8],
    width: u16,
    height: u16,
}

/// Pixels converted at a time; an even number.
const CHUNK_PX: usize = 256;

impl ImageBuffer for Paired<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }

    fn width(&self) -> u16 {
        self.width
    }

    fn height(&self) -> u16 {
        self.height
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let line = 3 * usize::from(self.width);
        let row = &self.rgb[usize::from(y) * line..][..line];
        let mut converted = [[0; CHUNK_PX]; 3];
        for pixels in row.chunks(3 * CHUNK_PX) {
            convert(pixels, &mut converted);
            for (buffer, converted) in buffers.iter_mut().zip(&converted) {
                buffer.extend_from_slice(&converted[..pixels.len() / 3]);
            }
        }
    }
}

wide! {
    /// JFIF's Y, Cb and Cr of at most `CHUNK_PX` pixels, rounded to the nearest. With an odd number the last pixel is
    /// paired with itself.
    fn convert(pixels: &[u8], converted: &mut [[u8; CHUNK_PX]; 3]) {
        // Added to a number from 0 to 255.5, this leaves the nearest integer in the lowest bits of the sum.
        const WHOLE: f32 = (1 << 23) as f32;
        let ([mut red, mut green, mut blue], count) = ([[0u8; CHUNK_PX]; 3], pixels.len() / 3);
        let planes = red.iter_mut().zip(&mut green).zip(&mut blue);
        for (((r, g), b), pixel) in planes.zip(pixels.chunks_exact(3)) {
            (*r, *g, *b) = (pixel[0], pixel[1], pixel[2]);
        }
        if count % 2 == 1 {
            (red[count], green[count], blue[count]) = (red[count - 1], green[count - 1], blue[count - 1]);
        }
        let [luma, blues, reds] = converted;
        for (y, ((&r, &g), &b)) in luma[..count].iter_mut().zip(red.iter().zip(&green).zip(&blue)) {
            *y = (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b) + WHOLE).to_bits() as u8;
        }
        let even = count.next_multiple_of(2);
        let pairs = red.chunks_exact(2).zip(green.chunks_exact(2)).zip(blue.chunks_exact(2));
        let out = blues[..even].chunks_exact_mut(2).zip(reds[..even].chunks_exact_mut(2));
        for ((blues, reds), ((r, g), b)) in out.zip(pairs) {
            // Of two pixels. 255.5, of pure blue or red, would be rounded up.
            let both = |pair: &[u8]| f32::from(u16::from(pair[0]) + u16::from(pair[1]));
            let (r, g, b) = (both(r), both(g), both(b));
            let blue = 128.0 - 0.084_368 * r - 0.165_632 * g + 0.25 * b;
            let red = 128.0 + 0.25 * r - 0.209_344 * g - 0.040_656 * b;
            let held = |level: f32| if level < 255.0 { level } else { 255.0 };
            let (blue, red) = ((held(blue) + WHOLE).to_bits() as u8, (held(red) + WHOLE).to_bits() as u8);
            (blues[0], blues[1], reds[0], reds[1]) = (blue, blue, red, red);
        }
    }
}
