//! Why a finger cannot be calibrated, and the limits of acceptance.

use crate::image::SizePx;
use crate::setting::SettingError;
use std::fmt;

/// Fewest markers from which a grid is accepted.
pub const FEWEST_MARKERS: usize = 16;
/// Fewest columns, and rows.
pub(super) const FEWEST_LINES: i32 = 3;
/// Largest accepted median residual, in pitches.
pub(super) const WORST_MEDIAN_PITCH: f64 = 0.08;
/// Largest accepted RMS residual.
pub(super) const WORST_RMS_PITCH: f64 = 0.15;
/// Largest accepted expected error of the map: residual times the root of parameters per marker. Together with the
/// residual limit, it rejects random dots. Dots near nodes by chance are about 0.15 pitch off; a fit of p parameters
/// per axis to n of them leaves 0.15 sqrt(1 - p/n). The expected error 0.15 sqrt(p/n (1 - p/n)) exceeds this limit for
/// all p/n from 0.02 to 0.98; below, the residual exceeds its own.
pub(super) const WORST_ERROR_PITCH: f64 = 0.02;
/// Least share of the spots near nodes that must lie on the grid. With 0.75 of a small grid, a map was wrong by a
/// seventh of a pitch; correct ones had 0.84 and more.
pub(super) const FEWEST_ON_GRID: f64 = 0.8;
/// Least share of the nodes inside the outline of the grid that must have a marker.
pub(super) const FEWEST_FILLED: f64 = 0.5;
/// More spots in the gaps than this share of the markers are a second grid.
pub(super) const SECOND_GRID_RATIO: f64 = 0.5;

/// Why a finger cannot be calibrated.
#[derive(Debug, Clone, PartialEq)]
pub enum CalibrationError {
    /// No frame was given, or all are dark.
    NoPicture {
        /// Frames examined.
        frames_count: usize,
    },
    /// The frames differ in size.
    Sizes {
        /// Size of the first.
        expected: SizePx,
        /// Size of another.
        got: SizePx,
    },
    /// No dots, or dots on no grid.
    NoGrid {
        /// Dots of the most promising size.
        dots_count: usize,
        /// Those of them on a grid.
        on_grid_count: usize,
    },
    /// The grid is too narrow to determine a map.
    Narrow {
        /// Columns and rows found.
        got: [i32; 2],
    },
    /// Many nodes without a marker: the grid may be one of every other dot.
    Holes {
        /// Markers found.
        markers_count: usize,
        /// Nodes within the outline.
        nodes_count: usize,
    },
    /// As many dots between the nodes as on them.
    AmbiguousPitch {
        /// Pitch found, px.
        pitch_px: f64,
        /// Spots in the middle of its cells.
        between_count: usize,
        /// Markers on its nodes.
        markers_count: usize,
    },
    /// Homography and polynomial do not fit the markers.
    Residual {
        /// Median residual, in pitches.
        median_pitch: f64,
        /// RMS residual, in pitches.
        rms_pitch: f64,
    },
    /// Too many spots near nodes are off the grid.
    Strays {
        /// Markers on the grid.
        markers_count: usize,
        /// Spots near its nodes that are off it.
        off_grid_count: usize,
    },
    /// Too few markers for their scatter.
    Uncertain {
        /// Expected error of the map, in pitches.
        error_pitch: f64,
        /// Markers found on the grid.
        markers_count: usize,
        /// Their RMS residual, in pitches.
        rms_pitch: f64,
    },
    /// A resulting fact is invalid for a sensor.
    Fact(SettingError),
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CalibrationError::NoPicture { frames_count } => write!(
                f,
                "no image to calibrate from: expected a lit finger at rest, got {frames_count} frames, all of them dark"
            ),
            CalibrationError::Sizes { expected, got } => {
                write!(f, "frames of different size: expected {expected} as the first, got {got}")
            }
            CalibrationError::NoGrid { dots_count, on_grid_count } => write!(
                f,
                "no grid of markers: expected at least {FEWEST_MARKERS} dots on a grid and half of all there are, got \
                 {on_grid_count} of {dots_count} dots (take a sharp picture of the untouched finger, lights on, at its full size)"
            ),
            CalibrationError::Narrow { got: [columns, rows] } => write!(
                f,
                "grid too narrow: expected at least {FEWEST_LINES} columns and {FEWEST_LINES} rows of markers, got \
                 {columns} and {rows} (show more of the gel)"
            ),
            CalibrationError::Holes { markers_count, nodes_count } => write!(
                f,
                "grid with holes: expected markers on half of its nodes or more, got {markers_count} on {nodes_count} \
                 (glare or dirt? average several frames, or take a picture with even light)"
            ),
            CalibrationError::AmbiguousPitch { pitch_px, between_count, markers_count } => write!(
                f,
                "ambiguous pitch: expected empty cells, got {between_count} dots amid the cells of a grid of \
                 {markers_count} at {pitch_px} px (texture as strong as the markers? give --polarity)"
            ),
            CalibrationError::Residual { median_pitch, rms_pitch } => write!(
                f,
                "markers off the grid: expected half of them within {WORST_MEDIAN_PITCH} pitch and {WORST_RMS_PITCH} \
                 RMS, got {median_pitch:.3} and {rms_pitch:.3} (was the gel touched? take the finger at rest)"
            ),
            CalibrationError::Strays { markers_count, off_grid_count } => write!(
                f,
                "glare or dirt among the markers: expected four of five dots on the grid, got {off_grid_count} off it beside \
                 {markers_count} on it (turn the light down, or clean the gel)"
            ),
            CalibrationError::Uncertain { error_pitch, markers_count, rms_pitch } => write!(
                f,
                "too few markers for their scatter: expected a map good to {WORST_ERROR_PITCH} pitch, got \
                 {error_pitch:.3} from {markers_count} markers {rms_pitch:.3} pitch RMS off it (average more frames, or \
                 show more of the gel)"
            ),
            CalibrationError::Fact(e) if e.key == "marker_diameter_px" => {
                write!(f, "{e}, as measured in the images: scale them so that the markers have such a size")
            }
            CalibrationError::Fact(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for CalibrationError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_of_a_size_that_nobody_gave_are_told_with_what_to_do() {
        let fact = |key: &str| {
            CalibrationError::Fact(SettingError { key: key.into(), got: "66.3".into(), expected: "a number".into() })
        };
        assert!(fact("marker_diameter_px").to_string().ends_with("scale them so that the markers have such a size"));
        assert!(!fact("pitch_px").to_string().contains("scale"));
    }
}
