//! Displacement of the whole surface under tractions: convolutions with the compliance, computed in Fourier space.

use super::fourier::{LANES, Rows};
use super::grid::{Grid, Region, smooth_even_at_least};
use super::transform::{Area, Lines, Transform};
use crate::layer::Compliance;
use num_complex::Complex64;
use slipbound::pixels::wide::wide;
use std::sync::Arc;

/// Number of aliases on either side, in each direction, that are added to the wave that a grid can resolve.
const ALIASES: i32 = 3;

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

impl Kernel {
    /// Kernels in pairs, the odd ones last.
    fn pairs(self) -> [Complex64; 3] {
        let Kernel { xx, xy, yy, zz, xz, yz } = self;
        [Complex64::new(xx, yy), Complex64::new(xy, zz), Complex64::new(xz, yz)]
    }

    fn of_pairs([even, rest, odd]: [Complex64; 3]) -> Self {
        Kernel { xx: even.re, xy: rest.re, yy: even.im, zz: rest.im, xz: odd.re, yz: odd.im }
    }
}

/// Compliance at one wave number: the spectra of even kernels are real, those of odd kernels are i times these.
#[derive(Debug, Clone, Copy, Default)]
struct Wave {
    xx: f64,
    xy: f64,
    yy: f64,
    zz: f64,
    xz: f64,
    yz: f64,
}

/// Compliance at the waves of every block of [`Lines`], in their order, divided by the gain of a forward and an inverse
/// transform.
#[derive(Debug)]
struct Waves {
    /// xx and yy, xy and zz, xz and yz.
    pairs: [Vec<Rows>; 3],
}

impl Waves {
    /// From the wave numbers `kx` and `ky`.
    fn of(transform: &Transform, wave: impl Fn(usize, usize) -> Wave) -> Self {
        let mut pairs = [(); 3].map(|()| vec![Rows::zeros(transform.nx); transform.blocks_count()]);
        for ky in 0..=transform.ny / 2 {
            for kx in 0..transform.nx {
                let (row, Wave { xx, xy, yy, zz, xz, yz }) = (transform.place(kx), wave(kx, ky));
                for (rows, pair) in pairs.iter_mut().zip([[xx, yy], [xy, zz], [xz, yz]]) {
                    for (part, value) in rows[ky / LANES].parts_mut().into_iter().zip(pair) {
                        part[row][ky % LANES] = value;
                    }
                }
            }
        }
        Waves { pairs }
    }

    /// Values of a block: xx and yy, xy and zz, or xz and yz.
    fn of_block(&self, pair: usize, block: usize) -> [&[f64]; 2] {
        flat(&self.pairs[pair][block])
    }

    /// u_z of the pressure, in place.
    fn press(&self, block: usize, z: &mut Rows) {
        let [_, zz] = self.of_block(1, block);
        flat_mut(z).into_iter().for_each(|part| scale(zz, part));
    }

    /// u_x and u_y of the traction, in place.
    fn shear(&self, block: usize, x: &mut Rows, y: &mut Rows) {
        let ([xx, yy], [xy, _]) = (self.of_block(0, block), self.of_block(1, block));
        flat_mut(x).into_iter().zip(flat_mut(y)).for_each(|(x, y)| mix(xx, xy, yy, x, y));
    }

    /// u_x = i xz p and u_y = i yz p of the pressure.
    fn spread(&self, block: usize, p: &Rows, x: &mut Rows, y: &mut Rows) {
        let [p_re, p_im] = flat(p);
        for (odd, out) in self.of_block(2, block).into_iter().zip([x, y]) {
            let [re, im] = flat_mut(out);
            product(odd, p_im, -1.0, re);
            product(odd, p_re, 1.0, im);
        }
    }

