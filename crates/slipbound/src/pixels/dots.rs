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

use super::bits::pack_row;
use super::wide::wide;
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
    /// Sums of columns of the padded image, as high as core and ring together and as high as the core.
    all_columns: Vec<i32>,
    core_columns: Vec<i32>,
    /// Sums of such columns along a row.
    all_sums: Vec<i32>,
    core_sums: Vec<i32>,
    response: Vec<i32>,
    /// 255 where a row has a peak, and the same in bits.
    peaks: Vec<u8>,
    peak_bits: Vec<u64>,
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
            all_columns: vec![0; padded.width],
            core_columns: vec![0; padded.width],
            all_sums: vec![0; small.width],
            core_sums: vec![0; small.width],
            response: vec![0; small.area()],
            peaks: vec![0; small.width.next_multiple_of(64)],
            peak_bits: vec![0; small.width.div_ceil(64)],
            spots: Vec::with_capacity(most),
            order: Vec::with_capacity(most),
            taken: Vec::with_capacity(most),
        }
    }

    /// Spots whose contrast is at least `min_levels`, strongest first. `grey` holds the rows without gaps.
    pub fn run(&mut self, grey: &[u8], min_levels: f32) -> &[Spot] {
        assert_eq!(grey.len(), self.size.area(), "grey image of another size");
        self.decimate(grey);
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
            let row = |i: usize| &grey[((y << self.shift) + i.min(n - 1)) * self.size.width..][..self.size.width];
            let out = &mut self.padded[(y + pad) * width..][..width];
            let small = &mut out[pad..pad + self.small.width];
            match self.shift {
                0 => small.iter_mut().zip(row(0)).for_each(|(o, &v)| *o = (4 * u16::from(v)).abs_diff(flip)),
                1 => decimate_by_2(row(0), row(1), flip, small),
                _ => {
                    let sums = &mut self.row_sums[..self.small.width << self.shift];
                    sums.fill(0);
                    (0..n).for_each(|i| add_bytes(row(i), sums));
                    let fours = small.iter_mut().zip(sums.as_chunks::<4>().0);
                    fours.for_each(|(o, s)| *o = ((s[0] + s[1] + s[2] + s[3]) / 4).abs_diff(flip));
                }
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

    /// response = core sum * ring area - ring sum * core area: a contrast times both areas.
    fn respond(&mut self) {
        let (c, r, width) = (self.core_half, self.ring_half, self.small.width + 2 * self.ring_half);
        let (core_area, all_area) = self.areas();
        let (all_rows, core_rows) = (2 * r + 1, 2 * c + 1);
        let padded = &self.padded;
        let row = |y: usize| &padded[y * width..][..width];
        self.all_columns.fill(0);
        self.core_columns.fill(0);
        (0..all_rows).for_each(|y| add_row(row(y), &mut self.all_columns));
        (r - c..r - c + core_rows).for_each(|y| add_row(row(y), &mut self.core_columns));
        for (y, out) in self.response.chunks_exact_mut(self.small.width).enumerate() {
            if y > 0 {
                exchange_row(row(y + all_rows - 1), row(y - 1), &mut self.all_columns);
                exchange_row(row(y + r - c + core_rows - 1), row(y + r - c - 1), &mut self.core_columns);
            }
            sum_along(&self.all_columns, all_rows, &mut self.all_sums);
            sum_along(&self.core_columns[r - c..], core_rows, &mut self.core_sums);
            contrast(&self.all_sums, &self.core_sums, core_area, all_area, out);
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
        if w < 3 {
            return;
        }
        for y in 1..h.saturating_sub(1) {
            let row = |y: usize| &self.response[y * w..][..w];
            find_peaks(row(y - 1), row(y), row(y + 1), least, &mut self.peaks[1..w - 1]);
            pack_row(&self.peaks, &mut self.peak_bits);
            for x in
                self.peak_bits.iter().enumerate().flat_map(|(word, &bits)| ones(bits).map(move |bit| 64 * word + bit))
            {
                let v = at(x, y);
                let corners = [at(x - 1, y - 1), at(x + 1, y - 1), at(x - 1, y + 1), at(x + 1, y + 1)];
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

/// The numbers of the bits that are set, ascending.
fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(bit)
    })
}

wide! {
    fn add_bytes(row: &[u8], sums: &mut [u16]) {
        sums.iter_mut().zip(row).for_each(|(sum, &v)| *sum += u16::from(v));
    }

    /// Sums of 2 x 2 pixels, or what they lack of `flip`.
    fn decimate_by_2(above: &[u8], below: &[u8], flip: u16, out: &mut [u16]) {
        let pairs = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
        for (out, (a, b)) in out.iter_mut().zip(pairs) {
            // Left and right byte of a pair, taken apart as halves of one number.
            let (a, b) = (u16::from_le_bytes(*a), u16::from_le_bytes(*b));
            *out = ((a & 255) + (a >> 8) + (b & 255) + (b >> 8)).abs_diff(flip);
        }
    }

    fn add_row(row: &[u16], columns: &mut [i32]) {
        columns.iter_mut().zip(row).for_each(|(sum, &v)| *sum += i32::from(v));
    }

    fn exchange_row(enters: &[u16], leaves: &[u16], columns: &mut [i32]) {
        let rows = enters.iter().zip(leaves);
        columns.iter_mut().zip(rows).for_each(|(sum, (&enters, &leaves))| *sum += i32::from(enters) - i32::from(leaves));
    }

    /// Sums of `count` neighbours, by sixteen places at a time: what is summed stays in registers.
    fn sum_along(columns: &[i32], count: usize, sums: &mut [i32]) {
        const PLACES: usize = 16;
        let (whole, rest) = sums.as_chunks_mut::<PLACES>();
        let rest_at = whole.len() * PLACES;
        for (k, sums) in whole.iter_mut().enumerate() {
            let near = &columns[k * PLACES..][..PLACES + count - 1];
            let mut total = [0; PLACES];
            for away in 0..count {
                let Some(places) = near[away..].first_chunk::<PLACES>() else { break };
                for i in 0..PLACES {
                    total[i] += places[i];
                }
            }
            *sums = total;
        }
        for (sum, near) in rest.iter_mut().zip(columns[rest_at..].windows(count)) {
            *sum = near.iter().sum();
        }
    }

    fn contrast(all: &[i32], core: &[i32], core_area: i32, all_area: i32, out: &mut [i32]) {
        for (out, (&all, &core)) in out.iter_mut().zip(all.iter().zip(core)) {
            *out = core.wrapping_mul(all_area).wrapping_sub(all.wrapping_mul(core_area));
        }
    }

    /// 255 where the inner places of the row between are at least `least` and a maximum among their eight neighbours; of equal
    /// ones the first counts. `peaks`: two shorter than the rows.
    fn find_peaks(above: &[i32], here: &[i32], below: &[i32], least: i32, peaks: &mut [u8]) {
        let n = peaks.len();
        let [above_left, above_mid, above_right] = [&above[..n], &above[1..][..n], &above[2..][..n]];
        let [left, mid, right] = [&here[..n], &here[1..][..n], &here[2..][..n]];
        let [below_left, below_mid, below_right] = [&below[..n], &below[1..][..n], &below[2..][..n]];
        for i in 0..n {
            let v = mid[i];
            let along = (v >= least) & (v > left[i]) & (v >= right[i]) & (v > above_mid[i]) & (v >= below_mid[i]);
            let across =
                (v > above_left[i]) & (v > above_right[i]) & (v >= below_left[i]) & (v >= below_right[i]);
            peaks[i] = u8::from(along & across).wrapping_neg();
        }
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
