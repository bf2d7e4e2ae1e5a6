//! The law of the paper's bottle experiments: hold with 10 N; at incipient slip pause, add 10 N, continue, up to 60 N.
//! Beyond the paper: what was loaded and can be judged no longer is gripped harder, slowly and within bounds.
//!
//! ```text
//!   force   60 |                    ____
//!              |               ____|        x  incipient slip
//!              |          ____|x   x
//!           10 |_________|x
//!              +---------------------------> time     the arm pauses at each step until the force has been reached
//! ```

use super::controller::{ArmMotion, GripController, GripDecision, GripLimits, arrived, step_s};
use super::unsure::UnsureRise;
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::GripperState;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Settings of [`OnSlip`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct OnSlipSettings {
    /// Force per finger added at each slip, N: 10 in the paper. Negative for laying down: each slip lowers the force.
    pub step_n: f64,
    /// Time after a step in which further slip counts as the same slip, ns.
    pub hold_off_ns: u64,
    /// Time for which the force must be settled before the arm moves on, ns. Meanwhile the monitor takes a new
    /// reference.
    pub settle_ns: u64,
    /// Longest pause for one step, ns, so that a gripper that never reports its force does not stop the arm forever.
    pub longest_pause_ns: u64,
    /// Rate of increase while a contact that was loaded when last judged is `unsure`, N per finger and second; 0: none,
    /// as in the paper. None either where `step_n` is not positive.
    pub unsure_n_per_s: f64,
    /// Limit of that increase between two slips, as a fraction of the grip at which it began.
    pub unsure_most_fraction: f64,
}

/// While the hand is `unsure`, a slip is not reported where the grip force is unknown. A margin of at most this counts as
/// one, whatever `slip.alarm_margin_fraction`; a larger one, from images alone, does not count as judged.
const SLIPPING_MARGIN: f64 = 0.5;

impl Default for OnSlipSettings {
    fn default() -> Self {
        OnSlipSettings {
            step_n: 10.0,
            hold_off_ns: 200_000_000,
            settle_ns: 90_000_000,
            longest_pause_ns: 1_000_000_000,
            unsure_n_per_s: 10.0,
            unsure_most_fraction: 0.5,
        }
    }
}

impl OnSlipSettings {
    /// The same with this step, N per finger.
    #[must_use]
    pub const fn with_step_n(self, step_n: f64) -> Self {
        OnSlipSettings { step_n, ..self }
    }

    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("on_slip.step_n", self.step_n, -1000.0, 1000.0)?;
        within("on_slip.hold_off_ns", self.hold_off_ns as f64, 0.0, 10e9)?;
        within("on_slip.settle_ns", self.settle_ns as f64, 0.0, 10e9)?;
        within("on_slip.longest_pause_ns", self.longest_pause_ns as f64, 0.0, 60e9)?;
        within("on_slip.unsure_n_per_s", self.unsure_n_per_s, 0.0, 1000.0)?;
        within("on_slip.unsure_most_fraction", self.unsure_most_fraction, 0.0, 10.0)
    }
}

#[derive(Debug, Clone, Copy)]
enum Phase {
    Steady,
    /// The force has been changing since `since_ns`; it reached its target at `arrived_ns`.
    Stepping {
        since_ns: u64,
        arrived_ns: Option<u64>,
    },
}

/// A force step at each incipient slip.
#[derive(Debug, Clone)]
pub struct OnSlip {
    settings: OnSlipSettings,
    limits: GripLimits,
    force_n: f64,
    phase: Phase,
    alarms_count: u32,
    last_alarm_ns: Option<u64>,
    wants_more: bool,
    last_ns: Option<u64>,
    unsure_rise: UnsureRise,
}

impl OnSlip {
    /// Starts with the starting force of the limits.
    pub fn new(settings: OnSlipSettings, limits: &GripLimits) -> Result<Self, SettingError> {
        settings.check()?;
        Ok(OnSlip {
            settings,
            limits: *limits,
            force_n: limits.start_n,
            phase: Phase::Steady,
            alarms_count: 0,
            last_alarm_ns: None,
            wants_more: false,
            last_ns: None,
            unsure_rise: UnsureRise::new(settings.unsure_n_per_s, settings.unsure_most_fraction),
        })
    }

    fn alarm(&mut self, now_ns: u64, gripper: &GripperState) {
        self.alarms_count += 1;
        self.last_alarm_ns = Some(now_ns);
        let force_n = (self.force_n + self.settings.step_n).clamp(self.limits.least_n, self.limits.most_n);
        if force_n == self.force_n {
            // Slip before the gripper has reached that force proves nothing.
            self.wants_more |= self.settings.step_n > 0.0 && self.has_arrived(gripper);
            return;
        }
        self.force_n = force_n;
        self.unsure_rise.begin_anew();
        self.phase = Phase::Stepping { since_ns: now_ns, arrived_ns: None };
    }

    /// Whether the gripper has reached the force. One that holds with more, because it may not be lowered, has it as soon
    /// as it exerts what it was told last: the step may have been added to that.
    fn has_arrived(&self, gripper: &GripperState) -> bool {
        let holds_more = gripper.pressed_n().is_some_and(|n| n > self.force_n)
            && gripper.target_n.is_none_or(|target_n| arrived(target_n, gripper));
        arrived(self.force_n, gripper) || self.settings.step_n > 0.0 && holds_more
    }

    /// What was loaded and is `unsure` may be slipping.
    fn raise_while_unsure(&mut self, hand: &HandReport, elapsed_s: f64) {
        self.unsure_rise.see(hand);
        let judged = hand.margin.filter(|margin| hand.state != SlipState::Unsure || *margin <= SLIPPING_MARGIN);
        if let Some(margin) = judged {
            self.unsure_rise.judged(margin);
        }
        let may_slip = hand.margin.is_none_or(|margin| margin <= SLIPPING_MARGIN);
        if hand.state == SlipState::Unsure && may_slip && self.settings.step_n > 0.0 {
            self.force_n = self.unsure_rise.raised_n(self.force_n, self.limits.most_n, elapsed_s);
        }
    }
}

impl GripController for OnSlip {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        let elapsed_s = step_s(self.last_ns.replace(now_ns), now_ns);
        self.raise_while_unsure(hand, elapsed_s);
        let held_off = self.last_alarm_ns.is_some_and(|last| now_ns.saturating_sub(last) < self.settings.hold_off_ns);
        if hand.state.is_slip() && !held_off {
            self.alarm(now_ns, gripper);
        }
        if let Phase::Stepping { since_ns, arrived_ns } = self.phase {
            let arrived_ns = self.has_arrived(gripper).then(|| arrived_ns.unwrap_or(now_ns));
            let stood = arrived_ns.is_some_and(|at| now_ns.saturating_sub(at) >= self.settings.settle_ns);
            let too_long = now_ns.saturating_sub(since_ns) >= self.settings.longest_pause_ns;
            self.phase = if stood || too_long { Phase::Steady } else { Phase::Stepping { since_ns, arrived_ns } };
        }
        let arm = match self.phase {
            Phase::Steady => ArmMotion::Go,
            Phase::Stepping { .. } => ArmMotion::Pause,
        };
        GripDecision { force_n: self.force_n, arm }
    }

    fn alarms_count(&self) -> u32 {
        self.alarms_count
    }

    fn wants_more(&self) -> bool {
        self.wants_more
    }
}
