//! The imprint in gel coordinates: what stays the same while the object sticks, however the gel is sheared.
//!
//! ```text
//!   picture --undo the gel's motion--> gel coordinates --markers masked, minus a blur--> pattern
//!                                                                 correlated with the reference: imprint change
//! ```

use super::gel::{GelMotion, GelPlace};
use super::picture::Picture;
use super::planes::Planes;
use crate::image::Mask;
use crate::monitor::imprint::Imprint;
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};

/// Spread of the blur that is taken off, in pitches. Shading of the whole contact and of the light is wider, the
/// edges and creases of an object are finer.
const BLUR_PITCH: f64 = 0.4;

/// Spread of the blur on a fabric skin, in pitches. There the pattern is what is left by the blur: the weave stays with
/// the gel, the patch in which it is pressed moves with the object.
const BLUR_PITCH_FABRIC: f64 = 0.5;

/// Least weight of the cells under that blur: a patch is not continued beyond what is seen.
const LEAST_WEIGHT_FRACTION: f32 = 0.3;

/// Markers hide the pattern within this many of their diameters of their centre: their own rim, and half a cell.
const MASK_DIAMETERS: f64 = 1.0;

/// Contrast of the weave at rest, averaged over the frames before anything touches.
#[derive(Debug, Clone)]
struct Weave {
    contrast: Vec<f32>,
    frames_count: u32,
}

/// Frames after which more of them no longer make the weave at rest any better known.
const WEAVE_FRAMES_COUNT: u32 = 30;

/// A gel cell that no marker covers.
#[derive(Debug, Clone, Copy)]
struct FreeCell {
    cell: u32,
    rest_px: [f32; 2],
    place: GelPlace,
}

/// The pattern of the last frame; owns its scratch.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    picture: Picture,
    /// Gel cells that no marker covers.
    free: Vec<FreeCell>,
    /// Camera's view: what is outside is not seen.
    view: Option<Mask>,
    kernel: Vec<f32>,
    kernel_weight: f32,
    /// Fabric: the weave at rest, its contrast in each gel cell; zero where nobody saw it unloaded.
    weave: Option<Weave>,
    /// One row with nothing on both sides of it, as far as the blur reaches.
    row: Vec<f32>,
    rows_blurred: Vec<f32>,
    blurred: Planes,
    /// Band-passed, in gel coordinates.
    pub(super) now: Planes,
}

impl Pattern {
    /// `rest_px`: the markers at rest. `gel`: how the gel between them will move.
    pub(super) fn new(sensor: &Sensor, rest_px: &[Vec2], view: Option<&Mask>, gel: &GelMotion) -> Self {
        let picture = Picture::new(sensor);
        let count = picture.shades.len();
        let mask_px = MASK_DIAMETERS * sensor.marker_diameter_px;
        let free = (0..count)
            .map(|cell| (cell, picture.centre_px(cell)))
            .filter(|&(_, centre)| rest_px.iter().all(|&marker| (marker - centre).length() > mask_px))
            .map(|(cell, centre)| FreeCell {
                cell: cell as u32,
                rest_px: [centre.x as f32, centre.y as f32],
                place: gel.place(centre),
            })
            .collect();
        let planes = Planes::new(if sensor.skin == Skin::Fabric { 1 } else { 2 }, count);
        let blur_pitch = if sensor.skin == Skin::Fabric { BLUR_PITCH_FABRIC } else { BLUR_PITCH };
        let spread_cells = (blur_pitch * sensor.pitch_px / picture.cell_px as f64).max(1.0);
        let reach = (2.5 * spread_cells).ceil() as usize;
        let kernel: Vec<f32> =
            (0..=reach).map(|d| libm::exp(-0.5 * (d as f64 / spread_cells).powi(2)) as f32).collect();
        let along = 2.0 * kernel.iter().sum::<f32>() - kernel[0];
        Pattern {
            free,
            view: view.cloned(),
            kernel,
            kernel_weight: along * along,
            weave: (sensor.skin == Skin::Fabric).then(|| Weave { contrast: vec![0.0; count], frames_count: 0 }),
            row: vec![0.0; picture.columns + 2 * reach],
            rows_blurred: vec![0.0; count],
            blurred: planes.clone(),
            now: planes,
            picture,
        }
    }

    /// Cells in a row.
    pub(super) fn columns(&self) -> usize {
        self.picture.columns
    }

    /// Side of a cell in px.
    pub(super) fn cell_px(&self) -> usize {
        self.picture.cell_px
    }

    /// Takes the weave of a frame in which nothing touches, for the one at rest. Nothing on a smooth gel.
    pub(super) fn learn_rest(&mut self, imprint: &Imprint) {
        let Some(weave) = &mut self.weave else { return };
        if weave.frames_count >= WEAVE_FRAMES_COUNT {
            return;
        }
        self.picture.take(imprint);
        weave.frames_count += 1;
        let share = 1.0 / weave.frames_count as f32;
        for (rest, shade) in weave.contrast.iter_mut().zip(&self.picture.shades) {
            *rest += share * (shade[0] - *rest);
        }
    }

