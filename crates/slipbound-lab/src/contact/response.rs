//! How the whole surface yields to tractions: convolutions with the compliance, done in Fourier space.

use super::grid::{Grid, Region, smooth_even_at_least};
use super::transform::{Area, Planner, Transform};
use crate::layer::Compliance;
use rustfft::num_complex::Complex64;
use std::sync::Arc;

/// Waves on either side, in either direction, that are added to the one a grid can resolve.
const ALIASES: i32 = 3;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Displacement at one offset from a cell that carries unit traction, in mm/MPa.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Kernel {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
    pub zz: f64,
    /// u_x from pressure; u_z from q_x is its negative.
    pub xz: f64,
    /// u_y from pressure.
    pub yz: f64,
}

/// Compliance at the wave numbers of one half of a transform, divided by the number of its points.
#[derive(Debug, Clone, Copy, Default)]
struct Wave {
    /// (xx + yy) / 2
    mean: f64,
    /// (xx - yy) / 2 + i xy
    spread: Complex64,
    zz: f64,
    /// xz, yz: the spectra of the odd kernels are i times these.
    odd: Complex64,
}

/// The response of a body's surface on windows up to `most_width` x `most_height` cells, with its buffers.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    pub(super) transform: Transform,
    /// Fingers of one gel share them.
    waves: Arc<[Wave]>,
    full: Vec<Complex64>,
    half: Vec<Complex64>,
    pub most_width: usize,
    pub most_height: usize,
}

impl Response {
    /// From a compliance that is a function of the wave number (a layer): periodic on the padded domain.
    pub fn of_layer(grid: &Grid, planner: Planner, compliance: impl Fn(f64) -> Compliance) -> Self {
        let mut out = Self::empty(grid.padded_width_cells, grid.padded_height_cells, planner);
        (out.most_width, out.most_height) = (grid.width_cells, grid.height_cells);
        let (half, ny) = (out.transform.half(), out.transform.ny);
        let scale = 1.0 / (out.transform.nx * ny) as f64;
        out.waves = (0..half * ny)
            .map(|i| {
                let wave = sampled(grid, i / ny, i % ny, &compliance);
                Wave {
                    mean: wave.mean * scale,
                    spread: wave.spread * scale,
                    zz: wave.zz * scale,
                    odd: wave.odd * scale,
                }
            })
            .collect();
        out
    }

    /// From a kernel in space, given for offsets of less than half the padded size.
    pub fn of_kernel(
        [nx, ny]: [usize; 2],
        [most_width, most_height]: [usize; 2],
        planner: Planner,
        kernel: impl Fn(isize, isize) -> Kernel,
    ) -> Self {
        let mut out = Self::empty(nx, ny, planner);
        (out.most_width, out.most_height) = (most_width, most_height);
        // Two real kernels are one complex field; even ones have real spectra, odd ones imaginary spectra.
        let mut even = vec![ZERO; nx * ny];
        let mut rest = vec![ZERO; nx * ny];
        let mut odd = vec![ZERO; nx * ny];
        let (w, h) = (most_width as isize, most_height as isize);
        for dy in 1 - h..h {
            for dx in 1 - w..w {
                let at = dy.rem_euclid(ny as isize) as usize * nx + dx.rem_euclid(nx as isize) as usize;
                let k = kernel(dx, dy);
                even[at] = Complex64::new(k.xx, k.yy);
                rest[at] = Complex64::new(k.xy, k.zz);
                odd[at] = Complex64::new(k.xz, k.yz);
            }
        }
        let everything = Area::all_of(Region { column: 0, row: 0, width_cells: nx, height_cells: ny });
        let mut spectra = [(); 3].map(|()| vec![ZERO; nx * ny]);
        for (field, spectrum) in [&even, &rest, &odd].into_iter().zip(&mut spectra) {
            out.transform.forward(field, nx, everything, spectrum);
        }
        let scale = 1.0 / (nx * ny) as f64;
        let wave = |i: usize| {
            let [even, rest, odd] = [0, 1, 2].map(|s| spectra[s][i] * scale);
            Wave {
                mean: 0.5 * (even.re + even.im),
                spread: Complex64::new(0.5 * (even.re - even.im), rest.re),
                zz: rest.im,
                odd: Complex64::new(odd.im, -odd.re), // i xz + i (i yz) = -yz + i xz
            }
        };
        out.waves = (0..out.transform.half() * ny).map(wave).collect();
        out
    }

