//! The one record of a cycle: what was seen, what was commanded, and, in simulation, what was true.

use crate::hand::HandReport;
use crate::plant::PlantTruth;
use crate::port::{GripCommand, GripperState, WristCommand, WristState};
use crate::task::Phase;
use serde::{Deserialize, Serialize};

/// How a cycle went.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // made once a cycle, never stored
pub enum CycleOutcome {
    /// The fingers are still being looked at unloaded; nothing was commanded.
    AtRest,
    /// Gripper or wrist said nothing that could be worked with; nothing was commanded but a pause.
    Waiting,
    /// Commands went out.
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
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// What was seen and commanded in a cycle: one line of the `reports.jsonl` of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cycle {
    /// Time of the loop, ns.
    pub time_ns: u64,
    /// What the fingers said together.
    pub hand: HandReport,
    /// What the gripper said before it was commanded.
    pub gripper: GripperState,
    /// The idle reading of its force, N per finger, which the loop takes out of that.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub idle_force_n: f64,
    /// What the wrist said before it was commanded.
    pub wrist: WristState,
    /// What the gripper was told.
    pub grip_command: GripCommand,
    /// What the task wanted of the wrist; while there is a `fault` it was paused instead.
    pub wrist_command: WristCommand,
    /// What the task was doing.
    pub phase: Phase,
    /// The slip margin the controller reckoned with, 0 to 1; None for a controller that has none.
    pub margin: Option<f64>,
    /// Alarms of the controller so far.
    pub alarms_count: u32,
    /// Slips of the hand that have begun so far; when it rises, a slip begins in this cycle and this is its number.
    pub slips_count: u32,
    /// What was true, where that is known.
    pub truth: Option<PlantTruth>,
    /// Whether gripper or wrist had a fault: a lost link, a refusal, a force that does not follow.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fault: bool,
}
