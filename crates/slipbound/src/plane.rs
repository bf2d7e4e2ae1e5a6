//! Points, rigid motions and homographies of the image plane.
//!
//! ```text
//!   o----> x  along the finger                rotation is positive from x to y:
//!   |                                         clockwise on the screen,
//!   v  y  across the finger                   z points into the gel
//! ```

use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A point or a displacement in the image plane. The unit is the caller's: px unless the name says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "[f64; 2]", from = "[f64; 2]")]
pub struct Vec2 {
    /// Along the finger.
    pub x: f64,
    /// Across the finger.
    pub y: f64,
}

/// The whole pixel nearest to a coordinate; ties are rounded away from zero, like `round`, which is a function call on
/// CPUs that the baseline is compiled for. NaN is 0.
#[inline]
pub fn nearest_px(at_px: f64) -> isize {
    (at_px + 0.5f64.copysign(at_px)) as isize
}

impl Vec2 {
    /// The origin, or no displacement.
    pub const ZERO: Vec2 = Vec2 { x: 0.0, y: 0.0 };

    /// The vector (x, y).
    pub const fn new(x: f64, y: f64) -> Self {
        Vec2 { x, y }
    }

    /// Euclidean length.
    pub fn length(self) -> f64 {
        self.length_squared().sqrt()
    }

    /// Squared Euclidean length.
    pub fn length_squared(self) -> f64 {
        self.x * self.x + self.y * self.y
    }

    /// Scalar product.
    pub fn dot(self, other: Vec2) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// z of the cross product: positive when `other` lies clockwise on the screen (from x to y).
    pub fn cross(self, other: Vec2) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Rotated by an angle in radians, positive from x to y.
    pub fn rotated(self, angle_rad: f64) -> Vec2 {
        let (s, c) = (libm::sin(angle_rad), libm::cos(angle_rad));
        Vec2::new(c * self.x - s * self.y, s * self.x + c * self.y)
    }

    /// The vector rotated by 90 deg from x to y: the velocity, at this lever arm, of a unit rotation.
    pub fn turned(self) -> Vec2 {
        Vec2::new(-self.y, self.x)
    }

    /// Direction in radians, 0 along x, positive from x to y, in (-pi, pi].
    pub fn direction_rad(self) -> f64 {
        libm::atan2(self.y, self.x)
    }

    /// Whether both components are finite numbers.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl From<[f64; 2]> for Vec2 {
    fn from([x, y]: [f64; 2]) -> Self {
        Vec2 { x, y }
    }
}

impl From<Vec2> for [f64; 2] {
    fn from(v: Vec2) -> Self {
        [v.x, v.y]
    }
}

impl Add for Vec2 {
    type Output = Vec2;
    fn add(self, o: Vec2) -> Vec2 {
        Vec2::new(self.x + o.x, self.y + o.y)
    }
}

impl AddAssign for Vec2 {
    fn add_assign(&mut self, o: Vec2) {
        *self = *self + o;
    }
}

impl Sub for Vec2 {
    type Output = Vec2;
    fn sub(self, o: Vec2) -> Vec2 {
        Vec2::new(self.x - o.x, self.y - o.y)
    }
}

impl Neg for Vec2 {
    type Output = Vec2;
    fn neg(self) -> Vec2 {
        Vec2::new(-self.x, -self.y)
    }
}

impl Mul<f64> for Vec2 {
    type Output = Vec2;
    fn mul(self, s: f64) -> Vec2 {
        Vec2::new(self.x * s, self.y * s)
    }
}

impl Div<f64> for Vec2 {
    type Output = Vec2;
    fn div(self, s: f64) -> Vec2 {
        Vec2::new(self.x / s, self.y / s)
    }
}

/// A planar rigid motion `now = R (rest - reference) + reference + translation`: a rotation about a reference
/// point, then a translation of that point. No scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigidMotion {
    /// The reference point: the mean of the fitted points before the motion.
    pub reference: Vec2,
    /// Displacement of the reference point.
    pub translation: Vec2,
    /// Rotation in radians, positive from x to y.
    pub rotation_rad: f64,
}

impl RigidMotion {
    /// Where a point of the body is after the motion.
    pub fn apply(&self, rest: Vec2) -> Vec2 {
        rest + self.displacement(rest)
    }

    /// Exact displacement of a point of the body.
    pub fn displacement(&self, rest: Vec2) -> Vec2 {
        self.tabulated().displacement(rest)
    }

    /// The motion with its sine and cosine precomputed, for many points.
    pub(crate) fn tabulated(&self) -> TabulatedMotion {
        // R - I, with cos - 1 written so that nothing cancels at small angles.
        let half = libm::sin(self.rotation_rad / 2.0);
        TabulatedMotion { motion: *self, sin: libm::sin(self.rotation_rad), cos_less_1: -2.0 * half * half }
    }