    /// The same response for windows of at most `most_width` x `most_height` cells on smaller transforms: the
    /// kernel is cut out in space, so the results differ by rounding alone.
    pub fn cut_to(&self, most_cells: [usize; 2], planner: Planner) -> Self {
        self.in_space().cut_to(most_cells, planner)
    }

    /// Its kernel, back in space.
    pub(super) fn in_space(&self) -> InSpace {
        let (nx, ny) = (self.transform.nx, self.transform.ny);
        let mut transform = self.transform.clone();
        let whole = Region { column: 0, row: 0, width_cells: nx, height_cells: ny };
        let mut fields = [(); 3].map(|()| vec![ZERO; nx * ny]);
        for (which, field) in fields.iter_mut().enumerate() {
            let mut spectrum = vec![ZERO; nx * ny];
            for kx in 0..nx {
                for ky in 0..ny {
                    // Even tables are equal at k and -k, odd ones opposite.
                    let (mirrored, at) = if kx < transform.half() {
                        (false, kx * ny + ky)
                    } else {
                        (true, (nx - kx) * ny + (ny - ky) % ny)
                    };
                    let w = self.waves[at];
                    let odd = if mirrored { -w.odd } else { w.odd };
                    spectrum[kx * ny + ky] = match which {
                        0 => Complex64::new(w.mean + w.spread.re, w.mean - w.spread.re),
                        1 => Complex64::new(w.spread.im, w.zz),
                        _ => Complex64::new(-odd.im, odd.re),
                    };
                }
            }
            transform.inverse(&mut spectrum, whole, nx, field);
        }
        InSpace { nx, ny, fields }
    }

    fn empty(nx: usize, ny: usize, planner: Planner) -> Self {
        let transform = Transform::new(nx, ny, planner);
        let half = transform.half() * ny;
        Response {
            waves: Arc::new([]),
            full: vec![ZERO; nx * ny],
            half: vec![ZERO; half],
            transform,
            most_width: nx,
            most_height: ny,
        }
    }

    /// Points of the transforms: what a convolution costs.
    pub fn points_count(&self) -> usize {
        self.transform.nx * self.transform.ny
    }

    /// Whether a window fits.
    pub fn fits(&self, window: Region) -> bool {
        window.width_cells <= self.most_width && window.height_cells <= self.most_height
    }

    /// u_z on the window from the pressure on it.
    pub fn depth_of_pressure(&mut self, window: Region, stride: usize, pressure: &[f64], depth: &mut [f64]) {
        self.transform.forward_real(pressure, stride, Area::all_of(window), &mut self.half);
        for (z, w) in self.half.iter_mut().zip(self.waves.iter()) {
            *z *= w.zz;
        }
        self.transform.inverse_real(&mut self.half, window, stride, depth);
    }

    /// u_x + i u_y on the window from the in-plane traction on it.
    pub fn shift_of_traction(
        &mut self,
        window: Region,
        stride: usize,
        traction: &[Complex64],
        shift: &mut [Complex64],
    ) {
        self.transform.forward(traction, stride, Area::all_of(window), &mut self.full);
        self.yield_in_plane();
        self.transform.inverse(&mut self.full, window, stride, shift);
    }

