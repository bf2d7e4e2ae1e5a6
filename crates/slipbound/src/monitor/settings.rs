//! The settings of all steps together.

use crate::monitor::contact::ContactSettings;
use crate::monitor::evidence::EvidenceSettings;
use crate::monitor::imprint::{Illumination, ImprintSettings};
use crate::monitor::markers::{Finder, MarkerSettings};
use crate::monitor::motion::{Fit, MotionSettings};
use crate::monitor::rest::RestSettings;
use crate::monitor::slip::{RigidField, SlipRule, SlipSettings};
use crate::sensor::{Polarity, Sensor};
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// The settings of every step. `Settings::default()` is what we ship, [`Settings::paper`] the paper as written.
///
/// ```
/// # use slipbound::monitor::{Settings, SlipRule};
/// let settings = Settings::default().with(|s| s.slip.rule = SlipRule::Markers).with(|s| s.rest.average_count = 5);
/// assert!(settings.check().is_ok());
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Settings {
    /// How the rest frame is made.
    pub rest: RestSettings,
    /// Step 0.
    pub imprint: ImprintSettings,
    /// Step 1.
    pub contact: ContactSettings,
    /// Step 2.
    pub markers: MarkerSettings,
    /// Step 3.
    pub motion: MotionSettings,
    /// Step 4.
    pub slip: SlipSettings,
    /// Evidence of sliding.
    pub evidence: EvidenceSettings,
}

impl Settings {
    /// The paper as written. Where the default differs, docs/deviations.md says why.
    pub fn paper() -> Self {
        Settings {
            rest: RestSettings { average_count: 1, ..RestSettings::default() },
            imprint: ImprintSettings { illumination: Illumination::Gaussian, ..ImprintSettings::default() },
            contact: ContactSettings {
                hide_rest_edges: false,
                drop_weak_pieces: false,
                rim_fraction: 0.0,
                displaced_pitch: 0.0,
                dilate_pitch: 25.0 / 15.2,
                period_ms: 0.0,
                ..ContactSettings::default()
            },
            markers: MarkerSettings {
                finder: Finder::Threshold,
                predict: false,
                match_within_pitch: 7.0 / 15.2,
                ask_neighbours: false,
                ..MarkerSettings::default()
            },
            motion: MotionSettings { fit: Fit::Similarity, ..MotionSettings::default() },
            slip: SlipSettings { rule: SlipRule::Markers, field: RigidField::SmallAngle, ..SlipSettings::default() },
            evidence: EvidenceSettings { used: false, ..EvidenceSettings::default() },
        }
    }

    /// The same with the changes that `change` makes.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self);
        self
    }

    /// Checks every setting, and that the finger can be watched with them.
    pub(crate) fn check_for(&self, sensor: &Sensor) -> Result<(), SettingError> {
        self.check()?;
        if self.markers.finder == Finder::Threshold && sensor.polarity == Polarity::Bright {
            return Err(SettingError {
                key: "markers.finder".into(),
                got: "threshold, on a finger with bright markers".into(),
                expected: "edges: the paper's threshold finds dark markers only".into(),
            });
        }
        Ok(())
    }

    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        self.rest.check()?;
        self.imprint.check()?;
        self.contact.check()?;
        self.markers.check()?;
        self.motion.check()?;
        self.slip.check()?;
        self.evidence.check()
    }
}
