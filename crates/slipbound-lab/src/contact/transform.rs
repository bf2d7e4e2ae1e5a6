//! Two-dimensional transforms of zero-padded real fields (pressure, depth, both components of a vector), two at a time.
//!
//! ```text
//!   cells of a region          eight columns of them      waves along y, block by block         waves along x and y
//!   [row 0: x x x x x x x ]    FFT along y, two fields    [ky 0..7 of every column of data]     FFT along x of a block
//!   [row 1: x x x ...     ] -> as real and imaginary  ->  [ky 8..15 ...                   ] ->  at a time, see `response`
//!   ...                        part                       ...         ... ny / 2]
//! ```
//!
//! Two real fields are one complex one: with Z its transform along y, F = (Z(ky) + conj Z(-ky)) / 2 is that of one and
//! (Z(ky) - conj Z(-ky)) / 2i that of the other. A vector field is two fields; so are the left and the right half of a
//! scalar field. From there on every field is its own half spectrum, ky from 0 to ny / 2, so that kernels multiply
//! without access to -k. Padding costs least in this order: along y only columns with data are transformed, along x one
//! block after the other, which stays in the nearest cache from the forward transform through the product to the
//! inverse.

use super::fourier::{Fourier, LANES, Lanes, NOTHING, Rows};
use super::grid::Region;
use num_complex::Complex64;
use slipbound::pixels::wide::wide;

/// The cells of a transform: `window` is at the corner of the padded domain, `data` is the part of it that is not zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub window: Region,
    pub data: Region,
}

impl Area {
    pub fn all_of(window: Region) -> Self {
        Area { window, data: window }
    }

    /// Columns and rows of the padded domain left of and above the data.
    fn before(&self) -> (usize, usize) {
        (self.data.column - self.window.column, self.data.row - self.window.row)
    }
}

/// A real field transformed along y, times 2: of each block of `LANES` waves a row for every column.
#[derive(Debug, Clone)]
pub(crate) struct Lines {
    rows: Rows,
    /// Capacity in columns.
    most_width: usize,
}

impl Lines {
    /// The lines of adjacent columns.
    fn of(&mut self, block: usize, first: usize, count: usize) -> [&mut [Lanes]; 2] {
        let from = block * self.most_width + first;
        self.rows.parts_mut().map(|part| &mut part[from..][..count])
    }
}

/// Transforms of one padded size.
#[derive(Debug, Clone)]
pub(crate) struct Transform {
    pub nx: usize,
    pub ny: usize,
    along_x: Fourier,
    along_y: Fourier,
    /// Eight columns of the padded domain.
    columns: Rows,
}

impl Transform {
    /// Sizes are even and of the form 2^a 3^b 5^c.
    pub fn new(nx: usize, ny: usize) -> Self {
        let (along_x, along_y) = (Fourier::new(nx), Fourier::new(ny));
        Transform { nx, ny, along_x, along_y, columns: Rows::zeros(ny) }
    }

    /// Blocks of waves along y.
    pub fn blocks_count(&self) -> usize {
        (self.ny / 2 + 1).div_ceil(LANES)
    }

    /// Memory for a field with so many columns.
    pub fn lines(&self, most_width: usize) -> Lines {
        Lines { rows: Rows::zeros(self.blocks_count() * most_width), most_width }
    }

    /// The row of a block that contains wave `kx` along x.
    pub fn place(&self, kx: usize) -> usize {
        self.along_x.places()[kx] as usize
    }

    /// Both components of a vector field, x + iy.
    pub fn lines_of_vectors(&mut self, field: &[Complex64], stride: usize, area: Area, [x, y]: [&mut Lines; 2]) {
        let (data, (_, top)) = (area.data, area.before());
        let rows = top..top + data.height_cells;
        for column in (0..data.width_cells).step_by(LANES) {
            let count = LANES.min(data.width_cells - column);
            self.columns.clear_outside(rows.clone());
            let from = &field[data.row * stride + data.column + column..];
            let [re, im] = self.columns.parts_mut();
            take_vectors(from, stride, count, &mut re[rows.clone()], &mut im[rows.clone()]);
            self.along_y.forward(&mut self.columns);
            for block in 0..self.blocks_count() {
                self.apart::<false>(block, x.of(block, column, count));
                self.apart::<true>(block, y.of(block, column, count));
            }
        }
    }

