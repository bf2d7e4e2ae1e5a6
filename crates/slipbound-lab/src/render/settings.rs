//! Settings of a simulated camera and its skin; the two fingers we know.

use super::surroundings_kind::Surroundings;
use crate::contact::{GelEdge, Grid};
use serde::{Deserialize, Serialize};
use slipbound::image::SizePx;
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{EdgeBand, Flip, Polarity, Rectification, Sensor, Skin};

/// Radius of the rounded edge of a gel, in mm. An estimate: the load of a contact that reaches the edge is then within
/// a tenth of that of a gel that ends there, because the computed layer drags some gel beyond its edge along.
const GEL_EDGE_RADIUS_MM: f64 = 3.0;

/// Everything an image depends on, except the contact and the seeds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSettings {
    /// The facts of this finger for the method, at the size of the camera image; its pitch in mm is known.
    pub sensor: Sensor,
    /// Position of the camera: x and y in the finger frame, and its height over the surface of the gel, in mm.
    pub eye_mm: [f64; 3],
    /// Refractive index of gel and lens; 1 and above.
    pub refractive_index: f64,
    /// Half the size of the gel, in mm; beyond it nothing touches and the housing is visible.
    pub gel_half_mm: Vec2,
    /// The markers.
    pub dots: Dots,
    /// The texture of the skin.
    pub texture: Texture,
    /// The light.
    pub light: Light,
    /// Surroundings of the gel, and dirt on its lens.
    pub surroundings: Surroundings,
    /// Standard deviation of the optical blur in px of the camera image, 0.3 to 1.2.
    pub blur_px: f64,
    /// Standard deviation of the noise of a channel at level 128; it grows as the root of the level.
    pub noise_levels: f64,
    /// Whether scratches of the coating glint.
    pub glints: bool,
    /// Pixels of the camera that are stuck dark or bright.
    pub stuck_pixels_count: usize,
}

/// Markers: a jittered grid of dots in the middle of the gel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dots {
    /// Columns, along x.
    pub columns_count: usize,
    /// Rows, along y.
    pub rows_count: usize,
    /// Radius in mm.
    pub radius_mm: f64,
    /// Standard deviation of the position along x and along y, in mm.
    pub jitter_mm: f64,
    /// Standard deviation of the radius in mm.
    pub radius_jitter_mm: f64,
    /// Width over which the edge of a dot fades, in mm.
    pub edge_mm: f64,
    /// Share of the light that a dot absorbs, 0 to 1.
    pub darkness_fraction: f64,
}

/// Texture of the skin. Its contrast is `rest + gain (1 - exp(-p / p_ref))`, p being the pressure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texture {
    /// Width of a thread of the fabric, or of a grain of the coating, in mm.
    pub thread_mm: f64,
    /// Contrast without pressure, as a fraction of the light.
    pub rest_fraction: f64,
    /// Contrast gained under pressure, as a fraction of the light.
    pub gain_fraction: f64,
    /// Pressure at which 63 % of the gain is reached, in MPa.
    pub p_ref_mpa: f64,
}

/// Light of red, green and blue. A level is `background (1 + shade l . grad u_z)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Levels over the rectified image, per channel, as a polynomial of degree 4 in (u, v), which run from -1 to 1
    /// over its width and height: coefficients of 1, u, v, u2, uv, v2, u3, u2v, uv2, v3, u4, u3v, u2v2, uv3, v4.
    pub background_levels: [[f64; 15]; 3],
    /// l: sensitivity of each channel to the gradient of the depth along x and along y.
    pub toward: [[f64; 2]; 3],
    /// Strength of the shading.
    pub shade: f64,
    /// Levels of the glare at the far edge of the gel (greatest y), per channel.
    pub glare_levels: [f64; 3],
    /// Levels beyond the gel if the surroundings are a housing, per channel.
    pub housing_levels: [f64; 3],
}

