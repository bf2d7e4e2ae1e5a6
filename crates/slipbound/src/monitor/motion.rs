//! Step 3: contact region + marker displacement -> rigid motion of the inner region.
//!
//! ```text
//!    contact region        eroded: inner region       mean of the inner markers = reference point
//!      .-######-.             ........                 + rotation about it: measured against the reference
//!      ##########   ------>   ..####..   ------>       frame, fitted by least squares, without scale
//!      '-######-'             ........
//! ```

use crate::image::Mask;
use crate::monitor::report::Marker;
use crate::pixels::morphology::Element;
use crate::plane::{RigidMotion, Vec2, nearest_px};
use crate::sensor::Sensor;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// What is fitted to the inner markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Rotation and translation, by least squares over those inner markers that agree: when slip has advanced from the
    /// rim further than the erosion reaches, slipping markers are outvoted instead of averaged in.
    RobustRigid,
    /// Rotation and translation, by least squares over all inner markers.
    Rigid,
    /// Rotation, translation and scale, of which the scale is discarded: `estimateRigidTransform` of the paper.
    Similarity,
}

/// Settings of step 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
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
            fit: Fit::RobustRigid,
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
    pitch_px: f64,
    elements: [Element; 4],
    /// Which element made the inner region last; None without contact.
    element: Option<usize>,
    pub(super) motion: Option<RigidMotion>,
    pub(super) inner_count: u32,
}

impl Motion {
    pub(super) fn new(sensor: &Sensor, settings: &MotionSettings) -> Self {
        Motion {
            settings: settings.clone(),
            pitch_px: sensor.pitch_px,
            elements: settings.erode_pitch.map(|pitch| {
                let side = (pitch * sensor.pitch_px).round().max(1.0) as usize;
                Element::ellipse(side, side)
            }),
            element: None,
            motion: None,
            inner_count: 0,
        }
    }

    /// No contact: no inner region and no motion.
    pub(super) fn clear(&mut self) {
        self.element = None;
        self.motion = None;
        self.inner_count = 0;
    }

    /// The element that erodes the contact region to the inner one; None without contact.
    pub(super) fn inner_erosion(&self) -> Option<&Element> {
        self.element.map(|i| &self.elements[i])
    }

    /// Fits the motion since the reference frame; marks the inner markers.
    pub(super) fn fit(&mut self, contact: &Mask, markers: &mut [Marker]) {
        self.motion = None;
        for (i, element) in self.elements.iter().enumerate() {
            self.element = Some(i);
            self.inner_count = 0;
            for m in markers.iter_mut() {
                // Evaluated only at the markers: drawing the whole region takes longer than the rest of this step.
                let (x, y) = (nearest_px(m.now.x), nearest_px(m.now.y));
                m.inner = m.whole && m.in_reference && element.fits(contact, x, y);
                self.inner_count += u32::from(m.inner);
            }
            if self.inner_count >= self.settings.inner_markers_count {
                let inner = markers.iter().filter(|m| m.inner).map(|m| (m.reference, m.now));
                // Deviation: D7 robust rigid fit
                self.motion = match self.settings.fit {
                    Fit::RobustRigid => fit_most(inner, self.pitch_px),
                    Fit::Rigid => fit_rigid(inner),
                    Fit::Similarity => fit_similarity(inner),
                };
                return;
            }
        }
    }
}

/// Scales, in pitches, within which markers count as agreeing; from wide to narrow, so that the fit converges to the
/// motion of most of them. The last is a third of the slip threshold.
const AGREEMENT_PITCH: [f64; 9] = [1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1];

/// Weighted sums of a set of point pairs, from which each fit follows in closed form.
struct Moments {
    from: Vec2,
    to: Vec2,
    cos: f64,
    sin: f64,
    spread: f64,
}

