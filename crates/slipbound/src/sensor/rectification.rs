//! How the camera's view of the gel becomes the rectified image: a homography and an optional lens distortion.
//!
//! ```text
//!   rectified --crop--> plane p --distortion--> p + d(p) --homography^-1--> upright camera image
//! ```
//! The map goes from the rectified image to the camera, the direction in which pixels are fetched: that needs no
//! inversion of a step.

use crate::plane::{Homography, Vec2};
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// How the camera's view of the gel becomes the rectified image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectification {
    /// From the (flipped) camera image to the plane of the gel, px to px, pixel centres at whole numbers.
    pub homography: Homography,
    /// The part of that plane which becomes the rectified image: left, top, right, bottom (exclusive).
    pub crop_px: [usize; 4],
    /// Distortion by the lens and a curved gel beyond a homography; None for a flat gel and a straight lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
}

/// Coefficients of a polynomial of degree 3 and of degree 5 in two variables.
const COUNTS: [(usize, usize); 2] = [(3, 10), (5, 21)];
/// Largest number of coefficients.
pub(crate) const MOST_TERMS: usize = 21;

/// A displacement of the plane of the gel: a polynomial of degree 3 or 5 in (u, v) = (p - centre) / span, for x and
/// for y in plane px. Terms in the order 1, u, v, u2, uv, v2, u3, u2v, uv2, v3, and so on.
///
/// It is valid where u and v are within -1..1, the bounding box of the markers; beyond, it is extrapolated linearly,
/// because a polynomial would soon fold there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DistortionFile", into = "DistortionFile")]
pub struct Distortion {
    /// Where (u, v) = (0, 0), plane px.
    pub centre_px: Vec2,
    /// Plane px per unit of u and of v.
    pub span_px: Vec2,
    terms_count: usize,
    x_px: [f64; MOST_TERMS],
    y_px: [f64; MOST_TERMS],
}

/// As written in a sensor file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DistortionFile {
    centre_px: Vec2,
    span_px: Vec2,
    x_px: Vec<f64>,
    y_px: Vec<f64>,
}

impl TryFrom<DistortionFile> for Distortion {
    type Error = String;

    fn try_from(file: DistortionFile) -> Result<Self, String> {
        Distortion::new(file.centre_px, file.span_px, &file.x_px, &file.y_px)
    }
}

impl From<Distortion> for DistortionFile {
    fn from(d: Distortion) -> Self {
        let (x_px, y_px) = d.terms_px();
        DistortionFile { centre_px: d.centre_px, span_px: d.span_px, x_px: x_px.into(), y_px: y_px.into() }
    }
}

impl Distortion {
    /// A polynomial from its coefficients for x and for y, 10 of each (degree 3) or 21 (degree 5).
    pub fn new(centre_px: Vec2, span_px: Vec2, x_px: &[f64], y_px: &[f64]) -> Result<Self, String> {
        if !COUNTS.iter().any(|(_, n)| x_px.len() == *n && y_px.len() == *n) {
            let (x, y) = (x_px.len(), y_px.len());
            return Err(format!(
                "expected 10 numbers in x_px and in y_px (degree 3) or 21 in each (degree 5), got {x} and {y}"
            ));
        }
        let mut all = [[0.0; MOST_TERMS]; 2];
        all[0][..x_px.len()].copy_from_slice(x_px);
        all[1][..y_px.len()].copy_from_slice(y_px);
        Ok(Distortion { centre_px, span_px, terms_count: x_px.len(), x_px: all[0], y_px: all[1] })
    }

    /// Degree of the polynomial: 3 or 5.
    pub fn degree(&self) -> usize {
        COUNTS.iter().find(|(_, n)| *n == self.terms_count).map_or(0, |(degree, _)| *degree)
    }

    /// The coefficients for x and for y in plane px.
    pub fn terms_px(&self) -> (&[f64], &[f64]) {
        (&self.x_px[..self.terms_count], &self.y_px[..self.terms_count])
    }

