//! The result of a calibration.

use super::grid::MARGIN_PITCH;
use crate::plane::Vec2;
use crate::sensor::Sensor;

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
