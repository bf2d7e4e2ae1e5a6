//! The control loop: frames in, commands out. It receives the time as an argument, so that simulation, emulators,
//! replay and hardware drive the same code.
//!
//! ```text
//!   finger 0: source -> rest -> monitor --.
//!   finger 1: source -> rest -> monitor --+--> Hand --> Task --> gripper, wrist      a cycle
//!   gripper, wrist: poll -----------------'                 '--> CycleObserver
//! ```
//!
//! Guarantee: a fault of software or of a link never opens a hand. While gripper or wrist have a fault (a lost link, no
//! answer, a refusal, a latched fast stop, jaws that no longer hold, a force or a wrist that does not follow) the wrist is
//! paused, the force is kept (a command that the gripper does not reach may fall to what it exerts), and the loop
//! continues to judge frames and waits, for up to ten seconds. Jaws that have opened are not closed again. On any other
//! error the loop ends: the wrist is paused first, and the gripper keeps its force, or raises it to the blind force if
//! that is set and higher.
//!
//! The loop has no clock and no threads. Its driver calls [`ControlLoop::cycle`] when frames are due and
//! [`Gripper::poll_io`] every few ms in between: `slipbound_rig::realtime` for hardware, `slipbound_lab::lockstep` for
//! the simulator.

mod cycle;
mod error;
mod fault;
mod observer;

pub use cycle::{Cycle, CycleOutcome};
pub use error::ControlError;
pub use fault::{Fault, FaultKind};
pub use observer::{CycleObserver, CycleView};

use crate::events::{SlipEpisodes, SlipObservation};
use crate::finger_pipeline::{FingerPipeline, FingerView, MonitorRunner, Sequential};
use crate::grip::{ForceSense, GripController};
use crate::hand::{FINGERS_MOST, Hand, HandReport, Mounting, check_sides};
use crate::monitor::{RestKind, SlipState};
use crate::port::{
    DriverEvent, GripCommand, GripSample, Gripper, GripperErrorKind, GripperState, Jaws, Wrist, WristCommand,
    WristMotion, WristState,
};
use crate::setting::SettingError;
use crate::task::{Observation, Phase, Task, TaskStep};
use fault::{FaultLog, ForceShortfall, HoldEnd, WristStandstill};

/// A pause of the wrist, whatever it is doing.
const PAUSE: WristCommand = WristCommand::new(WristMotion::Pause);

/// Gripper and wrist at the beginning of a cycle.
struct Polled {
    /// State of the gripper as it was read: the record contains it.
    state: GripperState,
    /// The same with its force corrected: the loop uses it.
    sensed: GripperState,
    wrist_state: WristState,
    /// Why the wrist could not be polled; its state is then its last one.
    wrist_fault: Option<Fault>,
}

/// The step of a cycle.
struct Decided {
    step: TaskStep,
    /// The fault that is present, if any.
    fault: Option<Fault>,
    /// Whether it is the step on a fault, present or just over.
    on_fault: bool,
}

/// What became of the commands of a cycle.
#[derive(Debug, PartialEq)]
struct Sent {
    /// The fault of a device that did not accept its command.
    fault: Option<Fault>,
    /// Whether the gripper kept its force because the command was lower.
    refused_lowering: bool,
}

/// The control loop of one hand.
pub struct ControlLoop {
    fingers: Vec<FingerPipeline>,
    runner: Box<dyn MonitorRunner>,
    hand: Hand,
    task: Box<dyn Task + Send>,
    faults: FaultLog,
    force: ForceSense,
    shortfall: ForceShortfall,
    hold_end: HoldEnd,
    standstill: WristStandstill,
    refused_lowering: Option<String>,
    slips: SlipEpisodes,
    events: Vec<DriverEvent>,
    last_step: Option<TaskStep>,
    left_with_n: Option<f64>,
    /// What the gripper reported of its jaws last.
    jaws: Option<Jaws>,
    grip: Option<GripSample>,
    wrist: Option<WristState>,
}

