//! Pictures of an unknown finger at rest -> the facts of its sensor file, without a click.
//!
//! ```text
//!   frames --> dots of any size, dark or bright --> which node of a grid each is --> homography, polynomial if it pays
//!                                                                                      |
//!   sensor  <-- grey weights <-- colours of dots and gaps <-- calm frames averaged <-- rectified picture
//! ```
//! Nothing here runs per frame; memory is made as needed. What cannot be calibrated is refused with the reason:
//! a wrong grid is worse than none.

mod colours;
mod defects;
mod fit;
mod grid;
mod lattice;
mod search;
mod shear;
mod solve;

use crate::image::{Frame, Pixels, Rgb, SizePx};
use crate::monitor::{RestBuilder, RestKind, Settings};
use crate::pixels::grey::{GreyWeights, grey_from_rgb};
use crate::pixels::mean::FrameMean;
use crate::pixels::patch::dot_colours;
use crate::plane::Vec2;
use crate::sensor::{EdgeBand, Flip, Polarity, Rectification, Sensor, Skin};
use crate::setting::SettingError;
use fit::{median, scaled_to_one};
use grid::Grid;
use std::fmt;

pub use shear::{HangingFrame, ShearError, calm_end, calm_held, displacement_sum_px, outermost, shear_stiffness};

/// What a picture of dots cannot say about a finger.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The name of the kind of finger.
    pub name: String,
    /// What is behind the numbers.
    pub description: String,
    /// Serial number of this one finger.
    pub serial: Option<String>,
    /// Distance between neighbouring markers on the gel in mm.
    pub pitch_mm: Option<f64>,
    /// A mirror image looks like a grid, too.
    pub flip: Flip,
    /// The weave of a fabric shows only where it is pressed.
    pub skin: Skin,
    /// Dark or bright; None: found.
    pub polarity: Option<Polarity>,
}

/// One marker of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridMarker {
    /// Column and row of the grid.
    pub node: [i32; 2],
    /// Where it was found in the camera image as delivered, px.
    pub camera_px: Vec2,
    /// How far the map puts it from there, in pitches.
    pub residual_pitch: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The facts, checked; `bare_sharpness` is measured on the same frames, if they look untouched.
    pub sensor: Sensor,
    /// Every marker on the grid, column by column.
    pub markers: Vec<GridMarker>,
    /// RMS of the residuals of all markers, in pitches.
    pub residual_pitch: f64,
    /// The same with a homography alone.
    pub residual_without_distortion_pitch: f64,
    /// Markers more than [`OFF_GRID_PITCH`] from their node.
    pub off_grid_count: usize,
    /// Places in the list of frames that were averaged, first and last.
    pub averaged: [usize; 2],
    /// Whether the averaged frames look untouched.
    pub untouched: bool,
    /// The averaged picture as delivered, bytes red, green, blue.
    pub mean_rgb: Vec<u8>,
}

impl Calibration {
    /// Where the first column and the first row of the grid meet in the rectified image, px.
    pub fn origin_px(&self) -> Vec2 {
        let margin_px = (grid::MARGIN_PITCH * self.sensor.pitch_px).round();
        Vec2::new(margin_px, margin_px)
    }
}

