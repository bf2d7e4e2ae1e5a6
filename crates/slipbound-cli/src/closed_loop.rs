//! The loop: frames in, commands out. The same for simulation, replay and hardware.
//!
//! ```text
//!   eye 0: source -> monitor --.
//!   eye 1: source -> monitor --+--> Hand --> Task --> gripper, wrist
//!   gripper, wrist: poll ------'
//! ```
//!
//! On any error the wrist is paused first and the gripper is told nothing: its force stays where it is.

use crate::frames::FrameRecorder;
use anyhow::{Context, anyhow};
use slipbound::hand::{Hand, HandReport, Mounting};
use slipbound::image::Frame;
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport};
use slipbound::port::{
    FrameBuffer, FrameSource, GripSample, Gripper, GripperState, Next, Wrist, WristCommand, WristMotion, WristState,
};
use slipbound::sensor::Sensor;
use slipbound::task::{Moment, Task, TaskStep};

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
    monitor: Option<SlipMonitor>,
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
        Eye { name: name.into(), mounting, source, sensor, settings, rest: None, monitor: None, frame, report: None }
    }

    /// The judge, once the rest is known.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_ref()
    }

    /// The next frame, as part of the rest or to be judged. False when the source has ended.
    fn look(&mut self, grip: Option<GripSample>, recorder: Option<&mut FrameRecorder>) -> anyhow::Result<bool> {
        self.report = None;
        let next = self.source.next(&mut self.frame).map_err(|e| anyhow!("{}: {e}", self.name))?;
        if let Some(recorder) = recorder {
            recorder.keep(&self.name, &next, &self.frame)?;
        }
        match (next, &mut self.monitor) {
            (Next::End, _) => return Ok(false),
            (Next::Frame, None) => self.add_to_rest()?,
            (Next::Frame, Some(monitor)) => {
                let frame = self.frame.frame().with_context(|| self.name.clone())?;
                self.report = Some(monitor.step(&frame, grip));
            }
            (Next::Torn { .. }, Some(monitor)) => {
                self.report = Some(monitor.torn(self.frame.seq, self.frame.time_ns));
            }
            (Next::Torn { .. } | Next::Silent, _) => {}
        }
        Ok(true)
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
            self.monitor = Some(monitor.with_context(|| self.name.clone())?);
        }
        Ok(())
    }
}

/// What one turn of the loop saw and did.
#[derive(Debug, Clone, Copy)]
pub struct Turn {
    /// What the hand saw.
    pub hand: HandReport,
    /// What the gripper said before it was commanded.
    pub gripper: GripperState,
    /// What the wrist said before it was commanded.
    pub wrist: WristState,
    /// What was commanded.
    pub step: TaskStep,
}

/// How a turn went.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::large_enum_variant)] // made once a turn, never stored
pub enum Turned {
    /// The fingers are still being looked at open; nothing was commanded.
    AtRest,
    /// Commands went out.
    Commanded(Turn),
    /// A source has ended.
    Over,
}

/// The loop's state.
pub struct ClosedLoop {
    /// The fingers.
    pub eyes: Vec<Eye>,
    hand: Hand,
    /// The task.
    pub task: Box<dyn Task + Send>,
    /// Who keeps the frames, if anyone does.
    pub recorder: Option<FrameRecorder>,
}

impl ClosedLoop {
    /// A loop before its first turn.
    pub fn new(eyes: Vec<Eye>, task: Box<dyn Task + Send>) -> anyhow::Result<Self> {
        let mountings: Vec<Mounting> = eyes.iter().map(|eye| eye.mounting).collect();
        Ok(ClosedLoop { hand: Hand::new(&mountings)?, eyes, task, recorder: None })
    }

    /// One turn: every finger's frame, the gripper's and the wrist's state, the commands. On an error the wrist has
    /// been paused and the gripper left alone.
    pub fn turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let turned = self.try_turn(now_ns, gripper, wrist);
        if turned.is_err() {
            // A wrist that does not take this either runs out of its time to live.
            let _ = wrist.command(WristCommand::new(WristMotion::Pause));
        }
        turned
    }

    fn try_turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let state = gripper.poll().map_err(|e| anyhow!("gripper: {e}"))?;
        let grip = state.pressed_n().map(|force_n| GripSample { force_n });
        for (i, eye) in self.eyes.iter_mut().enumerate() {
            if !eye.look(grip, self.recorder.as_mut())? {
                return Ok(Turned::Over);
            }
            match &eye.report {
                Some(report) => self.hand.see(i, report),
                None => self.hand.missed(i),
            }
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.turn()?;
        }
        if self.eyes.iter().any(|eye| eye.monitor.is_none()) {
            return Ok(Turned::AtRest);
        }
        let hand = self.hand.report();
        let wrist_state = wrist.poll().map_err(|e| anyhow!("wrist: {e}"))?;
        let step = self.task.step(&Moment { now_ns, hand: &hand, gripper: &state, wrist: &wrist_state });
        // A wrist that is to stand stands before the grip changes.
        wrist.command(step.wrist).map_err(|e| anyhow!("wrist: {e}"))?;
        gripper.command(step.grip).map_err(|e| anyhow!("gripper: {e}"))?;
        Ok(Turned::Commanded(Turn { hand, gripper: state, wrist: wrist_state, step }))
    }
}
