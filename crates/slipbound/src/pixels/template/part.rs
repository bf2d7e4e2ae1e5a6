//! The part of a window that has weights: samples of it, and vectors as whole-numbered weights of them.

use super::sums::{LANES, ROUND, WEIGHED_LANES, bilinear};
use crate::image::SizePx;
use crate::plane::{Vec2, nearest_px};

/// Sampling steps per pixel; the fit compensates the remainder.
const STEPS_PER_PX: f64 = 16.0;
/// The largest tabulated weight, a byte: the weights of all markers, half a megabyte, are read in every frame.
pub(super) const FULL_WEIGHT: f64 = 127.0;

/// Some columns and rows of a window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub left: usize,
    pub top: usize,
    pub width: usize,
    pub height: usize,
}

impl Part {
    /// The part of a square of `side` where `share` is not zero, at least as wide as the lanes.
    pub fn of(share: &[f64], side: usize) -> Self {
        let is_empty = |row: usize| share[row * side..][..side].iter().all(|s| *s == 0.0);
        // The weights are the same on all four sides.
        let rim = (0..side / 2).take_while(|row| is_empty(*row)).count();
        let seen = side - 2 * rim;
        let width = seen.max(LANES);
        Part { left: rim.min(side - width), top: rim, width, height: seen }
    }

    /// Memory for its pixels.
    pub fn zeros(self) -> Vec<i16> {
        vec![0; (self.width * self.height).next_multiple_of(ROUND)]
    }

    /// Values inside this part, multiplied by `scale`, as integers; `values` takes the index of a pixel in the whole
    /// window of `side`. The rounding error of each is carried to the next, so that a vector orthogonal to a constant
    /// stays so. Several side by side: each waits for its last rounding.
    pub fn cut<const N: usize>(
        self,
        values: impl Fn(usize) -> [f64; N],
        scale: [f64; N],
        side: usize,
    ) -> [Vec<i16>; N] {
        let mut cut = [(); N].map(|()| self.zeros());
        let mut owed = [0.0; N];
        for row in 0..self.height {
            let first = (self.top + row) * side + self.left;
            for column in 0..self.width {
                let values = values(first + column);
                for k in 0..N {
                    let wanted = values[k] * scale[k] + owed[k];
                    let whole = rounded(wanted);
                    owed[k] = wanted - f64::from(whole);
                    cut[k][row * self.width + column] = whole;
                }
            }
        }
        cut
    }
}

/// The nearest whole number, a half away from zero: `round` is a call where the CPU is not known to have the
/// instruction.
fn rounded(v: f64) -> i16 {
    let whole = v as i32;
    let rest = v - f64::from(whole);
    (whole + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)) as i16
}

/// Samples a part of the window about a place; returns the middle of the sampled window, at most a 32nd of a pixel away
/// on each axis.
pub(super) fn sample(side: usize, part: Part, grey: &[u8], size: SizePx, place: Vec2, out: &mut [i16]) -> Vec2 {
    let reach = (side as f64 - 1.0) / 2.0;
    let steps = |v: f64| nearest_px((v - reach) * STEPS_PER_PX) as usize;
    let (x, y) = (steps(place.x), steps(place.y));
    let (column, row) = (x / STEPS_PER_PX as usize + part.left, y / STEPS_PER_PX as usize + part.top);
    let (fx, fy) = ((x % STEPS_PER_PX as usize) as i16, (y % STEPS_PER_PX as usize) as i16);
    let out = &mut out[..part.width * part.height];
    bilinear(&grey[row * size.width + column..], size.width, part.width, [fx, fy], out);
    Vec2::new(x as f64 / STEPS_PER_PX + reach, y as f64 / STEPS_PER_PX + reach)
}

/// Lists of weights, interleaved by lanes.
pub(super) fn side_by_side<const LISTS: usize>(lists: [Vec<i16>; LISTS]) -> Vec<[[i8; WEIGHED_LANES]; LISTS]> {
    let lists = lists.each_ref().map(|list| list.as_chunks::<WEIGHED_LANES>().0);
    (0..lists[0].len())
        .map(|i| lists.map(|list| list[i].map(|weight| weight.clamp(i8::MIN.into(), i8::MAX.into()) as i8)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::window::Window;
    use super::*;

    /// Darkness of a dot that fades to its rim.
    fn cone(away_px: f64) -> f64 {
        (1.0 - away_px / 6.0).max(0.0)
    }

    /// For every window size, the part cut away has no weight.
    #[test]
    fn the_part_that_is_weighed_holds_every_share() {
        for tenths in 20..400 {
            let window = Window::new(f64::from(tenths) / 10.0, cone);
            let (part, side) = (window.part, window.side);
            assert!(part.left + part.width <= side && part.top + part.height <= side, "{tenths}: {part:?} of {side}");
            let within = |i: usize| {
                let (x, y) = (i % side, i / side);
                (part.left..part.left + part.width).contains(&x) && (part.top..part.top + part.height).contains(&y)
            };
            let lost = (0..side * side).find(|&i| window.share[i] != 0.0 && !within(i));
            assert_eq!(lost, None, "{tenths}: {part:?} of {side}");
            assert!(part.height * part.width <= side * side && window.samples.len().is_multiple_of(ROUND));
        }
    }

    /// Rows that are no multiple of the lanes, too.
    #[test]
    fn a_part_is_sampled_as_the_whole_window_is() {
        let size = SizePx::new(120, 90);
        let grey: Vec<u8> = (0..size.area() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for radius_px in [5.3, 8.2, 9.3, 13.0, 17.1] {
            let Window { side, part, mut samples, .. } = Window::new(radius_px, cone);
            let mut all = vec![0; side * side];
            let whole = Part { left: 0, top: 0, width: side, height: side };
            let place = Vec2::new(58.37, 44.81);
            assert_eq!(
                sample(side, whole, &grey, size, place, &mut all),
                sample(side, part, &grey, size, place, &mut samples)
            );
            for (i, &sample) in samples[..part.width * part.height].iter().enumerate() {
                let (x, y) = (part.left + i % part.width, part.top + i / part.width);
                assert_eq!(sample, all[y * side + x], "{radius_px} px, {x} {y}");
            }
        }
    }
}
