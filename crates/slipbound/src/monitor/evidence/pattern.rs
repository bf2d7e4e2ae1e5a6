//! The imprint in gel coordinates: constant while the object sticks, however the gel is sheared.
//!
//! ```text
//!   image ----undo the gel's motion--> gel coordinates --markers masked, minus a blur--> pattern
//!                                                                 correlated with the reference: imprint change
//! ```

use super::gel::{GelGrid, GelMotion};
use super::image_cells::{ImageCells, Places};
use super::planes::Planes;
use crate::image::Mask;
use crate::monitor::imprint::Imprint;
use crate::pixels::blur::Blur;
use crate::pixels::wide::wide;
use crate::plane::{Vec2, nearest_px};
use crate::sensor::{Sensor, Skin};

/// Spread of the blur that is subtracted, in pitches. Shading of the whole contact and of the light is coarser, the
/// edges and creases of an object are finer.
const BLUR_PITCH: f64 = 0.4;

/// Spread of the blur on a fabric skin, in pitches. There the pattern is the blurred contrast: the weave moves with the
/// gel, the patch in which it is pressed moves with the object.
const BLUR_PITCH_FABRIC: f64 = 0.5;

/// Least weight of the cells under that blur: a patch is not extrapolated beyond what is visible.
const LEAST_WEIGHT_FRACTION: f32 = 0.3;

/// Markers hide the pattern within this many of their diameters from their centre: their own rim, and half a cell.
const MASK_DIAMETERS: f64 = 1.0;

/// Contrast of the weave at rest, averaged over frames without contact.
#[derive(Debug, Clone)]
struct Weave {
    contrast: Vec<f32>,
    frames_count: u32,
}

/// Number of frames averaged: more would not improve the weave at rest.
const WEAVE_FRAMES_COUNT: u32 = 30;

/// The pattern of the last frame; owns its scratch.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    image_cells: ImageCells,
    /// 1 where no marker covers a cell of the gel, else 0.
    free: Vec<u8>,
    /// Rest positions of the cells, px, by column and by row; motion of the gel there; and positions of a row of them
    /// in the image.
    columns_px: Vec<f32>,
    rows_px: Vec<f32>,
    gel: GelGrid,
    places: Places,
    /// View of the camera: cells outside it are not seen.
    view: Option<Mask>,
    blur: Blur,
    /// Fabric: contrast of the weave at rest in each gel cell; zero without a frame of it unloaded.
    weave: Option<Weave>,
    blurred: Planes,
    /// Band-passed, in gel coordinates.
    pub(super) now: Planes,
}

impl Pattern {
    /// `rest_px`: the markers at rest. `gel`: the motion of the gel between them.
    pub(super) fn new(sensor: &Sensor, rest_px: &[Vec2], view: Option<&Mask>, gel: &GelMotion) -> Self {
        let image_cells = ImageCells::new(sensor);
        let count = image_cells.shades.len();
        let mask_px = MASK_DIAMETERS * sensor.marker_diameter_px;
        let columns_px: Vec<f64> = (0..image_cells.columns).map(|x| image_cells.centre_px(x).x).collect();
        let rows_px: Vec<f64> =
            (0..image_cells.rows).map(|y| image_cells.centre_px(y * image_cells.columns).y).collect();
        let mut free = vec![1; count];
        for &marker in rest_px {
            // A cell outside this square is not covered.
            let half_px = mask_px + 1.0;
            let near = |px: &[f64], at: f64| {
                let first = px.partition_point(|&px| px < at - half_px);
                first..px.partition_point(|&px| px <= at + half_px)
            };
            for y in near(&rows_px, marker.y) {
                for x in near(&columns_px, marker.x) {
                    let cell = y * image_cells.columns + x;
                    free[cell] &= u8::from((marker - image_cells.centre_px(cell)).length() > mask_px);
                }
            }
        }
        let planes = Planes::new(if sensor.skin == Skin::Fabric { 1 } else { 2 }, count);
        let blur_pitch = if sensor.skin == Skin::Fabric { BLUR_PITCH_FABRIC } else { BLUR_PITCH };
        let spread_cells = (blur_pitch * sensor.pitch_px / image_cells.cell_px as f64).max(1.0);
        let reach = (2.5 * spread_cells).ceil() as usize;
        let kernel: Vec<f32> =
            (0..=reach).map(|d| libm::exp(-0.5 * (d as f64 / spread_cells).powi(2)) as f32).collect();
        Pattern {
            free,
            gel: GelGrid::new(gel, &columns_px, &rows_px),
            columns_px: columns_px.iter().map(|&px| px as f32).collect(),
            rows_px: rows_px.iter().map(|&px| px as f32).collect(),
            places: Places::new(image_cells.columns),
            view: view.cloned(),
            blur: Blur::new(kernel, image_cells.columns, count),
            weave: (sensor.skin == Skin::Fabric).then(|| Weave { contrast: vec![0.0; count], frames_count: 0 }),
            blurred: planes.clone(),
            now: planes,
            image_cells,
        }
    }