impl Moments {
    /// None when the weights are all zero.
    fn of(pairs: impl Iterator<Item = (Vec2, Vec2, f64)> + Clone) -> Option<Moments> {
        let (mut weight, mut from, mut to) = (0.0, Vec2::ZERO, Vec2::ZERO);
        for (a, b, w) in pairs.clone() {
            weight += w;
            from += a * w;
            to += b * w;
        }
        if weight <= 0.0 {
            return None;
        }
        let mut moments = Moments { from: from / weight, to: to / weight, cos: 0.0, sin: 0.0, spread: 0.0 };
        for (a, b, w) in pairs {
            let (a, b) = (a - moments.from, b - moments.to);
            moments.cos += w * a.dot(b);
            moments.sin += w * a.cross(b);
            moments.spread += w * a.length_squared();
        }
        Some(moments)
    }

    fn motion(&self, rotation_rad: f64) -> RigidMotion {
        RigidMotion { reference: self.from, translation: self.to - self.from, rotation_rad }
    }

    fn rigid(&self) -> RigidMotion {
        self.motion(libm::atan2(self.sin, self.cos))
    }
}

/// The rigid motion that takes the first points to the second with least squared error: the reference point is the
/// mean of the first, the translation the mean displacement, the rotation that between the centred sets. None
/// without points.
pub fn fit_rigid(pairs: impl Iterator<Item = (Vec2, Vec2)> + Clone) -> Option<RigidMotion> {
    Moments::of(pairs.map(|(a, b)| (a, b, 1.0))).map(|m| m.rigid())
}

/// The same with a weight for each pair; None when all weights are zero.
pub(super) fn fit_weighted(pairs: impl Iterator<Item = (Vec2, Vec2, f64)> + Clone) -> Option<RigidMotion> {
    Moments::of(pairs).map(|m| m.rigid())
}

/// The angle of the least-squares similarity as the paper reads it: arcsin of the lower left entry of its matrix,
/// with the scale left in. None without points.
pub fn fit_similarity(pairs: impl Iterator<Item = (Vec2, Vec2)> + Clone) -> Option<RigidMotion> {
    let moments = Moments::of(pairs.map(|(a, b)| (a, b, 1.0)))?;
    let lower_left = if moments.spread > 0.0 { moments.sin / moments.spread } else { 0.0 };
    Some(moments.motion(libm::asin(lower_left.clamp(-1.0, 1.0))))
}

