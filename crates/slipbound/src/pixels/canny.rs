//! Grey image -> mask of edges after Canny (1986): Sobel gradient 3x3, ridge of its magnitude, hysteresis.
//!
//! ```text
//!   src rows --Sobel--> dx, dy --|dx| + |dy|, direction--> ridge pixels above low: weak, above high: strong
//!                                                          strong + every weak touching it (8 ways) -> out
//! ```
//! Pixel for pixel what cv2.Canny(src, low, high) gives, with its default aperture and L1 norm. A band of rows is
//! treated as a separate image: neither gradient nor edge crosses its border.

use super::bits::pack_row;
use super::wide::wide;
use crate::image::{Mask, SizePx};
use std::ops::Range;

/// Direction of the gradient, to 45 degrees.
const ACROSS: i16 = 0;
const DOWN: i16 = 1;
const FALLING: i16 = 2;
const RISING: i16 = 3;

/// tan(22.5 degrees) in 2^-15, as integer edge detectors write it.
const TAN_22: i32 = 13573;

/// The scratch memory of the edge detector.
#[derive(Debug, Clone)]
pub struct Canny {
    size: SizePx,
    /// Columns of three rows weighted 1 2 1, one column more on each side.
    sums: Vec<i16>,
    /// Columns of three rows weighted -1 0 1, likewise.
    differences: Vec<i16>,
    /// Magnitudes of three rows, by row number modulo 3, one zero more on each side.
    magnitudes: [Vec<i16>; 3],
    /// Directions of two rows, by row number modulo 2.
    directions: [Vec<i16>; 2],
    /// Per pixel of a row: 255 on a ridge above low, 255 on a ridge above high.
    weak_row: Vec<u8>,
    strong_row: Vec<u8>,
    weak: Mask,
    /// Words that strong pixels may still spread into; each at most once, so it never grows.
    stack: Vec<u32>,
    stacked: Vec<bool>,
}

impl Canny {
    /// Scratch memory for images of `size`.
    pub fn new(size: SizePx) -> Self {
        let (n, whole) = (size.width, size.width.next_multiple_of(64));
        let weak = Mask::new(size);
        let words = weak.words().len();
        Canny {
            size,
            sums: vec![0; n + 2],
            differences: vec![0; n + 2],
            magnitudes: std::array::from_fn(|_| vec![0; n + 2]),
            directions: std::array::from_fn(|_| vec![0; n]),
            weak_row: vec![0; whole],
            strong_row: vec![0; whole],
            weak,
            stack: Vec::with_capacity(words),
            stacked: vec![false; words],
        }
    }

    /// Finds the edges in `rows` of `src` (rows without a gap) and writes only those rows of `out`. Thresholds are
    /// magnitudes |dx| + |dy| of the Sobel gradient, 4 times the difference of levels across a step; an edge exceeds
    /// them. They are swapped when low is above high.
    pub fn run(&mut self, src: &[u8], rows: Range<usize>, low: u16, high: u16, out: &mut Mask) {
        assert_eq!(src.len(), self.size.area(), "source of another size");
        assert_eq!(out.size(), self.size, "mask of another size");
        assert!(rows.end <= self.size.height, "rows {rows:?} of {}", self.size);
        if rows.is_empty() {
            return;
        }
        // No magnitude exceeds 2 * 4 * 255.
        let (low, high) = (low.min(high).min(4096) as i16, low.max(high).min(4096) as i16);
        let n = self.size.width;
        self.magnitudes[(rows.start + 2) % 3].fill(0);
        for y in rows.start..=rows.end {
            if y < rows.end {
                let row = |y: usize| &src[y * n..][..n];
                let above = row(y.saturating_sub(1).max(rows.start));
                let below = row((y + 1).min(rows.end - 1));
                sum_columns(above, row(y), below, &mut self.sums[1..=n], &mut self.differences[1..=n]);
                repeat_ends(&mut self.sums);
                repeat_ends(&mut self.differences);
                let magnitudes = &mut self.magnitudes[y % 3][1..=n];
                gradient(&self.sums, &self.differences, magnitudes, &mut self.directions[y % 2]);
            } else {
                self.magnitudes[y % 3].fill(0);
            }
            if y > rows.start {
                self.mark_ridges(y - 1, low, high, out);
            }
        }
        self.follow(rows, out);
    }