    /// Displacement by equation 1 of the paper: the limit of [`RigidMotion::displacement`] at small angles.
    pub fn displacement_small_angle(&self, rest: Vec2) -> Vec2 {
        self.translation + (rest - self.reference).turned() * self.rotation_rad // Eq. 1
    }

    /// The point that does not move: the centre of rotation (ICR of the paper, for a finite motion its pole).
    /// None for a rotation below `min_rotation_rad`, where the pole runs off to infinity.
    pub fn centre_of_rotation(&self, min_rotation_rad: f64) -> Option<Vec2> {
        if self.rotation_rad.abs() < min_rotation_rad.max(f64::MIN_POSITIVE) {
            return None;
        }
        // (I - R)^-1 t = t/2 + cot(rotation/2)/2 * t turned
        let half = self.rotation_rad / 2.0;
        let cot = libm::cos(half) / libm::sin(half);
        Some(self.reference + (self.translation + self.translation.turned() * cot) * 0.5)
    }
}

/// A rigid motion with its sine and cosine precomputed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TabulatedMotion {
    motion: RigidMotion,
    sin: f64,
    cos_less_1: f64,
}

impl TabulatedMotion {
    /// As [`RigidMotion::apply`].
    pub(crate) fn apply(&self, rest: Vec2) -> Vec2 {
        rest + self.displacement(rest)
    }

    /// As [`RigidMotion::displacement`].
    pub(crate) fn displacement(&self, rest: Vec2) -> Vec2 {
        let arm = rest - self.motion.reference;
        let turned = Vec2::new(self.cos_less_1 * arm.x - self.sin * arm.y, self.sin * arm.x + self.cos_less_1 * arm.y);
        self.motion.translation + turned
    }
}

/// A plane projective map, rows of a 3 x 3 matrix acting on (x, y, 1).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Homography(pub [[f64; 3]; 3]);