impl CameraSettings {
    /// A camera by the words of a scene; any unknown camera is a GelSlim, any unknown surroundings are the camera's
    /// own.
    pub(crate) fn of_words(camera: &str, surroundings: &str) -> Self {
        let mut settings = match camera {
            "gelsight_mini" => CameraSettings::gelsight_mini(),
            _ => CameraSettings::gelslim(),
        };
        settings.surroundings = Surroundings::named(surroundings).unwrap_or(settings.surroundings);
        settings
    }

    /// GelSlim of the paper at 640 x 480, finger gs1: the facts of `sensors/gelslim.toml` at that size.
    ///
    /// Optics from the published homography: the camera is at 40 degrees, 36 mm over the gel. Pitch 1.5 mm and dots of
    /// 0.5 mm are assumed, as in the sensor file. Light: chosen so that medians of the image match those of the
    /// released one (green 204 top right, 126 top left, 148 middle right, 118 bottom; red 63 top left, falling to 0;
    /// blue 13 to 21). Texture: chosen by eye; see docs/simulator.md.
    pub fn gelslim() -> Self {
        let facts = Sensor {
            name: "gelslim_sim".into(),
            description: "Simulated GelSlim, optics of finger gs1; pitch_mm is exact, being ours.".into(),
            serial: None,
            image_px: SizePx::new(427, 320),
            flip: Flip::Vertical,
            grey_weights_rgb: [0.0, 0.5, 0.5],
            polarity: Polarity::Dark,
            pitch_px: 15.2,
            pitch_mm: Some(1.5),
            gel_mm: Some([44.0, 33.8]),
            marker_diameter_px: 5.3,
            skin: Skin::Fabric,
            bare_sharpness: Some(0.115), // 0.095 to 0.132 on single frames at rest, 0.27 and more with an imprint
            edge_bands: Vec::new(),
            rectification: Some(Rectification {
                homography: Homography([
                    [0.79809213, -0.33790120, 41.21788310],
                    [0.03669927, 0.84359564, -24.59355941],
                    [-0.00010275817, -0.00143881538, 1.0],
                ]),
                crop_px: [50, 0, 377, 320],
                distortion: None,
            }),
            defects_px: Vec::new(),
            shear: None,
        };
        // The released thresholds, which also fit the simulated weave at this size.
        let edge_bands = vec![
            EdgeBand { rows_to_fraction: 0.8875, low_levels: 90, high_levels: 120 },
            EdgeBand { rows_to_fraction: 1.0, low_levels: 50, high_levels: 70 },
        ];
        let sensor = facts.at_size(SizePx::new(640, 480)).expect("the same shape");
        CameraSettings {
            sensor: Sensor { edge_bands, ..sensor },
            eye_mm: [-0.9, -30.5, 36.1],
            refractive_index: 1.41,
            gel_half_mm: Vec2::new(22.0, 16.9),
            dots: Dots {
                columns_count: 29,
                rows_count: 20,
                radius_mm: 0.25,
                jitter_mm: 0.05,
                radius_jitter_mm: 0.015,
                edge_mm: 0.1,
                darkness_fraction: 0.62,
            },
            texture: Texture { thread_mm: 0.5, rest_fraction: 0.10, gain_fraction: 0.48, p_ref_mpa: 0.040 },
            light: Light {
                background_levels: [
                    [1.3, -11.0, -7.2, 17.0, 21.2, 5.8, -0.9, -12.2, -5.3, 3.4, -6.9, -0.7, 3.6, -5.5, -3.8],
                    [123.5, 21.2, -30.4, 7.3, -29.1, 21.2, -7.7, -2.8, 6.7, 6.5, -4.2, 8.5, -2.7, 0.7, -4.5],
                    [13.9, 0.2, 0.5, 0.8, -0.6, 5.0, -0.8, -1.6, 1.1, 0.7, -0.3, 1.5, -0.9, -1.2, -1.4],
                ],
                toward: [[0.9, 0.2], [0.0, 0.9], [0.2, -0.1]],
                shade: 1.2,
                glare_levels: [150.0, 110.0, 190.0],
                housing_levels: [3.0, 16.0, 7.0],
            },
            surroundings: Surroundings::Full,
            blur_px: 0.8,
            noise_levels: 0.15,
            glints: true,
            stuck_pixels_count: 6,
        }
    }

