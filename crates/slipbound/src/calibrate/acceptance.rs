//! Whether a grid is accepted: a wrong one is worse than none.

use super::error::{
    CalibrationError, FEWEST_FILLED, FEWEST_LINES, FEWEST_MARKERS, FEWEST_ON_GRID, SECOND_GRID_RATIO,
    WORST_ERROR_PITCH, WORST_MEDIAN_PITCH, WORST_RMS_PITCH,
};
use super::fit::{median, rms};
use super::grid::{Grid, OFF_GRID_PITCH};
use crate::image::SizePx;
use crate::pixels::dots::DotFinder;
use crate::plane::Vec2;
use crate::sensor::MOST_MARKER_DIAMETER_PX;
use std::collections::BTreeMap;

/// Refuses a grid that may be wrong.
pub(super) fn accept(grid: &Grid, dots_count: usize, grey: &[u8], camera_px: SizePx) -> Result<(), CalibrationError> {
    let markers_count = grid.dots.len();
    if markers_count < FEWEST_MARKERS {
        let dots_count = dots_count.max(markers_count);
        return Err(CalibrationError::NoGrid { dots_count, on_grid_count: markers_count });
    }
    let lines = |line: &dyn Fn(&(i32, i32)) -> i32| {
        let (low, high) = grid.dots.keys().map(line).fold((i32::MAX, i32::MIN), |(l, h), v| (l.min(v), h.max(v)));
        high - low + 1
    };
    let got = [lines(&|n| n.0), lines(&|n| n.1)];
    if got.iter().any(|n| *n < FEWEST_LINES) {
        return Err(CalibrationError::Narrow { got });
    }
    let nodes_count = within_outline(grid);
    if (markers_count as f64) < FEWEST_FILLED * nodes_count as f64 {
        return Err(CalibrationError::Holes { markers_count, nodes_count });
    }
    let residuals = grid.residuals_pitch();
    let on_grid: Vec<f64> = residuals.iter().copied().filter(|r| *r <= OFF_GRID_PITCH).collect();
    let (median_pitch, rms_pitch) = (median(&residuals), rms(&on_grid));
    if !(median_pitch <= WORST_MEDIAN_PITCH && rms_pitch <= WORST_RMS_PITCH) {
        return Err(CalibrationError::Residual { median_pitch, rms_pitch });
    }
    let off_grid_count = grid.off_grid.len() + residuals.len() - on_grid.len();
    if (on_grid.len() as f64) < FEWEST_ON_GRID * (on_grid.len() + off_grid_count) as f64 {
        // A few of many dots are on a grid by chance: that is not a grid with glare in it.
        let on_grid_count = on_grid.len();
        if on_grid_count < FEWEST_MARKERS || 2 * on_grid_count < dots_count {
            return Err(CalibrationError::NoGrid { dots_count: dots_count.max(on_grid_count), on_grid_count });
        }
        return Err(CalibrationError::Strays { markers_count: on_grid_count, off_grid_count });
    }
    // Per axis: homography and the nonlinear terms of the polynomial.
    let parameters = 4.0 + grid.map.distortion.map_or(0.0, |d| d.terms_px().0.len() as f64 - 3.0);
    let error_pitch = rms_pitch * (parameters / markers_count as f64).sqrt();
    if error_pitch > WORST_ERROR_PITCH {
        return Err(CalibrationError::Uncertain { error_pitch, markers_count, rms_pitch });
    }
    if grid.diameter_px > MOST_MARKER_DIAMETER_PX {
        // No sensor has such dots: its check says so.
        return Ok(());
    }
    let between_count = between(grid, grey, camera_px);
    if between_count as f64 > SECOND_GRID_RATIO * markers_count as f64 {
        return Err(CalibrationError::AmbiguousPitch { pitch_px: grid.pitch_px, between_count, markers_count });
    }
    Ok(())
}

/// Number of nodes between the first and the last marker of their row.
fn within_outline(grid: &Grid) -> usize {
    let rows = grid.dots.keys().fold(BTreeMap::new(), |mut rows, (i, j)| {
        let span = rows.entry(*j).or_insert((*i, *i));
        *span = (span.0.min(*i), span.1.max(*i));
        rows
    });
    rows.values().map(|(low, high)| (high - low + 1) as usize).sum()
}

/// Number of dots in the middle of a cell or of its sides with at least half the median contrast of the markers.
fn between(grid: &Grid, grey: &[u8], camera_px: SizePx) -> usize {
    let (rectified, table) = grid.rectified(grey, camera_px);
    let size = table.out_size();
    let levels: Vec<f64> = grid.dots.values().map(|d| f64::from(d.response_levels)).collect();
    let mut finder = DotFinder::new(size, grid.diameter_px, 0.5 * grid.pitch_px, grid.polarity);
    let spots = finder.run(&rectified, (0.5 * median(&levels)) as f32);
    let origin = grid.plane(*grid.dots.keys().next().unwrap_or(&(0, 0)));
    let between_nodes = |v: f64| {
        let part = v / grid.pitch_px - (v / grid.pitch_px).floor();
        (part - 0.5).abs() < 0.15
    };
    let on_line = |v: f64| {
        let part = v / grid.pitch_px;
        (part - part.round()).abs() < 0.15
    };
    let is_between = |p: Vec2| {
        let from = p - origin;
        (between_nodes(from.x) && (between_nodes(from.y) || on_line(from.y)))
            || (between_nodes(from.y) && on_line(from.x))
    };
    spots.iter().filter(|s| is_between(s.position)).count()
}
