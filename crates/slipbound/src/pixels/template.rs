//! Tracks one dot by its appearance and that of the skin around it: grey window + learned patterns -> shift and
//! strengths.
//!
//! ```text
//!   window of the frame   =   level + slope   +   a * dot   +   b * weave around it       dot, weave: as at rest
//!                                                  .-.           # # #
//!                                                 ( # )         # . # .                  all four move together:
//!                                                  '-'           # # #                   they are of one skin
//! ```
//! A gap of a pressed weave may be as dark and as wide as a dot. Dot and weave together are unique in their vicinity.
//!
//! The shift is the least-squares solution for a, b and both shifts at once (Gauss-Newton), on sums of products with
//! vectors tabulated at rest. These vectors are orthogonal to a constant and to a slope of light. Windows and vectors
//! are integers: sums are the same in any order.

mod sums;

use crate::image::SizePx;
use crate::plane::{Vec2, nearest_px};
use sums::{LANES, ROUND, WEIGHED_LANES, bilinear, energy, products};

/// Sampling steps per pixel; the fit compensates the remainder.
const STEPS_PER_PX: f64 = 16.0;
/// Sampled values per grey level.
const STEPS_PER_LEVEL: f64 = 16.0;
/// The largest tabulated weight, a byte: the weights of all markers, about a megabyte, are read in every frame; with
/// two bytes each the markers of a fabric skin took an eighth longer.
const FULL_WEIGHT: f64 = 127.0;
/// Dot, weave, and the slopes of both along x and y.
const PATTERNS: usize = 6;

/// The grid on which windows are sampled, and the scratch memory for one of them.
#[derive(Debug, Clone)]
pub struct Window {
    side: usize,
    /// Weight of each pixel, falling to zero towards the rim of the window.
    share: Vec<f64>,
    /// The pixels with a weight.
    inside: Vec<usize>,
    /// Orthonormal under these weights: level and slopes.
    plane: [Vec<f64>; 3],
    /// The part of the window outside which all weights are zero: only this part is sampled.
    part: Part,
    plane_weights: Vec<[[i8; WEIGHED_LANES]; 3]>,
    plane_scale: f64,
    share_weights: Vec<i16>,
    samples: Vec<i16>,
}

/// Some columns and rows of a window.
#[derive(Debug, Clone, Copy)]
struct Part {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Part {
    /// The part of a square of `side` where `share` is not zero, at least as wide as the lanes.
    fn of(share: &[f64], side: usize) -> Self {
        let is_empty = |row: usize| share[row * side..][..side].iter().all(|s| *s == 0.0);
        // The weights are the same on all four sides.
        let rim = (0..side / 2).take_while(|row| is_empty(*row)).count();
        let seen = side - 2 * rim;
        let width = seen.max(LANES);
        Part { left: rim.min(side - width), top: rim, width, height: seen }
    }

    /// Memory for its pixels.
    fn zeros(self) -> Vec<i16> {
        vec![0; (self.width * self.height).next_multiple_of(ROUND)]
    }

