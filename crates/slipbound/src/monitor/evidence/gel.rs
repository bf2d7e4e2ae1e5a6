//! The motion of the gel between its markers: marker displacements -> current position of every point of the gel.
//!
//! ```text
//!   markers: o  o  o        nodes every half pitch, each a local linear fit        any point: bilinear
//!            o  o  o  --->  to the markers around it; weights known from rest --->  between four nodes
//! ```

use crate::image::SizePx;
use crate::monitor::report::Marker;
use crate::pixels::wide::wide;
use crate::plane::Vec2;

/// Distance between nodes, in pitches.
const NODE_PITCH: f64 = 0.5;

/// Spread of the Gaussian that weighs the markers around a node, in pitches: the nearest four dominate the fit, the
/// next ring stabilizes it.
const REACH_PITCH: f64 = 0.7;

/// Markers beyond this many spreads do not count.
const CUT_REACHES: f64 = 3.2;

/// Ridge on the slopes of the fit, relative to its mean: limits extrapolation at nodes beside the markers.
const SLOPE_RIDGE: f64 = 0.02;

/// Neighbouring nodes that are summed in parallel, one in each lane of a vector.
const GROUP: usize = 8;

/// Displacement of the gel at the nodes; the weights are computed once from the markers at rest.
#[derive(Debug, Clone)]
pub(super) struct GelMotion {
    columns: usize,
    step_px: f64,
    /// For each group of nodes, where its markers start; one more than there are groups.
    starts: Vec<u32>,
    /// The markers that count for a node of the group, ascending, and their weights: zero for nodes too far away.
    markers: Vec<u32>,
    weights: Vec<[f32; GROUP]>,
    of_markers_px: Vec<[f32; 2]>,
    displacement_px: Vec<[f32; 2]>,
}

impl GelMotion {
    /// For markers at rest on a rectified image of `size`.
    pub(super) fn new(rest_px: &[Vec2], size: SizePx, pitch_px: f64) -> Self {
        let step_px = NODE_PITCH * pitch_px;
        let count = |length: usize| (length as f64 / step_px) as usize + 2;
        let (columns, rows) = (count(size.width), count(size.height));
        let nodes_count = columns * rows;
        let (mut starts, mut markers, mut weights) = (vec![0], Vec::new(), Vec::new());
        for first in (0..nodes_count).step_by(GROUP) {
            // Weights of the group by marker; the row of a marker that no node uses is all zeros.
            let mut of_group = vec![[0.0; GROUP]; rest_px.len()];
            for (lane, i) in (first..nodes_count.min(first + GROUP)).enumerate() {
                let node = Vec2::new((i % columns) as f64, (i / columns) as f64) * step_px;
                for (marker, weight) in weights_of(node, rest_px, REACH_PITCH * pitch_px) {
                    of_group[marker as usize][lane] = weight;
                }
            }
            for (marker, lanes) in of_group.into_iter().enumerate().filter(|(_, lanes)| *lanes != [0.0; GROUP]) {
                markers.push(marker as u32);
                weights.push(lanes);
            }
            starts.push(weights.len() as u32);
        }
        GelMotion {
            columns,
            step_px,
            starts,
            markers,
            weights,
            of_markers_px: vec![[0.0; 2]; rest_px.len()],
            displacement_px: vec![[0.0; 2]; nodes_count],
        }
    }

    /// Updates the displacements from the markers.
    pub(super) fn take(&mut self, markers: &[Marker]) {
        for (moved, marker) in self.of_markers_px.iter_mut().zip(markers) {
            let now_from_rest = marker.now_from_rest();
            *moved = [now_from_rest.x as f32, now_from_rest.y as f32];
        }
        let (displacements_px, starts) = (&self.of_markers_px, &self.starts);
        node_sums(displacements_px, &self.markers, &self.weights, starts, &mut self.displacement_px);
    }

