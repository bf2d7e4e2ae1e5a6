//! Limits that no controller and no task can bypass: forces stay in range, and a blind hand does not let go. Every
//! commanded force passes through here.

use super::controller::{ArmMotion, GAP_NS, GripController, GripDecision, GripLimits, step_s};
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::{GripperState, Jaws};

/// Rate at which a force that was raised while the hand was blind is lowered again, N/s, while `stick` is reported.
const RETURN_N_PER_S: f64 = 5.0;

/// A controller behind a guard.
pub struct Guard {
    inner: Box<dyn GripController + Send>,
    limits: GripLimits,
    force_n: f64,
    seen_ns: Option<u64>,
    last_ns: Option<u64>,
    blind: bool,
    /// The force that the controller wanted last, N, while the force is still above it: after a blind phase, or because
    /// it could not be lowered.
    raised_from_n: Option<f64>,
    /// The controller may not lower the force.
    never_lowers: bool,
}

impl std::fmt::Debug for Guard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Guard { limits, force_n, blind, .. } = self;
        f.debug_struct("Guard").field("limits", limits).field("force_n", force_n).field("blind", blind).finish()
    }
}

impl Guard {
    /// Guards a controller. The limits must have been checked.
    pub fn new(inner: Box<dyn GripController + Send>, limits: GripLimits) -> Self {
        Guard {
            inner,
            limits,
            force_n: limits.start_n,
            seen_ns: None,
            last_ns: None,
            blind: false,
            raised_from_n: None,
            never_lowers: false,
        }
    }

    /// Whether no finger has been live for longer than [`GripLimits::blind_after_ns`](crate::grip::GripLimits).
    pub fn is_blind(&self) -> bool {
        self.blind
    }

    /// Holds with a force, N per finger, set by the task instead of the controller. The same limits apply: the force does
    /// not fall without a live finger or after the object was lost, and a force that was raised while the hand was blind
    /// is lowered slowly.
    pub fn hold(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState, force_n: f64) -> GripDecision {
        let elapsed_s = self.step_s(now_ns);
        if let Some(kept) = self.decision_without_sight(now_ns, hand, gripper) {
            return kept;
        }
        let wanted = self.lower_slowly(GripDecision { force_n, arm: ArmMotion::Go }, elapsed_s, hand);
        self.limited(wanted)
    }

    /// Keeps the last force, within the same limits, for a cycle in which nobody asks for another.
    pub fn hold_last(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        self.step_s(now_ns);
        let last = GripDecision { force_n: self.force_n, arm: ArmMotion::Go };
        self.decision_without_sight(now_ns, hand, gripper).unwrap_or(last)
    }

    /// As [`GripController::decide`], but with at least the last force.
    pub fn decide_no_less(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        let before_n = self.force_n;
        let decided = self.decide(now_ns, hand, gripper);
        self.force_n = decided.force_n.max(before_n);
        GripDecision { force_n: self.force_n, ..decided }
    }

    /// The gripper holds with this force, N per finger, although it was told a lower one: it refuses to lower its
    /// force, or a fault keeps it. Whatever is added from now on is added to this force.
    pub fn raise_to(&mut self, force_n: f64) {
        let force_n = force_n.clamp(self.limits.least_n, self.limits.most_n);
        if force_n > self.force_n {
            let before_n = std::mem::replace(&mut self.force_n, force_n);
            // A force that was raised while the hand was blind stays one: it is lowered slowly.
            if self.raised_from_n.is_none() && !self.inner.start_from(force_n) {
                self.raised_from_n = Some(before_n);
            }
        }
    }

    /// The fingers felt the object for the first time when it was held and loaded already, so the controller knows only
    /// a part of the load: it may raise the force but not lower it, until neither the fingers nor the gripper hold
    /// anything. A force set by the task ([`Guard::hold`]) may be lower.
    pub fn never_lower(&mut self) {
        self.never_lowers = true;
    }

    /// Whether the force is still above the wanted one: it was raised while the hand was blind, or could not be
    /// lowered.
    pub fn is_raised(&self) -> bool {
        self.raised_from_n.is_some()
    }

