//! The contact region of a smooth gel: where the colour of coarse cells has left the rest picture.
//!
//! Cells under a marker, then or now, are left out and filled from their neighbours; a common change of
//! brightness (exposure, a warming LED) is divided out first.

use crate::image::Mask;
use crate::monitor::cell_map::{CellMap, cover_radius_px, smooth};
use crate::pixels::cells::Cells;
use crate::pixels::components::Components;
use crate::pixels::contour::mask_above;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Change against rest; owns all scratch.
#[derive(Debug, Clone)]
pub(crate) struct ShadingContact {
    map: CellMap,
    rest: Vec<[f32; 3]>,
    rest_covered: Vec<bool>,
    covered: Vec<bool>,
    cover_radius_px: f64,
    least_cells: usize,
    ratios: Vec<f32>,
    change: Vec<[f32; 4]>,
    scratch: Vec<[f32; 4]>,
    score: Vec<f32>,
    widened: Vec<Vec<f32>>,
    work: Vec<f32>,
    stack: Vec<u32>,
    components: Components,
}

impl ShadingContact {
    pub(crate) fn new(
        sensor: &Sensor,
        cells: &Cells,
        rest: &[[f32; 3]],
        rest_covered: &[bool],
        close_pitch: f64,
        least_px: f64,
    ) -> Self {
        let map = CellMap::new(sensor, cells);
        let count = map.count();
        let cell_px = map.cell_px as f64;
        ShadingContact {
            rest: rest.to_vec(),
            rest_covered: rest_covered.to_vec(),
            covered: vec![false; count],
            cover_radius_px: cover_radius_px(sensor),
            widened: vec![vec![0.0; count]; (close_pitch * sensor.pitch_px / 2.0 / cell_px).round() as usize + 1],
            least_cells: (least_px / (cell_px * cell_px)).ceil() as usize,
            ratios: Vec::with_capacity(count),
            change: vec![[0.0; 4]; count],
            scratch: vec![[0.0; 4]; count],
            score: vec![0.0; count],
            work: vec![0.0; count],
            stack: Vec::with_capacity(count),
            components: Components::new(sensor.rectified_px()),
            map,
        }
    }

    /// Writes the contact region; returns the mean change inside it in levels. `change_fraction`: what changes less than
    /// this share of the strongest change is light that the imprint reflects elsewhere, and so is a piece that nowhere reaches
    /// twice that share.
    pub(crate) fn find(
        &mut self,
        cells: &Cells,
        markers: impl Iterator<Item = Vec2>,
        change_levels: f32,
        change_fraction: f32,
        region: &mut Mask,
    ) -> f64 {
        self.covered.copy_from_slice(&self.rest_covered);
        for centre in markers {
            self.map.cover(centre, self.cover_radius_px, &mut self.covered);
        }
        let gain = self.gain(cells);
        for i in 0..self.map.count() {
            let (now, rest) = (self.map.colour(cells, i), self.rest[i]);
            self.change[i] = if self.covered[i] {
                [0.0; 4]
            } else {
                [now[0] * gain[0] - rest[0], now[1] * gain[1] - rest[1], now[2] * gain[2] - rest[2], 1.0]
            };
        }
        smooth(&mut self.change, &mut self.scratch, self.map.columns);
        for (score, c) in self.score.iter_mut().zip(&self.change) {
            *score = if c[3] > 0.0 { c[0].abs().max(c[1].abs()).max(c[2].abs()) } else { 0.0 };
        }
        // Deviation: D15 stray light
        let peak = self.peak();
        let change_levels = change_levels.max(change_fraction * peak);
        let strength = mean_above(&self.score, change_levels);
        self.close();
        self.drop_small(change_levels, 2.0 * change_fraction * peak);
        mask_above(&self.score, self.map.columns, self.map.cell_px, change_levels, region);
        // The flat middle of an object changes less than its rim.
        self.components.fill_holes(region);
        strength
    }