    /// GelSight Mini with its marker gel at 640 x 480, the whole view: dots, spacing and light of
    /// `sensors/gelsight_mini_wide.toml`, whose recording has half that size. The pitch follows from a view of 18.6 mm,
    /// as stated by the maker; the gel is 25.25 x 20.75 mm, as in public models of the finger. The camera position, 27
    /// mm straight over the gel, is assumed.
    pub fn gelsight_mini() -> Self {
        CameraSettings {
            sensor: Sensor {
                name: "gelsight_mini_sim".into(),
                description: "Simulated GelSight Mini with markers, whole view; pitch_mm is exact, being ours.".into(),
                serial: None,
                image_px: SizePx::new(640, 480),
                flip: Flip::None,
                grey_weights_rgb: [0.2, 0.5, 0.3],
                polarity: Polarity::Dark,
                pitch_px: 61.6,
                pitch_mm: Some(1.79),
                gel_mm: Some([25.25, 20.75]),
                marker_diameter_px: 22.0,
                skin: Skin::Smooth,
                bare_sharpness: Some(1.5), // at rest; 3.0 and more with an imprint that has edges, 1.6 with a round one
                edge_bands: Vec::new(),
                rectification: None,
                defects_px: Vec::new(),
                shear: None,
            },
            eye_mm: [0.0, 0.0, 27.0],
            refractive_index: 1.41,
            gel_half_mm: Vec2::new(12.625, 10.375),
            dots: Dots {
                columns_count: 10,
                rows_count: 7,
                radius_mm: 0.32,
                jitter_mm: 0.018,
                radius_jitter_mm: 0.0135,
                edge_mm: 0.054,
                darkness_fraction: 0.75,
            },
            texture: Texture { thread_mm: 0.134, rest_fraction: 0.012, gain_fraction: 0.0, p_ref_mpa: 1.0 },
            light: Light {
                background_levels: MINI_BACKGROUND,
                toward: [[0.0, 0.9], [-0.8, -0.45], [0.8, -0.45]],
                shade: 1.8,
                glare_levels: [0.0; 3],
                housing_levels: [20.0, 24.0, 24.0],
            },
            surroundings: Surroundings::Housing, // its gel fills the image
            blur_px: 0.9,
            noise_levels: 2.5,
            glints: false,
            stuck_pixels_count: 4,
        }
    }

    /// Edge of the gel for the contact; None if it is beyond the grid of the contact.
    pub(crate) fn gel_edge(&self, grid: &Grid) -> Option<GelEdge> {
        let (half_mm, room_mm) = (self.gel_half_mm, grid.half_size_mm());
        (half_mm.x < room_mm.x || half_mm.y < room_mm.y).then_some(GelEdge { half_mm, radius_mm: GEL_EDGE_RADIUS_MM })
    }

    /// The same camera with another number of rows and the same field of view: 320 are those of the released GelSlim
    /// frames, 240 those of `sensors/gelsight_mini_wide.toml`. The blur of the lens shrinks with the image, to 0.3 px
    /// at least; the noise per pixel does not change.
    pub(crate) fn at_height(self, height_px: usize) -> Self {
        let size = self.sensor.image_px;
        let width_px = (size.width * height_px + size.height / 2) / size.height;
        let sensor = self.sensor.at_size(SizePx::new(width_px, height_px)).expect("the same shape");
        let scale = height_px as f64 / size.height as f64;
        CameraSettings { sensor, blur_px: (self.blur_px * scale).max(0.3), ..self }
    }
}

/// Light of the press recording behind `sensors/gelsight_mini_wide.toml`, by eye: teal above, violet in the middle,
/// brown below, darker towards the sides.
const MINI_BACKGROUND: [[f64; 15]; 3] = [
    [108.0, -4.0, 38.0, -14.0, 0.0, -32.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [102.0, 2.0, 6.0, -12.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [128.0, 4.0, -18.0, -14.0, 0.0, -12.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
];
