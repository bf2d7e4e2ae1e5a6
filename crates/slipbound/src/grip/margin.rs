//! Ours: holds a slip margin. The grip follows the load in proportion, lets go slowly when it is safe, and is bounded
//! by a floor, a largest force and a rate.
//!
//! ```text
//!   load         F   from the mean shear of the gel since rest, see `HandReport::load_n`
//!   used         f = F / (mu P)        margin = 1 - f
//!   f > target         : P -> F / (mu target)     at once, at most `raise_n_per_s`
//!   f < target - slack : P falls by `release_n_per_s`, not below the floor
//! ```
//!
//! The used fraction is an interim estimate. The residual of the slip field over mu P / (k A) was tried first: on the
//! simulated finger it reads 0.06 to 0.5 without any load, from the spreading of the squeezed gel alone, where the
//! mean shear reads 0.03 to 0.07. Friction itself is not measured: `mu` is reckoned with until an incipient slip
//! shows that it is less. The law needs the stiffness of the gel (see [`Shear`](crate::sensor::Shear)); without it
//! it is refused.

use super::controller::{ArmMotion, GripController, GripDecision, GripLimits};
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::GripperState;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Share of the friction reckoned with that one slip may take away.
const SLIP_COST: f64 = 0.2;

/// Friction is never reckoned with as less than this.
const LEAST_MU: f64 = 0.15;

/// Settings of [`Margin`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MarginSettings {
    /// Shear stiffness of the gel, MPa/mm; 0 takes that of the sensor file.
    pub stiffness_mpa_per_mm: f64,
    /// Friction coefficient to reckon with until slip shows it to be less.
    pub mu: f64,
    /// Used fraction to hold, 0 to 1.
    pub target_fraction: f64,
    /// Below target less this the grip is let go slowly.
    pub slack_fraction: f64,
    /// Fastest rise, N per finger and second.
    pub raise_n_per_s: f64,
    /// Rate of letting go, N per finger and second; 0 never lets go.
    pub release_n_per_s: f64,
}

impl Default for MarginSettings {
    fn default() -> Self {
        MarginSettings {
            stiffness_mpa_per_mm: 0.0,
            mu: 0.4,
            target_fraction: 0.5,
            slack_fraction: 0.3,
            raise_n_per_s: 120.0,
            release_n_per_s: 1.0,
        }
    }
}

impl MarginSettings {
    /// Checks every setting but whether there is a stiffness; the error names the first one that cannot be.
    pub fn check(&self) -> Result<(), SettingError> {
        within("margin.stiffness_mpa_per_mm", self.stiffness_mpa_per_mm, 0.0, 100.0)?;
        within("margin.mu", self.mu, 0.05, 2.0)?;
        within("margin.target_fraction", self.target_fraction, 0.05, 0.95)?;
        within("margin.slack_fraction", self.slack_fraction, 0.0, self.target_fraction)?;
        within("margin.raise_n_per_s", self.raise_n_per_s, 0.1, 10_000.0)?;
        within("margin.release_n_per_s", self.release_n_per_s, 0.0, 1000.0)
    }

    /// The same with the stiffness of the finger where the settings have none. Refused when nobody knows it.
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

/// Holds a slip margin.
#[derive(Debug, Clone)]
pub struct Margin {
    settings: MarginSettings,
    limits: GripLimits,
    force_n: f64,
    last_ns: Option<u64>,
    mu: f64,
    margin: Option<f64>,
    alarms_count: u32,
    slipping: bool,
    wants_more: bool,
}

impl Margin {
    /// Starts with the starting force of the limits. Refuses settings that cannot be.
    pub fn new(settings: MarginSettings, limits: &GripLimits) -> Result<Self, SettingError> {
        let settings = settings.for_finger(None)?;
        settings.check()?;
        Ok(Margin {
            settings,
            limits: *limits,
            force_n: limits.start_n,
            last_ns: None,
            mu: settings.mu,
            margin: None,
            alarms_count: 0,
            slipping: false,
            wants_more: false,
        })
    }

    /// An incipient slip says: no more friction than is used now.
    fn learn(&mut self, hand: &HandReport, used_mu: f64) {
        let slips = matches!(hand.state, SlipState::Incipient | SlipState::Gross);
        if slips && !self.slipping {
            self.alarms_count += 1;
            self.wants_more |= self.force_n >= self.limits.most_n;
            self.mu = self.mu.min(used_mu.max(self.mu * (1.0 - SLIP_COST))).max(LEAST_MU);
        }
        self.slipping = slips;
    }
}

impl GripController for Margin {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &GripperState) -> GripDecision {
        let seconds = now_ns.saturating_sub(self.last_ns.unwrap_or(now_ns)) as f64 * 1e-9;
        self.last_ns = Some(now_ns);
        let pressed_n = gripper.pressed_n().filter(|n| *n > 0.0);
        let (Some(load_n), Some(pressed_n)) = (hand.load_n(self.settings.stiffness_mpa_per_mm), pressed_n) else {
            return GripDecision { force_n: self.force_n, arm: ArmMotion::Go };
        };
        self.learn(hand, load_n / pressed_n);
        let target = self.settings.target_fraction;
        let used = load_n / (self.mu * pressed_n);
        self.margin = Some((1.0 - used).clamp(0.0, 1.0));
        let wanted_n = load_n / (self.mu * target);
        if wanted_n > self.force_n {
            self.force_n = wanted_n.min(self.force_n + self.settings.raise_n_per_s * seconds);
        } else if used < target - self.settings.slack_fraction {
            self.force_n = wanted_n.max(self.force_n - self.settings.release_n_per_s * seconds);
        }
        self.force_n = self.force_n.clamp(self.limits.least_n, self.limits.most_n);
        self.wants_more |= load_n >= self.mu * self.limits.most_n * target && self.force_n >= self.limits.most_n;
        // The arm waits while the grip is behind the load.
        let behind = self.force_n > 1.2 * pressed_n && used > target + 0.2;
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
}
