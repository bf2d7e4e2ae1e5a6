//! The appearance of dots: the mean of small windows about many places, and the colours of a dot and its surroundings.

use crate::image::{Mask, Rgb, SizePx};
use crate::plane::Vec2;

/// The mean window about the places, `2 half + 1` pixels wide and high, sampled bilinearly, rows without a gap. Places
/// whose window leaves the image are skipped; None when none is left.
pub fn mean_window(grey: &[u8], size: SizePx, places: impl Iterator<Item = Vec2>, half: usize) -> Option<Vec<f32>> {
    let side = 2 * half + 1;
    let (mut sums, mut count) = (vec![0.0f32; side * side], 0);
    for place in places {
        let (left, top) = (place.x - half as f64, place.y - half as f64);
        let fits = |from: f64, len: usize| from >= 0.0 && from + (side as f64) < (len - 1) as f64;
        if !fits(left, size.width) || !fits(top, size.height) {
            continue; // also when it is not a number
        }
        let (column, row) = (left as usize, top as usize);
        let (fx, fy) = ((left - column as f64) as f32, (top - row as f64) as f32);
        for (y, out) in sums.chunks_exact_mut(side).enumerate() {
            let above = &grey[(row + y) * size.width + column..][..=side];
            let below = &grey[(row + y + 1) * size.width + column..][..=side];
            for (out, (a, b)) in out.iter_mut().zip(above.windows(2).zip(below.windows(2))) {
                let mix = |p: &[u8]| f32::from(p[0]) * (1.0 - fx) + f32::from(p[1]) * fx;
                *out += mix(a) * (1.0 - fy) + mix(b) * fy;
            }
        }
        count += 1;
    }
    (count > 0).then(|| sums.iter().map(|s| s / count as f32).collect())
}

/// Red, green and blue of a dot and of the ring around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DotColours {
    /// Mean of the dot.
    pub core_levels: [f64; 3],
    /// Mean of the ring.
    pub ring_levels: [f64; 3],
    /// Covariance of the ring's pixels, levels squared.
    pub ring_covariance: [[f64; 3]; 3],
}

/// Colours within `core_px` of a place, and between `ring_px.0` and `ring_px.1` of it. None at the border.
pub fn dot_colours(image: Rgb<'_>, place: Vec2, core_px: f64, ring_px: (f64, f64)) -> Option<DotColours> {
    let size = image.size();
    let reach = ring_px.1.ceil();
    let inside = |v: f64, len: usize| v >= reach && v + reach < len as f64 - 1.0;
    if !inside(place.x, size.width) || !inside(place.y, size.height) {
        return None;
    }
    let (mut core, mut ring, mut products) = ([0.0; 3], [0.0; 3], [[0.0; 3]; 3]);
    let (mut core_count, mut ring_count) = (0.0, 0.0);
    for y in (place.y - reach) as usize..=(place.y + reach) as usize {
        let row = image.row(y);
        for x in (place.x - reach) as usize..=(place.x + reach) as usize {
            let r = (Vec2::new(x as f64, y as f64) - place).length();
            let colour = image.order().rgb([row[3 * x], row[3 * x + 1], row[3 * x + 2]]).map(f64::from);
            if r <= core_px {
                core_count += 1.0;
                core.iter_mut().zip(colour).for_each(|(s, v)| *s += v);
            } else if r >= ring_px.0 && r <= ring_px.1 {
                ring_count += 1.0;
                ring.iter_mut().zip(colour).for_each(|(s, v)| *s += v);
                for (products, a) in products.iter_mut().zip(colour) {
                    products.iter_mut().zip(colour).for_each(|(s, b)| *s += a * b);
                }
            }
        }
    }
    if core_count == 0.0 || ring_count == 0.0 {
        return None;
    }
    let mean = ring.map(|s| s / ring_count);
    let covariance = |i: usize, j: usize| products[i][j] / ring_count - mean[i] * mean[j];
    Some(DotColours {
        core_levels: core.map(|s| s / core_count),
        ring_levels: mean,
        ring_covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance(i, j))),
    })
}

/// Sets or clears the pixels within a radius of a place.
pub fn write_disc(mask: &mut Mask, centre: Vec2, radius_px: f64, on: bool) {
    let size = mask.size();
    let span = |at: f64, len: usize| {
        let from = (at - radius_px).max(0.0) as usize;
        from.min(len)..((at + radius_px).max(-1.0) + 1.0) as usize
    };
    for y in span(centre.y, size.height) {
        for x in span(centre.x, size.width) {
            let inside = (Vec2::new(x as f64, y as f64) - centre).length() <= radius_px;
            if inside && x < size.width && y < size.height {
                mask.set(x, y, on);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_centred_on_their_places() {
        let size = SizePx::new(20, 16);
        let ramp: Vec<u8> = (0..size.area()).map(|i| (i % 20 * 10) as u8).collect();
        let places = [Vec2::new(8.25, 8.0), Vec2::new(10.25, 6.5), Vec2::new(1.0, 8.0), Vec2::new(f64::NAN, 8.0)];
        let window = mean_window(&ramp, size, places.into_iter(), 2).expect("two of them fit");
        for row in window.chunks_exact(5) {
            for (x, level) in row.iter().enumerate() {
                assert!((level - (92.5 + 10.0 * (x as f32 - 2.0))).abs() < 1e-3, "{window:?}");
            }
        }
        assert_eq!(mean_window(&ramp, size, std::iter::once(Vec2::ZERO), 2), None);
    }

    #[test]
    fn dot_and_ring_are_separated_and_the_ring_has_its_spread() {
        let size = SizePx::new(31, 31);
        let rgb: Vec<u8> = (0..size.area())
            .flat_map(|i| {
                let r = (Vec2::new((i % 31) as f64, (i / 31) as f64) - Vec2::new(15.0, 15.0)).length();
                let stripe = if i % 2 == 0 { 10 } else { 0 };
                if r < 4.0 { [20, 40, 60] } else { [100 + stripe, 100, 100 - stripe] }
            })
            .collect();
        let image = Rgb::new(&rgb, size).expect("whole");
        let colours = dot_colours(image, Vec2::new(15.0, 15.0), 3.0, (6.0, 10.0)).expect("inside");
        assert_eq!(colours.core_levels, [20.0, 40.0, 60.0]);
        assert!((colours.ring_levels[0] - 105.0).abs() < 1.0 && colours.ring_levels[1] == 100.0);
        let spread = colours.ring_covariance;
        assert!((spread[0][0] - 25.0).abs() < 1.0 && (spread[0][2] + 25.0).abs() < 1.0 && spread[1][1].abs() < 1e-6);
        assert_eq!(dot_colours(image, Vec2::new(9.0, 15.0), 3.0, (6.0, 10.0)), None);
    }
}
