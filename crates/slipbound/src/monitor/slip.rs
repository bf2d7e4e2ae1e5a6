//! Step 4: measured minus rigid displacement -> slip field, and the verdict of the rule `markers`.
//!
//! ```text
//!    measured (yellow)  -  rigid (blue)  =  slip field (black)     over the threshold: purple
//!       ---->                ------>           <--      more than N of them: incipient slip (rule `markers`)
//! ```

use crate::image::Mask;
use crate::monitor::report::{Marker, SlipKind, SlipSummary};
use crate::plane::{RigidMotion, Vec2, nearest_px};
use crate::sensor::Sensor;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// How the rigid displacement of a marker follows from the motion of the reference point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RigidField {
    /// The exact rotation.
    Exact,
    /// Equation 1 of the paper, its limit at small angles.
    SmallAngle,
}

/// The rule that raises the alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SlipRule {
    /// The estimated margin is small: see [`Estimates`](super::Estimates).
    Margin,
    /// The paper's: markers whose slip field exceeds a threshold.
    Markers,
}

/// Settings of step 4.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct SlipSettings {
    /// The rule that raises the alarm.
    pub rule: SlipRule,
    /// Rule `margin`: incipient slip begins at this margin (1: no load, 0: the object slides) or below.
    pub alarm_margin_fraction: f64,
    /// Rule `margin`: it ends above this margin.
    pub clear_margin_fraction: f64,
    /// How the rigid displacement of the slip field is computed. Rule `markers`; under `margin` as `threshold_pitch`.
    pub field: RigidField,
    /// Rule `markers`: a marker slips when its slip field is longer than this many pitches. The paper's code: 4.5 px at
    /// 15.2 px. Under `margin` it is only shown in overlay and report, and counts in a hand of several fingers where they
    /// know no margin.
    pub threshold_pitch: f64,
    /// Rule `markers`: incipient slip is more than this share of all markers at once. The paper's code: 7 of 400. Under
    /// `margin` as `threshold_pitch`.
    pub over_fraction: f64,
    /// Rule `markers`: fewest markers for incipient slip, since a single one may be defective. Under `margin` as
    /// `threshold_pitch`.
    pub over_min_count: u32,
}

impl Default for SlipSettings {
    fn default() -> Self {
        SlipSettings {
            rule: SlipRule::Margin,
            alarm_margin_fraction: 0.5,
            clear_margin_fraction: 0.55,
            field: RigidField::Exact,
            threshold_pitch: 4.5 / 15.2,
            over_fraction: 7.0 / 400.0,
            over_min_count: 2,
        }
    }
}

impl SlipSettings {
    /// The margin at which incipient slip is reported; None where another rule reports it.
    pub fn alarm_margin(&self) -> Option<f64> {
        (self.rule == SlipRule::Margin).then_some(self.alarm_margin_fraction)
    }

    pub(super) fn check(&self) -> Result<(), SettingError> {
        within("slip.alarm_margin_fraction", self.alarm_margin_fraction, 0.0, 1.0)?;
        within("slip.clear_margin_fraction", self.clear_margin_fraction, self.alarm_margin_fraction, 1.0)?;
        within("slip.threshold_pitch", self.threshold_pitch, 0.001, 10.0)?;
        within("slip.over_fraction", self.over_fraction, 0.0, 1.0)?;
        within("slip.over_min_count", f64::from(self.over_min_count), 1.0, 1000.0)
    }

    /// The fewest markers over the threshold that mean slip, for a finger with `markers_count` markers.
    pub fn over_needed_count(&self, markers_count: usize) -> u32 {
        // Deviation: D9 shares instead of counts
        let more_than = (self.over_fraction * markers_count as f64 + 1e-9).floor() as u32;
        (more_than + 1).max(self.over_min_count)
    }
}

