//! The result of a calibration.

use super::grid::{MARGIN_PITCH, largest_diameter_px};
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Largest change of a cell over half of the image, as a share of it, that is no oblique view: at 25 deg, where cells
/// look a tenth narrower, a camera with a view of 40 deg sees them change by 16 % over that.
const EVEN_FRACTION: f64 = 0.03;

/// One spot and the node of the grid nearest to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridMarker {
    /// Column and row of the grid.
    pub node: [i32; 2],
    /// Where it was found in the camera image as delivered, px.
    pub camera_px: Vec2,
    /// Distance from there to where the map puts the node, in pitches.
    pub residual_pitch: f64,
}

/// The result of a calibration.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The facts, checked; `bare_sharpness` is measured on the same frames, if they look untouched.
    pub sensor: Sensor,
    /// Every marker on the grid, column by column.
    pub markers: Vec<GridMarker>,
    /// Spots near a node that are off the grid: glare, dirt, a dot printed twice. They count neither for the map nor
    /// for the residual.
    pub off_grid: Vec<GridMarker>,
    /// RMS of the residuals of all markers, in pitches.
    pub residual_pitch: f64,
    /// The same with a homography alone.
    pub residual_without_distortion_pitch: f64,
    /// Indices of the averaged frames, first and last.
    pub averaged: [usize; 2],
    /// Whether the averaged frames look untouched.
    pub untouched: bool,
    /// The averaged image as delivered, bytes red, green, blue.
    pub mean_rgb: Vec<u8>,
}

impl Calibration {
    /// Where the first column and the first row of the grid meet in the rectified image, px.
    pub fn origin_px(&self) -> Vec2 {
        let margin_px = (MARGIN_PITCH * self.sensor.pitch_px).round();
        Vec2::new(margin_px, margin_px)
    }

    /// How far the rows of the grid are turned in the middle of the upright camera image, rad, positive from x to y. The
    /// rectified image, and with it x and y of every report, follows the rows.
    pub fn turn_rad(&self) -> f64 {
        let size = self.sensor.rectified_px();
        let middle = Vec2::new(size.width as f64, size.height as f64) / 2.0;
        let step = Vec2::new(self.sensor.pitch_px / 2.0, 0.0);
        let seen = |p: Vec2| self.sensor.upright_from_rectified(p);
        (seen(middle + step) - seen(middle - step)).direction_rad()
    }

    /// Whether the dots may be wider than the diameter says, which is at most two thirds of the pitch.
    pub fn diameter_is_limited(&self) -> bool {
        self.sensor.marker_diameter_px >= largest_diameter_px(self.sensor.pitch_px)
    }

    /// How the cells of the grid look in the upright camera image: width over height, and the angle between rows and
    /// columns, rad. None where both change over the image, as in an oblique view: there it is not known how they would
    /// look from the front.
    pub fn cells_from_front(&self) -> Option<(f64, f64)> {
        let size = self.sensor.rectified_px();
        let steps_at = |share: [f64; 2]| {
            let at = Vec2::new(share[0] * size.width as f64, share[1] * size.height as f64);
            [Vec2::new(0.5, 0.0), Vec2::new(0.0, 0.5)].map(|half| {
                let half = half * self.sensor.pitch_px;
                self.sensor.upright_from_rectified(at + half) - self.sensor.upright_from_rectified(at - half)
            })
        };
        let [along, across] = steps_at([0.5, 0.5]);
        let differs = |a: Vec2, b: Vec2| (a - b).length() > EVEN_FRACTION * b.length();
        let is_even = [[0.25, 0.5], [0.75, 0.5], [0.5, 0.25], [0.5, 0.75]].into_iter().all(|share| {
            let [x, y] = steps_at(share);
            !differs(x, along) && !differs(y, across)
        });
        let angle_rad = across.direction_rad() - along.direction_rad();
        is_even.then(|| (along.length() / across.length(), angle_rad.rem_euclid(std::f64::consts::PI)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Homography;
    use crate::sensor::Rectification;
    use crate::sensor::tests::smooth;

    #[test]
    fn a_grid_turned_clockwise_on_the_screen_has_a_positive_turn() {
        let turn_rad = 20f64.to_radians();
        // Its rows, which are along x in the plane, run to the right and down in the image.
        let (sin, cos) = libm::sincos(turn_rad);
        let homography = Homography([[cos, sin, 9.0], [-sin, cos, 90.0], [0.0, 0.0, 1.0]]);
        let rectification = Some(Rectification { homography, crop_px: [0, 0, 200, 200], distortion: None });
        let calibration = |rectification| Calibration {
            sensor: Sensor { rectification, ..smooth() },
            markers: Vec::new(),
            off_grid: Vec::new(),
            residual_pitch: 0.0,
            residual_without_distortion_pitch: 0.0,
            averaged: [0, 0],
            untouched: true,
            mean_rgb: Vec::new(),
        };
        assert!((calibration(rectification).turn_rad() - turn_rad).abs() < 1e-9);
        assert_eq!(calibration(None).turn_rad(), 0.0);
    }
}
