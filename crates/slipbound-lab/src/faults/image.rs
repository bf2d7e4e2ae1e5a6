//! The image of a frame: its pixels and its encoded form, kept consistent.

use crate::jpeg::Codec;
use slipbound::port::{FrameBuffer, PixelFormat, SourceError};

/// Quality at which a changed frame is encoded again.
const JPEG_QUALITY: u8 = 90;

/// Encodes changed pixels and decodes them again, so that the recording equals what the method sees. Grey frames lose
/// their encoded form.
pub(super) fn encode_again(frame: &mut FrameBuffer) -> Result<(), SourceError> {
    if frame.format != PixelFormat::Rgb {
        frame.encoded.clear();
        return Ok(());
    }
    let codec = Codec::new(frame.size, JPEG_QUALITY);
    codec.encode(&frame.pixels, &mut frame.encoded)?;
    codec.decode(frame)
}

/// Copies the image of a frame to another of the same size, which keeps its number and time.
pub(super) fn copy_image(from: &FrameBuffer, to: &mut FrameBuffer) {
    to.encoded.clone_from(&from.encoded);
    to.pixels.clone_from(&from.pixels);
}