/// Step 4.
#[derive(Debug, Clone)]
pub(super) struct Slip {
    settings: SlipSettings,
    pitch_px: f64,
    mm_per_px: Option<f64>,
    over_needed_count: u32,
    pub(super) summary: SlipSummary,
    pub(super) slips: bool,
}

impl Slip {
    pub(super) fn new(sensor: &Sensor, settings: &SlipSettings, markers_count: usize) -> Self {
        Slip {
            settings: settings.clone(),
            pitch_px: sensor.pitch_px,
            mm_per_px: sensor.mm_per_px(),
            over_needed_count: settings.over_needed_count(markers_count),
            summary: SlipSummary::default(),
            slips: false,
        }
    }

    /// No contact: no slip field.
    pub(super) fn clear(&mut self) {
        self.summary = SlipSummary {
            max_mm: self.mm_per_px.map(|_| 0.0),
            markers_needed: self.over_needed_count,
            threshold_pitch: self.settings.threshold_pitch,
            ..SlipSummary::default()
        };
        self.slips = false;
    }

    /// Fills in the slip of every marker in contact and judges it.
    pub(super) fn judge(&mut self, motion: Option<&RigidMotion>, markers: &mut [Marker]) {
        self.clear();
        let Some(motion) = motion else { return };
        let exact = motion.tabulated();
        let threshold_px = self.summary.threshold_pitch * self.pitch_px;
        let (mut longest_px, mut over_sum, mut arm_squared, mut count) = (0.0f64, Vec2::ZERO, 0.0, 0u32);
        for m in markers.iter_mut().filter(|m| m.in_contact && m.whole && m.in_reference) {
            let rigid = match self.settings.field {
                // Deviation: D8 exact rotation
                RigidField::Exact => exact.displacement(m.reference),
                RigidField::SmallAngle => motion.displacement_small_angle(m.reference), // Eq. 1
            };
            m.slip = m.now_from_reference() - rigid;
            m.over = m.slip.length() > threshold_px;
            longest_px = longest_px.max(m.slip.length());
            arm_squared += (m.reference - motion.reference).length_squared();
            count += 1;
            if m.over {
                self.summary.markers_over += 1;
                over_sum += m.slip;
            }
        }
        self.summary.max_pitch = longest_px / self.pitch_px;
        self.summary.max_mm = self.mm_per_px.map(|mm| longest_px * mm);
        self.slips = self.summary.markers_over >= self.over_needed_count;
        if self.slips && self.settings.rule == SlipRule::Markers {
            // Deviation: D10 direction and kind
            let rim_px = motion.rotation_rad.abs() * (arm_squared / f64::from(count)).sqrt();
            let kind = kind(rim_px, motion.translation.length());
            self.summary.kind = Some(kind);
            // The markers lag behind the object: it slides against the slip field.
            let object = -over_sum;
            self.summary.direction_rad = (kind != SlipKind::Rotation).then(|| object.direction_rad());
        }
    }
}

impl Slip {
    /// Sets kind and direction from the load where the slip field does not show them: the object moves where the load
    /// pulls it, with the shares by which pull and turn move the gel, both in px3: displacement of the gel times its
    /// area. Without load they are unknown.
    pub(super) fn set_kind_from_load(&mut self, pull_px3: Vec2, turn_px3: f64) {
        if pull_px3 == Vec2::ZERO && turn_px3 == 0.0 {
            return;
        }
        let kind = kind(turn_px3.abs(), pull_px3.length());
        self.summary.kind = Some(kind);
        self.summary.direction_rad = (kind != SlipKind::Rotation).then(|| pull_px3.direction_rad());
    }
}

/// Rotation when it makes up more than two thirds of the motion at the rim, translation when less than one third.
fn kind(rotation_px: f64, translation_px: f64) -> SlipKind {
    let share = rotation_px / (rotation_px + translation_px).max(f64::MIN_POSITIVE);
    match share {
        s if s > 2.0 / 3.0 => SlipKind::Rotation,
        s if s < 1.0 / 3.0 => SlipKind::Translation,
        _ => SlipKind::Both,
    }
}

