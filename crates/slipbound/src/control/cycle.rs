//! The record of one cycle: what was measured, what was commanded and, in simulation, the ground truth.

use super::error::ControlError;
use super::fault::Fault;
use crate::hand::HandReport;
use crate::plant::PlantTruth;
use crate::port::{GripCommand, GripperState, WristCommand, WristState};
use crate::task::{Ending, Phase};
use serde::{Deserialize, Serialize};

/// Result of a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // made once a cycle, never stored
pub enum CycleOutcome {
    /// The rest frames of the fingers are still being recorded; nothing was commanded.
    FindingRest,
    /// Gripper or wrist gave no usable state; nothing was commanded but a pause of the wrist.
    Waiting,
    /// Commands were sent.
    Commanded(Cycle),
    /// A source of frames has ended; nothing was commanded.
    SourceEnded,
}

impl CycleOutcome {
    /// The record of the cycle; None when nothing was commanded.
    pub fn commanded(&self) -> Option<&Cycle> {
        match self {
            CycleOutcome::Commanded(cycle) => Some(cycle),
            _ => None,
        }
    }

    /// Whether the task has ended, in this cycle or before.
    pub fn has_ended(&self) -> bool {
        self.commanded().is_some_and(|cycle| matches!(cycle.phase, Phase::Ended(_)))
    }

    /// Whether a run is over after this cycle: its task has ended, or a source of frames. `fault`: that of
    /// [`ControlLoop::fault`](super::ControlLoop::fault) after the cycle. Where only a time was over, or the source, a
    /// fault is what ended the work: the error is that fault.
    pub fn is_over(&self, fault: Option<&Fault>) -> Result<bool, ControlError> {
        // Who holds to the end of a time, or of the source, has not held with a fault, and jaws that a fault may have kept
        // open have not found nothing.
        let (is_over, ran_out) = match self {
            CycleOutcome::SourceEnded => (true, true),
            CycleOutcome::Commanded(Cycle { phase: Phase::Ended(ending), .. }) => (true, ending.is_timed_out()),
            CycleOutcome::FindingRest | CycleOutcome::Waiting | CycleOutcome::Commanded(_) => (false, false),
        };
        match fault.filter(|_| ran_out) {
            Some(fault) => Err(ControlError::Fault { fault: fault.clone(), waited_ns: 0 }),
            None => Ok(is_over),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// What was measured and commanded in a cycle: one line of the `reports.jsonl` of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cycle {
    /// Time of the loop, ns.
    pub time_ns: u64,
    /// The fused report of all fingers.
    pub hand: HandReport,
    /// State of the gripper before this cycle's command.
    pub gripper: GripperState,
    /// Idle reading of its force sensor, N per finger, which the loop subtracts.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub idle_force_n: f64,
    /// State of the wrist before this cycle's command.
    pub wrist: WristState,
    /// Command sent to the gripper.
    pub grip_command: GripCommand,
    /// Command sent to the wrist; a command of this cycle that fails is followed by a pause.
    pub wrist_command: WristCommand,
    /// Phase of the task.
    pub phase: Phase,
    /// The slip margin used by the controller, 0 to 1; None for a controller that uses none.
    pub margin: Option<f64>,
    /// Alarms of the controller so far.
    pub alarms_count: u32,
    /// Slips of the hand that have begun so far; when it rises, a slip begins in this cycle and this is its number.
    pub slips_count: u32,
    /// Ground truth; None outside simulation.
    pub truth: Option<PlantTruth>,
    /// Whether gripper or wrist had a fault: a lost link, a refusal, a force that does not follow its command.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fault: bool,
    /// Whether a fault was known before the commands were sent: the wrist was paused, and neither a lower force nor a
    /// new release was sent.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub on_fault: bool,
    /// Whether the gripper refused the command because it would have lowered the force.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub refused_lowering: bool,
}

impl Cycle {
    /// How the task has ended. None while it goes on, and where only a time was over while gripper or wrist had a fault:
    /// then that fault has ended it ([`CycleOutcome::is_over`]).
    pub fn ending(&self) -> Option<Ending> {
        match self.phase {
            Phase::Ended(ending) if !(self.fault && ending.is_timed_out()) => Some(ending),
            _ => None,
        }
    }
}
