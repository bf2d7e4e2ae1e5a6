//! Position of one dot, to a few hundredths of a pixel: grey window -> centre, by the pull of its edge.
//!
//! The centre c is where the pull `F(c) = sum over pixels of w(|p - c|) (p - c) grey(p)` vanishes. With
//! `w(r) = g(r) / r`, g the slope of the edge, this is the maximum-likelihood position of a round dot in white
//! noise; with w = 1 it would be the plain centroid, which is as sensitive to the noise inside and outside.
//! An outer ring of small negative weight makes F independent of a constant and of a linear slope of light.
//!
//! ```text
//!   w |      ___
//!     |     /   \            r = 0: dot centre     peak: the edge, at half the diameter
//!     |____/     \_
//!     +------------\________---> r
//!                   -------       the ring, against slopes of light
//! ```
//!
//! The weights are tabulated as integers for assumed centres an eighth of a pixel apart (a quarter for large dots): a
//! pull is a sum of products of integers, the same in any order. F is linear over half a pixel, so the step from the
//! nearest assumed centre to the true one is only as inaccurate as the stiffness.

use super::wide::wide;
use crate::image::SizePx;
use crate::plane::Vec2;

/// Assumed centres per pixel along each axis, and the largest half width of the window for which this many are used:
/// the tables of larger dots would exceed the cache.
const FINE: (usize, usize) = (8, 16);
/// Assumed centres per pixel along each axis for larger dots.
const COARSE: usize = 4;
/// The pull along the weaker axis of a dot is at least this share of the stronger one.
const STRIPE_RATIO: f64 = 0.25;
/// Number of pixels that are weighted in parallel.
const LANES: usize = 16;
/// The largest tabulated weight.
const FULL_WEIGHT: f64 = 8000.0;

/// The weights for one assumed centre: w(r) dx and w(r) dy, row by row over the window.
#[derive(Debug, Clone)]
struct Phase {
    along: Vec<i16>,
    across: Vec<i16>,
    /// Row by row first the one, then the other, each padded by zeros to a whole number of [`LANES`].
    padded: Vec<[i16; LANES]>,
    along_sum: i64,
    across_sum: i64,
}

/// The weights of one dot size.
#[derive(Debug, Clone)]
pub struct EdgeKernel {
    radius_px: f64,
    /// The window is `2 half + 1` pixels wide and high, about the whole pixel nearest to the assumed centre.
    half: usize,
    /// Assumed centres per pixel along each axis.
    per_px: usize,
    phases: Vec<Phase>,
    /// 1 for each pixel of a row of the window, padded by zeros to a whole number of [`LANES`].
    row: Vec<[i16; LANES]>,
}

impl EdgeKernel {
    /// Weights for dots of `diameter_px` whose neighbours are `pitch_px` away. `edge_share`: half the width of the edge
    /// that pulls, in radii of the dot; at least 0.8 px, the blur of a good lens.
    pub fn new(diameter_px: f64, pitch_px: f64, edge_share: f64) -> Self {
        let radius = diameter_px / 2.0;
        let edge = (edge_share * radius).max(0.8);
        let inner = radius + 1.6 * edge;
        // The ring must not reach the edges of the neighbours.
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
        let weight = |r: f64| if r > outer { 0.0 } else { pull(r) - share * ring(r) };
        let highest =
            (0..1000).map(|i| f64::from(i) / 1000.0 * outer).map(|r| (weight(r) * r).abs()).fold(0.0, f64::max);
        let half = (outer + 0.5).floor() as usize;
        let per_px = if half <= FINE.1 { FINE.0 } else { COARSE };
        let scaled = |r: f64| weight(r) * FULL_WEIGHT / highest;
        let phases = (0..per_px * per_px)
            .map(|i| Phase::new(half, offset(i % per_px, per_px), offset(i / per_px, per_px), scaled))
            .collect();
        let side = 2 * half + 1;
        let row: Vec<i16> = (0..side.next_multiple_of(LANES)).map(|x| i16::from(x < side)).collect();
        EdgeKernel { radius_px: radius, half, per_px, phases, row: row.as_chunks().0.to_vec() }
    }

