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
}