impl ControlLoop {
    /// A loop before its first cycle; its monitors run one after the other. Fails for an invalid hand: no finger, more
    /// than [`FINGERS_MOST`], several that are all on one side, or a mounting that is not a number.
    pub fn new(fingers: Vec<FingerPipeline>, task: Box<dyn Task + Send>) -> Result<Self, SettingError> {
        let mountings: Vec<Mounting> = fingers.iter().map(FingerPipeline::mounting).collect();
        check_sides(&mountings)?;
        Ok(ControlLoop {
            hand: Hand::new(&mountings)?,
            fingers,
            runner: Box::new(Sequential),
            task,
            faults: FaultLog::default(),
            force: ForceSense::default(),
            shortfall: ForceShortfall::default(),
            hold_end: HoldEnd::default(),
            standstill: WristStandstill::default(),
            refused_lowering: None,
            slips: SlipEpisodes::default(),
            events: Vec::new(),
            last_step: None,
            left_with_n: None,
            jaws: None,
            grip: None,
            wrist: None,
        })
    }

    /// The same loop with its monitors run by `runner`, for example on threads of their own. The reports are the same.
    #[must_use]
    pub fn with_runner(self, runner: Box<dyn MonitorRunner>) -> Self {
        ControlLoop { runner, ..self }
    }

    /// The same loop with a known idle reading of the gripper's force, N per finger, instead of one learned from the
    /// open hand; used by replay.
    #[must_use]
    pub fn with_idle_force(mut self, idle_n: f64) -> Self {
        self.force.set_idle(idle_n);
        self
    }

    /// Before a cycle of a replay: whether the recorded one was [`on_fault`](Cycle::on_fault). A fault need not show in
    /// the recorded states.
    pub fn assume_fault(&mut self, now_ns: u64, is_present: bool) {
        self.faults.assume(now_ns, is_present);
    }

    /// The fingers.
    pub fn fingers(&self) -> &[FingerPipeline] {
        &self.fingers
    }

    /// The task.
    pub fn task(&self) -> &dyn Task {
        self.task.as_ref()
    }

    /// The fault of gripper or wrist that is present, or was present less than half a second ago; None otherwise.
    pub fn fault(&self) -> Option<&Fault> {
        self.faults.current()
    }