    /// Whether a dot centred here lies entirely within the image, including its rim.
    pub fn holds(&self, size: SizePx, centre: Vec2) -> bool {
        let margin = self.radius_px + 0.5;
        let (x_max, y_max) = (size.width as f64 - 1.0 - margin, size.height as f64 - 1.0 - margin);
        centre.x >= margin && centre.x <= x_max && centre.y >= margin && centre.y <= y_max
    }

    /// The pull F near `centre`, and the assumed centre it is computed for, within half a step of the table on each
    /// axis. Positive x when brighter pixels lie at larger x. None where the border of the image would cut the dot:
    /// there the rest of its rim pulls it inwards.
    pub fn pull(&self, grey: &[u8], size: SizePx, centre: Vec2) -> Option<(Vec2, Vec2)> {
        if !self.holds(size, centre) {
            return None; // also when the centre is not a number
        }
        let (column, phase_x, x) = nearest(centre.x, self.per_px);
        let (row, phase_y, y) = nearest(centre.y, self.per_px);
        let (at, phase) = (Vec2::new(x, y), &self.phases[phase_y * self.per_px + phase_x]);
        let (half, side) = (self.half, 2 * self.half + 1);
        // The part of the window inside the image, in window coordinates.
        let part = |at: usize, end: usize| half.saturating_sub(at)..side.min(end + half - at);
        let (columns, rows) = (part(column, size.width), part(row, size.height));
        let whole = columns.len() == side && rows.len() == side;
        let corner = (row + rows.start - half) * size.width + column + columns.start - half;
        let padded_end = corner + (side - 1) * size.width + LANES * self.row.len();
        let [fx, fy, weight_x, weight_y, rim] = if whole && padded_end <= grey.len() {
            let [fx, fy, rim] = window_pull(&grey[corner..padded_end], size.width, &phase.padded, &self.row);
            [fx, fy, phase.along_sum, phase.across_sum, rim]
        } else {
            let line = |y: usize| &grey[corner + (y - rows.start) * size.width..][..columns.len()];
            let level = |y: usize| line(y).iter().map(|&v| i64::from(v)).sum::<i64>();
            let mut sums = [0, 0, 0, 0, level(rows.start) + level(rows.end - 1)];
            for y in rows.clone() {
                let weights = y * side + columns.start..y * side + columns.end;
                let (along, across) = (&phase.along[weights.clone()], &phase.across[weights]);
                let (x_sum, y_sum) = row_pull(line(y), along, across);
                let weight = |row: &[i16]| row.iter().map(|&w| i64::from(w)).sum::<i64>();
                let row = [i64::from(x_sum), i64::from(y_sum), weight(along), weight(across)];
                sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
            }
            sums
        };
        // On a pixel grid the ring cancels a constant only approximately: subtract the level of the window's rim.
        let level = rim as f64 / (2 * columns.len()) as f64;
        let force = Vec2::new(fx as f64 - level * weight_x as f64, fy as f64 - level * weight_y as f64);
        Some((force / FULL_WEIGHT, at))
    }

    /// Rate at which the pull grows when the assumed centre leaves the dot, from shifts of half a pixel each way:
    /// negative for a bright dot, positive for a dark one, per px. None at the border, and where it grows along one
    /// axis only: a stripe, or the foot of a slope of light, is no dot.
    pub fn stiffness(&self, grey: &[u8], size: SizePx, centre: Vec2) -> Option<f64> {
        let x = Vec2::new(0.5, 0.0);
        let y = Vec2::new(0.0, 0.5);
        let pull = |at: Vec2| self.pull(grey, size, at).map(|(force, _)| force);
        let along = pull(centre + x)?.x - pull(centre - x)?.x;
        let across = pull(centre + y)?.y - pull(centre - y)?.y;
        let (weak, strong) = if along.abs() < across.abs() { (along, across) } else { (across, along) };
        (weak * strong > 0.0 && weak.abs() >= STRIPE_RATIO * strong.abs()).then_some((along + across) / 2.0)
    }

