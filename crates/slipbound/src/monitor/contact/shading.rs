//! The contact region of a smooth gel: where the colour of coarse cells has left the rest picture.
//!
//! Cells under a marker, then or now, are left out and filled from their neighbours; a common change of
//! brightness (exposure, a warming LED) is divided out first.

use crate::image::Mask;
use crate::pixels::cells::Cells;
use crate::pixels::components::Components;
use crate::pixels::contour::mask_above;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// The geometry of cells on the rectified image: which camera cell each shows.
#[derive(Debug, Clone)]
pub(crate) struct CellMap {
    pub(crate) cell_px: usize,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    camera_cell: Vec<u32>,
    /// Cells that the camera does not see, or only next to its border, where markers are cut.
    pub(crate) unseen: Vec<bool>,
}

impl CellMap {
    /// Cells of a sixth of a pitch: fine enough to see between large markers, coarse enough to average noise.
    pub(crate) fn cell_px(sensor: &Sensor) -> usize {
        [4, 8, 16].into_iter().rev().find(|&c| c as f64 <= 0.17 * sensor.pitch_px).unwrap_or(4)
    }

    pub(crate) fn new(sensor: &Sensor, cells: &Cells) -> Self {
        let (size, cell_px) = (sensor.rectified_px(), cells.cell_px());
        let (columns, rows) = (size.width / cell_px, size.height / cell_px);
        let half = (cell_px as f64 - 1.0) / 2.0;
        let camera_cell = (0..columns * rows)
            .map(|i| {
                let centre = Vec2::new((i % columns) as f64, (i / columns) as f64) * cell_px as f64;
                let there = sensor.camera_from_rectified(centre + Vec2::new(half, half)) / cell_px as f64;
                let index = |v: f64, end: usize| (v.max(0.0) as usize).min(end - 1);
                (index(there.y, cells.rows()) * cells.columns() + index(there.x, cells.columns())) as u32
            })
            .collect();
        let margin_px = sensor.marker_diameter_px;
        let seen = |at: f64, len: usize| at >= margin_px && at <= len as f64 - 1.0 - margin_px;
        let unseen = (0..columns * rows)
            .map(|i| {
                let corner = Vec2::new((i % columns) as f64, (i / columns) as f64) * cell_px as f64;
                let there = sensor.camera_from_rectified(corner + Vec2::new(half, half));
                // Without a rectification the border is that of the picture, and known as such.
                sensor.rectification.is_some()
                    && !(seen(there.x, sensor.image_px.width) && seen(there.y, sensor.image_px.height))
            })
            .collect();
        CellMap { cell_px, columns, rows, camera_cell, unseen }
    }

    /// Number of cells.
    pub(crate) fn count(&self) -> usize {
        self.camera_cell.len()
    }

    /// The colour of cell `i`.
    pub(crate) fn colour(&self, cells: &Cells, i: usize) -> [f32; 3] {
        cells.means_levels()[self.camera_cell[i] as usize]
    }

    /// Marks the cells that a marker at `centre` covers.
    pub(crate) fn cover(&self, centre: Vec2, radius_px: f64, covered: &mut [bool]) {
        if !centre.is_finite() {
            return;
        }
        let c = self.cell_px as f64;
        let (left, right) = ((centre.x - radius_px) / c, (centre.x + radius_px) / c);
        let (top, bottom) = ((centre.y - radius_px) / c, (centre.y + radius_px) / c);
        // Distance from the marker to the nearest point of a cell, along one axis.
        let gap = |cell: usize, at: f64| {
            let from = cell as f64 * c - 0.5;
            (from - at).max(at - (from + c)).max(0.0)
        };
        for row in top.max(0.0) as usize..=(bottom.max(0.0) as usize).min(self.rows - 1) {
            for column in left.max(0.0) as usize..=(right.max(0.0) as usize).min(self.columns - 1) {
                let (dx, dy) = (gap(column, centre.x), gap(row, centre.y));
                if dx * dx + dy * dy <= radius_px * radius_px {
                    covered[row * self.columns + column] = true;
                }
            }
        }
    }
}

/// Radius around a marker within which cells do not count: its own, its blurred rim, and half a cell of motion.
pub(crate) fn cover_radius_px(sensor: &Sensor) -> f64 {
    0.55 * sensor.marker_diameter_px + 1.5
}

/// Averages over a cell's neighbourhood with weights 1 4 6 4 1 each way, leaving out cells of weight 0.
/// `values` holds three channels and the weight, all premultiplied; the result is divided again.
pub(crate) fn smooth(values: &mut [[f32; 4]], scratch: &mut [[f32; 4]], columns: usize) {
    let rows = values.len() / columns;
    let add = |to: &mut [[f32; 4]], from: &[[f32; 4]], tap: f32| {
        for (t, f) in to.iter_mut().zip(from) {
            t.iter_mut().zip(f).for_each(|(t, f)| *t += tap * f);
        }
    };
    const TAPS: [(usize, f32); 2] = [(1, 4.0), (2, 1.0)];
    for (y, out) in scratch.chunks_exact_mut(columns).enumerate() {
        let row = |y: usize| &values[y * columns..][..columns];
        out.fill([0.0; 4]);
        add(out, row(y), 6.0);
        for (away, tap) in TAPS {
            if y >= away {
                add(out, row(y - away), tap);
            }
            if y + away < rows {
                add(out, row(y + away), tap);
            }
        }
    }
    for (row, out) in scratch.chunks_exact(columns).zip(values.chunks_exact_mut(columns)) {
        out.fill([0.0; 4]);
        add(out, row, 6.0);
        for (away, tap) in TAPS.into_iter().filter(|(away, _)| *away < columns) {
            add(&mut out[away..], &row[..columns - away], tap);
            add(&mut out[..columns - away], &row[away..], tap);
        }
    }
    for v in values {
        let per_weight = 1.0 / v[3].max(1e-6);
        v.iter_mut().take(3).for_each(|x| *x *= per_weight);
    }
}

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
    /// this share of the strongest change is light that the imprint throws about, and so is a piece that nowhere reaches
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
        // Deviation: D13 light thrown about
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