/// The rigid motion of most pairs: least squares with the weights of Geman and McClure, from wide to narrow scale.
/// `pitch_px` is the marker pitch. None without points.
pub fn fit_most(pairs: impl Iterator<Item = (Vec2, Vec2)> + Clone, pitch_px: f64) -> Option<RigidMotion> {
    let all = fit_rigid(pairs.clone())?;
    let mut motion = all;
    for scale_pitch in AGREEMENT_PITCH {
        let scale_squared = (scale_pitch * pitch_px) * (scale_pitch * pitch_px);
        let last = motion.tabulated();
        let weighed = pairs.clone().map(move |(a, b)| {
            let t = 1.0 + (b - last.apply(a)).length_squared() / scale_squared;
            (a, b, 1.0 / (t * t))
        });
        motion = Moments::of(weighed)?.rigid();
    }
    // The same motion, stated at the mean of all inner markers: the paper's reference point.
    let translation = motion.displacement(all.reference);
    Some(RigidMotion { reference: all.reference, translation, ..motion })
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
        let fitted = fit_rigid(grid().map(|p| (p, truth.apply(p)))).expect("points");
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
        let rigid = fit_rigid(pairs.clone()).expect("points");
        let similar = fit_similarity(pairs).expect("points");
        assert!((rigid.rotation_rad - 0.2).abs() < 1e-12);
        assert!((similar.rotation_rad - libm::asin(1.1 * libm::sin(0.2))).abs() < 1e-12);
    }

    /// A third of the markers lags by 0.4 pitch: least squares spreads the lag over all, the robust fit does not.
    #[test]
    fn markers_that_lag_are_outvoted() {
        let truth = RigidMotion { reference: Vec2::ZERO, translation: Vec2::new(8.0, 2.0), rotation_rad: 0.05 };
        let lag = |p: Vec2| if p.x < 60.0 { Vec2::new(6.0, 0.0) } else { Vec2::ZERO };
        let pairs = grid().map(|p| (p, truth.apply(p) - lag(p)));
        let error = |m: RigidMotion| (m.apply(Vec2::new(100.0, 100.0)) - truth.apply(Vec2::new(100.0, 100.0))).length();
        assert!(error(fit_most(pairs.clone(), 15.0).expect("points")) < 0.1);
        assert!(error(fit_rigid(pairs).expect("points")) > 0.5);
    }

    /// 8 x 6 markers at 30 px, moved by (3, -2) px, then changed by a test.
    fn moved(change: impl Fn(&mut Marker)) -> Vec<Marker> {
        let place = |i: u32| Vec2::new(40.0 + 30.0 * f64::from(i % 8), 40.0 + 30.0 * f64::from(i / 8));
        let mut markers: Vec<Marker> = (0..48).map(|id| Marker::at_rest(id, place(id))).collect();
        for m in &mut markers {
            m.now = m.reference + Vec2::new(3.0, -2.0);
            change(m);
        }
        markers
    }

    /// A disc-shaped region.
    fn disc(centre: Vec2, radius_px: f64) -> Mask {
        let size = crate::image::SizePx::new(320, 240);
        let mut region = Mask::new(size);
        for i in 0..size.area() {
            let (x, y) = (i % size.width, i / size.width);
            region.set(x, y, (Vec2::new(x as f64, y as f64) - centre).length() < radius_px);
        }
        region
    }

    fn fitted(region: &Mask, markers: &mut [Marker]) -> Motion {
        let settings = MotionSettings { fit: Fit::Rigid, ..MotionSettings::default() };
        let mut motion = Motion::new(&crate::sensor::tests::smooth(), &settings);
        motion.fit(region, markers);
        motion
    }

    /// Markers that are not whole now, or were not found in the reference frame, do not affect the motion.
    #[test]
    fn the_motion_is_that_of_markers_whose_way_is_known() {
        let region = disc(Vec2::new(145.0, 115.0), 90.0);
        let spoilt = |m: &Marker| m.id.is_multiple_of(5);
        for spoil in [|m: &mut Marker| m.in_reference = false, |m: &mut Marker| m.whole = false] {
            let mut markers = moved(|m| {
                if spoilt(m) {
                    m.now.x += 25.0;
                    spoil(m);
                }
            });
            let motion = fitted(&region, &mut markers);
            let found = motion.motion.expect("markers");
            assert!((found.translation - Vec2::new(3.0, -2.0)).length() < 1e-9, "{found:?}");
            assert!(found.rotation_rad.abs() < 1e-9);
            assert_eq!(motion.inner_count as usize, markers.iter().filter(|m| m.inner).count());
            assert!(motion.inner_count > 4 && markers.iter().all(|m| !(m.inner && spoilt(m))));
        }
    }

    /// A small contact: the widest erosion leaves too few markers, the next ones more.
    #[test]
    fn the_inner_region_is_eroded_less_where_few_markers_would_be_left() {
        let around = |radius_px: f64| {
            let mut markers = moved(|_| {});
            let motion = fitted(&disc(Vec2::new(148.0, 113.0), radius_px), &mut markers);
            let which = motion.inner_erosion().map(|erosion| {
                motion.elements.iter().position(|element| std::ptr::eq(element, erosion)).expect("one of them")
            });
            (which, motion.inner_count, motion.motion.is_some())
        };
        // Radii of the ellipses: 25, 15, 5 and 1 px times 30 / 15.2 / 2, that is 24.7, 14.8, 4.9 and 1 px. The four
        // nearest markers lie at 21.2 px from the middle.
        assert_eq!(around(50.0), (Some(0), 4, true));
        assert_eq!(around(40.0), (Some(1), 4, true));
        assert_eq!(around(30.0), (Some(2), 4, true));
        assert_eq!(around(24.0), (Some(3), 4, true));
        assert_eq!(around(10.0), (Some(3), 0, false), "no markers, no motion");
    }
}