    /// The stiffness for a round dark dot, one level deep, with an edge of this blur.
    pub fn stiffness_of_a_disc(&self, edge_px: f64) -> f64 {
        let side = 2 * self.half + 7;
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
            let (force, at) = self.pull(grey, size, centre)?;
            let mut step = force / -stiffness;
            let length = step.length();
            if length > longest_px {
                step = step * (longest_px / length);
            }
            centre = at + step;
            if length < 0.13 {
                break; // the pull is linear from here to the centre
            }
        }
        Some(centre)
    }
}

impl Phase {
    fn new(half: usize, dx: f64, dy: f64, weight: impl Fn(f64) -> f64) -> Self {
        let side = 2 * half + 1;
        let arm = |i: usize| Vec2::new((i % side) as f64 - half as f64 - dx, (i / side) as f64 - half as f64 - dy);
        let table = |part: &dyn Fn(Vec2) -> f64| -> Vec<i16> {
            (0..side * side).map(arm).map(|p| (weight(p.length()) * part(p)).round() as i16).collect()
        };
        let (along, across) = (table(&|p| p.x), table(&|p| p.y));
        let sum = |table: &[i16]| table.iter().map(|&w| i64::from(w)).sum();
        let zeros = side.next_multiple_of(LANES) - side;
        let padded: Vec<i16> = (along.chunks_exact(side).zip(across.chunks_exact(side)))
            .flat_map(|(along, across)| [along, across])
            .flat_map(|row| row.iter().copied().chain(std::iter::repeat_n(0, zeros)))
            .collect();
        let padded = padded.as_chunks().0.to_vec();
        Phase { along_sum: sum(&along), across_sum: sum(&across), along, across, padded }
    }
}

/// The pull over a whole window, and the sum of its first and last row: its rows lie `stride` apart in `grey`. `row`: 1
/// for each pixel of a row; pixels beyond have zero weight.
fn window_pull(grey: &[u8], stride: usize, weights: &[[i16; LANES]], row: &[[i16; LANES]]) -> [i64; 3] {
    #[cfg(target_arch = "x86_64")]
    {
        use super::wide::{Vectors, vectors};
        // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature of the kernels of that name,
        // or AVX-512 with VNNI, the features of the other.
        #[allow(unsafe_code)]
        match row.len() {
            2 if vectors() >= Vectors::Avx512Vnni => {
                return unsafe { avx512::window_pull(grey, stride, weights, row) };
            }
            1 if vectors() >= Vectors::Avx2 => return unsafe { avx2::window_pull::<1>(grey, stride, weights, row) },
            2 if vectors() >= Vectors::Avx2 => return unsafe { avx2::window_pull::<2>(grey, stride, weights, row) },
            3 if vectors() >= Vectors::Avx2 => return unsafe { avx2::window_pull::<3>(grey, stride, weights, row) },
            _ => {}
        }
    }
    any_window_pull(grey, stride, weights, row)
}

wide! {
    /// The twin of [`avx2::window_pull`] and [`avx512::window_pull`], which give the same sums, for windows of any width.
    fn any_window_pull(grey: &[u8], stride: usize, weights: &[[i16; LANES]], row: &[[i16; LANES]]) -> [i64; 3] {
        let mut sums = [0; 3];
        let per_row = row.len();
        let last = weights.len() / (2 * per_row) - 1;
        for (y, weights) in weights.chunks_exact(2 * per_row).enumerate() {
            let pixels = grey[y * stride..][..per_row * LANES].as_chunks::<LANES>().0;
            let (along, across) = weights.split_at(per_row);
            sums[0] += lanes_sum(pixels, along);
            sums[1] += lanes_sum(pixels, across);
            if y == 0 || y == last {
                sums[2] += lanes_sum(pixels, row);
            }
        }
        sums
    }
}

/// Sum of products.
#[inline(always)]
fn lanes_sum(pixels: &[[u8; LANES]], weights: &[[i16; LANES]]) -> i64 {
    let mut sum = 0i32;
    for (pixels, weights) in pixels.iter().zip(weights) {
        for i in 0..LANES {
            sum += i32::from(i16::from(pixels[i])) * i32::from(weights[i]);
        }
    }
    i64::from(sum)
}

