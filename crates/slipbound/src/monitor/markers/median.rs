//! The median of up to nine numbers, without branches.

use crate::plane::Vec2;

/// Inputs of the sorting network.
const MOST: usize = 9;

/// The median of at most nine values; the upper one of two middle values.
#[rustfmt::skip]
pub(super) fn median_of(steps: &[Vec2], part: impl Fn(&Vec2) -> f64) -> f64 {
    // Padded with minima and maxima so that the median stays in the middle of nine.
    let below = 4 - steps.len() / 2;
    let mut nine = [i64::MAX; MOST];
    nine[..below].fill(i64::MIN);
    nine[below..].iter_mut().zip(steps).for_each(|(out, step)| *out = ordered(part(step)));
    // Paeth's network: the last exchange leaves the median at index 4.
    let n = &mut nine;
    order::<1, 2>(n); order::<4, 5>(n); order::<7, 8>(n); order::<0, 1>(n); order::<3, 4>(n); order::<6, 7>(n);
    order::<1, 2>(n); order::<4, 5>(n); order::<7, 8>(n); order::<0, 3>(n); order::<5, 8>(n); order::<4, 7>(n);
    order::<3, 6>(n); order::<1, 4>(n); order::<2, 5>(n); order::<4, 7>(n); order::<4, 2>(n); order::<6, 4>(n);
    order::<4, 2>(n);
    f64::from_bits(ordered_bits(nine[4]) as u64)
}

/// Swaps two elements if the first is greater.
#[inline(always)]
fn order<const FIRST: usize, const SECOND: usize>(nine: &mut [i64; MOST]) {
    let (a, b) = (nine[FIRST], nine[SECOND]);
    (nine[FIRST], nine[SECOND]) = (a.min(b), a.max(b));
}

/// An integer in the order of [`f64::total_cmp`], and back.
fn ordered(v: f64) -> i64 {
    ordered_bits(v.to_bits() as i64)
}

fn ordered_bits(bits: i64) -> i64 {
    bits ^ ((bits >> 63) as u64 >> 1) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_up_to_nine_is_that_of_the_sorted_ones() {
        let mut state = 7u32;
        let mut value = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [-0.0, 0.0, 1.5, f64::from(state >> 20) - 2000.0, -f64::from(state >> 28)][(state >> 24) as usize % 5]
        };
        for count in (3..=9).cycle().take(700) {
            let steps: Vec<Vec2> = (0..count).map(|_| Vec2::new(value(), value())).collect();
            let mut sorted: Vec<f64> = steps.iter().map(|step| step.y).collect();
            sorted.sort_by(f64::total_cmp);
            assert_eq!(median_of(&steps, |step| step.y).to_bits(), sorted[count / 2].to_bits(), "{steps:?}");
        }
    }
}