    /// u_z = -i (xz qx + yz qy) of the traction.
    fn lift(&self, block: usize, x: &Rows, y: &Rows, z: &mut Rows) {
        let ([xz, yz], [x_re, x_im], [y_re, y_im]) = (self.of_block(2, block), flat(x), flat(y));
        let [re, im] = flat_mut(z);
        sum(xz, yz, x_im, y_im, 1.0, re);
        sum(xz, yz, x_re, y_re, -1.0, im);
    }
}

fn flat(rows: &Rows) -> [&[f64]; 2] {
    rows.parts().map(<[_]>::as_flattened)
}

fn flat_mut(rows: &mut Rows) -> [&mut [f64]; 2] {
    rows.parts_mut().map(<[_]>::as_flattened_mut)
}

/// The response of a body's surface on windows up to `most_width` x `most_height` cells, with its buffers.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    pub(super) transform: Transform,
    /// Shared by fingers with the same gel.
    waves: Arc<Waves>,
    /// Along x, along y, into the gel: tractions and then displacements.
    lines: [Lines; 3],
    /// One block of each.
    blocks: [Rows; 3],
    pub most_width: usize,
    pub most_height: usize,
}

impl Response {
    /// From a compliance that is a function of the wave number (a layer): periodic on the padded domain.
    pub fn of_layer(grid: &Grid, compliance: impl Fn(f64) -> Compliance) -> Self {
        let transform = Transform::new(grid.padded_width_cells, grid.padded_height_cells);
        // Lines hold fields times 2.
        let scale = 0.5 / (transform.nx * transform.ny) as f64;
        let waves = Waves::of(&transform, |kx, ky| sampled(grid, kx, ky, &compliance, scale));
        Self::new(transform, waves, [grid.width_cells, grid.height_cells])
    }

    /// From a kernel in space, given for offsets of less than half the padded size.
    pub fn of_kernel([nx, ny]: [usize; 2], most_cells: [usize; 2], kernel: impl Fn(isize, isize) -> Kernel) -> Self {
        let mut transform = Transform::new(nx, ny);
        let mut fields = [(); 3].map(|()| vec![Complex64::ZERO; nx * ny]);
        let [w, h] = most_cells.map(|most| most as isize);
        for dy in 1 - h..h {
            for dx in 1 - w..w {
                let at = dy.rem_euclid(ny as isize) as usize * nx + dx.rem_euclid(nx as isize) as usize;
                kernel(dx, dy).pairs().into_iter().zip(&mut fields).for_each(|(pair, field)| field[at] = pair);
            }
        }
        let everything = Area::all_of(Region { column: 0, row: 0, width_cells: nx, height_cells: ny });
        let blocks = transform.blocks_count();
        let spectra = fields.map(|field| {
            let mut lines = [(); 2].map(|()| transform.lines(nx));
            let [first, second] = &mut lines;
            transform.lines_of_vectors(&field, nx, everything, [first, second]);
            lines.map(|mut lines| -> Vec<Rows> {
                let mut waves = vec![Rows::zeros(nx); blocks];
                for (block, waves) in waves.iter_mut().enumerate() {
                    transform.waves(&mut lines, block, everything, waves);
                }
                waves
            })
        });
        // Lines hold fields times 2, those of the kernels here and those of tractions later.
        let scale = 0.25 / (nx * ny) as f64;
        let waves = Waves::of(&transform, |kx, ky| {
            let (block, row, lane) = (ky / LANES, transform.place(kx), ky % LANES);
            let even = |waves: &[Rows]| waves[block].parts()[0][row][lane] * scale;
            let odd = |waves: &[Rows]| waves[block].parts()[1][row][lane] * scale;
            let [[xx, yy], [xy, zz], [xz, yz]] = &spectra;
            Wave { xx: even(xx), xy: even(xy), yy: even(yy), zz: even(zz), xz: odd(xz), yz: odd(yz) }
        });
        Self::new(transform, waves, most_cells)
    }

