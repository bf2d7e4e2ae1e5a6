//! The contact region of a smooth gel: where the colour of coarse cells differs from the rest frame.
//!
//! ```text
//!   object       \\_____________/        the slope of the gel is largest at the rim of the contact:
//!   gel    ____/                 \____    the region ends where the change falls below a share of the strongest nearby
//!   change   .:|:._  middle  _.:|:.
//!              ^ filled: enclosed, or open to one side of the view or two opposite ones (an object cut by it)
//! ```
//!
//! Cells under a marker, at rest or now, are left out and filled from their neighbours; a common change of
//! brightness (exposure, a warming LED) is divided out first.

use crate::image::{Mask, SizePx};
use crate::monitor::cell_map::{CellMap, cover_radius_px};
use crate::pixels::binomial::{Binomial, Weighted};
use crate::pixels::cells::Cells;
use crate::pixels::components::Components;
use crate::pixels::contour::mask_above;
use crate::pixels::disc::Disc;
use crate::pixels::threshold::at_least;
use crate::pixels::wide::wide;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// What has changed in a frame, besides the contact region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShadingChange {
    /// Mean change where it counts, levels.
    pub mean_levels: f64,
    /// Area of the changes that are large enough for a contact, beyond its rim included, px2.
    pub changed_px2: f64,
    /// Area of the pieces that are each too small for a contact, px2.
    pub small_px2: f64,
}

/// Change against rest; owns all scratch.
#[derive(Debug, Clone)]
pub(crate) struct ShadingContact {
    map: CellMap,
    rest: Vec<[f32; 3]>,
    rest_covered: Vec<bool>,
    /// The smoothed change of the first frame, where it was kept, and whether that is the last frame.
    start: Vec<Weighted>,
    starts_now: bool,
    covered: Vec<bool>,
    cover_radius_px: f64,
    least_cells: usize,
    ratios: Vec<f32>,
    change: Vec<Weighted>,
    smooth: Binomial,
    score: Vec<f32>,
    disc: Disc,
    rim_fraction: f32,
    rim: Vec<f32>,
    work: Vec<f32>,
    /// The change that one cell in a hundred exceeded in the last frame.
    last_peak: f32,
    /// Cells that changed, their connected pieces, and the number of cells and strongest change of each piece.
    changed: Mask,
    cell_components: Components,
    measures: Vec<(usize, f32)>,
    /// Per unchanged piece: the sides of the view that it reaches.
    sides: Vec<u8>,
    components: Components,
}

impl ShadingContact {
    pub(crate) fn new(
        sensor: &Sensor,
        cells: &Cells,
        rest: &[[f32; 3]],
        rest_covered: &[bool],
        close_pitch: f64,
        rim_fraction: f64,
        least_px: f64,
    ) -> Self {
        let map = CellMap::new(sensor, cells);
        let count = map.count();
        let cell_px = map.cell_px as f64;
        ShadingContact {
            rest: rest.to_vec(),
            rest_covered: rest_covered.to_vec(),
            start: Vec::with_capacity(count),
            starts_now: false,
            covered: vec![false; count],
            cover_radius_px: cover_radius_px(sensor),
            disc: Disc::new(map.columns, count, (close_pitch * sensor.pitch_px / 2.0 / cell_px).round() as usize),
            rim_fraction: rim_fraction as f32,
            rim: vec![0.0; count],
            least_cells: (least_px / (cell_px * cell_px)).ceil() as usize,
            ratios: Vec::with_capacity(count),
            change: vec![[0.0; 4]; count],
            smooth: Binomial::new(map.columns, count),
            score: vec![0.0; count],
            work: vec![0.0; count],
            last_peak: 0.0,
            changed: Mask::new(SizePx::new(map.columns, map.rows)),
            cell_components: Components::new(SizePx::new(map.columns, map.rows)),
            measures: Vec::with_capacity(count),
            sides: Vec::with_capacity(count),
            components: Components::new(sensor.rectified_px()),
            map,
        }
    }