    /// Everything the pressure does: u_x + i u_y and u_z on the window. `data` holds all cells under pressure.
    pub fn all_of_pressure(
        &mut self,
        area: Area,
        stride: usize,
        pressure: &[f64],
        shift: &mut [Complex64],
        depth: &mut [f64],
    ) {
        let (nx, ny, half) = (self.transform.nx, self.transform.ny, self.transform.half());
        self.transform.forward_real(pressure, stride, area, &mut self.half);
        let waves = &self.waves[..];
        for kx in 0..half {
            let own = kx == 0 || 2 * kx == nx;
            for ky in 0..ny {
                let i = kx * ny + ky;
                let odd = waves[i].odd;
                let turn = Complex64::new(-odd.im, odd.re); // i (xz + i yz)
                self.full[i] = turn * self.half[i];
                if !own {
                    self.full[(nx - kx) * ny + (ny - ky) % ny] = -turn * self.half[i].conj();
                }
            }
        }
        for (z, w) in self.half.iter_mut().zip(self.waves.iter()) {
            *z *= w.zz;
        }
        self.transform.inverse(&mut self.full, area.window, stride, shift);
        self.transform.inverse_real(&mut self.half, area.window, stride, depth);
    }

    /// Everything the in-plane traction does: u_x + i u_y and u_z on the window.
    pub fn all_of_traction(
        &mut self,
        area: Area,
        stride: usize,
        traction: &[Complex64],
        shift: &mut [Complex64],
        depth: &mut [f64],
    ) {
        let (nx, ny, half) = (self.transform.nx, self.transform.ny, self.transform.half());
        self.transform.forward(traction, stride, area, &mut self.full);
        let waves = &self.waves[..];
        for kx in 0..half {
            for ky in 0..ny {
                let i = kx * ny + ky;
                let z = self.full[i];
                let m = self.full[(nx - kx) % nx * ny + (ny - ky) % ny].conj();
                let (qx, d) = ((z + m) * 0.5, (z - m) * 0.5);
                let qy = Complex64::new(d.im, -d.re);
                let sum = qx * waves[i].odd.re + qy * waves[i].odd.im;
                self.half[i] = Complex64::new(sum.im, -sum.re); // -i (xz qx + yz qy)
            }
        }
        self.yield_in_plane();
        self.transform.inverse(&mut self.full, area.window, stride, shift);
        self.transform.inverse_real(&mut self.half, area.window, stride, depth);
    }

    /// U(k) = mean Z(k) + spread conj Z(-k), in place, for k and -k at a time.
    fn yield_in_plane(&mut self) {
        let (nx, ny) = (self.transform.nx, self.transform.ny);
        for kx in 0..self.transform.half() {
            let waves = &self.waves[kx * ny..(kx + 1) * ny];
            if kx == 0 || 2 * kx == nx {
                let column = &mut self.full[kx * ny..(kx + 1) * ny];
                for ky in 0..=ny / 2 {
                    let mirror = (ny - ky) % ny;
                    let (z, m, w) = (column[ky], column[mirror], waves[ky]);
                    column[ky] = z * w.mean + w.spread * m.conj();
                    column[mirror] = m * w.mean + w.spread * z.conj();
                }
                continue;
            }
            let (left, right) = self.full.split_at_mut((nx - kx) * ny);
            let (own, other) = (&mut left[kx * ny..(kx + 1) * ny], &mut right[..ny]);
            pair(&mut own[0], &mut other[0], &waves[0]);
            for ((z, m), w) in own[1..].iter_mut().zip(other[1..].iter_mut().rev()).zip(&waves[1..]) {
                pair(z, m, w);
            }
        }
    }
}

/// The kernel of a response at every offset of its padded domain: xx + i yy, xy + i zz, xz + i yz.
pub(super) struct InSpace {
    nx: usize,
    ny: usize,
    fields: [Vec<Complex64>; 3],
}

impl InSpace {
    /// See [`Response::cut_to`].
    pub fn cut_to(&self, [most_width, most_height]: [usize; 2], planner: Planner) -> Response {
        let InSpace { nx, ny, fields } = self;
        let size = [smooth_even_at_least(2 * most_width - 1), smooth_even_at_least(2 * most_height - 1)];
        Response::of_kernel(size, [most_width, most_height], planner, |dx, dy| {
            let at = dy.rem_euclid(*ny as isize) as usize * nx + dx.rem_euclid(*nx as isize) as usize;
            Kernel {
                xx: fields[0][at].re,
                yy: fields[0][at].im,
                xy: fields[1][at].re,
                zz: fields[1][at].im,
                xz: fields[2][at].re,
                yz: fields[2][at].im,
            }
        })
    }
}