/// Sums stay in registers over a whole window instead of a row: less than half of the time of the compiled twin.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::LANES;
    use crate::pixels::lanes::{bytes, sum, words};
    use std::arch::x86_64::*;

    /// Rows summed in 32 bits: two products of a pixel and a weight in each of three lanes, each below 255 x 8001.
    const ROWS: usize = 128;

    /// ```text
    ///   16 pixels --> 16 bits each  x  16 weights  --> 8 sums of two products, 32 bits each; added over rows
    /// ```
    #[target_feature(enable = "avx2")]
    pub(super) fn window_pull<const PER_ROW: usize>(
        grey: &[u8],
        stride: usize,
        weights: &[[i16; LANES]],
        row: &[[i16; LANES]],
    ) -> [i64; 3] {
        let mut sums = [0; 3];
        let weights = weights.as_chunks::<PER_ROW>().0.as_chunks::<2>().0;
        for (part, rows) in weights.chunks(ROWS).enumerate() {
            let (mut fx, mut fy) = (_mm256_setzero_si256(), _mm256_setzero_si256());
            for (y, [along, across]) in rows.iter().enumerate() {
                let pixels = &grey[(part * ROWS + y) * stride..][..PER_ROW * LANES];
                for ((pixels, along), across) in pixels.as_chunks::<LANES>().0.iter().zip(along).zip(across) {
                    let pixels = _mm256_cvtepu8_epi16(bytes(pixels));
                    fx = _mm256_add_epi32(fx, _mm256_madd_epi16(pixels, words(along)));
                    fy = _mm256_add_epi32(fy, _mm256_madd_epi16(pixels, words(across)));
                }
            }
            sums[0] += sum(fx);
            sums[1] += sum(fy);
        }
        let mut rim = _mm256_setzero_si256();
        for y in [0, weights.len() - 1] {
            let pixels = &grey[y * stride..][..PER_ROW * LANES];
            for (pixels, ones) in pixels.as_chunks::<LANES>().0.iter().zip(row) {
                rim = _mm256_add_epi32(rim, _mm256_madd_epi16(_mm256_cvtepu8_epi16(bytes(pixels)), words(ones)));
            }
        }
        sums[2] = sum(rim);
        sums
    }
}

/// A third of the instructions of [`avx2`], for windows of 17 to 32 pixels a row: each is one vector.
#[cfg(target_arch = "x86_64")]
mod avx512 {
    use super::LANES;
    use crate::pixels::lanes::{sum_of_16, wide_bytes, wide_words};
    use std::arch::x86_64::*;

    /// Rows summed in 32 bits, as in [`super::avx2`].
    const ROWS: usize = 256;

    /// ```text
    ///   32 pixels --> 16 bits each  x  32 weights  --> 16 sums of two products, 32 bits each; added over rows
    /// ```
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    pub(super) fn window_pull(grey: &[u8], stride: usize, weights: &[[i16; LANES]], row: &[[i16; LANES]]) -> [i64; 3] {
        let mut sums = [0; 3];
        let weights = weights.as_chunks::<2>().0.as_chunks::<2>().0;
        for (part, rows) in weights.chunks(ROWS).enumerate() {
            let (mut fx, mut fy) = (_mm512_setzero_si512(), _mm512_setzero_si512());
            for (y, [along, across]) in rows.iter().enumerate() {
                let Some(pixels) = grey[(part * ROWS + y) * stride..].first_chunk() else { break };
                let pixels = _mm512_cvtepu8_epi16(wide_bytes(pixels));
                fx = _mm512_add_epi32(fx, _mm512_madd_epi16(pixels, wide_words(along.as_flattened())));
                fy = _mm512_add_epi32(fy, _mm512_madd_epi16(pixels, wide_words(across.as_flattened())));
            }
            sums[0] += sum_of_16(fx);
            sums[1] += sum_of_16(fy);
        }
        let mut rim = _mm512_setzero_si512();
        for y in [0, weights.len() - 1] {
            let Some(pixels) = grey[y * stride..].first_chunk() else { break };
            let pixels = _mm512_cvtepu8_epi16(wide_bytes(pixels));
            rim = _mm512_dpwssd_epi32(rim, pixels, wide_words(row.as_flattened()));
        }
        sums[2] = sum_of_16(rim);
        sums
    }
}