/// Marks the markers in the contact region; returns how many of them are completely in view.
pub(super) fn mark_contact(contact: &Mask, markers: &mut [Marker]) -> u32 {
    let mut count = 0;
    for m in markers {
        m.in_contact = contact.get(nearest_px(m.now.x), nearest_px(m.now.y));
        (m.inner, m.over, m.slip) = (false, false, Vec2::ZERO);
        count += u32::from(m.in_contact && m.whole);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_wants_8_of_400_markers_and_a_finger_of_60_two() {
        let settings = SlipSettings::default();
        assert_eq!(settings.over_needed_count(400), 8);
        assert_eq!(settings.over_needed_count(60), 2);
        assert_eq!(settings.over_needed_count(30), 2);
        assert_eq!(settings.over_needed_count(250), 5);
    }

    const PITCH_PX: f64 = 30.0;

    /// Step 4 on 10 x 7 markers in contact that all follow a motion, except for the change that a test makes to each.
    fn judged(motion: RigidMotion, change: impl Fn(&mut Marker)) -> (Slip, Vec<Marker>) {
        let place = |i: u32| Vec2::new(f64::from(i % 10), f64::from(i / 10)) * PITCH_PX;
        let mut markers: Vec<Marker> = (0..70).map(|id| Marker::at_rest(id, place(id))).collect();
        for m in &mut markers {
            (m.in_contact, m.now) = (true, motion.apply(m.reference));
            change(m);
        }
        let settings = SlipSettings { rule: SlipRule::Markers, ..SlipSettings::default() };
        let mut slip = Slip::new(&crate::sensor::tests::smooth(), &settings, markers.len());
        slip.judge(Some(&motion), &mut markers);
        (slip, markers)
    }

    fn along(translation: Vec2, rotation_rad: f64) -> RigidMotion {
        RigidMotion { reference: Vec2::new(4.5, 3.0) * PITCH_PX, translation, rotation_rad }
    }

    #[test]
    fn markers_that_lag_are_counted_and_the_object_slides_the_other_way() {
        // Four lag by half a pitch along y, one by just less than the threshold.
        let threshold_px = SlipSettings::default().threshold_pitch * PITCH_PX;
        let (slip, markers) = judged(along(Vec2::new(0.0, 20.0), 0.0), |m| match m.id {
            0..4 => m.now.y -= 0.5 * PITCH_PX,
            4 => m.now.y -= threshold_px - 1e-6,
            _ => {}
        });
        assert_eq!((slip.summary.markers_over, slip.summary.markers_needed, slip.slips), (4, 2, true));
        assert!((slip.summary.max_pitch - 0.5).abs() < 1e-9);
        // 1.5 mm a pitch.
        assert!((slip.summary.max_mm.expect("a pitch in mm") - 0.75).abs() < 1e-9);
        assert_eq!(slip.summary.kind, Some(SlipKind::Translation));
        let direction_rad = slip.summary.direction_rad.expect("slides");
        assert!((direction_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{direction_rad}");
        let over: String = markers[..6].iter().map(|m| if m.over { '#' } else { '.' }).collect();
        assert_eq!(over, "####..");
        let (one, _) = judged(along(Vec2::ZERO, 0.0), |m| m.now.x += if m.id == 0 { 40.0 } else { 0.0 });
        assert_eq!((one.summary.markers_over, one.slips, one.summary.kind), (1, false, None), "one alone is none");
    }

    /// Markers cut by the border, not found in the reference frame or out of contact give no information on slip.
    #[test]
    fn only_markers_whose_way_is_known_and_that_are_touched_slip() {
        let lag = |m: &mut Marker, spoil: fn(&mut Marker)| {
            if m.id < 5 {
                m.now.x -= PITCH_PX;
                spoil(m);
            }
        };
        let over = |spoil: fn(&mut Marker)| {
            let (slip, _) = judged(along(Vec2::new(5.0, 0.0), 0.0), |m| lag(m, spoil));
            (slip.summary.markers_over, slip.slips, slip.summary.max_pitch > 1e-9)
        };
        assert_eq!(over(|_| {}), (5, true, true));
        assert_eq!(over(|m| m.in_reference = false), (0, false, false));
        assert_eq!(over(|m| m.whole = false), (0, false, false));
        assert_eq!(over(|m| m.in_contact = false), (0, false, false));
    }

    /// The mean arm of the markers is 3.5 pitches: 105 px.
    #[test]
    fn a_slip_is_called_by_what_makes_most_of_the_motion_at_the_rim() {
        let kind = |translation_px: f64, rotation_rad: f64| {
            let (slip, _) = judged(along(Vec2::new(translation_px, 0.0), rotation_rad), |m| {
                m.now.x -= if m.id < 5 { 15.0 } else { 0.0 }
            });
            (slip.summary.kind.expect("slips"), slip.summary.direction_rad.is_some())
        };
        assert_eq!(kind(20.0, 0.0), (SlipKind::Translation, true));
        assert_eq!(kind(0.5, 0.2), (SlipKind::Rotation, false));
        assert_eq!(kind(0.5, -0.2), (SlipKind::Rotation, false));
        assert_eq!(kind(20.0, 0.2), (SlipKind::Both, true));
        // A share of two thirds is not enough for a single kind.
        let mut slip = judged(along(Vec2::ZERO, 0.0), |_| {}).0;
        for (force, torque, kind) in [
            (1.01, 0.5, SlipKind::Translation),
            (0.99, 0.5, SlipKind::Both),
            (0.5, 0.99, SlipKind::Both),
            (0.5, -1.01, SlipKind::Rotation),
        ] {
            slip.set_kind_from_load(Vec2::new(0.0, force), torque);
            let direction_rad = (kind != SlipKind::Rotation).then_some(std::f64::consts::FRAC_PI_2);
            assert_eq!(
                (slip.summary.kind, slip.summary.direction_rad),
                (Some(kind), direction_rad),
                "{force} {torque}"
            );
        }
    }

    #[test]
    fn without_a_motion_nothing_is_said_of_slip() {
        let (mut slip, mut markers) = judged(along(Vec2::ZERO, 0.0), |m| m.now.x += if m.id < 5 { 40.0 } else { 0.0 });
        assert!(slip.slips);
        slip.judge(None, &mut markers);
        let nothing = SlipSummary {
            max_mm: Some(0.0),
            markers_needed: 2,
            threshold_pitch: SlipSettings::default().threshold_pitch,
            ..SlipSummary::default()
        };
        assert_eq!((slip.slips, slip.summary), (false, nothing));
    }

    #[test]
    fn markers_are_in_contact_where_the_region_is_and_only_whole_ones_count() {
        use crate::image::SizePx;
        let mut markers: Vec<Marker> =
            (0..4).map(|id| Marker::at_rest(id, Vec2::new(10.4 + 10.0 * f64::from(id), 5.0))).collect();
        let mut region = Mask::new(SizePx::new(64, 10));
        region.set(10, 5, true);
        region.set(20, 5, true);
        region.set(31, 5, true);
        for m in &mut markers {
            (m.inner, m.over, m.slip) = (true, true, Vec2::new(1.0, 1.0));
        }
        // The current position counts, to the nearest pixel.
        markers[2].now.x = 30.6;
        markers[1].whole = false;
        assert_eq!(mark_contact(&region, &mut markers), 2);
        let touched: String = markers.iter().map(|m| if m.in_contact { '#' } else { '.' }).collect();
        assert_eq!(touched, "###.");
        assert!(
            markers.iter().all(|m| !m.inner && !m.over && m.slip == Vec2::ZERO),
            "what was said before is forgotten"
        );
    }
}
