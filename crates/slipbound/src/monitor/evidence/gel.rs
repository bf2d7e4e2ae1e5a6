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
    of_markers_px: Vec<[f32; 2]>,
    displacement_px: Vec<[f32; 2]>,
}

/// Where a point of the gel lies between four nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct GelPlace {
    node: u32,
    right: f32,
    down: f32,
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
        GelMotion {
            columns,
            step_px,
            starts,
            weights,
            of_markers_px: vec![[0.0; 2]; rest_px.len()],
            displacement_px: vec![[0.0; 2]; columns * rows],
        }
    }

    /// Takes over where the markers are.
    pub(super) fn take(&mut self, markers: &[Marker]) {
        for (moved, marker) in self.of_markers_px.iter_mut().zip(markers) {
            let now_from_rest = marker.now_from_rest();
            *moved = [now_from_rest.x as f32, now_from_rest.y as f32];
        }
        for (node, range) in self.displacement_px.iter_mut().zip(self.starts.windows(2)) {
            let weights = &self.weights[range[0] as usize..range[1] as usize];
            *node = weights.iter().fold([0.0; 2], |[x, y], &(marker, weight)| {
                let [dx, dy] = self.of_markers_px[marker as usize];
                [x + weight * dx, y + weight * dy]
            });
        }
    }

    /// The place of the point of the gel that rests at `at`.
    pub(super) fn place(&self, at: Vec2) -> GelPlace {
        let (x, y) = (at.x.max(0.0) / self.step_px, at.y.max(0.0) / self.step_px);
        let rows = self.displacement_px.len() / self.columns;
        let (column, row) = ((x as usize).min(self.columns - 2), (y as usize).min(rows - 2));
        GelPlace {
            node: (row * self.columns + column) as u32,
            right: (x - column as f64) as f32,
            down: (y - row as f64) as f32,
        }
    }

    /// How far the point at a place has moved along x and y, px.
    pub(super) fn at(&self, place: GelPlace) -> [f32; 2] {
        let first = place.node as usize;
        let (above, below) =
            (&self.displacement_px[first..first + 2], &self.displacement_px[first + self.columns..][..2]);
        std::array::from_fn(|k| {
            let upper = above[0][k] + place.right * (above[1][k] - above[0][k]);
            let lower = below[0][k] + place.right * (below[1][k] - below[0][k]);
            upper + place.down * (lower - upper)
        })
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
