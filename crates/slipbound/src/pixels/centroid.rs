//! Where one dot is, to a few hundredths of a pixel: grey window -> centre, by the pull of its edge.
//!
//! The centre c is where the pull `F(c) = sum over pixels of w(|p - c|) (p - c) grey(p)` vanishes. With
//! `w(r) = g(r) / r`, g the slope of the edge, this is the maximum-likelihood position of a round dot in white
//! noise; with w = 1 it would be the plain centroid, which listens as much to the noise inside and outside.
//! An outer ring of small negative weight makes F blind to a constant and to a slope of light.
//!
//! ```text
//!   w |      ___
//!     |     /   \            r = 0: dot centre     peak: the edge, at half the diameter
//!     |____/     \_
//!     +------------\________---> r
//!                   -------       the ring, against slopes of light
//! ```

use crate::image::SizePx;
use crate::plane::Vec2;

/// Table entries per squared pixel of distance.
const STEPS_PER_PX2: f64 = 16.0;

/// The weights of one dot size.
#[derive(Debug, Clone)]
pub struct EdgeKernel {
    radius_px: f64,
    reach_px: f64,
    weight: Vec<f32>,
}

impl EdgeKernel {
    /// Weights for dots of `diameter_px` whose neighbours are `pitch_px` away. `edge_share`: half the width of the edge
    /// that pulls, in radii of the dot; at least 0.8 px, the blur of a good lens.
    pub fn new(diameter_px: f64, pitch_px: f64, edge_share: f64) -> Self {
        let radius = diameter_px / 2.0;
        let edge = (edge_share * radius).max(0.8);
        let inner = radius + 1.6 * edge;
        // The ring stays off the edges of the neighbours.
        let outer = (radius + 5.5 * edge).min(pitch_px - radius - edge).max(inner + 1.5);
        let pull = |r: f64| {
            let t = (r - radius) / edge;
            libm::exp(-0.5 * t * t) / r.max(0.5 * edge)
        };
        let ring = |r: f64| {
            if r < inner || r > outer {
                return 0.0;
            }
            let s = libm::sin(std::f64::consts::PI * (r - inner) / (outer - inner));
            s * s
        };
        // sum w x^2 = pi * integral of w r^3 dr must vanish.
        let moment = |w: &dyn Fn(f64) -> f64| {
            let steps = 4000;
            (0..steps).map(|i| (i as f64 + 0.5) / steps as f64 * outer).map(|r| w(r) * r * r * r).sum::<f64>()
        };
        let share = moment(&pull) / moment(&ring);
        let entries = libm::ceil(outer * outer * STEPS_PER_PX2) as usize + 1;
        let weight = (0..entries)
            .map(|i| {
                let r = ((i as f64 + 0.5) / STEPS_PER_PX2).sqrt();
                (pull(r) - share * ring(r)) as f32
            })
            .collect();
        EdgeKernel { radius_px: radius, reach_px: outer, weight }
    }

    /// How far from the centre pixels are looked at.
    pub fn reach_px(&self) -> f64 {
        self.reach_px
    }

    /// Whether a dot centred here lies whole in the image, its rim included.
    pub fn holds(&self, size: SizePx, centre: Vec2) -> bool {
        let margin = self.radius_px + 0.5;
        let (x_max, y_max) = (size.width as f64 - 1.0 - margin, size.height as f64 - 1.0 - margin);
        centre.x >= margin && centre.x <= x_max && centre.y >= margin && centre.y <= y_max
    }

    /// The pull F at `centre`: positive x when brighter pixels lie at larger x. None where the border of the image
    /// would cut the dot: there the rest of its rim pulls it inwards.
    pub fn pull(&self, grey: &[u8], size: SizePx, centre: Vec2) -> Option<Vec2> {
        if !self.holds(size, centre) {
            return None; // also when the centre is not a number
        }
        let reach = self.reach_px;
        let from = |c: f64| (c - reach).ceil().max(0.0) as usize;
        let to = |c: f64, end: usize| ((c + reach).floor() as usize).min(end - 1);
        let (left, right) = (from(centre.x), to(centre.x, size.width));
        let (top, bottom) = (from(centre.y), to(centre.y, size.height));
        // On a pixel grid the ring cancels a constant only roughly: take off the level of the window's rim first.
        let rim = [top, bottom].map(|y| &grey[y * size.width..][left..=right]);
        let rim_sum: u32 = rim.iter().flat_map(|row| row.iter()).map(|&v| u32::from(v)).sum();
        let level = rim_sum as f32 / (2 * (right - left + 1)) as f32;
        let (mut fx, mut fy) = (0.0f32, 0.0f32);
        for y in top..=bottom {
            let row = &grey[y * size.width..][left..=right];
            let dy = (y as f64 - centre.y) as f32;
            let first_dx = (left as f64 - centre.x) as f32;
            let steps = STEPS_PER_PX2 as f32;
            let (mut row_sum, mut row_x) = (0.0f32, 0.0f32);
            for (i, &v) in row.iter().enumerate() {
                let dx = first_dx + i as f32;
                let index = ((dx * dx + dy * dy) * steps) as usize;
                let pull = self.weight.get(index).copied().unwrap_or(0.0) * (f32::from(v) - level);
                row_sum += pull;
                row_x += pull * dx;
            }
            fx += row_x;
            fy += row_sum * dy;
        }
        Some(Vec2::new(f64::from(fx), f64::from(fy)))
    }

