//! Grey image -> decimated image -> contrast of core against ring about every decimated pixel.

use crate::image::SizePx;
use crate::pixels::wide::wide;
use crate::sensor::Polarity;

/// Half width of the core in dot diameters: the core lies inside the dot, also beside its exact centre.
const CORE_HALF_FRACTION: f64 = 0.4;
/// Decimated values have two more bits than grey levels.
pub(super) const STEPS_PER_LEVEL: i32 = 4;

/// Number of decimated pixels that are processed in parallel.
pub(super) const PLACES: usize = 32;

/// Number of decimated values whose sum fits 16 bits; no square is wider.
const MOST_SIDE: usize = u16::MAX as usize / (255 * STEPS_PER_LEVEL as usize);

/// A square of decimated pixels.
#[derive(Debug, Clone, Copy)]
struct Square {
    side: usize,
}

impl Square {
    fn area(self) -> i32 {
        (self.side * self.side) as i32
    }
}

/// Contrast of dots of one size, of a decimated image; owns all scratch memory.
#[derive(Debug, Clone)]
pub(super) struct Response {
    size: SizePx,
    /// Logarithm to base 2 of the decimation.
    pub shift: usize,
    /// The decimated size.
    pub small: SizePx,
    core_half: usize,
    ring_half: usize,
    is_dark: bool,
    row_sums: Vec<u16>,
    padded: Vec<u16>,
    /// Column sums of the padded image, over the height of core plus ring and over that of the core; zeros after them.
    all_columns: Vec<u16>,
    core_columns: Vec<u16>,
    /// Sums of 2, 4, 8, .. neighbouring columns, and sums over the width of the squares.
    powers: Vec<Vec<u16>>,
    all_sums: Vec<i32>,
    core_sums: Vec<i32>,
    /// Row length of `values`, a multiple of [`PLACES`]; values beyond the image are meaningless.
    pub stride: usize,
    pub values: Vec<i32>,
}

impl Response {
    pub fn new(size: SizePx, diameter_px: f64, pitch_px: f64, polarity: Polarity) -> Self {
        let shift = (0..3).rev().find(|s| diameter_px / f64::from(1 << s) >= 3.0).unwrap_or(0);
        let small = SizePx::new(size.width >> shift, size.height >> shift);
        let scale = f64::from(1u32 << shift);
        let core_half = ((diameter_px / scale * CORE_HALF_FRACTION).round() as usize).max(1);
        let widest = ((pitch_px - diameter_px / 2.0) / scale).floor().max(1.0) as usize;
        let ring_half = (2 * core_half + 1).min(widest).max(core_half + 1);
        let padded = SizePx::new(small.width + 2 * ring_half, small.height + 2 * ring_half);
        assert!(2 * ring_half < MOST_SIDE, "dots of {diameter_px} px: too large to be summed");
        // The last block of a row reads one block further.
        let stride = small.width.next_multiple_of(PLACES) + PLACES;
        Response {
            size,
            shift,
            small,
            core_half,
            ring_half,
            is_dark: polarity == Polarity::Dark,
            row_sums: vec![0; size.width],
            padded: vec![0; padded.area()],
            all_columns: vec![0; stride + MOST_SIDE],
            core_columns: vec![0; stride + MOST_SIDE],
            powers: (0..MOST_SIDE.ilog2()).map(|_| vec![0; stride + MOST_SIDE]).collect(),
            all_sums: vec![0; stride],
            core_sums: vec![0; stride],
            stride,
            values: vec![0; stride * small.height],
        }
    }

    /// Computes `values`. `grey` holds the rows without gaps.
    pub fn run(&mut self, grey: &[u8]) {
        assert_eq!(grey.len(), self.size.area(), "grey image of another size");
        self.decimate(grey);
        self.respond();
    }

    /// What a contrast of one grey level is in `values`.
    pub fn unit(&self) -> f32 {
        let (all, core) = self.squares();
        let (all_area, core_area) = (all.area(), core.area());
        // core * all - all * core = contrast * core_area * ring_area, with ring_area = all_area - core_area
        (STEPS_PER_LEVEL * core_area * (all_area - core_area)) as f32
    }

    fn decimate(&mut self, grey: &[u8]) {
        let (n, pad) = (1usize << self.shift, self.ring_half);
        let width = self.small.width + 2 * pad;
        let flip = if self.is_dark { 255 * STEPS_PER_LEVEL as u16 } else { 0 };
        for y in 0..self.small.height {
            let row = |i: usize| &grey[((y << self.shift) + i.min(n - 1)) * self.size.width..][..self.size.width];
            let out = &mut self.padded[(y + pad) * width..][..width];
            let small = &mut out[pad..pad + self.small.width];
            match self.shift {
                0 => small.iter_mut().zip(row(0)).for_each(|(o, &v)| *o = (4 * u16::from(v)).abs_diff(flip)),
                1 => decimate_by_2(row(0), row(1), flip, small),
                _ => {
                    let sums = &mut self.row_sums[..self.small.width << self.shift];
                    sums.fill(0);
                    (0..n).for_each(|i| add_bytes(row(i), sums));
                    let fours = small.iter_mut().zip(sums.as_chunks::<4>().0);
                    fours.for_each(|(o, s)| *o = ((s[0] + s[1] + s[2] + s[3]) / 4).abs_diff(flip));
                }
            }
            let (first, last) = (out[pad], out[pad + self.small.width - 1]);
            out[..pad].fill(first);
            out[pad + self.small.width..].fill(last);
        }
        for y in 0..pad {
            self.padded.copy_within(pad * width..(pad + 1) * width, y * width);
            let bottom = pad + self.small.height;
            self.padded.copy_within((bottom - 1) * width..bottom * width, (bottom + y) * width);
        }
    }

