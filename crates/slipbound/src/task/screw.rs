//! Screwing a cap onto a bottle: turn; the controller reacts to slip; end on evidence that the cap is tight.
//!
//! ```text
//!   Grasping -> Working  <->  Waiting (the grip is being raised)  -> Ended(Tight)
//! ```
//!
//! The paper stops at incipient slip at 60 N. Up to half of the torque can still be unused then. Here the wrist turns
//! on until the shear of the gels stays flat while it turns ([`ScrewEnd::Evidence`]).

use super::step::{Ending, Missing, Observation, Task, TaskStep};
use super::turning::{SlideSettings, Turning};
use crate::grip::Guard;
use crate::hand::Allowed;
use crate::port::FASTEST_TURN_RAD_PER_S;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Criterion for a tight cap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScrewEnd {
    /// At the largest force the fingers slip and continue to slip, and the shear stays flat over `flat_window_rad` of
    /// turning.
    Evidence,
    /// At the first incipient slip at the largest force: the paper's literal law.
    SlipAtMost,
}

/// Settings of [`Screw`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ScrewSettings {
    /// Criterion for a tight cap.
    pub end: ScrewEnd,
    /// Rate of the wrist, rad/s, positive tightens a right-hand thread: 20 deg/s.
    pub rate_rad_per_s: f64,
    /// Maximum turn, rad.
    pub most_rad: f64,
    /// Turn over which the shear has to stay flat, rad: 8 deg, 2 mm at the rim of a bottle cap. Below `most_rad`.
    pub flat_window_rad: f64,
    /// Growth of the shear over that turn, as a fraction of the shear, that still counts as flat.
    pub flat_fraction: f64,
    /// Where the cap may slide in the fingers: along the thread, because the wrist does not follow it down.
    pub allowed: Allowed,
    /// When the fingers are considered to slide around the cap.
    pub slide: SlideSettings,
}

impl Default for ScrewSettings {
    fn default() -> Self {
        ScrewSettings {
            end: ScrewEnd::Evidence,
            rate_rad_per_s: 20f64.to_radians(),
            most_rad: 180f64.to_radians(),
            flat_window_rad: 8f64.to_radians(),
            flat_fraction: 0.03,
            allowed: Allowed { along: true, ..Allowed::default() },
            slide: SlideSettings::default(),
        }
    }
}

impl ScrewSettings {
    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("screw.rate_rad_per_s", self.rate_rad_per_s.abs(), 1e-3, FASTEST_TURN_RAD_PER_S)?;
        within("screw.most_rad", self.most_rad, 0.01, 100.0)?;
        within("screw.flat_window_rad", self.flat_window_rad, 0.01, self.most_rad.min(1.0))?;
        within("screw.flat_fraction", self.flat_fraction, 0.0, 0.5)?;
        self.slide.check("screw", self.most_rad)
    }
}

/// Screwing.
#[derive(Debug)]
pub struct Screw {
    settings: ScrewSettings,
    turning: Turning,
}

impl Screw {
    /// Starts with a cap between the open jaws. Fails for invalid settings. `stiffness_mpa_per_mm` is that of the gels
    /// against shear, None where it is unknown.
    pub fn new(settings: ScrewSettings, grip: Guard, stiffness_mpa_per_mm: Option<f64>) -> Result<Self, SettingError> {
        settings.check()?;
        let way = (settings.rate_rad_per_s, settings.most_rad);
        let turning =
            Turning::new(grip, way, settings.allowed, settings.slide, stiffness_mpa_per_mm, settings.flat_window_rad);
        Ok(Screw { settings, turning })
    }
}

impl Task for Screw {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        let ScrewSettings { end, flat_window_rad, flat_fraction, .. } = self.settings;
        self.turning.step(observation, |seen| match end {
            _ if !seen.slip_at_most => None,
            ScrewEnd::SlipAtMost => Some(Ending::SlipAtMost),
            ScrewEnd::Evidence => (seen.slips_over(flat_window_rad)
                && seen.shear.is_flat(flat_window_rad, flat_fraction))
            .then_some(Ending::Tight),
        })
    }

    fn grip(&self) -> &Guard {
        &self.turning.grip
    }

    fn grip_mut(&mut self) -> &mut Guard {
        &mut self.turning.grip
    }

    fn interrupt(&mut self) {
        self.turning.interrupt();
    }

    fn missing(&self) -> Option<Missing> {
        self.turning.missing()
    }
}