    /// Values inside this part, multiplied by `scale`, as integers; `values` takes the index of a pixel in the whole
    /// window of `side`. The rounding error of each is carried to the next, so that a vector orthogonal to a constant
    /// stays so. Several side by side: each waits for its last rounding.
    fn cut<const N: usize>(self, values: impl Fn(usize) -> [f64; N], scale: [f64; N], side: usize) -> [Vec<i16>; N] {
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

/// What is learned of one dot at rest.
#[derive(Debug, Clone)]
pub struct Template {
    /// The patterns, without level and slope and multiplied by the weight of each pixel.
    weights: Vec<[[i8; WEIGHED_LANES]; PATTERNS]>,
    /// Levels per unit of a sum of products.
    levels: [f64; PATTERNS],
    /// Products of the patterns with one another.
    gram: [[f64; PATTERNS]; PATTERNS],
    /// Response of each pattern to a stretch of dot and of weave: x and y times their slopes along x, then along y.
    stretched: [[[f64; 4]; 2]; PATTERNS],
}

/// Where the search for a template starts, and the known state of the skin there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Place, px.
    pub place: Vec2,
    /// Previous strength of the weave, 1 at rest.
    pub weave: f64,
    /// Displacement gradient of the skin along x and along y.
    pub stretch: [Vec2; 2],
}

/// Where a template was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Where the dot is, px.
    pub place: Vec2,
    /// Strength of the dot, 1 at rest.
    pub dot: f64,
    /// Strength of the weave, 1 at rest.
    pub weave: f64,
    /// Share of the window's variance that dot and weave explain, 0 to 1.
    pub explained: f64,
}

impl Window {
    /// For patterns that reach `radius_px` from the middle.
    pub fn new(radius_px: f64) -> Self {
        let side = ((2.0 * radius_px).ceil() as usize).next_multiple_of(LANES);
        let middle = (side as f64 - 1.0) / 2.0;
        let arm = |i: usize| Vec2::new((i % side) as f64 - middle, (i / side) as f64 - middle);
        let share: Vec<f64> = (0..side * side)
            .map(|i| {
                let t = ((radius_px - arm(i).length()) / (0.3 * radius_px)).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&share).map(|((a, b), s)| a * b * s).sum::<f64>();
        let unit = |v: Vec<f64>| {
            let length = dot(&v, &v).sqrt();
            v.into_iter().map(|v| v / length).collect::<Vec<f64>>()
        };
        let of = |part: &dyn Fn(Vec2) -> f64| unit((0..side * side).map(|i| part(arm(i))).collect());
        // By symmetry these are orthogonal.
        let plane = [of(&|_| 1.0), of(&|p| p.x), of(&|p| p.y)];
        let most = plane.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        let plane_scale = FULL_WEIGHT / most;
        let part = Part::of(&share, side);
        let plane_weights =
            side_by_side(part.cut(|i| [0, 1, 2].map(|k: usize| plane[k][i] * share[i]), [plane_scale; 3], side));
        let [share_weights] = part.cut(|i| [share[i]], [256.0], side);
        let inside = (0..side * side).filter(|&i| share[i] > 0.0).collect();
        Window { side, share, inside, plane, part, plane_weights, plane_scale, share_weights, samples: part.zeros() }
    }

    /// Whether a window about a place lies within the image.
    pub fn holds(&self, size: SizePx, place: Vec2) -> bool {
        let reach = (self.side as f64 - 1.0) / 2.0;
        let inside = |v: f64, end: usize| v >= reach + 2.0 && v + reach + 3.0 < end as f64;
        inside(place.x, size.width) && inside(place.y, size.height)
    }

    /// Sum of squares of the sampled window not explained by level or slope, levels squared.
    fn energy(&self) -> f64 {
        let mut sum = energy(&self.samples, &self.share_weights) as f64 / STEPS_PER_LEVEL / STEPS_PER_LEVEL;
        for part in products(&self.samples, &self.plane_weights) {
            let part = part as f64 / (self.plane_scale * STEPS_PER_LEVEL);
            sum -= part * part;
        }
        sum.max(1e-9)
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

    /// Learns the dot at `place`: `dark(r)` is the darkness of a dot at r px from its middle, between 0 and 1. None
    /// where the window leaves the image.
    pub fn learn(&self, grey: &[u8], size: SizePx, place: Vec2, dark: impl Fn(f64) -> f64) -> Option<Template> {
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
        let from_middle = |i: usize| i as f64 - middle;
        let mut disc = Vec::with_capacity(wide * wide);
        for y in 0..wide {
            let q = |x: usize| Vec2::new(from_middle(x) - 1.0, from_middle(y) - 1.0);
            disc.extend((0..wide).map(|x| -dark((q(x) - (place - at)).length())));
        }
        // The rows of the window itself, `shift` samples further.
        let rows = |v: &[f64], shift: isize| -> Vec<f64> {
            let mut rows = Vec::with_capacity(side * side);
            for y in 0..side {
                rows.extend_from_slice(&v[((y + 1) * wide + 1).wrapping_add_signed(shift)..][..side]);
            }
            rows
        };
        let slope = |v: &[f64], step: isize| -> Vec<f64> {
            rows(v, step).iter().zip(rows(v, -step)).map(|(after, before)| (after - before) / 2.0).collect()
        };
        // Depth of this dot: the projection of the window onto the disc.
        let mut flat = [rows(&disc, 0), rows(&seen, 0)];
        self.level(&mut flat);
        let [of_disc, of_seen] = self.products_with(&flat, &flat[0]);
        let depth = of_seen / of_disc;
        let dot: Vec<f64> = disc.iter().map(|v| v * depth).collect();
        let weave: Vec<f64> = seen.iter().zip(&dot).map(|(v, d)| v - d).collect();
        let down = wide as isize;
        let mut patterns =
            [rows(&dot, 0), rows(&weave, 0), slope(&dot, 1), slope(&weave, 1), slope(&dot, down), slope(&weave, down)];
        let bare = patterns.clone();
        self.level(&mut patterns);
        let gram = std::array::from_fn(|j| self.products_with(&patterns, &patterns[j]));
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
        let share = &self.share;
        let highest = |p: &[f64]| p.iter().zip(share).fold(1e-9f64, |m, (v, s)| m.max((v * s).abs()));
        let scale: [f64; PATTERNS] = std::array::from_fn(|k| FULL_WEIGHT / highest(&patterns[k]));
        let weighed = |i: usize| std::array::from_fn(|k| patterns[k][i] * share[i]);
        let weights = side_by_side(self.part.cut(weighed, scale, side));
        Some(Template { weights, levels: scale.map(|s| 1.0 / (s * STEPS_PER_LEVEL)), gram, stretched })
    }

    /// The best fit of a template near `from`, within `reach_px` of it; None at the border or when it leaves that
    /// reach.
    pub fn find(&mut self, template: &Template, grey: &[u8], size: SizePx, from: Start, reach_px: f64) -> Option<Fit> {
        let Start { place: start, weave, stretch } = from;
        let g = &template.gram;
        let (mut dot, mut weave, before) = (1.0, weave, weave);
        let mut place = start;
        for pass in 1..=PASSES {
            if !self.holds(size, place) {
                return None; // also when it is not a number
            }
            let at = sample(self.side, self.part, grey, size, place, &mut self.samples);
            let weighed = products(&self.samples, &template.weights);
            let b: [f64; PATTERNS] = std::array::from_fn(|k| weighed[k] as f64 * template.levels[k]);
            // With the stretch, a point at q was at q - stretch q.
            let stretch = [stretch[0].x, stretch[1].x, stretch[0].y, stretch[1].y];
            let b: [f64; PATTERNS] = std::array::from_fn(|k| {
                let [of_dot, of_weave] = &template.stretched[k];
                let seen = of_dot.iter().zip(of_weave).zip(&stretch);
                b[k] + seen.map(|((d, w), e)| (dot * d + weave * w) * e).sum::<f64>()
            });
            // The strength of a weave that is hardly visible is held at its previous value.
            let hold = HOLD_LEVELS * HOLD_LEVELS * self.plane[0][0].powi(-2);
            // Derivatives with respect to dot, weave, and the shifts along x and along y.
            let slope = |k: usize, j: usize| -(dot * g[2 * k][j] + weave * g[2 * k + 1][j]);
            let both = |k: usize, l: usize| -(dot * slope(k, 2 * l) + weave * slope(k, 2 * l + 1));
            let shift = |k: usize| -(dot * b[2 * k] + weave * b[2 * k + 1]);
            let mut m = [
                [g[0][0], g[0][1], slope(1, 0), slope(2, 0), b[0]],
                [g[0][1], g[1][1] + hold, slope(1, 1), slope(2, 1), b[1] + hold * before],
                [slope(1, 0), slope(1, 1), both(1, 1), both(1, 2), shift(1)],
                [slope(2, 0), slope(2, 1), both(1, 2), both(2, 2), shift(2)],
            ];
            let [new_dot, new_weave, dx, dy] = solve(&mut m)?;
            let step = Vec2::new(dx, dy);
            let solved = new_dot * b[0] + new_weave * b[1] + dx * shift(1) + dy * shift(2);
            (dot, weave) = (new_dot.clamp(0.2, 3.0), new_weave.clamp(-1.0, 12.0));
            let length = step.length();
            let taken = if length > LONGEST_PX { step * (LONGEST_PX / length) } else { step };
            place = at + taken;
            if (place - start).length() > reach_px {
                return None;
            }
            if length < DONE_PX || pass == PASSES {
                let explained = (solved / self.energy()).clamp(0.0, 1.0);
                return Some(Fit { place, dot: new_dot, weave: new_weave, explained });
            }
        }
        None
    }
}

/// Samples a part of the window about a place; returns the middle of the sampled window, at most a 32nd of a pixel away
/// on each axis.
fn sample(side: usize, part: Part, grey: &[u8], size: SizePx, place: Vec2, out: &mut [i16]) -> Vec2 {
    let reach = (side as f64 - 1.0) / 2.0;
    let steps = |v: f64| nearest_px((v - reach) * STEPS_PER_PX) as usize;
    let (x, y) = (steps(place.x), steps(place.y));
    let (column, row) = (x / STEPS_PER_PX as usize + part.left, y / STEPS_PER_PX as usize + part.top);
    let (fx, fy) = ((x % STEPS_PER_PX as usize) as i16, (y % STEPS_PER_PX as usize) as i16);
    let out = &mut out[..part.width * part.height];
    bilinear(&grey[row * size.width + column..], size.width, part.width, [fx, fy], out);
    Vec2::new(x as f64 / STEPS_PER_PX + reach, y as f64 / STEPS_PER_PX + reach)
}

/// A weave weaker than this at rest is held at its previous strength, levels.
const HOLD_LEVELS: f64 = 3.0;
/// Maximum number of passes, the longest step of one, and the step below which the fit is linear, px.
const PASSES: u32 = 6;
const LONGEST_PX: f64 = 1.5;
const DONE_PX: f64 = 0.15;

/// Gaussian elimination; the matrix is symmetric and positive. None where it is singular.
fn solve(m: &mut [[f64; 5]; 4]) -> Option<[f64; 4]> {
    let mut inverse = [0.0; 4];
    for k in 0..4 {
        let pivot = m[k];
        if pivot[k].abs() < 1e-9 {
            return None;
        }
        inverse[k] = 1.0 / pivot[k];
        for row in &mut m[k + 1..] {
            let share = row[k] * inverse[k];
            row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= share * p);
        }
    }
    let mut x = [0.0; 4];
    for k in (0..4).rev() {
        let known: f64 = (k + 1..4).map(|j| m[k][j] * x[j]).sum();
        x[k] = (m[k][4] - known) * inverse[k];
    }
    Some(x)
}

/// Lists of weights, interleaved by lanes.
fn side_by_side<const LISTS: usize>(lists: [Vec<i16>; LISTS]) -> Vec<[[i8; WEIGHED_LANES]; LISTS]> {
    let lists = lists.each_ref().map(|list| list.as_chunks::<WEIGHED_LANES>().0);
    (0..lists[0].len())
        .map(|i| lists.map(|list| list[i].map(|weight| weight.clamp(i8::MIN.into(), i8::MAX.into()) as i8)))
        .collect()
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
        let window = Window::new(9.3);
        let (seen, side) = (SizePx::new(60, 60), 60);
        let grey: Vec<u8> = (0..side * side).map(|i| 120 + (i * i % 71) as u8).collect();
        let template = window.learn(&grey, seen, Vec2::new(30.2, 29.7), |r| (1.0 - r / 6.0).max(0.0)).expect("inside");
        for k in 0..PATTERNS {
            let weights = || template.weights.iter().flat_map(|lists| lists[k]).map(i32::from);
            assert!(weights().sum::<i32>().abs() <= 1, "pattern {k}");
            assert!((100..=128).contains(&weights().map(i32::abs).max().expect("weights")), "pattern {k}");
        }
    }

    /// For every window size, the part cut away has no weight.
    #[test]
    fn the_part_that_is_weighed_holds_every_share() {
        for tenths in 20..400 {
            let window = Window::new(f64::from(tenths) / 10.0);
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
            let Window { side, part, mut samples, .. } = Window::new(radius_px);
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
