//! Our controller: holds a slip margin. The grip is proportional to the load, is reduced slowly when that is safe, and
//! is bounded by a floor, a largest force and a rate.
//!
//! ```text
//!   used         f = 1 - margin, the largest among the fingers: load over the load at which the object slides
//!   f > target         : P -> P f / target        at most `raise_n_per_s`
//!   f < target - slack : P falls by `release_n_per_s`, not below the floor, once the load stood for half a second;
//!                        beyond 1.5 times the wanted force it decays with rate `release_excess_per_s` if faster
//! ```
//!
//! On a slippery object a step of the load needs a larger change of force, for which the gripper needs more time.
//! Therefore the target is lower there. The friction is the monitor's estimate; where it is unknown the contact is
//! assumed to be slippery.
//!
//! Where the view cuts the contact the margin is unreliable, because the rim slips outside the view. The target is then
//! reduced to seven tenths ([`MarginSettings::cut_target_share`]), and the force is not lowered under a load. After a
//! slide it is not lowered below the force that stopped the slide until the load has fallen. It is not lowered while
//! fewer fingers know a margin than before in this grasp: the missing finger may have the smallest margin.
//!
//! While the object slides under the force that should hold it, the force rises from the commanded one, and a command
//! that has stood for a second, and that the gripper does not report as not accepted, counts as reached, whatever the
//! gripper reads: a reading that is too low does not hide that more force is needed.
//!
//! When a loaded finger in contact gives no margin, the force is raised slowly, up to a limit: see
//! [`MarginSettings::unsure_n_per_s`].
//!
//! f is the monitor's estimate (step 6). The force f P at which the object would slide is averaged over
//! [`MarginSettings::average_ns`]; above [`MarginSettings::urgent_fraction`] a single frame counts. The controller
//! needs the stiffness of the gel (see [`Shear`](crate::sensor::Shear)) and the grip force: it is refused without the
//! first; without a measurement of the second it does not lower the grip, and where the gripper does not tell the force
//! it was set to either, it raises it in the same slow way while too much is used.

use super::controller::{ArmMotion, GAP_NS, GripController, GripDecision, GripLimits, arrived, step_s, tolerance_n};
use super::unsure::UnsureRise;
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::GripperState;
use crate::setting::{SettingError, within};
use crate::smoothing;
use serde::{Deserialize, Serialize};

/// The minimum holding force is growing, and the grip is not lowered, while it exceeds its mean over this time by this
/// share plus this force. Friction is estimated late: force released under a growing load would be missing then.
const STANDS_S: f64 = 0.5;
const GROWN_FRACTION: f64 = 0.03;
const GROWN_N: f64 = 0.1;

/// Time for which the command must have stood to count as reached, ns: longer than jaws ever need to build up force.
const REACHED_NS: u64 = 1_000_000_000;

/// Force beyond this multiple of the wanted force is excess.
const EXCESS: f64 = 1.5;

/// Share of the contact at the border of the view up to which a margin is reliable, and from which it is fully
/// doubtful. The rim outside the view slips unseen: for a slippery bottle two thirds of the used fraction are
/// estimated. For a band of contact along ten columns of markers the share is 0.1 at one end, 0.2 at both.
const DOUBTFUL_CUT: (f64, f64) = (0.05, 0.15);
/// With a doubtful margin the force is not lowered above this used fraction.
const DOUBTFUL_LOADED_FRACTION: f64 = 0.15;
/// The force that stopped a slide is kept until the minimum holding force has fallen to this share of its value then.
const LOAD_FALLEN_FRACTION: f64 = 0.3;

/// The grip lags behind the load, and the arm waits, while the command exceeds the force by this factor and the used
/// fraction exceeds its target by this much.
const LAGGING_FORCE_RATIO: f64 = 1.2;
const LAGGING_USED_FRACTION: f64 = 0.15;