    /// response = core sum * ring area - ring sum * core area: a contrast times both areas.
    fn respond(&mut self) {
        let (c, r, width) = (self.core_half, self.ring_half, self.small.width + 2 * self.ring_half);
        let (all, core) = self.squares();
        let padded = &self.padded;
        let row = |y: usize| &padded[y * width..][..width];
        self.all_columns.fill(0);
        self.core_columns.fill(0);
        (0..all.side).for_each(|y| add_row(row(y), &mut self.all_columns));
        (r - c..r - c + core.side).for_each(|y| add_row(row(y), &mut self.core_columns));
        for (y, out) in self.values.chunks_exact_mut(self.stride).enumerate() {
            if y > 0 {
                exchange_row(row(y + all.side - 1), row(y - 1), &mut self.all_columns);
                exchange_row(row(y + r - c + core.side - 1), row(y + r - c - 1), &mut self.core_columns);
            }
            sum_along(&self.all_columns, all.side, &mut self.powers, &mut self.all_sums);
            sum_along(&self.core_columns[r - c..], core.side, &mut self.powers, &mut self.core_sums);
            contrast(&self.all_sums, &self.core_sums, core.area(), all.area(), out);
        }
    }

    /// Core plus ring, and the core.
    fn squares(&self) -> (Square, Square) {
        (Square { side: 2 * self.ring_half + 1 }, Square { side: 2 * self.core_half + 1 })
    }
}

wide! {
    fn add_bytes(row: &[u8], sums: &mut [u16]) {
        sums.iter_mut().zip(row).for_each(|(sum, &v)| *sum += u16::from(v));
    }

    /// Sums of 2 x 2 pixels, or their difference to `flip`.
    fn decimate_by_2(above: &[u8], below: &[u8], flip: u16, out: &mut [u16]) {
        let pairs = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
        for (out, (a, b)) in out.iter_mut().zip(pairs) {
            // Left and right byte of a pair, split as halves of one number.
            let (a, b) = (u16::from_le_bytes(*a), u16::from_le_bytes(*b));
            *out = ((a & 255) + (a >> 8) + (b & 255) + (b >> 8)).abs_diff(flip);
        }
    }

    fn add_row(row: &[u16], columns: &mut [u16]) {
        columns.iter_mut().zip(row).for_each(|(sum, &v)| *sum += v);
    }

    fn exchange_row(enters: &[u16], leaves: &[u16], columns: &mut [u16]) {
        let rows = enters.iter().zip(leaves);
        columns.iter_mut().zip(rows).for_each(|(sum, (&enters, &leaves))| *sum = sum.wrapping_add(enters).wrapping_sub(leaves));
    }

    /// Adds pairs of values that are `away` apart.
    fn add_away(of: &[u16], away: usize, sums: &mut [u16]) {
        for ((sum, &a), &b) in sums.iter_mut().zip(of).zip(&of[away..]) {
            *sum = a.wrapping_add(b);
        }
    }

    fn add_to(of: &[u16], sums: &mut [i32]) {
        sums.iter_mut().zip(of).for_each(|(sum, &v)| *sum += i32::from(v));
    }

    fn add_both_to(a: &[u16], b: &[u16], sums: &mut [i32]) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (&a, &b))| *sum += i32::from(a) + i32::from(b));
    }

    fn contrast(all: &[i32], core: &[i32], core_area: i32, all_area: i32, out: &mut [i32]) {
        for (out, (&all, &core)) in out.iter_mut().zip(all.iter().zip(core)) {
            *out = core.wrapping_mul(all_area).wrapping_sub(all.wrapping_mul(core_area));
        }
    }
}

/// Sums of `side` neighbouring column sums of the same height: by powers of two as far as 16 bits suffice.
///
/// ```text
///   11 = 4 + 4 + 2 + 1     * * * * * * * * * * *     sums of 2 are two of 1, sums of 4 two of 2
///                          |_____| |_____| |_| |
/// ```
fn sum_along(columns: &[u16], side: usize, powers: &mut [Vec<u16>], sums: &mut [i32]) {
    let most = (MOST_SIDE / side).min(side).ilog2() as usize;
    for k in 0..most {
        let (smaller, larger) = powers.split_at_mut(k);
        add_away(smaller.last().map_or(columns, Vec::as_slice), 1 << k, &mut larger[0]);
    }
    let mut first = 0;
    let mut next = || {
        let power = most.min((side - first).checked_ilog2()? as usize);
        let part = &power.checked_sub(1).map_or(columns, |k| &powers[k])[first..];
        first += 1 << power;
        Some(part)
    };
    sums.fill(0);
    while let Some(part) = next() {
        match next() {
            Some(other) => add_both_to(part, other, sums),
            None => add_to(part, sums),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_along_are_those_of_the_neighbours_whatever_their_number() {
        for side in [1, 2, 3, 5, 7, 11, 13, 27, 31, 63] {
            // The largest column sums for squares of this width.
            let columns: Vec<u16> = (0..96 + MOST_SIDE as u32).map(|i| (i * i % 1021) as u16 * side as u16).collect();
            let mut powers: Vec<Vec<u16>> = vec![vec![0; columns.len()]; 6];
            let mut sums = vec![0; 96];
            sum_along(&columns, side, &mut powers, &mut sums);
            for (i, &sum) in sums.iter().enumerate() {
                let exact: i32 = columns[i..i + side].iter().map(|&v| i32::from(v)).sum();
                assert_eq!(sum, exact, "{side} from {i}");
            }
        }
    }
}
