//! How sharp a smooth gel looks between its markers: an imprint is sharper than illumination can be.
//!
//! ```text
//!   . . . . . . .     a cell counts where it and most of its neighbours are    a pitch of few cells:    each cell is the
//!   . o . . . o .     free, far from markers: their rims are sharp, too        o o o o o                mean of its parts
//!   . . . . . . .                                                              nothing is free          that are free
//! ```

use crate::image::Pixels;
use crate::monitor::cell_map::{CellMap, cover_radius_px};
use crate::pixels::binomial::{Binomial, Weighted};
use crate::pixels::cells::Cells;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Distance from markers, in pitches, at which whole cells count, if at least this share of them then does.
const WIDE_PITCH: f64 = 0.4;
const LEAST_COMPARED_FRACTION: f64 = 0.03;
/// Otherwise cells consist of parts of this width, px, and parts count from the distance, in so many steps down to the
/// rim of the markers, at which this share of the cells does.
const PART_PX: usize = 2;
const RADIUS_STEPS: u32 = 8;
const LEAST_CLOSE_FRACTION: f64 = 0.3;
/// Free share of a cell that counts, and of its neighbourhood: with more of it hidden its mean is off centre, unless
/// markers are all around.
const LEAST_FREE: f32 = 0.4;
const LEAST_FREE_AROUND: [f32; 2] = [0.7, 0.4];

/// Radius around a marker within which cells do not count, unless its pitch is too short for it.
pub(super) fn wide_radius_px(sensor: &Sensor) -> f64 {
    (WIDE_PITCH * sensor.pitch_px).max(cover_radius_px(sensor))
}

/// Cells covered by a marker, and cells that the camera does not see entirely.
pub(super) fn covered(map: &CellMap, markers: &[Vec2], radius_px: f64) -> Vec<bool> {
    let mut covered = map.unseen.clone();
    markers.iter().for_each(|&centre| map.cover(centre, radius_px, &mut covered));
    covered
}

/// Measures it.
#[derive(Debug, Clone)]
pub(super) struct Sharpness {
    /// The parts of the cells, and how many of them a cell has along each side.
    parts: Cells,
    map: CellMap,
    parts_a_side: usize,
    /// Parts nearer to a marker, and cells nearer to the border of the image, do not count.
    hidden_radius_px: f64,
    border_cells: usize,
    least_free_around: f32,
    /// Whether any cell counts between markers of this pitch and diameter.
    tells: bool,
}

impl Sharpness {
    /// With cells as wide as those of the contact region.
    pub(super) fn new(sensor: &Sensor) -> Self {
        let cell_px = CellMap::cell_px(sensor);
        let of_parts = |part_px: usize, hidden_radius_px: f64, least_free_around: f32| {
            let parts = Cells::new(sensor.image_px, part_px);
            Sharpness {
                map: CellMap::new(sensor, &parts),
                parts,
                parts_a_side: cell_px / part_px,
                hidden_radius_px,
                border_cells: (sensor.marker_diameter_px / cell_px as f64).ceil() as usize,
                least_free_around,
                tells: true,
            }
        };
        let wide = of_parts(cell_px, wide_radius_px(sensor), LEAST_FREE_AROUND[0]);
        if wide.compared_fraction(sensor) >= LEAST_COMPARED_FRACTION {
            return wide;
        }
        // As far from markers as their pitch allows.
        let (most, least) = (wide_radius_px(sensor), cover_radius_px(sensor));
        let radius_px = |step: u32| most + f64::from(step) / f64::from(RADIUS_STEPS) * (least - most);
        let mut close = of_parts(PART_PX, most, LEAST_FREE_AROUND[1]);
        let leaves_enough = |step: &u32| {
            close.hidden_radius_px = radius_px(*step);
            close.compared_fraction(sensor) >= LEAST_CLOSE_FRACTION
        };
        let tells = (0..=RADIUS_STEPS).find(leaves_enough).is_some();
        Sharpness { tells, ..close }
    }

    /// Whether any cell counts between the markers of this finger.
    pub(super) fn tells(&self) -> bool {
        self.tells
    }

    /// Whether cells keep far from markers: how sharp an untouched finger looks then depends on its light alone.
    pub(super) fn is_wide(&self) -> bool {
        self.parts_a_side == 1
    }

    /// Share of the cells that count between markers a pitch apart.
    fn compared_fraction(&self, sensor: &Sensor) -> f64 {
        let (size, pitch_px) = (sensor.rectified_px(), sensor.pitch_px);
        let along = |length_px: usize| (0..(length_px as f64 / pitch_px) as usize).map(|i| (i as f64 + 0.5) * pitch_px);
        let row = |y: f64| along(size.width).map(move |x| Vec2::new(x, y));
        let cells = self.cells(&along(size.height).flat_map(row).collect::<Vec<_>>(), |_| [0.0; 3]);
        self.differences_levels(&cells).len() as f64 / cells.len() as f64
    }

    /// Sharpness of a camera image with these markers, levels; not a number where they leave nothing to compare.
    pub(super) fn levels(&mut self, pixels: &Pixels<'_>, markers: &[Vec2]) -> f64 {
        if !self.tells {
            return f64::NAN;
        }
        self.parts.run(pixels);
        let cells = self.cells(markers, |part| self.map.colour(&self.parts, part));
        self.roughness_levels(&cells).unwrap_or(f64::NAN)
    }

