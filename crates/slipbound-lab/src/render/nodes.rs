//! Which piece of the gel is seen at which pixel, its slope and its pressure: computed once a frame, at nodes a few
//! pixels apart.
//!
//! ```text
//!   cells (displacement, its slope, pressure) --Newton--> nodes of the camera image --straight lines--> pixels of a row
//! ```

use super::surface::Surface;
use super::view::View;
use super::{CameraSettings, Texture};
use crate::contact::Grid;
use slipbound::image::SizePx;
use slipbound::pixels::wide::wide;
use slipbound::plane::Vec2;

/// Largest distance between nodes on the gel, in mm: a cell of the contact.
const NODE_MM: f64 = 0.4;
/// Most Newton steps at a node, and the step in mm after which the iteration ends: the remaining error is less than a
/// third of it, 0.0004 px, as slopes of the gel differ by less than that from cell to cell.
const STEPS_COUNT: usize = 12;
const NEAR_MM: f32 = 1e-4;
/// How far the gel may be stretched into view from beyond its border, in mm.
pub(super) const BEYOND_MM: f64 = 2.0;

/// Rows of nodes that are processed together.
const ROWS: usize = 4;

/// Inputs of a pixel: position of the visible piece on the gel at rest (x, y in mm), slope of its depth along x and
/// along y, contrast of the texture.
pub(super) const LANES: usize = 5;

/// Displacement x, y and depth in mm, slope of the depth along x and y, pressure in MPa; two spare lanes.
type Cell = [f32; 8];

/// Constants of a node.
#[derive(Debug, Clone, Copy)]
struct Site {
    plane_mm: [f32; 2],
    parallax: [f32; 2],
}

/// Contrast of the texture, which grows with the pressure.
#[derive(Debug, Clone, Copy)]
struct Contrast {
    per_mpa: f32,
    rest: f32,
    gain: f32,
}

/// Offset from the last node of a row to its piece of gel, and the change of this offset from the node before.
#[derive(Debug, Clone, Copy, Default)]
struct Track {
    off: [f32; 2],
    change: [f32; 2],
}

/// A lattice over the camera image.
#[derive(Debug, Clone)]
pub(super) struct Nodes {
    /// Pixels from node to node along x.
    step_px: usize,
    /// Rows of pixels that have nodes, and for each row of pixels the last of these at or above it.
    rows_px: Vec<usize>,
    above: Vec<usize>,
    columns: usize,
    sites: Vec<Site>,
    /// Columns of each row of nodes that pixels on the gel need.
    used: Vec<std::ops::Range<usize>>,
    lanes: [Vec<f32>; LANES],
    line: [Vec<f32>; LANES],
    cells: Vec<Cell>,
    /// The cells of the previous frame, and its grid.
    before: Vec<Cell>,
    grid: Option<Grid>,
}

impl Nodes {
    /// `spans`: the pixels of each row that show the gel.
    pub fn new(settings: &CameraSettings, view: &View, spans: &[std::ops::Range<usize>]) -> Self {
        let SizePx { width, height } = settings.sensor.image_px;
        let place = |x: usize, y: usize| {
            let plane = view.plane_from_camera(Vec2::new(x as f64, y as f64));
            let most = settings.gel_half_mm + Vec2::new(BEYOND_MM, BEYOND_MM);
            Vec2::new(plane.x.clamp(-most.x, most.x), plane.y.clamp(-most.y, most.y))
        };
        // The longest pixel of a row, along x or along y, is at one of the ends of its span.
        let long = |y: usize, dx: usize, dy: usize| {
            let Some(span) = spans.get(y).filter(|span| !span.is_empty()) else { return 0.0 };
            let length = |x: usize| (place(x + dx, y + dy) - place(x, y)).length();
            length(span.start).max(length(span.end - 1))
        };
        let step = |long_mm: f64| [8, 4, 2].into_iter().find(|&n| n as f64 * long_mm <= NODE_MM).unwrap_or(1);
        let step_px = step((0..height).map(|y| long(y, 1, 0)).fold(0.0, f64::max));
        let mut rows_px = vec![0];
        while let Some(&y) = rows_px.last().filter(|&&y| y < height - 1) {
            let long_mm = (y..y + 8).map(|y| long(y, 0, 1)).fold(0.0, f64::max);
            rows_px.push(y + step(long_mm));
        }
        let above: Vec<usize> =
            (0..height).map(|y| rows_px.partition_point(|&row| row <= y).min(rows_px.len() - 1) - 1).collect();
        let (columns, rows) = ((width - 1) / step_px + 2, rows_px.len());
        let mut used = vec![0..0; rows];
        for (y, span) in spans.iter().enumerate().filter(|(_, span)| !span.is_empty()) {
            let (first, end) = (span.start / step_px, (span.end - 1) / step_px + 2);
            for range in &mut used[above[y]..above[y] + 2] {
                *range = if range.end == 0 { first..end } else { range.start.min(first)..range.end.max(end) };
            }
        }
        let sites = (0..columns * rows)
            .map(|i| {
                let plane = place(i % columns * step_px, rows_px[i / columns]);
                let parallax = view.parallax(plane);
                Site { plane_mm: [plane.x as f32, plane.y as f32], parallax: [parallax.x as f32, parallax.y as f32] }
            })
            .collect();
        Nodes {
            step_px,
            rows_px,
            above,
            columns,
            sites,
            used,
            lanes: std::array::from_fn(|_| vec![0.0; columns * rows]),
            line: std::array::from_fn(|_| vec![0.0; columns]),
            cells: Vec::new(),
            before: Vec::new(),
            grid: None,
        }
    }

