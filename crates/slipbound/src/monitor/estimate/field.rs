//! The displacement field of a contact: its markers, the rigid motion of those that stick, and the load -> features.
//!
//! ```text
//!   points, sorted by radius -+- residuals: how far markers lag behind the rigid motion
//!                             +- shape: size, border, slope of the lag from the middle to the rim
//!   motion, load -------------+- stiffness: load over motion, as a whole and of the last stretch
//!   stiffness over grip ------+- loads: load and shear over what the grip could hold
//! ```

use super::features::{
    CUT, FAR_SHEAR, FEATURES_COUNT, Features, HIDDEN, LOAD, MEAN_SHEAR, MOVING, NARROW, NOISE, OVER_FRACTION,
    OVER_TWENTIETH, Q25, Q50, Q75, Q90, RESIDUAL_OVER_RIGID, RESIDUAL_SHEAR, RIM_OVER_CENTRE, SCALE_MU, SECANT, SLOPE,
    SOFTENING, STICKING, TANGENT, TURNING, WIDE, WORK_LOST,
};
use super::rigid_fit::Point;
use super::window::{Sample, Stretches};
use crate::plane::{RigidMotion, Vec2};

/// Data of a frame that the features need besides the points.
pub(super) struct FieldFacts {
    pub pitch_px: f64,
    /// Area of the contact, px2, including the part out of view.
    pub area_px2: f64,
    /// The share of it that is out of view.
    pub hidden_fraction: f64,
    /// Width of the surrounding gel that a sticking patch drags along, px: 0.64 of the gel's thickness.
    pub drag_width_px: f64,
    /// Load: sum over all markers of displacement times area, px3.
    pub force_px3: Vec2,
    /// Its moment about the middle of the contact, px4.
    pub moment_px4: f64,
    /// Stiffness k in N/px3 over the grip force in N; None where either is unknown.
    pub stiffness_over_grip_per_px3: Option<f64>,
    /// Border of the view: smallest and largest position of a marker that is well inside.
    pub inside: (Vec2, Vec2),
    /// A frame of some 0.18 s ago.
    pub before: Option<Sample>,
    /// Largest secant stiffness so far, px2.
    pub stiffest_px2: f64,
}

/// Changes of the rigid motion below this many noise floors give no stiffness, nor does a motion below this many
/// pitches.
const LEAST_MOVE_FLOORS: f64 = 2.0;
const MOVING_PITCH: f64 = 0.02;

/// Most of `moving`. A contact that moves is told from one that stands, but for how long its load has grown is not: from
/// that, trees infer how much of a ramp remains, and take slow loads for large ones.
const MOST_MOVING: f64 = 0.01;

/// Slip over this share of the rigid displacement and this many pitches counts in `over_fraction`; slip over this many
/// pitches in `over_twentieth`.
const OVER_RIGID_FRACTION: f64 = 0.1;
const OVER_PITCH: f64 = 0.03;
const OVER_TWENTIETH_PITCH: f64 = 0.05;

/// Square of the scale of the weights in `sticking`, pitches squared.
const STICKING_PITCH2: f64 = 0.01;

/// Noise floors added to the motion of which `turning` is a share.
const TURNING_FLOORS: f64 = 0.5;

/// The features, and quantities computed with them.
pub(super) struct FieldMeasures {
    pub features: Features,
    /// Combined load: force, and torque over mean radius, px3.
    pub load_px3: f64,
    /// RMS of the rigid displacement, px.
    pub rigid_px: f64,
    /// Mean distance of the markers in contact from its middle, px.
    pub arm_px: f64,
    /// Mean square of these distances over their mean, px. The torque divided by it is the force under which the whole
    /// contact moves as far as the gel at the arm does under the torque.
    pub lever_px: f64,
    /// Secant stiffness of this frame, px2; None while nothing has moved.
    pub secant_px2: Option<f64>,
}

/// Noise floor of displacement, in pitches: 0.02 mm at a pitch of 1.5 mm.
pub(super) const FLOOR_PITCH: f64 = 0.02 / 1.5;

/// The features of a frame. `points` have their rigid displacement and radius set; they are sorted by radius here.
/// `scratch` is at least as long.
pub(super) fn features(
    points: &mut [Point],
    motion: &RigidMotion,
    facts: &FieldFacts,
    stretches: &mut Stretches,
    scratch: &mut [f64],
) -> FieldMeasures {
    points.sort_unstable_by(|a, b| a.radius.total_cmp(&b.radius));
    let sums = Sums::of(points, FLOOR_PITCH * facts.pitch_px);
    let load_px3 = libm::hypot(facts.force_px3.length(), facts.moment_px4 / sums.arm_px);
    let mut features = [0.0; FEATURES_COUNT];
    residuals(points, &sums, facts.pitch_px, scratch, &mut features);
    shape(points, &sums, facts, &mut features);
    motion_of_contact(&sums, motion, facts, &mut features);
    let secant_px2 = stiffness(&sums, motion, load_px3, facts, stretches, &mut features);
    loads(points, load_px3, facts, scratch, &mut features);
    let Sums { rigid_px, arm_px, lever_px, .. } = sums;
    FieldMeasures { features, load_px3, rigid_px, arm_px, lever_px, secant_px2 }
}