/// Friction coefficient at or below which a contact counts as slippery, and from which it does not.
const FRICTION: (f64, f64) = (0.3, 0.9);

/// Settings of [`Margin`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct MarginSettings {
    /// Above 0, a finger whose sensor file states no shear stiffness is not refused, MPa/mm. The value itself is not used:
    /// the margin is the monitor's, by the stiffness in the sensor file, and without one from images alone.
    pub stiffness_mpa_per_mm: f64,
    /// Target used fraction for a friction coefficient of 0.9 or more, 0 to 1.
    pub target_fraction: f64,
    /// Target used fraction for a friction coefficient of 0.3 or less, or an unknown one; at most `target_fraction`;
    /// linear in between.
    pub slippery_target_fraction: f64,
    /// Share of the target that is held where the view cuts the contact; 1: no reduction.
    pub cut_target_share: f64,
    /// Used fraction above which a single frame counts instead of the average.
    pub urgent_fraction: f64,
    /// Averaging time of the minimum holding force, ns.
    pub average_ns: u64,
    /// The grip is reduced while the used fraction is below the target by more than this.
    pub slack_fraction: f64,
    /// Maximum rate of increase, N per finger and second.
    pub raise_n_per_s: f64,
    /// Rate of reduction, N per finger and second; 0: never.
    pub release_n_per_s: f64,
    /// Decay rate, 1/s, of the force beyond 1.5 times the wanted one, where that is faster than `release_n_per_s`:
    /// after a cap has broken loose the grip is many times larger than needed. 0: always `release_n_per_s`.
    pub release_excess_per_s: f64,
    /// Rate of increase while a contact that was loaded when last judged gives no margin, or while too much is used of
    /// a grip whose force is unknown, N per finger and second; 0: none.
    pub unsure_n_per_s: f64,
    /// Limit of that increase, as a fraction of the grip at which it began.
    pub unsure_most_fraction: f64,
}

impl Default for MarginSettings {
    fn default() -> Self {
        MarginSettings {
            stiffness_mpa_per_mm: 0.0,
            target_fraction: 0.76,
            slippery_target_fraction: 0.55,
            cut_target_share: 0.7,
            urgent_fraction: 0.8,
            average_ns: 100_000_000,
            slack_fraction: 0.05,
            raise_n_per_s: 120.0,
            release_n_per_s: 5.0,
            release_excess_per_s: 4.0,
            unsure_n_per_s: 10.0,
            unsure_most_fraction: 0.5,
        }
    }
}

impl MarginSettings {
    /// The same for a finger whose sensor file states no shear stiffness, MPa/mm above 0.
    #[must_use]
    pub const fn with_stiffness_mpa_per_mm(self, stiffness_mpa_per_mm: f64) -> Self {
        MarginSettings { stiffness_mpa_per_mm, ..self }
    }

