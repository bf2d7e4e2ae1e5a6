//! The facts of a sensor file, from the grid and from what the user knows.

use super::colours;
use super::fit::{median, scaled_to_one};
use super::grid::Grid;
use crate::image::{Frame, Pixels, Rgb, SizePx};
use crate::monitor::{RestBuilder, Settings};
use crate::pixels::patch::dot_colours;
use crate::plane::{Homography, Vec2};
use crate::sensor::{EdgeBand, Flip, Polarity, Rectification, Sensor, Skin};

/// Facts about a finger that an image of its markers does not show and the user has to state.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownFacts {
    /// The name of the kind of finger.
    pub name: String,
    /// Where the numbers come from.
    pub description: String,
    /// Serial number of this one finger.
    pub serial: Option<String>,
    /// Distance between neighbouring markers on the gel in mm.
    pub pitch_mm: Option<f64>,
    /// How the camera mirrors its image: a mirrored grid still looks like a grid.
    pub flip: Flip,
    /// The skin: the weave of a fabric is visible only where it is pressed.
    pub skin: Skin,
    /// Dark or bright; None: to be detected.
    pub polarity: Option<Polarity>,
}

/// Converts a point of the upright image to the image as delivered, or back.
pub(super) fn mirrored(p: Vec2, flip: Flip, size: SizePx) -> Vec2 {
    let (right, bottom) = ((size.width - 1) as f64, (size.height - 1) as f64);
    let x = if matches!(flip, Flip::Horizontal | Flip::Both) { right - p.x } else { p.x };
    let y = if matches!(flip, Flip::Vertical | Flip::Both) { bottom - p.y } else { p.y };
    Vec2::new(x, y)
}

/// Grey weights that make the markers stand out best against the gel around them.
pub(super) fn grey_weights(image: Rgb<'_>, grid: &Grid, flip: Flip) -> [f64; 3] {
    let dots = grid.dots.iter().filter_map(|(node, dot)| {
        let scale = grid.map.scale_at(grid.plane(*node));
        let (radius, pitch) = (0.5 * grid.diameter_px * scale, grid.pitch_px * scale);
        let ring = (radius + 1.5, (pitch - radius - 1.5).max(radius + 3.0));
        dot_colours(image, mirrored(dot.seen, flip, image.size()), 0.7 * radius, ring)
    });
    colours::grey_weights(&dots.collect::<Vec<_>>(), grid.polarity)
}

/// Canny's thresholds of the paper's first finger, until others are set.
const EDGE_LEVELS: (u16, u16) = (90, 120);

/// The sensor, without what is measured on the rectified image later.
pub(super) fn sensor(grid: &Grid, grey_weights_rgb: [f64; 3], image_px: SizePx, known: &KnownFacts) -> Sensor {
    let size = grid.size();
    let homography = grid.map.camera_from_plane.inverse().map(scaled_to_one).unwrap_or(Homography::IDENTITY);
    let (low_levels, high_levels) = EDGE_LEVELS;
    Sensor {
        name: known.name.clone(),
        description: known.description.clone(),
        serial: known.serial.clone(),
        image_px,
        flip: known.flip,
        grey_weights_rgb,
        polarity: grid.polarity,
        pitch_px: grid.pitch_px,
        pitch_mm: known.pitch_mm,
        gel_mm: None,
        marker_diameter_px: grid.diameter_px,
        skin: known.skin,
        bare_sharpness: None,
        edge_bands: match known.skin {
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

/// Sharpness of the untouched finger as the monitor measures it: the median of single frames, which the monitor
/// examines, too (their noise counts where the gel shows little), or that of their mean if it is sharper.
pub(super) fn bare_sharpness(sensor: &Sensor, frames: &[Frame<'_>], mean_rgb: &[u8]) -> Option<f64> {
    let mut builder = RestBuilder::new(sensor, &Settings::default(), sensor.image_px).ok()?;
    let pixels = Pixels::Rgb(Rgb::new(mean_rgb, sensor.image_px).ok()?);
    let of_mean = builder.look(&Frame { pixels, ..*frames.first()? }).sharpness;
    let of_frames: Vec<f64> = frames.iter().map(|frame| builder.look(frame).sharpness).collect();
    let sharpness = median(&of_frames).max(of_mean);
    sharpness.is_finite().then(|| (sharpness * 1000.0).round() / 1000.0)
}
