//! Limits that no controller and no task can bypass: forces stay in range, and a blind hand does not let go. Every
//! commanded force comes from here.

use super::controller::{ArmMotion, GripController, GripDecision, GripLimits};
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::{GripperState, Jaws};

/// A controller, guarded.
pub struct Guard {
    inner: Box<dyn GripController + Send>,
    limits: GripLimits,
    force_n: f64,
    seen_ns: Option<u64>,
    blind: bool,
}

impl std::fmt::Debug for Guard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Guard { limits, force_n, blind, .. } = self;
        f.debug_struct("Guard").field("limits", limits).field("force_n", force_n).field("blind", blind).finish()
    }
}

impl Guard {
    /// Guards a controller with limits that were checked.
    pub fn new(inner: Box<dyn GripController + Send>, limits: GripLimits) -> Self {
        Guard { inner, limits, force_n: limits.start_n, seen_ns: None, blind: false }
    }

    /// Whether no finger has been live for longer than [`GripLimits::blind_after_ns`](crate::grip::GripLimits).
    pub fn is_blind(&self) -> bool {
        self.blind
    }

    /// Holds with a force set by the task instead of the controller. The same limits apply, and without a live finger,
    /// or after the object was lost, the force does not fall.
    pub fn hold(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState, force_n: f64) -> GripDecision {
        let wanted = GripDecision { force_n, arm: ArmMotion::Go };
        self.kept(now_ns, hand, gripper).unwrap_or_else(|| self.limited(wanted))
    }

    /// The force it decided on last, N per finger.
    pub fn force_n(&self) -> f64 {
        self.force_n
    }

    /// The decision where there is nothing to go by; None where there is.
    fn kept(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> Option<GripDecision> {
        let sees = hand.state != SlipState::Unjudged;
        let seen_ns = *self.seen_ns.get_or_insert(now_ns);
        if sees {
            self.seen_ns = Some(now_ns);
        }
        self.blind = !sees && now_ns.saturating_sub(seen_ns) >= self.limits.blind_after_ns;
        let jaws_gone = matches!(gripper.jaws, Jaws::Lost | Jaws::Nothing | Jaws::Stopped);
        if sees && !jaws_gone {
            return None;
        }
        // The force stays, or rises if that is set and something may be held; the arm waits once it is more than a frame.
        if self.blind && !matches!(gripper.jaws, Jaws::Open | Jaws::Closing) {
            self.force_n = self.force_n.max(self.limits.blind_force_n.unwrap_or(0.0));
        }
        let arm = if self.blind || jaws_gone { ArmMotion::Pause } else { ArmMotion::Go };
        Some(GripDecision { force_n: self.force_n, arm })
    }

    fn limited(&mut self, wanted: GripDecision) -> GripDecision {
        if wanted.force_n.is_finite() {
            self.force_n = wanted.force_n.clamp(self.limits.least_n, self.limits.most_n);
        }
        GripDecision { force_n: self.force_n, arm: wanted.arm }
    }

    /// Its limits.
    pub fn limits(&self) -> &GripLimits {
        &self.limits
    }
}

impl GripController for Guard {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        if let Some(kept) = self.kept(now_ns, hand, gripper) {
            return kept;
        }
        let wanted = self.inner.decide(now_ns, hand, gripper);
        self.limited(wanted)
    }

    fn alarms_count(&self) -> u32 {
        self.inner.alarms_count()
    }

    fn wants_more(&self) -> bool {
        self.inner.wants_more()
    }

    fn margin(&self) -> Option<f64> {
        self.inner.margin()
    }
}
