//! Average over a neighbourhood of 5 x 5 with weights 1 4 6 4 1 each way, of colours some of which are masked.

use super::wide::wide;

/// Red, green, blue and the weight of a cell, all multiplied by the weight; zeros where it is masked.
pub type Weighted = [f32; 4];

/// Number of cells beyond the border that the sums read.
const REACH: usize = 2;

/// The scratch memory of the average.
#[derive(Debug, Clone)]
pub struct Binomial {
    columns: usize,
    /// An empty row.
    nothing: Vec<Weighted>,
    /// Column sums, with zeros on both sides.
    line: Vec<Weighted>,
    rows: Vec<Weighted>,
}

impl Binomial {
    /// Scratch memory for `count` cells in rows of `columns`.
    pub fn new(columns: usize, count: usize) -> Self {
        Binomial {
            columns,
            nothing: vec![[0.0; 4]; columns],
            line: vec![[0.0; 4]; columns + 2 * REACH],
            rows: vec![[0.0; 4]; count],
        }
    }

    /// Replaces each colour by the average of its neighbourhood without masked cells, and each weight by the sum of
    /// weights there, at most 256. A cell without any unmasked neighbour becomes black.
    pub fn run(&mut self, values: &mut [Weighted]) {
        let n = self.columns;
        let count = values.len() / n.max(1);
        for (y, out) in self.rows.chunks_exact_mut(n.max(1)).enumerate() {
            let row = |y: Option<usize>| match y.filter(|&y| y < count) {
                Some(y) => &values[y * n..][..n],
                None => &self.nothing[..],
            };
            let [first, second] = [1, 2].map(|away| (row(y.checked_sub(away)), row(Some(y + away))));
            sum_of_five(row(Some(y)), first.0, first.1, second.0, second.1, out);
        }
        for (row, out) in self.rows.chunks_exact(n.max(1)).zip(values.chunks_exact_mut(n.max(1))) {
            self.line[REACH..][..n].copy_from_slice(row);
            let at = |from: usize| &self.line[from..][..n];
            sum_of_five(at(2), at(1), at(3), at(0), at(4), out);
            divide(out);
        }
    }
}

wide! {
    /// 6 4 4 1 1 times the five, added in this order.
    fn sum_of_five(a: &[Weighted], b: &[Weighted], c: &[Weighted], d: &[Weighted], e: &[Weighted], out: &mut [Weighted]) {
        let n = 4 * out.len();
        let (a, b, c) = (&a.as_flattened()[..n], &b.as_flattened()[..n], &c.as_flattened()[..n]);
        let (d, e, out) = (&d.as_flattened()[..n], &e.as_flattened()[..n], &mut out.as_flattened_mut()[..n]);
        for i in 0..n {
            out[i] = 6.0 * a[i] + 4.0 * b[i] + 4.0 * c[i] + d[i] + e[i];
        }
    }

    fn divide(values: &mut [Weighted]) {
        for v in values {
            let per_weight = 1.0 / v[3].max(1e-6);
            *v = [v[0] * per_weight, v[1] * per_weight, v[2] * per_weight, v[3]];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_binomial_and_hidden_cells_and_borders_are_left_out() {
        let (columns, rows) = (7, 6);
        let colour = |i: usize| [(i * 7 % 50) as f32, (i * 3 % 20) as f32, 9.0];
        let hidden = |i: usize| i.is_multiple_of(5);
        let mut values: Vec<Weighted> = (0..columns * rows)
            .map(|i| if hidden(i) { [0.0; 4] } else { [colour(i)[0], colour(i)[1], colour(i)[2], 1.0] })
            .collect();
        Binomial::new(columns, values.len()).run(&mut values);
        let tap = |a: usize, b: usize| [6.0, 4.0, 1.0].get(a.abs_diff(b)).copied().unwrap_or(0.0f64);
        for (i, got) in values.iter().enumerate() {
            let mut sums = [0.0f64; 4];
            for j in (0..columns * rows).filter(|&j| !hidden(j)) {
                let weight = tap(i % columns, j % columns) * tap(i / columns, j / columns);
                (0..3).for_each(|c| sums[c] += weight * f64::from(colour(j)[c]));
                sums[3] += weight;
            }
            assert_eq!(f64::from(got[3]), sums[3], "weight of cell {i}");
            for c in 0..3 {
                assert!((f64::from(got[c]) - sums[c] / sums[3]).abs() < 1e-4, "cell {i}: {got:?} for {sums:?}");
            }
        }
    }
}
