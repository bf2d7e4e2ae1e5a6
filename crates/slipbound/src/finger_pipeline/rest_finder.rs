//! Finds the rest frame among the first frames of a source, in the same way for recordings and for the control loop.

use crate::image::{Frame, ImageError, SizePx};
use crate::monitor::{Rest, RestBuilder, RestChoice, RestError, RestKind, RestLook, Settings};
use crate::port::FrameBuffer;
use crate::sensor::Sensor;
use crate::setting::SettingError;
use std::ops::Range;

/// Looks at the first [`window_count`](crate::monitor::RestSettings::window_count) whole frames, chooses the stationary
/// run among them (an untouched one if there is any) and averages it. Keeps a copy of every frame of the window.
#[derive(Debug, Clone)]
pub struct RestFinder {
    builder: RestBuilder,
    window_count: usize,
    frames: Vec<FrameBuffer>,
    looks: Vec<RestLook>,
}

/// A rest frame and the frames it was made from.
#[derive(Debug, Clone)]
pub struct FoundRest {
    /// The rest frame; [`Rest::kind`] gives whether the finger was already in contact.
    pub rest: Rest,
    /// Numbers of the frames averaged into it: from the first up to, not including, the last.
    pub seqs: Range<u64>,
    /// Whether none of several frames stood still: then they are the first, and the finger counts as in contact.
    pub is_moving: bool,
}

impl RestFinder {
    /// A finder for frames of `camera_px`. Fails when a setting or a sensor fact is invalid.
    pub fn new(sensor: &Sensor, settings: &Settings, camera_px: SizePx) -> Result<Self, SettingError> {
        Ok(RestFinder {
            builder: RestBuilder::new(sensor, settings, camera_px)?,
            window_count: settings.rest.window_count as usize,
            frames: Vec::new(),
            looks: Vec::new(),
        })
    }

    /// The facts of the finger at the size of its frames.
    pub fn sensor(&self) -> &Sensor {
        self.builder.sensor()
    }

    /// Takes the next whole frame of the source. Frames beyond the window are ignored.
    pub fn see(&mut self, frame: &FrameBuffer) -> Result<(), ImageError> {
        if self.is_full() {
            return Ok(());
        }
        let look = self.builder.look(&frame.frame()?);
        self.looks.push(look);
        self.frames.push(frame.clone());
        Ok(())
    }

    /// The frames seen so far, in order: the number of each, and its look.
    pub fn looks(&self) -> impl Iterator<Item = (u64, &RestLook)> {
        self.frames.iter().map(|frame| frame.seq).zip(&self.looks)
    }

    /// Upper limit of the sharpness of an untouched finger: see [`RestLook::sharpness`].
    pub fn bare_sharpness(&self) -> f64 {
        self.builder.bare_sharpness()
    }

    /// Whether the window is full: nothing more is needed.
    pub fn is_full(&self) -> bool {
        self.frames.len() >= self.window_count
    }

    /// The frames seen so far.
    pub(super) fn frames(&self) -> &[FrameBuffer] {
        &self.frames
    }

    /// Which of the frames seen so far make the rest frame. Fails when no frame was stationary and bright.
    pub(super) fn choose(&self) -> Result<RestChoice, RestError> {
        self.builder.choose(&self.looks)
    }

    /// The rest frame, from the frames seen so far. Fails when no frame was stationary and bright, or too few markers
    /// show.
    pub fn find(&self) -> Result<FoundRest, RestError> {
        let choice = self.choose()?;
        let is_moving = self.builder.is_moving(&choice);
        let run = &self.frames[choice.frames];
        let mut builder = self.builder.clone();
        for buffer in run {
            // Frames with an invalid buffer were rejected by `see`.
            let Ok(frame) = buffer.frame() else { return Err(RestError::Empty) };
            builder.add(&frame)?;
        }
        let seqs = run.first().map_or(0, |f| f.seq)..run.last().map_or(0, |f| f.seq + 1);
        Ok(FoundRest { rest: builder.build(choice.kind)?, seqs, is_moving })
    }
}

/// The rest frame from frames that the user declares to be at rest: the average of all. In contact when most look
/// touched, or where the settings declare an object [`held`](crate::monitor::RestSettings::held). The error comes with
/// the index in `frames` of the frame that cannot be used, if it is one of them.
pub fn rest_from(mut builder: RestBuilder, frames: &[Frame<'_>]) -> Result<Rest, (Option<usize>, RestError)> {
    let touched_count = frames.iter().filter(|frame| builder.look(frame).touched).count();
    let is_touched = builder.settings().rest.held || 2 * touched_count > frames.len();
    let kind = if is_touched { RestKind::InContact } else { RestKind::Unloaded };
    for (i, frame) in frames.iter().enumerate() {
        builder.add(frame).map_err(|e| (Some(i), e))?;
    }
    builder.build(kind).map_err(|e| (None, e))
}