    /// Number of coefficients per axis for a degree.
    pub(crate) fn terms_count(degree: usize) -> usize {
        (degree + 1) * (degree + 2) / 2
    }

    /// The values of 1, u, v, u2, uv, v2, ... at a point of the plane.
    pub(crate) fn monomials(centre_px: Vec2, span_px: Vec2, degree: usize, p: Vec2) -> [f64; MOST_TERMS] {
        let q = Vec2::new((p.x - centre_px.x) / span_px.x, (p.y - centre_px.y) / span_px.y);
        let mut values = [0.0; MOST_TERMS];
        values[0] = 1.0;
        let mut n = 1;
        for d in 1..=degree {
            // All of degree d: those of degree d - 1 times u, then the last of them times v.
            let before = n - d;
            for i in 0..d {
                values[n + i] = values[before + i] * q.x;
            }
            values[n + d] = values[n - 1] * q.y;
            n += d + 1;
        }
        values
    }

    /// Displacement of a point of the plane, plane px.
    pub fn displacement_px(&self, p: Vec2) -> Vec2 {
        let held = |at: f64, centre: f64, span: f64| at.clamp(centre - span, centre + span);
        let (centre, span) = (self.centre_px, self.span_px);
        let rim = Vec2::new(held(p.x, centre.x, span.x), held(p.y, centre.y, span.y));
        let at_rim = self.polynomial_px(rim);
        let beyond = p - rim;
        if beyond == Vec2::ZERO || !beyond.is_finite() {
            return at_rim;
        }
        at_rim + (at_rim - self.polynomial_px(rim - beyond * SLOPE_SHARE)) / SLOPE_SHARE
    }

    fn polynomial_px(&self, p: Vec2) -> Vec2 {
        let values = Self::monomials(self.centre_px, self.span_px, self.degree(), p);
        let sum = |terms: &[f64]| terms.iter().zip(&values).map(|(c, v)| c * v).sum::<f64>();
        let (x, y) = self.terms_px();
        Vec2::new(sum(x), sum(y))
    }

    /// The same distortion when the plane is scaled: p becomes scale p + shift.
    fn scaled(&self, scale: f64, shift: f64) -> Distortion {
        Distortion {
            centre_px: self.centre_px * scale + Vec2::new(shift, shift),
            span_px: self.span_px * scale,
            x_px: self.x_px.map(|c| c * scale),
            y_px: self.y_px.map(|c| c * scale),
            ..*self
        }
    }
}

/// Share of the distance beyond the rim over which the slope at the rim is measured.
const SLOPE_SHARE: f64 = 1e-4;
/// Rounds of Newton's method; each squares the error.
const ROUNDS_COUNT: usize = 12;
/// Determinant of the derivative at or below which a map counts as folded.
const MIN_JACOBIAN: f64 = 0.05;
/// Step over which a slope is measured, px.
const SLOPE_STEP_PX: f64 = 0.01;

impl Rectification {
    /// Where a point of the plane of the gel lies in the upright camera image.
    pub fn upright_from_plane(&self, p: Vec2) -> Vec2 {
        let inverse = self.homography.inverse().unwrap_or(Homography::IDENTITY);
        self.upright_with(&inverse, p)
    }

    fn upright_with(&self, inverse: &Homography, p: Vec2) -> Vec2 {
        inverse.apply(self.distortion.map_or(p, |d| p + d.displacement_px(p)))
    }