    /// Checks every setting except whether there is a stiffness; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("margin.stiffness_mpa_per_mm", self.stiffness_mpa_per_mm, 0.0, 100.0)?;
        within("margin.target_fraction", self.target_fraction, 0.05, 0.95)?;
        within("margin.slippery_target_fraction", self.slippery_target_fraction, 0.05, self.target_fraction)?;
        within("margin.cut_target_share", self.cut_target_share, 0.1, 1.0)?;
        within("margin.urgent_fraction", self.urgent_fraction, self.target_fraction, 1.0)?;
        within("margin.average_ns", self.average_ns as f64, 0.0, 1e9)?;
        within("margin.slack_fraction", self.slack_fraction, 0.0, self.slippery_target_fraction)?;
        within("margin.raise_n_per_s", self.raise_n_per_s, 0.1, 10_000.0)?;
        within("margin.release_n_per_s", self.release_n_per_s, 0.0, 1000.0)?;
        within("margin.release_excess_per_s", self.release_excess_per_s, 0.0, 100.0)?;
        within("margin.unsure_n_per_s", self.unsure_n_per_s, 0.0, 1000.0)?;
        within("margin.unsure_most_fraction", self.unsure_most_fraction, 0.0, 10.0)
    }

    /// Target used fraction for this friction and this doubt.
    fn target(&self, friction: Option<f64>, doubt: f64) -> f64 {
        let (slippery, firm) = FRICTION;
        let firm_fraction =
            friction.map_or(0.0, |friction| ((friction - slippery) / (firm - slippery)).clamp(0.0, 1.0));
        let sure =
            self.slippery_target_fraction + firm_fraction * (self.target_fraction - self.slippery_target_fraction);
        sure * (1.0 - doubt * (1.0 - self.cut_target_share))
    }

    /// How much of `force_n` is released in this time when less is wanted, N per finger; independent of the loop rate.
    pub fn release_n(&self, force_n: f64, wanted_n: f64, elapsed_s: f64) -> f64 {
        if self.release_n_per_s <= 0.0 {
            return 0.0;
        }
        let excess_n = force_n - EXCESS * wanted_n;
        (self.release_n_per_s * elapsed_s).max(excess_n * (1.0 - libm::exp(-self.release_excess_per_s * elapsed_s)))
    }

    /// The same, with the stiffness of the finger if the settings have none. Fails when neither has one.
    pub fn for_finger(&self, of_finger_mpa_per_mm: Option<f64>) -> Result<Self, SettingError> {
        let of_finger = of_finger_mpa_per_mm.unwrap_or(0.0);
        let stiffness_mpa_per_mm = if self.stiffness_mpa_per_mm > 0.0 { self.stiffness_mpa_per_mm } else { of_finger };
        if stiffness_mpa_per_mm > 0.0 {
            return Ok(MarginSettings { stiffness_mpa_per_mm, ..*self });
        }
        Err(SettingError {
            key: "margin.stiffness_mpa_per_mm".into(),
            got: "0, and the sensor has no [shear]".into(),
            expected: "the shear stiffness of the gel: calibrate it, or use the controller on_slip".into(),
        })
    }
}

/// Doubt about a margin when this share of the contact is cut, 0 to 1.
fn doubt(cut_fraction: f64) -> f64 {
    let (none, full) = DOUBTFUL_CUT;
    ((cut_fraction - none) / (full - none)).clamp(0.0, 1.0)
}

/// A slide that a higher grip force has stopped.
#[derive(Debug, Clone, Copy)]
struct StoppedSlide {
    /// Minimum holding force in the last cycle of the slide, N.
    holding_n: f64,
    /// Force commanded in that cycle, N.
    force_n: f64,
}

/// Holds a slip margin.
#[derive(Debug, Clone)]
pub struct Margin {
    settings: MarginSettings,
    limits: GripLimits,
    force_n: f64,
    last_ns: Option<u64>,
    /// Since when this force has been decided, ns and N.
    stands: Option<(u64, f64)>,
    /// Averaged minimum holding force, N: the force at which the object would slide.
    holding_n: Option<f64>,
    /// Its average over [`STANDS_S`], N.
    slow_holding_n: f64,
    margin: Option<f64>,
    /// The largest number of fingers with a margin at a time, since the hand last held nothing.
    margins_most: u32,
    /// The last slide, until the load has fallen.
    stopped: Option<StoppedSlide>,
    unsure_rise: UnsureRise,
    alarms_count: u32,
    slipping: bool,
    wants_more: bool,
}

impl Margin {
    /// Starts with the starting force of the limits. Fails for invalid settings.
    pub fn new(settings: MarginSettings, limits: &GripLimits) -> Result<Self, SettingError> {
        let settings = settings.for_finger(None)?;
        settings.check()?;
        Ok(Margin {
            settings,
            limits: *limits,
            force_n: limits.start_n,
            last_ns: None,
            stands: None,
            holding_n: None,
            slow_holding_n: 0.0,
            margin: None,
            margins_most: 0,
            stopped: None,
            unsure_rise: UnsureRise::new(settings.unsure_n_per_s, settings.unsure_most_fraction),
            alarms_count: 0,
            slipping: false,
            wants_more: false,
        })
    }