/// Sums over the points that several features need.
struct Sums {
    floor_px: f64,
    /// Mean length of the rigid displacement, px.
    mean_rigid_px: f64,
    /// Sum of the squares of these lengths, px2, and the root of their mean, px.
    rigid_squared_px2: f64,
    rigid_px: f64,
    /// See [`FieldMeasures`].
    arm_px: f64,
    lever_px: f64,
}

impl Sums {
    fn of(points: &[Point], floor_px: f64) -> Self {
        let rigid_squared_px2 = points.iter().map(|q| q.rigid.length_squared()).sum::<f64>();
        let arm_px = mean(points, |q| q.radius).max(1e-6);
        Sums {
            floor_px,
            mean_rigid_px: mean(points, |q| q.rigid.length()),
            rigid_squared_px2,
            rigid_px: (rigid_squared_px2 / points.len() as f64).sqrt(),
            arm_px,
            lever_px: mean(points, |q| q.radius * q.radius).max(1e-12) / arm_px,
        }
    }

    /// Slip of a point over its rigid displacement.
    fn relative(&self, q: &Point) -> f64 {
        slip_px(q) / (q.rigid.length() + self.floor_px)
    }
}

fn mean(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    points.iter().map(of).sum::<f64>() / points.len() as f64
}

fn share(points: &[Point], of: impl Fn(&Point) -> bool) -> f64 {
    points.iter().filter(|q| of(q)).count() as f64 / points.len() as f64
}

fn slip_px(q: &Point) -> f64 {
    q.residual().length()
}

/// Displacement since the point joined the contact, px.
fn moved_px(q: &Point) -> f64 {
    (q.displacement - q.joined).length()
}

/// How far the points lag behind the rigid motion.
fn residuals(points: &[Point], sums: &Sums, pitch_px: f64, scratch: &mut [f64], into: &mut Features) {
    let third = (points.len() / 3).max(1);
    let (inner, outer) = (&points[..third], &points[points.len() - third..]);
    let weight = |q: &Point| {
        let t = 1.0 + q.residual().length_squared() / (STICKING_PITCH2 * pitch_px * pitch_px);
        1.0 / (t * t)
    };
    let is_over = |q: &Point| slip_px(q) > OVER_RIGID_FRACTION * q.rigid.length() + OVER_PITCH * pitch_px;
    let along: f64 = points.iter().map(|q| (q.displacement - q.joined).dot(q.rigid)).sum();
    into[RESIDUAL_OVER_RIGID] = mean(points, slip_px) / (sums.mean_rigid_px + sums.floor_px);
    into[RIM_OVER_CENTRE] = mean(outer, moved_px) / (mean(inner, moved_px) + sums.floor_px);
    into[OVER_FRACTION] = share(points, is_over);
    into[OVER_TWENTIETH] = share(points, |q| slip_px(q) > OVER_TWENTIETH_PITCH * pitch_px);
    into[WORK_LOST] = 1.0 - along / sums.rigid_squared_px2.max(1e-6);
    into[STICKING] = mean(points, weight);
    [into[Q90], into[Q75], into[Q50], into[Q25]] =
        quantiles(points, |q| sums.relative(q), [0.9, 0.75, 0.5, 0.25], scratch);
}

/// Size of the contact, its share at the border of the view, and how the slip grows towards its rim.
fn shape(points: &[Point], sums: &Sums, facts: &FieldFacts, into: &mut Features) {
    let (narrow_px, wide_px) = spread(points);
    (into[NARROW], into[WIDE]) = (narrow_px / facts.pitch_px, wide_px / facts.pitch_px);
    let largest_radius = points.last().map_or(1.0, |q| q.radius).max(1e-6);
    let mean_x = mean(points, |q| q.radius) / largest_radius;
    let mean_y = mean(points, |q| sums.relative(q));
    let (mut xx, mut xy) = (0.0, 0.0);
    for q in points {
        let x = q.radius / largest_radius - mean_x;
        (xx, xy) = (xx + x * x, xy + x * (sums.relative(q) - mean_y));
    }
    into[SLOPE] = xy / xx.max(1e-9);
    let (low, high) = facts.inside;
    into[CUT] = share(points, |q| q.rest.x < low.x || q.rest.y < low.y || q.rest.x > high.x || q.rest.y > high.y);
    into[HIDDEN] = facts.hidden_fraction;
}

