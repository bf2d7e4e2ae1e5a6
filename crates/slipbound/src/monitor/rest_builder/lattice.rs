//! The lattice of the markers at rest: their spacing, and which of the spots found are not on its nodes.
//!
//! ```text
//!   o   o   o   o       markers are at whole pitches along both axes of the rectified image; glare, dirt and
//!   o   o * o   o       scratches (*) are not. The lattice is estimated from the spots around each one, so it
//!   o   o   o   o       follows a small error of the pitch or of the lens correction.
//! ```

use crate::plane::Vec2;

/// Spacing over pitch was 0.97 to 1.03 for the right finger (all our recordings), and 0.47 to 0.79 or 1.29 to 1.41 for
/// another finger.
const PITCH_TRUSTED_RATIO: std::ops::RangeInclusive<f64> = 0.85..=1.18;
/// Spots within this distance vote on the position of the lattice, in pitches: about 28 nodes.
const VOTERS_PITCH: f64 = 3.0;
/// Fewest of them.
const FEWEST_VOTERS: u32 = 4;
/// Least agreement, from 0 (anywhere) to 1 (all on nodes), for a lattice.
const LEAST_AGREEMENT: f64 = 0.6;
/// Largest offset of a marker while the lattice is only a first estimate, in pitches.
const FIRST_LIMIT_PITCH: f64 = 0.3;
/// A spot is off the lattice when it is further from its node than this many standard deviations of the spots on it,
const LIMIT_SIGMAS: f64 = 4.5;
/// with that limit clamped to this range, in pitches.
const LIMITS_PITCH: (f64, f64) = (0.16, 0.35);
/// Least share of the spots on a lattice; with fewer, the dots have none (painted by hand, or random), and all of them
/// are markers. On a real finger, 18 % of the spots were glare.
const REGULAR_FRACTION: f64 = 0.65;

/// Median distance of a point to its nearest neighbour, px; None for fewer than two.
pub(super) fn spacing_px(points: &[Vec2]) -> Option<f64> {
    let nearest = |(i, a): (usize, &Vec2)| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, b)| (*b - *a).length()).min_by(f64::total_cmp)
    };
    let mut apart: Vec<f64> = points.iter().enumerate().filter_map(nearest).collect();
    apart.sort_unstable_by(f64::total_cmp);
    apart.get(apart.len() / 2).copied()
}

/// Whether points with this spacing can be the markers of a finger of this pitch.
pub(super) fn fits(spacing_px: f64, pitch_px: f64) -> bool {
    PITCH_TRUSTED_RATIO.contains(&(spacing_px / pitch_px))
}

/// Which points are nodes of a lattice along the axes of the image; None without a lattice.
pub(super) fn on_lattice(points: &[Vec2], pitch_px: f64) -> Option<Vec<bool>> {
    let all = vec![true; points.len()];
    let first = offsets_pitch(points, &all, pitch_px);
    let mut voters: Vec<bool> = first.iter().map(|off| off.is_some_and(|v| v < FIRST_LIMIT_PITCH)).collect();
    let second = offsets_pitch(points, &voters, pitch_px);
    voters.iter_mut().zip(&second).for_each(|(v, off)| *v = off.is_some_and(|v| v < FIRST_LIMIT_PITCH));
    let mut regular: Vec<f64> = second.iter().zip(&voters).filter(|(_, v)| **v).filter_map(|(off, _)| *off).collect();
    if (regular.len() as f64) < REGULAR_FRACTION * points.len() as f64 {
        return None;
    }
    regular.sort_unstable_by(f64::total_cmp);
    // The standard deviation per axis of a two-dimensional normal distribution with this median length.
    let sigma_pitch = regular.get(regular.len() / 2)? / 1.177;
    let limit_pitch = (LIMIT_SIGMAS * sigma_pitch).clamp(LIMITS_PITCH.0, LIMITS_PITCH.1);
    let third = offsets_pitch(points, &voters, pitch_px);
    Some(third.iter().map(|off| off.is_some_and(|v| v <= limit_pitch)).collect())
}

