//! Grey image -> its Gaussian smooth, exact: every tap of the kernel is summed.
//!
//! ```text
//!   src row --mirrored ends--> along x, f32 --> the last kernel-height rows --> along y --> out
//! ```
//! Sums are f32, the middle tap first, then pairs outwards: the same bits everywhere. Beyond the border the image is
//! mirrored about the centres of its border pixels. For a smooth much wider than its details, `background` is faster.

use super::border::reflect_101;
use super::wide::wide;
use crate::image::SizePx;

/// Pixels summed side by side.
const BLOCK: usize = 16;

/// Kernels and scratch memory of a Gaussian smooth.
#[derive(Debug, Clone)]
pub struct Gaussian {
    size: SizePx,
    /// Taps from the middle outwards, along x and along y.
    taps_x: Vec<f32>,
    taps_y: Vec<f32>,
    /// A source row with its mirrored ends.
    padded: Vec<f32>,
    /// Rows smoothed along x, by row number modulo the number held.
    rows: Vec<f32>,
    rows_held: usize,
    /// Where in `rows` the rows above and below the output row start, from the middle outwards.
    pairs: Vec<[usize; 2]>,
    row: Vec<f32>,
}

impl Gaussian {
    /// For images of `size`: a kernel of `kernel_px` (width, height; odd) cut out of a Gaussian of `sigma_px` and
    /// normalised to sum 1. Panics for an even side or a sigma that is not positive.
    pub fn new(size: SizePx, kernel_px: [usize; 2], sigma_px: f64) -> Self {
        let [taps_x, taps_y] = kernel_px.map(|side| taps(side, sigma_px));
        let width = size.width.next_multiple_of(BLOCK);
        let rows_held = kernel_px[1].min(size.height);
        Gaussian {
            size,
            padded: vec![0.0; width + kernel_px[0] - 1],
            rows: vec![0.0; width * rows_held],
            rows_held,
            pairs: vec![[0; 2]; taps_y.len() - 1],
            row: vec![0.0; width],
            taps_x,
            taps_y,
        }
    }

    /// Smooths into fractions of a level. Rows follow each other without a gap in both.
    pub fn to_f32(&mut self, src: &[u8], out: &mut [f32]) {
        assert_eq!(out.len(), self.size.area(), "output of another size");
        self.each_row(src, |y, row| out[y * row.len()..][..row.len()].copy_from_slice(row));
    }

    /// Smooths into whole levels, rounded to the nearest. The method does not need it; the comparison with other
    /// implementations does (`examples/parity.rs`).
    pub fn to_u8(&mut self, src: &[u8], out: &mut [u8]) {
        assert_eq!(out.len(), self.size.area(), "output of another size");
        self.each_row(src, |y, row| {
            for (out, &level) in out[y * row.len()..][..row.len()].iter_mut().zip(row) {
                // 1.5 * 2^23: added to a small number, it leaves that number, rounded, in the lowest bits.
                *out = (level + 12_582_912.0).to_bits() as u8;
            }
        });
    }

    fn each_row(&mut self, src: &[u8], mut emit: impl FnMut(usize, &[f32])) {
        assert_eq!(src.len(), self.size.area(), "source of another size");
        let SizePx { width, height } = self.size;
        let (stride, below) = (self.row.len(), self.taps_y.len() - 1);
        let mut done = 0;
        for y in 0..height {
            while done < height.min(y + below + 1) {
                let held = &mut self.rows[done % self.rows_held * stride..][..stride];
                pad(&src[done * width..][..width], self.taps_x.len() - 1, &mut self.padded);
                smooth_along(&self.padded, &self.taps_x, held);
                done += 1;
            }
            let start = |y: isize| reflect_101(y, height) % self.rows_held * stride;
            for (pair, away) in self.pairs.iter_mut().zip(1..) {
                *pair = [start(y as isize - away), start(y as isize + away)];
            }
            smooth_across(&self.rows, start(y as isize), &self.pairs, &self.taps_y, &mut self.row);
            emit(y, &self.row[..width]);
        }
    }
}

/// The upper half of the kernel, the middle tap first.
fn taps(side_px: usize, sigma_px: f64) -> Vec<f32> {
    assert!(side_px % 2 == 1, "kernel side of {side_px} px: expected an odd number");
    assert!(sigma_px > 0.0, "sigma of {sigma_px} px: expected more than 0");
    let exact: Vec<f64> =
        (0..=side_px / 2).map(|i| libm::exp(-((i * i) as f64) / (2.0 * sigma_px * sigma_px))).collect();
    let sum = 2.0 * exact.iter().sum::<f64>() - exact[0];
    exact.iter().map(|tap| (tap / sum) as f32).collect()
}