/// Displacement at the middles of cells by traction that is uniform over each cell, for one wave number of the
/// grid: the sum over all waves that look the same on the grid, each weighted by the transform of a cell.
fn sampled(grid: &Grid, kx: usize, ky: usize, compliance: &impl Fn(f64) -> Compliance) -> Wave {
    let (wx, wy, nyquist) = grid.wave(kx, ky);
    let period = std::f64::consts::TAU / grid.cell_mm;
    let sinc = |k: f64| if k == 0.0 { 1.0 } else { libm::sin(0.5 * k * grid.cell_mm) / (0.5 * k * grid.cell_mm) };
    let mut out = Wave::default();
    for (m, n) in (-ALIASES..=ALIASES).flat_map(|m| (-ALIASES..=ALIASES).map(move |n| (m, n))) {
        let (x, y) = (wx + f64::from(m) * period, wy + f64::from(n) * period);
        let share = sinc(x) * sinc(y);
        if share == 0.0 {
            continue;
        }
        let k = libm::hypot(x, y);
        let (cx, cy) = if k > 0.0 { (x / k, y / k) } else { (1.0, 0.0) };
        let c = compliance(k);
        let spread = 0.5 * (c.along_mm_per_mpa - c.across_mm_per_mpa);
        out.mean += share * 0.5 * (c.along_mm_per_mpa + c.across_mm_per_mpa);
        out.spread += Complex64::new(cx * cx - cy * cy, 2.0 * cx * cy) * (share * spread);
        out.zz += share * c.normal_mm_per_mpa;
        out.odd -= Complex64::new(cx, cy) * (share * c.coupling_mm_per_mpa);
    }
    if nyquist {
        // Odd products of cx and cy have no consistent sign here.
        out.spread.im = 0.0;
        out.odd = ZERO;
    }
    out
}

