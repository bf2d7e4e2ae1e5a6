//! Approximate positions of dots, to about half a pixel: grey image -> spots, by the difference of two box means.
//!
//! ```text
//!   +-----------+     response = mean of the ring - mean of the core (dark dots; reversed for bright ones)
//!   |   ring    |     on an image decimated, at most fourfold, to dots of 3 to 6 px: irregular, hollow and
//!   |  +-----+  |     doubled dots fuse into one peak, shading and grid lines of light cancel.
//!   |  |core |  |     A spot is a local maximum of the response, the strongest first, none within
//!   |  +-----+  |     SEPARATION_PITCH of a stronger one.
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
/// Half width of the core in dot diameters: the core lies inside the dot, also beside its exact centre.
const CORE_HALF_FRACTION: f64 = 0.4;
/// Least distance of two spots: neighbours that a load presses together stay apart, the halves of a dot do not.
const SEPARATION_PITCH: f64 = 0.45;
/// Least response, whatever the caller asks for: one step of a decimated value.
const LEAST_LEVELS: f32 = 1.0 / STEPS_PER_LEVEL as f32;

/// Decimated values have two more bits than grey levels.
const STEPS_PER_LEVEL: i32 = 4;

/// Number of decimated pixels that are processed in parallel.
const PLACES: usize = 32;

/// Number of decimated values whose sum fits 16 bits; no square is wider.
const MOST_SIDE: usize = u16::MAX as usize / (255 * STEPS_PER_LEVEL as usize);

/// A square of decimated pixels.
#[derive(Debug, Clone, Copy)]
struct Square {
    side: usize,
}

impl Square {
    fn area(self) -> i32 {
        (self.side * self.side) as i32
    }
}

/// Finds spots of one dot size; owns all scratch memory.
#[derive(Debug, Clone)]
pub struct DotFinder {
    size: SizePx,
    shift: usize,
    small: SizePx,
    core_half: usize,
    ring_half: usize,
    separation_px: f64,
    is_dark: bool,
    row_sums: Vec<u16>,
    padded: Vec<u16>,
    /// Column sums of the padded image, over the height of core plus ring and over that of the core; zeros after them.
    all_columns: Vec<u16>,
    core_columns: Vec<u16>,
    /// Sums of 2, 4, 8, .. neighbouring columns, and sums over the width of the squares.
    powers: Vec<Vec<u16>>,
    all_sums: Vec<i32>,
    core_sums: Vec<i32>,
    /// Row length of `response`, a multiple of [`PLACES`]; values beyond the image are meaningless.
    stride: usize,
    response: Vec<i32>,
    /// 255 where a row has a peak, and the same in bits.
    peaks: Vec<u8>,
    peak_bits: Vec<u64>,
    /// Peaks in reading order, the start index of each row, and their ranks, the strongest first.
    found: Vec<Spot>,
    row_starts: Vec<u32>,
    ranks: Vec<u32>,
    order: Vec<(u32, u32)>,
    taken: Vec<bool>,
    spots: Vec<Spot>,
}

impl DotFinder {
    /// A finder of dots of `diameter_px` on a grid of `pitch_px`, in grey images of `size`.
    pub fn new(size: SizePx, diameter_px: f64, pitch_px: f64, polarity: Polarity) -> Self {
        let shift = (0..3).rev().find(|s| diameter_px / f64::from(1 << s) >= 3.0).unwrap_or(0);
        let small = SizePx::new(size.width >> shift, size.height >> shift);
        let scale = f64::from(1u32 << shift);
        let core_half = ((diameter_px / scale * CORE_HALF_FRACTION).round() as usize).max(1);
        let widest = ((pitch_px - diameter_px / 2.0) / scale).floor().max(1.0) as usize;
        let ring_half = (2 * core_half + 1).min(widest).max(core_half + 1);
        let padded = SizePx::new(small.width + 2 * ring_half, small.height + 2 * ring_half);
        assert!(2 * ring_half < MOST_SIDE, "dots of {diameter_px} px: too large to be summed");
        // The last block of a row reads one block further.
        let stride = small.width.next_multiple_of(PLACES) + PLACES;
        let most = small.area() / 4 + small.width + small.height + 1;
        DotFinder {
            size,
            shift,
            small,
            core_half,
            ring_half,
            separation_px: SEPARATION_PITCH * pitch_px,
            is_dark: polarity == Polarity::Dark,
            row_sums: vec![0; size.width],
            padded: vec![0; padded.area()],
            all_columns: vec![0; stride + MOST_SIDE],
            core_columns: vec![0; stride + MOST_SIDE],
            powers: (0..MOST_SIDE.ilog2()).map(|_| vec![0; stride + MOST_SIDE]).collect(),
            all_sums: vec![0; stride],
            core_sums: vec![0; stride],
            stride,
            response: vec![0; stride * small.height],
            peaks: vec![0; stride.next_multiple_of(64)],
            peak_bits: vec![0; stride.div_ceil(64)],
            found: Vec::with_capacity(most),
            row_starts: Vec::with_capacity(small.height + 1),
            ranks: Vec::with_capacity(most),
            order: Vec::with_capacity(most),
            taken: Vec::with_capacity(most),
            spots: Vec::with_capacity(most),
        }
    }