    /// Takes the pattern of the frame taken last.
    pub(super) fn take(&mut self, imprint: &Imprint, gel: &GelMotion) {
        self.picture.take(imprint);
        self.now.all_mut().for_each(|plane| plane.fill(0.0));
        for free in &self.free {
            let moved = gel.at(free.place);
            let there: [f32; 2] = std::array::from_fn(|k| free.rest_px[k] + moved[k]);
            let Some(shade) = self.picture.at(there).filter(|_| in_view(self.view.as_ref(), there)) else { continue };
            let cell = free.cell as usize;
            self.now.shades.iter_mut().zip(shade).for_each(|(plane, shade)| plane[cell] = shade);
            self.now.seen[cell] = 1.0;
        }
        if let Some(weave) = &self.weave {
            let rest = weave.contrast.iter().zip(&self.now.seen);
            self.now.shades[0].iter_mut().zip(rest).for_each(|(out, (rest, seen))| *out -= rest * seen);
        }
        for (from, to) in self.now.all_mut().zip(self.blurred.all_mut()) {
            blur(from, self.picture.columns, &self.kernel, &mut self.row, &mut self.rows_blurred, to);
        }
        let weights = &self.blurred.seen;
        if self.weave.is_some() {
            let least = LEAST_WEIGHT_FRACTION * self.kernel_weight;
            let cells = self.now.shades[0].iter_mut().zip(&mut self.now.seen);
            for ((out, seen), (blurred, &weight)) in cells.zip(self.blurred.shades[0].iter().zip(weights)) {
                (*out, *seen) = if weight > least { (blurred / weight, 1.0) } else { (0.0, 0.0) };
            }
            return;
        }
        for (plane, blurred) in self.now.shades.iter_mut().zip(&self.blurred.shades) {
            let seen = self.now.seen.iter().zip(weights);
            for ((out, blurred), (seen, weight)) in plane.iter_mut().zip(blurred).zip(seen) {
                *out = (*out - blurred / weight.max(1e-6)) * seen;
            }
        }
    }
}

/// Symmetric blur of one plane, rows first; `kernel`: its weights from the middle outwards; nothing lies beyond the border.
/// `row`: scratch of a row and twice the kernel's reach; `between`: scratch as large as the plane.
fn blur(from: &[f32], columns: usize, kernel: &[f32], row: &mut [f32], between: &mut [f32], to: &mut [f32]) {
    let reach = kernel.len() - 1;
    let outward = || kernel.iter().enumerate().skip(1);
    for (from, out) in from.chunks_exact(columns).zip(between.chunks_exact_mut(columns)) {
        row[reach..reach + columns].copy_from_slice(from);
        out.iter_mut().zip(from).for_each(|(out, from)| *out = kernel[0] * from);
        for (away, &weight) in outward() {
            let sides = row[reach - away..].iter().zip(&row[reach + away..]);
            out.iter_mut().zip(sides).for_each(|(out, (left, right))| *out += weight * (left + right));
        }
    }
    let line = |y: usize| &between[y * columns..(y + 1) * columns];
    let rows = between.len() / columns;
    for (y, out) in to.chunks_exact_mut(columns).enumerate() {
        out.iter_mut().zip(line(y)).for_each(|(out, from)| *out = kernel[0] * from);
        for (away, &weight) in outward() {
            let (above, below) = (y.checked_sub(away), Some(y + away).filter(|&y| y < rows));
            match (above, below) {
                (Some(above), Some(below)) => {
                    let sides = line(above).iter().zip(line(below));
                    out.iter_mut().zip(sides).for_each(|(out, (a, b))| *out += weight * (a + b));
                }
                (Some(y), None) | (None, Some(y)) => {
                    out.iter_mut().zip(line(y)).for_each(|(out, from)| *out += weight * from);
                }
                (None, None) => {}
            }
        }
    }
}

fn in_view(view: Option<&Mask>, [x, y]: [f32; 2]) -> bool {
    view.is_none_or(|view| view.get(x.round() as isize, y.round() as isize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blur_of_a_point_is_the_kernel_both_ways_and_ends_at_the_border() {
        let (columns, rows, kernel) = (9, 7, [4.0, 2.0, 1.0]);
        let (mut row, mut between, mut to) =
            (vec![0.0; columns + 4], vec![0.0; columns * rows], vec![0.0; columns * rows]);
        for (x, y) in [(4, 3), (0, 0), (8, 6), (1, 5)] {
            let mut from = vec![0.0; columns * rows];
            from[y * columns + x] = 1.0;
            blur(&from, columns, &kernel, &mut row, &mut between, &mut to);
            for (i, &seen) in to.iter().enumerate() {
                let weight = |a: usize, b: usize| kernel.get(a.abs_diff(b)).copied().unwrap_or(0.0);
                assert_eq!(seen, weight(i % columns, x) * weight(i / columns, y), "{i} of ({x}, {y})");
            }
        }
    }
}
