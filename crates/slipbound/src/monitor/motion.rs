//! Step 3: contact region + marker displacement -> rigid motion of the inner region.
//!
//! ```text
//!    contact region        eroded: inner region       mean of the inner markers = reference point
//!      .-######-.             ........                 + rotation about it: measured against the reference
//!      ##########   ------>   ..####..   ------>       frame, fitted by least squares, without scale
//!      '-######-'             ........
//! ```

use super::Marker;
use crate::image::Mask;
use crate::pixels::morphology::{Element, Morphology};
use crate::plane::{RigidMotion, Vec2};
use crate::sensor::{Sensor, SettingError, within};
use serde::{Deserialize, Serialize};

/// What is fitted to the inner markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Rotation and translation.
    Rigid,
    /// Rotation, translation and scale, of which the scale is thrown away: `estimateRigidTransform` of the paper.
    Similarity,
}

/// Settings of step 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSettings {
    /// What is fitted.
    pub fit: Fit,
    /// Diameters of the ellipse that erodes the contact region to the inner one, in pitches, tried in this order
    /// until enough markers lie inside. The released code: 25, 15, 5 and 1 px at a pitch of 15.2 px.
    pub erode_pitch: [f64; 4],
    /// Fewest markers in the inner region.
    pub inner_markers_count: u32,
    /// Rotations smaller than this have no centre.
    pub icr_min_rotation_rad: f64,
}

impl Default for MotionSettings {
    fn default() -> Self {
        MotionSettings {
            fit: Fit::Rigid,
            erode_pitch: [25.0 / 15.2, 15.0 / 15.2, 5.0 / 15.2, 1.0 / 15.2],
            inner_markers_count: 4,
            icr_min_rotation_rad: 0.005,
        }
    }
}

impl MotionSettings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        for pitch in self.erode_pitch {
            within("motion.erode_pitch", pitch, 0.0, 10.0)?;
        }
        within("motion.inner_markers_count", f64::from(self.inner_markers_count), 2.0, 100.0)?;
        within("motion.icr_min_rotation_rad", self.icr_min_rotation_rad, 0.0, 1.0)
    }
}

/// Step 3, with its scratch.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    settings: MotionSettings,
    elements: [Element; 4],
    morphology: Morphology,
    pub(super) inner: Mask,
    pub(super) motion: Option<RigidMotion>,
    pub(super) inner_count: u32,
}

impl Motion {
    pub(super) fn new(sensor: &Sensor, settings: &MotionSettings) -> Self {
        let size = sensor.rectified_px();
        Motion {
            settings: settings.clone(),
            elements: settings.erode_pitch.map(|pitch| {
                let side = (pitch * sensor.pitch_px).round().max(1.0) as usize;
                Element::ellipse(side, side)
            }),
            morphology: Morphology::new(size),
            inner: Mask::new(size),
            motion: None,
            inner_count: 0,
        }
    }

    /// No contact: no inner region and no motion.
    pub(super) fn clear(&mut self) {
        self.inner.clear();
        self.motion = None;
        self.inner_count = 0;
    }

    /// Fits the motion since the reference frame; marks the inner markers.
    pub(super) fn fit(&mut self, contact: &Mask, markers: &mut [Marker]) {
        self.motion = None;
        for element in &self.elements {
            self.morphology.erode(contact, element, &mut self.inner);
            self.inner_count = 0;
            for m in markers.iter_mut() {
                let (x, y) = (m.now.x.round() as isize, m.now.y.round() as isize);
                m.inner = m.matched && m.in_reference && self.inner.get(x, y);
                self.inner_count += u32::from(m.inner);
            }
            if self.inner_count >= self.settings.inner_markers_count {
                let inner = markers.iter().filter(|m| m.inner).map(|m| (m.reference, m.now));
                self.motion = fit_motion(inner, self.settings.fit);
                return;
            }
        }
    }
}

/// The motion that takes the first points to the second with least squared error: the reference point is the mean
/// of the first, the translation the mean displacement, the rotation the one between the centred point sets.
/// None without points.
pub fn fit_motion(pairs: impl Iterator<Item = (Vec2, Vec2)> + Clone, fit: Fit) -> Option<RigidMotion> {
    let mut count = 0.0;
    let (mut from, mut to) = (Vec2::ZERO, Vec2::ZERO);
    for (a, b) in pairs.clone() {
        count += 1.0;
        from += a;
        to += b;
    }
    if count == 0.0 {
        return None;
    }
    let (from, to) = (from / count, to / count);
    let (mut cos, mut sin, mut spread) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a - from, b - to);
        cos += a.dot(b);
        sin += a.cross(b);
        spread += a.length_squared();
    }
    let rotation_rad = match fit {
        Fit::Rigid => libm::atan2(sin, cos),
        // The similarity matrix is [cos, -sin; sin, cos] / spread; the paper reads the angle off its lower left entry.
        Fit::Similarity if spread > 0.0 => libm::asin((sin / spread).clamp(-1.0, 1.0)),
        Fit::Similarity => 0.0,
    };
    Some(RigidMotion { reference: from, translation: to - from, rotation_rad })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = Vec2> + Clone {
        (0..30).map(|i| Vec2::new(40.0 + f64::from(i % 6) * 15.0, 70.0 + f64::from(i / 6) * 15.0))
    }

    #[test]
    fn the_fit_returns_the_motion_it_was_shown() {
        let truth =
            RigidMotion { reference: Vec2::new(10.0, 20.0), translation: Vec2::new(3.0, -7.5), rotation_rad: 0.4 };
        let fitted = fit_motion(grid().map(|p| (p, truth.apply(p))), Fit::Rigid).expect("points");
        assert!((fitted.rotation_rad - 0.4).abs() < 1e-12);
        for p in grid() {
            assert!((fitted.apply(p) - truth.apply(p)).length() < 1e-9);
        }
        let (a, b) = (truth.centre_of_rotation(0.01).expect("turns"), fitted.centre_of_rotation(0.01).expect("turns"));
        assert!((a - b).length() < 1e-8);
    }

    /// Fault 4 of the released code: squeezing 10 % of scale into the fit bends the angle; the rigid fit keeps it.
    #[test]
    fn a_dilation_bends_the_angle_of_the_similarity_but_not_of_the_rigid_fit() {
        let turn = RigidMotion { reference: Vec2::ZERO, translation: Vec2::ZERO, rotation_rad: 0.2 };
        let pairs = grid().map(|p| (p, turn.apply(p) * 1.1));
        let rigid = fit_motion(pairs.clone(), Fit::Rigid).expect("points");
        let similar = fit_motion(pairs, Fit::Similarity).expect("points");
        assert!((rigid.rotation_rad - 0.2).abs() < 1e-12);
        assert!((similar.rotation_rad - libm::asin(1.1 * libm::sin(0.2))).abs() < 1e-12);
    }
}