/// Sums of products of a row of pixels with two rows of weights.
fn row_pull(pixels: &[u8], along: &[i16], across: &[i16]) -> (i32, i32) {
    let (mut x, mut y) = (0i32, 0i32);
    for ((&v, &a), &b) in pixels.iter().zip(along).zip(across) {
        let v = i32::from(i16::from(v));
        x += v * i32::from(a);
        y += v * i32::from(b);
    }
    (x, y)
}

/// The offset of a phase from its whole pixel, in -0.5..0.5 px, for `per_px` phases per pixel.
fn offset(phase: usize, per_px: usize) -> f64 {
    (phase as f64 + 0.5) / per_px as f64 - 0.5
}

/// The whole pixel, the phase and the assumed centre nearest to a coordinate, which must not be negative.
fn nearest(v: f64, per_px: usize) -> (usize, usize, f64) {
    let steps = ((v + 0.5) * per_px as f64).floor() as usize;
    let (pixel, phase) = (steps / per_px, steps % per_px);
    (pixel, phase, pixel as f64 + offset(phase, per_px))
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
            let kernel = EdgeKernel::new(diameter, 2.8 * diameter, 0.3);
            for slope in [0.0, 1.5] {
                for step in 0..10 {
                    let truth = Vec2::new(34.0 + 0.137 * f64::from(step), 33.0 + 0.293 * f64::from(step));
                    let grey = disc(size, truth, diameter / 2.0, slope);
                    let start = truth + Vec2::new(0.6, -0.5);
                    let stiffness = kernel.stiffness(&grey, size, start).expect("inside");
                    let rough = kernel.centre(&grey, size, start, stiffness, 1.0, 8).expect("inside");
                    let stiffness = kernel.stiffness(&grey, size, rough).expect("inside");
                    let found = kernel.centre(&grey, size, rough, stiffness, 1.0, 8).expect("inside");
                    let error = (found - truth).length();
                    assert!(error < 0.02, "diameter {diameter}, slope {slope}, {truth:?}: {error} px off");
                }
            }
        }
    }

    #[test]
    fn wide_windows_pull_as_plain_ones() {
        use crate::pixels::wide::{Vectors, with_vectors};
        let size = SizePx::new(150, 140);
        let grey: Vec<u8> = (0..size.area() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for (diameter, pitch) in [(4.0, 12.0), (8.0, 26.0), (14.0, 60.0), (24.0, 60.0), (30.0, 100.0)] {
            let kernel = EdgeKernel::new(diameter, pitch, 0.3);
            for place in [Vec2::new(70.3, 71.6), Vec2::new(66.9, 60.1), Vec2::new(80.0, 75.5)] {
                let pull = |widest| with_vectors(widest, || kernel.pull(&grey, size, place));
                let plain = pull(Vectors::Baseline);
                assert!(plain.is_some_and(|(force, _)| force.length() > 1.0));
                for widest in [Vectors::Avx512Vnni, Vectors::Avx512, Vectors::Avx2] {
                    assert_eq!(pull(widest), plain, "{widest:?}: dots of {diameter} px at {place:?}");
                }
            }
        }
    }

    #[test]
    fn outside_the_image_there_is_no_pull_and_near_its_border_a_flat_image_has_none() {
        let size = SizePx::new(60, 50);
        let kernel = EdgeKernel::new(8.0, 24.0, 0.3);
        let grey = vec![100; size.area()];
        assert_eq!(kernel.pull(&grey, size, Vec2::new(4.4, 20.0)), None);
        assert_eq!(kernel.pull(&grey, size, Vec2::new(f64::NAN, 20.0)), None);
        for place in [Vec2::new(30.3, 25.6), Vec2::new(4.6, 4.6), Vec2::new(54.4, 20.0), Vec2::new(30.0, 44.4)] {
            let (force, at) = kernel.pull(&grey, size, place).expect("inside");
            assert!(force.length() < 1e-9, "a flat image pulls {force:?} at {place:?}");
            assert!((at - place).length() < 0.18);
        }
    }
}
