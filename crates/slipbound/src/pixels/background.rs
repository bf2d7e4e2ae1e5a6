//! Grey image -> its wide smooth, fast: an approximate Gaussian, for illumination that varies slowly.
//!
//! ```text
//!   src --mean of 4x4 or 8x8--> tiles --3 boxes along rows, 3 along columns--> tiles --bilinear--> out
//! ```
//! The box widths are chosen so that all steps together have the variance of the requested Gaussian.

use super::border::{reflect, reflect_101};
use super::wide::wide;
use crate::image::SizePx;

/// Fixed-point resolution of the tiles: fractions of a level.
const TILE_FRACTIONS: u32 = 64;
/// Box passes along each axis; three bring a box within a few per cent of a Gaussian.
const BOXES: usize = 3;

/// Maximum radius of a box, in tiles: for a Gaussian of some 250 px.
const MOST_RADIUS: usize = 31;

/// The scratch memory of the wide smooth.
#[derive(Debug, Clone)]
pub struct Background {
    size: SizePx,
    /// Side of a tile: 4 or 8.
    tile_px: usize,
    tiles: SizePx,
    box_radii: [usize; BOXES],
    /// Column sums over the rows of a tile, padded to whole tiles.
    column_sums: Vec<u16>,
    /// Levels of the tiles in 64ths.
    levels: Vec<u16>,
    levels_next: Vec<u16>,
    box_sums: Vec<u32>,
    /// Two rows of tiles, widened to pixels, in 16ths of a level.
    wide_rows: [Vec<u16>; 2],
}

impl Background {
    /// Scratch memory for images of `size`; approximates a Gaussian of `sigma_px`, which should be 8 px or more (below
    /// 6 px the smooth no longer shrinks with it, above 250 px it no longer grows).
    pub fn new(size: SizePx, sigma_px: f64) -> Self {
        // Wide tiles are twice as fast; below sigma 20 the steps of the boxes become visible. In bench/parity the
        // result is within 4 levels of the Gaussian everywhere, and within 1.2 in the mean of any frame.
        let tile_px = if sigma_px >= 20.0 { 8 } else { 4 };
        let tiles = SizePx::new(size.width.div_ceil(tile_px), size.height.div_ceil(tile_px));
        let box_radii = box_radii(sigma_px / tile_px as f64);
        Background {
            size,
            tile_px,
            tiles,
            box_radii,
            column_sums: vec![0; tiles.width * tile_px],
            levels: vec![0; tiles.area()],
            levels_next: vec![0; tiles.area()],
            box_sums: vec![0; tiles.width.max(tiles.height)],
            wide_rows: [vec![0; tiles.width * tile_px], vec![0; tiles.width * tile_px]],
        }
    }

    /// Smooths `src` into `out`, rows without a gap in both.
    pub fn apply(&mut self, src: &[u8], out: &mut [u8]) {
        assert_eq!(src.len(), self.size.area(), "source of another size");
        assert_eq!(out.len(), self.size.area(), "output of another size");
        if self.tile_px == 8 { self.apply_tiles::<8>(src, out) } else { self.apply_tiles::<4>(src, out) }
    }

    fn apply_tiles<const TILE: usize>(&mut self, src: &[u8], out: &mut [u8]) {
        self.shrink::<TILE>(src);
        self.smooth_rows();
        self.smooth_columns();
        self.grow::<TILE>(out);
    }

    fn shrink<const TILE: usize>(&mut self, src: &[u8]) {
        let SizePx { width, height } = self.size;
        for (ty, levels) in self.levels.chunks_exact_mut(self.tiles.width).enumerate() {
            let rows: [&[u8]; TILE] =
                std::array::from_fn(|j| &src[reflect_101((ty * TILE + j) as isize, height) * width..][..width]);
            sum_rows(rows, &mut self.column_sums[..width]);
            for x in width..self.column_sums.len() {
                self.column_sums[x] = self.column_sums[reflect_101(x as isize, width)];
            }
            let scale = (TILE_FRACTIONS as usize / (TILE * TILE)) as u16;
            sum_tiles::<TILE>(&self.column_sums, scale, levels);
        }
    }