    fn new(transform: Transform, waves: Waves, [most_width, most_height]: [usize; 2]) -> Self {
        let lines = [(); 3].map(|()| transform.lines(most_width));
        let blocks = [(); 3].map(|()| Rows::zeros(transform.nx));
        Response { transform, waves: Arc::new(waves), lines, blocks, most_width, most_height }
    }

    /// The same response for windows of at most `most_width` x `most_height` cells on smaller transforms. The kernel is
    /// truncated in space, so the results differ only by rounding.
    pub fn cut_to(&self, most_cells: [usize; 2]) -> Self {
        self.in_space().cut_to(most_cells)
    }

    /// Its kernel, transformed back to space.
    pub(super) fn in_space(&self) -> InSpace {
        let mut transform = self.transform.clone();
        let (nx, ny) = (transform.nx, transform.ny);
        let whole = Region { column: 0, row: 0, width_cells: nx, height_cells: ny };
        let fields = [0, 1, 2].map(|pair| {
            let mut lines = [0, 1].map(|part| {
                let mut lines = transform.lines(nx);
                for block in 0..transform.blocks_count() {
                    let mut waves = Rows::zeros(nx);
                    // The spectra of even kernels are real, those of odd ones imaginary.
                    let into = &mut flat_mut(&mut waves)[usize::from(pair == 2)];
                    into.iter_mut().zip(self.waves.of_block(pair, block)[part]).for_each(|(out, w)| *out = 2.0 * w);
                    transform.lines_of_waves(&mut waves, block, whole, &mut lines);
                }
                lines
            });
            let mut field = vec![Complex64::ZERO; nx * ny];
            let [first, second] = &mut lines;
            transform.vectors([first, second], whole, nx, &mut field);
            field
        });
        InSpace { nx, ny, fields }
    }

    /// Points of the transforms: the cost of a convolution.
    pub fn points_count(&self) -> usize {
        self.transform.nx * self.transform.ny
    }

    /// Whether a window fits.
    pub fn fits(&self, window: Region) -> bool {
        window.width_cells <= self.most_width && window.height_cells <= self.most_height
    }

    /// u_z on the window from the pressure on it.
    pub fn depth_of_pressure(&mut self, window: Region, stride: usize, pressure: &[f64], depth: &mut [f64]) {
        let (transform, [_, _, lines], [_, _, z]) = (&mut self.transform, &mut self.lines, &mut self.blocks);
        let area = Area::all_of(window);
        transform.lines_of_scalars(pressure, stride, area, lines);
        for block in 0..transform.blocks_count() {
            transform.waves(lines, block, area, z);
            self.waves.press(block, z);
            transform.lines_of_waves(z, block, window, lines);
        }
        transform.scalars(lines, window, stride, depth);
    }

    /// u_x + i u_y on the window from the in-plane traction on it.
    pub fn shift_of_traction(
        &mut self,
        window: Region,
        stride: usize,
        traction: &[Complex64],
        shift: &mut [Complex64],
    ) {
        let (transform, [along, across, _], [x, y, _]) = (&mut self.transform, &mut self.lines, &mut self.blocks);
        let area = Area::all_of(window);
        transform.lines_of_vectors(traction, stride, area, [along, across]);
        for block in 0..transform.blocks_count() {
            transform.waves(along, block, area, x);
            transform.waves(across, block, area, y);
            self.waves.shear(block, x, y);
            transform.lines_of_waves(x, block, window, along);
            transform.lines_of_waves(y, block, window, across);
        }
        transform.vectors([along, across], window, stride, shift);
    }

    /// All effects of the pressure: u_x + i u_y and u_z on the window. `data` contains all cells under pressure.
    pub fn all_of_pressure(
        &mut self,
        area: Area,
        stride: usize,
        pressure: &[f64],
        shift: &mut [Complex64],
        depth: &mut [f64],
    ) {
        self.transform.lines_of_scalars(pressure, stride, area, &mut self.lines[2]);
        for block in 0..self.transform.blocks_count() {
            let [x, y, z] = &mut self.blocks;
            self.transform.waves(&mut self.lines[2], block, area, z);
            self.waves.spread(block, z, x, y);
            self.waves.press(block, z);
            self.keep(block, area.window);
        }
        self.displacement(area.window, stride, shift, depth);
    }

