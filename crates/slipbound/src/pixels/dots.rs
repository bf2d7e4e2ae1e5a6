//! Where dots are, to about half a pixel: grey image -> spots, by the difference of two box means.
//!
//! ```text
//!   +-----------+     response = mean of the ring - mean of the core (dark dots; reversed for bright ones)
//!   |   ring    |     on an image decimated so that a dot is 3 to 6 px wide: irregular, hollow and doubled
//!   |  +-----+  |     dots fuse into one peak, shading and grid lines of light cancel.
//!   |  |core |  |     A spot is a local maximum of the response, the strongest first, none within
//!   |  +-----+  |     half a pitch of a stronger one.
//!   +-----------+
//! ```

use crate::image::SizePx;
use crate::plane::Vec2;
use crate::sensor::Polarity;

/// One dot-like spot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Position in px of the full image.
    pub position: Vec2,
    /// Contrast of core against ring in grey levels; positive.
    pub response_levels: f32,
}

/// The curvature of a spot along one axis is at most this many times that along the other.
const RIDGE: f64 = 8.0;

/// Decimated values are kept with two more bits than grey levels.
const STEPS_PER_LEVEL: i32 = 4;

/// Finds spots of one dot size; owns all scratch.
#[derive(Debug, Clone)]
pub struct DotFinder {
    size: SizePx,
    shift: usize,
    small: SizePx,
    core_half: usize,
    ring_half: usize,
    separation_px: f64,
    invert: bool,
    row_sums: Vec<u16>,
    padded: Vec<u16>,
    integral: Vec<i32>,
    response: Vec<i32>,
    spots: Vec<Spot>,
    order: Vec<u32>,
    taken: Vec<bool>,
}

impl DotFinder {
    /// A finder of dots of `diameter_px` on a grid of `pitch_px`, in grey images of `size`.
    pub fn new(size: SizePx, diameter_px: f64, pitch_px: f64, polarity: Polarity) -> Self {
        let shift = (0..3).rev().find(|s| diameter_px / f64::from(1 << s) >= 3.0).unwrap_or(0);
        let small = SizePx::new(size.width >> shift, size.height >> shift);
        let scale = f64::from(1u32 << shift);
        let core_half = ((diameter_px / scale * 0.4).round() as usize).max(1);
        let widest = ((pitch_px - diameter_px / 2.0) / scale).floor().max(1.0) as usize;
        let ring_half = (2 * core_half + 1).min(widest).max(core_half + 1);
        let padded = SizePx::new(small.width + 2 * ring_half, small.height + 2 * ring_half);
        let most = small.area() / 4 + small.width + small.height + 1;
        DotFinder {
            size,
            shift,
            small,
            core_half,
            ring_half,
            separation_px: 0.45 * pitch_px,
            invert: polarity == Polarity::Dark,
            row_sums: vec![0; size.width],
            padded: vec![0; padded.area()],
            integral: vec![0; (padded.width + 1) * (padded.height + 1)],
            response: vec![0; small.area()],
            spots: Vec::with_capacity(most),
            order: Vec::with_capacity(most),
            taken: Vec::with_capacity(most),
        }
    }

    /// Spots whose contrast is at least `min_levels`, strongest first. `grey` holds the rows without gaps.
    pub fn run(&mut self, grey: &[u8], min_levels: f32) -> &[Spot] {
        assert_eq!(grey.len(), self.size.area(), "grey image of another size");
        self.decimate(grey);
        self.integrate();
        self.respond();
        self.collect(min_levels.max(0.25));
        self.keep_apart();
        &self.spots
    }

    fn decimate(&mut self, grey: &[u8]) {
        let (n, pad) = (1usize << self.shift, self.ring_half);
        let width = self.small.width + 2 * pad;
        let flip = if self.invert { 255 * STEPS_PER_LEVEL as u16 } else { 0 };
        for y in 0..self.small.height {
            let sums = &mut self.row_sums[..self.small.width << self.shift];
            sums.fill(0);
            for row in 0..n {
                let from = ((y << self.shift) + row) * self.size.width;
                for (sum, &v) in sums.iter_mut().zip(&grey[from..from + self.size.width]) {
                    *sum += u16::from(v);
                }
            }
            let out = &mut self.padded[(y + pad) * width..][..width];
            let small = &mut out[pad..pad + self.small.width];
            match self.shift {
                0 => small.iter_mut().zip(&*sums).for_each(|(o, s)| *o = (s * 4).abs_diff(flip)),
                1 => small.iter_mut().zip(sums.chunks_exact(2)).for_each(|(o, s)| *o = (s[0] + s[1]).abs_diff(flip)),
                _ => small
                    .iter_mut()
                    .zip(sums.chunks_exact(4))
                    .for_each(|(o, s)| *o = ((s[0] + s[1] + s[2] + s[3]) / 4).abs_diff(flip)),
            }
            let (first, last) = (out[pad], out[pad + self.small.width - 1]);
            out[..pad].fill(first);
            out[pad + self.small.width..].fill(last);
        }
        for y in 0..pad {
            self.padded.copy_within(pad * width..(pad + 1) * width, y * width);
            let bottom = pad + self.small.height;
            self.padded.copy_within((bottom - 1) * width..bottom * width, (bottom + y) * width);
        }
    }

