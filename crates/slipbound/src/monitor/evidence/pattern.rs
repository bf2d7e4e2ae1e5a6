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
use crate::pixels::blur::Blur;
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
    blur: Blur,
    /// Fabric: the weave at rest, its contrast in each gel cell; zero where nobody saw it unloaded.
    weave: Option<Weave>,
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
        Pattern {
            free,
            view: view.cloned(),
            blur: Blur::new(kernel, picture.columns, count),
            weave: (sensor.skin == Skin::Fabric).then(|| Weave { contrast: vec![0.0; count], frames_count: 0 }),
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
            let seen = self.now.seen.iter().zip(weights);
            for ((out, blurred), (seen, weight)) in plane.iter_mut().zip(blurred).zip(seen) {
                *out = (*out - blurred / weight.max(1e-6)) * seen;
            }
        }
    }
}

fn in_view(view: Option<&Mask>, [x, y]: [f32; 2]) -> bool {
    view.is_none_or(|view| view.get(x.round() as isize, y.round() as isize))
}
