//! Images of an unknown finger at rest -> the facts of its sensor file, without manual input.
//!
//! ```text
//!   frames --> dots of any size, dark or bright --> which node of a grid each is --> homography, polynomial if needed
//!                                                                                      |
//!   sensor  <-- grey weights <-- colours of dots and gaps <-- frames at rest averaged <-- rectified image
//! ```
//! Nothing here runs per frame; memory is allocated as needed. A finger that cannot be calibrated is refused with the
//! reason: a wrong grid is worse than none.

mod acceptance;
mod calibration;
mod colours;
mod defects;
mod error;
mod facts;
mod fit;
mod grid;
mod lattice;
mod search;
mod shear;
mod solve;

pub use calibration::{Calibration, GridMarker};
pub use error::{CalibrationError, FEWEST_MARKERS};
pub use facts::KnownFacts;
pub use shear::{
    HangingFrame, ShearError, displacement_sum_px, outermost, shear_stiffness, stationary_end, stationary_held,
    steadied,
};

use crate::image::{Frame, Pixels, Rgb};
use crate::monitor::{RestBuilder, RestKind, Settings};
use crate::pixels::cells::Cells;
use crate::pixels::grey::{GreyWeights, grey_from_rgb};
use crate::pixels::mean::FrameMean;
use crate::sensor::Sensor;
use fit::{median, rms};
use grid::{Dot, Grid, OFF_GRID_PITCH};
use std::ops::Range;

/// Most frames examined to find the finger at rest.
pub const FRAMES_MOST: usize = 20;
/// Mean level below which an image is dark.
const DARK_LEVELS: f64 = 12.0;

