//! Shades of the cells of an image, plane by plane, and the correlation of two of them.

use crate::pixels::wide::wide;

/// Numbers summed in parallel, so that the sum is the same and fast on every machine.
const LANES_COUNT: usize = 8;

/// Shades of cells, row by row; zero in cells that are not seen.
#[derive(Debug, Clone)]
pub(super) struct Planes {
    /// Two on a smooth gel, one on a fabric skin.
    pub(super) shades: Vec<Vec<f32>>,
    /// 1 where a cell is seen, else 0.
    pub(super) seen: Vec<f32>,
}

impl Planes {
    /// Nothing seen.
    pub(super) fn new(planes_count: usize, cells_count: usize) -> Self {
        Planes { shades: vec![vec![0.0; cells_count]; planes_count], seen: vec![0.0; cells_count] }
    }

    /// Copies `other`.
    pub(super) fn copy_from(&mut self, other: &Planes) {
        self.shades.iter_mut().zip(&other.shades).for_each(|(to, from)| to.copy_from_slice(from));
        self.seen.copy_from_slice(&other.seen);
    }

    /// All planes, `seen` last.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        self.shades.iter_mut().chain([&mut self.seen])
    }

    /// 1 - correlation with other planes, over the cells seen in both; None when one of them is flat there.
    pub(super) fn change(&self, other: &Planes) -> Option<f64> {
        let (mut both, mut here, mut there) = (0.0, 0.0, 0.0);
        for (a, b) in self.shades.iter().zip(&other.shades) {
            both += sum_of_products(a, b);
            here += sum_of_squares(a, &other.seen);
            there += sum_of_squares(b, &self.seen);
        }
        let scale = (here * there).sqrt();
        (scale > 0.0).then(|| 1.0 - both / scale)
    }
}

wide! {
    /// The sum of a b.
    fn sum_of_products(a: &[f32], b: &[f32]) -> f64 {
        sum_of(a, b, |a, b| a * b)
    }

    /// The sum of a a b.
    fn sum_of_squares(a: &[f32], b: &[f32]) -> f64 {
        sum_of(a, b, |a, b| a * a * b)
    }
}

/// The sum of `term` over the pairs of two rows of numbers. In single precision over short stretches only.
#[inline(always)]
pub(super) fn sum_of(a: &[f32], b: &[f32], term: impl Fn(f32, f32) -> f32) -> f64 {
    const STRETCH: usize = 16 * LANES_COUNT;
    let mut total = 0.0;
    // Loops, not adaptors: the closures that these fold with would be compiled for the baseline.
    for (a, b) in a.chunks(STRETCH).zip(b.chunks(STRETCH)) {
        let mut lanes = [0.0f32; LANES_COUNT];
        let (a_lanes, a_rest) = a.as_chunks::<LANES_COUNT>();
        let (b_lanes, b_rest) = b.as_chunks::<LANES_COUNT>();
        for (a, b) in a_lanes.iter().zip(b_lanes) {
            for i in 0..LANES_COUNT {
                lanes[i] += term(a[i], b[i]);
            }
        }
        let (mut sum, mut rest) = (0.0, 0.0);
        for lane in lanes {
            sum += lane;
        }
        for (&a, &b) in a_rest.iter().zip(b_rest) {
            rest += term(a, b);
        }
        total += f64::from(sum + rest);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_both_see_is_compared_and_nothing_with_the_flat() {
        let mut a = Planes::new(1, 300);
        a.seen.fill(1.0);
        a.shades[0].iter_mut().enumerate().for_each(|(i, shade)| *shade = (i % 7) as f32 - 3.0);
        assert_eq!(a.change(&a), Some(0.0));
        let mut half = a.clone();
        half.shades[0][150..].fill(0.0);
        half.seen[150..].fill(0.0);
        assert!(a.change(&half).is_some_and(|change| change.abs() < 1e-6));
        let mut against = a.clone();
        against.shades[0].iter_mut().for_each(|shade| *shade = -*shade);
        assert!(a.change(&against).is_some_and(|change| (change - 2.0).abs() < 1e-6));
        assert_eq!(a.change(&Planes::new(1, 300)), None);
    }

    #[test]
    fn no_number_of_a_sum_is_left_out() {
        for length in [0, 1, 7, 8, 127, 128, 129, 300] {
            let ones = vec![1.0; length];
            assert_eq!(sum_of(&ones, &ones, |a, b| a + b), 2.0 * length as f64);
        }
    }
}