    /// How fast the pull grows when the assumed centre leaves the dot, by moving it half a pixel each way:
    /// negative for a dark dot, positive for a bright one, per level and px. None at the border.
    pub fn stiffness(&self, grey: &[u8], size: SizePx, centre: Vec2) -> Option<f64> {
        let x = Vec2::new(0.5, 0.0);
        let y = Vec2::new(0.0, 0.5);
        let along = self.pull(grey, size, centre + x)?.x - self.pull(grey, size, centre - x)?.x;
        let across = self.pull(grey, size, centre + y)?.y - self.pull(grey, size, centre - y)?.y;
        Some((along + across) / 2.0)
    }

    /// The stiffness on a round dark dot of one level of depth whose edge is as sharp as this kernel listens for.
    pub fn stiffness_of_a_disc(&self, edge_px: f64) -> f64 {
        let side = 2 * self.reach_px.ceil() as usize + 5;
        let (size, centre) = (SizePx::new(side, side), Vec2::new(1.0, 1.0) * (side / 2) as f64);
        let disc: Vec<u8> = (0..size.area())
            .map(|i| {
                let r = (Vec2::new((i % side) as f64, (i / side) as f64) - centre).length();
                let depth = 0.5 * libm::erfc((r - self.radius_px) / (edge_px * std::f64::consts::SQRT_2));
                (200.0 - 100.0 * depth).round() as u8
            })
            .collect();
        self.stiffness(&disc, size, centre).map_or(0.0, |s| s / 100.0)
    }

    /// The centre of the dot near `start`, by at most `steps` Newton steps with a known `stiffness` (from
    /// [`EdgeKernel::stiffness`]); a step is at most `longest_px`. None at the border of the image.
    pub fn centre(
        &self,
        grey: &[u8],
        size: SizePx,
        start: Vec2,
        stiffness: f64,
        longest_px: f64,
        steps: usize,
    ) -> Option<Vec2> {
        let mut centre = start;
        for _ in 0..steps {
            let mut step = self.pull(grey, size, centre)? / -stiffness;
            let length = step.length();
            if length > longest_px {
                step = step * (longest_px / length);
            }
            centre += step;
            if length < 0.004 {
                break;
            }
        }
        Some(centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dark soft disc on a slope of light.
    fn disc(size: SizePx, centre: Vec2, radius: f64, slope_levels_per_px: f64) -> Vec<u8> {
        (0..size.area())
            .map(|i| {
                let p = Vec2::new((i % size.width) as f64, (i / size.width) as f64);
                let r = (p - centre).length();
                let light = 120.0 + slope_levels_per_px * (p.x - 34.0);
                let depth = 70.0 / (1.0 + libm::exp((r - radius) / 0.45));
                (light - depth + 0.5).clamp(0.0, 255.0) as u8
            })
            .collect()
    }

    #[test]
    fn a_soft_disc_is_found_to_a_fiftieth_of_a_pixel_on_a_slope_of_light() {
        let size = SizePx::new(72, 70);
        for diameter in [4.0, 5.3, 8.0, 14.0] {
            let kernel = EdgeKernel::new(diameter, 2.8 * diameter, 0.35);
            for slope in [0.0, 1.5] {
                for step in 0..10 {
                    let truth = Vec2::new(34.0 + 0.137 * f64::from(step), 33.0 + 0.293 * f64::from(step));
                    let grey = disc(size, truth, diameter / 2.0, slope);
                    let start = truth + Vec2::new(0.6, -0.5);
                    let stiffness = kernel.stiffness(&grey, size, start).expect("inside");
                    let found = kernel.centre(&grey, size, start, stiffness, 1.0, 8).expect("inside");
                    let error = (found - truth).length();
                    assert!(error < 0.02, "diameter {diameter}, slope {slope}, {truth:?}: {error} px off");
                }
            }
        }
    }

    #[test]
    fn outside_the_image_there_is_no_pull() {
        let size = SizePx::new(40, 40);
        let kernel = EdgeKernel::new(8.0, 24.0, 0.35);
        let grey = vec![100; size.area()];
        assert_eq!(kernel.pull(&grey, size, Vec2::new(4.4, 20.0)), None);
        assert_eq!(kernel.pull(&grey, size, Vec2::new(f64::NAN, 20.0)), None);
        let flat = kernel.pull(&grey, size, Vec2::new(20.3, 19.6)).expect("inside");
        assert!(flat.length() < 2.0, "a flat image pulls {flat:?}");
    }
}
