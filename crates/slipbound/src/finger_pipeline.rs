//! A finger of the control loop: its source of frames, its rest frame, its monitor.
//!
//! ```text
//!   FrameSource --acquire--> first frames --RestFinder--> Rest --> SlipMonitor
//!                            later frames --judge-----------------> SlipReport
//! ```
//!
//! Frames are acquired by the loop and judged by a [`MonitorRunner`]: one after the other ([`Sequential`]), or on
//! threads of their own, for which [`FingerPipeline::lend`] hands out monitor and frame.

mod recording_monitor;
mod rest_finder;

pub use recording_monitor::RecordingMonitor;
pub use rest_finder::{FoundRest, RestFinder, rest_from};

use crate::control::ControlError;
use crate::hand::Mounting;
use crate::monitor::{Rest, RestError, RestKind, Settings, SlipMonitor, SlipReport};
use crate::port::{FrameBuffer, FrameSource, GripSample, Next};
use crate::sensor::Sensor;
use crate::setting::SettingError;

/// A finger: its source of frames, its mounting, its monitor.
pub struct FingerPipeline {
    name: String,
    mounting: Mounting,
    source: Box<dyn FrameSource + Send>,
    sensor: Sensor,
    settings: Settings,
    refuses_touch: bool,
    rest: Option<Rest>,
    rest_finder: Option<RestFinder>,
    rest_kind: Option<RestKind>,
    rest_error: Option<RestError>,
    monitor: Option<Box<SlipMonitor>>,
    frame: FrameBuffer,
    next: Next,
    report: Option<SlipReport>,
}

/// A frame and the monitor that is to judge it, to be passed to a thread and back.
pub struct MonitorJob {
    monitor: Box<SlipMonitor>,
    frame: FrameBuffer,
    grip: Option<GripSample>,
    report: Option<SlipReport>,
}

impl MonitorJob {
    /// Judges the frame.
    pub fn run(&mut self) {
        // A buffer that does not match its stated size was rejected before it was lent.
        self.report = self.frame.frame().ok().map(|frame| self.monitor.step(&frame, self.grip));
    }
}

/// A finger as an observer sees it in a cycle.
#[derive(Debug, Clone, Copy)]
pub struct FingerView<'a> {
    /// Name of the finger.
    pub name: &'a str,
    /// What its source gave in this cycle.
    pub next: &'a Next,
    /// The newest frame.
    pub frame: &'a FrameBuffer,
    /// Its report; None when no frame came, or the rest frame is not known yet.
    pub report: Option<&'a SlipReport>,
    /// The monitor after the frame; None before the rest frame is known. An observer behind a queue receives it only
    /// when a slip begins.
    pub monitor: Option<&'a SlipMonitor>,
    /// Whether the finger was unloaded or in contact in its rest frame; None before that is known.
    pub rest_kind: Option<RestKind>,
    /// Why the frames so far have no rest frame, for example because they are dark; None before there were enough of them,
    /// and once it is known. Nothing is commanded meanwhile.
    pub rest_error: Option<&'a RestError>,
}

impl FingerPipeline {
    /// A finger before its first frame.
    pub fn new(
        name: &str,
        mounting: Mounting,
        sensor: Sensor,
        settings: Settings,
        source: Box<dyn FrameSource + Send>,
    ) -> Self {
        FingerPipeline {
            name: name.into(),
            mounting,
            source,
            sensor,
            settings,
            refuses_touch: false,
            rest: None,
            rest_finder: None,
            rest_kind: None,
            rest_error: None,
            monitor: None,
            frame: FrameBuffer::default(),
            next: Next::Silent,
            report: None,
        }
    }

    /// The same finger, but failing with [`ControlError::Touched`] when something touches it in its rest frame.
    #[must_use]
    pub fn refusing_touch(self) -> Self {
        FingerPipeline { refuses_touch: true, ..self }
    }

    /// The same finger with a known rest frame: its first frame is judged already. A frame of another size fails with
    /// [`ControlError::Setting`], and so does the rest frame of another finger.
    #[must_use]
    pub fn with_rest(self, rest: Rest) -> Self {
        FingerPipeline { rest: Some(rest), ..self }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its mounting in the hand.
    pub fn mounting(&self) -> Mounting {
        self.mounting
    }

    /// Its sensor facts, as given to [`FingerPipeline::new`].
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Its monitor; None before the rest frame is known, and while it is lent.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_deref()
    }

    /// Whether it was unloaded or in contact in its rest frame; None before that is known.
    pub fn rest_kind(&self) -> Option<RestKind> {
        self.rest_kind
    }

    /// The newest frame.
    pub fn frame(&self) -> &FrameBuffer {
        &self.frame
    }

    /// The report on the newest frame; None when no frame came in this cycle.
    pub fn report(&self) -> Option<&SlipReport> {
        self.report.as_ref()
    }

