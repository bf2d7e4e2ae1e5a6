//! Frames as JPEG: every one is encoded and decoded again, as it would be in a recording.

use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, PixelFormat, SourceError};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;

/// Encodes and decodes frames of one size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Codec {
    size: SizePx,
    quality: u8,
}

impl Codec {
    /// `quality`: 1 to 100.
    pub fn new(size: SizePx, quality: u8) -> Self {
        Codec { size, quality }
    }

    /// Rows of RGB pixels to a JPEG. Colour has half the resolution along x (4:2:2), as USB cameras send it.
    pub fn encode(&self, rgb: &[u8], into: &mut Vec<u8>) -> Result<(), SourceError> {
        into.clear();
        let mut encoder = jpeg_encoder::Encoder::new(into, self.quality);
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_2_1);
        let (width, height) = (self.size.width as u16, self.size.height as u16);
        Ok(encoder.encode(rgb, width, height, jpeg_encoder::ColorType::Rgb)?)
    }

    /// `into.encoded` to `into.pixels`.
    pub fn decode(&self, into: &mut FrameBuffer) -> Result<(), SourceError> {
        let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
        let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(into.encoded.as_slice()), options);
        into.pixels.resize(3 * self.size.area(), 0);
        decoder.decode_into(&mut into.pixels).map_err(|error| format!("JPEG: {error:?}"))?;
        into.format = PixelFormat::Rgb;
        into.size = self.size;
        Ok(())
    }
}
