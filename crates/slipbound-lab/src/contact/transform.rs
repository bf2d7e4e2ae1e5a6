//! Two-dimensional transforms of zero-padded fields, for fields of complex numbers (in-plane vectors x + iy) and
//! of real numbers (pressure, depth).
//!
//! ```text
//!   cells of a region        rows, padded          spectrum, one column of ky after the other
//!   [row 0 ............]     FFT along x           [kx = 0: ky 0 1 2 ...][kx = 1: ...] ...
//!   [row 1 ............]  -> (only rows with  ->   FFT along y
//!                             data)
//! ```
//!
//! An in-plane vector field is one complex field, so its two components cost one complex transform and no
//! unpacking: with Z the transform of qx + i qy, conj Z(-k) is that of qx - i qy. Real rows go two at a time as
//! real and imaginary part. That needs only complex transforms, whose planner can be kept scalar; realfft's
//! planner cannot, and packed rows cost the same.

use super::grid::Region;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner, FftPlannerScalar};
use std::sync::Arc;

/// Which transforms are used. Results are the same bytes per planner, build and CPU features; between planners
/// they differ by rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Planner {
    /// The widest vector instructions this CPU has.
    #[default]
    Fastest,
    /// No vector instructions: the same bytes on every CPU of one build, for golden tests.
    Scalar,
}

/// Rows that are scattered to columns together: four complex numbers fill a cache line.
const ROWS: usize = 4;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Which cells a transform is about: `window` is laid at the corner of the padded domain, `data` is the part of it
/// that is not zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub window: Region,
    pub data: Region,
}

impl Area {
    pub fn all_of(window: Region) -> Self {
        Area { window, data: window }
    }

    fn data_in_window(&self) -> (Region, usize, usize) {
        (self.data, self.data.column - self.window.column, self.data.row - self.window.row)
    }
}

/// Transforms of one padded size, with their buffers.
#[derive(Clone)]
pub(crate) struct Transform {
    pub nx: usize,
    pub ny: usize,
    along_x: [Arc<dyn Fft<f64>>; 2],
    along_y: [Arc<dyn Fft<f64>>; 2],
    rows: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl std::fmt::Debug for Transform {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Transform {{ nx: {}, ny: {} }}", self.nx, self.ny)
    }
}

impl Transform {
    pub fn new(nx: usize, ny: usize, planner: Planner) -> Self {
        let (along_x, along_y) = match planner {
            Planner::Fastest => {
                let mut p = FftPlanner::new();
                ([p.plan_fft_forward(nx), p.plan_fft_inverse(nx)], [p.plan_fft_forward(ny), p.plan_fft_inverse(ny)])
            }
            Planner::Scalar => {
                let mut p = FftPlannerScalar::new();
                ([p.plan_fft_forward(nx), p.plan_fft_inverse(nx)], [p.plan_fft_forward(ny), p.plan_fft_inverse(ny)])
            }
        };
        let scratch = along_x.iter().chain(&along_y).map(|f| f.get_inplace_scratch_len()).max().unwrap_or(0);
        Transform { nx, ny, along_x, along_y, rows: vec![ZERO; ROWS * nx], scratch: vec![ZERO; scratch] }
    }

    /// Columns of the spectrum of a real field; the others follow from symmetry.
    pub fn half(&self) -> usize {
        self.nx / 2 + 1
    }

    /// Spectrum of a complex field: `nx` columns of `ny`.
    pub fn forward(&mut self, field: &[Complex64], stride: usize, area: Area, spectrum: &mut [Complex64]) {
        let (nx, ny) = (self.nx, self.ny);
        let (data, left, top) = area.data_in_window();
        let right = left + data.width_cells;
        let mut first = 0;
        while first < data.height_cells {
            let count = ROWS.min(data.height_cells - first);
            for r in 0..count {
                let from = (data.row + first + r) * stride + data.column;
                let line = &mut self.rows[r * nx..(r + 1) * nx];
                line[..left].fill(ZERO);
                line[left..right].copy_from_slice(&field[from..from + data.width_cells]);
                line[right..].fill(ZERO);
            }
            self.along_x[0].process_with_scratch(&mut self.rows[..count * nx], &mut self.scratch);
            scatter(&self.rows, nx, count, spectrum, ny, top + first);
            first += count;
        }
        clear_rows_outside(spectrum, ny, top, top + data.height_cells);
        self.along_y[0].process_with_scratch(spectrum, &mut self.scratch);
    }

    /// Complex field from its spectrum, which is destroyed. Not scaled.
    pub fn inverse(&mut self, spectrum: &mut [Complex64], region: Region, stride: usize, field: &mut [Complex64]) {
        let (nx, ny) = (self.nx, self.ny);
        self.along_y[1].process_with_scratch(spectrum, &mut self.scratch);
        let mut first = 0;
        while first < region.height_cells {
            let count = ROWS.min(region.height_cells - first);
            gather(spectrum, ny, first, &mut self.rows, nx, count);
            self.along_x[1].process_with_scratch(&mut self.rows[..count * nx], &mut self.scratch);
            for r in 0..count {
                let to = (region.row + first + r) * stride + region.column;
                field[to..to + region.width_cells].copy_from_slice(&self.rows[r * nx..r * nx + region.width_cells]);
            }
            first += count;
        }
    }

