//! Lifting and holding: raise the object, then hold it for a time while it may be filled or pulled at.

use super::grasp::{Grasp, Grasped};
use super::shear_offset::ShearOffset;
use super::step::{ARRIVED_MM, Ending, Missing, Observation, PAUSE, Phase, Task, TaskStep, lower};
use crate::grip::{ArmMotion, GripController, GripDecision, Guard};
use crate::hand::Allowed;
use crate::monitor::SlipState;
use crate::port::Jaws;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Longest time between two steps that counts as held, ns.
const LONGEST_STEP_NS: u64 = 250_000_000;

/// Settings of [`Lift`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct LiftSettings {
    /// How far to lift, mm.
    pub lift_mm: f64,
    /// Rate, mm/s.
    pub rate_mm_per_s: f64,
    /// How long to hold it after that, ns. Time in which no finger feels it, or the gripper does not report a hold,
    /// does not count.
    pub hold_ns: u64,
    /// Where the object may slide: nowhere.
    pub allowed: Allowed,
}

impl Default for LiftSettings {
    fn default() -> Self {
        LiftSettings { lift_mm: 20.0, rate_mm_per_s: 20.0, hold_ns: 8_000_000_000, allowed: Allowed::default() }
    }
}

impl LiftSettings {
    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("lift.lift_mm", self.lift_mm, 0.0, 1000.0)?;
        within("lift.rate_mm_per_s", self.rate_mm_per_s, 0.1, 100.0)?;
        within("lift.hold_ns", self.hold_ns as f64, 0.0, 1e15)
    }
}

/// Lifting and holding.
#[derive(Debug)]
pub struct Lift {
    settings: LiftSettings,
    grip: Guard,
    grasp: Grasp,
    shear_offset: ShearOffset,
    phase: Phase,
    start_mm: Option<f64>,
    /// Time of the last step of work, ns.
    worked_ns: Option<u64>,
    is_up: bool,
    /// For how long the lifted object was felt and held, ns.
    held_ns: u64,
    last: GripDecision,
}

impl Lift {
    /// Starts with the object between the open jaws. Fails for invalid settings.
    pub fn new(settings: LiftSettings, grip: Guard) -> Result<Self, SettingError> {
        settings.check()?;
        let last = GripDecision { force_n: grip.limits().start_n, arm: ArmMotion::Pause };
        let (grasp, phase) = (Grasp::default(), Phase::Grasping);
        Ok(Lift {
            settings,
            grip,
            grasp,
            shear_offset: ShearOffset::default(),
            phase,
            start_mm: None,
            worked_ns: None,
            is_up: false,
            held_ns: 0,
            last,
        })
    }

    fn work(&mut self, observation: &Observation<'_>) {
        let seen =
            self.shear_offset.correct(&self.settings.allowed.filter(observation.hand), observation.gripper.pressed_n());
        self.last = self.grip.decide(observation.now_ns, &seen, observation.gripper);
        let since_ns = self.worked_ns.replace(observation.now_ns).unwrap_or(observation.now_ns);
        // Time counts as held only while the object is felt; of a long gap between two steps only a part counts.
        let feels = !matches!(observation.hand.state, SlipState::Unjudged | SlipState::NoContact)
            && observation.gripper.jaws == Jaws::Holding;
        if self.is_up && feels {
            self.held_ns += observation.now_ns.saturating_sub(since_ns).min(LONGEST_STEP_NS);
        }
        self.is_up |= self.left_mm(observation) <= ARRIVED_MM;
        self.phase = match () {
            _ if observation.is_lost() => Phase::Ended(Ending::Lost),
            _ if self.is_up && feels && self.held_ns >= self.settings.hold_ns => Phase::Ended(Ending::Held),
            _ if self.is_up || self.last.arm == ArmMotion::Pause => Phase::Waiting,
            _ => Phase::Working,
        };
    }

    /// How far it is still to be lifted, mm.
    fn left_mm(&mut self, observation: &Observation<'_>) -> f64 {
        let lowered_mm = observation.wrist.lowered_mm;
        self.settings.lift_mm - (*self.start_mm.get_or_insert(lowered_mm) - lowered_mm)
    }
}

impl Task for Lift {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        match self.phase {
            Phase::Grasping => {
                match self.grasp.step(observation, &self.settings.allowed.filter(observation.hand), &mut self.grip) {
                    Grasped::NotYet(grip) => self.last = grip,
                    Grasped::Yes(grip) => {
                        self.shear_offset.take(observation.hand, observation.gripper.pressed_n());
                        self.last = grip;
                        self.phase = Phase::at_work(grip.arm);
                    }
                    Grasped::Never(ending) => self.phase = Phase::Ended(ending),
                }
            }
            Phase::Ended(_) => {}
            _ => self.work(observation),
        }
        let wrist = match self.phase {
            Phase::Working => lower(-self.settings.rate_mm_per_s, self.left_mm(observation)),
            _ => PAUSE,
        };
        TaskStep { grip: self.last.command(), wrist, phase: self.phase }
    }

    fn grip(&self) -> &Guard {
        &self.grip
    }

    fn grip_mut(&mut self) -> &mut Guard {
        &mut self.grip
    }

    fn interrupt(&mut self) {
        self.grasp.interrupt();
    }

    fn missing(&self) -> Option<Missing> {
        self.grasp.missing().filter(|_| self.phase == Phase::Grasping)
    }
}