    /// Spots whose contrast is at least `min_levels`, strongest first. `grey` holds the rows without gaps.
    pub fn run(&mut self, grey: &[u8], min_levels: f32) -> &[Spot] {
        assert_eq!(grey.len(), self.size.area(), "grey image of another size");
        self.decimate(grey);
        self.respond();
        self.collect(min_levels.max(LEAST_LEVELS));
        self.keep_apart();
        &self.spots
    }

    fn decimate(&mut self, grey: &[u8]) {
        let (n, pad) = (1usize << self.shift, self.ring_half);
        let width = self.small.width + 2 * pad;
        let flip = if self.is_dark { 255 * STEPS_PER_LEVEL as u16 } else { 0 };
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
        let (all, core) = self.squares();
        let padded = &self.padded;
        let row = |y: usize| &padded[y * width..][..width];
        self.all_columns.fill(0);
        self.core_columns.fill(0);
        (0..all.side).for_each(|y| add_row(row(y), &mut self.all_columns));
        (r - c..r - c + core.side).for_each(|y| add_row(row(y), &mut self.core_columns));
        for (y, out) in self.response.chunks_exact_mut(self.stride).enumerate() {
            if y > 0 {
                exchange_row(row(y + all.side - 1), row(y - 1), &mut self.all_columns);
                exchange_row(row(y + r - c + core.side - 1), row(y + r - c - 1), &mut self.core_columns);
            }
            sum_along(&self.all_columns, all.side, &mut self.powers, &mut self.all_sums);
            sum_along(&self.core_columns[r - c..], core.side, &mut self.powers, &mut self.core_sums);
            contrast(&self.all_sums, &self.core_sums, core.area(), all.area(), out);
        }
    }

    /// Core plus ring, and the core.
    fn squares(&self) -> (Square, Square) {
        (Square { side: 2 * self.ring_half + 1 }, Square { side: 2 * self.core_half + 1 })
    }

    fn collect(&mut self, min_levels: f32) {
        let (all, core) = self.squares();
        let (all_area, core_area) = (all.area(), core.area());
        // core * all - all * core = contrast * core_area * ring_area, with ring_area = all_area - core_area
        let unit = (STEPS_PER_LEVEL * core_area * (all_area - core_area)) as f32;
        let least = (min_levels * unit) as i32;
        let (w, h) = (self.small.width, self.small.height);
        let at = |x: usize, y: usize| self.response[y * self.stride + x];
        let half_block = (f64::from(1u32 << self.shift) - 1.0) / 2.0;
        self.found.clear();
        self.row_starts.clear();
        self.row_starts.push(0);
        if w < 3 {
            return;
        }
        for y in 1..h.saturating_sub(1) {
            self.row_starts.push(self.found.len() as u32);
            let row = |y: usize| &self.response[y * self.stride..][..self.stride];
            find_peaks([row(y - 1), row(y), row(y + 1)], least, &mut self.peaks);
            // The right border and pixels beyond it are never peaks.
            self.peaks[w - 2..].fill(0);
            pack_row(&self.peaks, &mut self.peak_bits);
            let words = self.peak_bits.iter().enumerate();
            for x in words.flat_map(|(word, &bits)| ones(bits).map(move |bit| 64 * word + bit + 1)) {
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
                self.found.push(Spot {
                    position: Vec2::new((x as f64 + dx) * scale + half_block, (y as f64 + dy) * scale + half_block),
                    response_levels: v as f32 / unit,
                });
            }
        }
    }