    /// Marks the weak and the strong pixels of row y; needs the magnitudes of the adjacent rows.
    fn mark_ridges(&mut self, y: usize, low: i16, high: i16, strong: &mut Mask) {
        let n = self.size.width;
        let [above, here, below] = [(y + 2) % 3, y % 3, (y + 1) % 3].map(|i| &self.magnitudes[i][..]);
        let directions = &self.directions[y % 2];
        ridges(above, here, below, directions, [low, high], &mut self.weak_row[..n], &mut self.strong_row[..n]);
        pack_row(&self.weak_row, self.weak.row_mut(y));
        pack_row(&self.strong_row, strong.row_mut(y));
    }

    /// Spreads the strong pixels over the weak ones they touch, 64 pixels at a time. Only words with weak pixels that
    /// are not strong yet are visited, and again when a neighbour has grown.
    fn follow(&mut self, rows: Range<usize>, strong: &mut Mask) {
        let per_row = strong.row(0).len();
        let words = rows.start * per_row..rows.end * per_row;
        let (weak, strong) = (self.weak.words(), strong.words_mut());
        for i in words.clone().rev() {
            if weak[i] & !strong[i] != 0 {
                self.stack.push(i as u32);
                self.stacked[i] = true;
            }
        }
        while let Some(i) = self.stack.pop() {
            let i = i as usize;
            self.stacked[i] = false;
            let open = weak[i] & !strong[i];
            let column = i % per_row;
            // The rows above and below; beyond the band or the row the word itself is used again.
            let above = if i >= words.start + per_row { i - per_row } else { i };
            let below = if i + per_row < words.end { i + per_row } else { i };
            let (before, after) = (usize::from(column > 0), usize::from(column + 1 < per_row));
            let three =
                |away: usize| strong[above + away - before] | strong[i + away - before] | strong[below + away - before];
            let here = three(before);
            let left = if before > 0 { three(0) >> 63 } else { 0 };
            let right = if after > 0 { three(before + 1) << 63 } else { 0 };
            let new = fill_word((here | here << 1 | here >> 1 | left | right) & open, open);
            if new == 0 {
                continue;
            }
            strong[i] |= new;
            // Growth affects a neighbouring word only through the end bits.
            let (before, after) = (before & new as usize, after & (new >> 63) as usize);
            for row in [above, i, below] {
                for at in row - before..=row + after {
                    if weak[at] & !strong[at] != 0 && !self.stacked[at] {
                        self.stacked[at] = true;
                        self.stack.push(at as u32);
                    }
                }
            }
        }
    }
}

wide! {
    fn sum_columns(above: &[u8], here: &[u8], below: &[u8], sums: &mut [i16], differences: &mut [i16]) {
        let rows = above.iter().zip(here).zip(below);
        for ((sum, difference), ((&a, &h), &b)) in sums.iter_mut().zip(differences).zip(rows) {
            *sum = i16::from(a) + 2 * i16::from(h) + i16::from(b);
            *difference = i16::from(b) - i16::from(a);
        }
    }
}

/// The border pixels repeat outside the image.
fn repeat_ends(row: &mut [i16]) {
    let last = row.len() - 1;
    row[0] = row[1];
    row[last] = row[last - 1];
}

wide! {
    /// Magnitude |dx| + |dy| and direction of the gradient.
    fn gradient(sums: &[i16], differences: &[i16], magnitudes: &mut [i16], directions: &mut [i16]) {
        let n = magnitudes.len();
        let (sums_left, sums_right) = (&sums[..n], &sums[2..][..n]);
        let (left, middle, right) = (&differences[..n], &differences[1..][..n], &differences[2..][..n]);
        let directions = &mut directions[..n];
        for i in 0..n {
            let dx = sums_right[i] - sums_left[i];
            let dy = left[i] + 2 * middle[i] + right[i];
            let (x, y) = (dx.abs(), dy.abs());
            magnitudes[i] = x + y;
            // floor(x tan 22.5); x times 13573 / 2^15 is whole only at x = 0, so <= here is < in exact arithmetic.
            let flat = ((i32::from(2 * x) * TAN_22) >> 16) as i16;
            // tan 67.5 = 2 + tan 22.5
            let diagonal = if (dx ^ dy) < 0 { RISING } else { FALLING };
            let steep = if y > flat + 2 * x { DOWN } else { diagonal };
            directions[i] = if y <= flat { ACROSS } else { steep };
        }
    }
}

