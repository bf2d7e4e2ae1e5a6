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

    /// The values of a whole window of `side` inside this part, as integers. The rounding error of each is carried to
    /// the next, so that a vector orthogonal to a constant stays so.
    fn cut(self, window: impl Iterator<Item = f64>, scale: f64, side: usize) -> Vec<i16> {
        let (columns, rows) = (self.left..self.left + self.width, self.top..self.top + self.height);
        let inside = |(i, _): &(usize, f64)| columns.contains(&(i % side)) && rows.contains(&(i / side));
        let (mut cut, mut owed) = (self.zeros(), 0.0);
        for (cut, (_, value)) in cut.iter_mut().zip(window.enumerate().filter(inside)) {
            let wanted = value * scale + owed;
            *cut = wanted.round() as i16;
            owed = wanted - f64::from(*cut);
        }
        cut
    }
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
        let plane_weights = side_by_side(std::array::from_fn(|k| {
            part.cut(plane[k].iter().zip(&share).map(|(v, s)| v * s), plane_scale, side)
        }));
        let share_weights = part.cut(share.iter().copied(), 256.0, side);
        Window { side, share, plane, part, plane_weights, plane_scale, share_weights, samples: part.zeros() }
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

    /// Removes level and slope from a pattern.
    fn level(&self, pattern: &mut [f64]) {
        for plane in &self.plane {
            let part: f64 = pattern.iter().zip(plane).zip(&self.share).map(|((v, p), s)| v * p * s).sum();
            pattern.iter_mut().zip(plane).for_each(|(v, p)| *v -= part * p);
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
        let disc: Vec<f64> = (0..wide * wide)
            .map(|i| {
                let q = Vec2::new((i % wide) as f64 - middle - 1.0, (i / wide) as f64 - middle - 1.0);
                -dark((q - (place - at)).length())
            })
            .collect();
        let inner =
            |v: &[f64]| -> Vec<f64> { (0..side * side).map(|i| v[(i / side + 1) * wide + i % side + 1]).collect() };
        let slope = |v: &[f64], step: usize| -> Vec<f64> {
            let middle = |i: usize| (i / side + 1) * wide + i % side + 1;
            (0..side * side).map(|i| (v[middle(i) + step] - v[middle(i) - step]) / 2.0).collect()
        };
        // Depth of this dot: the projection of the window onto the disc.
        let (mut flat_disc, mut flat_seen) = (inner(&disc), inner(&seen));
        self.level(&mut flat_disc);
        self.level(&mut flat_seen);
        let share = &self.share;
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(share).map(|((a, b), s)| a * b * s).sum::<f64>();
        let depth = product(&flat_disc, &flat_seen) / product(&flat_disc, &flat_disc);
        let dot: Vec<f64> = disc.iter().map(|v| v * depth).collect();
        let weave: Vec<f64> = seen.iter().zip(&dot).map(|(v, d)| v - d).collect();
        let mut patterns =
            [inner(&dot), inner(&weave), slope(&dot, 1), slope(&weave, 1), slope(&dot, wide), slope(&weave, wide)];
        let bare = patterns.clone();
        patterns.iter_mut().for_each(|p| self.level(p));
        let gram = std::array::from_fn(|j| std::array::from_fn(|k| product(&patterns[j], &patterns[k])));
        let stretched = std::array::from_fn(|k| {
            std::array::from_fn(|of| {
                std::array::from_fn(|part| {
                    let slope = &bare[2 * (1 + part / 2) + of];
                    let arms =
                        (0..side * side).map(|i| if part % 2 == 0 { i % side } else { i / side } as f64 - middle);
                    let moved: Vec<f64> = slope.iter().zip(arms).map(|(v, arm)| v * arm).collect();
                    product(&patterns[k], &moved)
                })
            })
        });
        let highest = |p: &[f64]| p.iter().zip(share).fold(1e-9f64, |m, (v, s)| m.max((v * s).abs()));
        let scale: [f64; PATTERNS] = std::array::from_fn(|k| FULL_WEIGHT / highest(&patterns[k]));
        let weighed = |k: usize| patterns[k].iter().zip(share).map(|(v, s)| v * s);
        let weights = side_by_side(std::array::from_fn(|k| self.part.cut(weighed(k), scale[k], side)));
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
                let (ring, share) = (steps as usize, steps.fract());
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