    /// Cells in a row.
    pub(super) fn columns(&self) -> usize {
        self.image_cells.columns
    }

    /// Side of a cell in px.
    pub(super) fn cell_px(&self) -> usize {
        self.image_cells.cell_px
    }

    /// Adds the weave of a frame without contact to the one at rest. Does nothing on a smooth gel.
    pub(super) fn learn_rest(&mut self, imprint: &Imprint) {
        let Some(weave) = &mut self.weave else { return };
        if weave.frames_count >= WEAVE_FRAMES_COUNT {
            return;
        }
        self.image_cells.take(imprint);
        weave.frames_count += 1;
        let share = 1.0 / weave.frames_count as f32;
        for (rest, shade) in weave.contrast.iter_mut().zip(&self.image_cells.shades) {
            *rest += share * (shade[0] - *rest);
        }
    }

    /// Computes the pattern of the last frame.
    pub(super) fn take(&mut self, imprint: &Imprint, gel: &GelMotion) {
        self.image_cells.take(imprint);
        self.gel.take(gel);
        self.look_up();
        if let Some(weave) = &self.weave {
            let rest = weave.contrast.iter().zip(&self.now.seen);
            self.now.shades[0].iter_mut().zip(rest).for_each(|(out, (rest, seen))| *out -= rest * seen);
        }
        for (from, to) in self.now.all_mut().zip(self.blurred.all_mut()) {
            self.blur.run(from, to);
        }
        let weights = &self.blurred.seen;
        if self.weave.is_some() {
            let least = LEAST_WEIGHT_FRACTION * self.blur.weight();
            let cells = self.now.shades[0].iter_mut().zip(&mut self.now.seen);
            for ((out, seen), (blurred, &weight)) in cells.zip(self.blurred.shades[0].iter().zip(weights)) {
                (*out, *seen) = if weight > least { (blurred / weight, 1.0) } else { (0.0, 0.0) };
            }
            return;
        }
        for (plane, blurred) in self.now.shades.iter_mut().zip(&self.blurred.shades) {
            take_off(blurred, weights, &self.now.seen, plane);
        }
    }

    /// Reads the shades of the gel cells at their current positions in the image.
    fn look_up(&mut self) {
        let n = self.image_cells.columns;
        for (y, free) in self.free.chunks_exact(n).enumerate() {
            let places = &mut self.places;
            self.gel.places_of_row(y, &self.columns_px, self.rows_px[y], &mut places.x_px, &mut places.y_px);
            self.image_cells.locate(places);
            for (x, free) in free.iter().enumerate() {
                let cell = y * n + x;
                let seen =
                    free & places.inside[x] != 0 && in_view(self.view.as_ref(), [places.x_px[x], places.y_px[x]]);
                let shade = if seen { self.image_cells.at(places, x) } else { [0.0; 2] };
                self.now.shades.iter_mut().zip(shade).for_each(|(plane, shade)| plane[cell] = shade);
                self.now.seen[cell] = if seen { 1.0 } else { 0.0 };
            }
        }
    }
}

wide! {
    /// Subtracts the blurred shades where cells are seen.
    fn take_off(blurred: &[f32], weights: &[f32], seen: &[f32], plane: &mut [f32]) {
        for ((out, blurred), (seen, weight)) in plane.iter_mut().zip(blurred).zip(seen.iter().zip(weights)) {
            *out = (*out - blurred / weight.max(1e-6)) * seen;
        }
    }
}

fn in_view(view: Option<&Mask>, [x, y]: [f32; 2]) -> bool {
    view.is_none_or(|view| view.get(nearest_px(f64::from(x)), nearest_px(f64::from(y))))
}