    /// Row boxes are computed as column boxes of the transposed image: many sums in parallel instead of one after the
    /// other.
    fn smooth_rows(&mut self) {
        let SizePx { width, height } = self.tiles;
        transpose(&self.levels, width, &mut self.levels_next);
        std::mem::swap(&mut self.levels, &mut self.levels_next);
        self.smooth_down(height, width);
        transpose(&self.levels, height, &mut self.levels_next);
        std::mem::swap(&mut self.levels, &mut self.levels_next);
    }

    fn smooth_columns(&mut self) {
        self.smooth_down(self.tiles.width, self.tiles.height);
    }

    /// Smooths levels of `n` columns and `height` rows along the columns.
    fn smooth_down(&mut self, n: usize, height: usize) {
        let sums = &mut self.box_sums[..n];
        for radius in self.box_radii {
            let row = |y: isize| &self.levels[reflect(y, height) * n..][..n];
            let r = radius as isize;
            sums.fill(0);
            (-r..=r).for_each(|y| add_levels(row(y), sums));
            for (y, out) in self.levels_next.chunks_exact_mut(n).enumerate() {
                let y = y as isize;
                box_columns(sums, row(y - r), row(y + r + 1), inverse(radius), out);
            }
            std::mem::swap(&mut self.levels, &mut self.levels_next);
        }
    }

    fn grow<const TILE: usize>(&mut self, out: &mut [u8]) {
        let (n, width) = (self.tiles.width, self.size.width);
        let [above, below] = &mut self.wide_rows;
        widen::<TILE>(&self.levels[..n], above);
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            // Row y lies between the middles of two rows of tiles; before the first and after the last there is only
            // one.
            let ty = (y + TILE / 2) / TILE;
            let within = (y + TILE / 2) % TILE;
            if within == 0 || y == 0 {
                if y > 0 {
                    std::mem::swap(above, below);
                }
                let next = ty.min(self.tiles.height - 1);
                widen::<TILE>(&self.levels[next * n..][..n], below);
            }
            let weight = (2 * within + 1) * 8 / TILE;
            between(&above[..width], &below[..width], weight as u16, out);
        }
    }
}

/// Radii of three boxes whose variance, with that of the tiles and of the bilinear upsampling, is `sigma_tiles`
/// squared.
fn box_radii(sigma_tiles: f64) -> [usize; BOXES] {
    // In tiles squared: 1/12 for the mean over a tile, 1/6 for the triangle kernel of the upsampling.
    let wanted = (sigma_tiles * sigma_tiles - 0.25).max(0.0);
    let variance = |radius: usize| (radius * (radius + 1)) as f64 / 3.0;
    let mut radii = [0; BOXES];
    // Widen one box after the other while that brings the sum nearer; the last stays the widest.
    'widen: loop {
        if radii[0] == MOST_RADIUS {
            break radii;
        }
        for i in (0..BOXES).rev() {
            if radii[i] == MOST_RADIUS {
                continue;
            }
            let now: f64 = radii.iter().map(|&r| variance(r)).sum();
            let gain = variance(radii[i] + 1) - variance(radii[i]);
            if now + gain / 2.0 > wanted {
                break 'widen radii;
            }
            radii[i] += 1;
        }
    }
}

/// 1 / (2 radius + 1) in 2^-24.
fn inverse(radius: usize) -> u32 {
    let width = 2 * radius as u32 + 1;
    ((1 << 24) + width / 2) / width
}

/// A sum over a box -> its mean, rounded. The product of the sum and `inverse`, in 2^-24, is computed from the upper
/// bits and the lower twelve bits of `inverse`; both products fit 32 bits up to [`MOST_RADIUS`].
#[inline(always)]
fn mean_level(sum: u32, inverse: u32) -> u16 {
    ((sum * (inverse >> 12) + ((sum * (inverse & 0xfff) + (1 << 23)) >> 12)) >> 12) as u16
}

