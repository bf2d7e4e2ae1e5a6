//! The displacement field of a contact: its markers, the rigid motion of those that stick, and the features.

use super::features::{Features, SCALE_MU};
use super::window::{Sample, Stretches};
use crate::plane::{RigidMotion, Vec2};

/// A marker in contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    /// Number of the marker.
    pub id: u32,
    /// Position at rest, px.
    pub rest: Vec2,
    /// Displacement under load, px.
    pub displacement: Vec2,
    /// Residual to the rigid motion when the marker joined the contact, px.
    pub joined: Vec2,
    /// Displacement of the rigid motion there, px.
    pub rigid: Vec2,
    /// Distance from the middle of the contact, px.
    pub radius: f64,
}

impl Point {
    /// Slip over the rigid motion, px.
    pub fn residual(&self) -> Vec2 {
        self.displacement - self.rigid - self.joined
    }
}

/// Scales in pitches of the weights of the rigid fit, one a round: without a fit of the last frame, from wide to narrow,
/// and with it, where the first round starts from its stick set.
const FIRST_PITCH: [f64; 9] = [1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1];
const NEXT_PITCH: [f64; 7] = [0.3, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1];

/// The rigid motion of the sticking markers, starting from that of the last frame: the stick set is carried over, so
/// that a slipping rim does not bias the fit.
pub(super) fn fit(points: &[Point], before: Option<&RigidMotion>, pitch_px: f64) -> Option<RigidMotion> {
    let (mut motion, scales) = match before {
        Some(before) => (*before, &NEXT_PITCH[..]),
        None => (weighted(points, |_| 1.0)?, &FIRST_PITCH[..]),
    };
    for scale_pitch in scales {
        let scale_squared = (scale_pitch * pitch_px) * (scale_pitch * pitch_px);
        let last = motion.tabulated();
        motion = weighted(points, |p| {
            let off = p.displacement - p.joined - last.displacement(p.rest);
            let t = 1.0 + off.length_squared() / scale_squared;
            1.0 / (t * t)
        })?;
    }
    Some(motion)
}

fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64) -> Option<RigidMotion> {
    crate::monitor::motion::fit_weighted(points.iter().map(|p| (p.rest, p.rest + p.displacement - p.joined, weight(p))))
}

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

/// Changes of the rigid motion below this many noise floors give no stiffness.
const LEAST_MOVE_FLOORS: f64 = 2.0;

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
    let (n, p) = (points.len() as f64, facts.pitch_px);
    let floor = FLOOR_PITCH * p;
    points.sort_unstable_by(|a, b| a.radius.total_cmp(&b.radius));
    let mean = |of: &dyn Fn(&Point) -> f64, points: &[Point]| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let share = |of: &dyn Fn(&Point) -> bool| points.iter().filter(|p| of(p)).count() as f64 / n;
    let slip = |q: &Point| q.residual().length();
    let relative = |q: &Point| slip(q) / (q.rigid.length() + floor);
    let moved = |q: &Point| (q.displacement - q.joined).length();

    let third = (points.len() / 3).max(1);
    let (inner, outer) = (&points[..third], &points[points.len() - third..]);
    let mean_rigid = mean(&|q| q.rigid.length(), points);
    let rigid_squared = points.iter().map(|q| q.rigid.length_squared()).sum::<f64>();
    let rigid_px = (rigid_squared / n).sqrt();
    let arm_px = mean(&|q| q.radius, points).max(1e-6);
    let lever_px = mean(&|q| q.radius * q.radius, points).max(1e-12) / arm_px;
    let largest_radius = points.last().map_or(1.0, |q| q.radius).max(1e-6);
    let along: f64 = points.iter().map(|q| (q.displacement - q.joined).dot(q.rigid)).sum();

    let load_px3 = libm::hypot(facts.force_px3.length(), facts.moment_px4 / arm_px);
    // About the middle of the contact, where the motion is expressed.
    let work = facts.force_px3.dot(motion.translation) + facts.moment_px4 * motion.rotation_rad;
    let patch_px2 =
        facts.area_px2 + facts.drag_width_px * 2.0 * (std::f64::consts::PI * facts.area_px2.max(1.0)).sqrt();
    let moves = rigid_px > 0.02 * p;
    let secant_px2 = moves.then(|| work / (rigid_px * rigid_px));
    let stiffest_px2 = facts.stiffest_px2.max(secant_px2.unwrap_or(0.0));
    let added_rigid = facts.before.map_or(0.0, |s| rigid_px - s.rigid_px);
    let tangent_px2 = stretches.see(load_px3, rigid_px, LEAST_MOVE_FLOORS * floor);

    let (mut narrow, mut wide) = spread(points);
    (narrow, wide) = (narrow / p, wide / p);
    let slope = {
        let (mean_x, mean_y) = (mean(&|q| q.radius, points) / largest_radius, mean(&relative, points));
        let (mut xx, mut xy) = (0.0, 0.0);
        for q in points.iter() {
            let x = q.radius / largest_radius - mean_x;
            (xx, xy) = (xx + x * x, xy + x * (relative(q) - mean_y));
        }
        xy / xx.max(1e-9)
    };
    let turn_px = motion.rotation_rad.abs() * arm_px;
    let (low, high) = facts.inside;
    let cut = share(&|q| q.rest.x < low.x || q.rest.y < low.y || q.rest.x > high.x || q.rest.y > high.y);
    let sticking = mean(
        &|q| {
            let t = 1.0 + q.residual().length_squared() / (0.01 * p * p);
            1.0 / (t * t)
        },
        points,
    );
    let over_fraction = share(&|q| slip(q) > 0.1 * q.rigid.length() + 0.03 * p);
    let over_twentieth = share(&|q| slip(q) > 0.05 * p);
    let [q90, q75, q50, q25] = quantiles(points, relative, [0.9, 0.75, 0.5, 0.25], scratch);
    let [far_px] = quantiles(points, moved, [0.9], scratch);

    let mean_moved = points.iter().fold(Vec2::ZERO, |sum, q| sum + (q.displacement - q.joined)) / n;
    let slip_rms = (points.iter().map(|q| q.residual().length_squared()).sum::<f64>() / n).sqrt();
    let per_grip = facts.stiffness_over_grip_per_px3.unwrap_or(0.0) / SCALE_MU;
    let area = per_grip * facts.area_px2;
    FieldMeasures {
        features: [
            mean(&slip, points) / (mean_rigid + floor),
            mean(&moved, outer) / (mean(&moved, inner) + floor),
            over_fraction,
            secant_px2.unwrap_or(0.0) / patch_px2,
            1.0 - along / rigid_squared.max(1e-6),
            tangent_px2.or(secant_px2).unwrap_or(0.0) / patch_px2,
            secant_px2.map_or(0.0, |now| if stiffest_px2 > 0.0 { 1.0 - now / stiffest_px2 } else { 0.0 }),
            q25,
            q50,
            q75,
            q90,
            floor / (rigid_px + floor),
            cut,
            sticking,
            slope,
            turn_px / (motion.translation.length() + turn_px + 0.5 * floor),
            narrow,
            wide,
            over_twentieth,
            added_rigid / (rigid_px + floor),
            per_grip * load_px3,
            area * mean_moved.length(),
            area * slip_rms,
            area * far_px,
            facts.hidden_fraction,
        ],
        load_px3,
        rigid_px,
        arm_px,
        lever_px,
        secant_px2,
    }
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