    /// The force it decided on last, N per finger.
    pub fn force_n(&self) -> f64 {
        self.force_n
    }

    /// Time since the last decision, s: see [`step_s`]. Of a gap less than the time to blindness counts as time without
    /// sight, because fingers may have been judged in it; so one frame without sight after it is no blindness, and two
    /// in a row are, even where every decision is a gap away from the next.
    fn step_s(&mut self, now_ns: u64) -> f64 {
        let last_ns = self.last_ns.replace(now_ns);
        let gap_ns = last_ns.map_or(0, |last_ns| now_ns.saturating_sub(last_ns));
        if gap_ns > GAP_NS {
            let unseen_ns = gap_ns.min(self.limits.blind_after_ns.div_ceil(2));
            self.seen_ns = self.seen_ns.map(|seen_ns| seen_ns + (gap_ns - unseen_ns));
        }
        step_s(last_ns, now_ns)
    }

    /// The decision while nothing can be judged; None otherwise.
    fn decision_without_sight(
        &mut self,
        now_ns: u64,
        hand: &HandReport,
        gripper: &GripperState,
    ) -> Option<GripDecision> {
        let sees = hand.state != SlipState::Unjudged;
        let seen_ns = *self.seen_ns.get_or_insert(now_ns);
        if sees {
            self.seen_ns = Some(now_ns);
        }
        self.blind = !sees && now_ns.saturating_sub(seen_ns) >= self.limits.blind_after_ns;
        self.never_lowers &= hand.state != SlipState::NoContact || gripper.jaws == Jaws::Holding;
        let jaws_gone = matches!(gripper.jaws, Jaws::Lost | Jaws::Nothing | Jaws::Stopped | Jaws::Open);
        if sees && !jaws_gone {
            return None;
        }
        // The force is kept, or raised if that is set and something may be held; the arm pauses once the hand counts as
        // blind.
        if self.blind && !matches!(gripper.jaws, Jaws::Open | Jaws::Closing) {
            let raised_n = self.force_n.max(self.limits.blind_force_n.unwrap_or(0.0));
            if raised_n > self.force_n {
                self.raised_from_n.get_or_insert(self.force_n);
            }
            self.force_n = raised_n;
        }
        let arm = if self.blind || jaws_gone { ArmMotion::Pause } else { ArmMotion::Go };
        Some(GripDecision { force_n: self.force_n, arm })
    }

    /// The controller does not know of a force that was raised while the hand was blind or could not be lowered.
    /// Increases of the controller are added to it; it is lowered slowly, and only while nothing slips.
    fn lower_slowly(&mut self, wanted: GripDecision, elapsed_s: f64, hand: &HandReport) -> GripDecision {
        let Some(before_n) = self.raised_from_n.filter(|_| wanted.force_n.is_finite()) else { return wanted };
        let wanted_n = wanted.force_n.clamp(self.limits.least_n, self.limits.most_n);
        let added_n = (wanted_n - before_n).max(0.0);
        let released_n = if hand.state == SlipState::Stick { RETURN_N_PER_S * elapsed_s } else { 0.0 };
        let force_n = wanted_n.max(self.force_n + added_n - released_n);
        self.raised_from_n = (wanted_n < force_n).then_some(wanted_n);
        GripDecision { force_n, ..wanted }
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
        let elapsed_s = self.step_s(now_ns);
        if let Some(kept) = self.decision_without_sight(now_ns, hand, gripper) {
            return kept;
        }
        let before_n = self.force_n;
        let wanted = self.inner.decide(now_ns, hand, gripper);
        let wanted = self.lower_slowly(wanted, elapsed_s, hand);
        let decided = self.limited(wanted);
        if self.never_lowers {
            self.raise_to(before_n);
        }
        GripDecision { force_n: self.force_n, ..decided }
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

    fn start_from(&mut self, force_n: f64) -> bool {
        self.raise_to(force_n);
        true
    }
}