/// The facts of the finger that these frames show at rest; of a recording, the first [`FRAMES_MOST`] frames or fewer.
pub fn calibrate(frames: &[Frame<'_>], known: &KnownFacts) -> Result<Calibration, CalibrationError> {
    let Some(size) = frames.first().map(|f| f.pixels.size()) else {
        return Err(CalibrationError::NoPicture { frames_count: 0 });
    };
    if let Some(other) = frames.iter().map(|f| f.pixels.size()).find(|s| *s != size) {
        return Err(CalibrationError::Sizes { expected: size, got: other });
    }
    let means: Vec<f64> = frames.iter().map(mean_levels).collect();
    let lit: Vec<f64> = means.iter().copied().filter(|m| *m >= DARK_LEVELS).collect();
    // The camera may still be settling: frames of unusual brightness are not tried.
    let usual = median(&lit);
    let is_usual = |i: &usize| means[*i] >= DARK_LEVELS && (means[*i] - usual).abs() <= 0.1 * usual;
    let Some(start) = (0..frames.len()).find(is_usual) else {
        return Err(CalibrationError::NoPicture { frames_count: frames.len() });
    };
    if frames.len() == 1 {
        return from_mean(frames, known);
    }
    // A rough sensor shows which frames are at rest: from the first frame that gives one by itself (motion may blur the
    // others), else from the mean of all.
    let single = |i: usize| Some((i, from_mean(&frames[i..=i], known).ok()?));
    let (start, rough) = match (start..frames.len()).filter(is_usual).find_map(single) {
        Some(found) => found,
        None => (start, from_mean(&frames[start..], known)?),
    };
    // Its sharpness was measured on the very frames to be judged.
    let rough = Sensor { bare_sharpness: None, ..rough.sensor };
    let (rest, untouched) = at_rest(&frames[start..], &rough).unwrap_or((0..1, false));
    let averaged = start + rest.start..start + rest.end;
    let mut calibration = from_mean(&frames[averaged.clone()], known)?;
    calibration.averaged = [averaged.start, averaged.end - 1];
    calibration.untouched = untouched;
    if !untouched {
        calibration.sensor.bare_sharpness = None;
    }
    Ok(calibration)
}

/// The frames in which the finger is at rest, and whether it is untouched in them.
fn at_rest(frames: &[Frame<'_>], sensor: &Sensor) -> Option<(Range<usize>, bool)> {
    let mut builder = RestBuilder::new(sensor, &Settings::default(), sensor.image_px).ok()?;
    let looks: Vec<_> = frames.iter().map(|f| builder.look(f)).collect();
    let choice = builder.choose(&looks).ok()?;
    Some((choice.frames, choice.kind == RestKind::Unloaded))
}

fn mean_levels(frame: &Frame<'_>) -> f64 {
    let mut cells = Cells::new(frame.pixels.size(), 8);
    cells.run(&frame.pixels);
    let sum: f32 = cells.means_levels().iter().map(|c| c[0].max(c[1]).max(c[2])).sum();
    f64::from(sum) / cells.means_levels().len().max(1) as f64
}

/// Equal weights, until the colours of the markers are known.
const EVEN_WEIGHTS: [f64; 3] = [0.33, 0.34, 0.33];

fn from_mean(frames: &[Frame<'_>], known: &KnownFacts) -> Result<Calibration, CalibrationError> {
    let size = frames[0].pixels.size();
    let mut mean = FrameMean::new(size);
    frames.iter().for_each(|f| mean.add(&f.pixels));
    let mean_rgb = mean.rgb();
    let image = Rgb::new(&mean_rgb, size).map_err(|_| CalibrationError::NoPicture { frames_count: frames.len() })?;
    let grey = |weights: [f64; 3]| {
        let mut grey = vec![0; size.area()];
        grey_from_rgb(image, &GreyWeights::new(weights), known.flip, &mut grey);
        grey
    };
    let even = grey(EVEN_WEIGHTS);
    let found = search::search(&even, size, known.polarity);
    let found = found.ok_or(CalibrationError::NoGrid { dots_count: 0, on_grid_count: 0 })?;
    let dots_count = found.spots.len();
    let no_grid = |on_grid_count: usize| CalibrationError::NoGrid { dots_count, on_grid_count };
    if found.nodes.len() < FEWEST_MARKERS {
        return Err(no_grid(found.nodes.len()));
    }
    let mut grid = Grid::rough(&found).ok_or(no_grid(found.nodes.len()))?;
    grid.refine(&even, size).ok_or(no_grid(grid.dots.len()))?;
    let weights = match &frames[0].pixels {
        Pixels::Rgb(_) => facts::grey_weights(image, &grid, known.flip),
        Pixels::Gray(_) => EVEN_WEIGHTS,
    };
    let weighted = grey(weights);
    grid.refine(&weighted, size).ok_or(no_grid(grid.dots.len()))?;
    acceptance::accept(&grid, dots_count, &weighted, size)?;
    grid.reject_beyond(OFF_GRID_PITCH).ok_or(no_grid(grid.dots.len()))?;

    let mut sensor = facts::sensor(&grid, weights, size, known);
    sensor.check().map_err(CalibrationError::Fact)?;
    let (rectified, table) = grid.rectified(&weighted, size);
    sensor.defects_px = defects::find(&rectified, &table, &grid);
    sensor.bare_sharpness = facts::bare_sharpness(&sensor, frames, &mean_rgb);
    let straight = fit::fit(&grid.pairs(), 0, grid.pitch_px);
    let straight = straight.map_or(vec![], |m| grid.pairs().iter().map(|p| m.residual_px(p) / grid.pitch_px).collect());
    let marker = |(&(i, j), dot): (&(i32, i32), &Dot)| GridMarker {
        node: [i, j],
        camera_px: facts::mirrored(dot.seen, known.flip, size),
        residual_pitch: grid.residual_pitch((i, j), dot),
    };
    let (markers, off_grid): (Vec<_>, Vec<_>) =
        grid.dots.iter().map(marker).partition(|m| m.residual_pitch <= OFF_GRID_PITCH);
    let residuals: Vec<f64> = markers.iter().map(|m| m.residual_pitch).collect();
    Ok(Calibration {
        markers,
        off_grid: off_grid.into_iter().chain(grid.off_grid.iter().map(marker)).collect(),
        residual_pitch: rms(&residuals),
        residual_without_distortion_pitch: rms(&straight),
        averaged: [0, frames.len() - 1],
        untouched: true,
        sensor,
        mean_rgb,
    })
}
