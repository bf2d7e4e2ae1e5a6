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

mod learn;
mod part;
mod sums;
mod window;

pub use learn::darkness;
pub use window::{Template, Window};

use crate::image::SizePx;
use crate::plane::Vec2;
use part::sample;
use sums::products;
use window::{PATTERNS, in_turn};

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
    /// The best fit of a template near `from`, within `reach_px` of it; None at the border or when it leaves that
    /// reach.
    pub fn find(&mut self, template: &Template, grey: &[u8], size: SizePx, from: Start, reach_px: f64) -> Option<Fit> {
        let Start { place, weave, stretch } = from;
        let start = place - template.offset;
        let g = &template.gram;
        let (mut dot, mut weave, before) = (1.0, weave, weave);
        let mut place = start;
        for pass in 1..=PASSES {
            if !self.holds(size, place) {
                return None; // also when it is not a number
            }
            let at = sample(self.side, self.part, grey, size, place, &mut self.samples);
            let of_dot = products(&self.samples, &self.dot.weights);
            let weighed = in_turn(of_dot, products(&self.samples, &template.weights));
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
                return Some(Fit { place: place + template.offset, dot: new_dot, weave: new_weave, explained });
            }
        }
        None
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows are sampled at sixteenths of a pixel: a dot half a step beside them is not found half a step away.
    #[test]
    fn a_dot_is_found_where_it_was_learned() {
        let size = SizePx::new(80, 80);
        let cone = |away_px: f64| (1.0 - away_px / 6.0).max(0.0);
        let place = Vec2::new(40.0 + 1.0 / 32.0 - 1e-6, 39.5 - 1.0 / 32.0 + 1e-6);
        let level = |x: usize, y: usize| {
            let at = Vec2::new(x as f64, y as f64);
            let weave = 12.0 * (libm::sin(0.9 * at.x) + libm::sin(0.8 * at.y + 0.4));
            (150.0 + weave - 70.0 * cone((at - place).length())).round() as u8
        };
        let grey: Vec<u8> = (0..size.area()).map(|i| level(i % size.width, i / size.width)).collect();
        let mut window = Window::new(9.3, cone);
        let template = window.learn(&grey, size, place).expect("inside");
        for away in [Vec2::ZERO, Vec2::new(0.9, -0.7), Vec2::new(-0.4, 1.1)] {
            let start = Start { place: place + away, weave: 1.0, stretch: [Vec2::ZERO; 2] };
            let fit = window.find(&template, &grey, size, start, 3.0).expect("there");
            assert!((fit.place - place).length() < 0.025, "{away:?}: {fit:?}");
            assert!((fit.dot - 1.0).abs() < 0.02 && (fit.weave - 1.0).abs() < 0.05 && fit.explained > 0.98, "{fit:?}");
        }
    }
}
