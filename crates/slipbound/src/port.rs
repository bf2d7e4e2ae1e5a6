//! The traits of cameras, grippers and wrists. The core only defines them; `slipbound-rig` (hardware, files) and the
//! simulator implement them.

mod gripper;
mod source_error;
mod wrist;

pub use gripper::{DriverEvent, GripCommand, GripSample, Gripper, GripperError, GripperErrorKind, GripperState, Jaws};
pub use source_error::{SourceError, SourceErrorKind};
pub use wrist::{
    FASTEST_TURN_RAD_PER_S, LONGEST_TIME_TO_LIVE_NS, Wrist, WristCommand, WristError, WristErrorKind, WristMotion,
    WristState,
};

use crate::image::{Frame, Gray, ImageError, Pixels, Rgb, SizePx};
use serde::{Deserialize, Serialize};

/// The clock that the time of a frame is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// The camera's or simulator's own clock, at exposure.
    Device,
    /// The computer's clock, at arrival.
    Host,
    /// Time stamps of a container or of its recorder.
    Container,
    /// Frame number times a frame rate that was assumed or written in a header, not measured.
    Assumed,
    /// There is no time.
    Unknown,
}

/// How the bytes of a [`FrameBuffer`] are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PixelFormat {
    /// One byte a pixel.
    Gray,
    /// Three bytes a pixel: red, green, blue.
    Rgb,
}

impl PixelFormat {
    /// Bytes a pixel takes.
    pub const fn bytes_per_pixel(self) -> usize {
        match self {
            PixelFormat::Gray => 1,
            PixelFormat::Rgb => 3,
        }
    }
}

/// The buffer that a source fills with a frame; recycled, so that a running source need not allocate.
#[derive(Debug, Clone)]
pub struct FrameBuffer {
    /// The frame as it was recorded or received, for example a JPEG; empty when it was never encoded.
    pub encoded: Vec<u8>,
    /// Decoded pixels, rows without gaps.
    pub pixels: Vec<u8>,
    /// Layout of `pixels`.
    pub format: PixelFormat,
    /// Size of `pixels`.
    pub size: SizePx,
    /// The source's running number.
    pub seq: u64,
    /// Time of exposure or arrival in nanoseconds, by `clock`.
    pub time_ns: Option<u64>,
    /// Whose clock `time_ns` is from.
    pub clock: Clock,
    /// Name of the frame in messages, for example the file name of an image; empty for most sources.
    pub label: String,
}

impl Default for FrameBuffer {
    fn default() -> Self {
        FrameBuffer {
            encoded: Vec::new(),
            pixels: Vec::new(),
            format: PixelFormat::Rgb,
            size: SizePx::new(0, 0),
            seq: 0,
            time_ns: None,
            clock: Clock::Unknown,
            label: String::new(),
        }
    }
}

impl FrameBuffer {
    /// The frame to be judged. Fails when `pixels` is too short for `size` and `format`.
    pub fn frame(&self) -> Result<Frame<'_>, ImageError> {
        let pixels = match self.format {
            PixelFormat::Gray => Pixels::Gray(Gray::new(&self.pixels, self.size)?),
            PixelFormat::Rgb => Pixels::Rgb(Rgb::new(&self.pixels, self.size)?),
        };
        Ok(Frame { pixels, seq: self.seq, time_ns: self.time_ns })
    }
}

/// Result of asking a source for a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Next {
    /// A frame, in the buffer.
    Frame,
    /// A frame that cannot be decoded completely; the buffer holds its number, time and encoded bytes.
    Torn {
        /// What is wrong with it.
        reason: String,
    },
    /// Nothing within the source's time limit; more may come.
    Silent,
    /// The recording is over.
    End,
}

/// Frames in order: a camera, a recording, a simulator.
///
/// ```
#[doc = include_str!("../examples/my_camera.rs")]
/// ```
pub trait FrameSource {
    /// Reads the next frame into a recycled buffer. An error is final: no frame will follow. A torn frame is not an
    /// error.
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError>;

    /// Total number of frames; None where it is not known in advance.
    fn frames_count(&self) -> Option<u64> {
        None
    }
}

impl<T: FrameSource + ?Sized> FrameSource for Box<T> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        (**self).next(into)
    }

    fn frames_count(&self) -> Option<u64> {
        (**self).frames_count()
    }
}