    /// Whether a finger that had a margin earlier in this grasp has none now.
    fn misses_finger(&mut self, hand: &HandReport) -> bool {
        if hand.state == SlipState::NoContact && hand.live_count >= self.margins_most {
            self.margins_most = 0;
        }
        self.margins_most = self.margins_most.max(hand.margins_count);
        hand.margins_count < self.margins_most
    }

    /// Minimum holding force, averaged, because a single frame is noisy. It does not depend on the grip. It does not
    /// fall while a finger is missing (`misses`): the other fingers cannot measure the load on that finger.
    fn update_holding_n(&mut self, used: f64, pressed_n: f64, elapsed_s: f64, misses: bool) -> f64 {
        let limit_n = used * pressed_n;
        let average_s = self.settings.average_ns as f64 * 1e-9;
        let share = if average_s > 0.0 { smoothing::weight(elapsed_s, average_s) } else { 1.0 };
        let before_n = self.holding_n.unwrap_or(limit_n);
        let now_n = if misses { limit_n.max(before_n) } else { limit_n };
        let average_n = before_n + share * (now_n - before_n);
        self.holding_n = Some(average_n);
        if used >= self.settings.urgent_fraction { now_n.max(average_n) } else { average_n }
    }

    /// The force with which the gripper presses, N: its reading, but not less than a command that it has had long enough
    /// to reach. What it says it has not accepted it was never going to reach.
    fn pressed_n(&mut self, now_ns: u64, gripper: &GripperState) -> Option<f64> {
        let since_ns = self.stands.filter(|(_, n)| *n == self.force_n).map_or(now_ns, |(since_ns, _)| since_ns);
        self.stands = Some((since_ns, self.force_n));
        let is_accepted = gripper.target_n.is_none_or(|n| n >= self.force_n - tolerance_n(self.force_n));
        let is_reached = is_accepted && now_ns.saturating_sub(since_ns) >= REACHED_NS;
        let read_n = gripper.pressed_n().filter(|n| n.is_finite())?;
        Some(if is_reached { read_n.max(self.force_n) } else { read_n }).filter(|n| *n > 0.0)
    }

    /// No margin or no force is known. What slides is gripped harder. A contact that was loaded when last judged may be
    /// slipping, and where more of the friction is `used` than there should be, how much force is missing is not known;
    /// without frames or contact nothing is known.
    fn without_margin(&mut self, hand: &HandReport, used: Option<f64>, elapsed_s: f64) -> GripDecision {
        if self.unsure_rise.see(hand) {
            self.stopped = None;
        }
        let target = self.settings.target(hand.friction, doubt(hand.cut_fraction));
        let is_above = used.is_some_and(|used| used > target);
        // An unsure frame's margin says that it slips, or nothing.
        if let Some(used) = used.filter(|_| hand.state != SlipState::Unsure || is_above) {
            self.unsure_rise.judged(1.0 - used);
        }
        if hand.state == SlipState::Gross {
            self.force_n = (self.force_n + self.settings.raise_n_per_s * elapsed_s).min(self.limits.most_n);
        } else if hand.state == SlipState::Unsure || is_above {
            self.force_n = self.unsure_rise.raised_n(self.force_n, self.limits.most_n, elapsed_s);
        }
        GripDecision { force_n: self.force_n, arm: ArmMotion::Go }
    }

    fn count_alarm(&mut self, hand: &HandReport, gripper: &GripperState) {
        let slips = hand.state.is_slip();
        if slips && !self.slipping {
            self.alarms_count += 1;
        }
        self.wants_more |= slips && self.force_n >= self.limits.most_n && arrived(self.force_n, gripper);
        self.slipping = slips;
    }
}

