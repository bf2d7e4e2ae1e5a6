//! Indexed dots -> the map from the plane of the gel to the camera: homography, and a polynomial if needed.
//!
//! ```text
//!   plane p = pitch (i, j) + margin --p + d(p)--> --M--> camera px        minimised: camera px, robustly
//! ```
//! A higher degree of d (none, 3, 5) is chosen only if it clearly reduces the error on held-out dots.

use super::solve::Normal;
use crate::plane::{Homography, Vec2};
use crate::sensor::{Distortion, MOST_TERMS};

/// A dot and its point in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pair {
    /// px of the plane of the gel.
    pub plane: Vec2,
    /// px of the upright camera image.
    pub seen: Vec2,
}

/// The map from plane to camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaneMap {
    pub camera_from_plane: Homography,
    pub distortion: Option<Distortion>,
}

impl PlaneMap {
    pub fn apply(&self, p: Vec2) -> Vec2 {
        self.camera_from_plane.apply(self.distortion.map_or(p, |d| p + d.displacement_px(p)))
    }

    /// Camera px per step of one plane px along x and along y.
    fn slopes(&self, p: Vec2) -> (Vec2, Vec2) {
        let slope = |by: Vec2| self.apply(p + by * 0.5) - self.apply(p - by * 0.5);
        (slope(Vec2::new(1.0, 0.0)), slope(Vec2::new(0.0, 1.0)))
    }

    /// Camera px per plane px at a point, as the root of the ratio of areas; not a number where the map folds.
    pub fn scale_at(&self, p: Vec2) -> f64 {
        let (along, across) = self.slopes(p);
        along.cross(across).sqrt()
    }

    /// Offset of a dot from its point, in plane px, to first order.
    pub fn offset_px(&self, pair: &Pair) -> Vec2 {
        let (along, across) = self.slopes(pair.plane);
        let by = pair.seen - self.apply(pair.plane);
        Vec2::new(by.cross(across), along.cross(by)) / along.cross(across)
    }

    /// How far a dot is from where the map puts it, in plane px.
    pub fn residual_px(&self, pair: &Pair) -> f64 {
        (self.apply(pair.plane) - pair.seen).length() / self.scale_at(pair.plane)
    }
}

/// Most and fewest Gauss-Newton rounds; it stops early when no residual changes by this much, in plane px.
const ROUNDS_COUNT: usize = 12;
const LEAST_ROUNDS_COUNT: usize = 5;
const CONVERGED_PX: f64 = 1e-6;
/// Separates homography and polynomial where both fit the same; too small to bias the result.
const DAMPING: f64 = 1e-7;
/// Residuals are weighted down beyond this many robust standard deviations (Geman and McClure).
const ROBUST_SIGMAS: f64 = 3.0;
/// A residual below this share of the pitch is never weighted down.
const ALWAYS_GOOD_PITCH: f64 = 0.03;
/// Folds of the cross-validation that chooses the degree.
const FOLDS_COUNT: usize = 5;
/// A higher degree must reduce the error on held-out dots below this share of the lower one's.
const MAX_ERROR_RATIO: f64 = 0.9;
/// Largest error counted for a held-out dot, in pitches: a doubled dot carries no information about the degree.
const CAPPED_PITCH: f64 = 0.1;

/// The homography between point sets by normalised direct linear transformation. None for fewer than 4 or degenerate points.
pub(super) fn homography(pairs: &[Pair]) -> Option<Homography> {
    let plane = normalisation(pairs.iter().map(|p| p.plane))?;
    let seen = normalisation(pairs.iter().map(|p| p.seen))?;
    let mut normal = Normal::new(8);
    for pair in pairs {
        let (p, c) = (plane.apply(pair.plane), seen.apply(pair.seen));
        normal.add(&[p.x, p.y, 1.0, 0.0, 0.0, 0.0, -c.x * p.x, -c.x * p.y], c.x, 1.0);
        normal.add(&[0.0, 0.0, 0.0, p.x, p.y, 1.0, -c.y * p.x, -c.y * p.y], c.y, 1.0);
    }
    let h = normal.solve(0.0)?;
    let normalised = Homography([[h[0], h[1], h[2]], [h[3], h[4], h[5]], [h[6], h[7], 1.0]]);
    Some(scaled_to_one(seen.inverse()?.after(&normalised).after(&plane)))
}

/// The same homography with 1 in its lower right corner.
pub(super) fn scaled_to_one(h: Homography) -> Homography {
    Homography(h.0.map(|row| row.map(|v| v / h.0[2][2])))
}