    fn integrate(&mut self) {
        let width = self.small.width + 2 * self.ring_half;
        let mut above_from = 0;
        for values in self.padded.chunks_exact(width) {
            let (above, here) = self.integral[above_from..].split_at_mut(width + 1);
            let mut sum = 0i32;
            here[0] = 0;
            for ((out, up), &v) in here[1..=width].iter_mut().zip(&above[1..]).zip(values) {
                sum += i32::from(v);
                *out = up.wrapping_add(sum);
            }
            above_from += width + 1;
        }
    }

    /// response = core sum * ring area - ring sum * core area: a contrast times both areas.
    fn respond(&mut self) {
        let (c, r) = (self.core_half, self.ring_half);
        let stride = self.small.width + 2 * r + 1;
        let (core_area, all_area) = self.areas();
        for (y, out) in self.response.chunks_exact_mut(self.small.width).enumerate() {
            let line = |dy: usize, dx: usize| &self.integral[(y + dy) * stride + dx..][..self.small.width];
            let (ra, rb) = (line(0, 0), line(0, 2 * r + 1));
            let (rc, rd) = (line(2 * r + 1, 0), line(2 * r + 1, 2 * r + 1));
            let (near, far) = (r - c, r + c + 1);
            let (ca, cb) = (line(near, near), line(near, far));
            let (cc, cd) = (line(far, near), line(far, far));
            for x in 0..out.len() {
                let all = rd[x].wrapping_sub(rb[x]).wrapping_sub(rc[x]).wrapping_add(ra[x]);
                let core = cd[x].wrapping_sub(cb[x]).wrapping_sub(cc[x]).wrapping_add(ca[x]);
                out[x] = core.wrapping_mul(all_area).wrapping_sub(all.wrapping_mul(core_area));
            }
        }
    }

    /// Areas of the core and of core and ring together, in decimated pixels.
    fn areas(&self) -> (i32, i32) {
        let square = |half: usize| ((2 * half + 1) * (2 * half + 1)) as i32;
        (square(self.core_half), square(self.ring_half))
    }

    fn collect(&mut self, min_levels: f32) {
        let (core_area, all_area) = self.areas();
        // core * all - all * core = contrast * core_area * ring_area, with ring_area = all_area - core_area
        let unit = (STEPS_PER_LEVEL * core_area * (all_area - core_area)) as f32;
        let least = (min_levels * unit) as i32;
        let (w, h) = (self.small.width, self.small.height);
        let at = |x: usize, y: usize| self.response[y * w + x];
        let half_block = (f64::from(1u32 << self.shift) - 1.0) / 2.0;
        self.spots.clear();
        for y in 1..h.saturating_sub(1) {
            for x in 1..w.saturating_sub(1) {
                let v = at(x, y);
                if v < least || v <= at(x - 1, y) || v < at(x + 1, y) || v <= at(x, y - 1) || v < at(x, y + 1) {
                    continue;
                }
                let corners = [at(x - 1, y - 1), at(x + 1, y - 1), at(x - 1, y + 1), at(x + 1, y + 1)];
                if v <= corners[0] || v <= corners[1] || v < corners[2] || v < corners[3] {
                    continue;
                }
                let curvature = |before: i32, after: i32| f64::from(before) + f64::from(after) - 2.0 * f64::from(v);
                let (xx, yy) = (curvature(at(x - 1, y), at(x + 1, y)), curvature(at(x, y - 1), at(x, y + 1)));
                let xy =
                    (f64::from(corners[0]) + f64::from(corners[3]) - f64::from(corners[1]) - f64::from(corners[2]))
                        / 4.0;
                // A ridge of shadow is curved along one axis only.
                let (trace, det) = (xx + yy, xx * yy - xy * xy);
                if det <= 0.0 || trace * trace * RIDGE > det * (RIDGE + 1.0) * (RIDGE + 1.0) {
                    continue;
                }
                let top = |before: i32, after: i32| {
                    let curve = f64::from(before) + f64::from(after) - 2.0 * f64::from(v);
                    if curve < 0.0 { (f64::from(before) - f64::from(after)) / (2.0 * curve) } else { 0.0 }
                };
                let dx = top(at(x - 1, y), at(x + 1, y));
                let dy = top(at(x, y - 1), at(x, y + 1));
                let scale = f64::from(1u32 << self.shift);
                self.spots.push(Spot {
                    position: Vec2::new((x as f64 + dx) * scale + half_block, (y as f64 + dy) * scale + half_block),
                    response_levels: v as f32 / unit,
                });
            }
        }
    }