    /// A scalar field.
    pub fn lines_of_scalars(&mut self, field: &[f64], stride: usize, area: Area, lines: &mut Lines) {
        let (data, (_, top)) = (area.data, area.before());
        let (rows, left) = (top..top + data.height_cells, data.width_cells.div_ceil(2));
        for column in (0..left).step_by(LANES) {
            let counts = [left, data.width_cells - left].map(|width| LANES.min(width.saturating_sub(column)));
            self.columns.clear_outside(rows.clone());
            let from = data.row * stride + data.column + column;
            let [re, im] = self.columns.parts_mut();
            take_scalars(&field[from..], stride, counts[0], &mut re[rows.clone()]);
            take_scalars(&field[from + left..], stride, counts[1], &mut im[rows.clone()]);
            self.along_y.forward(&mut self.columns);
            for block in 0..self.blocks_count() {
                self.apart::<false>(block, lines.of(block, column, counts[0]));
                self.apart::<true>(block, lines.of(block, left + column, counts[1]));
            }
        }
    }

    /// The waves along x of a block, from lines of the data.
    pub fn waves(&self, lines: &mut Lines, block: usize, area: Area, waves: &mut Rows) {
        let ((left, _), width) = (area.before(), area.data.width_cells);
        waves.clear_outside(left..left + width);
        for (waves, lines) in waves.parts_mut().into_iter().zip(lines.of(block, 0, width)) {
            waves[left..left + width].copy_from_slice(lines);
        }
        self.along_x.forward(waves);
    }

    /// Lines of the window from the waves of a block, which are destroyed.
    pub fn lines_of_waves(&self, waves: &mut Rows, block: usize, window: Region, lines: &mut Lines) {
        self.along_x.inverse(waves);
        for (waves, lines) in waves.parts().into_iter().zip(lines.of(block, 0, window.width_cells)) {
            lines.copy_from_slice(&waves[..window.width_cells]);
        }
    }

    /// A vector field from the lines of its components. Not scaled.
    pub fn vectors(&mut self, [x, y]: [&mut Lines; 2], window: Region, stride: usize, field: &mut [Complex64]) {
        for column in (0..window.width_cells).step_by(LANES) {
            let count = LANES.min(window.width_cells - column);
            for block in 0..self.blocks_count() {
                self.together(block, x.of(block, column, count), y.of(block, column, count));
            }
            self.along_y.inverse(&mut self.columns);
            let to = &mut field[window.row * stride + window.column + column..];
            let [re, im] = self.columns.parts().map(|part| &part[..window.height_cells]);
            give_vectors(re, im, stride, count, to);
        }
    }

    /// A scalar field from its lines. Not scaled.
    pub fn scalars(&mut self, lines: &mut Lines, window: Region, stride: usize, field: &mut [f64]) {
        let left = window.width_cells.div_ceil(2);
        for column in (0..left).step_by(LANES) {
            let counts = [left, window.width_cells - left].map(|width| LANES.min(width.saturating_sub(column)));
            for block in 0..self.blocks_count() {
                let both = lines.of(block, column, left + counts[1]);
                let [[re, more_re], [im, more_im]] = both.map(|part| <[_; 2]>::from(part.split_at_mut(left)));
                self.together(block, [&mut re[..counts[0]], &mut im[..counts[0]]], [more_re, more_im]);
            }
            self.along_y.inverse(&mut self.columns);
            let to = window.row * stride + window.column + column;
            let [re, im] = self.columns.parts().map(|part| &part[..window.height_cells]);
            give_scalars(re, stride, counts[0], &mut field[to..]);
            give_scalars(im, stride, counts[1], &mut field[to + left..]);
        }
    }

    /// The waves of a block of the first or the second of the two fields in `columns`, times 2.
    fn apart<const SECOND: bool>(&self, block: usize, [re, im]: [&mut [Lanes]; 2]) {
        let [from_re, from_im] = self.columns.parts();
        apart::<SECOND>(from_re, from_im, self.along_y.places(), block, re, im);
    }

    /// The waves of a block of two fields into `columns`; the second may have fewer lines.
    fn together(&mut self, block: usize, first: [&mut [Lanes]; 2], second: [&mut [Lanes]; 2]) {
        let ([f_re, f_im], [g_re, g_im], [re, im]) = (first, second, self.columns.parts_mut());
        together([f_re, f_im, g_re, g_im], self.along_y.places(), block, re, im);
    }
}