    /// Updates every node of the gel. Returns whether the gel has moved since the last call; if not, nodes are
    /// unchanged.
    pub fn look(&mut self, surface: &Surface, texture: &Texture) -> bool {
        std::mem::swap(&mut self.cells, &mut self.before);
        self.take(surface);
        if self.grid.replace(*surface.grid) == Some(*surface.grid) && self.cells == self.before {
            return false;
        }
        let field = Field::new(surface, &self.cells);
        let contrast = Contrast {
            per_mpa: -1.0 / texture.p_ref_mpa as f32,
            rest: texture.rest_fraction as f32,
            gain: texture.gain_fraction as f32,
        };
        for (group, used) in self.used.chunks(ROWS).enumerate() {
            let first = group * ROWS * self.columns;
            look_along(&field, contrast, &self.sites[first..], used, first, self.columns, &mut self.lanes);
        }
        true
    }

    /// Gathers the data of each cell, with the slope of the depth.
    fn take(&mut self, surface: &Surface) {
        let (width, height) = (surface.grid.width_cells, surface.grid.height_cells);
        let per_mm = 0.5 / surface.grid.cell_mm;
        let depth = |x: usize, y: usize| surface.displacement[y * width + x].depth_mm;
        self.cells.clear();
        self.cells.extend((0..width * height).map(|i| {
            let (x, y) = (i % width, i / width);
            let moved = &surface.displacement[i];
            let along = depth((x + 1).min(width - 1), y) - depth(x.saturating_sub(1), y);
            let across = depth(x, (y + 1).min(height - 1)) - depth(x, y.saturating_sub(1));
            [
                moved.shift_mm.x as f32,
                moved.shift_mm.y as f32,
                moved.depth_mm as f32,
                (along * per_mm) as f32,
                (across * per_mm) as f32,
                surface.pressure_mpa[i] as f32,
                0.0,
                0.0,
            ]
        }));
    }

    /// The lanes of a row of pixels, written from the node at or before `span.start` on; `out` is wider than the image
    /// by as much.
    pub fn spread(&mut self, y: usize, span: std::ops::Range<usize>, out: &mut [Vec<f32>; LANES]) {
        let (step_x, row) = (self.step_px, self.above[y]);
        let share = (y - self.rows_px[row]) as f32 / (self.rows_px[row + 1] - self.rows_px[row]) as f32;
        let (first, last) = (span.start / step_x, (span.end - 1) / step_x + 1);
        for ((lane, line), out) in self.lanes.iter().zip(&mut self.line).zip(out) {
            let from = row * self.columns + first;
            let (above, below) = (&lane[from..=from + last - first], &lane[from + self.columns..][..=last - first]);
            let line = &mut line[..=last - first];
            for ((line, a), b) in line.iter_mut().zip(above).zip(below) {
                *line = a + (b - a) * share;
            }
            let out = &mut out[first * step_x..last * step_x];
            match step_x {
                8 => between::<8>(line, out),
                4 => between::<4>(line, out),
                2 => between::<2>(line, out),
                _ => out.copy_from_slice(&line[..out.len()]),
            }
        }
    }
}

wide! {
    /// Updates some rows of nodes; `sites` starts at the first of them, which has index `first`. A node depends on the
    /// one before it in its row, which gives its first guess, but not on other rows, so the rows are interleaved.
    #[allow(clippy::too_many_arguments)] // parts of the nodes
    fn look_along(
        field: &Field<'_>,
        contrast: Contrast,
        sites: &[Site],
        used: &[std::ops::Range<usize>],
        first: usize,
        columns: usize,
        lanes: &mut [Vec<f32>; LANES],
    ) {
        let mut tracks = [Track::default(); ROWS];
        let seen = used.iter().filter(|used| !used.is_empty());
        let start = seen.clone().map(|used| used.start).min().unwrap_or(0);
        let end = seen.map(|used| used.end).max().unwrap_or(0);
        for column in start..end {
            for ((row, used), track) in used.iter().enumerate().zip(&mut tracks) {
                if column < used.start || column >= used.end {
                    continue;
                }
                let i = row * columns + column;
                let (site, Track { off, change }) = (&sites[i], *track);
                let (piece, cell) = field.seen(site, [off[0] + change[0], off[1] + change[1]]);
                let now = [piece[0] - site.plane_mm[0], piece[1] - site.plane_mm[1]];
                // The first guess is extrapolated from the last two nodes.
                *track = Track { off: now, change: [now[0] - off[0], now[1] - off[1]] };
                let pressed = if cell[5] > 0.0 { 1.0 - libm::expf(cell[5] * contrast.per_mpa) } else { 0.0 };
                let values = [piece[0], piece[1], cell[3], cell[4], contrast.rest + contrast.gain * pressed];
                lanes.iter_mut().zip(values).for_each(|(lane, value)| lane[first + i] = value);
            }
        }
    }

    /// Linear interpolation between nodes, N pixels each.
    fn between<const N: usize>(nodes: &[f32], out: &mut [f32]) {
        for (pair, out) in nodes.windows(2).zip(out.chunks_exact_mut(N)) {
            let (a, step) = (pair[0], (pair[1] - pair[0]) * (1.0 / N as f32));
            for (i, out) in out.iter_mut().enumerate() {
                *out = a + step * i as f32;
            }
        }
    }
}