    /// What an observer sees of it.
    pub fn view(&self) -> FingerView<'_> {
        FingerView {
            name: &self.name,
            next: &self.next,
            frame: &self.frame,
            report: self.report.as_ref(),
            monitor: self.monitor.as_deref(),
            rest_kind: self.rest_kind,
            rest_error: self.rest_error.as_ref(),
        }
    }

    /// Discards the last frame, so that it is not shown twice when another finger's source fails.
    pub(crate) fn clear_frame(&mut self) {
        (self.next, self.report) = (Next::Silent, None);
    }

    /// Takes the next frame from the source. False when the source has ended.
    pub(crate) fn acquire(&mut self) -> Result<bool, ControlError> {
        self.next = match self.source.next(&mut self.frame) {
            Ok(next) => next,
            Err(source) => {
                self.next = Next::Silent;
                return Err(ControlError::Source { finger: self.name.clone(), source });
            }
        };
        Ok(self.next != Next::End)
    }

    /// Uses the frame for the rest frame, or keeps it to be judged.
    pub(crate) fn process_frame(&mut self) -> Result<(), ControlError> {
        match (&self.next, &self.monitor) {
            (Next::Frame, None) => match self.rest.take() {
                Some(rest) => self.start_from(rest)?,
                None => self.look_for_rest()?,
            },
            (Next::Frame, Some(_)) => {
                self.frame.frame().map_err(|source| ControlError::Frame { finger: self.name.clone(), source })?;
            }
            (Next::Torn { .. }, Some(monitor)) => {
                self.report = Some(monitor.torn(self.frame.seq, self.frame.time_ns));
            }
            (Next::Torn { .. } | Next::Silent | Next::End, _) => {}
        }
        Ok(())
    }

    fn look_for_rest(&mut self) -> Result<(), ControlError> {
        let finger = || self.name.clone();
        let finder = match &mut self.rest_finder {
            Some(finder) => finder,
            None => {
                let finder = RestFinder::new(&self.sensor, &self.settings, self.frame.size);
                self.rest_finder.insert(finder.map_err(|source| ControlError::Setting { finger: finger(), source })?)
            }
        };
        finder.see(&self.frame).map_err(|source| ControlError::Frame { finger: finger(), source })?;
        if !finder.is_full() {
            return Ok(());
        }
        let found = match self.rest_finder.take().map(|finder| finder.find()) {
            Some(Ok(found)) => found,
            // Only dark frames so far: the loop waits, nothing is held yet.
            Some(Err(error @ RestError::NoStationaryFrame { .. })) => {
                self.rest_error = Some(error);
                return Ok(());
            }
            None => return Ok(()),
            Some(Err(source)) => return Err(ControlError::Rest { finger: finger(), source }),
        };
        if self.refuses_touch && found.rest.kind() == RestKind::InContact {
            return Err(ControlError::Touched { finger: finger() });
        }
        self.judge_against(found.rest)
    }

    /// Takes the given rest frame, once the first frame has shown the frame size.
    fn start_from(&mut self, rest: Rest) -> Result<(), ControlError> {
        if rest.size() != self.frame.size {
            let (got, expected) = (rest.size().to_string(), format!("{} as the frames", self.frame.size));
            let source = SettingError { key: "rest.size".into(), got, expected };
            return Err(ControlError::Setting { finger: self.name.clone(), source });
        }
        let sized = self.frame.frame().map(drop);
        sized.map_err(|source| ControlError::Frame { finger: self.name.clone(), source })?;
        self.judge_against(rest)
    }

    fn judge_against(&mut self, rest: Rest) -> Result<(), ControlError> {
        (self.rest_kind, self.rest_error) = (Some(rest.kind()), None);
        let monitor = SlipMonitor::new(&self.sensor, &self.settings, rest);
        self.monitor =
            Some(Box::new(monitor.map_err(|source| ControlError::Setting { finger: self.name.clone(), source })?));
        Ok(())
    }

    /// Whether a frame waits to be judged.
    fn awaits_judgement(&self) -> bool {
        self.next == Next::Frame && self.report.is_none()
    }

    /// Judges the frame acquired last, if there is one.
    pub fn judge(&mut self, grip: Option<GripSample>) {
        if !self.awaits_judgement() {
            return;
        }
        if let (Some(monitor), Ok(frame)) = (&mut self.monitor, self.frame.frame()) {
            self.report = Some(monitor.step(&frame, grip));
        }
    }

    /// Lends out the frame acquired last and the monitor that is to judge it; None when there is nothing to judge. It
    /// must be returned by [`FingerPipeline::take_back`].
    pub fn lend(&mut self, grip: Option<GripSample>) -> Option<MonitorJob> {
        if !self.awaits_judgement() {
            return None;
        }
        let monitor = self.monitor.take()?;
        Some(MonitorJob { monitor, frame: std::mem::take(&mut self.frame), grip, report: None })
    }

    /// Takes back what was lent, with its report.
    pub fn take_back(&mut self, job: MonitorJob) {
        (self.monitor, self.frame, self.report) = (Some(job.monitor), job.frame, job.report);
    }
}

/// Runs the monitors of a hand's fingers in every cycle.
pub trait MonitorRunner: Send {
    /// Judges every finger's newest frame. An error means that a finger's monitor is gone.
    fn judge(&mut self, fingers: &mut [FingerPipeline], grip: Option<GripSample>) -> Result<(), ControlError>;
}

/// Runs the monitors one after the other on the thread of the loop.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sequential;

impl MonitorRunner for Sequential {
    fn judge(&mut self, fingers: &mut [FingerPipeline], grip: Option<GripSample>) -> Result<(), ControlError> {
        fingers.iter_mut().for_each(|finger| finger.judge(grip));
        Ok(())
    }
}
