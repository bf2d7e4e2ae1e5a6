//! Coarse cells on the rectified image: which camera cell each one shows, and which ones markers cover. Contact on
//! smooth gels and the rest frame are computed on them.

use crate::pixels::cells::Cells;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Possible sides of a cell, px.
const CELLS_PX: [usize; 3] = [4, 8, 16];
/// Widest cell, in pitches; and widest cell where there would be more than [`MOST_COUNT`].
const FINE_PITCH: f64 = 0.17;
const COARSE_PITCH: f64 = 0.36;
const MOST_COUNT: usize = 10_000;
/// The gap between four markers is this many cells wide: then one of them is free, wherever the grid lies.
const BETWEEN_CELLS: f64 = 2.2;

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
    /// Cells of a sixth of a pitch: fine enough to see between large markers, coarse enough to average noise. Up to
    /// twice as wide where there would be too many to process in a frame: contact and evidence are then nearly as good
    /// (bench/eval.md). Not wider than what markers leave of the gel between four of them.
    pub(crate) fn cell_px(sensor: &Sensor) -> usize {
        let size = sensor.rectified_px();
        let count = |c: usize| (size.width / c) * (size.height / c);
        let reach = |share: f64| move |c: &usize| *c as f64 <= share * sensor.pitch_px;
        let fine = CELLS_PX.into_iter().rev().find(reach(FINE_PITCH)).unwrap_or(CELLS_PX[0]);
        let between_px = std::f64::consts::SQRT_2 * sensor.pitch_px - 2.0 * cover_radius_px(sensor);
        let sees = |c: &usize| reach(COARSE_PITCH)(c) && (*c <= fine || *c as f64 <= between_px / BETWEEN_CELLS);
        let wide = CELLS_PX.into_iter().filter(sees).find(|&c| c >= fine && count(c) <= MOST_COUNT);
        wide.or(CELLS_PX.into_iter().rev().find(sees)).unwrap_or(fine)
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
                // Without a rectification, the border is that of the image, and known.
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

    /// The camera cell shown by each cell.
    pub(crate) fn camera_cells(&self) -> &[u32] {
        &self.camera_cell
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
            let dy = gap(row, centre.y);
            for column in left.max(0.0) as usize..=(right.max(0.0) as usize).min(self.columns - 1) {
                let dx = gap(column, centre.x);
                if dx * dx + dy * dy <= radius_px * radius_px {
                    covered[row * self.columns + column] = true;
                }
            }
        }
    }
}

/// Radius of the cover over a marker: this many of its diameters, and this much more, px.
const COVER_DIAMETERS: f64 = 0.55;
const COVER_RIM_PX: f64 = 1.5;

/// Radius around a marker within which cells do not count: its own radius, its blurred rim, and half a cell of motion.
pub(crate) fn cover_radius_px(sensor: &Sensor) -> f64 {
    COVER_DIAMETERS * sensor.marker_diameter_px + COVER_RIM_PX
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;
    use crate::sensor::tests::smooth;

    #[test]
    fn cells_are_a_sixth_of_a_pitch_and_wider_only_where_there_are_too_many() {
        for (width, height, pitch_px, cell_px) in [
            (320, 240, 15.0, 4),
            (320, 240, 30.8, 4),
            (320, 240, 44.0, 4),
            (640, 480, 22.0, 4),
            (640, 480, 22.8, 8),
            (640, 480, 33.0, 8),
            (640, 480, 61.6, 8),
            (640, 480, 100.0, 16),
            (1920, 1440, 61.6, 16),
            (1920, 1440, 26.5, 8),
        ] {
            let sensor = Sensor { image_px: SizePx::new(width, height), pitch_px, ..smooth() };
            assert_eq!(CellMap::cell_px(&sensor), cell_px, "{width} x {height}, pitch {pitch_px} px");
        }
        // Large markers leave no room for wide cells.
        for (pitch_px, marker_diameter_px, cell_px) in [(22.8, 8.0, 8), (22.8, 14.0, 4), (33.0, 22.0, 8)] {
            let sensor = Sensor { image_px: SizePx::new(640, 480), pitch_px, marker_diameter_px, ..smooth() };
            assert_eq!(CellMap::cell_px(&sensor), cell_px, "pitch {pitch_px} px, dots of {marker_diameter_px} px");
        }
    }

    /// In the middle, over a corner of a cell, at every border, beyond it.
    #[test]
    fn a_marker_covers_the_cells_that_its_disc_reaches_and_no_others() {
        let sensor = Sensor { image_px: SizePx::new(64, 48), ..smooth() };
        let map = CellMap::new(&sensor, &Cells::new(sensor.image_px, 4));
        assert_eq!((map.columns, map.rows), (16, 12));
        let radius_px = 5.0;
        for (x, y) in [
            (30.2, 20.9),
            (31.5, 23.5),
            (0.0, 20.0),
            (63.0, 21.0),
            (33.0, 0.4),
            (30.0, 47.0),
            (61.0, 45.0),
            (66.0, 30.0),
        ] {
            let mut covered = vec![false; map.count()];
            map.cover(Vec2::new(x, y), radius_px, &mut covered);
            for (i, covered) in covered.into_iter().enumerate() {
                let left = (i % map.columns * 4) as f64 - 0.5;
                let top = (i / map.columns * 4) as f64 - 0.5;
                let away_px = Vec2::new(x - x.clamp(left, left + 4.0), y - y.clamp(top, top + 4.0)).length();
                assert!(!covered || away_px <= radius_px, "cell {i}, {away_px} px from {x}, {y}");
                // The covered range is exact to half a pixel.
                assert!(covered || away_px > radius_px - 0.5, "cell {i}, {away_px} px from {x}, {y}");
            }
        }
    }
}
