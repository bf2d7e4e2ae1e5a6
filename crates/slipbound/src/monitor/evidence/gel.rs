//! The motion of the gel between its markers: marker displacements -> where every point of the gel is now.
//!
//! ```text
//!   markers: o  o  o        nodes every half pitch, each a local linear fit        any point: bilinear
//!            o  o  o  --->  to the markers around it; weights known from rest --->  between four nodes
//! ```

use crate::image::SizePx;
use crate::monitor::report::Marker;
use crate::plane::Vec2;

/// Nodes stand this far apart, in pitches.
const NODE_PITCH: f64 = 0.5;

/// Spread of the Gaussian that weighs the markers around a node, in pitches: the nearest four carry the fit, the next
/// ring steadies it.
const REACH_PITCH: f64 = 0.7;

/// Markers beyond this many spreads do not count.
const CUT_REACHES: f64 = 3.2;

/// Least weight of the slopes of the fit against its mean, so that a node beside the markers does not extrapolate wildly.
const SLOPE_RIDGE: f64 = 0.02;

/// Displacement of the gel at the nodes; the weights are made once from the markers at rest.
#[derive(Debug, Clone)]
pub(super) struct GelMotion {
    columns: usize,
    step_px: f64,
    /// Of each node, where its weights start; one more than there are nodes.
    starts: Vec<u32>,
    weights: Vec<(u32, f32)>,
    displacement_px: Vec<Vec2>,
}

impl GelMotion {
    /// For markers at rest on a rectified image of `size`.
    pub(super) fn new(rest_px: &[Vec2], size: SizePx, pitch_px: f64) -> Self {
        let step_px = NODE_PITCH * pitch_px;
        let count = |length: usize| (length as f64 / step_px) as usize + 2;
        let (columns, rows) = (count(size.width), count(size.height));
        let (mut starts, mut weights) = (vec![0], Vec::new());
        for i in 0..columns * rows {
            let node = Vec2::new((i % columns) as f64, (i / columns) as f64) * step_px;
            add_weights(node, rest_px, REACH_PITCH * pitch_px, &mut weights);
            starts.push(weights.len() as u32);
        }
        GelMotion { columns, step_px, starts, weights, displacement_px: vec![Vec2::ZERO; columns * rows] }
    }

    /// Takes over where the markers are.
    pub(super) fn take(&mut self, markers: &[Marker]) {
        for (node, range) in self.displacement_px.iter_mut().zip(self.starts.windows(2)) {
            let weights = &self.weights[range[0] as usize..range[1] as usize];
            *node = weights.iter().fold(Vec2::ZERO, |sum, &(marker, weight)| {
                sum + markers[marker as usize].now_from_rest() * f64::from(weight)
            });
        }
    }

    /// How far the point of the gel that rests at `at` has moved, px.
    pub(super) fn at(&self, at: Vec2) -> Vec2 {
        let (x, y) = (at.x.max(0.0) / self.step_px, at.y.max(0.0) / self.step_px);
        let rows = self.displacement_px.len() / self.columns;
        let (column, row) = ((x as usize).min(self.columns - 2), (y as usize).min(rows - 2));
        let (fx, fy) = (x - column as f64, y - row as f64);
        let node = |right: usize, down: usize| self.displacement_px[(row + down) * self.columns + column + right];
        (node(0, 0) * (1.0 - fx) + node(1, 0) * fx) * (1.0 - fy) + (node(0, 1) * (1.0 - fx) + node(1, 1) * fx) * fy
    }
}

/// Weights with which the displacements of the markers make that of a node: the value at the node of a line fitted by
/// weighted least squares.
fn add_weights(node: Vec2, rest_px: &[Vec2], reach_px: f64, weights: &mut Vec<(u32, f32)>) {
    // Where markers are far, the fourth nearest sets the reach.
    let mut nearest = [f64::MAX; 4];
    for &p in rest_px {
        let d = (p - node).length();
        if d < nearest[3] {
            nearest[3] = d;
            nearest.sort_unstable_by(f64::total_cmp);
        }
    }
    let fourth_px = if nearest[3] < f64::MAX { nearest[3] } else { 0.0 };
    let reach_px = reach_px.max(0.7 * fourth_px);
    let near = |p: Vec2| {
        let r = (p - node) / reach_px;
        (r.length() < CUT_REACHES).then(|| (r, libm::exp(-0.5 * r.length_squared())))
    };
    // Normal equations of value + slope_x x + slope_y y.
    let (mut w0, mut wx, mut wy, mut wxx, mut wxy, mut wyy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (r, w) in rest_px.iter().filter_map(|&p| near(p)) {
        w0 += w;
        wx += w * r.x;
        wy += w * r.y;
        wxx += w * r.x * r.x;
        wxy += w * r.x * r.y;
        wyy += w * r.y * r.y;
    }
    let (xx, yy) = (wxx + SLOPE_RIDGE * w0, wyy + SLOPE_RIDGE * w0);
    // First row of the inverse, by cofactors.
    let (c0, cx, cy) = (xx * yy - wxy * wxy, wxy * wy - wx * yy, wx * wxy - xx * wy);
    let determinant = w0 * c0 + wx * cx + wy * cy;
    if determinant <= 0.0 {
        return;
    }
    for (i, &p) in rest_px.iter().enumerate() {
        if let Some((r, w)) = near(p) {
            weights.push((i as u32, (w * (c0 + cx * r.x + cy * r.y) / determinant) as f32));
        }
    }
}
