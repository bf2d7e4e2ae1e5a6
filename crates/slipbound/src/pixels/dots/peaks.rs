//! Contrast about every decimated pixel -> its peaks, without ridges, to a part of a pixel -> those that are apart.

use super::response::{PLACES, Response, STEPS_PER_LEVEL};
use crate::pixels::bits::pack_row;
use crate::pixels::wide::wide;
use crate::plane::Vec2;

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
/// Least distance of two spots: neighbours that a load presses together stay apart, the halves of a dot do not.
const SEPARATION_PITCH: f64 = 0.45;
/// Least response, whatever the caller asks for: one step of a decimated value.
const LEAST_LEVELS: f32 = 1.0 / STEPS_PER_LEVEL as f32;

/// The peaks of a response, and the spots among them; owns all scratch memory.
#[derive(Debug, Clone)]
pub(super) struct Peaks {
    separation_px: f64,
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

impl Peaks {
    /// Of responses like this one, to dots on a grid of `pitch_px`.
    pub fn new(response: &Response, pitch_px: f64) -> Self {
        let (small, stride) = (response.small, response.stride);
        let most = small.area() / 4 + small.width + small.height + 1;
        Peaks {
            separation_px: SEPARATION_PITCH * pitch_px,
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

    /// The peaks of at least this contrast that are apart, the strongest first.
    pub fn run(&mut self, response: &Response, min_levels: f32) -> &[Spot] {
        self.collect(response, min_levels.max(LEAST_LEVELS));
        self.keep_apart(response.shift);
        &self.spots
    }

    fn collect(&mut self, response: &Response, min_levels: f32) {
        let unit = response.unit();
        let least = (min_levels * unit) as i32;
        let (w, h) = (response.small.width, response.small.height);
        let scale = f64::from(1u32 << response.shift);
        let half_block = (scale - 1.0) / 2.0;
        self.found.clear();
        self.row_starts.clear();
        self.row_starts.push(0);
        if w < 3 {
            return;
        }
        for y in 1..h.saturating_sub(1) {
            self.row_starts.push(self.found.len() as u32);
            let rows = [y - 1, y, y + 1].map(|y| &response.values[y * response.stride..][..response.stride]);
            find_peaks(rows, least, &mut self.peaks);
            // The right border and pixels beyond it are never peaks.
            self.peaks[w - 2..].fill(0);
            pack_row(&self.peaks, &mut self.peak_bits);
            let words = self.peak_bits.iter().enumerate();
            for x in words.flat_map(|(word, &bits)| ones(bits).map(move |bit| 64 * word + bit + 1)) {
                let near = rows.map(|row| [row[x - 1], row[x], row[x + 1]]);
                if is_ridge(near) {
                    continue;
                }
                let off = subpixel(near);
                self.found.push(Spot {
                    position: Vec2::new(
                        (x as f64 + off.x) * scale + half_block,
                        (y as f64 + off.y) * scale + half_block,
                    ),
                    response_levels: near[1][1] as f32 / unit,
                });
            }
        }
    }

    /// Keeps the peaks, strongest first, except those within [`SEPARATION_PITCH`] of a stronger one.
    fn keep_apart(&mut self, shift: usize) {
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
        let rows = (self.separation_px / f64::from(1u32 << shift)) as usize + 2;
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

/// Second difference of three values in a row.
fn curvature([before, v, after]: [i32; 3]) -> f64 {
    f64::from(before) + f64::from(after) - 2.0 * f64::from(v)
}

/// Whether a peak, in the middle of 3 x 3 values, is one of a ridge of shadow, which is curved along one axis only.
fn is_ridge([above, here, below]: [[i32; 3]; 3]) -> bool {
    let (xx, yy) = (curvature(here), curvature([above[1], here[1], below[1]]));
    let xy = (f64::from(above[0]) + f64::from(below[2]) - f64::from(above[2]) - f64::from(below[0])) / 4.0;
    let (trace, det) = (xx + yy, xx * yy - xy * xy);
    det <= 0.0 || trace * trace * RIDGE > det * (RIDGE + 1.0) * (RIDGE + 1.0)
}

/// Where the parabolas through the middle of 3 x 3 values have their tops, decimated px from the middle.
fn subpixel([above, here, below]: [[i32; 3]; 3]) -> Vec2 {
    let top = |three: [i32; 3]| {
        let curve = curvature(three);
        if curve < 0.0 { (f64::from(three[0]) - f64::from(three[2])) / (2.0 * curve) } else { 0.0 }
    };
    Vec2::new(top(here), top([above[1], here[1], below[1]]))
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