impl Homography {
    /// The identity.
    pub const IDENTITY: Homography = Homography([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);

    /// The image of a point.
    pub fn apply(&self, p: Vec2) -> Vec2 {
        let [a, b, c] = self.0;
        let w = c[0] * p.x + c[1] * p.y + c[2];
        Vec2::new((a[0] * p.x + a[1] * p.y + a[2]) / w, (b[0] * p.x + b[1] * p.y + b[2]) / w)
    }

    /// `self` after `first`.
    pub fn after(&self, first: &Homography) -> Homography {
        let mut out = [[0.0; 3]; 3];
        for (i, row) in out.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = (0..3).map(|k| self.0[i][k] * first.0[k][j]).sum();
            }
        }
        Homography(out)
    }

    /// The inverse map; None when the matrix is singular or not finite.
    pub fn inverse(&self) -> Option<Homography> {
        let m = &self.0;
        let cofactor = |i: usize, j: usize| {
            let (r, s) = ((i + 1) % 3, (i + 2) % 3);
            let (t, u) = ((j + 1) % 3, (j + 2) % 3);
            m[r][t] * m[s][u] - m[r][u] * m[s][t]
        };
        let det = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum::<f64>();
        if !det.is_finite() || det.abs() < 1e-12 {
            return None;
        }
        let mut out = [[0.0; 3]; 3];
        for (i, row) in out.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = cofactor(j, i) / det;
            }
        }
        Some(Homography(out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_1_is_the_small_angle_limit_of_the_exact_rotation() {
        let arm = Vec2::new(80.0, 0.0);
        for (rotation_deg, error_px) in [(0.5f64, 0.003), (5.0, 0.305), (10.0, 1.219), (15.0, 2.741)] {
            let m =
                RigidMotion { reference: Vec2::ZERO, translation: Vec2::ZERO, rotation_rad: rotation_deg.to_radians() };
            let error = (m.displacement(arm) - m.displacement_small_angle(arm)).length();
            assert!((error - error_px).abs() < 0.01, "{rotation_deg} deg: {error} px, expected {error_px}");
        }
    }

    #[test]
    fn centre_of_rotation_does_not_move() {
        let m =
            RigidMotion { reference: Vec2::new(100.0, 50.0), translation: Vec2::new(3.0, -2.0), rotation_rad: -0.2 };
        let icr = m.centre_of_rotation(1e-3).expect("rotates");
        assert!((m.apply(icr) - icr).length() < 1e-9);
        assert!(
            m.centre_of_rotation(0.2).is_some() && m.centre_of_rotation(0.201).is_none(),
            "below, not at, the least"
        );
        let shift = RigidMotion { rotation_rad: 0.0, ..m };
        assert_eq!(shift.centre_of_rotation(0.0), None);
    }

    #[test]
    fn homography_inverse_undoes() {
        let h = Homography([
            [0.79809213, -0.33790120, 41.21788310],
            [0.03669927, 0.84359564, -24.59355941],
            [-0.00010275817, -0.00143881538, 1.0],
        ]);
        let p = Vec2::new(200.0, 120.0);
        assert!((h.inverse().expect("regular").apply(h.apply(p)) - p).length() < 1e-9);
        assert_eq!(Homography([[0.0; 3]; 3]).inverse(), None);
    }

    fn close(a: Vec2, b: Vec2) {
        assert!((a - b).length() < 1e-9 * (1.0 + b.length()), "{a:?}, not {b:?}");
    }

    #[test]
    fn a_quarter_turn_takes_x_to_y_and_y_to_minus_x() {
        let (x, y) = (Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0));
        let quarter = std::f64::consts::FRAC_PI_2;
        close(x.rotated(quarter), y);
        close(y.rotated(quarter), -x);
        assert_eq!((x.turned(), y.turned()), (y, -x));
        assert_eq!((y.direction_rad(), Vec2::new(-1.0, 0.0).direction_rad()), (quarter, std::f64::consts::PI));
        assert_eq!(([3.0, 4.0], Vec2::new(3.0, 4.0)), (Vec2::new(3.0, 4.0).into(), [3.0, 4.0].into()));
        for broken in [f64::NAN, f64::INFINITY] {
            assert!(!Vec2::new(broken, 0.0).is_finite() && !Vec2::new(0.0, broken).is_finite() && x.is_finite());
        }
    }

    mod any {
        use super::*;
        use proptest::prelude::*;

        fn vector() -> impl Strategy<Value = Vec2> {
            (-300.0..300.0f64, -300.0..300.0f64).prop_map(|(x, y)| Vec2::new(x, y))
        }

        /// Maps between images: those of an oblique camera, far from its horizon.
        fn homography() -> impl Strategy<Value = Homography> {
            let matrix =
                (0.5..2.0f64, -0.3..0.3f64, vector(), -0.3..0.3f64, 0.5..2.0f64, (-4e-4..4e-4f64, -4e-4..4e-4f64));
            matrix.prop_map(|(a, b, t, c, d, (g, h))| Homography([[a, b, t.x], [c, d, t.y], [g, h, 1.0]]))
        }

        proptest! {
            #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

            #[test]
            fn products_are_those_of_the_plane(a in vector(), b in vector(), turn in -3.0..3.0f64) {
                // The sum of the squares equals the product of the squared lengths, and a common rotation changes
                // neither product.
                let size = 1.0 + a.length_squared() * b.length_squared();
                let sum = a.dot(b) * a.dot(b) + a.cross(b) * a.cross(b);
                prop_assert!((sum - a.length_squared() * b.length_squared()).abs() < 1e-9 * size);
                prop_assert!((a.rotated(turn).dot(b.rotated(turn)) - a.dot(b)).abs() < 1e-9 * size);
                prop_assert!((a.rotated(turn).cross(b.rotated(turn)) - a.cross(b)).abs() < 1e-9 * size);
                prop_assert!((a.turned().dot(b) - a.cross(b)).abs() < 1e-9 * size);
                prop_assert!((a.length() * a.length() - a.dot(a)).abs() < 1e-9 * size);
                // A right angle from x to y is positive.
                prop_assert!(a.cross(a.turned()) >= 0.0);
                close((a + b) * 2.0 - a / 0.5, b * 2.0);
                close(a.rotated(turn).rotated(-turn), a);
            }

            #[test]
            fn a_rigid_motion_keeps_distances_and_turns_by_its_angle(
                reference in vector(), translation in vector(), rotation_rad in -3.0..3.0f64, p in vector(), q in vector(),
            ) {
                let motion = RigidMotion { reference, translation, rotation_rad };
                close(motion.apply(reference), reference + translation);
                close(motion.apply(p) - motion.apply(q), (p - q).rotated(rotation_rad));
                close(motion.tabulated().apply(p), motion.apply(p));
                // At a very small angle the motion follows equation 1.
                let (exact, small) = (motion.displacement(p), RigidMotion { rotation_rad: 1e-7, ..motion }.displacement_small_angle(p));
                close(RigidMotion { rotation_rad: 1e-7, ..motion }.displacement(p), small);
                prop_assert!(exact.is_finite());
                let least_rad = 0.01;
                match motion.centre_of_rotation(least_rad) {
                    Some(centre) => close(motion.apply(centre), centre),
                    None => prop_assert!(rotation_rad.abs() < least_rad),
                }
            }

            #[test]
            fn maps_follow_each_other_and_are_undone(first in homography(), then in homography(), p in vector()) {
                close(then.after(&first).apply(p), then.apply(first.apply(p)));
                if let Some(back) = first.inverse() {
                    close(back.apply(first.apply(p)), p);
                }
                close(Homography::IDENTITY.apply(p), p);
            }
        }
    }

    #[test]
    fn a_map_onto_a_line_or_of_no_numbers_has_no_inverse() {
        let line = Homography([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(line.inverse(), None);
        assert_eq!(Homography([[f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).inverse(), None);
        // Mirrored maps have an inverse, too.
        let mirror = Homography([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(mirror.inverse(), Some(mirror));
    }
}