/// Shifts the mean to the origin and scales the mean distance from it to the root of 2.
fn normalisation(points: impl Iterator<Item = Vec2> + Clone) -> Option<Homography> {
    let count = points.clone().count() as f64;
    let sum = points.clone().fold(Vec2::ZERO, |a, b| a + b);
    let mean = sum / count;
    let spread = points.map(|p| (p - mean).length()).sum::<f64>() / count;
    if !(count >= 4.0 && spread > 0.0) {
        return None;
    }
    let s = std::f64::consts::SQRT_2 / spread;
    Some(Homography([[s, 0.0, -s * mean.x], [0.0, s, -s * mean.y], [0.0, 0.0, 1.0]]))
}

/// The map with a polynomial of this degree (0: none) by robust least squares in camera px.
pub(super) fn fit(pairs: &[Pair], degree: usize, pitch_px: f64) -> Option<PlaneMap> {
    let mut map = PlaneMap { camera_from_plane: homography(pairs)?, distortion: None };
    let (low, high) = bounds(pairs.iter().map(|p| p.plane));
    let (centre, span) = ((low + high) * 0.5, (high - low) * 0.5);
    // The homography covers the linear terms of d.
    let bent = 3..Distortion::terms_count(degree).max(3);
    let mut d = [[0.0; MOST_TERMS]; 2];
    let n = 8 + 2 * bent.len();
    let mut row = [vec![0.0; n], vec![0.0; n]];
    let mut before: Vec<f64> = Vec::new();
    for round in 0..ROUNDS_COUNT {
        let residuals: Vec<f64> = pairs.iter().map(|p| map.residual_px(p)).collect();
        // Not before the weights have taken effect; NaN never counts as converged.
        let converged = || residuals.iter().zip(&before).all(|(now, before)| (now - before).abs() < CONVERGED_PX);
        if round > LEAST_ROUNDS_COUNT && converged() {
            break;
        }
        let scale = (ROBUST_SIGMAS * robust_sigma(&residuals)).max(ALWAYS_GOOD_PITCH * pitch_px);
        let mut normal = Normal::new(n);
        for (pair, miss) in pairs.iter().zip(&residuals) {
            // Equal weights until the shape is roughly right: lens distortion is no outlier.
            let t = if round < 3 { 1.0 } else { 1.0 + miss * miss / (scale * scale) };
            let weight = 1.0 / (t * t);
            let monomials = Distortion::monomials(centre, span, degree, pair.plane);
            let q = match degree {
                0 => pair.plane,
                _ => pair.plane + displaced(&d, &monomials),
            };
            let h = &map.camera_from_plane.0;
            let w = h[2][0] * q.x + h[2][1] * q.y + h[2][2];
            let c = map.camera_from_plane.apply(q);
            let miss = pair.seen - c;
            for (axis, (c, r)) in [c.x, c.y].into_iter().zip([miss.x, miss.y]).enumerate() {
                let out = &mut row[axis];
                out.fill(0.0);
                for (k, v) in [q.x, q.y, 1.0].into_iter().enumerate() {
                    out[3 * axis + k] = v / w;
                }
                (out[6], out[7]) = (-c * q.x / w, -c * q.y / w);
                let slope = [(h[axis][0] - c * h[2][0]) / w, (h[axis][1] - c * h[2][1]) / w];
                for (k, i) in bent.clone().enumerate() {
                    (out[8 + 2 * k], out[9 + 2 * k]) = (slope[0] * monomials[i], slope[1] * monomials[i]);
                }
                normal.add(out, r, weight);
            }
        }
        // (u2, uv) and (uv, v2) equal the perspective of the homography, to first order: they are left to it.
        let place = |axis: usize, term: usize| 8 + 2 * (term - bent.start) + axis;
        for (x_term, y_term) in [(3, 4), (4, 5)].into_iter().take(if degree > 0 { 2 } else { 0 }) {
            row[0].fill(0.0);
            (row[0][place(0, x_term)], row[0][place(1, y_term)]) = (1.0, 1.0);
            normal.add(&row[0], -(d[0][x_term] + d[1][y_term]), pairs.len() as f64);
        }
        let step = normal.solve(DAMPING)?;
        for (i, by) in step[..8].iter().enumerate() {
            map.camera_from_plane.0[i / 3][i % 3] += by;
        }
        for (k, i) in bent.clone().enumerate() {
            d[0][i] += step[8 + 2 * k];
            d[1][i] += step[9 + 2 * k];
        }
        if degree > 0 {
            let terms = Distortion::terms_count(degree);
            map.distortion = Distortion::new(centre, span, &d[0][..terms], &d[1][..terms]).ok();
        }
        before = residuals;
    }
    map.camera_from_plane.0.iter().flatten().all(|v| v.is_finite()).then_some(map)
}

fn displaced(d: &[[f64; MOST_TERMS]; 2], monomials: &[f64; MOST_TERMS]) -> Vec2 {
    let sum = |terms: &[f64; MOST_TERMS]| terms.iter().zip(monomials).map(|(c, v)| c * v).sum::<f64>();
    Vec2::new(sum(&d[0]), sum(&d[1]))
}

