//! Step 0: camera frame -> imprint: grey, rectified, and (where a later step needs it) with flat illumination.
//!
//! ```text
//!   camera frame --weights, flip--> grey, upright --warp--> grey, rectified --minus background--> flat
//!        \--block means--> cells: coarse colour, for the contact region of smooth gels
//! ```
//! Pixels are rectified, not only marker positions: contact region, markers and images share one geometry.

use crate::image::{Frame, Mask, Pixels, SizePx};
use crate::monitor::cell_map::CellMap;
use crate::monitor::report::Reason;
use crate::pixels::background::Background;
use crate::pixels::cells::Cells;
use crate::pixels::checksum::checksum;
use crate::pixels::flatten::Flatten;
use crate::pixels::gaussian::Gaussian;
use crate::pixels::grey::{GreyWeights, grey_rows_from_gray, grey_rows_from_rgb};
use crate::pixels::mean::mean_levels;
use crate::pixels::mirror;
use crate::pixels::warp::WarpTable;
use crate::plane::Vec2;
use crate::sensor::{Flip, Sensor, Skin};
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// What is subtracted as illumination.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Illumination {
    /// A wide smoothing of a decimated image: the same within a few grey levels, in a tenth of the time.
    Decimated,
    /// The released code's Gaussian: 31 x 31 px with sigma 31 px at a pitch of 15.2 px.
    Gaussian,
}

/// Settings of step 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ImprintSettings {
    /// A frame whose mean grey level is below this is not judged.
    pub dark_below_levels: f64,
    /// What is subtracted as illumination before edge detection.
    pub illumination: Illumination,
}

impl Default for ImprintSettings {
    fn default() -> Self {
        ImprintSettings { dark_below_levels: 12.0, illumination: Illumination::Decimated }
    }
}

impl ImprintSettings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        within("imprint.dark_below_levels", self.dark_below_levels, 0.0, 128.0)
    }
}

/// Flat = (grey - background + 50) * 2 + 20, clipped: as in the released code.
const FLATTEN: (f64, f64, f64) = (50.0, 2.0, 20.0);

#[derive(Debug, Clone)]
enum Smooth {
    /// Its background is computed in the buffer of the flat image.
    Decimated(Background),
    Gaussian(Gaussian, Vec<f32>),
}

/// Images to make besides the grey one, whatever the skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Extra {
    /// [`Imprint::flat`]; a fabric skin always has it.
    pub(super) flat: bool,
    /// [`Imprint::cells`]; a smooth skin always has them.
    pub(super) cells: bool,
}

/// Step 0, with its images and scratch buffers.
#[derive(Debug, Clone)]
pub(super) struct Imprint {
    camera_px: SizePx,
    size: SizePx,
    flip: Flip,
    weights: GreyWeights,
    dark_below_levels: f64,
    warp: Option<(WarpTable, Vec<u8>)>,
    /// Pixels where the camera sees undamaged skin; None if it is all of them.
    seen: Option<Mask>,
    /// Top left and bottom right of a rectangle that the camera sees entirely.
    inner_rectangle: (Vec2, Vec2),
    smooth: Option<(Smooth, Flatten)>,
    has_cells: bool,
    pub(super) grey: Vec<u8>,
    pub(super) flat: Vec<u8>,
    pub(super) cells: Cells,
    /// Mean grey level of the last frame.
    pub(super) mean_levels: f64,
    /// Checksum of the last grey image, and whether the previous image had the same.
    sum: Option<u64>,
    repeats: bool,
}

/// Width of the released code's Gaussian at a pitch, an odd number of pixels, and its sigma, px.
fn gaussian(pitch_px: f64) -> (usize, f64) {
    let width_px = 31.0 / 15.2 * pitch_px;
    (((width_px - 1.0) / 2.0).round() as usize * 2 + 1, width_px)
}