impl GripController for Margin {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        if self.last_ns.is_some_and(|last_ns| now_ns.saturating_sub(last_ns) > GAP_NS) {
            // The averages are outdated, and a command of before may never have been sent.
            (self.holding_n, self.slow_holding_n, self.stands) = (None, 0.0, None);
        }
        let elapsed_s = step_s(self.last_ns.replace(now_ns), now_ns);
        self.count_alarm(hand, gripper);
        let misses = self.misses_finger(hand);
        let pressed_n = self.pressed_n(now_ns, gripper);
        let gross = hand.state == SlipState::Gross;
        // An object that slides uses all friction, whatever the estimate.
        let used = hand.margin.map(|margin| 1.0 - margin).map(|used| if gross { used.max(1.0) } else { used });
        let (Some(used), Some(pressed_n)) = (used.or(gross.then_some(1.0)), pressed_n) else {
            return self.without_margin(hand, used, elapsed_s);
        };
        // A command that counts as reached is no reading: the next rise would begin at the end of this one.
        if gripper.pressed_n().is_some_and(|n| n > 0.0) {
            self.unsure_rise.begin_anew();
        }
        let doubt = doubt(hand.cut_fraction);
        let target = self.settings.target(hand.friction, doubt);
        let holding_n = self.update_holding_n(used, pressed_n, elapsed_s, misses);
        let used = holding_n / pressed_n;
        let margin = (1.0 - used).clamp(0.0, 1.0);
        self.margin = Some(margin);
        self.unsure_rise.judged(margin);
        let raised_n = self.force_n + self.settings.raise_n_per_s * elapsed_s;
        let wanted_n = holding_n / target;
        // What slides under the force that should hold it needs more, however much of it the gripper reads.
        let wanted_n = if gross && wanted_n <= self.force_n { raised_n } else { wanted_n };
        let grows = holding_n > (1.0 + GROWN_FRACTION) * self.slow_holding_n + GROWN_N;
        self.slow_holding_n += smoothing::weight(elapsed_s, STANDS_S) * (holding_n - self.slow_holding_n);
        let release_n = self.settings.release_n(self.force_n, wanted_n, elapsed_s);
        self.stopped = self.stopped.filter(|stopped| holding_n > LOAD_FALLEN_FRACTION * stopped.holding_n);
        // The margin before a slide was wrong: the force that stopped the slide is kept while the load persists.
        let kept_n = self.stopped.map_or(0.0, |stopped| stopped.force_n.min(self.force_n));
        // A command is no measurement of the force that could be spared.
        let keeps = gripper.force_n.is_none() || misses || gross || doubt > 0.0 && used > DOUBTFUL_LOADED_FRACTION;
        let slack = self.settings.slack_fraction.min(target);
        if wanted_n > self.force_n {
            self.force_n = wanted_n.min(raised_n);
        } else if !grows && !keeps && holding_n < (target - slack) * self.force_n.min(pressed_n) {
            self.force_n = wanted_n.max(self.force_n - release_n).max(kept_n);
        }
        self.force_n = self.force_n.clamp(self.limits.least_n, self.limits.most_n);
        if gross {
            self.stopped = Some(StoppedSlide { holding_n, force_n: self.force_n });
        }
        // The arm waits while the grip lags behind the load.
        let behind = self.force_n > LAGGING_FORCE_RATIO * pressed_n && used > target + LAGGING_USED_FRACTION;
        GripDecision { force_n: self.force_n, arm: if behind { ArmMotion::Pause } else { ArmMotion::Go } }
    }

    fn alarms_count(&self) -> u32 {
        self.alarms_count
    }

    fn wants_more(&self) -> bool {
        self.wants_more
    }

    fn margin(&self) -> Option<f64> {
        self.margin
    }

    /// The wanted force follows from the load, whatever the grip: only the rate limits start from the force.
    fn start_from(&mut self, force_n: f64) -> bool {
        self.force_n = self.force_n.max(force_n);
        true
    }
}