    /// All effects of the in-plane traction: u_x + i u_y and u_z on the window.
    pub fn all_of_traction(
        &mut self,
        area: Area,
        stride: usize,
        traction: &[Complex64],
        shift: &mut [Complex64],
        depth: &mut [f64],
    ) {
        let [along, across, _] = &mut self.lines;
        self.transform.lines_of_vectors(traction, stride, area, [along, across]);
        for block in 0..self.transform.blocks_count() {
            let [x, y, z] = &mut self.blocks;
            self.transform.waves(&mut self.lines[0], block, area, x);
            self.transform.waves(&mut self.lines[1], block, area, y);
            self.waves.lift(block, x, y, z);
            self.waves.shear(block, x, y);
            self.keep(block, area.window);
        }
        self.displacement(area.window, stride, shift, depth);
    }

    /// The displacement of a block.
    fn keep(&mut self, block: usize, window: Region) {
        for (waves, lines) in self.blocks.iter_mut().zip(&mut self.lines) {
            self.transform.lines_of_waves(waves, block, window, lines);
        }
    }

    fn displacement(&mut self, window: Region, stride: usize, shift: &mut [Complex64], depth: &mut [f64]) {
        let [along, across, into] = &mut self.lines;
        self.transform.vectors([along, across], window, stride, shift);
        self.transform.scalars(into, window, stride, depth);
    }
}

wide! {
    /// a *= factor
    fn scale(factor: &[f64], a: &mut [f64]) {
        a.iter_mut().zip(factor).for_each(|(a, factor)| *a *= factor);
    }

    /// x = xx x + xy y, y = xy x + yy y
    fn mix(xx: &[f64], xy: &[f64], yy: &[f64], x: &mut [f64], y: &mut [f64]) {
        for (((xx, xy), yy), (x, y)) in xx.iter().zip(xy).zip(yy).zip(x.iter_mut().zip(y)) {
            (*x, *y) = (xx * *x + xy * *y, xy * *x + yy * *y);
        }
    }

    /// out = sign factor a
    fn product(factor: &[f64], a: &[f64], sign: f64, out: &mut [f64]) {
        for ((factor, a), out) in factor.iter().zip(a).zip(out) {
            *out = sign * factor * a;
        }
    }

    /// out = sign (xz x + yz y)
    fn sum(xz: &[f64], yz: &[f64], x: &[f64], y: &[f64], sign: f64, out: &mut [f64]) {
        for (((xz, yz), (x, y)), out) in xz.iter().zip(yz).zip(x.iter().zip(y)).zip(out) {
            *out = sign * (xz * x + yz * y);
        }
    }
}

/// The kernel of a response at every offset of its padded domain, in [`Kernel::pairs`].
pub(super) struct InSpace {
    nx: usize,
    ny: usize,
    fields: [Vec<Complex64>; 3],
}

impl InSpace {
    /// See [`Response::cut_to`].
    pub fn cut_to(&self, [most_width, most_height]: [usize; 2]) -> Response {
        let InSpace { nx, ny, fields } = self;
        let size = [smooth_even_at_least(2 * most_width - 1), smooth_even_at_least(2 * most_height - 1)];
        Response::of_kernel(size, [most_width, most_height], |dx, dy| {
            let at = dy.rem_euclid(*ny as isize) as usize * nx + dx.rem_euclid(*nx as isize) as usize;
            Kernel::of_pairs([0, 1, 2].map(|which: usize| fields[which][at]))
        })
    }
}