    /// Spectrum of a real field: `nx / 2 + 1` columns of `ny`.
    pub fn forward_real(&mut self, field: &[f64], stride: usize, area: Area, spectrum: &mut [Complex64]) {
        let (nx, ny, half) = (self.nx, self.ny, self.half());
        let (data, left, top) = area.data_in_window();
        let right = left + data.width_cells;
        let mut first = 0;
        while first < data.height_cells {
            let count = (2 * ROWS).min(data.height_cells - first);
            let pairs = count.div_ceil(2);
            for r in 0..pairs {
                let even = (data.row + first + 2 * r) * stride + data.column;
                let line = &mut self.rows[r * nx..(r + 1) * nx];
                line[..left].fill(ZERO);
                if 2 * r + 1 < count {
                    let (a, b) = (&field[even..], &field[even + stride..]);
                    for (z, (&re, &im)) in line[left..right].iter_mut().zip(a.iter().zip(b)) {
                        *z = Complex64::new(re, im);
                    }
                } else {
                    for (z, &re) in line[left..right].iter_mut().zip(&field[even..]) {
                        *z = Complex64::new(re, 0.0);
                    }
                }
                line[right..].fill(ZERO);
            }
            self.along_x[0].process_with_scratch(&mut self.rows[..pairs * nx], &mut self.scratch);
            for k in 0..half {
                let mirror = if k == 0 { 0 } else { nx - k };
                let column = &mut spectrum[k * ny + top + first..];
                for r in 0..pairs {
                    let (z, m) = (self.rows[r * nx + k], self.rows[r * nx + mirror].conj());
                    let (sum, difference) = ((z + m) * 0.5, (z - m) * 0.5);
                    column[2 * r] = sum;
                    if 2 * r + 1 < count {
                        column[2 * r + 1] = Complex64::new(difference.im, -difference.re); // (z - m) / 2i
                    }
                }
            }
            first += count;
        }
        clear_rows_outside(spectrum, ny, top, top + data.height_cells);
        self.along_y[0].process_with_scratch(spectrum, &mut self.scratch);
    }

    /// Real field from the half spectrum, which is destroyed. Not scaled.
    pub fn inverse_real(&mut self, spectrum: &mut [Complex64], region: Region, stride: usize, field: &mut [f64]) {
        let (nx, ny, half) = (self.nx, self.ny, self.half());
        self.along_y[1].process_with_scratch(spectrum, &mut self.scratch);
        let mut first = 0;
        while first < region.height_cells {
            let count = (2 * ROWS).min(region.height_cells - first);
            let pairs = count.div_ceil(2);
            for k in 0..half {
                let column = &spectrum[k * ny..(k + 1) * ny];
                for r in 0..pairs {
                    let a = column[first + 2 * r];
                    let b = if 2 * r + 1 < count { column[first + 2 * r + 1] } else { ZERO };
                    // a + ib, and at -k the same of the conjugates, as both rows are real
                    self.rows[r * nx + k] = Complex64::new(a.re - b.im, a.im + b.re);
                    if k != 0 && 2 * k != nx {
                        self.rows[r * nx + nx - k] = Complex64::new(a.re + b.im, b.re - a.im);
                    }
                }
            }
            self.along_x[1].process_with_scratch(&mut self.rows[..pairs * nx], &mut self.scratch);
            for r in 0..count {
                let line = &self.rows[(r / 2) * nx..(r / 2) * nx + region.width_cells];
                let to = (region.row + first + r) * stride + region.column;
                for (out, z) in field[to..to + region.width_cells].iter_mut().zip(line) {
                    *out = if r % 2 == 0 { z.re } else { z.im };
                }
            }
            first += count;
        }
    }
}

fn clear_rows_outside(spectrum: &mut [Complex64], ny: usize, top: usize, bottom: usize) {
    for column in spectrum.chunks_exact_mut(ny) {
        column[..top].fill(ZERO);
        column[bottom..].fill(ZERO);
    }
}

/// Rows into columns, a few rows at a time.
fn scatter(rows: &[Complex64], nx: usize, count: usize, spectrum: &mut [Complex64], ny: usize, first: usize) {
    if count == ROWS {
        let (a, rest) = rows.split_at(nx);
        let (b, rest) = rest.split_at(nx);
        let (c, d) = rest.split_at(nx);
        for (k, column) in spectrum.chunks_exact_mut(ny).enumerate() {
            column[first..first + ROWS].copy_from_slice(&[a[k], b[k], c[k], d[k]]);
        }
        return;
    }
    for (k, column) in spectrum.chunks_exact_mut(ny).enumerate() {
        for r in 0..count {
            column[first + r] = rows[r * nx + k];
        }
    }
}

/// Columns into rows, a few rows at a time.
fn gather(spectrum: &[Complex64], ny: usize, first: usize, rows: &mut [Complex64], nx: usize, count: usize) {
    if count == ROWS {
        let (a, rest) = rows.split_at_mut(nx);
        let (b, rest) = rest.split_at_mut(nx);
        let (c, d) = rest.split_at_mut(nx);
        let rows = a.iter_mut().zip(b).zip(c.iter_mut().zip(d));
        for (column, ((a, b), (c, d))) in spectrum.chunks_exact(ny).zip(rows) {
            let four = &column[first..first + ROWS];
            (*a, *b, *c, *d) = (four[0], four[1], four[2], four[3]);
        }
        return;
    }
    for (k, column) in spectrum.chunks_exact(ny).enumerate() {
        for (r, &z) in column[first..first + count].iter().enumerate() {
            rows[r * nx + k] = z;
        }
    }
}
