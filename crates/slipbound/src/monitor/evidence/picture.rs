//! What carries the imprint of an object, on coarse cells of the rectified image.
//!
//! ```text
//!   smooth gel:  ln R/G and ln B/G of a cell: the slope of the surface, free of brightness
//!   fabric:      ln of the contrast of the weave in a cell: the weave shows where something presses it
//! ```

use crate::image::Gray;
use crate::monitor::cell_map::CellMap;
use crate::monitor::imprint::Imprint;
use crate::pixels::contrast::cell_contrast;
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};

/// Two numbers of a cell; the second is zero on a fabric skin.
pub(super) type Shade = [f32; 2];

/// Added to levels before a logarithm is taken, so that the noise of dark cells stays small.
const DARK_LEVELS: f32 = 4.0;

/// Steps of the table of logarithms to a level.
const STEPS_PER_LEVEL: f32 = 8.0;

/// Where a rectified cell lies between the cells of the camera.
#[derive(Debug, Clone, Copy)]
struct Tap {
    cell: u32,
    right: f32,
    down: f32,
}

#[derive(Debug, Clone)]
enum Carrier {
    /// Colours of camera cells; one tap a rectified cell, none where both are the same.
    Colour { taps: Vec<Tap>, camera: Vec<Shade>, camera_columns: usize, ln: Vec<f32> },
    /// Contrast of the weave.
    Weave { sums: Vec<u16>, contrast: Vec<f32>, ln: Vec<f32> },
}

/// The picture; owns its scratch.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    pub(super) cell_px: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    cells_per_px: f32,
    carrier: Carrier,
    pub(super) shades: Vec<Shade>,
}

impl Picture {
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
        Picture {
            cell_px,
            columns,
            rows,
            cells_per_px: 1.0 / cell_px as f32,
            carrier,
            shades: vec![[0.0; 2]; columns * rows],
        }
    }

    /// Takes the shades of the frame taken last.
    pub(super) fn take(&mut self, imprint: &Imprint) {
        match &mut self.carrier {
            Carrier::Weave { sums, contrast, ln } => {
                let Ok(grey) = Gray::new(&imprint.grey, imprint.size()) else { return };
                cell_contrast(grey, self.cell_px, sums, contrast);
                for (shade, &levels) in self.shades.iter_mut().zip(contrast.iter()) {
                    shade[0] = logarithm(ln, levels);
                }
            }
            Carrier::Colour { taps, camera, camera_columns, ln } => {
                let to = if taps.is_empty() { &mut self.shades } else { &mut *camera };
                for (shade, colour) in to.iter_mut().zip(imprint.cells.means_levels()) {
                    let [red, green, blue] = colour.map(|levels| logarithm(ln, levels));
                    *shade = [red - green, blue - green];
                }
                for (shade, tap) in self.shades.iter_mut().zip(taps.iter()) {
                    *shade = mix(camera, *camera_columns, tap.cell as usize, tap.right, tap.down);
                }
            }
        }
    }

    /// The shade at a place of the rectified image, between four cells; None beyond the outermost.
    pub(super) fn at(&self, [x_px, y_px]: [f32; 2]) -> Option<Shade> {
        let cell = |px: f32| (px + 0.5) * self.cells_per_px - 0.5;
        let (x, y) = (cell(x_px), cell(y_px));
        if !(x >= 0.0 && y >= 0.0 && x < (self.columns - 1) as f32 && y < (self.rows - 1) as f32) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let at = row * self.columns + column;
        Some(mix(&self.shades, self.columns, at, x - column as f32, y - row as f32))
    }

    /// Centre of a cell in px.
    pub(super) fn centre_px(&self, cell: usize) -> Vec2 {
        let middle = (self.cell_px as f64 - 1.0) / 2.0;
        let corner = Vec2::new((cell % self.columns) as f64, (cell / self.columns) as f64) * self.cell_px as f64;
        corner + Vec2::new(middle, middle)
    }
}

fn logarithm(ln: &[f32], levels: f32) -> f32 {
    let at = (levels * STEPS_PER_LEVEL + 0.5) as usize;
    ln[at.min(ln.len() - 1)]
}

fn mix(shades: &[Shade], columns: usize, at: usize, right: f32, down: f32) -> Shade {
    let (above, below) = (&shades[at..at + 2], &shades[at + columns..at + columns + 2]);
    std::array::from_fn(|k| {
        let upper = above[0][k] + right * (above[1][k] - above[0][k]);
        let lower = below[0][k] + right * (below[1][k] - below[0][k]);
        upper + down * (lower - upper)
    })
}

/// Where each rectified cell lies in the camera's picture; empty where that is the rectified one.
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