impl Imprint {
    /// For frames of [`Sensor::image_px`]; all memory is allocated here.
    pub(super) fn new(sensor: &Sensor, settings: &ImprintSettings, extra: Extra) -> Self {
        let (camera_px, size) = (sensor.image_px, sensor.rectified_px());
        let has_flat = extra.flat || sensor.skin == Skin::Fabric;
        let smooth = || match settings.illumination {
            Illumination::Decimated => {
                // Deviation: D1 fast background
                // A Gaussian cut at 31 px with sigma 31 px is almost a box: its effective sigma is 0.58 pitch.
                Smooth::Decimated(Background::new(size, 0.58 * sensor.pitch_px))
            }
            Illumination::Gaussian => {
                let (side, sigma_px) = gaussian(sensor.pitch_px);
                let gaussian = Gaussian::new(size, [side, side], sigma_px);
                Smooth::Gaussian(gaussian, vec![0.0; size.area()])
            }
        };
        let warp = sensor.rectification.as_ref().map(|r| {
            let (to_upright, crop) = (r.to_upright(), Vec2::new(r.crop_px[0] as f64, r.crop_px[1] as f64));
            let table = WarpTable::held_at_border(size, camera_px, |p| to_upright(p + crop));
            (table, vec![0; camera_px.area()])
        });
        Imprint {
            camera_px,
            size,
            flip: sensor.flip,
            weights: GreyWeights::new(sensor.grey_weights_rgb),
            dark_below_levels: settings.dark_below_levels,
            seen: seen(sensor, warp.as_ref().map(|(table, _)| table)),
            inner_rectangle: warp
                .as_ref()
                .map_or((Vec2::ZERO, Vec2::ZERO), |(table, _)| inner_rectangle(table.valid())),
            warp,
            smooth: has_flat.then(|| (smooth(), Flatten::new(FLATTEN.0, FLATTEN.1, FLATTEN.2))),
            mean_levels: 0.0,
            sum: None,
            repeats: false,
            grey: vec![0; size.area()],
            flat: vec![0; if has_flat { size.area() } else { 0 }],
            has_cells: extra.cells || sensor.skin == Skin::Smooth,
            cells: Cells::new(camera_px, CellMap::cell_px(sensor)),
        }
    }

    /// Processes a frame, or returns the reason why it cannot be judged. `flat`: whether to update [`Imprint::flat`],
    /// if there is one.
    pub(super) fn take(&mut self, frame: &Frame<'_>, flat: bool) -> Result<(), Reason> {
        let got = frame.pixels.size();
        if got != self.camera_px {
            return Err(Reason::FrameSize { expected: self.camera_px, got });
        }
        let upright = self.warp.as_mut().map_or(&mut self.grey, |(_, upright)| upright);
        let cell_px = self.cells.cell_px();
        let mut from = 0;
        // Each strip of camera rows is read once for all images made of it.
        for cell_row in 0..=self.cells.rows() {
            let end = if cell_row < self.cells.rows() { from + cell_px } else { got.height };
            match &frame.pixels {
                Pixels::Rgb(rgb) => grey_rows_from_rgb(*rgb, &self.weights, self.flip, from..end, upright),
                Pixels::Gray(gray) => grey_rows_from_gray(*gray, self.flip, from..end, upright),
            }
            if self.has_cells && cell_row < self.cells.rows() {
                self.cells.run_rows(&frame.pixels, cell_row..cell_row + 1);
            }
            from = end;
        }
        self.mean_levels = mean_levels(upright, got.width);
        if self.mean_levels < self.dark_below_levels {
            return Err(Reason::Dark { mean_levels: self.mean_levels });
        }
        if let Some((table, upright)) = &self.warp {
            table.apply(upright, &mut self.grey);
        }
        if flat {
            self.flatten();
        }
        let sum = checksum(&self.grey);
        self.repeats = self.sum.replace(sum) == Some(sum);
        Ok(())
    }

    /// Whether the last image equals the previous one bit for bit: noise never repeats itself, a hung camera does.
    pub(super) fn repeats(&self) -> bool {
        self.repeats
    }

    /// Remakes the grey image from the last camera image as if it had another flip. Does nothing without a
    /// rectification: the image would only be mirrored.
    pub(super) fn mirror(&mut self, from: Flip, to: Flip) {
        let Some((table, upright)) = &mut self.warp else { return };
        if from.is_horizontal() != to.is_horizontal() {
            mirror::columns(upright, self.camera_px.width);
        }
        if from.is_vertical() != to.is_vertical() {
            mirror::rows(upright, self.camera_px.width);
        }
        table.apply(upright, &mut self.grey);
        self.flatten();
    }

    /// Replaces the grey image, for example by an average of several.
    pub(super) fn put_grey(&mut self, grey: impl Iterator<Item = u8>) {
        self.grey.iter_mut().zip(grey).for_each(|(out, v)| *out = v);
        self.flatten();
    }

