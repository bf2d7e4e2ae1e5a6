//! The quantity that carries the imprint of an object, on coarse cells of the rectified image.
//!
//! ```text
//!   smooth gel:  ln R/G and ln B/G of a cell: the slope of the surface, independent of brightness
//!   fabric:      ln of the contrast of the weave in a cell: the weave shows where something presses it
//! ```

use crate::image::Gray;
use crate::monitor::cell_map::CellMap;
use crate::monitor::imprint::Imprint;
use crate::pixels::contrast::cell_contrast;
use crate::pixels::wide::wide;
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};

/// Two numbers of a cell; the second is zero on a fabric skin.
pub(super) type Shade = [f32; 2];

/// Added to levels before the logarithm, so that the noise of dark cells stays small.
const DARK_LEVELS: f32 = 4.0;

/// Number of cells whose table indices are computed at once.
const STRETCH: usize = 64;

/// Entries of the table of logarithms per level.
const STEPS_PER_LEVEL: f32 = 8.0;

/// Position of a rectified cell between the cells of the camera.
#[derive(Debug, Clone, Copy)]
struct Tap {
    cell: u32,
    right: f32,
    down: f32,
}

#[derive(Debug, Clone)]
enum Carrier {
    /// Colours of camera cells; one tap per rectified cell, none where both are the same.
    Colour { taps: Vec<Tap>, camera: Vec<Shade>, camera_columns: usize, ln: Vec<f32> },
    /// Contrast of the weave.
    Weave { sums: Vec<u16>, contrast: Vec<f32>, ln: Vec<f32> },
}

/// The cells of an image, with scratch.
#[derive(Debug, Clone)]
pub(super) struct ImageCells {
    pub(super) cell_px: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    cells_per_px: f32,
    carrier: Carrier,
    pub(super) shades: Vec<Shade>,
}

impl ImageCells {
    pub(super) fn new(sensor: &Sensor) -> Self {
        let (size, cell_px) = (sensor.rectified_px(), CellMap::cell_px(sensor));
        let (columns, rows) = (size.width / cell_px, size.height / cell_px);
        let ln = (0..(256.0 * STEPS_PER_LEVEL) as usize + 1)
            .map(|i| libm::logf(i as f32 / STEPS_PER_LEVEL + DARK_LEVELS))
            .collect();
        let carrier = match sensor.skin {
            Skin::Fabric => Carrier::Weave { sums: vec![0; size.width], contrast: vec![0.0; columns * rows], ln },
            Skin::Smooth => {
                let (camera_columns, camera_rows) = (sensor.image_px.width / cell_px, sensor.image_px.height / cell_px);
                Carrier::Colour {
                    taps: taps(sensor, cell_px, columns, rows, camera_columns, camera_rows),
                    camera: vec![[0.0; 2]; camera_columns * camera_rows],
                    camera_columns,
                    ln,
                }
            }
        };
        ImageCells {
            cell_px,
            columns,
            rows,
            cells_per_px: 1.0 / cell_px as f32,
            carrier,
            shades: vec![[0.0; 2]; columns * rows],
        }
    }

    /// Computes the shades of the last frame.
    pub(super) fn take(&mut self, imprint: &Imprint) {
        match &mut self.carrier {
            Carrier::Weave { sums, contrast, ln } => {
                let Ok(grey) = Gray::new(&imprint.grey, imprint.size()) else { return };
                cell_contrast(grey, self.cell_px, sums, contrast);
                for (shades, levels) in self.shades.chunks_mut(STRETCH).zip(contrast.chunks(STRETCH)) {
                    let mut places = [0; STRETCH];
                    table_places(levels, ln.len(), &mut places);
                    shades.iter_mut().zip(places).for_each(|(shade, at)| shade[0] = ln[at as usize]);
                }
            }
            Carrier::Colour { taps, camera, camera_columns, ln } => {
                let to = if taps.is_empty() { &mut self.shades } else { &mut *camera };
                let stretches = to.chunks_mut(STRETCH).zip(imprint.cells.means_levels().chunks(STRETCH));
                for (shades, colours) in stretches {
                    let mut places = [0; 3 * STRETCH];
                    table_places(colours.as_flattened(), ln.len(), &mut places);
                    for (shade, place) in shades.iter_mut().zip(places.as_chunks::<3>().0) {
                        let [red, green, blue] = place.map(|at| ln[at as usize]);
                        *shade = [red - green, blue - green];
                    }
                }
                for (shade, tap) in self.shades.iter_mut().zip(taps.iter()) {
                    *shade = mix(camera, *camera_columns, tap.cell as usize, tap.right, tap.down);
                }
            }
        }
    }