    /// Writes the contact region. `change_fraction`: a change below this share of the strongest is light reflected by
    /// the imprint, and so is a piece that nowhere reaches twice that share.
    pub(crate) fn find(
        &mut self,
        cells: &Cells,
        markers: impl Iterator<Item = Vec2>,
        change_levels: f32,
        change_fraction: f32,
        region: &mut Mask,
    ) -> ShadingChange {
        self.starts_now = false;
        self.covered.copy_from_slice(&self.rest_covered);
        for centre in markers {
            self.map.cover(centre, self.cover_radius_px, &mut self.covered);
        }
        let gain = self.gain(cells);
        let means = cells.means_levels();
        let known = self.rest.iter().zip(&self.covered).zip(self.map.camera_cells());
        for (change, ((rest, &covered), &cell)) in self.change.iter_mut().zip(known) {
            let now = means[cell as usize];
            let seen = [now[0] * gain[0] - rest[0], now[1] * gain[1] - rest[1], now[2] * gain[2] - rest[2], 1.0];
            *change = if covered { [0.0; 4] } else { seen };
        }
        self.smooth.run(&mut self.change);
        strongest_channels(&self.change, &mut self.score);
        // Deviation: D15 stray light
        let peak = self.peak();
        let change_levels = change_levels.max(change_fraction * peak);
        let mean_levels = mean_above(&self.score, change_levels);
        self.rim.copy_from_slice(&self.score);
        // Joins the lines left by the rim of an object into one region.
        self.disc.dilate(&mut self.score);
        // Deviation: D20 the rim ends the region
        if self.rim_fraction > 0.0 {
            over_near(&mut self.rim, &self.score, change_levels, self.rim_fraction);
        }
        self.disc.erode(&mut self.score);
        let (changed_count, small_count) = self.drop_small(change_levels, 2.0 * change_fraction * peak);
        let (columns, cell_px) = (self.map.columns, self.map.cell_px);
        if self.rim_fraction > 0.0 {
            self.rim.iter_mut().zip(&self.score).for_each(|(rim, &kept)| *rim = if kept > 0.0 { *rim } else { 0.0 });
            self.disc.close(&mut self.rim);
            // The enclosed area, such as the flat middle of an object, changes less than the rim.
            self.fill_cut(change_levels);
            // This leaves no hole: cells below the level connect to the border, and so does the field between them.
            mask_above(&self.rim, columns, cell_px, change_levels, &mut self.changed, region);
        } else {
            mask_above(&self.score, columns, cell_px, change_levels, &mut self.changed, region);
            self.components.fill_holes(region);
        }
        let area_px2 = |count: usize| (count * cell_px * cell_px) as f64;
        ShadingChange { mean_levels, changed_px2: area_px2(changed_count), small_px2: area_px2(small_count) }
    }

    /// Share of the cells whose colour in the last frame differs by more than a level from that in the first frame for
    /// which this was asked.
    pub(crate) fn changed_since_start_fraction(&mut self, level: f32) -> f64 {
        if self.start.is_empty() {
            self.starts_now = true;
            self.start.extend_from_slice(&self.change);
        }
        let differs = |(now, start): (&Weighted, &Weighted)| {
            let known = now[3] > 0.0 && start[3] > 0.0;
            known && (0..3).any(|channel| (now[channel] - start[channel]).abs() > level)
        };
        let changed_count = self.change.iter().zip(&self.start).filter(|cell| differs(*cell)).count();
        changed_count as f64 / self.change.len().max(1) as f64
    }

    /// The last frame shows no finger: it is no first one either.
    pub(crate) fn forget_frame(&mut self) {
        if std::mem::take(&mut self.starts_now) {
            self.start.clear();
        }
    }

    /// Factor of each channel that undoes a common change of brightness: the median of rest / now.
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