    /// Keeps the peaks, strongest first, except those within [`SEPARATION_PITCH`] of a stronger one.
    fn keep_apart(&mut self) {
        let found = &self.found;
        // Contrasts are positive, so their bit patterns sort like their values. Ties keep reading order, so the result
        // is unique.
        self.order.clear();
        self.order.extend(found.iter().zip(0..).map(|(spot, i)| (!spot.response_levels.to_bits(), i)));
        self.order.sort_unstable_by(|a, b| {
            let place = |i: u32| found[i as usize].position;
            let reading = || place(a.1).y.total_cmp(&place(b.1).y).then(place(a.1).x.total_cmp(&place(b.1).x));
            a.0.cmp(&b.0).then_with(reading)
        });
        self.ranks.clear();
        self.ranks.resize(found.len(), 0);
        self.order.iter().zip(0..).for_each(|(&(_, i), rank)| self.ranks[i as usize] = rank);
        self.taken.clear();
        self.taken.resize(found.len(), false);
        let near_squared = self.separation_px * self.separation_px;
        // Only spots of rows within one separation can be too close; a spot is at most half a row from its own row.
        let rows = (self.separation_px / f64::from(1u32 << self.shift)) as usize + 2;
        self.spots.clear();
        for (&(_, i), rank) in self.order.iter().zip(0..) {
            if self.taken[i as usize] {
                continue;
            }
            let here = found[i as usize];
            self.spots.push(here);
            let row = self.row_starts.partition_point(|&start| start <= i) - 1;
            let first = self.row_starts[row.saturating_sub(rows)] as usize;
            let end = self.row_starts.get(row + rows + 1).map_or(found.len(), |&end| end as usize);
            let others = found[first..end].iter().zip(&self.ranks[first..end]);
            for ((there, &of), taken) in others.zip(&mut self.taken[first..end]) {
                let away = there.position - here.position;
                *taken |= of > rank && away.length_squared() < near_squared;
            }
        }
    }
}

/// The indices of the set bits, ascending.
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

    /// Sums of 2 x 2 pixels, or their difference to `flip`.
    fn decimate_by_2(above: &[u8], below: &[u8], flip: u16, out: &mut [u16]) {
        let pairs = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
        for (out, (a, b)) in out.iter_mut().zip(pairs) {
            // Left and right byte of a pair, split as halves of one number.
            let (a, b) = (u16::from_le_bytes(*a), u16::from_le_bytes(*b));
            *out = ((a & 255) + (a >> 8) + (b & 255) + (b >> 8)).abs_diff(flip);
        }
    }

    fn add_row(row: &[u16], columns: &mut [u16]) {
        columns.iter_mut().zip(row).for_each(|(sum, &v)| *sum += v);
    }

    fn exchange_row(enters: &[u16], leaves: &[u16], columns: &mut [u16]) {
        let rows = enters.iter().zip(leaves);
        columns.iter_mut().zip(rows).for_each(|(sum, (&enters, &leaves))| *sum = sum.wrapping_add(enters).wrapping_sub(leaves));
    }

    /// Adds pairs of values that are `away` apart.
    fn add_away(of: &[u16], away: usize, sums: &mut [u16]) {
        for ((sum, &a), &b) in sums.iter_mut().zip(of).zip(&of[away..]) {
            *sum = a.wrapping_add(b);
        }
    }

    fn add_to(of: &[u16], sums: &mut [i32]) {
        sums.iter_mut().zip(of).for_each(|(sum, &v)| *sum += i32::from(v));
    }

    fn add_both_to(a: &[u16], b: &[u16], sums: &mut [i32]) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (&a, &b))| *sum += i32::from(a) + i32::from(b));
    }

    fn contrast(all: &[i32], core: &[i32], core_area: i32, all_area: i32, out: &mut [i32]) {
        for (out, (&all, &core)) in out.iter_mut().zip(all.iter().zip(core)) {
            *out = core.wrapping_mul(all_area).wrapping_sub(all.wrapping_mul(core_area));
        }
    }

    /// 255 where a value of the middle row, from the second on, is at least `least` and a maximum among its eight
    /// neighbours; of equal ones the first counts.
    fn find_peaks(rows: [&[i32]; 3], least: i32, peaks: &mut [u8]) {
        let mut first = 0;
        for peaks in peaks.as_chunks_mut::<PLACES>().0 {
            let near = rows.map(|row| row.get(first..first + PLACES + 2));
            first += PLACES;
            let [Some(above), Some(here), Some(below)] = near else { return };
            // Most of an image contains no dot.
            let strongest = here[1..=PLACES].iter().fold(i32::MIN, |most, &v| most.max(v));
            if strongest < least {
                *peaks = [0; PLACES];
                continue;
            }
            let three = [above, here, below].map(|row| [&row[..PLACES], &row[1..][..PLACES], &row[2..][..PLACES]]);
            let [[a, b, c], [d, v, e], [f, g, h]] = three;
            for i in 0..PLACES {
                let before = a[i].max(b[i]).max(c[i]).max(d[i]);
                let after = e[i].max(f[i]).max(g[i]).max(h[i]);
                peaks[i] = u8::from((v[i] > before) & (v[i] >= after.max(least))).wrapping_neg();
            }
        }
    }
}

