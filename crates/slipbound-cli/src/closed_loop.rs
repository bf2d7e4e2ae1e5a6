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

use crate::frames::FrameRecorder;
use crate::judge::Judge;
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

/// Time without trouble after which the wrist may go on, ns.
const CALM_NS: u64 = 500_000_000;

/// Longest time for a measured force to come up to what was commanded, ns, and what may lack then: N, and share.
const FOLLOW_NS: u64 = 1_500_000_000;
const LACK: (f64, f64) = (2.0, 0.2);

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

    /// The judge, once the rest is known.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_deref()
    }

    /// The next frame: part of the rest, or given to be judged, which ends in [`Eye::end_judging`]. False when the
    /// source has ended.
    fn look(&mut self, grip: Option<GripSample>, recorder: Option<&mut FrameRecorder>) -> anyhow::Result<bool> {
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
    fn end_judging(&mut self) -> anyhow::Result<()> {
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
    lacks_since_ns: Option<u64>,
}

impl ClosedLoop {
    /// A loop before its first turn.
    pub fn new(mut eyes: Vec<Eye>, task: Box<dyn Task + Send>) -> anyhow::Result<Self> {
        if let Some((_last, others)) = eyes.split_last_mut() {
            others.iter_mut().for_each(|eye| eye.judge = Some(Judge::new()));
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
            let _ = gripper.command(GripCommand { force_n, motion: Motion::Pause });
        }
    }

    fn try_turn(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> anyhow::Result<Turned> {
        let state = gripper.poll().map_err(|e| format!("gripper: {e}")).and_then(|state| self.usable(state));
        let wrist_state = wrist.poll().map_err(|e| format!("wrist: {e}"));
        let known = state.and_then(|state| Ok((state, wrist_state?)));
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
        if self.eyes.iter().any(|eye| eye.monitor.is_none()) {
            self.calm(now_ns);
            return Ok(Turned::AtRest);
        }
        let hand = self.hand.report();
        let step = self.task.step(&Moment { now_ns, hand: &hand, gripper: &state, wrist: &wrist_state });
        self.last = Some(step);
        let wanted = self.lacks(now_ns, &state, &step);
        match self.command(&step, gripper, wrist).or(wanted) {
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
mod tests {
    use super::*;
    use slipbound::hand::Side;
    use slipbound::port::{SourceError, WristError};
    use slipbound::task::{TaskKind, TaskSettings};
    use std::cell::RefCell;
    use std::rc::Rc;

    const S: u64 = 1_000_000_000;

    /// A camera that is silent.
    struct Silent;

    impl FrameSource for Silent {
        fn next(&mut self, _into: &mut FrameBuffer) -> Result<Next, SourceError> {
            Ok(Next::Silent)
        }
    }

    /// A gripper and a wrist that write down what they are told.
    #[derive(Clone, Default)]
    struct Scribe {
        told: Rc<RefCell<Vec<String>>>,
        is_lost: bool,
    }

    impl Gripper for Scribe {
        fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
            self.told.borrow_mut().push(format!("grip {}", command.force_n));
            Ok(())
        }

        fn poll(&mut self) -> Result<GripperState, GripperError> {
            if self.is_lost {
                return Err("gone 3 ms ago".into());
            }
            let (force_n, target_n, opening_mm) = (Some(20.0), Some(20.0), None);
            Ok(GripperState { time_ns: 0, force_n, target_n, opening_mm, jaws: Jaws::Holding })
        }
    }

    impl Wrist for Scribe {
        fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
            self.told.borrow_mut().push(format!("{:?}", command.motion));
            Ok(())
        }

        fn poll(&mut self) -> Result<WristState, WristError> {
            Ok(WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false })
        }
    }

    fn around(blind_force_n: Option<f64>) -> ClosedLoop {
        let mut settings = TaskSettings::default();
        settings.grip.blind_force_n = blind_force_n;
        let task = settings.task(TaskKind::Lift, None).expect("valid");
        let sensor = slipbound_rig::sensors::load("gelslim").expect("built in");
        let eye = Eye::new("left", Mounting::on(Side::Left), sensor, Settings::default(), Box::new(Silent));
        ClosedLoop::new(vec![eye], task).expect("valid")
    }

    fn step(phase: Phase, motion: Motion) -> TaskStep {
        TaskStep { grip: GripCommand { force_n: 20.0, motion }, wrist: PAUSE, phase }
    }

    #[test]
    fn who_leaves_pauses_the_wrist_first_and_only_ever_presses_harder() {
        let releases = step(Phase::Releasing, Motion::Release);
        for (blind_force_n, last, expected) in [
            (None, step(Phase::Working, Motion::Go), vec!["Pause"]),
            (Some(35.0), step(Phase::Working, Motion::Go), vec!["Pause", "grip 35"]),
            (Some(12.0), step(Phase::Working, Motion::Go), vec!["Pause"]),
            (Some(35.0), releases, vec!["Pause"]),
        ] {
            let (scribe, mut around) = (Scribe::default(), around(blind_force_n));
            around.last = Some(last);
            around.leave(&mut scribe.clone(), &mut scribe.clone());
            assert_eq!(*scribe.told.borrow(), expected);
        }
    }

    #[test]
    fn a_lost_gripper_is_waited_for_with_the_wrist_paused_for_ten_seconds() {
        let (scribe, mut around) = (Scribe::default(), around(None));
        let mut lost = Scribe { is_lost: true, ..scribe.clone() };
        for now_ns in [S, 5 * S, 10 * S] {
            assert!(matches!(around.turn(now_ns, &mut lost, &mut scribe.clone()), Ok(Turned::Waiting)));
        }
        assert_eq!(around.trouble.as_ref().map(Trouble::kind).as_deref(), Some("gripper: gone  ms ago"));
        assert!(matches!(around.turn(10 * S + 1, &mut scribe.clone(), &mut scribe.clone()), Ok(Turned::AtRest)));
        let error = around.turn(11 * S, &mut lost, &mut scribe.clone()).expect_err("patience ends").to_string();
        assert_eq!(error, "gripper: gone 3 ms ago; waited 10 s");
        assert!(scribe.told.borrow().iter().all(|told| told == "Pause"), "{:?}", scribe.told.borrow());
        assert!(scribe.told.borrow().len() >= 4);
    }

    #[test]
    fn a_force_that_does_not_follow_is_trouble_and_one_on_its_way_is_not() {
        let mut around = around(None);
        let state = |force_n| GripperState { force_n: Some(force_n), ..Scribe::default().poll_state() };
        let asked = step(Phase::Waiting, Motion::Pause);
        assert_eq!(around.lacks(0, &state(10.0), &asked), None);
        assert_eq!(around.lacks(S, &state(12.0), &asked), None);
        assert_eq!(around.lacks(S + S / 4, &state(17.0), &asked), None, "it has come up");
        assert_eq!(around.lacks(2 * S, &state(10.0), &asked), None, "counted anew");
        let why = around.lacks(4 * S, &state(10.0), &asked).expect("too long");
        assert!(why.contains("expected 20.0 N per finger, measured 10.0 N"), "{why}");
        assert_eq!(around.lacks(5 * S, &state(0.0), &step(Phase::Releasing, Motion::Release)), None);
    }

    impl Scribe {
        fn poll_state(mut self) -> GripperState {
            Gripper::poll(&mut self).expect("there")
        }
    }
}