/// The rigid motion itself: its size against the noise, its rotation, and what was added lately.
fn motion_of_contact(sums: &Sums, motion: &RigidMotion, facts: &FieldFacts, into: &mut Features) {
    let turn_px = motion.rotation_rad.abs() * sums.arm_px;
    let added_px = facts.before.map_or(0.0, |s| sums.rigid_px - s.rigid_px);
    into[NOISE] = sums.floor_px / (sums.rigid_px + sums.floor_px);
    into[TURNING] = turn_px / (motion.translation.length() + turn_px + TURNING_FLOORS * sums.floor_px);
    into[MOVING] = (added_px / (sums.rigid_px + sums.floor_px)).clamp(-MOST_MOVING, MOST_MOVING);
}

/// Load over motion. Returns the secant stiffness, px2; None while nothing has moved.
fn stiffness(
    sums: &Sums,
    motion: &RigidMotion,
    load_px3: f64,
    facts: &FieldFacts,
    stretches: &mut Stretches,
    into: &mut Features,
) -> Option<f64> {
    // About the middle of the contact, where the motion is expressed.
    let work = facts.force_px3.dot(motion.translation) + facts.moment_px4 * motion.rotation_rad;
    let patch_px2 =
        facts.area_px2 + facts.drag_width_px * 2.0 * (std::f64::consts::PI * facts.area_px2.max(1.0)).sqrt();
    let moves = sums.rigid_px > MOVING_PITCH * facts.pitch_px;
    let secant_px2 = moves.then(|| work / (sums.rigid_px * sums.rigid_px));
    let stiffest_px2 = facts.stiffest_px2.max(secant_px2.unwrap_or(0.0));
    let tangent_px2 = stretches.see(load_px3, sums.rigid_px, LEAST_MOVE_FLOORS * sums.floor_px);
    into[SECANT] = secant_px2.unwrap_or(0.0) / patch_px2;
    into[TANGENT] = tangent_px2.or(secant_px2).unwrap_or(0.0) / patch_px2;
    into[SOFTENING] = secant_px2.map_or(0.0, |now| if stiffest_px2 > 0.0 { 1.0 - now / stiffest_px2 } else { 0.0 });
    secant_px2
}

/// Load and shear over what the grip could hold; 0 where that is not known.
fn loads(points: &[Point], load_px3: f64, facts: &FieldFacts, scratch: &mut [f64], into: &mut Features) {
    let n = points.len() as f64;
    let mean_moved = points.iter().fold(Vec2::ZERO, |sum, q| sum + (q.displacement - q.joined)) / n;
    let slip_rms_px = (points.iter().map(|q| q.residual().length_squared()).sum::<f64>() / n).sqrt();
    let [far_px] = quantiles(points, moved_px, [0.9], scratch);
    let per_grip = facts.stiffness_over_grip_per_px3.unwrap_or(0.0) / SCALE_MU;
    let area = per_grip * facts.area_px2;
    into[LOAD] = per_grip * load_px3;
    into[MEAN_SHEAR] = area * mean_moved.length();
    into[RESIDUAL_SHEAR] = area * slip_rms_px;
    into[FAR_SHEAR] = area * far_px;
}

/// Quantiles of `of` over the points, the largest first. `scratch` is at least as long as `points`.
fn quantiles<const N: usize>(
    points: &[Point],
    of: impl Fn(&Point) -> f64,
    at: [f64; N],
    scratch: &mut [f64],
) -> [f64; N] {
    let mut below = &mut scratch[..points.len()];
    below.iter_mut().zip(points).for_each(|(out, q)| *out = of(q));
    let last = (points.len() - 1) as f64;
    let mut larger = f64::NAN;
    at.map(|at| {
        let at = (at * last).round() as usize;
        // Two quantiles of few points may coincide.
        if at < below.len() {
            let (rest, found, _) = std::mem::take(&mut below).select_nth_unstable_by(at, f64::total_cmp);
            (below, larger) = (rest, *found);
        }
        larger
    })
}

/// Standard deviations of the positions along their main axes, the smaller first, px.
fn spread(points: &[Point]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = points.iter().fold(Vec2::ZERO, |sum, q| sum + q.rest) / n;
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for q in points {
        let d = q.rest - mean;
        (xx, yy, xy) = (xx + d.x * d.x / n, yy + d.y * d.y / n, xy + d.x * d.y / n);
    }
    let (half, apart) = ((xx + yy) / 2.0, libm::hypot((xx - yy) / 2.0, xy));
    ((half - apart).max(0.0).sqrt(), (half + apart).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_numbers_however_few() {
        for count in 1..60usize {
            let radius = |i: usize| ((i * 37) % 11) as f64;
            let points: Vec<Point> = (0..count).map(|i| Point { radius: radius(i), ..Point::default() }).collect();
            let mut sorted: Vec<f64> = (0..count).map(radius).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let at = [0.9, 0.75, 0.5, 0.25];
            let wanted = at.map(|at| sorted[(at * (count - 1) as f64).round() as usize]);
            let mut scratch = vec![0.0; count + 3];
            assert_eq!(quantiles(&points, |q| q.radius, at, &mut scratch), wanted, "of {count}");
        }
    }
}
