//! Symmetric blur of a coarse field by the same weights along rows and along columns; zero beyond the border.

use super::wide::wide;

/// The weights and the scratch memory.
#[derive(Debug, Clone)]
pub struct Blur {
    columns: usize,
    /// From the middle outwards.
    weights: Vec<f32>,
    /// One row with zeros on both sides, as far as the blur reaches.
    line: Vec<f32>,
    rows: Vec<f32>,
}

impl Blur {
    /// For `count` values in rows of `columns`; `weights` from the middle outwards, one or more.
    pub fn new(weights: Vec<f32>, columns: usize, count: usize) -> Self {
        let reach = weights.len() - 1;
        Blur { columns, weights, line: vec![0.0; columns + 2 * reach], rows: vec![0.0; count] }
    }

    /// The sum of all weights, both ways.
    pub fn weight(&self) -> f32 {
        let along = 2.0 * self.weights.iter().sum::<f32>() - self.weights[0];
        along * along
    }

    /// Blurs `from` into `to`.
    pub fn run(&mut self, from: &[f32], to: &mut [f32]) {
        let (n, weights, reach) = (self.columns, &self.weights, self.weights.len() - 1);
        for (from, out) in from.chunks_exact(n).zip(self.rows.chunks_exact_mut(n)) {
            self.line[reach..reach + n].copy_from_slice(from);
            blur_line(&self.line, weights, out);
        }
        let line = |y: usize| &self.rows[y * n..(y + 1) * n];
        let rows = self.rows.len() / n.max(1);
        for (y, out) in to.chunks_exact_mut(n).enumerate() {
            scale(line(y), weights[0], out);
            for (away, &weight) in weights.iter().enumerate().skip(1) {
                match (y.checked_sub(away), Some(y + away).filter(|&y| y < rows)) {
                    (Some(above), Some(below)) => add_two(line(above), line(below), weight, out),
                    (Some(y), None) | (None, Some(y)) => add_one(line(y), weight, out),
                    (None, None) => {}
                }
            }
        }
    }
}

wide! {
    /// `line` extends beyond `out` on both sides by the number of weights after the first.
    fn blur_line(line: &[f32], weights: &[f32], out: &mut [f32]) {
        const PLACES: usize = 16;
        let reach = weights.len() - 1;
        let (whole, rest) = out.as_chunks_mut::<PLACES>();
        let rest_at = whole.len() * PLACES;
        for (k, out) in whole.iter_mut().enumerate() {
            let near = &line[k * PLACES..][..PLACES + 2 * reach];
            let mut sums = [0.0; PLACES];
            for i in 0..PLACES {
                sums[i] = weights[0] * near[reach + i];
            }
            for (away, weight) in weights.iter().enumerate().skip(1) {
                let (left, right) = (&near[reach - away..][..PLACES], &near[reach + away..][..PLACES]);
                for i in 0..PLACES {
                    sums[i] += weight * (left[i] + right[i]);
                }
            }
            *out = sums;
        }
        for (i, out) in rest.iter_mut().enumerate() {
            let at = rest_at + i + reach;
            let sides = weights.iter().enumerate().skip(1);
            *out = sides.fold(weights[0] * line[at], |sum, (away, weight)| sum + weight * (line[at - away] + line[at + away]));
        }
    }

    fn scale(from: &[f32], weight: f32, out: &mut [f32]) {
        out.iter_mut().zip(from).for_each(|(out, from)| *out = weight * from);
    }

    fn add_one(from: &[f32], weight: f32, out: &mut [f32]) {
        out.iter_mut().zip(from).for_each(|(out, from)| *out += weight * from);
    }

    fn add_two(above: &[f32], below: &[f32], weight: f32, out: &mut [f32]) {
        out.iter_mut().zip(above.iter().zip(below)).for_each(|(out, (a, b))| *out += weight * (a + b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blur_of_a_point_is_the_kernel_both_ways_and_ends_at_the_border() {
        let (columns, rows, weights) = (19, 7, [4.0, 2.0, 1.0]);
        let mut blur = Blur::new(weights.to_vec(), columns, columns * rows);
        assert_eq!(blur.weight(), 100.0);
        let mut to = vec![0.0; columns * rows];
        for (x, y) in [(4, 3), (0, 0), (18, 6), (1, 5), (15, 2), (16, 2)] {
            let mut from = vec![0.0; columns * rows];
            from[y * columns + x] = 1.0;
            blur.run(&from, &mut to);
            for (i, &seen) in to.iter().enumerate() {
                let weight = |a: usize, b: usize| weights.get(a.abs_diff(b)).copied().unwrap_or(0.0);
                assert_eq!(seen, weight(i % columns, x) * weight(i / columns, y), "{i} of ({x}, {y})");
            }
        }
    }
}
