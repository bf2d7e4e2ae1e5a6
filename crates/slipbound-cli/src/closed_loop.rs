//! The loop: frames in, commands out. The same for simulation, replay and hardware.
//!
//! ```text
//!   eye 0: source -> monitor --.
//!   eye 1: source -> monitor --+--> Hand --> Task --> gripper, wrist
//!   gripper, wrist: poll ------'
//! ```
//!
//! While gripper or wrist are in trouble (a lost link, no answer, a latched fast stop) the wrist is paused, the force
//! stays where it is, and the loop looks on and waits for them, for ten seconds. On any other error it leaves: the wrist
//! is paused first, and the gripper keeps its force, or goes to the force for blind hands where that is set and more.

use crate::frames::FrameRecorder;
use anyhow::{Context, anyhow};
use slipbound::hand::{Hand, HandReport, Mounting};
use slipbound::image::Frame;
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport};
use slipbound::port::{
    FrameBuffer, FrameSource, GripCommand, GripSample, Gripper, GripperError, GripperState, Jaws, Motion, Next, Wrist,
    WristCommand, WristMotion, WristState,
};
use slipbound::sensor::Sensor;
use slipbound::task::{Moment, Phase, Task, TaskStep};
use slipbound_rig::gripper;

/// Frames of the open hand from which each finger's rest is averaged.
pub const REST_FRAMES_COUNT: u32 = 10;

/// Longest wait for a gripper or wrist in trouble, ns: enough for a cable to be put back.
const PATIENCE_NS: u64 = 10_000_000_000;

/// A pause, in whatever the wrist is doing.
const PAUSE: WristCommand = WristCommand::new(WristMotion::Pause);

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
    /// Gripper or wrist said nothing that could be worked with: see [`ClosedLoop::trouble`].
    Waiting,
    /// Commands went out.
    Commanded(Turn),
    /// A source has ended.
    Over,
}

/// What of a turn is told to whoever writes it down.
#[derive(Debug)]
pub struct Told<'a> {
    /// Time of the turn, ns.
    pub now_ns: u64,
    /// How it went.
    pub turned: Turned,
    /// What the gripper's driver had to say.
    pub notes: &'a [String],
}

/// What gripper or wrist could not do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trouble {
    /// Since when, ns.
    pub since_ns: u64,
    /// What was said first.
    pub why: String,
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
    /// What gripper or wrist could not do in the last turn; None when all is well.
    pub trouble: Option<Trouble>,
    /// A lower force that the gripper refused, the first time; the force stays where it is.
    pub refused_lowering: Option<String>,
    last: Option<TaskStep>,
}

impl ClosedLoop {
    /// A loop before its first turn.
    pub fn new(eyes: Vec<Eye>, task: Box<dyn Task + Send>) -> anyhow::Result<Self> {
        let mountings: Vec<Mounting> = eyes.iter().map(|eye| eye.mounting).collect();
        let (recorder, trouble, refused_lowering, last) = (None, None, None, None);
        Ok(ClosedLoop { hand: Hand::new(&mountings)?, eyes, task, recorder, trouble, refused_lowering, last })
    }

    /// One turn: every finger's frame, the gripper's and the wrist's state, the commands. On an error, that of a
    /// gripper or wrist in trouble for too long among them, the loop has been left: [`ClosedLoop::leave`].
    pub fn turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let turned = self.try_turn(now_ns, gripper, wrist);
        if turned.is_err() {
            self.leave(gripper, wrist);
        }
        turned
    }

    /// Leaves the hand as it is: the wrist pauses, then the force stays, or rises to that for blind hands if it is
    /// set. To be called when no further turn will come before the task has ended.
    pub fn leave(&mut self, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) {
        // A wrist that does not take this either runs out of its time to live.
        let _ = wrist.command(PAUSE);
        let Some(TaskStep { grip, phase, .. }) = self.last else { return };
        let holds = grip.motion != Motion::Release && !matches!(phase, Phase::Releasing | Phase::Ended(_));
        if let Some(force_n) = self.task.grip().limits().blind_force_n.filter(|n| holds && *n > grip.force_n) {
            // A gripper that does not take this keeps what it has.
            let _ = gripper.command(GripCommand { force_n, motion: Motion::Pause });
        }
    }

    fn try_turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let state = gripper.poll().map_err(|e| format!("gripper: {e}"));
        let wrist_state = wrist.poll().map_err(|e| format!("wrist: {e}"));
        let known = state.and_then(|state| Ok((state, wrist_state?)));
        let grip = known.as_ref().ok().and_then(|(state, _)| state.pressed_n()).map(|force_n| GripSample { force_n });
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
            recorder.turn(known.is_err())?;
        }
        let (state, wrist_state) = match known {
            Ok(known) => known,
            Err(why) => {
                self.suffer(now_ns, why, wrist)?;
                return Ok(Turned::Waiting);
            }
        };
        if self.eyes.iter().any(|eye| eye.monitor.is_none()) {
            return Ok(Turned::AtRest);
        }
        let hand = self.hand.report();
        let step = self.task.step(&Moment { now_ns, hand: &hand, gripper: &state, wrist: &wrist_state });
        self.last = Some(step);
        match self.command(&state, &step, gripper, wrist) {
            Some(why) => self.suffer(now_ns, why, wrist)?,
            None => self.trouble = None,
        }
        Ok(Turned::Commanded(Turn { hand, gripper: state, wrist: wrist_state, step }))
    }

    /// Commands wrist and gripper; what they could not do.
    fn command(
        &mut self,
        state: &GripperState,
        step: &TaskStep,
        gripper: &mut dyn Gripper,
        wrist: &mut dyn Wrist,
    ) -> Option<String> {
        let is_over = matches!(step.phase, Phase::Ended(_));
        match state.jaws {
            Jaws::Stopped => return Some("gripper: it has stopped itself (fast stop); its force stays".into()),
            Jaws::Unknown if !is_over => {
                let known = "gripper: expected jaws that know where they are, got jaws unknown";
                return Some(format!("{known}: switched off and on, or not homed; take the object out and home it"));
            }
            _ => {}
        }
        // A wrist that is to stand stands before the grip changes.
        let moved = wrist.command(step.wrist).map_err(|e| format!("wrist: {e}"));
        let gripped = gripper.command(step.grip).or_else(|e| self.bear(e)).map_err(|e| format!("gripper: {e}"));
        gripped.and(moved).err()
    }

    /// A gripper that must not be told a lower force holds on with the one it has: that is no trouble.
    fn bear(&mut self, error: GripperError) -> Result<(), GripperError> {
        match error.downcast_ref::<gripper::Error>() {
            Some(lowering @ gripper::Error::Lowering { .. }) => {
                self.refused_lowering.get_or_insert_with(|| lowering.to_string());
                Ok(())
            }
            _ => Err(error),
        }
    }

    /// In trouble: the wrist is paused; an error when it lasts too long.
    fn suffer(&mut self, now_ns: u64, why: String, wrist: &mut dyn Wrist) -> anyhow::Result<()> {
        let _ = wrist.command(PAUSE); // the wrist may be what is in trouble: it then pauses by itself
        let trouble = self.trouble.get_or_insert(Trouble { since_ns: now_ns, why });
        let waited_ns = now_ns.saturating_sub(trouble.since_ns);
        anyhow::ensure!(waited_ns < PATIENCE_NS, "{}; waited {} s", trouble.why, waited_ns / 1_000_000_000);
        Ok(())
    }
}