    /// One cycle: every finger's newest frame, the gripper's and the wrist's state, the commands; then `observer` is
    /// called. `now_ns` must not decrease. On an error, including that of a fault that lasts too long, the loop has
    /// been left safely ([`ControlLoop::leave`]).
    pub fn cycle(
        &mut self,
        now_ns: u64,
        gripper: &mut dyn Gripper,
        wrist: &mut dyn Wrist,
        observer: &mut dyn CycleObserver,
    ) -> Result<CycleOutcome, ControlError> {
        let outcome = self.try_cycle(now_ns, gripper, wrist);
        if outcome.is_err() {
            self.leave(gripper, wrist);
        }
        self.events.clear();
        while let Some(event) = gripper.next_event() {
            self.events.push(event);
        }
        // Hand::new has rejected an empty list and more than FINGERS_MOST.
        let views: [FingerView<'_>; FINGERS_MOST] =
            std::array::from_fn(|i| self.fingers[i.min(self.fingers.len() - 1)].view());
        observer.after_cycle(&CycleView {
            now_ns,
            outcome: outcome.as_ref().ok(),
            fingers: &views[..self.fingers.len()],
            fault: self.faults.current(),
            refused_lowering: self.refused_lowering.as_deref(),
            driver_events: &self.events,
            truth: None,
        });
        outcome
    }

    /// Leaves the hand safely: the wrist pauses, then the force stays, or rises to the blind force if that is set and an
    /// object may be held. To be called when no further cycle will follow and the task has not ended.
    pub fn leave(&mut self, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) {
        // A wrist that rejects this stops when its time to live expires.
        let _ = wrist.command(PAUSE);
        let Some(TaskStep { grip: GripCommand::Hold { force_n }, phase, .. }) = self.last_step else { return };
        // A grasp has nothing between jaws that are open or on their way: they would go on with the higher force.
        let is_empty = phase == Phase::Grasping && matches!(self.jaws, Some(Jaws::Open | Jaws::Closing));
        let is_over = matches!(phase, Phase::Releasing | Phase::Ended(_));
        let holds = !is_over && !is_empty && !self.hold_end.has_opened();
        if let Some(force_n) = self.task.grip().limits().blind_force_n.filter(|n| holds && *n > force_n) {
            // A gripper that rejects this keeps its force.
            let is_accepted = gripper.command(GripCommand::Hold { force_n }).is_ok();
            self.left_with_n = is_accepted.then_some(force_n).or(self.left_with_n);
        }
    }

    /// The blind force, N per finger, if [`ControlLoop::leave`] has raised the grip to it.
    pub fn left_with_n(&self) -> Option<f64> {
        self.left_with_n
    }

    fn try_cycle(
        &mut self,
        now_ns: u64,
        gripper: &mut dyn Gripper,
        wrist: &mut dyn Wrist,
    ) -> Result<CycleOutcome, ControlError> {
        let polled = self.poll(now_ns, gripper, wrist);
        if !self.look()? {
            return Ok(CycleOutcome::SourceEnded);
        }
        let Polled { state, sensed, wrist_state, wrist_fault } = match polled {
            Ok(polled) => polled,
            Err(fault) => {
                self.task.interrupt();
                self.raise_fault(now_ns, fault, wrist)?;
                return Ok(CycleOutcome::Waiting);
            }
        };
        if self.fingers.iter().any(|finger| finger.monitor().is_none()) {
            self.faults.clear(now_ns);
            return Ok(CycleOutcome::FindingRest);
        }
        let hand = self.hand.report(now_ns);
        self.slips.see(&SlipObservation::of_hand(now_ns, &hand));
        // What the fingers were judged with; taking over may change it.
        let idle_force_n = self.force.idle_n();
        if self.last_step.is_none() {
            self.take_over(&state, &hand)?;
        }
        let observation = Observation { now_ns, hand: &hand, gripper: &sensed, wrist: &wrist_state };
        if self.hold_end.has_opened() && state.jaws == Jaws::Holding && is_force_unknown(&state) {
            return Err(ControlError::HeldForceUnknown); // grasped again with a force of somebody else
        }
        let Decided { step, fault, on_fault } = self.decide(&observation, wrist_fault);
        let refused_lowering = self.send(&observation, &step, fault, gripper, wrist)?;
        let grip = self.task.grip();
        Ok(CycleOutcome::Commanded(Cycle {
            time_ns: now_ns,
            hand,
            gripper: state,
            idle_force_n,
            wrist: wrist_state,
            grip_command: step.grip,
            wrist_command: step.wrist,
            phase: step.phase,
            margin: grip.margin(),
            alarms_count: grip.alarms_count(),
            slips_count: self.slips.count(),
            truth: None,
            fault: self.faults.current().is_some(),
            on_fault,
            refused_lowering,
        }))
    }

    /// Polls gripper and wrist; a fault where one of them gives no usable state.
    fn poll(&mut self, now_ns: u64, gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) -> Result<Polled, Fault> {
        let polled = gripper.poll();
        self.jaws = polled.as_ref().map(|state| state.jaws).ok().or(self.jaws);
        if matches!(&polled, Err(error) if error.kind == GripperErrorKind::Link) {
            self.hold_end.lose_sight();
        }
        let state = polled.map_err(Fault::of_gripper).and_then(|state| self.usable(state));
        self.grip = None; // a reading of this cycle, or none
        // A wrist that cannot be polled is taken to stand at its last position; the grip still reacts to slip.
        let wrist_known = match (wrist.poll().map_err(Fault::of_wrist), self.wrist) {
            (Ok(state), _) => Ok((state, None)),
            (Err(fault), Some(last)) => Ok((WristState { moving: false, ..last }, Some(fault))),
            (Err(fault), None) => Err(fault),
        };
        self.wrist = wrist_known.as_ref().ok().map(|(state, _)| *state);
        let (state, (wrist_state, wrist_fault)) = (state?, wrist_known?);
        let sensed = match self.last_step {
            None => self.force.rest(&state, !self.is_unloaded()),
            Some(_) => self.force.see(now_ns, &state, true),
        };
        self.grip = sensed.pressed_n().map(|force_n| GripSample { force_n });
        Ok(Polled { state, sensed, wrist_state, wrist_fault })
    }

    /// The step of the task, or that on a fault.
    fn decide(&mut self, observation: &Observation<'_>, wrist_fault: Option<Fault>) -> Decided {
        if self.hold_end.has_opened() && observation.gripper.jaws == Jaws::Holding {
            // Somebody grasped the object again, with a force of their own.
            let GripperState { target_n, force_n, .. } = *observation.gripper;
            let held_n = force_n.filter(|n| n.is_finite()).into_iter().chain(target_n).fold(0.0, f64::max);
            self.task.grip_mut().raise_to(held_n);
        }
        let step = self.task.step(observation);
        let shortfall = self.shortfall.check(observation.now_ns, observation.gripper, &step);
        // A force that the gripper does not reach need not be kept.
        let pressed_n = observation.gripper.force_n.filter(|_| shortfall.is_some());
        let commanded = self.last_step.map(|last| last.wrist.motion);
        let standstill = self.standstill.check(observation.now_ns, observation.wrist, commanded, step.wrist.motion);
        let hold_end = self.hold_end.check(observation.now_ns, observation.gripper, &step);
        let fault = hold_end.or(shortfall).or(wrist_fault).or(standstill);
        let on_fault = fault.is_some() || self.faults.current().is_some();
        let step = if on_fault { self.step_on_fault(step, pressed_n) } else { step };
        if on_fault {
            self.task.interrupt();
        }
        self.last_step = Some(step);
        Decided { step, fault, on_fault }
    }

    /// Sends the commands; raises or clears the fault. Returns whether the gripper refused to lower its force.
    fn send(
        &mut self,
        observation: &Observation<'_>,
        step: &TaskStep,
        fault: Option<Fault>,
        gripper: &mut dyn Gripper,
        wrist: &mut dyn Wrist,
    ) -> Result<bool, ControlError> {
        let sent = self.command(step, observation.gripper, gripper, wrist);
        match sent.fault.or(fault) {
            Some(fault) => self.raise_fault(observation.now_ns, fault, wrist)?,
            None => self.faults.clear(observation.now_ns),
        }
        Ok(sent.refused_lowering)
    }

    /// Judges every finger's newest frame and passes the reports to the hand. False when a source has ended.
    fn look(&mut self) -> Result<bool, ControlError> {
        // All frames are acquired first, so that they are from the same time: making a monitor from a rest frame takes
        // many frame periods.
        self.fingers.iter_mut().for_each(FingerPipeline::clear_frame);
        for finger in &mut self.fingers {
            if !finger.acquire()? {
                return Ok(false);
            }
        }
        self.fingers.iter_mut().try_for_each(FingerPipeline::process_frame)?;
        // No finger is judged until all have a rest frame; nothing is commanded before.
        if self.fingers.iter().all(|finger| finger.monitor().is_some()) {
            self.runner.judge(&mut self.fingers, self.grip)?;
        }
        for (i, finger) in self.fingers.iter().enumerate() {
            match finger.report() {
                Some(report) => self.hand.see(i, report),
                None => self.hand.missed(i),
            }
        }
        Ok(true)
    }

    /// Whether no finger was in contact when its rest frame was taken, as far as that is known.
    fn is_unloaded(&self) -> bool {
        self.fingers.iter().all(|finger| finger.rest_kind() != Some(RestKind::InContact))
    }

    /// Before the first step: keeps what the gripper holds already. Jaws may press without reporting a hold, as after an
    /// acknowledged fast stop: then they measure a force, and the fingers feel something or are blind. Fails for a hold
    /// with a force that the gripper does not tell, because any command could lower it.
    fn take_over(&mut self, state: &GripperState, hand: &HandReport) -> Result<(), ControlError> {
        let is_unloaded = self.is_unloaded();
        if state.jaws == Jaws::Holding {
            if is_force_unknown(state) {
                return Err(ControlError::HeldForceUnknown);
            }
        } else {
            let may_hold = !is_unloaded || hand.state != SlipState::NoContact;
            // A grasp lowers only what presses harder; a lower reading may be the bias of a sensor.
            let start_n = self.task.grip().limits().start_n;
            let pressed_n = if may_hold { self.force.pressed_unreported(state, start_n) } else { None };
            let Some(pressed_n) = pressed_n else { return Ok(()) };
            self.task.grip_mut().raise_to(pressed_n);
        }
        if !is_unloaded {
            // The loaded gel counts as the unloaded one, so nobody knows how much of the force is needed.
            self.task.grip_mut().never_lower();
        }
        Ok(())
    }

    /// The state if it can be used, else a fault.
    fn usable(&self, state: GripperState) -> Result<GripperState, Fault> {
        let is_over = self.last_step.is_some_and(|step| matches!(step.phase, Phase::Ended(_)));
        match state.jaws {
            Jaws::Stopped => Err(Fault::stopped()),
            Jaws::Unknown if !is_over => Err(Fault::jaws_unknown()),
            _ => Ok(state),
        }
    }

    /// The step while there is a fault: the wrist is paused, and the force is not lowered, nor the hand opened unless it
    /// was told so before the fault. `pressed_n`: the force that the gripper exerts, N, where it stays short of the
    /// command: the command is not lowered beyond it.
    fn step_on_fault(&mut self, step: TaskStep, pressed_n: Option<f64>) -> TaskStep {
        let grip = match (self.last_step.map(|last| last.grip), step.grip) {
            (Some(GripCommand::Hold { force_n: last_n }), GripCommand::Hold { force_n }) => {
                GripCommand::Hold { force_n: force_n.max(pressed_n.unwrap_or(last_n).min(last_n)) }
            }
            (Some(held @ GripCommand::Hold { .. }), GripCommand::Release) => held,
            _ => step.grip,
        };
        if let Some(force_n) = grip.force_n() {
            self.task.grip_mut().raise_to(force_n);
        }
        TaskStep { grip, wrist: PAUSE, ..step }
    }

    /// Commands wrist and gripper. `state`: the gripper's before the command.
    fn command(
        &mut self,
        step: &TaskStep,
        state: &GripperState,
        gripper: &mut dyn Gripper,
        wrist: &mut dyn Wrist,
    ) -> Sent {
        // A wrist that has to stop is stopped before the grip changes.
        let moved = wrist.command(step.wrist).map_err(Fault::of_wrist);
        if self.hold_end.has_opened() {
            return Sent { fault: moved.err(), refused_lowering: false };
        }
        match gripper.command(step.grip) {
            // A gripper that refuses to lower its force keeps the present one: that is no fault.
            Err(error) if error.kind == GripperErrorKind::Lowering => {
                // Open jaws hold nothing to be kept: with the higher force the grasp would be harder than asked for.
                let grips = matches!(state.jaws, Jaws::Holding | Jaws::Closing);
                if let Some(force_n) = state.target_n.or(state.force_n).filter(|_| grips) {
                    self.task.grip_mut().raise_to(force_n);
                }
                self.refused_lowering.get_or_insert_with(|| error.to_string());
                Sent { fault: moved.err(), refused_lowering: true }
            }
            gripped => Sent { fault: gripped.map_err(Fault::of_gripper).and(moved).err(), refused_lowering: false },
        }
    }

    /// Pauses the wrist; an error when the fault lasts too long.
    fn raise_fault(&mut self, now_ns: u64, fault: Fault, wrist: &mut dyn Wrist) -> Result<(), ControlError> {
        let _ = wrist.command(PAUSE); // the fault may be the wrist's own: it then pauses by itself
        self.faults.raise(now_ns, fault).map_err(|(fault, waited_ns)| ControlError::Fault { fault, waited_ns })
    }
}

/// Whether a gripper tells neither what it is set to nor what it measures.
fn is_force_unknown(state: &GripperState) -> bool {
    state.target_n.or(state.force_n.filter(|n| n.is_finite())).is_none()
}

#[cfg(test)]
mod tests;