    fn columns(&self) -> usize {
        self.map.columns / self.parts_a_side
    }

    /// Colours of the cells, weighted with the share of each that is free of markers.
    fn cells(&self, markers: &[Vec2], colour: impl Fn(usize) -> [f32; 3]) -> Vec<Weighted> {
        let covered = covered(&self.map, markers, self.hidden_radius_px);
        let (side, columns, rows) = (self.parts_a_side, self.columns(), self.map.rows / self.parts_a_side);
        let part_weight = 1.0 / (side * side) as f32;
        let mut cells = vec![[0.0; 4]; columns * rows];
        for (i, cell) in cells.iter_mut().enumerate() {
            let corner = i / columns * side * self.map.columns + i % columns * side;
            for part in (0..side * side).map(|k| corner + k / side * self.map.columns + k % side) {
                if !covered[part] {
                    let [r, g, b] = colour(part);
                    cell.iter_mut().zip([r, g, b, 1.0]).for_each(|(sum, v)| *sum += part_weight * v);
                }
            }
        }
        cells
    }

    /// The 99th percentile of the difference between a cell and its neighbourhood, levels; None without such cells.
    /// Illumination alone stays below about 5; an imprint does not.
    fn roughness_levels(&self, cells: &[Weighted]) -> Option<f64> {
        let mut sharp = self.differences_levels(cells);
        let at = sharp.len() * 99 / 100;
        (!sharp.is_empty()).then(|| f64::from(*sharp.select_nth_unstable_by(at, f32::total_cmp).1))
    }

    /// The difference between each cell and its neighbourhood, of the cells that count. A marker cut by the border of the
    /// image is no spot, so cells within `border_cells` of it do not.
    fn differences_levels(&self, cells: &[Weighted]) -> Vec<f32> {
        let (columns, border) = (self.columns(), self.border_cells);
        let rows = cells.len() / columns;
        let shown = |i: usize| {
            let (x, y) = (i % columns, i / columns);
            let inside = x.min(y) >= border && x + border < columns && y + border < rows;
            inside && cells[i][3] >= LEAST_FREE
        };
        let mut around: Vec<Weighted> =
            cells.iter().enumerate().map(|(i, cell)| if shown(i) { *cell } else { [0.0; 4] }).collect();
        Binomial::new(columns, around.len()).run(&mut around);
        let pairs = cells.iter().zip(&around).enumerate();
        let compared = pairs.filter(|(i, (_, around))| shown(*i) && around[3] > self.least_free_around * 256.0);
        let difference = |(cell, around): (&Weighted, &Weighted)| {
            (0..3).map(|c| (cell[c] / cell[3] - around[c]).abs()).fold(0.0, f32::max)
        };
        compared.map(|(_, pair)| difference(pair)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;
    use crate::monitor::contact::illumination_tests::{COLUMNS, ROWS, cells, imprint};
    use crate::sensor::tests::smooth;

    /// On 160 x 120 px, with three cells at the border that do not count.
    fn sharpness() -> Sharpness {
        let size = SizePx::new(4 * COLUMNS, 4 * ROWS);
        let sensor = Sensor { image_px: size, pitch_px: 40.0, marker_diameter_px: 12.0, ..smooth() };
        let sharpness = Sharpness::new(&sensor);
        assert!(sharpness.is_wide() && (sharpness.columns(), sharpness.border_cells) == (COLUMNS, 3));
        sharpness
    }

    #[test]
    fn an_imprint_is_sharp_and_light_and_cut_or_covered_cells_are_not() {
        let sharpness = sharpness();
        let seen = vec![false; COLUMNS * ROWS];
        let roughness = |cells: &[[f32; 3]], covered: &[bool]| {
            let weighed = |(c, covered): (&[f32; 3], &bool)| if *covered { [0.0; 4] } else { [c[0], c[1], c[2], 1.0] };
            sharpness.roughness_levels(&cells.iter().zip(covered).map(weighed).collect::<Vec<_>>())
        };
        let sharp_levels = |cells: &[[f32; 3]], covered: &[bool]| roughness(cells, covered).expect("cells");
        assert!(sharp_levels(&cells(), &seen) < 1.0, "{}", sharp_levels(&cells(), &seen));
        let mut touched = cells();
        imprint(&mut touched, 6.0);
        let levels = sharp_levels(&touched, &seen);
        assert!((8.0..30.0).contains(&levels), "{levels}");
        // A spot in a covered cell, or within three cells of the border, does not count.
        for spots in
            [[(20, 15), (21, 15)], [(0, 15), (2, 8)], [(39, 15), (37, 4)], [(9, 0), (30, 2)], [(9, 29), (30, 27)]]
        {
            let mut spotted = cells();
            let mut covered = seen.clone();
            for (x, y) in spots {
                spotted[y * COLUMNS + x] = [255.0; 3];
                covered[y * COLUMNS + x] = x == 20 || x == 21;
            }
            assert!(sharp_levels(&spotted, &covered) < 1.0, "{spots:?}: {}", sharp_levels(&spotted, &covered));
        }
        assert_eq!(roughness(&touched, &vec![true; COLUMNS * ROWS]), None);
    }
}
