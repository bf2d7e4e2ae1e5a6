//! The settings of all steps together.

use crate::monitor::contact::ContactSettings;
use crate::monitor::evidence::EvidenceSettings;
use crate::monitor::imprint::{Illumination, ImprintSettings};
use crate::monitor::markers::{Finder, MarkerSettings, THRESHOLD_REACH_PITCH};
use crate::monitor::motion::{Fit, MotionSettings};
use crate::monitor::rest::RestSettings;
use crate::monitor::slip::{RigidField, SlipRule, SlipSettings};
use crate::pixels::MAX_ELEMENT_PX;
use crate::sensor::{Polarity, Sensor, Skin};
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
    /// Step 5.
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
                follow_light: false,
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

    /// Checks every setting, and that they suit this finger at the size of its frames.
    pub(crate) fn check_for(&self, sensor: &Sensor) -> Result<(), SettingError> {
        self.check()?;
        self.check_elements(sensor)?;
        if self.markers.finder == Finder::Threshold && sensor.polarity == Polarity::Bright {
            return Err(SettingError {
                key: "markers.finder".into(),
                got: "threshold, on a finger with bright markers".into(),
                expected: "edges: the paper's threshold finds dark markers only".into(),
            });
        }
        Ok(())
    }

    /// Structuring elements are given in pitches and limited in px.
    fn check_elements(&self, sensor: &Sensor) -> Result<(), SettingError> {
        let ContactSettings { close_pitch, erode_pitch, dilate_pitch, .. } = self.contact;
        let of_texture = [
            ("contact.close_pitch", close_pitch),
            ("contact.erode_pitch", erode_pitch),
            ("contact.dilate_pitch", dilate_pitch),
        ];
        let of_motion = self.motion.erode_pitch.map(|pitch| ("motion.erode_pitch", pitch));
        let of_finder = [("markers.finder", THRESHOLD_REACH_PITCH)];
        let used = (of_texture.iter().filter(|_| sensor.skin == Skin::Fabric))
            .chain(&of_motion)
            .chain(of_finder.iter().filter(|_| self.markers.finder == Finder::Threshold));
        for &(key, pitch) in used {
            let side_px = (pitch * sensor.pitch_px).round();
            if side_px > MAX_ELEMENT_PX as f64 {
                let pitch_px = sensor.pitch_px;
                return Err(SettingError {
                    key: key.into(),
                    got: format!("{pitch:.2} pitches of {pitch_px:.0} px: {side_px:.0} px"),
                    expected: format!("at most {MAX_ELEMENT_PX} px, {:.2} pitches", MAX_ELEMENT_PX as f64 / pitch_px),
                });
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::smooth;

    /// A setting whose structuring element is too large for the kernels is refused by its key, without a panic.
    #[test]
    fn elements_larger_than_the_kernels_take_are_refused() {
        let finger = |pitch_px: f64, skin| Sensor { pitch_px, skin, ..smooth() };
        let key = |settings: &Settings, sensor: &Sensor| settings.check_for(sensor).err().map(|error| error.key);
        let wide = Settings::default().with(|s| s.motion.erode_pitch[0] = 10.0);
        assert_eq!(key(&wide, &finger(102.3, Skin::Smooth)), None, "1023 px");
        assert_eq!(key(&wide, &finger(102.4, Skin::Smooth)).as_deref(), Some("motion.erode_pitch"));
        let wide = Settings::default().with(|s| s.contact.dilate_pitch = 9.0);
        assert_eq!(key(&wide, &finger(120.0, Skin::Smooth)), None, "of fabric skins alone");
        assert_eq!(key(&wide, &finger(120.0, Skin::Fabric)).as_deref(), Some("contact.dilate_pitch"));
        let error = Settings::paper().check_for(&finger(350.0, Skin::Smooth)).expect_err("45 px at 15.2").to_string();
        assert!(
            error.starts_with("markers.finder: expected at most 1023 px, 2.92 pitches, got 2.96 pitches of 350 px"),
            "{error}"
        );
    }
}