    /// The node before a coordinate, of `count` nodes along its axis, and the fraction of the way to the next.
    fn between(&self, at_px: f64, count: usize) -> (usize, f32) {
        let at = at_px.max(0.0) / self.step_px;
        let first = (at as usize).min(count - 2);
        (first, (at - first as f64) as f32)
    }
}

/// The motion of the gel at the points of a grid, bilinear between four nodes.
#[derive(Debug, Clone)]
pub(super) struct GelGrid {
    /// For each column and each row of the grid: the node before it, and the fraction of the way to the next.
    columns: Vec<(usize, f32)>,
    rows: Vec<(usize, f32)>,
    nodes_per_row: usize,
    /// Displacement along x and along y at the columns of the grid, for each row of nodes.
    along_nodes_px: [Vec<f32>; 2],
}

impl GelGrid {
    /// For points of the gel with these rest coordinates, px.
    pub(super) fn new(gel: &GelMotion, columns_px: &[f64], rows_px: &[f64]) -> Self {
        let node_rows = gel.displacement_px.len() / gel.columns;
        let between = |px: &[f64], count: usize| px.iter().map(|&at| gel.between(at, count)).collect();
        GelGrid {
            columns: between(columns_px, gel.columns),
            rows: between(rows_px, node_rows),
            nodes_per_row: gel.columns,
            along_nodes_px: std::array::from_fn(|_| vec![0.0; node_rows * columns_px.len()]),
        }
    }

    /// Updates the grid from the motion of the gel.
    pub(super) fn take(&mut self, gel: &GelMotion) {
        let n = self.columns.len();
        for (row, nodes) in gel.displacement_px.chunks_exact(self.nodes_per_row).enumerate() {
            let [along_x, along_y] = self.along_nodes_px.each_mut().map(|line| &mut line[row * n..][..n]);
            for ((x, y), &(first, right)) in along_x.iter_mut().zip(along_y).zip(&self.columns) {
                let (a, b) = (nodes[first], nodes[first + 1]);
                (*x, *y) = (a[0] + right * (b[0] - a[0]), a[1] + right * (b[1] - a[1]));
            }
        }
    }

    /// Current positions of the points of a row of the grid that rest at (`columns_px`, `row_px`), px.
    pub(super) fn places_of_row(
        &self,
        row: usize,
        columns_px: &[f32],
        row_px: f32,
        x_px: &mut [f32],
        y_px: &mut [f32],
    ) {
        let (n, (first, down)) = (self.columns.len(), self.rows[row]);
        let [x, y] = self.along_nodes_px.each_ref().map(|line| line[first * n..][..2 * n].split_at(n));
        places_x(x.0, x.1, down, columns_px, x_px);
        places_y(y.0, y.1, down, row_px, y_px);
    }
}

wide! {
    /// For each node, the weighted sum of the displacements of its group's markers, in the order of the markers.
    fn node_sums(of_markers: &[[f32; 2]], markers: &[u32], weights: &[[f32; GROUP]], starts: &[u32], nodes: &mut [[f32; 2]]) {
        for (nodes, range) in nodes.chunks_mut(GROUP).zip(starts.windows(2)) {
            let range = range[0] as usize..range[1] as usize;
            let (mut x, mut y) = ([0.0f32; GROUP], [0.0f32; GROUP]);
            for (&marker, weights) in markers[range.clone()].iter().zip(&weights[range]) {
                let [dx, dy] = of_markers[marker as usize];
                for lane in 0..GROUP {
                    x[lane] += weights[lane] * dx;
                    y[lane] += weights[lane] * dy;
                }
            }
            nodes.iter_mut().zip(x.into_iter().zip(y)).for_each(|(node, (x, y))| *node = [x, y]);
        }
    }

    fn places_x(above: &[f32], below: &[f32], down: f32, rest_px: &[f32], out: &mut [f32]) {
        for ((out, &rest), (&above, &below)) in out.iter_mut().zip(rest_px).zip(above.iter().zip(below)) {
            *out = rest + (above + down * (below - above));
        }
    }

    fn places_y(above: &[f32], below: &[f32], down: f32, rest_px: f32, out: &mut [f32]) {
        for (out, (&above, &below)) in out.iter_mut().zip(above.iter().zip(below)) {
            *out = rest_px + (above + down * (below - above));
        }
    }
}

