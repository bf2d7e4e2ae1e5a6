//! Frames as JPEG: every one is encoded and decoded again, as it would be in a recording.

use jpeg_encoder::{ImageBuffer, JpegColorType, SamplingFactor};
use slipbound::image::SizePx;
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

    /// Rows of RGB pixels to a JPEG. Colour has half the resolution along x (4:2:2), as USB cameras send it. Fails
    /// where there are fewer pixels than the size says.
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

    /// `into.encoded` to `into.pixels`. Fails on what is no JPEG of this size.
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

/// RGB as brightness and colour, each pair of pixels with the colour of its mean.
///
/// The encoder then keeps the first of each pair. Of unpaired colour that would be the colour of the left pixel: all
/// colour would lie half a pixel too far to the right, as decoders take it for the colour of the middle of the pair.
/// The encoder's own averaging does the same as this, with a division for every value.
struct Paired<'a> {
    rgb: &'a [u8],
    width: u16,
    height: u16,
}

/// Pixels converted at a time.
const CHUNK_PX: usize = 32;

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
        let whole = row.chunks_exact(3 * CHUNK_PX);
        let rest = whole.remainder();
        whole.for_each(|pixels| convert(pixels, CHUNK_PX, buffers));
        if !rest.is_empty() {
            // Beyond the border, the last pixel once more.
            let mut pixels = [0; 3 * CHUNK_PX];
            let last = [rest[rest.len() - 3], rest[rest.len() - 2], rest[rest.len() - 1]];
            pixels.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&last));
            pixels[..rest.len()].copy_from_slice(rest);
            convert(&pixels, rest.len() / 3, buffers);
        }
    }
}

/// JFIF's Y, Cb and Cr of the first `count` of some pixels, rounded to the nearest.
#[inline(always)]
fn convert(pixels: &[u8], count: usize, [luma, blue, red, _]: &mut [Vec<u8>; 4]) {
    // Added to a number from 0 to 255.5, this leaves the nearest whole number in the lowest bits of the sum.
    const WHOLE: f32 = (1 << 23) as f32;
    let mut planes = [[0.0f32; CHUNK_PX]; 3];
    for (i, pixel) in pixels[..3 * CHUNK_PX].chunks_exact(3).enumerate() {
        for c in 0..3 {
            planes[c][i] = f32::from(pixel[c]);
        }
    }
    let [r, g, b] = planes;
    let (mut y, mut cb, mut cr) = ([0u8; CHUNK_PX], [0u8; CHUNK_PX], [0u8; CHUNK_PX]);
    for i in 0..CHUNK_PX {
        y[i] = (0.299 * r[i] + 0.587 * g[i] + 0.114 * b[i] + WHOLE).to_bits() as u8;
    }
    for i in (0..CHUNK_PX).step_by(2) {
        // Of two pixels. 255.5, of pure blue or red, would be rounded up.
        let (r, g, b) = (r[i] + r[i + 1], g[i] + g[i + 1], b[i] + b[i + 1]);
        let blue = 128.0 - 0.084_368 * r - 0.165_632 * g + 0.25 * b;
        let red = 128.0 + 0.25 * r - 0.209_344 * g - 0.040_656 * b;
        let held = |level: f32| if level < 255.0 { level } else { 255.0 };
        (cb[i], cr[i]) = ((held(blue) + WHOLE).to_bits() as u8, (held(red) + WHOLE).to_bits() as u8);
        (cb[i + 1], cr[i + 1]) = (cb[i], cr[i]);
    }
    luma.extend_from_slice(&y[..count]);
    blue.extend_from_slice(&cb[..count]);
    red.extend_from_slice(&cr[..count]);
}
