//! The grid on which windows are sampled, and what is known of the dots of a finger.

use super::part::{FULL_WEIGHT, Part, side_by_side};
use super::sums::{LANES, WEIGHED_LANES, energy, products};
use crate::image::SizePx;
use crate::plane::Vec2;

/// Sampled values per grey level.
pub(super) const STEPS_PER_LEVEL: f64 = 16.0;
/// Dot, weave, and the slopes of both along x and y: even ones are of the dot, odd ones of the weave.
pub(super) const PATTERNS: usize = 6;
pub(super) const OF_DOT: usize = 3;
pub(super) const OF_WEAVE: usize = 3;

/// The grid on which windows are sampled, what all dots of a finger have in common, and the scratch memory for one window.
#[derive(Debug, Clone)]
pub struct Window {
    pub(super) side: usize,
    /// Weight of each pixel, falling to zero towards the rim of the window.
    pub(super) share: Vec<f64>,
    /// The pixels with a weight.
    pub(super) inside: Vec<usize>,
    /// Orthonormal under these weights: level and slopes.
    pub(super) plane: [Vec<f64>; 3],
    /// The part of the window outside which all weights are zero: only this part is sampled.
    pub(super) part: Part,
    pub(super) plane_weights: Vec<[[i8; WEIGHED_LANES]; 3]>,
    pub(super) plane_scale: f64,
    pub(super) share_weights: Vec<i16>,
    pub(super) dot: Dot,
    pub(super) samples: Vec<i16>,
}

/// What is learned of one dot at rest.
#[derive(Debug, Clone)]
pub struct Template {
    /// From the middle of the window to the dot, px: at most a 32nd of a pixel along x and y.
    pub(super) offset: Vec2,
    /// The weave and its slopes, without level and slope of light and multiplied by the weight of each pixel.
    pub(super) weights: Vec<[[i8; WEIGHED_LANES]; OF_WEAVE]>,
    /// Levels per unit of a sum of products.
    pub(super) levels: [f64; PATTERNS],
    /// Products of the patterns with one another.
    pub(super) gram: [[f64; PATTERNS]; PATTERNS],
    /// Response of each pattern to a stretch of dot and of weave: x and y times their slopes along x, then along y.
    pub(super) stretched: [[[f64; 4]; 2]; PATTERNS],
}

/// A dot of unit depth in the middle of a window, and its slopes along x and along y: the dots of a finger are equally
/// wide, and only their depths differ. So their weights are read once for all markers.
#[derive(Debug, Clone, Default)]
pub(super) struct Dot {
    /// The dot alone.
    pub(super) bare: [Vec<f64>; OF_DOT],
    /// Without level and slope.
    pub(super) patterns: [Vec<f64>; OF_DOT],
    /// As in [`Template`].
    pub(super) weights: Vec<[[i8; WEIGHED_LANES]; OF_DOT]>,
    pub(super) scale: [f64; OF_DOT],
    /// Its darkness on the window, one pixel wider on each side.
    pub(super) wide: Vec<f64>,
}

impl Window {
    /// For patterns that reach `radius_px` from the middle; `dark(r)` is the darkness of a dot at r px from its middle,
    /// between 0 and 1.
    pub fn new(radius_px: f64, dark: impl Fn(f64) -> f64) -> Self {
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
        let (dot, samples) = (Dot::default(), part.zeros());
        let mut window =
            Window { side, share, inside, plane, part, plane_weights, plane_scale, share_weights, dot, samples };
        window.dot = window.draw(dark);
        window
    }

    /// Whether a window about a place lies within the image.
    pub(super) fn holds(&self, size: SizePx, place: Vec2) -> bool {
        let reach = (self.side as f64 - 1.0) / 2.0;
        let inside = |v: f64, end: usize| v >= reach + 2.0 && v + reach + 3.0 < end as f64;
        inside(place.x, size.width) && inside(place.y, size.height)
    }

    /// The same of a window that is expected to show the dot of a template at a place.
    pub fn holds_dot(&self, template: &Template, size: SizePx, place: Vec2) -> bool {
        self.holds(size, place - template.offset)
    }

    /// Sum of squares of the sampled window not explained by level or slope, levels squared.
    pub(super) fn energy(&self) -> f64 {
        let mut sum = energy(&self.samples, &self.share_weights) as f64 / STEPS_PER_LEVEL / STEPS_PER_LEVEL;
        for part in products(&self.samples, &self.plane_weights) {
            let part = part as f64 / (self.plane_scale * STEPS_PER_LEVEL);
            sum -= part * part;
        }
        sum.max(1e-9)
    }
}

/// Values of the dot and of the weave, in the order of the patterns.
pub(super) fn in_turn<T>([dot, dot_x, dot_y]: [T; OF_DOT], [weave, weave_x, weave_y]: [T; OF_WEAVE]) -> [T; PATTERNS] {
    [dot, weave, dot_x, weave_x, dot_y, weave_y]
}