    /// Drops every spot that lies within half a pitch of a stronger one.
    fn keep_apart(&mut self) {
        // Ties keep reading order, so the sort has one answer everywhere.
        self.spots.sort_unstable_by(|a, b| {
            let place = |s: &Spot| (s.position.y, s.position.x);
            b.response_levels
                .total_cmp(&a.response_levels)
                .then(place(a).0.total_cmp(&place(b).0).then(place(a).1.total_cmp(&place(b).1)))
        });
        let near_squared = self.separation_px * self.separation_px;
        // Sweep in y: only spots within one separation above can be too close.
        self.order.clear();
        self.order.extend(0..self.spots.len() as u32);
        let spots = &self.spots;
        self.order.sort_unstable_by(|&a, &b| {
            spots[a as usize].position.y.total_cmp(&spots[b as usize].position.y).then(a.cmp(&b))
        });
        self.taken.clear();
        self.taken.resize(self.spots.len(), false);
        // place[i]: rank of spot i in the sweep; found by walking outwards from it, strongest spot first.
        let mut kept = 0;
        for strongest in 0..self.spots.len() {
            if self.taken[strongest] {
                continue;
            }
            let here = self.spots[strongest].position;
            let rank = self.order.partition_point(|&i| {
                let p = self.spots[i as usize].position.y;
                p < here.y - self.separation_px
            });
            for &i in &self.order[rank..] {
                let there = self.spots[i as usize].position;
                if there.y > here.y + self.separation_px {
                    break;
                }
                if i as usize > strongest && (there - here).length_squared() < near_squared {
                    self.taken[i as usize] = true;
                }
            }
            kept += 1;
        }
        let mut index = 0;
        let taken = &self.taken;
        self.spots.retain(|_| {
            index += 1;
            !taken[index - 1]
        });
        debug_assert_eq!(kept, self.spots.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey 150 with square dots of `side` px at the places given, `depth` levels darker.
    fn draw(size: SizePx, dots: &[(usize, usize)], side: usize, depth: u8) -> Vec<u8> {
        let mut grey = vec![150u8; size.area()];
        for &(cx, cy) in dots {
            for y in cy - side / 2..=cy + side / 2 {
                grey[y * size.width + cx - side / 2..][..2 * (side / 2) + 1].fill(150 - depth);
            }
        }
        grey
    }

    #[test]
    fn every_dot_is_one_spot_within_a_pixel() {
        let size = SizePx::new(130, 101);
        let dots = [(20, 20), (50, 22), (80, 19), (110, 20), (20, 60), (50, 61), (80, 62), (110, 85)];
        for side in [5, 9, 13] {
            let mut finder = DotFinder::new(size, side as f64, 30.0, Polarity::Dark);
            let spots = finder.run(&draw(size, &dots, side, 40), 8.0);
            assert_eq!(spots.len(), dots.len(), "side {side}");
            for &(x, y) in &dots {
                let dot = Vec2::new(x as f64, y as f64);
                let nearest = spots.iter().map(|s| (s.position - dot).length()).fold(f64::MAX, f64::min);
                assert!(nearest < 1.0, "side {side}, dot {dot:?}: {nearest} px off");
            }
        }
    }

    #[test]
    fn a_slope_of_light_and_a_bright_dot_are_no_dark_spots() {
        let size = SizePx::new(96, 96);
        let slope: Vec<u8> = (0..size.area()).map(|i| (40 + (i % 96) * 2) as u8).collect();
        let mut finder = DotFinder::new(size, 8.0, 30.0, Polarity::Dark);
        assert_eq!(finder.run(&slope, 2.0), &[]);
        let bright: Vec<u8> = draw(size, &[(48, 48)], 9, 60).iter().map(|v| 255 - v).collect();
        assert!(finder.run(&bright, 12.0).iter().all(|s| (s.position - Vec2::new(48.0, 48.0)).length() > 4.0));
        let mut finder = DotFinder::new(size, 8.0, 30.0, Polarity::Bright);
        assert_eq!(finder.run(&bright, 12.0).len(), 1);
    }

    #[test]
    fn a_doubled_dot_is_one_spot() {
        let size = SizePx::new(96, 96);
        let mut finder = DotFinder::new(size, 9.0, 30.0, Polarity::Dark);
        assert_eq!(finder.run(&draw(size, &[(44, 48), (52, 48)], 7, 50), 8.0).len(), 1);
    }
}