/// `padded` holds the row from column -radius on.
fn pad(row: &[u8], radius: usize, padded: &mut [f32]) {
    for (out, &level) in padded[radius..].iter_mut().zip(row) {
        *out = f32::from(level);
    }
    for i in 0..radius {
        padded[radius - 1 - i] = f32::from(row[reflect_101(-1 - i as isize, row.len())]);
        padded[radius + row.len() + i] = f32::from(row[reflect_101((row.len() + i) as isize, row.len())]);
    }
}

wide! {
    fn smooth_along(padded: &[f32], taps: &[f32], out: &mut [f32]) {
        let radius = taps.len() - 1;
        for (i, out) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let span = &padded[i * BLOCK..][..BLOCK + 2 * radius];
            let mut sum = [0.0; BLOCK];
            add(&mut sum, taps[0], block(span, radius));
            for (k, &tap) in taps.iter().enumerate().skip(1) {
                add_pair(&mut sum, tap, block(span, radius - k), block(span, radius + k));
            }
            *out = sum;
        }
    }

    fn smooth_across(rows: &[f32], middle: usize, pairs: &[[usize; 2]], taps: &[f32], out: &mut [f32]) {
        for (i, out) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let x = i * BLOCK;
            let mut sum = [0.0; BLOCK];
            add(&mut sum, taps[0], block(rows, middle + x));
            for (&tap, &[above, below]) in taps[1..].iter().zip(pairs) {
                add_pair(&mut sum, tap, block(rows, above + x), block(rows, below + x));
            }
            *out = sum;
        }
    }
}

#[inline(always)]
fn block(values: &[f32], at: usize) -> &[f32; BLOCK] {
    values[at..].first_chunk().expect("a block fits")
}

#[inline(always)]
fn add(sum: &mut [f32; BLOCK], tap: f32, values: &[f32; BLOCK]) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum += tap * value;
    }
}

#[inline(always)]
fn add_pair(sum: &mut [f32; BLOCK], tap: f32, before: &[f32; BLOCK], after: &[f32; BLOCK]) {
    for ((sum, before), after) in sum.iter_mut().zip(before).zip(after) {
        *sum += tap * (before + after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive(src: &[u8], size: SizePx, [kx, ky]: [usize; 2], sigma_px: f64) -> Vec<f64> {
        let weight = |side: usize| {
            let w: Vec<f64> = (0..side)
                .map(|i| {
                    let d = (i as f64 - (side / 2) as f64) / sigma_px;
                    (-d * d / 2.0).exp()
                })
                .collect();
            let sum: f64 = w.iter().sum();
            w.into_iter().map(|v| v / sum).collect::<Vec<f64>>()
        };
        let (wx, wy) = (weight(kx), weight(ky));
        let mut out = Vec::new();
        for y in 0..size.height as isize {
            for x in 0..size.width as isize {
                let mut sum = 0.0;
                for (j, wy) in wy.iter().enumerate() {
                    let sy = reflect_101(y + j as isize - (ky / 2) as isize, size.height);
                    for (i, wx) in wx.iter().enumerate() {
                        let sx = reflect_101(x + i as isize - (kx / 2) as isize, size.width);
                        sum += wy * wx * f64::from(src[sy * size.width + sx]);
                    }
                }
                out.push(sum);
            }
        }
        out
    }

    #[test]
    fn a_flat_picture_stays() {
        let size = SizePx::new(37, 21);
        let mut out = vec![0; size.area()];
        Gaussian::new(size, [25, 15], 21.0).to_u8(&[255; 37 * 21], &mut out);
        assert!(out.iter().all(|&v| v == 255));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn equals_the_sum_over_the_whole_kernel(
            width in 1usize..50, height in 1usize..40, half_x in 0usize..16, half_y in 0usize..16,
            sigma_px in 0.5f64..40.0, seed: u32
        ) {
            let size = SizePx::new(width, height);
            let src: Vec<u8> =
                (0..size.area() as u32).map(|i| (i.wrapping_add(seed).wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            let kernel_px = [2 * half_x + 1, 2 * half_y + 1];
            let mut gaussian = Gaussian::new(size, kernel_px, sigma_px);
            let (mut fractions, mut whole) = (vec![0.0; size.area()], vec![0; size.area()]);
            gaussian.to_f32(&src, &mut fractions);
            gaussian.to_u8(&src, &mut whole);
            for ((&f, &w), &exact) in fractions.iter().zip(&whole).zip(&naive(&src, size, kernel_px, sigma_px)) {
                prop_assert!((f64::from(f) - exact).abs() < 1e-3, "{} for {}", f, exact);
                prop_assert!((f64::from(w) - exact).abs() < 0.501, "{} for {}", w, exact);
            }
        }
    }
}