/// Distance of each point from the nearest node of the lattice of the voters around it, itself excluded; None where
/// they do not agree.
fn offsets_pitch(points: &[Vec2], votes: &[bool], pitch_px: f64) -> Vec<Option<f64>> {
    let phase = |v: f64| {
        let angle_rad = std::f64::consts::TAU * v / pitch_px;
        Vec2::new(libm::cos(angle_rad), libm::sin(angle_rad))
    };
    let phases: Vec<[Vec2; 2]> = points.iter().map(|p| [phase(p.x), phase(p.y)]).collect();
    let reach_px = VOTERS_PITCH * pitch_px;
    let offset = |i: usize| {
        let (mut sums, mut weights, mut count) = ([Vec2::ZERO; 2], 0.0, 0u32);
        for (j, other) in points.iter().enumerate() {
            let away_px = (*other - points[i]).length();
            if j != i && votes[j] && away_px < reach_px {
                // Near voters weigh more: a small error of the pitch adds up over a few pitches.
                let weight = 1.0 / (1.0 + (away_px / pitch_px) * (away_px / pitch_px));
                sums.iter_mut().zip(phases[j]).for_each(|(sum, phase)| *sum += phase * weight);
                weights += weight;
                count += 1;
            }
        }
        let agree = |sum: &Vec2| sum.length() >= LEAST_AGREEMENT * weights;
        let off = |axis: usize| {
            let (own, lattice) = (phases[i][axis], sums[axis]);
            libm::atan2(lattice.cross(own), lattice.dot(own)) / std::f64::consts::TAU
        };
        (count >= FEWEST_VOTERS && sums.iter().all(agree)).then(|| Vec2::new(off(0), off(1)).length())
    };
    (0..points.len()).map(offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 12 x 10 markers at 20 px, placed by `place`.
    fn grid(place: impl Fn(Vec2) -> Vec2) -> Vec<Vec2> {
        (0..120).map(|i| place(Vec2::new(f64::from(i % 12), f64::from(i / 12)) * 20.0)).collect()
    }

    #[test]
    fn glare_between_and_beside_the_markers_is_off_the_lattice() {
        // A pitch 2 % off the file's, and a lens: 0.6 pitch at the corners.
        let middle = Vec2::new(110.0, 90.0);
        let mut points =
            grid(|p| p * 1.02 + (p - middle) * ((p - middle).length_squared() / 2.0e6) + Vec2::new(33.3, 7.7));
        let markers_count = points.len();
        // Highlights along two lines, one through the markers and one beyond them.
        points.extend((0..9).map(|i| Vec2::new(40.0 + 13.0 * f64::from(i), 57.0 + 0.7 * f64::from(i))));
        points.extend((0..13).map(|i| Vec2::new(20.0 + 17.0 * f64::from(i), 235.0)));
        let on = on_lattice(&points, 20.0).expect("a lattice");
        let left_out: Vec<Vec2> = (0..markers_count).filter(|i| !on[*i]).map(|i| points[i]).collect();
        assert_eq!(left_out, [], "markers left out");
        let phantoms = on[markers_count..].iter().filter(|on| **on).count();
        assert!(phantoms <= 2, "{phantoms} highlights taken for markers");
    }

    #[test]
    fn dots_without_order_have_no_lattice() {
        let mut state = 12345u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 16) / 65536.0 * 240.0
        };
        let points: Vec<Vec2> = (0..120).map(|_| Vec2::new(next(), next())).collect();
        assert_eq!(on_lattice(&points, 20.0), None);
        assert_eq!(on_lattice(&grid(|p| p), 27.0), None, "another pitch");
        let turned = grid(|p| Vec2::new(0.94 * p.x - 0.34 * p.y, 0.34 * p.x + 0.94 * p.y));
        assert_eq!(on_lattice(&turned, 20.0), None, "turned against the image");
    }

    /// Four neighbours agree; two markers two pitches away are 0.2 pitch beside their nodes. The weight is 1 / (1 +
    /// d^2) at d pitches.
    #[test]
    fn near_markers_say_more_of_the_lattice_than_far_ones() {
        let near = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let far = [(0.2, 2.0), (0.2, -2.0)];
        let place = |(x, y): &(f64, f64)| Vec2::new(200.0 + 20.0 * x, 160.0 + 20.0 * y);
        let points: Vec<Vec2> = [(0.0, 0.0)].iter().chain(&near).chain(&far).map(place).collect();
        let off = offsets_pitch(&points, &vec![true; points.len()], 20.0)[0].expect("they agree");
        let (near_weight, far_weight) = (4.0 / 2.0, 2.0 / (1.0 + 4.04));
        let shift_rad = 0.2 * std::f64::consts::TAU;
        let lattice_rad =
            libm::atan2(far_weight * libm::sin(shift_rad), near_weight + far_weight * libm::cos(shift_rad));
        let expected = lattice_rad / std::f64::consts::TAU;
        assert!((off - expected).abs() < 1e-9 && expected > 0.014, "{off} for {expected}");
    }

    /// Two of three markers are 0.06 pitch to alternating sides, about 0.065 pitch from the mean of those around them:
    /// a standard deviation of 0.055 pitch.
    #[test]
    fn four_and_a_half_standard_deviations_of_the_others_are_off_the_lattice() {
        for (off_pitch, expected) in [(0.22, true), (0.27, false)] {
            let side = |i: usize| match i % 3 {
                0 => 0.0,
                _ => 1.2 * f64::from(1 - 2 * ((i % 12 + i / 12) % 2) as i32),
            };
            let mut points = grid(|p| p);
            points.iter_mut().enumerate().for_each(|(i, p)| p.x += side(i));
            points[53].y += off_pitch * 20.0;
            assert_eq!(on_lattice(&points, 20.0).expect("a lattice")[53], expected, "{off_pitch} pitch");
        }
    }

    #[test]
    fn the_spacing_is_that_of_neighbours() {
        assert!((spacing_px(&grid(|p| p)).expect("points") - 20.0).abs() < 1e-9);
        assert_eq!(spacing_px(&[Vec2::ZERO]), None);
        assert!(fits(20.0, 20.0) && fits(16.5, 15.2) && !fits(20.0, 15.2) && !fits(10.0, 15.2));
    }
}