wide! {
    /// Rows of cells, `stride` apart, into lanes.
    fn take_vectors(field: &[Complex64], stride: usize, count: usize, re: &mut [Lanes], im: &mut [Lanes]) {
        for ((re, im), cells) in re.iter_mut().zip(im).zip(field.chunks(stride)) {
            match cells.first_chunk::<LANES>() {
                Some(cells) if count == LANES => {
                    let cells = *cells;
                    (*re, *im) = (cells.map(|z| z.re), cells.map(|z| z.im));
                }
                _ => {
                    (*re, *im) = (NOTHING, NOTHING);
                    cells[..count].iter().enumerate().for_each(|(i, z)| (re[i], im[i]) = (z.re, z.im));
                }
            }
        }
    }

    /// As [`take_vectors`].
    fn take_scalars(field: &[f64], stride: usize, count: usize, lanes: &mut [Lanes]) {
        for (y, lanes) in lanes.iter_mut().enumerate() {
            let cells = &field[y * stride..][..count];
            match cells.first_chunk() {
                Some(cells) => *lanes = *cells,
                None => {
                    *lanes = NOTHING;
                    lanes.iter_mut().zip(cells).for_each(|(lane, value)| *lane = *value);
                }
            }
        }
    }

    /// The reverse of [`take_vectors`].
    fn give_vectors(re: &[Lanes], im: &[Lanes], stride: usize, count: usize, field: &mut [Complex64]) {
        for ((re, im), cells) in re.iter().zip(im).zip(field.chunks_mut(stride)) {
            match cells.first_chunk_mut::<LANES>() {
                Some(cells) if count == LANES => *cells = std::array::from_fn(|i| Complex64::new(re[i], im[i])),
                _ => cells[..count].iter_mut().enumerate().for_each(|(i, z)| *z = Complex64::new(re[i], im[i])),
            }
        }
    }

    /// The reverse of [`take_scalars`].
    fn give_scalars(lanes: &[Lanes], stride: usize, count: usize, field: &mut [f64]) {
        for (y, lanes) in lanes.iter().enumerate() {
            let cells = &mut field[y * stride..][..count];
            match cells.first_chunk_mut() {
                Some(cells) => *cells = *lanes,
                None => cells.iter_mut().zip(*lanes).for_each(|(cell, value)| *cell = value),
            }
        }
    }

    /// See [`Transform::apart`]: lanes were columns and are waves from here on.
    fn apart<const SECOND: bool>(
        re: &[Lanes],
        im: &[Lanes],
        places: &[u32],
        block: usize,
        line_re: &mut [Lanes],
        line_im: &mut [Lanes],
    ) {
        let ny = places.len();
        let mut waves = [[NOTHING; LANES]; 2];
        for (ky, k) in (block * LANES..=ny / 2).zip(0..LANES) {
            let (at, mirror) = (places[ky] as usize, places[(ny - ky) % ny] as usize);
            let (z, mirror) = ([&re[at], &im[at]], [&re[mirror], &im[mirror]]);
            for i in 0..LANES {
                (waves[0][k][i], waves[1][k][i]) = if SECOND {
                    (z[1][i] + mirror[1][i], mirror[0][i] - z[0][i])
                } else {
                    (z[0][i] + mirror[0][i], z[1][i] - mirror[1][i])
                };
            }
        }
        for (i, (re, im)) in line_re.iter_mut().zip(line_im).enumerate() {
            for k in 0..LANES {
                (re[k], im[k]) = (waves[0][k][i], waves[1][k][i]);
            }
        }
    }

    /// See [`Transform::together`]: real and imaginary parts of the first field, then of the second.
    fn together(lines: [&mut [Lanes]; 4], places: &[u32], block: usize, re: &mut [Lanes], im: &mut [Lanes]) {
        let ny = places.len();
        let mut waves = [[NOTHING; LANES]; 4];
        for (waves, lines) in waves.iter_mut().zip(lines) {
            for (i, line) in lines.iter().enumerate() {
                for (k, wave) in waves.iter_mut().enumerate() {
                    wave[i] = line[k];
                }
            }
        }
        for (ky, k) in (block * LANES..=ny / 2).zip(0..LANES) {
            let (at, mirror) = (places[ky] as usize, places[(ny - ky) % ny] as usize);
            let (mut z, mut z_mirror) = ([NOTHING; 2], [NOTHING; 2]);
            for i in 0..LANES {
                let [f_re, f_im, g_re, g_im] = [waves[0][k][i], waves[1][k][i], waves[2][k][i], waves[3][k][i]];
                (z[0][i], z[1][i]) = (f_re - g_im, f_im + g_re);
                (z_mirror[0][i], z_mirror[1][i]) = (f_re + g_im, g_re - f_im);
            }
            [re[mirror], im[mirror]] = z_mirror;
            [re[at], im[at]] = z; // of 0 and ny / 2, which are their own mirrors, the valid one
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::pixels::wide::{Vectors, with_vectors};

    const STRIDE: usize = 29;
    const HEIGHT: usize = 20;

    /// Pseudo-random numbers.
    fn field() -> Vec<Complex64> {
        let level = |i: usize| libm::sin(1e4 * (i as f64 + 0.5));
        (0..STRIDE * HEIGHT).map(|i| Complex64::new(level(2 * i), level(2 * i + 1))).collect()
    }

    /// Regions of every width up to two blocks and a half, anywhere in the window.
    fn areas() -> impl Iterator<Item = Area> {
        (1..=20).map(|width| {
            let window = Region { column: 3, row: 2, width_cells: width + width % 3, height_cells: 14 };
            let data = Region { column: 3 + width % 3, row: 3, width_cells: width, height_cells: 9 };
            Area { window, data }
        })
    }

    /// Forward and inverse: the data at their positions, nothing around them, times the number of points and the two of
    /// the lines.
    #[test]
    fn fields_come_back_whatever_their_width() {
        let (field, mut transform) = (field(), Transform::new(24, 18));
        let scalars: Vec<f64> = field.iter().map(|z| z.re).collect();
        for area in areas() {
            let (mut waves, mut lines) = (Rows::zeros(24), [(); 3].map(|()| transform.lines(24)));
            let [x, y, z] = &mut lines;
            transform.lines_of_vectors(&field, STRIDE, area, [x, y]);
            transform.lines_of_scalars(&scalars, STRIDE, area, z);
            for lines in &mut lines {
                for block in 0..transform.blocks_count() {
                    transform.waves(lines, block, area, &mut waves);
                    transform.lines_of_waves(&mut waves, block, area.window, lines);
                }
            }
            let (mut vectors, mut depths) = (vec![Complex64::ZERO; field.len()], vec![0.0; field.len()]);
            let [x, y, z] = &mut lines;
            transform.vectors([x, y], area.window, STRIDE, &mut vectors);
            transform.scalars(z, area.window, STRIDE, &mut depths);
            for i in 0..field.len() {
                let here = if area.data.contains(i, STRIDE) { field[i] * (2.0 * 24.0 * 18.0) } else { Complex64::ZERO };
                let (missed, deeper) = (vectors[i] - here, depths[i] - here.re);
                assert!(
                    missed.norm_sqr().sqrt() < 1e-11 && deeper.abs() < 1e-11,
                    "{area:?}, cell {i}: {missed} {deeper}"
                );
            }
        }
    }

    /// One wave each: cosines of a vector's components are at their positions, also in both halves of a scalar field.
    #[test]
    fn a_wave_stands_at_its_place() {
        let (nx, ny, tau) = (24, 18, std::f64::consts::TAU);
        let mut transform = Transform::new(nx, ny);
        let whole = Area::all_of(Region { column: 0, row: 0, width_cells: nx, height_cells: ny });
        for (kx, ky) in [(0, 0), (1, 0), (5, 2), (23, 3), (12, 4), (7, 8), (2, 9), (12, 9)] {
            let phase =
                |i: usize| tau * ((kx * (i % nx) * ny + ky * (i / nx) * nx) % (nx * ny)) as f64 / (nx * ny) as f64;
            let field: Vec<f64> = (0..nx * ny).map(|i| libm::cos(phase(i))).collect();
            let (mut lines, mut waves) = (transform.lines(nx), Rows::zeros(nx));
            transform.lines_of_scalars(&field, nx, whole, &mut lines);
            for block in 0..transform.blocks_count() {
                transform.waves(&mut lines, block, whole, &mut waves);
                for (x, lane) in (0..nx).flat_map(|x| (0..LANES).map(move |lane| (x, lane))) {
                    let (y, at) = (block * LANES + lane, transform.place(x));
                    let own = y <= ny / 2 && [(kx, ky), ((nx - kx) % nx, (ny - ky) % ny)].contains(&(x, y));
                    // Half of it here and half at its mirror, unless it is its own mirror.
                    let mirrored = 2 * kx % nx == 0 && 2 * ky % ny == 0;
                    let expected = if own { (if mirrored { 2.0 } else { 1.0 }) * (nx * ny) as f64 } else { 0.0 };
                    let [re, im] = waves.parts().map(|part| part[at][lane]);
                    assert!((re - expected).abs() < 1e-11 && im.abs() < 1e-11, "{kx} {ky} at {x} {y}: {re} {im}");
                }
            }
        }
    }

    #[test]
    fn vectors_of_any_width_give_the_same_bits() {
        let field = field();
        let bits = || -> Vec<u64> {
            let (mut transform, area) = (Transform::new(24, 18), areas().nth(18).expect("a wide one"));
            let mut lines = [(); 2].map(|()| transform.lines(24));
            let [x, y] = &mut lines;
            transform.lines_of_vectors(&field, STRIDE, area, [x, y]);
            let mut back = vec![Complex64::ZERO; field.len()];
            transform.vectors([x, y], area.window, STRIDE, &mut back);
            lines
                .iter()
                .flat_map(|lines| lines.rows.parts())
                .flatten()
                .flatten()
                .copied()
                .chain(back.iter().flat_map(|z| [z.re, z.im]))
                .map(f64::to_bits)
                .collect()
        };
        let widest = bits();
        for narrower in [Vectors::Avx2, Vectors::Baseline] {
            assert!(widest == with_vectors(narrower, bits), "{narrower:?}");
        }
    }
}
