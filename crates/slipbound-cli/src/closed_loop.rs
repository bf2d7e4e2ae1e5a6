//! The loop: frames in, commands out. The same for simulation, replay and hardware.
//!
//! ```text
//!   eye 0: source -> monitor --.          all but the last judged on threads of their own
//!   eye 1: source -> monitor --+--> Hand --> Task --> gripper, wrist
//!   gripper, wrist: poll ------'
//! ```
//!
//! While gripper or wrist are in trouble (a lost link, no answer, a refusal, a latched fast stop, a force that does not
//! follow) the wrist is paused, the force stays where it is, and the loop looks on and waits for them, for ten seconds.
//! On any other error it leaves: the wrist is paused first, and the gripper keeps its force, or goes to the force for
//! blind hands where that is set and more.

mod eye;
mod judge;

pub use eye::Eye;

use crate::frames::FrameRecorder;
use slipbound::hand::{Hand, HandReport, Mounting};
use slipbound::port::{
    GripCommand, GripSample, Gripper, GripperError, GripperState, Jaws, Wrist, WristCommand, WristMotion,
    WristState,
};
use slipbound::task::{Observation, Phase, Task, TaskStep};
use slipbound_rig::gripper;

/// Longest wait for a gripper or wrist in trouble, ns: enough for a cable to be put back.
const PATIENCE_NS: u64 = 10_000_000_000;

/// Time without trouble after which the wrist may go on, ns.
const CALM_NS: u64 = 500_000_000;

/// Longest time for a measured force to come up to what was commanded, ns, and what may lack then: N, and share.
const FOLLOW_NS: u64 = 1_500_000_000;
const LACK: (f64, f64) = (2.0, 0.2);

/// A pause, in whatever the wrist is doing.
const PAUSE: WristCommand = WristCommand::new(WristMotion::Pause);

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
    /// When there last was any, ns.
    pub last_ns: u64,
    /// What was said last.
    pub why: String,
}

impl Trouble {
    /// What kind of trouble it is: what was said, without its numbers.
    pub fn kind(&self) -> String {
        self.why.chars().filter(|c| !c.is_ascii_digit()).collect()
    }
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
    /// What gripper or wrist could not do a short while ago; None when all is well.
    pub trouble: Option<Trouble>,
    /// A lower force that the gripper refused, the first time; the force stays where it is.
    pub refused_lowering: Option<String>,
    last: Option<TaskStep>,
    grip: Option<GripSample>,
    wrist: Option<WristState>,
    lacks_since_ns: Option<u64>,
}

