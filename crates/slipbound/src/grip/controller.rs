//! The trait of grip controllers, their decision, and the limits that hold for all of them.

use crate::hand::HandReport;
use crate::port::{GripCommand, GripperState};
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// What the arm may do while the grip force is adjusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmMotion {
    /// It may move.
    Go,
    /// It stands still until the grip force has been reached.
    Pause,
}

/// The decision of a controller: the grip force, and whether the arm may move meanwhile. Controllers never release;
/// tasks do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripDecision {
    /// Normal force per finger in newtons.
    pub force_n: f64,
    /// What the arm may do.
    pub arm: ArmMotion,
}

impl GripDecision {
    /// The command for the gripper.
    pub const fn command(&self) -> GripCommand {
        GripCommand::Hold { force_n: self.force_n }
    }
}

/// Decides the grip force.
pub trait GripController {
    /// The decision for this cycle. `now_ns` is the time of the loop in nanoseconds and must not decrease.
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision;

    /// How often it reacted to slip, or would have reacted had it not been at its limit.
    fn alarms_count(&self) -> u32;

    /// Whether slip was detected while it was at its largest force.
    fn wants_more(&self) -> bool;

    /// The slip margin it uses, 0 to 1; None for a controller that uses none.
    fn margin(&self) -> Option<f64> {
        None
    }

    /// The gripper holds with this force, N per finger, although a lower one was decided. Returns whether the next
    /// decision starts from this force; otherwise [`Guard`](super::Guard) adds the controller's increases to it.
    fn start_from(&mut self, _force_n: f64) -> bool {
        false
    }
}

/// Force limits that hold for every controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct GripLimits {
    /// Force per finger with which an object is grasped, N. The paper starts at 10 N.
    pub start_n: f64,
    /// Minimum force while something is held, N per finger: 5 N is the minimum of a WSG-50.
    pub least_n: f64,
    /// Maximum force, N per finger: 60 N in the paper, less where the object would be crushed.
    pub most_n: f64,
    /// Blind force: the force per finger to raise the grip to when no finger can be judged, N; None keeps the present
    /// force.
    pub blind_force_n: Option<f64>,
    /// Time without any live finger after which the hand counts as blind, ns.
    pub blind_after_ns: u64,
}

impl Default for GripLimits {
    fn default() -> Self {
        // Just under three frames at 30 Hz: one lost frame is no reason to stop.
        GripLimits { start_n: 10.0, least_n: 5.0, most_n: 60.0, blind_force_n: None, blind_after_ns: 90_000_000 }
    }
}

impl GripLimits {
    /// The same with other forces per finger, N: starting, minimum and maximum force.
    #[must_use]
    pub const fn with_forces_n(self, start_n: f64, least_n: f64, most_n: f64) -> Self {
        GripLimits { start_n, least_n, most_n, ..self }
    }

    /// The same with this blind force, N per finger.
    #[must_use]
    pub const fn with_blind_force_n(self, blind_force_n: Option<f64>) -> Self {
        GripLimits { blind_force_n, ..self }
    }

    /// Checks every limit; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("grip.least_n", self.least_n, 0.1, 1000.0)?;
        within("grip.most_n", self.most_n, self.least_n, 1000.0)?;
        within("grip.start_n", self.start_n, self.least_n, self.most_n)?;
        if let Some(force_n) = self.blind_force_n {
            within("grip.blind_force_n", force_n, self.least_n, self.most_n)?;
        }
        within("grip.blind_after_ns", self.blind_after_ns as f64, 0.0, 10e9)
    }
}

/// Longest time step between two decisions, s. After a gap (blind fingers, a lost link) the force continues at its
/// usual rate: it does not catch up in one step because of a single frame.
const LONGEST_STEP_S: f64 = 0.1;

/// A longer time without a decision, ns, is a gap: fingers may have been judged in it, and the load may have changed.
pub(super) const GAP_NS: u64 = 250_000_000;

/// Time since the last decision, by which rates are multiplied, s: 0 for the first one, at most 0.1.
pub(super) fn step_s(last_ns: Option<u64>, now_ns: u64) -> f64 {
    (now_ns.saturating_sub(last_ns.unwrap_or(now_ns)) as f64 * 1e-9).min(LONGEST_STEP_S)
}

/// Difference from a commanded force, N per finger or as a share of it, up to which it counts as reached.
const ARRIVED_N: f64 = 0.5;
const ARRIVED_FRACTION: f64 = 0.05;

/// The same for this force: half a newton or a twentieth.
pub(super) fn tolerance_n(target_n: f64) -> f64 {
    ARRIVED_N.max(ARRIVED_FRACTION * target_n)
}

/// Whether a commanded force has been reached.
pub(crate) fn arrived(target_n: f64, gripper: &GripperState) -> bool {
    gripper.pressed_n().is_some_and(|n| (n - target_n).abs() <= tolerance_n(target_n))
}