/// Transposes, in square blocks as far as they fit.
fn transpose(levels: &[u16], width: usize, out: &mut [u16]) {
    const SIDE: usize = 8;
    let height = levels.len() / width.max(1);
    let (right, bottom) = (width - width % SIDE, height - height % SIDE);
    for top in (0..bottom).step_by(SIDE) {
        for left in (0..right).step_by(SIDE) {
            let mut square = [[0; SIDE]; SIDE];
            for (y, row) in square.iter_mut().enumerate() {
                row.copy_from_slice(&levels[(top + y) * width + left..][..SIDE]);
            }
            for x in 0..SIDE {
                out[(left + x) * height + top..][..SIDE].copy_from_slice(&square.map(|row| row[x]));
            }
        }
    }
    for y in 0..height {
        for x in if y < bottom { right } else { 0 }..width {
            out[x * height + y] = levels[y * width + x];
        }
    }
}

wide! {
    fn sum_rows<const TILE: usize>(rows: [&[u8]; TILE], out: &mut [u16]) {
        let n = out.len();
        let rows = rows.map(|r| &r[..n]);
        for (i, out) in out.iter_mut().enumerate() {
            let mut sum = 0;
            for row in rows {
                sum += u16::from(row[i]);
            }
            *out = sum;
        }
    }

    /// Sums of columns -> levels of tiles, in units of `scale` a level.
    fn sum_tiles<const TILE: usize>(columns: &[u16], scale: u16, levels: &mut [u16]) {
        for (level, columns) in levels.iter_mut().zip(columns.as_chunks::<TILE>().0) {
            let mut sum = 0;
            for column in columns {
                sum += column;
            }
            *level = sum * scale;
        }
    }

    fn add_levels(levels: &[u16], sums: &mut [u32]) {
        sums.iter_mut().zip(levels).for_each(|(sum, &level)| *sum += u32::from(level));
    }
}

wide! {
    fn box_columns(sums: &mut [u32], leaves: &[u16], enters: &[u16], inverse: u32, out: &mut [u16]) {
        for (((sum, out), &leaves), &enters) in sums.iter_mut().zip(out).zip(leaves).zip(enters) {
            *out = mean_level(*sum, inverse);
            *sum = *sum + u32::from(enters) - u32::from(leaves);
        }
    }
}

/// A row of tiles in 64ths of a level -> a row of pixels in 16ths.
fn widen<const TILE: usize>(tiles: &[u16], out: &mut [u16]) {
    let sixteenths = |level: u16| (level + 2) >> 2;
    let (half, n) = (TILE / 2, out.len());
    out[..half].fill(sixteenths(tiles[0]));
    out[n - half..].fill(sixteenths(tiles[tiles.len() - 1]));
    for (pair, out) in tiles.windows(2).zip(out[half..].as_chunks_mut::<TILE>().0) {
        let (left, right) = (sixteenths(pair[0]), sixteenths(pair[1]));
        for (j, out) in out.iter_mut().enumerate() {
            let weight = ((2 * j + 1) * 8 / TILE) as u16; // of 16
            *out = (left * (16 - weight) + right * weight + 8) >> 4;
        }
    }
}

