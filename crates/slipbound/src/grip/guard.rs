//! What no controller may get past: forces stay in range, and a hand that sees nothing does not let go.

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
    /// Guards a controller by limits that were checked.
    pub fn new(inner: Box<dyn GripController + Send>, limits: GripLimits) -> Self {
        Guard { inner, limits, force_n: limits.start_n, seen_ns: None, blind: false }
    }

    /// Whether no finger has been live for longer than the limit.
    pub fn is_blind(&self) -> bool {
        self.blind
    }

    /// The limits it keeps.
    pub fn limits(&self) -> &GripLimits {
        &self.limits
    }
}

impl GripController for Guard {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        let sees = hand.state != SlipState::Unjudged;
        let seen_ns = *self.seen_ns.get_or_insert(now_ns);
        if sees {
            self.seen_ns = Some(now_ns);
        }
        self.blind = !sees && now_ns.saturating_sub(seen_ns) >= self.limits.blind_after_ns;
        let jaws_gone = matches!(gripper.jaws, Jaws::Lost | Jaws::Nothing | Jaws::Stopped);
        if !sees || jaws_gone {
            // Nothing to go by: the force stays, or rises if that is set; the arm waits once it is more than a frame.
            if self.blind {
                self.force_n = self.force_n.max(self.limits.blind_force_n.unwrap_or(0.0));
            }
            let arm = if self.blind || jaws_gone { ArmMotion::Pause } else { ArmMotion::Go };
            return GripDecision { force_n: self.force_n, arm };
        }
        let wanted = self.inner.decide(now_ns, hand, gripper);
        if wanted.force_n.is_finite() {
            self.force_n = wanted.force_n.clamp(self.limits.least_n, self.limits.most_n);
        }
        GripDecision { force_n: self.force_n, arm: wanted.arm }
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
