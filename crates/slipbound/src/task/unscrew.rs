//! Unscrewing a cap: turn back; the controller reacts to slip; end because the cap has opened, never because of slip.
//!
//! ```text
//!   Grasping -> Working  <->  Waiting  -> Ended(Opened): the torque fell and stayed low over further turning
//!                                      -> Ended(Stuck):  at the largest force the fingers slide over the cap
//! ```

use super::step::{Ending, Missing, Observation, Task, TaskStep};
use super::turning::{SlideSettings, Turning};
use crate::grip::Guard;
use crate::hand::Allowed;
use crate::port::FASTEST_TURN_RAD_PER_S;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Growth of the shear, as a share of itself, that counts as none.
const SLIDING_FRACTION: f64 = 0.03;

/// Settings of [`Unscrew`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct UnscrewSettings {
    /// Rate of the wrist, rad/s, negative opens a right-hand thread: 20 deg/s.
    pub rate_rad_per_s: f64,
    /// Maximum turn, rad.
    pub most_rad: f64,
    /// Turn over which the torque has to stay well below its peak, rad.
    pub open_rad: f64,
    /// A peak of shear below this does not count as resistance of the cap, mm.
    pub least_peak_mm: f64,
    /// At the largest force: turn over which the shear stays flat when the fingers slide, rad.
    pub stuck_rad: f64,
    /// Where the cap may slide in the fingers: along the thread.
    pub allowed: Allowed,
    /// When the fingers are considered to slide around the cap.
    pub slide: SlideSettings,
}

impl Default for UnscrewSettings {
    fn default() -> Self {
        UnscrewSettings {
            rate_rad_per_s: -20f64.to_radians(),
            most_rad: 180f64.to_radians(),
            open_rad: 10f64.to_radians(),
            least_peak_mm: 0.2,
            stuck_rad: 20f64.to_radians(),
            allowed: Allowed { along: true, ..Allowed::default() },
            slide: SlideSettings::default(),
        }
    }
}

impl UnscrewSettings {
    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("unscrew.rate_rad_per_s", self.rate_rad_per_s.abs(), 1e-3, FASTEST_TURN_RAD_PER_S)?;
        within("unscrew.most_rad", self.most_rad, 0.01, 100.0)?;
        within("unscrew.open_rad", self.open_rad, 0.01, self.most_rad.min(10.0))?;
        within("unscrew.least_peak_mm", self.least_peak_mm, 0.0, 10.0)?;
        within("unscrew.stuck_rad", self.stuck_rad, 0.01, self.most_rad.min(10.0))?;
        self.slide.check("unscrew", self.most_rad)
    }
}

/// Unscrewing.
#[derive(Debug)]
pub struct Unscrew {
    settings: UnscrewSettings,
    turning: Turning,
}

impl Unscrew {
    /// Starts with a cap between the open jaws. Fails for invalid settings. `stiffness_mpa_per_mm` is that of the gels
    /// against shear, None where it is unknown.
    pub fn new(
        settings: UnscrewSettings,
        grip: Guard,
        stiffness_mpa_per_mm: Option<f64>,
    ) -> Result<Self, SettingError> {
        settings.check()?;
        let way = (settings.rate_rad_per_s, settings.most_rad);
        let turning =
            Turning::new(grip, way, settings.allowed, settings.slide, stiffness_mpa_per_mm, settings.stuck_rad);
        Ok(Unscrew { settings, turning })
    }
}

impl Task for Unscrew {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        let UnscrewSettings { open_rad, least_peak_mm, stuck_rad, .. } = self.settings;
        self.turning.step(observation, |seen| {
            let fallen_rad = seen.shear.fallen_for_rad(seen.turned_rad, least_peak_mm);
            let slides =
                || seen.slip_at_most && fallen_rad.is_none() && seen.shear.is_flat(stuck_rad, SLIDING_FRACTION);
            match fallen_rad {
                Some(rad) if rad >= open_rad => Some(Ending::Opened),
                _ => slides().then_some(Ending::Stuck),
            }
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
