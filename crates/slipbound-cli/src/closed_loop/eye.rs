//! A finger of the loop: its source, its rest, its judge.

use super::judge::Judge;
use crate::frames::FrameRecorder;
use anyhow::{Context, anyhow};
use slipbound::hand::Mounting;
use slipbound::image::Frame;
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport};
use slipbound::port::{FrameBuffer, FrameSource, GripSample, Next};
use slipbound::sensor::Sensor;

/// Frames of the open hand from which each finger's rest is averaged.
pub const REST_FRAMES_COUNT: u32 = 10;

/// A finger: where its frames come from, and who judges them.
pub struct Eye {
    /// What it is called.
    pub name: String,
    /// How it sits in the hand.
    pub mounting: Mounting,
    source: Box<dyn FrameSource>,
    sensor: Sensor,
    settings: Settings,
    rest: Option<RestBuilder>,
    monitor: Option<Box<SlipMonitor>>,
    /// Who judges it beside the others, and whether that one has frame and monitor at the moment.
    judge: Option<Judge>,
    is_lent: bool,
    /// The newest frame.
    pub frame: FrameBuffer,
    /// What was said of it; None when none came.
    pub report: Option<SlipReport>,
}

impl Eye {
    /// A finger before its first frame.
    pub fn new(
        name: &str,
        mounting: Mounting,
        sensor: Sensor,
        settings: Settings,
        source: Box<dyn FrameSource>,
    ) -> Self {
        let frame = FrameBuffer::default();
        Eye {
            name: name.into(),
            mounting,
            source,
            sensor,
            settings,
            rest: None,
            monitor: None,
            judge: None,
            is_lent: false,
            frame,
            report: None,
        }
    }

    /// From now on judged on a thread of its own.
    pub(super) fn judge_beside(&mut self) {
        self.judge = Some(Judge::new());
    }

    /// The judge, once the rest is known.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_deref()
    }

    /// The next frame: part of the rest, or given to be judged, which ends in [`Eye::end_judging`]. False when the
    /// source has ended.
    pub(super) fn look(
        &mut self,
        grip: Option<GripSample>,
        recorder: Option<&mut FrameRecorder>,
    ) -> anyhow::Result<bool> {
        self.report = None;
        let next = self.source.next(&mut self.frame).map_err(|e| anyhow!("{}: {e}", self.name))?;
        if let Some(recorder) = recorder {
            recorder.keep(&self.name, &next, &self.frame)?;
        }
        match (next, &mut self.monitor) {
            (Next::End, _) => return Ok(false),
            (Next::Frame, None) => self.add_to_rest()?,
            (Next::Frame, Some(_)) => self.begin_judging(grip)?,
            (Next::Torn { .. }, Some(monitor)) => {
                self.report = Some(monitor.torn(self.frame.seq, self.frame.time_ns));
            }
            (Next::Torn { .. } | Next::Silent, _) => {}
        }
        Ok(true)
    }

    fn begin_judging(&mut self, grip: Option<GripSample>) -> anyhow::Result<()> {
        match (&self.judge, self.monitor.take()) {
            (Some(judge), Some(monitor)) => {
                judge.lend(monitor, std::mem::take(&mut self.frame), grip).with_context(|| self.name.clone())?;
                self.is_lent = true;
            }
            (None, Some(mut monitor)) => {
                let frame = self.frame.frame().with_context(|| self.name.clone())?;
                self.report = Some(monitor.step(&frame, grip));
                self.monitor = Some(monitor);
            }
            (_, None) => {}
        }
        Ok(())
    }

    /// Waits for the report of a frame that is being judged beside the others.
    pub(super) fn end_judging(&mut self) -> anyhow::Result<()> {
        if let Some(judge) = self.judge.as_ref().filter(|_| std::mem::take(&mut self.is_lent)) {
            let (monitor, frame, report) = judge.give_back().with_context(|| self.name.clone())?;
            (self.monitor, self.frame, self.report) = (Some(monitor), frame, Some(report));
        }
        Ok(())
    }

    fn add_to_rest(&mut self) -> anyhow::Result<()> {
        let frame: Frame<'_> = self.frame.frame().with_context(|| self.name.clone())?;
        let rest = match &mut self.rest {
            Some(rest) => rest,
            None => {
                let rest = RestBuilder::new(&self.sensor, &self.settings, self.frame.size);
                self.rest.insert(rest.with_context(|| self.name.clone())?)
            }
        };
        // A dark frame is passed over; the loop waits for the next.
        let _ = rest.add(&frame);
        let count = self.rest.as_ref().map_or(0, RestBuilder::frames_count);
        if count >= REST_FRAMES_COUNT
            && let Some(rest) = self.rest.take()
        {
            let rest: Rest = rest.build(RestKind::Unloaded).with_context(|| format!("{}: no rest", self.name))?;
            let monitor = SlipMonitor::new(&self.sensor, &self.settings, rest);
            self.monitor = Some(Box::new(monitor.with_context(|| self.name.clone())?));
        }
        Ok(())
    }
}