    /// Finds the cells around each position of a row.
    pub(super) fn locate(&self, places: &mut Places) {
        locate(places, self.cells_per_px, [self.columns, self.rows]);
    }

    /// The shade at position `i` of a located row, which must lie inside, interpolated between four cells.
    #[inline]
    pub(super) fn at(&self, places: &Places, i: usize) -> Shade {
        mix(&self.shades, self.columns, places.corner[i] as usize, places.right[i], places.down[i])
    }

    /// Centre of a cell in px.
    pub(super) fn centre_px(&self, cell: usize) -> Vec2 {
        let middle = (self.cell_px as f64 - 1.0) / 2.0;
        let corner = Vec2::new((cell % self.columns) as f64, (cell / self.columns) as f64) * self.cell_px as f64;
        corner + Vec2::new(middle, middle)
    }
}

wide! {
    /// Indices of the logarithms of levels in a table of `table_length`.
    fn table_places(levels: &[f32], table_length: usize, places: &mut [u32]) {
        let last = (table_length - 1) as f32;
        for (place, &levels) in places.iter_mut().zip(levels) {
            *place = (levels * STEPS_PER_LEVEL + 0.5).clamp(0.0, last) as i32 as u32;
        }
    }
}

fn mix(shades: &[Shade], columns: usize, at: usize, right: f32, down: f32) -> Shade {
    let (above, below) = (&shades[at..at + 2], &shades[at + columns..at + columns + 2]);
    std::array::from_fn(|k| {
        let upper = above[0][k] + right * (above[1][k] - above[0][k]);
        let lower = below[0][k] + right * (below[1][k] - below[0][k]);
        upper + down * (lower - upper)
    })
}

/// Positions in the rectified image, px, and the cells around them; scratch of one row.
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub(super) x_px: Vec<f32>,
    pub(super) y_px: Vec<f32>,
    /// 1 where a position lies between four cells, 0 beyond the outermost.
    pub(super) inside: Vec<u8>,
    /// The upper left of the four, and the fractions of the way to the next.
    corner: Vec<u32>,
    right: Vec<f32>,
    down: Vec<f32>,
}

impl Places {
    pub(super) fn new(count: usize) -> Self {
        let zeros = vec![0.0; count];
        Places {
            x_px: zeros.clone(),
            y_px: zeros.clone(),
            inside: vec![0; count],
            corner: vec![0; count],
            right: zeros.clone(),
            down: zeros,
        }
    }
}

wide! {
    fn locate(places: &mut Places, cells_per_px: f32, cells: [usize; 2]) {
        let n = places.x_px.len();
        let (x_px, y_px) = (&places.x_px[..n], &places.y_px[..n]);
        let (inside, corner) = (&mut places.inside[..n], &mut places.corner[..n]);
        let (right, down) = (&mut places.right[..n], &mut places.down[..n]);
        let (columns, last_column, last_row) = (cells[0] as i32, (cells[0] - 1) as f32, (cells[1] - 1) as f32);
        for i in 0..n {
            let (x, y) = ((x_px[i] + 0.5) * cells_per_px - 0.5, (y_px[i] + 0.5) * cells_per_px - 0.5);
            let within = (x >= 0.0) & (y >= 0.0) & (x < last_column) & (y < last_row);
            let (x, y) = (if within { x } else { 0.0 }, if within { y } else { 0.0 });
            let (column, row) = (x as i32, y as i32);
            inside[i] = u8::from(within);
            corner[i] = (row * columns + column) as u32;
            right[i] = x - column as f32;
            down[i] = y - row as f32;
        }
    }
}