wide! {
    /// Two rows in 16ths of a level -> the row `weight` 16ths of the way from the first to the second.
    fn between(above: &[u16], below: &[u16], weight: u16, out: &mut [u8]) {
        for ((out, &above), &below) in out.iter_mut().zip(above).zip(below) {
            *out = ((above * (16 - weight) + below * weight + 128) >> 8) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_picture_stays_and_sizes_need_not_divide() {
        for (width, height) in [(64, 48), (101, 67), (9, 5), (1, 1)] {
            for (sigma_px, level) in [(8.0, 0), (20.0, 137), (60.0, 255)] {
                let size = SizePx::new(width, height);
                let mut out = vec![1; size.area()];
                Background::new(size, sigma_px).apply(&vec![level; size.area()], &mut out);
                assert!(out.iter().all(|&v| v == level), "{size}, sigma {sigma_px}, level {level}: {out:?}");
            }
        }
    }

    #[test]
    fn a_picture_laid_on_its_side_has_its_background_laid_on_its_side() {
        for (width, height, sigma) in [(67, 131, 9.0), (160, 96, 15.0), (215, 170, 24.0)] {
            let level = |x: usize, y: usize| ((x * x / 7 + 3 * y + x * y / 31) % 200) as u8;
            let upright: Vec<u8> = (0..width * height).map(|i| level(i % width, i / width)).collect();
            let laid: Vec<u8> = (0..width * height).map(|i| level(i / height, i % height)).collect();
            let smooth = |size: SizePx, picture: &[u8]| {
                let mut out = vec![0; size.area()];
                Background::new(size, sigma).apply(picture, &mut out);
                out
            };
            let (upright, laid) =
                (smooth(SizePx::new(width, height), &upright), smooth(SizePx::new(height, width), &laid));
            for i in 0..width * height {
                // Sums are rounded after each pass; the order of the axes differs.
                let (a, b) = (upright[i], laid[i % width * height + i / width]);
                assert!(a.abs_diff(b) <= 1, "{width} x {height}, {i}: {a} and {b}");
            }
            assert!(upright.iter().max() > upright.iter().min());
        }
    }

    #[test]
    fn means_over_boxes_are_rounded_as_in_whole_numbers_of_any_size() {
        let most_level = 255 * TILE_FRACTIONS;
        for radius in 0..=MOST_RADIUS {
            let most = (2 * radius as u32 + 1) * most_level;
            for i in 0..1000 {
                let sum = (u64::from(most) * i / 999) as u32;
                let wanted = (u64::from(sum) * u64::from(inverse(radius)) + (1 << 23)) >> 24;
                assert_eq!(u64::from(mean_level(sum, inverse(radius))), wanted, "{sum} over a box of {radius}");
            }
            assert_eq!(u32::from(mean_level(most, inverse(radius))), most_level);
        }
    }

    #[test]
    fn boxes_have_the_variance_asked_for_up_to_the_widest() {
        let variance = |radii: [usize; BOXES]| radii.map(|r| (r * (r + 1)) as f64 / 3.0).iter().sum::<f64>() + 0.25;
        for sigma_tiles in [1.0, 2.0, 5.0, 12.0, 25.0] {
            let got = variance(box_radii(sigma_tiles)).sqrt();
            assert!((got - sigma_tiles).abs() < 0.35, "{got} for {sigma_tiles}");
        }
        assert_eq!(box_radii(100.0), [MOST_RADIUS; BOXES]);
    }

    #[test]
    fn a_slope_stays_away_from_the_borders() {
        let size = SizePx::new(240, 200);
        let src: Vec<u8> = (0..size.area()).map(|i| ((3 * (i % 240) + 5 * (i / 240)) / 8) as u8).collect();
        let mut out = vec![0; size.area()];
        for sigma_px in [16.0, 20.0] {
            Background::new(size, sigma_px).apply(&src, &mut out);
            let mut sum = 0;
            for y in 70..130 {
                for x in 70..170 {
                    let (got, expected) = (i32::from(out[y * 240 + x]), i32::from(src[y * 240 + x]));
                    assert!((got - expected).abs() <= 1, "({x}, {y}): {got}, expected {expected}");
                    sum += got - expected;
                }
            }
            let mean = f64::from(sum) / 6000.0;
            assert!(mean.abs() < 0.05, "sigma {sigma_px}: {mean} levels off in the mean, a shift of the picture");
        }
    }

    #[test]
    fn a_step_is_smoothed_as_by_the_gaussian() {
        for sigma_px in [8.0, 15.2, 30.0, 60.0] {
            let size = SizePx::new(512, 16);
            let src: Vec<u8> = (0..size.area()).map(|i| if i % 512 < 256 { 20 } else { 220 }).collect();
            let mut out = vec![0; size.area()];
            Background::new(size, sigma_px).apply(&src, &mut out);
            for x in 150..362 {
                let t = (x as f64 - 255.5) / (sigma_px * 2f64.sqrt());
                let expected = 120.0 + 100.0 * libm::erf(t);
                let error = (f64::from(out[8 * 512 + x]) - expected).abs();
                assert!(error < 5.0, "sigma {sigma_px}, column {x}: {} for {expected}", out[8 * 512 + x]);
            }
        }
    }
}
