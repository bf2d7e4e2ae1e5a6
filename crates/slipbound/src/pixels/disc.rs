//! Greyscale morphology of a coarse field: the maximum or minimum within a disc around every cell.
//!
//! ```text
//!       # # #        the disc, row by row: widened[w] holds the extreme of 2 w + 1 neighbours of a row;
//!     # # # # #      for each row of the disc the one with its width is used
//!     # # o # #
//!     # # # # #
//!       # # #
//! ```

use super::wide::wide;

/// A disc and its scratch memory.
#[derive(Debug, Clone)]
pub struct Disc {
    columns: usize,
    radius_cells: usize,
    /// Half the width of the disc, by rows from its middle.
    half_widths: Vec<usize>,
    widened: Vec<Vec<f32>>,
    /// A row with neutral values on both sides.
    line: Vec<f32>,
}

impl Disc {
    /// For `count` cells in rows of `columns`.
    pub fn new(columns: usize, count: usize, radius_cells: usize) -> Self {
        let k = radius_cells;
        let half_width = |away: usize| ((k * k - away * away) as f64).sqrt().round() as usize;
        Disc {
            columns,
            radius_cells,
            half_widths: (0..=k).map(half_width).collect(),
            widened: vec![vec![0.0; count]; k + 1],
            line: vec![0.0; columns + 2 * k],
        }
    }

    /// Closes gaps narrower than the disc: the maximum around every cell, then the minimum of those. Values must not be
    /// negative.
    pub fn close(&mut self, values: &mut [f32]) {
        self.dilate(values);
        self.erode(values);
    }

    /// The maximum within the disc around every cell. Values must not be negative.
    pub fn dilate(&mut self, values: &mut [f32]) {
        self.extreme::<true>(values);
    }

    /// The minimum within the disc around every cell.
    pub fn erode(&mut self, values: &mut [f32]) {
        self.extreme::<false>(values);
    }

    fn extreme<const GREATEST: bool>(&mut self, values: &mut [f32]) {
        let (n, k) = (self.columns, self.radius_cells);
        let neutral = if GREATEST { 0.0 } else { f32::MAX };
        self.line.fill(neutral);
        self.widened[0].copy_from_slice(values);
        for (y, row) in values.chunks_exact(n).enumerate() {
            self.line[k..k + n].copy_from_slice(row);
            for w in 1..=k {
                let (narrower, wider) = self.widened.split_at_mut(w);
                let (narrow, wide) = (&narrower[w - 1][y * n..][..n], &mut wider[0][y * n..][..n]);
                extreme_of_three::<GREATEST>(narrow, &self.line[k - w..][..n], &self.line[k + w..][..n], wide);
            }
        }
        let rows = values.len() / n.max(1);
        for (y, out) in values.chunks_exact_mut(n).enumerate() {
            let line = |near: usize| &self.widened[self.half_widths[near.abs_diff(y)]][near * n..][..n];
            out.copy_from_slice(line(y));
            for away in 1..=k {
                match (y.checked_sub(away).map(line), Some(y + away).filter(|&below| below < rows).map(line)) {
                    (Some(above), Some(below)) => take_extremes::<GREATEST>(above, below, out),
                    (Some(alone), None) | (None, Some(alone)) => take_extremes::<GREATEST>(alone, alone, out),
                    (None, None) => break,
                }
            }
        }
    }
}

/// Maximum or minimum of two values.
#[inline(always)]
fn extreme<const GREATEST: bool>(a: f32, b: f32) -> f32 {
    // Written as vector maximum and minimum instructions define it.
    if if GREATEST { a > b } else { a < b } { a } else { b }
}

wide! {
    fn extreme_of_three<const GREATEST: bool>(a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) {
        for (out, (&a, (&b, &c))) in out.iter_mut().zip(a.iter().zip(b.iter().zip(c))) {
            *out = extreme::<GREATEST>(extreme::<GREATEST>(a, b), c);
        }
    }

    fn take_extremes<const GREATEST: bool>(a: &[f32], b: &[f32], out: &mut [f32]) {
        for (out, (&a, &b)) in out.iter_mut().zip(a.iter().zip(b)) {
            *out = extreme::<GREATEST>(extreme::<GREATEST>(*out, a), b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_is_the_least_of_the_greatest_within_the_disc() {
        for (columns, rows, radius) in [(9, 7, 2), (5, 11, 4), (3, 2, 3), (8, 8, 0)] {
            let values: Vec<f32> = (0..columns * rows).map(|i| ((i * 37 + i * i) % 23) as f32).collect();
            let inside = |i: usize, j: usize| {
                let (dx, dy) = ((i % columns).abs_diff(j % columns), (i / columns).abs_diff(j / columns));
                dy <= radius && dx <= ((radius * radius - dy * dy) as f64).sqrt().round() as usize
            };
            let around = |of: &[f32], start: f32, take: fn(f32, f32) -> f32| -> Vec<f32> {
                let near = |i: usize| (0..of.len()).filter(move |&j| inside(i, j));
                (0..of.len()).map(|i| near(i).map(|j| of[j]).fold(start, take)).collect()
            };
            let expected = around(&around(&values, 0.0, f32::max), f32::MAX, f32::min);
            let mut closed = values.clone();
            Disc::new(columns, values.len(), radius).close(&mut closed);
            assert_eq!(closed, expected, "{columns} x {rows}, radius {radius}");
        }
    }
}
