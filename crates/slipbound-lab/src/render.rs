//! STAND-IN for the camera, with its interface: dark dots on a plain, evenly lit gel, seen straight on, without the
//! weave, shading and parallax by which contact shows. What it is good for is exact marker positions.

use crate::contact::{Displacement, Grid};
use crate::random::Random;
use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use slipbound::sensor::{Flip, Polarity, Sensor, Skin};

/// What a camera needs to know of the gel: displacement and pressure of every cell.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// The cells.
    pub grid: &'a Grid,
    /// Displacement of the gel's surface, cell by cell.
    pub displacement: &'a [Displacement],
    /// Pressure in MPa, 0 or above, cell by cell.
    pub pressure_mpa: &'a [f64],
}

const SIZE: SizePx = SizePx::new(640, 480);
const PX_PER_MM: f64 = 16.0;
const PITCH_MM: f64 = 1.5;
const DOT_RADIUS_PX: f64 = 4.0;

/// A plain camera.
#[derive(Debug, Clone)]
pub struct Renderer {
    seed: u64,
    markers_mm: Vec<Vec2>,
}

impl Renderer {
    /// 19 x 19 dots at 1.5 mm.
    pub fn gelslim(seed: u64) -> Self {
        let place = |n: usize| (n as f64 - 9.0) * PITCH_MM;
        Renderer { seed, markers_mm: (0..361).map(|n| Vec2::new(place(n % 19), place(n / 19))).collect() }
    }

    /// The same: the stand-in knows one finger.
    pub fn gelsight_mini(seed: u64) -> Self {
        Self::gelslim(seed)
    }

    /// Size of its frames.
    pub fn size(&self) -> SizePx {
        SIZE
    }

    /// Its facts.
    pub fn sensor(&self) -> Sensor {
        Sensor {
            name: "plain".into(),
            description: "Stand-in of the simulator: dots on a plain gel.".into(),
            serial: None,
            image_px: SIZE,
            flip: Flip::None,
            grey_weights_rgb: [0.3333, 0.3334, 0.3333],
            polarity: Polarity::Dark,
            pitch_px: PITCH_MM * PX_PER_MM,
            pitch_mm: Some(PITCH_MM),
            marker_diameter_px: 2.0 * DOT_RADIUS_PX,
            skin: Skin::Smooth,
            edge_bands: Vec::new(),
            rectification: None,
        }
    }

    /// Positions of the markers on the gel at rest, in mm.
    pub fn markers_at_rest_mm(&self) -> &[Vec2] {
        &self.markers_mm
    }

    /// Where a marker is in the picture, in px.
    pub fn marker_px(&self, marker: usize, surface: &Surface<'_>) -> Vec2 {
        let rest_mm = self.markers_mm[marker];
        let half = surface.grid.half_size_mm();
        let cell = |at_mm: f64, half_mm: f64, count: usize| {
            (((at_mm + half_mm) / surface.grid.cell_mm).max(0.0) as usize).min(count - 1)
        };
        let column = cell(rest_mm.x, half.x, surface.grid.width_cells);
        let row = cell(rest_mm.y, half.y, surface.grid.height_cells);
        let moved = surface.displacement[row * surface.grid.width_cells + column].shift_mm;
        (rest_mm + moved) * PX_PER_MM + Vec2::new(SIZE.width as f64, SIZE.height as f64) * 0.5
    }

    /// Draws a frame into rows of RGB pixels.
    pub fn render(&mut self, surface: &Surface<'_>, frame_seed: u64, rgb: &mut [u8]) {
        let mut random = Random::of(self.seed, frame_seed);
        for pixel in rgb.chunks_exact_mut(3) {
            pixel.fill(148 + (random.next_u64() % 5) as u8);
        }
        let reach = DOT_RADIUS_PX.ceil() as isize + 1;
        for marker in 0..self.markers_mm.len() {
            let middle = self.marker_px(marker, surface);
            let (column, row) = (middle.x.round() as isize, middle.y.round() as isize);
            for y in (row - reach).max(0)..(row + reach + 1).min(SIZE.height as isize) {
                for x in (column - reach).max(0)..(column + reach + 1).min(SIZE.width as isize) {
                    let distance = (Vec2::new(x as f64, y as f64) - middle).length();
                    let cover = (DOT_RADIUS_PX + 0.5 - distance).clamp(0.0, 1.0);
                    let at = 3 * (y as usize * SIZE.width + x as usize);
                    for level in &mut rgb[at..at + 3] {
                        *level = (f64::from(*level) * (1.0 - 0.6 * cover)) as u8;
                    }
                }
            }
        }
    }
}