/// Sums of `side` neighbouring column sums of the same height: by powers of two as far as 16 bits suffice.
///
/// ```text
///   11 = 4 + 4 + 2 + 1     * * * * * * * * * * *     sums of 2 are two of 1, sums of 4 two of 2
///                          |_____| |_____| |_| |
/// ```
fn sum_along(columns: &[u16], side: usize, powers: &mut [Vec<u16>], sums: &mut [i32]) {
    let most = (MOST_SIDE / side).min(side).ilog2() as usize;
    for k in 0..most {
        let (smaller, larger) = powers.split_at_mut(k);
        add_away(smaller.last().map_or(columns, Vec::as_slice), 1 << k, &mut larger[0]);
    }
    let mut first = 0;
    let mut next = || {
        let power = most.min((side - first).checked_ilog2()? as usize);
        let part = &power.checked_sub(1).map_or(columns, |k| &powers[k])[first..];
        first += 1 << power;
        Some(part)
    };
    sums.fill(0);
    while let Some(part) = next() {
        match next() {
            Some(other) => add_both_to(part, other, sums),
            None => add_to(part, sums),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey 150 with square dots of `side` px at the given places, `depth` levels darker.
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
    fn sums_along_are_those_of_the_neighbours_whatever_their_number() {
        for side in [1, 2, 3, 5, 7, 11, 13, 27, 31, 63] {
            // The largest column sums for squares of this width.
            let columns: Vec<u16> = (0..96 + MOST_SIDE as u32).map(|i| (i * i % 1021) as u16 * side as u16).collect();
            let mut powers: Vec<Vec<u16>> = vec![vec![0; columns.len()]; 6];
            let mut sums = vec![0; 96];
            sum_along(&columns, side, &mut powers, &mut sums);
            for (i, &sum) in sums.iter().enumerate() {
                let exact: i32 = columns[i..i + side].iter().map(|&v| i32::from(v)).sum();
                assert_eq!(sum, exact, "{side} from {i}");
            }
        }
    }

    #[test]
    fn peaks_are_where_no_neighbour_is_higher_and_the_first_of_equal_ones_counts() {
        let (width, least) = (6 * PLACES, 40);
        let mut seed = 5u32;
        let mut row = || -> Vec<i32> {
            let mut next = || {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                seed >> 24
            };
            (0..width).map(|i| if i / PLACES == 1 { 39 } else { (next() % 20) as i32 + 30 }).collect()
        };
        let rows = [row(), row(), row()];
        let mut peaks = vec![7; width];
        find_peaks(rows.each_ref().map(Vec::as_slice), least, &mut peaks);
        let is_peak = |x: usize| {
            let v = rows[1][x];
            let before = rows[0][x - 1..=x + 1].iter().chain([&rows[1][x - 1]]);
            let after = rows[2][x - 1..=x + 1].iter().chain([&rows[1][x + 1]]);
            v >= least && before.into_iter().all(|&b| v > b) && after.into_iter().all(|&a| v >= a)
        };
        let found: Vec<usize> = (1..=5 * PLACES).filter(|&x| peaks[x - 1] == 255).collect();
        assert!(found.len() > 3);
        assert_eq!(found, (1..=5 * PLACES).filter(|&x| is_peak(x)).collect::<Vec<_>>());
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