    /// What each channel must be multiplied by to undo a common change of brightness: the median of rest / now.
    fn gain(&mut self, cells: &Cells) -> [f32; 3] {
        std::array::from_fn(|channel| {
            self.ratios.clear();
            // Every eleventh cell is enough for a median.
            for i in (0..self.map.count()).step_by(11).filter(|&i| !self.covered[i]) {
                self.ratios.push(self.rest[i][channel] / self.map.colour(cells, i)[channel].max(1.0));
            }
            if self.ratios.is_empty() {
                return 1.0;
            }
            let middle = self.ratios.len() / 2;
            *self.ratios.select_nth_unstable_by(middle, f32::total_cmp).1
        })
    }

    /// Greyscale closing with a disc: joins the lines that the rim of an object leaves into the region between them.
    fn close(&mut self) {
        let (columns, widened) = (self.map.columns, &mut self.widened);
        spread(&mut self.score, widened, columns, 0.0, |a, b| if a > b { a } else { b });
        spread(&mut self.score, widened, columns, f32::MAX, |a, b| if a < b { a } else { b });
    }

    /// The change that one cell in a hundred exceeds.
    fn peak(&mut self) -> f32 {
        self.work.copy_from_slice(&self.score);
        let at = self.work.len() * 99 / 100;
        *self.work.select_nth_unstable_by(at, f32::total_cmp).1
    }

    /// Drops pieces that are small or reach `peak` nowhere.
    fn drop_small(&mut self, level: f32, peak: f32) {
        let columns = self.map.columns;
        // `work` says what has been seen.
        self.work.fill(0.0);
        for start in 0..self.score.len() {
            if self.score[start] < level || self.work[start] != 0.0 {
                continue;
            }
            self.stack.clear();
            self.stack.push(start as u32);
            self.work[start] = 1.0;
            let mut next = 0;
            while next < self.stack.len() {
                let i = self.stack[next] as usize;
                next += 1;
                let (x, y) = (i % columns, i / columns);
                let around = [
                    (x > 0).then(|| i - 1),
                    (x + 1 < columns).then(|| i + 1),
                    (y > 0).then(|| i - columns),
                    (y + 1 < self.map.rows).then(|| i + columns),
                ];
                for j in around.into_iter().flatten() {
                    if self.work[j] == 0.0 && self.score[j] >= level {
                        self.work[j] = 1.0;
                        self.stack.push(j as u32);
                    }
                }
            }
            let highest = self.stack.iter().map(|&i| self.score[i as usize]).fold(0.0, f32::max);
            if self.stack.len() < self.least_cells || highest < peak {
                for &i in &self.stack {
                    self.score[i as usize] = 0.0;
                }
            }
        }
    }
}

/// Maximum or minimum over a disc around every cell; its radius is one less than the number of `widened` scratch
/// pictures. `start` is what any value replaces.
fn spread(
    values: &mut [f32],
    widened: &mut [Vec<f32>],
    columns: usize,
    start: f32,
    reduce: impl Fn(f32, f32) -> f32 + Copy,
) {
    let (rows, k) = (values.len() / columns, widened.len() - 1);
    let take = |to: &mut [f32], from: &[f32]| to.iter_mut().zip(from).for_each(|(t, &f)| *t = reduce(*t, f));
    // widened[w]: over 2 w + 1 cells of the row.
    widened[0].copy_from_slice(values);
    for w in 1..=k {
        let (narrower, wider) = widened.split_at_mut(w);
        wider[0].copy_from_slice(&narrower[w - 1]);
        let rows = values.chunks_exact(columns).zip(wider[0].chunks_exact_mut(columns));
        for (row, out) in rows.filter(|_| w < columns) {
            take(&mut out[w..], &row[..columns - w]);
            take(&mut out[..columns - w], &row[w..]);
        }
    }
    for (y, out) in values.chunks_exact_mut(columns).enumerate() {
        out.fill(start);
        for near in y.saturating_sub(k)..=(y + k).min(rows - 1) {
            let away = near.abs_diff(y);
            let w = ((k * k - away * away) as f64).sqrt().round() as usize;
            take(out, &widened[w][near * columns..][..columns]);
        }
    }
}

fn mean_above(values: &[f32], level: f32) -> f64 {
    let (mut sum, mut count) = (0.0f64, 0u32);
    for &v in values.iter().filter(|&&v| v >= level) {
        sum += f64::from(v);
        count += 1;
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}
