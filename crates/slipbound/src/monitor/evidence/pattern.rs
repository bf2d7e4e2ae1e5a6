//! The imprint in gel coordinates: what stays the same while the object sticks, however the gel is sheared.
//!
//! ```text
//!   picture --undo the gel's motion--> gel coordinates --markers masked, minus a blur--> pattern
//!                                                                 correlated with the reference: imprint change
//! ```

use super::gel::GelMotion;
use super::picture::Picture;
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

/// A shade, and 1 where it is seen, 0 where not.
pub(super) type Seen = [f32; 3];

/// Contrast of the weave at rest, averaged over the frames before anything touches.
#[derive(Debug, Clone)]
struct Weave {
    contrast: Vec<f32>,
    frames_count: u32,
}

/// Frames after which more of them no longer make the weave at rest any better known.
const WEAVE_FRAMES_COUNT: u32 = 30;

/// The pattern of the last frame; owns its scratch.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    picture: Picture,
    /// Gel cells that no marker covers.
    free: Vec<bool>,
    /// Camera's view: what is outside is not seen.
    view: Option<Mask>,
    kernel: Vec<f32>,
    kernel_weight: f32,
    /// Fabric: the weave at rest, its contrast in each gel cell; zero where nobody saw it unloaded.
    weave: Option<Weave>,
    rows_blurred: Vec<Seen>,
    blurred: Vec<Seen>,
    /// Band-passed, in gel coordinates.
    pub(super) now: Vec<Seen>,
}

impl Pattern {
    pub(super) fn new(sensor: &Sensor, rest_px: &[Vec2], view: Option<&Mask>) -> Self {
        let picture = Picture::new(sensor);
        let count = picture.shades.len();
        let mask_px = MASK_DIAMETERS * sensor.marker_diameter_px;
        let free = (0..count)
            .map(|cell| {
                let centre = picture.centre_px(cell);
                rest_px.iter().all(|&marker| (marker - centre).length() > mask_px)
            })
            .collect();
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
            rows_blurred: vec![[0.0; 3]; count],
            blurred: vec![[0.0; 3]; count],
            now: vec![[0.0; 3]; count],
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
        for (cell, out) in self.now.iter_mut().enumerate() {
            let at = self.picture.centre_px(cell);
            let there = at + gel.at(at);
            *out = match self.picture.at(there) {
                Some([a, b]) if self.free[cell] && in_view(self.view.as_ref(), there) => [a, b, 1.0],
                _ => [0.0; 3],
            };
        }
        if let Some(weave) = &self.weave {
            self.now.iter_mut().zip(&weave.contrast).for_each(|(out, rest)| out[0] -= rest * out[2]);
        }
        self.blur();
        if self.weave.is_some() {
            let least = LEAST_WEIGHT_FRACTION * self.kernel_weight;
            for (out, blurred) in self.now.iter_mut().zip(&self.blurred) {
                *out = if blurred[2] > least { [blurred[0] / blurred[2], 0.0, 1.0] } else { [0.0; 3] };
            }
            return;
        }
        for (out, blurred) in self.now.iter_mut().zip(&self.blurred) {
            if out[2] > 0.0 {
                let per_weight = 1.0 / blurred[2].max(1e-6);
                *out = [out[0] - blurred[0] * per_weight, out[1] - blurred[1] * per_weight, 1.0];
            }
        }
    }

    /// Gaussian of the seen shades and of their weight, rows first.
    fn blur(&mut self) {
        let (columns, reach) = (self.picture.columns, self.kernel.len() - 1);
        let add = |to: &mut [Seen], from: &[Seen], tap: f32| {
            to.as_flattened_mut().iter_mut().zip(from.as_flattened()).for_each(|(t, f)| *t += tap * f);
        };
        for (row, out) in self.now.chunks_exact(columns).zip(self.rows_blurred.chunks_exact_mut(columns)) {
            out.fill([0.0; 3]);
            add(out, row, self.kernel[0]);
            for away in 1..=reach.min(columns - 1) {
                add(&mut out[away..], &row[..columns - away], self.kernel[away]);
                add(&mut out[..columns - away], &row[away..], self.kernel[away]);
            }
        }
        let rows = self.picture.rows;
        for (y, out) in self.blurred.chunks_exact_mut(columns).enumerate() {
            out.fill([0.0; 3]);
            for near in y.saturating_sub(reach)..=(y + reach).min(rows - 1) {
                add(out, &self.rows_blurred[near * columns..][..columns], self.kernel[near.abs_diff(y)]);
            }
        }
    }

    /// 1 - correlation of the pattern with another one, over the cells that both see; None when one of them is flat.
    pub(super) fn change(&self, other: &[Seen]) -> Option<f64> {
        let (mut both, mut here, mut there) = (0.0f64, 0.0f64, 0.0f64);
        for (a, b) in self.now.iter().zip(other).filter(|(a, b)| a[2] * b[2] > 0.0) {
            both += f64::from(a[0] * b[0] + a[1] * b[1]);
            here += f64::from(a[0] * a[0] + a[1] * a[1]);
            there += f64::from(b[0] * b[0] + b[1] * b[1]);
        }
        let scale = (here * there).sqrt();
        (scale > 0.0).then(|| 1.0 - both / scale)
    }
}

fn in_view(view: Option<&Mask>, at: Vec2) -> bool {
    view.is_none_or(|view| view.get(at.x.round() as isize, at.y.round() as isize))
}