    fn flatten(&mut self) {
        match &mut self.smooth {
            None => {}
            Some((Smooth::Decimated(background), flatten)) => {
                background.apply(&self.grey, &mut self.flat);
                flatten.over_u8(&self.grey, &mut self.flat);
            }
            Some((Smooth::Gaussian(gaussian, out), flatten)) => {
                gaussian.to_f32(&self.grey, out);
                flatten.from_f32(&self.grey, out, &mut self.flat);
            }
        }
    }

    /// Size of the rectified image.
    pub(super) fn size(&self) -> SizePx {
        self.size
    }

    /// Which rectified pixels the camera sees; None when it sees all of them.
    pub(super) fn view(&self) -> Option<&Mask> {
        self.warp.as_ref().map(|(table, _)| table.valid())
    }

    /// Whether `p` with a margin of `px` is in a rectangle that the camera sees entirely: a fast test, enough for most
    /// positions.
    pub(super) fn is_in_inner_rectangle(&self, p: Vec2, px: f64) -> bool {
        let (low, high) = self.inner_rectangle;
        p.x - px >= low.x && p.x + px <= high.x && p.y - px >= low.y && p.y + px <= high.y
    }

    /// Which rectified pixels show undamaged skin; None when all of them do.
    pub(super) fn seen(&self) -> Option<&Mask> {
        self.seen.as_ref()
    }
}

/// A rectangle with all pixels set: the side with the most clear pixels is moved inwards until none is left.
fn inner_rectangle(mask: &Mask) -> (Vec2, Vec2) {
    let (mut left, mut top) = (0, 0);
    let (mut right, mut bottom) = (mask.size().width as isize - 1, mask.size().height as isize - 1);
    let open = |xs: std::ops::RangeInclusive<isize>, ys: std::ops::RangeInclusive<isize>| {
        xs.flat_map(|x| ys.clone().map(move |y| (x, y))).filter(|&(x, y)| !mask.get(x, y)).count() as isize
    };
    while left <= right && top <= bottom {
        let sides = [
            open(left..=left, top..=bottom),
            open(right..=right, top..=bottom),
            open(left..=right, top..=top),
            open(left..=right, bottom..=bottom),
        ];
        match (0..4).max_by_key(|&side| sides[side]).filter(|&side| sides[side] > 0) {
            None => break,
            Some(0) => left += 1,
            Some(1) => right -= 1,
            Some(2) => top += 1,
            Some(_) => bottom -= 1,
        }
    }
    (Vec2::new(left as f64, top as f64), Vec2::new(right as f64, bottom as f64))
}

/// The pixels seen by a rectification, without the defects of the skin.
fn seen(sensor: &Sensor, table: Option<&WarpTable>) -> Option<Mask> {
    if table.is_none() && sensor.defects_px.is_empty() {
        return None;
    }
    let size = sensor.rectified_px();
    let mut seen = table.map_or_else(|| Mask::full(size), |table| table.valid().clone());
    for &[left, top, right, bottom] in &sensor.defects_px {
        // At another resolution a defect may end a pixel beyond the image.
        seen.clear_rectangle(left..right.min(size.width), top..bottom.min(size.height));
    }
    Some(seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Rgb;
    use crate::pixels::grey::grey_from_rgb;
    use crate::sensor::tests::smooth;

    #[test]
    fn the_gaussian_of_the_released_code_is_31_px_wide_at_its_pitch() {
        assert_eq!([15.2, 30.8, 7.6].map(|pitch_px| gaussian(pitch_px).0), [31, 63, 15]);
        assert!((gaussian(15.2).1 - 31.0).abs() < 1e-9);
    }

    #[test]
    fn rows_below_the_last_cells_are_in_the_grey_picture_too() {
        let size = SizePx::new(320, 243);
        let sensor = Sensor { image_px: size, ..smooth() };
        let bytes: Vec<u8> =
            (0..3 * size.area() as u32).map(|i| 60 + (i.wrapping_mul(2_654_435_761) >> 25) as u8).collect();
        let rgb = Rgb::new(&bytes, size).expect("whole");
        let mut imprint = Imprint::new(&sensor, &ImprintSettings::default(), Extra::default());
        imprint.take(&Frame { pixels: Pixels::Rgb(rgb), seq: 0, time_ns: None }, true).expect("bright");
        let mut grey = vec![0; size.area()];
        grey_from_rgb(rgb, &GreyWeights::new(sensor.grey_weights_rgb), sensor.flip, &mut grey);
        assert_eq!(imprint.grey, grey);
    }
}
