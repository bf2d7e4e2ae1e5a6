//! Encodes frames that come as pixels only, because frames are kept as files.

use super::picture;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};

/// Gives every frame of a source an encoded form: the original one or, for pixels only, a PNG, which decodes to the
/// same pixels. A frame that cannot be encoded stays without, and the recorder reports it: recording never makes a
/// camera fail.
pub struct Encoded<S>(pub S);

impl<S: FrameSource> FrameSource for Encoded<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.0.next(into)?;
        if next == Next::Frame && into.encoded.is_empty() && picture::encode(into).is_err() {
            into.encoded.clear();
        }
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.0.frames_count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;
    use slipbound::port::PixelFormat;

    /// A frame of pixels, then one that came encoded.
    struct Two(u64);

    impl FrameSource for Two {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            into.size = SizePx::new(5, 3);
            into.format = if self.0 == 0 { PixelFormat::Gray } else { PixelFormat::Rgb };
            into.pixels = (0..15 * into.format.bytes_per_pixel()).map(|i| (i * 37 % 256) as u8).collect();
            into.encoded = if self.0 == 2 { b"as it came".to_vec() } else { Vec::new() };
            self.0 += 1;
            Ok(if self.0 > 3 { Next::End } else { Next::Frame })
        }
    }

    #[test]
    fn a_frame_that_cannot_be_encoded_ends_no_source() {
        struct Empty;
        impl FrameSource for Empty {
            fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
                (into.size, into.seq) = (SizePx::new(0, 0), into.seq + 1);
                Ok(Next::Frame)
            }
        }
        let (mut source, mut frame) = (Encoded(Empty), FrameBuffer::default());
        for seq in 1..=2 {
            assert_eq!(source.next(&mut frame).expect("goes on"), Next::Frame);
            assert_eq!((frame.seq, frame.encoded.len()), (seq, 0));
        }
    }

    #[test]
    fn pixels_come_back_from_what_they_were_encoded_to() {
        let (mut source, mut frame) = (Encoded(Two(0)), FrameBuffer::default());
        for _ in 0..2 {
            assert_eq!(source.next(&mut frame).expect("encodes"), Next::Frame);
            let mut decoded = FrameBuffer { encoded: frame.encoded.clone(), ..FrameBuffer::default() };
            picture::decode(&mut decoded).expect("decodes");
            assert_eq!((decoded.format, decoded.size), (frame.format, frame.size));
            assert_eq!(decoded.pixels, frame.pixels);
        }
        assert_eq!(source.next(&mut frame).expect("goes on"), Next::Frame);
        assert_eq!(frame.encoded, b"as it came");
    }
}
