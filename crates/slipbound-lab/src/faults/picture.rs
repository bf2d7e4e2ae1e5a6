//! The picture of a frame as a whole: its pixels and its encoded form, kept in step.

use crate::jpeg::Codec;
use slipbound::port::{FrameBuffer, PixelFormat, SourceError};

/// Quality at which a changed frame is encoded again.
const JPEG_QUALITY: u8 = 90;

/// Encodes changed pixels and decodes them again, so that what is recorded is what is seen. Grey frames lose their
/// encoded form.
pub(super) fn encode_again(frame: &mut FrameBuffer) -> Result<(), SourceError> {
    if frame.format != PixelFormat::Rgb {
        frame.encoded.clear();
        return Ok(());
    }
    let codec = Codec::new(frame.size, JPEG_QUALITY);
    codec.encode(&frame.pixels, &mut frame.encoded)?;
    codec.decode(frame)
}

/// The picture of one frame under the number and time of another of the same size.
pub(super) fn copy_picture(from: &FrameBuffer, to: &mut FrameBuffer) {
    to.encoded.clone_from(&from.encoded);
    to.pixels.clone_from(&from.pixels);
}