/// Position of each rectified cell in the camera image; empty where that is the rectified one.
fn taps(sensor: &Sensor, cell_px: usize, columns: usize, rows: usize, camera: usize, camera_rows: usize) -> Vec<Tap> {
    let middle = (cell_px as f64 - 1.0) / 2.0;
    let straight = sensor.rectification.is_none() && !sensor.flip.is_horizontal() && !sensor.flip.is_vertical();
    if straight || camera < 2 || camera_rows < 2 {
        return Vec::new();
    }
    (0..columns * rows)
        .map(|i| {
            let corner = Vec2::new((i % columns) as f64, (i / columns) as f64) * cell_px as f64;
            let there = sensor.camera_from_rectified(corner + Vec2::new(middle, middle));
            let cell = |px: f64, end: usize| ((px - middle) / cell_px as f64).clamp(0.0, (end - 1) as f64 - 1e-6);
            let (x, y) = (cell(there.x, camera), cell(there.y, camera_rows));
            Tap {
                cell: (y as usize * camera + x as usize) as u32,
                right: (x - x.floor()) as f32,
                down: (y - y.floor()) as f32,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four cells of an image of three columns: the shade between them is bilinear.
    #[test]
    fn a_shade_between_four_cells_is_mixed_by_the_way_to_each() {
        let mut shades = [Shade::default(); 9];
        for (at, levels) in [(4, 1.0), (5, 3.0), (7, 10.0), (8, 20.0)] {
            shades[at][0] = levels;
        }
        for (right, down, levels) in [
            (0.0, 0.0, 1.0),
            (1.0, 0.0, 3.0),
            (0.0, 1.0, 10.0),
            (1.0, 1.0, 20.0),
            (0.5, 0.0, 2.0),
            (0.0, 0.5, 5.5),
            (0.5, 0.5, 8.5),
            (0.25, 0.5, 7.0),
        ] {
            assert_eq!(mix(&shades, 3, 4, right, down)[0], levels, "{right} {down}");
        }
    }

    /// Positions of the cells of an image of 320 x 240 px, of 4 px each, in the camera image, in cells.
    fn tapped(sensor: &Sensor) -> Vec<Vec2> {
        let place = |tap: &Tap| {
            let corner = Vec2::new(f64::from(tap.cell % 80), f64::from(tap.cell / 80));
            corner + Vec2::new(f64::from(tap.right), f64::from(tap.down))
        };
        taps(sensor, 4, 80, 60, 80, 60).iter().map(place).collect()
    }

    #[test]
    fn cells_are_looked_up_where_the_camera_has_them() {
        use crate::plane::Homography;
        use crate::sensor::{Flip, Rectification, tests::smooth};
        assert!(tapped(&smooth()).is_empty(), "the same picture");
        // Flipped about one axis or both; shifted by half a cell along x and one and a half along y, but not out of the
        // image.
        let shift = Homography([[1.0, 0.0, -2.0], [0.0, 1.0, -6.0], [0.0, 0.0, 1.0]]);
        let shifted = Some(Rectification { homography: shift, crop_px: [0, 0, 320, 240], distortion: None });
        type Place = fn(Vec2) -> Vec2;
        let sensors: [(Sensor, Place); 4] = [
            (Sensor { flip: Flip::Horizontal, ..smooth() }, |p| Vec2::new(79.0 - p.x, p.y)),
            (Sensor { flip: Flip::Vertical, ..smooth() }, |p| Vec2::new(p.x, 59.0 - p.y)),
            (Sensor { flip: Flip::Both, ..smooth() }, |p| Vec2::new(79.0 - p.x, 59.0 - p.y)),
            (Sensor { rectification: shifted, ..smooth() }, |p| {
                Vec2::new((p.x + 0.5).min(79.0), (p.y + 1.5).min(59.0))
            }),
        ];
        for (sensor, place) in sensors {
            let tapped = tapped(&sensor);
            assert_eq!(tapped.len(), 80 * 60);
            for (i, found) in tapped.iter().enumerate() {
                let wanted = place(Vec2::new((i % 80) as f64, (i / 80) as f64));
                assert!((*found - wanted).length() < 1e-4, "cell {i}: {found:?}, not {wanted:?} {:?}", sensor.flip);
            }
        }
    }

    #[test]
    fn a_place_lies_between_the_centres_of_four_cells_or_outside() {
        // Five columns and three rows of 4 px: centres at 1.5, 5.5, 9.5 px and so on.
        let cases = [
            (1.5, 1.5, Some((0, 0.0, 0.0))),
            (5.5, 1.5, Some((1, 0.0, 0.0))),
            (3.5, 1.5, Some((0, 0.5, 0.0))),
            (3.5, 8.5, Some((5, 0.5, 0.75))),
            (16.5, 4.5, Some((3, 0.75, 0.75))),
            (1.4, 1.5, None),
            (1.5, 1.4, None),
            (17.5, 1.5, None),
            (1.5, 9.5, None),
        ];
        let mut places = Places::new(cases.len());
        for (i, (x, y, _)) in cases.iter().enumerate() {
            (places.x_px[i], places.y_px[i]) = (*x, *y);
        }
        locate(&mut places, 0.25, [5, 3]);
        for (i, (x, y, between)) in cases.iter().enumerate() {
            let found = (places.inside[i] == 1).then_some((places.corner[i], places.right[i], places.down[i]));
            assert_eq!(found, *between, "{x} {y}");
        }
    }
}