wide! {
    /// Marks the pixels whose magnitude is not exceeded along the gradient, with 255: those above low as weak, above
    /// high as strong.
    fn ridges(
        above: &[i16],
        here: &[i16],
        below: &[i16],
        directions: &[i16],
        thresholds: [i16; 2],
        weak: &mut [u8],
        strong: &mut [u8],
    ) {
        let ([low, high], n) = (thresholds, weak.len());
        let [above_left, above_mid, above_right] = [0, 1, 2].map(|k| &above[k..][..n]);
        let [left, mid, right] = [0, 1, 2].map(|k| &here[k..][..n]);
        let [below_left, below_mid, below_right] = [0, 1, 2].map(|k| &below[k..][..n]);
        let (directions, strong) = (&directions[..n], &mut strong[..n]);
        for i in 0..n {
            let (m, d) = (mid[i], directions[i]);
            // A mask of all ones for the direction of the gradient: a select without a branch.
            let [across, down, falling, rising] =
                [ACROSS, DOWN, FALLING, RISING].map(|direction| i16::from(d == direction).wrapping_neg());
            let before =
                left[i] & across | above_mid[i] & down | above_left[i] & falling | above_right[i] & rising;
            let after = right[i] & across | below_mid[i] & down | below_right[i] & falling | below_left[i] & rising;
            // Of two equal neighbours along an axis the first counts.
            let is_ridge = (m > before) & (m >= after - (falling | rising));
            // 0, below every threshold, where it is no ridge.
            let ridge = m & i16::from(is_ridge).wrapping_neg();
            weak[i] = u8::from(ridge > low).wrapping_neg();
            strong[i] = u8::from(ridge > high).wrapping_neg();
        }
    }
}