/// The map with the degree of polynomial that the held-out dots justify.
pub(super) fn fit_as_needed(pairs: &[Pair], pitch_px: f64) -> Option<PlaneMap> {
    let mut best = (fit(pairs, 0, pitch_px)?, held_out_error_px(pairs, 0, pitch_px)?);
    for degree in [3, 5] {
        if pairs.len() < 2 * Distortion::terms_count(degree) {
            continue;
        }
        let (Some(map), Some(error)) = (fit(pairs, degree, pitch_px), held_out_error_px(pairs, degree, pitch_px))
        else {
            continue;
        };
        // The scale is NaN where the map folds.
        let folds = pairs.iter().any(|p| map.scale_at(p.plane).is_nan());
        if error < MAX_ERROR_RATIO * best.1 && !folds {
            best = (map, error);
        }
    }
    Some(best.0)
}

/// RMS residual of held-out dots, in plane px.
fn held_out_error_px(pairs: &[Pair], degree: usize, pitch_px: f64) -> Option<f64> {
    let most = CAPPED_PITCH * pitch_px;
    let mut sum = 0.0;
    for fold in 0..FOLDS_COUNT {
        let part = |held_out: bool| -> Vec<Pair> {
            let chosen = pairs.iter().enumerate().filter(|(i, _)| (fold_of(*i) == fold) == held_out);
            chosen.map(|(_, p)| *p).collect()
        };
        let map = fit(&part(false), degree, pitch_px)?;
        for pair in part(true) {
            let miss = map.residual_px(&pair);
            sum += if miss < most { miss * miss } else { most * most };
        }
    }
    Some((sum / pairs.len() as f64).sqrt())
}

/// Fold of a dot: scattered, so that a fold is no row or column of the grid.
fn fold_of(i: usize) -> usize {
    ((i as u32).wrapping_mul(2_654_435_761) >> 16) as usize % FOLDS_COUNT
}

/// The standard deviation per axis of a two-dimensional normal distribution with this median length.
pub(super) fn robust_sigma(lengths: &[f64]) -> f64 {
    median(lengths) / 1.177
}

/// The median; 0 for none.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// The root of the mean square; 0 for none.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Least and greatest of each coordinate.
pub(super) fn bounds(points: impl Iterator<Item = Vec2>) -> (Vec2, Vec2) {
    let (mut low, mut high) = (Vec2::new(f64::MAX, f64::MAX), Vec2::new(f64::MIN, f64::MIN));
    for p in points {
        low = Vec2::new(low.x.min(p.x), low.y.min(p.y));
        high = Vec2::new(high.x.max(p.x), high.y.max(p.y));
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: Homography = Homography([[0.9, 0.2, 30.0], [-0.1, 1.1, 12.0], [2.0e-4, -4.0e-4, 1.0]]);

    fn grid(bend: f64) -> Vec<Pair> {
        (0..120)
            .map(|i| {
                let plane = Vec2::new(f64::from(i % 12) * 20.0, f64::from(i / 12) * 20.0);
                let from = plane - Vec2::new(110.0, 90.0);
                let bent = plane + from * (bend * from.length_squared() / 1.0e4);
                Pair { plane, seen: TRUTH.apply(bent) }
            })
            .collect()
    }

    fn worst_px(map: &PlaneMap, pairs: &[Pair]) -> f64 {
        pairs.iter().map(|p| map.residual_px(p)).fold(0.0, f64::max)
    }

    #[test]
    fn a_homography_is_found_and_nothing_added_to_it() {
        let pairs = grid(0.0);
        let map = fit_as_needed(&pairs, 20.0).expect("a map");
        assert_eq!(map.distortion, None);
        assert!(worst_px(&map, &pairs) < 1e-6);
    }

    #[test]
    fn a_bent_grid_gets_a_polynomial_and_outliers_do_not_pull_it() {
        let mut pairs = grid(0.08);
        let truth = pairs.clone();
        for pair in pairs.iter_mut().step_by(17) {
            pair.seen += Vec2::new(3.0, -2.0);
        }
        let straight = fit(&pairs, 0, 20.0).expect("a map");
        assert!(worst_px(&straight, &truth) > 2.0);
        let map = fit_as_needed(&pairs, 20.0).expect("a map");
        assert_eq!(map.distortion.map(|d| d.degree()), Some(3));
        assert!(worst_px(&map, &truth) < 0.1, "{}", worst_px(&map, &truth));
    }

    #[test]
    fn points_on_a_line_have_no_homography() {
        let line: Vec<Pair> =
            (0..9).map(|i| Vec2::new(f64::from(i), 2.0 * f64::from(i))).map(|p| Pair { plane: p, seen: p }).collect();
        assert_eq!(homography(&line), None);
    }
}