impl ClosedLoop {
    /// A loop before its first turn.
    pub fn new(mut eyes: Vec<Eye>, task: Box<dyn Task + Send>) -> anyhow::Result<Self> {
        if let Some((_last, others)) = eyes.split_last_mut() {
            others.iter_mut().for_each(Eye::judge_beside);
        }
        let mountings: Vec<Mounting> = eyes.iter().map(|eye| eye.mounting).collect();
        Ok(ClosedLoop {
            hand: Hand::new(&mountings)?,
            eyes,
            task,
            recorder: None,
            trouble: None,
            refused_lowering: None,
            last: None,
            grip: None,
            wrist: None,
            lacks_since_ns: None,
        })
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
            let _ = gripper.command(GripCommand::Hold { force_n });
        }
    }

    fn try_turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let state = gripper.poll().map_err(|e| format!("gripper: {e}")).and_then(|state| self.usable(state));
        // A wrist that cannot be asked stands where it was last; the grip goes on answering slip meanwhile.
        let polled = wrist.poll().map_err(|e| format!("wrist: {e}"));
        let wrist_lost = polled.as_ref().err().cloned();
        let stands = self.wrist.map(|wrist| WristState { moving: false, ..wrist });
        self.wrist = polled.as_ref().ok().copied().or(stands);
        let known = state.and_then(|state| Ok((state, self.wrist.map_or(polled, Ok)?)));
        if let Ok((state, _)) = &known {
            self.grip = state.pressed_n().map(|force_n| GripSample { force_n });
        }
        let grip = self.grip;
        let mut goes_on = Ok(true);
        for eye in &mut self.eyes {
            if matches!(goes_on, Ok(true)) {
                goes_on = eye.look(grip, self.recorder.as_mut());
            }
        }
        for (i, eye) in self.eyes.iter_mut().enumerate() {
            eye.end_judging()?;
            match &eye.report {
                Some(report) => self.hand.see(i, report),
                None => self.hand.missed(i),
            }
        }
        if !goes_on? {
            return Ok(Turned::Over);
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
        if self.eyes.iter().any(|eye| eye.monitor().is_none()) {
            self.calm(now_ns);
            return Ok(Turned::AtRest);
        }
        let hand = self.hand.report();
        let step = self.task.step(&Observation { now_ns, hand: &hand, gripper: &state, wrist: &wrist_state });
        self.last = Some(step);
        let lacks = self.lacks(now_ns, &state, &step);
        match self.command(&step, gripper, wrist).or(lacks).or(wrist_lost) {
            Some(why) => self.suffer(now_ns, why, wrist)?,
            None => self.calm(now_ns),
        }
        Ok(Turned::Commanded(Turn { hand, gripper: state, wrist: wrist_state, step }))
    }

    /// A state that can be worked with.
    fn usable(&self, state: GripperState) -> Result<GripperState, String> {
        let is_over = self.last.is_some_and(|step| matches!(step.phase, Phase::Ended(_)));
        match state.jaws {
            Jaws::Stopped => Err("gripper: it has stopped itself (fast stop); its force stays".into()),
            Jaws::Unknown if !is_over => {
                let got = "gripper: expected jaws that know where they are, got jaws unknown";
                Err(format!("{got}: not heard of yet, or switched off and on (then take the object out and home it)"))
            }
            _ => Ok(state),
        }
    }

    /// Commands wrist and gripper; what they could not do. In trouble the wrist stands.
    fn command(&mut self, step: &TaskStep, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> Option<String> {
        // A wrist that is to stand stands before the grip changes.
        let motion = if self.trouble.is_some() { PAUSE } else { step.wrist };
        let moved = wrist.command(motion).map_err(|e| format!("wrist: {e}"));
        let gripped = gripper.command(step.grip).or_else(|e| self.bear(e)).map_err(|e| format!("gripper: {e}"));
        gripped.and(moved).err()
    }

    /// What lacks when a force that was commanded does not arrive.
    fn lacks(&mut self, now_ns: u64, state: &GripperState, step: &TaskStep) -> Option<String> {
        let asked_n = step.grip.force_n;
        let least_n = asked_n - LACK.0.max(LACK.1 * asked_n);
        let measured_n = state.force_n.filter(|n| state.jaws == Jaws::Holding && *n < least_n);
        let Some(measured_n) = measured_n.filter(|_| step.grip.motion != Motion::Release) else {
            self.lacks_since_ns = None;
            return None;
        };
        let since_ns = *self.lacks_since_ns.get_or_insert(now_ns);
        let is_late = now_ns.saturating_sub(since_ns) > FOLLOW_NS;
        is_late.then(|| format!("gripper: expected {asked_n:.1} N per finger, measured {measured_n:.1} N for too long"))
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

    /// No trouble in this turn: past trouble is over after a while.
    fn calm(&mut self, now_ns: u64) {
        self.trouble = self.trouble.take().filter(|trouble| now_ns < trouble.last_ns + CALM_NS);
    }

    /// In trouble: the wrist is paused; an error when it lasts too long.
    fn suffer(&mut self, now_ns: u64, why: String, wrist: &mut dyn Wrist) -> anyhow::Result<()> {
        let _ = wrist.command(PAUSE); // the wrist may be what is in trouble: it then pauses by itself
        let since_ns = self.trouble.as_ref().map_or(now_ns, |trouble| trouble.since_ns);
        let waited_ns = now_ns.saturating_sub(since_ns);
        anyhow::ensure!(waited_ns < PATIENCE_NS, "{why}; waited {} s", waited_ns / 1_000_000_000);
        self.trouble = Some(Trouble { since_ns, last_ns: now_ns, why });
        Ok(())
    }
}

#[cfg(test)]
mod tests;