/// Displacement at the cell centres by traction that is uniform over each cell, for one wave number of the grid, times
/// a factor: the sum over all aliases of the wave, each weighted by the transform of a cell.
fn sampled(grid: &Grid, kx: usize, ky: usize, compliance: &impl Fn(f64) -> Compliance, factor: f64) -> Wave {
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
        let (k, share) = (libm::hypot(x, y), share * factor);
        let (cx, cy) = if k > 0.0 { (x / k, y / k) } else { (1.0, 0.0) };
        let c = compliance(k);
        let (along, across) = (share * c.along_mm_per_mpa, share * c.across_mm_per_mpa);
        out.xx += cx * cx * along + cy * cy * across;
        out.yy += cy * cy * along + cx * cx * across;
        out.xy += cx * cy * (along - across);
        out.zz += share * c.normal_mm_per_mpa;
        out.xz -= cx * (share * c.coupling_mm_per_mpa);
        out.yz -= cy * (share * c.coupling_mm_per_mpa);
    }
    if nyquist {
        // Odd products of cx and cy have no consistent sign here.
        (out.xy, out.xz, out.yz) = (0.0, 0.0, 0.0);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::length;
    use crate::contact::half_space_response;
    use crate::layer::Gel;

    const GRID: Grid =
        Grid { width_cells: 20, height_cells: 17, cell_mm: 0.5, padded_width_cells: 40, padded_height_cells: 36 };

    /// Repeatable pseudo-random numbers between -1 and 1.
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
        let mut fields = Fields { pressure: vec![0.0; cells], traction: vec![Complex64::ZERO; cells] };
        for i in region.cells(GRID.width_cells) {
            fields.pressure[i] = next();
            fields.traction[i] = Complex64::new(next(), next());
        }
        fields
    }

    fn answer(response: &mut Response, area: Area, fields: &Fields) -> (Vec<Complex64>, Vec<f64>) {
        let cells = GRID.cells_count();
        let (mut shift, mut depth) = (vec![Complex64::ZERO; cells], vec![0.0; cells]);
        let (mut more, mut deeper) = (vec![Complex64::ZERO; cells], vec![0.0; cells]);
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
        // Even kernels are equal at opposite offsets, odd kernels have opposite signs.
        let table: Vec<[f64; 6]> = (0..40 * 40).map(|_| std::array::from_fn(|_| next())).collect();
        let kernel = |dx: isize, dy: isize| {
            let (flip, x, y) = if (dy, dx) < (0, 0) { (-1.0, -dx, -dy) } else { (1.0, dx, dy) };
            let [xx, xy, yy, zz, xz, yz] = table[(y * 40 + x + 20) as usize];
            let odd = if dx == 0 && dy == 0 { 0.0 } else { flip };
            Kernel { xx, xy, yy, zz, xz: odd * xz, yz: odd * yz }
        };
        let mut response = Response::of_kernel([40, 36], [20, 17], kernel);
        let data = Region { column: 3, row: 2, width_cells: 11, height_cells: 13 };
        let fields = on(data, 11);
        let (shift, depth) = answer(&mut response, Area { window: GRID.whole(), data }, &fields);
        for cell in [0, 5, 90, 177, 254, 339] {
            let (mut u, mut w) = (Complex64::ZERO, 0.0);
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
        let mut whole = Response::of_layer(&GRID, |k| gel.compliance(k));
        let window = Region { column: 4, row: 6, width_cells: 9, height_cells: 7 };
        let mut cut = whole.cut_to([9, 7]);
        assert!(cut.points_count() < whole.points_count() && cut.fits(window) && !cut.fits(GRID.whole()));
        let fields = on(window, 3);
        let (shift, depth) = answer(&mut whole, Area { window: GRID.whole(), data: window }, &fields);
        let (near, deep) = answer(&mut cut, Area::all_of(window), &fields);
        let (mut press, mut push) = (vec![0.0; GRID.cells_count()], vec![Complex64::ZERO; GRID.cells_count()]);
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
        let layer = Response::of_layer(&GRID, |k| gel.compliance(k));
        let half_space = half_space_response(&GRID, 0.2, 0.3);
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