    /// The change that one cell in a hundred exceeds.
    fn peak(&mut self) -> f32 {
        let at = self.score.len() * 99 / 100;
        let wanted = self.score.len() - at;
        // Only values near the last peak are searched, if there are enough of them.
        let floor = 0.7 * self.last_peak;
        let mut count = 0;
        for &v in &self.score {
            self.work[count] = v;
            count += usize::from(v > floor);
        }
        self.last_peak = if count >= wanted {
            *self.work[..count].select_nth_unstable_by(count - wanted, f32::total_cmp).1
        } else {
            self.work.copy_from_slice(&self.score);
            *self.work.select_nth_unstable_by(at, f32::total_cmp).1
        };
        self.last_peak
    }

    /// Fills areas that the region encloses alone, with one side of the view, or with two opposite ones: the middle of
    /// an object that the view cuts.
    fn fill_cut(&mut self, level: f32) {
        let (columns, rows) = (self.map.columns, self.map.rows);
        at_least(&self.rim, level, &mut self.changed);
        let runs = self.cell_components.clear_runs_by_sides(&self.changed);
        self.sides.clear();
        for run in runs.clone() {
            let (left, right) = (run.columns.start == 0, run.columns.end == columns);
            let (top, bottom) = (run.row == 0, run.row + 1 == rows);
            self.sides.push(0);
            for (touches, side) in [(left, LEFT), (right, RIGHT), (top, TOP), (bottom, BOTTOM)] {
                self.sides[run.component] |= if touches { side } else { 0 };
            }
        }
        for run in runs {
            let sides = self.sides[run.component];
            if sides.count_ones() <= 1 || sides == LEFT | RIGHT || sides == TOP | BOTTOM {
                self.rim[run.row * columns..][run.columns].fill(level);
            }
        }
    }

    /// Drops pieces that are small or nowhere reach `peak`; returns the number of cells of the others, and of
    /// those that are only too small.
    fn drop_small(&mut self, level: f32, peak: f32) -> (usize, usize) {
        at_least(&self.score, level, &mut self.changed);
        let columns = self.map.columns;
        let (runs, measures, score) =
            (self.cell_components.runs_by_sides(&self.changed), &mut self.measures, &mut self.score);
        measures.clear();
        for (i, run) in runs.clone().enumerate() {
            let cells = &score[run.row * columns..][run.columns.clone()];
            let highest = cells.iter().copied().fold(0.0, f32::max);
            measures.push((cells.len(), highest));
            // The first run of a piece comes before its others.
            if run.component != i {
                let first = &mut measures[run.component];
                *first = (first.0 + cells.len(), first.1.max(highest));
            }
        }
        let (mut kept, mut small) = (0, 0);
        for run in runs {
            let (count, highest) = measures[run.component];
            if highest >= peak && count < self.least_cells {
                small += run.columns.len();
            }
            if count < self.least_cells || highest < peak {
                score[run.row * columns..][run.columns].fill(0.0);
            } else {
                kept += run.columns.len();
            }
        }
        (kept, small)
    }
}

/// Sides of the view.
const LEFT: u8 = 1;
const RIGHT: u8 = 2;
const TOP: u8 = 4;
const BOTTOM: u8 = 8;

wide! {
    /// Scales each change so that `level` is the given share of the strongest change nearby; never raises it.
    fn over_near(change: &mut [f32], near: &[f32], level: f32, fraction: f32) {
        for (change, &near) in change.iter_mut().zip(near) {
            let by_near = if near > 0.0 { level * *change / (fraction * near) } else { 0.0 };
            *change = if by_near < *change { by_near } else { *change };
        }
    }

    /// The change of the most changed channel of each cell; zero where it is unknown.
    fn strongest_channels(change: &[[f32; 4]], score: &mut [f32]) {
        for (score, c) in score.iter_mut().zip(change) {
            let most = c[0].abs().max(c[1].abs()).max(c[2].abs());
            *score = if c[3] > 0.0 { most } else { 0.0 };
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
