//! Learns the dots of a finger from the rest frame.
//!
//! ```text
//!   mean dot of all markers --drawn in the middle of a window--> dot of unit depth
//!   window about a marker   =   level + slope   +   depth * dot   +   weave
//! ```

use super::part::{FULL_WEIGHT, Part, sample, side_by_side};
use super::sums::WEIGHED_LANES;
use super::window::{Dot, OF_DOT, PATTERNS, STEPS_PER_LEVEL, Template, Window, in_turn};
use crate::image::SizePx;
use crate::plane::Vec2;

impl Window {
    /// The dot that is this dark.
    pub(super) fn draw(&self, dark: impl Fn(f64) -> f64) -> Dot {
        let (middle, wide) = ((self.side as f64 - 1.0) / 2.0, self.side + 2);
        let from_middle = |i: usize| i as f64 - 1.0 - middle;
        let away_px = |i: usize| Vec2::new(from_middle(i % wide), from_middle(i / wide)).length();
        let wide: Vec<f64> = (0..wide * wide).map(|i| -dark(away_px(i))).collect();
        let bare = self.with_slopes(&wide);
        let mut patterns = bare.clone();
        self.level(&mut patterns);
        let (weights, scale) = self.weigh(&patterns);
        Dot { bare, patterns, weights, scale, wide }
    }

    /// A pattern on a window one pixel wider on each side -> the pattern, and its slopes along x and along y.
    fn with_slopes(&self, pattern: &[f64]) -> [Vec<f64>; 3] {
        let (side, wide) = (self.side, self.side + 2);
        // The rows of the window itself, `shift` samples further.
        let rows = |shift: isize| -> Vec<f64> {
            let mut rows = Vec::with_capacity(side * side);
            for y in 0..side {
                rows.extend_from_slice(&pattern[((y + 1) * wide + 1).wrapping_add_signed(shift)..][..side]);
            }
            rows
        };
        let slope = |step: isize| -> Vec<f64> {
            rows(step).iter().zip(rows(-step)).map(|(after, before)| (after - before) / 2.0).collect()
        };
        [rows(0), slope(1), slope(wide as isize)]
    }

    /// Patterns as weights of the sampled pixels, and the weights per unit of each.
    fn weigh<const N: usize>(&self, patterns: &[Vec<f64>; N]) -> (Vec<[[i8; WEIGHED_LANES]; N]>, [f64; N]) {
        let share = &self.share;
        let highest = |p: &[f64]| p.iter().zip(share).fold(1e-9f64, |m, (v, s)| m.max((v * s).abs()));
        let scale: [f64; N] = std::array::from_fn(|k| FULL_WEIGHT / highest(&patterns[k]));
        let weighed = |i: usize| std::array::from_fn(|k| patterns[k][i] * share[i]);
        (side_by_side(self.part.cut(weighed, scale, self.side)), scale)
    }

    /// Weighted product of each pattern with another. The sums run side by side: each waits for its last addition.
    fn products_with<const N: usize>(&self, patterns: &[Vec<f64>; N], other: &[f64]) -> [f64; N] {
        let mut sums = [0.0; N];
        for &i in &self.inside {
            for (sum, pattern) in sums.iter_mut().zip(patterns) {
                *sum += pattern[i] * other[i] * self.share[i];
            }
        }
        sums
    }

    /// Removes level and slope from patterns.
    fn level<const N: usize>(&self, patterns: &mut [Vec<f64>; N]) {
        for plane in &self.plane {
            let parts = self.products_with(patterns, plane);
            for (pattern, part) in patterns.iter_mut().zip(parts) {
                pattern.iter_mut().zip(plane).for_each(|(v, p)| *v -= part * p);
            }
        }
    }