/// A marker so far from its node is a blemish of the print, not of the map.
pub const OFF_GRID_PITCH: f64 = 0.15;
/// Fewest markers from which a grid is believed.
pub const FEWEST_MARKERS: usize = 16;
/// Fewest columns, and rows.
const FEWEST_LINES: i32 = 3;
/// The largest residual of half of the markers at which the map is believed, in pitches.
const WORST_MEDIAN_PITCH: f64 = 0.08;
/// The largest RMS residual.
const WORST_RMS_PITCH: f64 = 0.15;
/// The largest expected error of the map: residual times the root of parameters per marker. This and the residual keep
/// dots without order out: those found near nodes by chance are some 0.15 pitch off, a fit of p parameters an axis to n of
/// them leaves 0.15 sqrt(1 - p/n), and 0.15 sqrt(p/n (1 - p/n)) is above this bar for all p/n from 0.02 to 0.98; below,
/// the residual is above its own.
const WORST_ERROR_PITCH: f64 = 0.02;
/// Fewest nodes inside the outline of the grid that must have a marker, as a share.
const FEWEST_FILLED: f64 = 0.5;
/// A second grid in the gaps of the first is there when it has this share of as many spots.
const SECOND_GRID_RATIO: f64 = 0.5;

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq)]
pub enum CalibrationError {
    /// No frame was given, or all are dark.
    NoPicture {
        /// Frames looked at.
        frames_count: usize,
    },
    /// The frames differ in size.
    Sizes {
        /// That of the first.
        expected: SizePx,
        /// That of another.
        got: SizePx,
    },
    /// Dots on no grid, or none.
    NoGrid {
        /// Dots of the most promising size.
        dots_count: usize,
        /// Those of them on a grid.
        on_grid_count: usize,
    },
    /// A grid too narrow to fix a map.
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
    /// The markers do not lie on what homography and polynomial can do.
    Residual {
        /// Half of the markers are further away than this, in pitches.
        median_pitch: f64,
        /// RMS, in pitches.
        rms_pitch: f64,
    },
    /// Too few markers for the scatter they have.
    Uncertain {
        /// Expected error of the map, in pitches.
        error_pitch: f64,
        /// Markers there are.
        markers_count: usize,
        /// Their RMS residual, in pitches.
        rms_pitch: f64,
    },
    /// A fact came out that a sensor cannot have.
    Fact(SettingError),
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CalibrationError::NoPicture { frames_count } => write!(
                f,
                "no picture to calibrate from: expected a lit finger at rest, got {frames_count} frames, all of them dark"
            ),
            CalibrationError::Sizes { expected, got } => {
                write!(f, "frames of different size: expected {expected} as the first, got {got}")
            }
            CalibrationError::NoGrid { dots_count, on_grid_count } => write!(
                f,
                "no grid of markers: expected at least {FEWEST_MARKERS} dots on a grid, got {on_grid_count} of \
                 {dots_count} dots (take a sharp picture of the untouched finger, lights on, at its full size)"
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
            CalibrationError::Uncertain { error_pitch, markers_count, rms_pitch } => write!(
                f,
                "too few markers for their scatter: expected a map good to {WORST_ERROR_PITCH} pitch, got \
                 {error_pitch:.3} from {markers_count} markers {rms_pitch:.3} pitch RMS off it (average more frames, or \
                 show more of the gel)"
            ),
            CalibrationError::Fact(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for CalibrationError {}

/// Frames looked at to find the calm ones, at most.
pub const FRAMES_MOST: usize = 20;
/// Mean level below which a picture is dark.
const DARK_LEVELS: f64 = 12.0;

/// The facts of the finger that these frames show at rest; of a recording the first [`FRAMES_MOST`] or fewer.
pub fn calibrate(frames: &[Frame<'_>], given: &Given) -> Result<Calibration, CalibrationError> {
    let Some(size) = frames.first().map(|f| f.pixels.size()) else {
        return Err(CalibrationError::NoPicture { frames_count: 0 });
    };
    if let Some(other) = frames.iter().map(|f| f.pixels.size()).find(|s| *s != size) {
        return Err(CalibrationError::Sizes { expected: size, got: other });
    }
    let means: Vec<f64> = frames.iter().map(mean_levels).collect();
    let lit: Vec<f64> = means.iter().copied().filter(|m| *m >= DARK_LEVELS).collect();
    // A camera that is still settling: the frame of usual brightness is taken.
    let usual = median(&lit);
    let start = means.iter().position(|m| *m >= DARK_LEVELS && (m - usual).abs() <= 0.1 * usual);
    let Some(start) = start else {
        return Err(CalibrationError::NoPicture { frames_count: frames.len() });
    };
    let first = from_mean(&frames[start..=start], given);
    // The finger, once roughly known, says which frames are calm; if one frame was too poor, all are tried.
    let (from, to, untouched) = match &first {
        // Its sharpness was measured on the very frame in doubt.
        Ok(rough) if frames.len() > 1 => {
            calm(frames, &Sensor { bare_sharpness: None, ..rough.sensor.clone() }).unwrap_or((start, start + 1, true))
        }
        Ok(_) => (start, start + 1, true),
        Err(_) => (start, frames.len(), true),
    };
    let mut calibration = if to - from == 1 && from == start { first? } else { from_mean(&frames[from..to], given)? };
    calibration.averaged = [from, to - 1];
    calibration.untouched = untouched;
    if !untouched {
        calibration.sensor.bare_sharpness = None;
    }
    Ok(calibration)
}

/// The calm frames and whether nothing touches in them.
fn calm(frames: &[Frame<'_>], sensor: &Sensor) -> Option<(usize, usize, bool)> {
    let mut builder = RestBuilder::new(sensor, &Settings::default(), sensor.image_px).ok()?;
    let looks: Vec<_> = frames.iter().map(|f| builder.look(f)).collect();
    let choice = builder.choose(&looks).ok()?;
    Some((choice.frames.start, choice.frames.end, choice.kind == RestKind::Unloaded))
}

fn mean_levels(frame: &Frame<'_>) -> f64 {
    let mut cells = crate::pixels::cells::Cells::new(frame.pixels.size(), 8);
    cells.run(&frame.pixels);
    let sum: f32 = cells.means_levels().iter().map(|c| c[0].max(c[1]).max(c[2])).sum();
    f64::from(sum) / cells.means_levels().len().max(1) as f64
}

/// Equal weights: what is known of colour before the markers are.
const EVEN_WEIGHTS: [f64; 3] = [0.33, 0.34, 0.33];

fn from_mean(frames: &[Frame<'_>], given: &Given) -> Result<Calibration, CalibrationError> {
    let size = frames[0].pixels.size();
    let mut mean = FrameMean::new(size);
    frames.iter().for_each(|f| mean.add(&f.pixels));
    let mean_rgb = mean.rgb();
    let image = Rgb::new(&mean_rgb, size).map_err(|_| CalibrationError::NoPicture { frames_count: frames.len() })?;
    let grey = |weights: [f64; 3]| {
        let mut grey = vec![0; size.area()];
        grey_from_rgb(image, &GreyWeights::new(weights), given.flip, &mut grey);
        grey
    };
    let even = grey(EVEN_WEIGHTS);
    let found = search::search(&even, size, given.polarity);
    let found = found.ok_or(CalibrationError::NoGrid { dots_count: 0, on_grid_count: 0 })?;
    let dots_count = found.spots.len();
    let no_grid = |on_grid_count: usize| CalibrationError::NoGrid { dots_count, on_grid_count };
    if found.nodes.len() < FEWEST_MARKERS {
        return Err(no_grid(found.nodes.len()));
    }
    let mut grid = Grid::rough(&found).ok_or(no_grid(found.nodes.len()))?;
    grid.refine(&even, size).ok_or(no_grid(grid.dots.len()))?;
    let weights = match &frames[0].pixels {
        Pixels::Rgb(_) => weights(image, &grid, given.flip),
        Pixels::Gray(_) => EVEN_WEIGHTS,
    };
    let weighted = grey(weights);
    grid.refine(&weighted, size).ok_or(no_grid(grid.dots.len()))?;
    judge(&grid, dots_count, &weighted, size)?;

    let mut sensor = facts(&grid, weights, size, given);
    sensor.check().map_err(CalibrationError::Fact)?;
    let (rectified, table) = grid.rectified(&weighted, size);
    sensor.defects_px = defects::find(&rectified, &table, &grid);
    sensor.bare_sharpness = bare_sharpness(&sensor, &frames[0], &mean_rgb);
    let misses = grid.misses_pitch();
    let straight = fit::fit(&grid.pairs(), 0, grid.pitch_px);
    let straight = straight.map_or(vec![], |m| grid.pairs().iter().map(|p| m.miss_px(p) / grid.pitch_px).collect());
    let markers = grid.dots.iter().zip(&misses);
    let markers = markers.map(|((&(i, j), dot), &residual_pitch)| GridMarker {
        node: [i, j],
        camera_px: mirrored(dot.seen, given.flip, size),
        residual_pitch,
    });
    Ok(Calibration {
        markers: markers.collect(),
        residual_pitch: rms(&misses),
        residual_without_distortion_pitch: rms(&straight),
        off_grid_count: misses.iter().filter(|m| **m > OFF_GRID_PITCH).count(),
        averaged: [0, frames.len() - 1],
        untouched: true,
        sensor,
        mean_rgb,
    })
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// A point of the upright image in the image as delivered, and back.
fn mirrored(p: Vec2, flip: Flip, size: SizePx) -> Vec2 {
    let (right, bottom) = ((size.width - 1) as f64, (size.height - 1) as f64);
    let x = if matches!(flip, Flip::Horizontal | Flip::Both) { right - p.x } else { p.x };
    let y = if matches!(flip, Flip::Vertical | Flip::Both) { bottom - p.y } else { p.y };
    Vec2::new(x, y)
}

fn weights(image: Rgb<'_>, grid: &Grid, flip: Flip) -> [f64; 3] {
    let dots = grid.dots.iter().filter_map(|(node, dot)| {
        let scale = grid.map.scale_at(grid.plane(*node));
        let (radius, pitch) = (0.5 * grid.diameter_px * scale, grid.pitch_px * scale);
        let ring = (radius + 1.5, (pitch - radius - 1.5).max(radius + 3.0));
        dot_colours(image, mirrored(dot.seen, flip, image.size()), 0.7 * radius, ring)
    });
    colours::grey_weights(&dots.collect::<Vec<_>>(), grid.polarity)
}

/// Refuses a grid that may be a wrong one.
fn judge(grid: &Grid, dots_count: usize, grey: &[u8], camera_px: SizePx) -> Result<(), CalibrationError> {
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
    let misses = grid.misses_pitch();
    let (median_pitch, rms_pitch) = (median(&misses), rms(&misses));
    if !(median_pitch <= WORST_MEDIAN_PITCH && rms_pitch <= WORST_RMS_PITCH) {
        return Err(CalibrationError::Residual { median_pitch, rms_pitch });
    }
    // Homography and the terms of the polynomial that are not linear, for each axis.
    let parameters = 4.0 + grid.map.distortion.map_or(0.0, |d| d.terms_px().0.len() as f64 - 3.0);
    let error_pitch = rms_pitch * (parameters / markers_count as f64).sqrt();
    if error_pitch > WORST_ERROR_PITCH {
        return Err(CalibrationError::Uncertain { error_pitch, markers_count, rms_pitch });
    }
    let between_count = between(grid, grey, camera_px);
    if between_count as f64 > SECOND_GRID_RATIO * markers_count as f64 {
        return Err(CalibrationError::AmbiguousPitch { pitch_px: grid.pitch_px, between_count, markers_count });
    }
    Ok(())
}

/// Nodes between the first and the last marker of their row and of their column.
fn within_outline(grid: &Grid) -> usize {
    let rows = grid.dots.keys().fold(std::collections::BTreeMap::new(), |mut rows, (i, j)| {
        let span = rows.entry(*j).or_insert((*i, *i));
        *span = (span.0.min(*i), span.1.max(*i));
        rows
    });
    rows.values().map(|(low, high)| (high - low + 1) as usize).sum()
}

/// Dots as strong as the markers in the middle of a cell or of its sides.
fn between(grid: &Grid, grey: &[u8], camera_px: SizePx) -> usize {
    let (rectified, table) = grid.rectified(grey, camera_px);
    let size = table.out_size();
    let levels: Vec<f64> = grid.dots.values().map(|d| f64::from(d.response_levels)).collect();
    let mut finder = crate::pixels::dots::DotFinder::new(size, grid.diameter_px, 0.5 * grid.pitch_px, grid.polarity);
    let spots = finder.run(&rectified, (0.5 * median(&levels)) as f32);
    let origin = grid.plane(*grid.dots.keys().next().unwrap_or(&(0, 0)));
    let amid = |v: f64| {
        let part = v / grid.pitch_px - (v / grid.pitch_px).floor();
        (part - 0.5).abs() < 0.15
    };
    let on_line = |v: f64| {
        let part = v / grid.pitch_px;
        (part - part.round()).abs() < 0.15
    };
    let is_between = |p: Vec2| {
        let from = p - origin;
        (amid(from.x) && (amid(from.y) || on_line(from.y))) || (amid(from.y) && on_line(from.x))
    };
    spots.iter().filter(|s| is_between(s.position)).count()
}

/// Canny's thresholds of the paper's first finger, where nobody has set others.
const EDGE_LEVELS: (u16, u16) = (90, 120);

fn facts(grid: &Grid, grey_weights_rgb: [f64; 3], image_px: SizePx, given: &Given) -> Sensor {
    let size = grid.size();
    let homography =
        grid.map.camera_from_plane.inverse().map(scaled_to_one).unwrap_or(crate::plane::Homography::IDENTITY);
    let (low_levels, high_levels) = EDGE_LEVELS;
    Sensor {
        name: given.name.clone(),
        description: given.description.clone(),
        serial: given.serial.clone(),
        image_px,
        flip: given.flip,
        grey_weights_rgb,
        polarity: grid.polarity,
        pitch_px: grid.pitch_px,
        pitch_mm: given.pitch_mm,
        marker_diameter_px: grid.diameter_px,
        skin: given.skin,
        bare_sharpness: None,
        edge_bands: match given.skin {
            Skin::Fabric => vec![EdgeBand { rows_to_fraction: 1.0, low_levels, high_levels }],
            Skin::Smooth => Vec::new(),
        },
        rectification: Some(Rectification {
            homography,
            crop_px: [0, 0, size.width, size.height],
            distortion: grid.map.distortion,
        }),
        defects_px: Vec::new(),
        shear: None,
    }
}

/// How sharp the untouched finger looks, as the monitor measures it.
fn bare_sharpness(sensor: &Sensor, frame: &Frame<'_>, mean_rgb: &[u8]) -> Option<f64> {
    let mut builder = RestBuilder::new(sensor, &Settings::default(), sensor.image_px).ok()?;
    let pixels = Pixels::Rgb(Rgb::new(mean_rgb, sensor.image_px).ok()?);
    let look = builder.look(&Frame { pixels, ..*frame });
    look.sharpness.is_finite().then(|| (look.sharpness * 1000.0).round() / 1000.0)
}