#[inline(always)]
fn pair(z: &mut Complex64, m: &mut Complex64, w: &Wave) {
    let (a, b) = (*z, *m);
    *z = a * w.mean + w.spread * b.conj();
    *m = b * w.mean + w.spread * a.conj();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::length;
    use crate::contact::half_space_response;
    use crate::layer::Gel;

    const GRID: Grid =
        Grid { width_cells: 20, height_cells: 17, cell_mm: 0.5, padded_width_cells: 40, padded_height_cells: 36 };

    /// Repeatable numbers without structure, between -1 and 1.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    struct Fields {
        pressure: Vec<f64>,
        traction: Vec<Complex64>,
    }

    fn on(region: Region, seed: u64) -> Fields {
        let (mut next, cells) = (noise(seed), GRID.cells_count());
        let mut fields = Fields { pressure: vec![0.0; cells], traction: vec![ZERO; cells] };
        for i in region.cells(GRID.width_cells) {
            fields.pressure[i] = next();
            fields.traction[i] = Complex64::new(next(), next());
        }
        fields
    }

    fn answer(response: &mut Response, area: Area, fields: &Fields) -> (Vec<Complex64>, Vec<f64>) {
        let cells = GRID.cells_count();
        let (mut shift, mut depth) = (vec![ZERO; cells], vec![0.0; cells]);
        let (mut more, mut deeper) = (vec![ZERO; cells], vec![0.0; cells]);
        response.all_of_pressure(area, GRID.width_cells, &fields.pressure, &mut shift, &mut depth);
        response.all_of_traction(area, GRID.width_cells, &fields.traction, &mut more, &mut deeper);
        for i in 0..cells {
            shift[i] += more[i];
            depth[i] += deeper[i];
        }
        (shift, depth)
    }

    #[test]
    fn convolution_is_the_sum_over_cells() {
        let mut next = noise(7);
        // Even kernels are equal at opposite offsets, odd ones opposite.
        let table: Vec<[f64; 6]> = (0..40 * 40).map(|_| std::array::from_fn(|_| next())).collect();
        let kernel = |dx: isize, dy: isize| {
            let (flip, x, y) = if (dy, dx) < (0, 0) { (-1.0, -dx, -dy) } else { (1.0, dx, dy) };
            let [xx, xy, yy, zz, xz, yz] = table[(y * 40 + x + 20) as usize];
            let odd = if dx == 0 && dy == 0 { 0.0 } else { flip };
            Kernel { xx, xy, yy, zz, xz: odd * xz, yz: odd * yz }
        };
        let mut response = Response::of_kernel([40, 36], [20, 17], Planner::Scalar, kernel);
        let data = Region { column: 3, row: 2, width_cells: 11, height_cells: 13 };
        let fields = on(data, 11);
        let (shift, depth) = answer(&mut response, Area { window: GRID.whole(), data }, &fields);
        for cell in [0, 5, 90, 177, 254, 339] {
            let (mut u, mut w) = (ZERO, 0.0);
            for other in 0..GRID.cells_count() {
                let dx = (cell % 20) as isize - (other % 20) as isize;
                let dy = (cell / 20) as isize - (other / 20) as isize;
                let (k, q, p) = (kernel(dx, dy), fields.traction[other], fields.pressure[other]);
                u += Complex64::new(k.xx * q.re + k.xy * q.im + k.xz * p, k.xy * q.re + k.yy * q.im + k.yz * p);
                w += k.zz * p - k.xz * q.re - k.yz * q.im;
            }
            assert!(length(u - shift[cell]) < 1e-11 && (w - depth[cell]).abs() < 1e-11, "{cell}");
        }
    }

    #[test]
    fn small_transforms_give_what_the_whole_gives() {
        let gel = Gel::default();
        let mut whole = Response::of_layer(&GRID, Planner::Scalar, |k| gel.compliance(k));
        let window = Region { column: 4, row: 6, width_cells: 9, height_cells: 7 };
        let mut cut = whole.cut_to([9, 7], Planner::Scalar);
        assert!(cut.points_count() < whole.points_count() && cut.fits(window) && !cut.fits(GRID.whole()));
        let fields = on(window, 3);
        let (shift, depth) = answer(&mut whole, Area { window: GRID.whole(), data: window }, &fields);
        let (near, deep) = answer(&mut cut, Area::all_of(window), &fields);
        let (mut press, mut push) = (vec![0.0; GRID.cells_count()], vec![ZERO; GRID.cells_count()]);
        let pressed = answer(&mut cut, Area::all_of(window), &Fields { traction: push.clone(), ..on(window, 3) });
        cut.depth_of_pressure(window, 20, &fields.pressure, &mut press);
        cut.shift_of_traction(window, 20, &fields.traction, &mut push);
        for i in window.cells(20) {
            assert!(length(shift[i] - near[i]) < 1e-12 && (depth[i] - deep[i]).abs() < 1e-12);
            assert!((press[i] - pressed.1[i]).abs() < 1e-13);
            assert!(length(push[i] + pressed.0[i] - near[i]) < 1e-12);
        }
    }

    #[test]
    fn work_is_reciprocal_and_positive() {
        let gel = Gel::default();
        let layer = Response::of_layer(&GRID, Planner::Scalar, |k| gel.compliance(k));
        let half_space = half_space_response(&GRID, 0.2, 0.3, Planner::Scalar);
        for mut response in [layer, half_space] {
            let area = Area::all_of(GRID.whole());
            let (a, b) = (on(GRID.whole(), 1), on(GRID.whole(), 2));
            let (ua, ub) = (answer(&mut response, area, &a), answer(&mut response, area, &b));
            let work = |f: &Fields, u: &(Vec<Complex64>, Vec<f64>)| -> f64 {
                (0..GRID.cells_count())
                    .map(|i| f.traction[i].re * u.0[i].re + f.traction[i].im * u.0[i].im + f.pressure[i] * u.1[i])
                    .sum()
            };
            let (ab, ba, aa) = (work(&a, &ub), work(&b, &ua), work(&a, &ua));
            assert!((ab - ba).abs() < 1e-11 * aa && aa > 0.0, "{ab} {ba} {aa}");
        }
    }
}