    /// The map of [`Rectification::upright_from_plane`] with the homography inverted once, for use in a loop.
    pub fn to_upright(&self) -> impl Fn(Vec2) -> Vec2 + '_ {
        let inverse = self.homography.inverse().unwrap_or(Homography::IDENTITY);
        move |p| self.upright_with(&inverse, p)
    }

    /// The point of the plane of the gel that lies at a point of the upright camera image. None where the distortion
    /// has no such point near that of the homography.
    pub fn plane_from_upright(&self, upright: Vec2) -> Option<Vec2> {
        let bent = self.homography.apply(upright);
        let Some(d) = &self.distortion else { return bent.is_finite().then_some(bent) };
        let seen = |p: Vec2| p + d.displacement_px(p);
        let mut p = bent;
        for _ in 0..ROUNDS_COUNT {
            let miss = bent - seen(p);
            if miss.length() < 1e-9 {
                return Some(p);
            }
            let (along, across) = slopes(&seen, p);
            let det = along.cross(across);
            if det.is_nan() || det <= MIN_JACOBIAN {
                return None; // folded, or not a number
            }
            let step = Vec2::new(miss.cross(across), along.cross(miss)) / det;
            p += step;
        }
        ((bent - seen(p)).length() < 1e-3).then_some(p)
    }

    /// The same for a camera image `scale` times as wide; pixel centres lie at whole numbers.
    pub(super) fn scaled(&self, scale: f64) -> Rectification {
        let scaled = |v: usize| (v as f64 * scale).round() as usize;
        // Pixel coordinates scale about (-0.5, -0.5).
        let shift = (scale - 1.0) / 2.0;
        let grow = Homography([[scale, 0.0, shift], [0.0, scale, shift], [0.0, 0.0, 1.0]]);
        let shrink =
            Homography([[1.0 / scale, 0.0, -shift / scale], [0.0, 1.0 / scale, -shift / scale], [0.0, 0.0, 1.0]]);
        Rectification {
            homography: grow.after(&self.homography).after(&shrink),
            crop_px: self.crop_px.map(scaled),
            distortion: self.distortion.map(|d| d.scaled(scale, shift)),
        }
    }

    /// Checks every number; the error names the key.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        let bad = |key: &str, got: String, expected: &str| {
            Err(SettingError { key: format!("rectification.{key}"), got, expected: expected.into() })
        };
        let [left, top, right, bottom] = self.crop_px;
        if right < left + 32 || bottom < top + 32 || right > 8192 || bottom > 8192 {
            return bad("crop_px", format!("{:?}", self.crop_px), "left, top, right, bottom, 32 px apart");
        }
        if self.homography.inverse().is_none() {
            return bad("homography", format!("{:?}", self.homography.0), "an invertible matrix");
        }
        let Some(d) = &self.distortion else { return Ok(()) };
        let spans = [d.span_px.x, d.span_px.y];
        if !spans.iter().all(|s| (1.0..=1e5).contains(s)) || !d.centre_px.is_finite() {
            return bad(
                "distortion.span_px",
                format!("{spans:?}"),
                "two numbers from 1 to 100000, about a finite centre",
            );
        }
        if !d.x_px.iter().chain(&d.y_px).all(|c| c.is_finite()) {
            return bad("distortion.x_px, y_px", "a number that is none".into(), "finite numbers");
        }
        let folds = |i: usize| {
            let share = |i: usize, from: usize, to: usize| from as f64 + (to - from) as f64 * i as f64 / 10.0;
            let p = Vec2::new(share(i % 11, left, right), share(i / 11, top, bottom));
            let (along, across) = slopes(&|p| p + d.displacement_px(p), p);
            let det = along.cross(across);
            det.is_nan() || det <= MIN_JACOBIAN
        };
        match (0..121).any(folds) {
            true => {
                bad("distortion", "one that folds it".into(), "a polynomial that maps the cropped plane one to one")
            }
            false => Ok(()),
        }
    }
}