/// Markers and weights whose weighted sum of displacements is that of a node: the value there of a linear function
/// fitted by weighted least squares.
fn weights_of(node: Vec2, rest_px: &[Vec2], reach_px: f64) -> Vec<(u32, f32)> {
    // Where markers are sparse, the fourth nearest sets the reach. A marker that is far along one axis needs no distance.
    let mut nearest = [f64::MAX; 4];
    for &p in rest_px {
        let away = p - node;
        if away.x.abs().max(away.y.abs()) > nearest[3] {
            continue;
        }
        let d = away.length();
        if d < nearest[3] {
            nearest[3] = d;
            nearest.sort_unstable_by(f64::total_cmp);
        }
    }
    let fourth_px = if nearest[3] < f64::MAX { nearest[3] } else { 0.0 };
    let reach_px = reach_px.max(0.7 * fourth_px);
    let end_px = 1.01 * CUT_REACHES * reach_px;
    let near = |p: Vec2| {
        let away = p - node;
        if away.x.abs().max(away.y.abs()) > end_px {
            return None;
        }
        let r = away / reach_px;
        (r.length() < CUT_REACHES).then(|| (r, libm::exp(-0.5 * r.length_squared())))
    };
    let known: Vec<(u32, Vec2, f64)> =
        (0..).zip(rest_px).filter_map(|(i, &p)| near(p).map(|(r, w)| (i, r, w))).collect();
    // Normal equations of value + slope_x x + slope_y y.
    let (mut w0, mut wx, mut wy, mut wxx, mut wxy, mut wyy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for &(_, r, w) in &known {
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
        return Vec::new();
    }
    let weight = |r: Vec2, w: f64| (w * (c0 + cx * r.x + cy * r.y) / determinant) as f32;
    known.into_iter().map(|(i, r, w)| (i, weight(r, w))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gel_that_moves_and_stretches_evenly_does_so_between_its_markers() {
        let (size, pitch_px) = (SizePx::new(200, 160), 20.0);
        let rest_px: Vec<Vec2> =
            (0..80).map(|i| Vec2::new(10.0 + 20.0 * (i % 10) as f64, 10.0 + 20.0 * (i / 10) as f64)).collect();
        let moved = |p: Vec2| Vec2::new(1.5 + 0.01 * p.x, 0.02 * p.y - 0.5);
        let markers: Vec<Marker> =
            rest_px.iter().map(|&rest| Marker { now: rest + moved(rest), ..Marker::at_rest(0, rest) }).collect();
        let mut gel = GelMotion::new(&rest_px, size, pitch_px);
        gel.take(&markers);
        let (columns_px, rows_px): (Vec<f64>, Vec<f64>) =
            ((3..18).map(|i| 10.5 * f64::from(i)).collect(), vec![31.0, 77.7, 120.2]);
        let mut grid = GelGrid::new(&gel, &columns_px, &rows_px);
        grid.take(&gel);
        let rest_columns: Vec<f32> = columns_px.iter().map(|&x| x as f32).collect();
        let (mut x_px, mut y_px) = (vec![0.0; columns_px.len()], vec![0.0; columns_px.len()]);
        for (row, &y) in rows_px.iter().enumerate() {
            grid.places_of_row(row, &rest_columns, y as f32, &mut x_px, &mut y_px);
            for (&x, (&now_x, &now_y)) in columns_px.iter().zip(x_px.iter().zip(&y_px)) {
                let (rest, now) = (Vec2::new(x, y), Vec2::new(f64::from(now_x), f64::from(now_y)));
                assert!((now - rest - moved(rest)).length() < 0.02, "{rest:?}: {:?} for {:?}", now - rest, moved(rest));
            }
        }
    }
}