    /// Learns the dot at `place`. None where the window leaves the image.
    pub fn learn(&self, grey: &[u8], size: SizePx, place: Vec2) -> Option<Template> {
        if !self.holds(size, place) {
            return None;
        }
        let (side, middle) = (self.side, (self.side as f64 - 1.0) / 2.0);
        let wide = side + 2;
        // Samples of a window one pixel wider on each side, for slopes.
        let mut seen = vec![0.0; wide * wide];
        let mut at = place;
        let whole = Part { left: 0, top: 0, width: side, height: side };
        let mut all = vec![0; side * side];
        for (x, y) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            at = sample(side, whole, grey, size, place + Vec2::new(x, y), &mut all) - Vec2::new(x, y);
            let (left, top) = ((1.0 + x) as usize, (1.0 + y) as usize);
            for (row, samples) in all.chunks_exact(side).enumerate() {
                let out = &mut seen[(row + top) * wide + left..][..side];
                out.iter_mut().zip(samples).for_each(|(o, &v)| *o = f64::from(v) / STEPS_PER_LEVEL);
            }
        }
        // Depth of this dot: the projection of the window onto the dot of unit depth.
        let [flat, ..] = self.with_slopes(&seen);
        let mut flat = [flat];
        self.level(&mut flat);
        let unit = &self.dot.patterns[0];
        let [of_seen] = self.products_with(&flat, unit);
        let [of_unit, ..] = self.products_with(&self.dot.patterns, unit);
        let depth = of_seen / of_unit;
        let deep = |of: &[Vec<f64>; OF_DOT]| of.each_ref().map(|v| v.iter().map(|v| v * depth).collect::<Vec<f64>>());
        let weave: Vec<f64> = seen.iter().zip(&self.dot.wide).map(|(v, d)| v - d * depth).collect();
        let weave = self.with_slopes(&weave);
        let mut level_weave = weave.clone();
        self.level(&mut level_weave);
        let (weights, weave_scale) = self.weigh(&level_weave);
        let patterns = in_turn(deep(&self.dot.patterns), level_weave);
        let bare = in_turn(deep(&self.dot.bare), weave);
        let gram = std::array::from_fn(|j| self.products_with(&patterns, &patterns[j]));
        let from_middle = |i: usize| i as f64 - middle;
        let mut stretched = [[[0.0; 4]; 2]; PATTERNS];
        for (of, part) in (0..2).flat_map(|of| (0..4).map(move |part| (of, part))) {
            let mut moved = bare[2 * (1 + part / 2) + of].clone();
            for (y, row) in moved.chunks_exact_mut(side).enumerate() {
                for (x, v) in row.iter_mut().enumerate() {
                    *v *= from_middle(if part % 2 == 0 { x } else { y });
                }
            }
            for (stretched, product) in stretched.iter_mut().zip(self.products_with(&patterns, &moved)) {
                stretched[of][part] = product;
            }
        }
        let levels = in_turn(self.dot.scale.map(|s| depth / s), weave_scale.map(|s| 1.0 / s));
        Some(Template { offset: place - at, weights, levels: levels.map(|l| l / STEPS_PER_LEVEL), gram, stretched })
    }
}

/// Darkness of the dots at `places`, by distance from their middle in steps of `step_px`: the mean over all of them, 1
/// in the middle and 0 from `end_px` on. Their surroundings, a weave or a slope of light, differ and cancel.
pub fn darkness(grey: &[u8], size: SizePx, places: impl Iterator<Item = Vec2>, step_px: f64, end_px: f64) -> Vec<f64> {
    let count = (end_px / step_px).ceil() as usize + 1;
    let (mut sums, mut counts) = (vec![0.0; count], vec![0.0; count]);
    let reach = end_px.ceil();
    let inside = |v: f64, end: usize| v >= reach + 1.0 && v + reach + 2.0 < end as f64;
    for place in places.filter(|p| inside(p.x, size.width) && inside(p.y, size.height)) {
        for y in (place.y - reach) as usize..=(place.y + reach) as usize {
            for x in (place.x - reach) as usize..=(place.x + reach) as usize {
                let steps = (Vec2::new(x as f64, y as f64) - place).length() / step_px;
                let ring = steps as usize;
                let share = steps - ring as f64;
                if ring + 1 < count {
                    let level = f64::from(grey[y * size.width + x]);
                    for (ring, share) in [(ring, 1.0 - share), (ring + 1, share)] {
                        sums[ring] += share * level;
                        counts[ring] += share;
                    }
                }
            }
        }
    }
    let means: Vec<f64> = sums.iter().zip(&counts).map(|(s, c)| s / f64::max(*c, 1e-9)).collect();
    let (middle, beside) = (means[0], means[count - 2]);
    let contrast = if (beside - middle).abs() < 1e-6 { 1.0 } else { beside - middle };
    let mut dark: Vec<f64> = means.iter().map(|m| (beside - m) / contrast).collect();
    dark[count - 2..].fill(0.0);
    dark
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integer weights, but no accumulated rounding error.
    #[test]
    fn a_level_of_light_weighs_nothing() {
        let window = Window::new(9.3, |r| (1.0 - r / 6.0).max(0.0));
        let (seen, side) = (SizePx::new(60, 60), 60);
        let grey: Vec<u8> = (0..side * side).map(|i| 120 + (i * i % 71) as u8).collect();
        let template = window.learn(&grey, seen, Vec2::new(30.2, 29.7)).expect("inside");
        for k in 0..PATTERNS {
            let lists = if k % 2 == 0 { &window.dot.weights } else { &template.weights };
            let weights = || lists.iter().flat_map(|lists| lists[k / 2]).map(i32::from);
            assert!(weights().sum::<i32>().abs() <= 1, "pattern {k}");
            assert!((100..=128).contains(&weights().map(i32::abs).max().expect("weights")), "pattern {k}");
        }
    }
}