/// The cells as a field over the gel at rest: bilinear between cell centres, constant beyond the outermost ones.
struct Field<'a> {
    cells: &'a [Cell],
    width: usize,
    per_mm: f32,
    /// Centre of the first cell and index of the last cell, along x and y.
    origin_mm: [f32; 2],
    last: [f32; 2],
}

impl<'a> Field<'a> {
    fn new(surface: &Surface, cells: &'a [Cell]) -> Self {
        let (grid, half) = (surface.grid, surface.grid.half_size_mm());
        Field {
            cells,
            width: grid.width_cells,
            per_mm: (1.0 / grid.cell_mm) as f32,
            origin_mm: [half.x, half.y].map(|half| (0.5 * grid.cell_mm - half) as f32),
            last: [grid.width_cells, grid.height_cells].map(|count| (count - 1) as f32),
        }
    }

    /// The four cells around a position and its fractions between them.
    #[inline(always)]
    fn around(&self, [x, y]: [f32; 2]) -> ([&Cell; 4], [f32; 2]) {
        let place = |at: f32, axis: usize| {
            let at = ((at - self.origin_mm[axis]) * self.per_mm).clamp(0.0, self.last[axis]);
            let low = at.min(self.last[axis] - 1.0) as i32;
            (low as usize, at - low as f32)
        };
        let ((column, fx), (row, fy)) = (place(x, 0), place(y, 1));
        let corner = row * self.width + column;
        let (above, below) = (&self.cells[corner..corner + 2], &self.cells[corner + self.width..][..2]);
        ([&above[0], &above[1], &below[0], &below[1]], [fx, fy])
    }

    /// The piece of gel that is visible at a site, and the interpolated cell there. The apparent position of a piece is
    /// `X + shift + parallax depth`; Newton's method from the site, offset like the previous node.
    #[inline(always)]
    fn seen(&self, site: &Site, off: [f32; 2]) -> ([f32; 2], Cell) {
        let ([px, py], [kx, ky]) = (site.plane_mm, site.parallax);
        let mut at = [px + off[0], py + off[1]];
        for _ in 0..STEPS_COUNT {
            let ([a, b, c, d], [fx, fy]) = self.around(at);
            // x, y and depth; the unused fourth lane fills the vector.
            let along = |k: usize| ((b[k] - a[k]) * (1.0 - fy) + (d[k] - c[k]) * fy) * self.per_mm;
            let upper: [f32; 4] = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * fx);
            let lower: [f32; 4] = std::array::from_fn(|k| c[k] + (d[k] - c[k]) * fx);
            let [sx, sy, sz, _]: [f32; 4] = std::array::from_fn(|k| upper[k] + (lower[k] - upper[k]) * fy);
            let [along_x, along_y, zx, _]: [f32; 4] = std::array::from_fn(along);
            let [across_x, across_y, zy, _]: [f32; 4] = std::array::from_fn(|k| (lower[k] - upper[k]) * self.per_mm);
            let miss = [at[0] + sx + kx * sz - px, at[1] + sy + ky * sz - py];
            let (xx, xy) = (1.0 + along_x + kx * zx, across_x + kx * zy);
            let (yx, yy) = (along_y + ky * zx, 1.0 + across_y + ky * zy);
            let det = xx * yy - xy * yx;
            // Where the linear gel would fold over itself, a plain step.
            let (dx, dy) = if det > 0.1 {
                ((yy * miss[0] - xy * miss[1]) / det, (xx * miss[1] - yx * miss[0]) / det)
            } else {
                (miss[0], miss[1])
            };
            at = [at[0] - dx, at[1] - dy];
            if dx.abs() + dy.abs() < NEAR_MM {
                break;
            }
        }
        let ([a, b, c, d], [fx, fy]) = self.around(at);
        let cell = std::array::from_fn(|k| {
            let (upper, lower) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
            upper + (lower - upper) * fy
        });
        (at, cell)
    }
}