/// The runs of `allowed` that contain a pixel of `seeds`.
fn fill_word(seeds: u64, allowed: u64) -> u64 {
    let mut filled = seeds;
    loop {
        let next = filled | ((filled << 1 | filled >> 1) & allowed);
        if next == filled {
            return filled;
        }
        filled = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Canny pixel by pixel, with the border of the image repeated and magnitudes of 0 outside.
    fn naive(src: &[u8], size: SizePx, low: i32, high: i32) -> Mask {
        let (w, h) = (size.width as isize, size.height as isize);
        let at = |x: isize, y: isize| i32::from(src[(y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize]);
        let gradient = |x: isize, y: isize| {
            let sobel = |a: fn(isize, isize) -> (isize, isize)| {
                [(-1, 1), (0, 2), (1, 1)]
                    .iter()
                    .map(|&(along, weight)| {
                        let (ahead, back) = (a(1, along), a(-1, along));
                        weight * (at(x + ahead.0, y + ahead.1) - at(x + back.0, y + back.1))
                    })
                    .sum::<i32>()
            };
            (sobel(|across, along| (across, along)), sobel(|across, along| (along, across)))
        };
        let magnitude = |x: isize, y: isize| {
            if x < 0 || y < 0 || x >= w || y >= h {
                return 0;
            }
            let (dx, dy) = gradient(x, y);
            dx.abs() + dy.abs()
        };
        let (mut weak, mut edges) = (Mask::new(size), Mask::new(size));
        for y in 0..h {
            for x in 0..w {
                let m = magnitude(x, y);
                let (dx, dy) = gradient(x, y);
                let slope = 13573.0 / 32768.0 * f64::from(dx.abs());
                let ridge = if f64::from(dy.abs()) < slope {
                    m > magnitude(x - 1, y) && m >= magnitude(x + 1, y)
                } else if f64::from(dy.abs()) > slope + 2.0 * f64::from(dx.abs()) {
                    m > magnitude(x, y - 1) && m >= magnitude(x, y + 1)
                } else {
                    let s = if (dx < 0) != (dy < 0) { -1 } else { 1 };
                    m > magnitude(x - s, y - 1) && m > magnitude(x + s, y + 1)
                };
                weak.set(x as usize, y as usize, ridge && m > low);
                edges.set(x as usize, y as usize, ridge && m > high);
            }
        }
        loop {
            let before = edges.clone();
            for y in 0..h {
                for x in 0..w {
                    let touches = (-1..=1).any(|j| (-1..=1).any(|i| edges.get(x + i, y + j)));
                    if weak.get(x, y) && touches {
                        edges.set(x as usize, y as usize, true);
                    }
                }
            }
            if edges == before {
                return edges;
            }
        }
    }

    #[test]
    fn the_rim_of_a_square_as_opencv_draws_it() {
        let size = SizePx::new(12, 10);
        let src: Vec<u8> =
            (0..120).map(|i| if (3..8).contains(&(i % 12)) && (3..7).contains(&(i / 12)) { 200 } else { 20 }).collect();
        let mut edges = Mask::new(size);
        Canny::new(size).run(&src, 0..10, 90, 120, &mut edges);
        assert_eq!(
            edges,
            Mask::from_picture(
                "............
                 ............
                 ....###.....
                 ...#...#....
                 ..#....#....
                 ..#....#....
                 ...#####....
                 ............
                 ............
                 ............"
            )
        );
    }

    #[test]
    fn a_band_is_an_image_of_its_own_and_the_rest_is_left_alone() {
        let size = SizePx::new(70, 30);
        let src: Vec<u8> = (0..size.area() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 26) as u8).collect();
        let mut canny = Canny::new(size);
        let mut edges = Mask::new(size);
        edges.words_mut()[0] = 5;
        canny.run(&src, 10..25, 60, 90, &mut edges);
        let band = naive(&src[10 * 70..25 * 70], SizePx::new(70, 15), 60, 90);
        assert!(band.area_px2() > 20, "too few edges to judge");
        for y in 10..25 {
            assert_eq!(edges.row(y), band.row(y - 10), "row {y}");
        }
        assert_eq!(edges.row(0), [5, 0]);
        assert_eq!(edges.row(25), [0, 0]);
        canny.run(&src, 7..7, 60, 90, &mut edges);
    }

    #[test]
    fn a_weak_spiral_is_followed_to_its_end() {
        let size = SizePx::new(140, 140);
        let mut src = vec![100u8; size.area()];
        let (mut x, mut y, mut step, mut length) = (4i32, 4i32, (1i32, 0i32), 130);
        let mut sides = 0;
        while length > 6 {
            for _ in 0..length {
                src[(y * 140 + x) as usize] = 130;
                (x, y) = (x + step.0, y + step.1);
            }
            step = (-step.1, step.0);
            sides += 1;
            if sides >= 3 && sides % 2 == 1 {
                length -= 6;
            }
        }
        src[4 * 140 + 4] = 255;
        let mut edges = Mask::new(size);
        Canny::new(size).run(&src, 0..140, 50, 200, &mut edges);
        assert_eq!(edges, naive(&src, size, 50, 200));
        assert!(edges.area_px2() > 2000, "{} px", edges.area_px2());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_the_pixel_by_pixel_form(
            width in 1usize..140, height in 1usize..20, seed: u32, shift in 0u32..6, low in 0u16..200, more in 0u16..200
        ) {
            let size = SizePx::new(width, height);
            let noise = |i: u32| (i ^ i >> 15).wrapping_add(seed).wrapping_mul(2_654_435_761).rotate_left(9);
            let src: Vec<u8> = (0..size.area() as u32).map(|i| (noise(i) >> (24 + shift)) as u8).collect();
            let (low, high) = ((4 * low) >> shift, (4 * (low + more)) >> shift);
            let mut edges = Mask::new(size);
            Canny::new(size).run(&src, 0..height, low, high, &mut edges);
            prop_assert_eq!(edges, naive(&src, size, i32::from(low), i32::from(high)));
        }
    }
}