/// Derivatives of a map along x and along y.
fn slopes(map: &impl Fn(Vec2) -> Vec2, p: Vec2) -> (Vec2, Vec2) {
    let slope = |step: Vec2| (map(p + step) - map(p - step)) / (2.0 * SLOPE_STEP_PX);
    (slope(Vec2::new(SLOPE_STEP_PX, 0.0)), slope(Vec2::new(0.0, SLOPE_STEP_PX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pincushion: 10 % at the corners, and a little of everything else.
    fn bent() -> Rectification {
        let mut x_px = [0.3, -0.2, 0.1, 0.4, -0.3, 0.2, 12.0, 0.5, 11.0, -0.4];
        let mut y_px = x_px;
        y_px.reverse();
        (y_px[0], x_px[9]) = (0.1, 0.2);
        let distortion =
            Distortion::new(Vec2::new(160.0, 150.0), Vec2::new(150.0, 140.0), &x_px, &y_px).expect("ten each");
        let homography = Homography([[0.8, -0.34, 41.0], [0.04, 0.84, -24.6], [-1.0e-4, -1.4e-3, 1.0]]);
        Rectification { homography, crop_px: [0, 0, 320, 300], distortion: Some(distortion) }
    }

    #[test]
    fn the_way_back_undoes_the_way_there() {
        let r = bent();
        r.check().expect("possible");
        for (x, y) in [(0.0, 0.0), (160.0, 150.0), (319.0, 20.0), (40.0, 299.0)] {
            let p = Vec2::new(x, y);
            let there = r.upright_from_plane(p);
            assert!((r.plane_from_upright(there).expect("found") - p).length() < 1e-6, "{p:?}");
            let straight = Rectification { distortion: None, ..r };
            assert!((straight.upright_from_plane(p) - there).length() > 0.1, "the distortion does nothing at {p:?}");
        }
    }

    #[test]
    fn beyond_the_markers_it_goes_straight_on() {
        let d = bent().distortion.expect("there");
        let (rim, step) = (Vec2::new(310.0, 290.0), Vec2::new(4.0, 3.0));
        let at = |k: f64| d.displacement_px(rim + step * k);
        assert!((at(2.0) - at(1.0) - (at(1.0) - at(0.0))).length() < 1e-4, "not straight");
        assert!(((at(1.0) - at(0.0)) - (at(0.0) - at(-0.001)) / 0.001).length() < 1e-2, "a kink at the rim");
    }

    #[test]
    fn monomials_come_in_the_order_of_the_file() {
        let m = Distortion::monomials(Vec2::new(1.0, 2.0), Vec2::new(2.0, 2.0), 5, Vec2::new(7.0, 12.0));
        let (u, v) = (3.0f64, 5.0f64);
        let mut expected = Vec::new();
        for d in 0..=5 {
            expected.extend((0..=d).map(|j| u.powi(d - j) * v.powi(j)));
        }
        assert_eq!(m.to_vec(), expected);
    }

    #[test]
    fn a_file_without_it_is_as_before_and_one_with_it_comes_back() {
        let old = r#"{"homography":[[1,0,0],[0,1,0],[0,0,1]],"crop_px":[0,0,320,240]}"#;
        let old: Rectification = serde_json::from_str(old).expect("valid");
        assert_eq!(old.distortion, None);
        assert!(!serde_json::to_string(&old).expect("data").contains("distortion"));
        let text = serde_json::to_string(&bent()).expect("data");
        assert_eq!(serde_json::from_str::<Rectification>(&text).expect("valid"), bent());
        let short = text.replace("\"x_px\":[0.3,", "\"x_px\":[");
        let error = serde_json::from_str::<Rectification>(&short).expect_err("refused").to_string();
        assert!(error.contains("expected 10 numbers") && error.contains("got 9 and 10"), "{error}");
    }

    #[test]
    fn one_that_folds_is_refused() {
        let d = bent().distortion.expect("there");
        let (x, y) = d.terms_px();
        let fold: Vec<f64> = x.iter().map(|c| -20.0 * c).collect();
        let distortion = Distortion::new(d.centre_px, d.span_px, &fold, y).ok();
        let error = Rectification { distortion, ..bent() }.check().expect_err("refused");
        assert_eq!(error.key, "rectification.distortion");
    }

    #[test]
    fn another_resolution_sees_the_same() {
        let (small, large) = (bent(), bent().scaled(2.0));
        let centre = Vec2::new(0.5, 0.5);
        for p in [Vec2::new(30.0, 20.0), Vec2::new(250.0, 280.0)] {
            let doubled = large.upright_from_plane((p + centre) * 2.0 - centre);
            assert!((doubled - ((small.upright_from_plane(p) + centre) * 2.0 - centre)).length() < 1e-6);
        }
    }
}
