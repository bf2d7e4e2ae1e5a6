//! Images of a finger with known ground truth: dots at given positions, a contact patch, noise, JPEG. A painter, not a
//! simulator: the test defines all motion.
#![allow(dead_code)] // each test uses its part

use slipbound::image::{Frame, Pixels, Rgb, SizePx};
use slipbound::plane::Vec2;
use slipbound::sensor::{EdgeBand, Flip, Polarity, Sensor, Skin};

/// Random numbers from a seed: xorshift64*, and a normal distribution by the sum of twelve.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// Uniform in 0..1.
    pub fn even(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal, mean 0, standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }
}

/// A contact: an ellipse that moves with the object, seen as shading (smooth gel) or as pressed weave (fabric).
#[derive(Clone, Copy)]
pub struct Touch {
    pub centre: Vec2,
    pub radii_px: Vec2,
    pub strength_levels: f64,
}

impl Touch {
    /// 0 in the middle, 1 at the rim, more outside.
    pub fn depth(&self, p: Vec2) -> f64 {
        let d = p - self.centre;
        Vec2::new(d.x / self.radii_px.x, d.y / self.radii_px.y).length()
    }
}

/// Parameters of a painted finger.
#[derive(Clone)]
pub struct Painter {
    pub sensor: Sensor,
    pub rest: Vec<Vec2>,
    pub contrast_levels: f64,
    /// Blur of the dots' edges: standard deviation in px.
    pub edge_px: f64,
    pub noise_levels: f64,
    pub jpeg_quality: Option<u8>,
}

impl Painter {
    /// A finger with a grid of dots, each displaced by up to `jitter_px`.
    pub fn new(size: SizePx, pitch_px: f64, diameter_px: f64, skin: Skin, jitter_px: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let margin = 0.75 * pitch_px;
        let along = |px: usize| ((px as f64 - 2.0 * margin) / pitch_px).floor() as usize + 1;
        let (columns, rows) = (along(size.width), along(size.height));
        let start = |px: usize, n: usize| (px as f64 - (n - 1) as f64 * pitch_px) / 2.0;
        let (x0, y0) = (start(size.width, columns), start(size.height, rows));
        let rest = (0..rows * columns)
            .map(|i| {
                let grid = Vec2::new((i % columns) as f64, (i / columns) as f64) * pitch_px + Vec2::new(x0, y0);
                grid + Vec2::new(random.even() - 0.5, random.even() - 0.5) * (2.0 * jitter_px)
            })
            .collect();
        let edge_bands = vec![EdgeBand { rows_to_fraction: 1.0, low_levels: 90, high_levels: 120 }];
        let sensor = Sensor {
            name: "painted".into(),
            description: "drawn by the tests".into(),
            serial: None,
            image_px: size,
            flip: Flip::None,
            grey_weights_rgb: [1.0 / 3.0; 3],
            polarity: Polarity::Dark,
            pitch_px,
            pitch_mm: Some(1.5),
            gel_mm: None,
            marker_diameter_px: diameter_px,
            skin,
            bare_sharpness: None,
            edge_bands: if skin == Skin::Fabric { edge_bands } else { Vec::new() },
            rectification: None,
            defects_px: Vec::new(),
            shear: None,
        };
        Painter { sensor, rest, contrast_levels: 60.0, edge_px: 0.8, noise_levels: 3.0, jpeg_quality: Some(85) }
    }

    /// The depth of a dot's shadow at a distance from its centre: a disc with a blurred edge, 0 to 1.
    pub fn shadow(&self, distance_px: f64) -> f64 {
        0.5 * libm::erfc(
            (distance_px - self.sensor.marker_diameter_px / 2.0) / (self.edge_px * std::f64::consts::SQRT_2),
        )
    }

    /// The image without noise: light, contact, dots; levels of red, green and blue.
    pub fn ideal(&self, now: &[Vec2], touch: Option<&Touch>) -> Vec<[f32; 3]> {
        let size = self.sensor.image_px;
        let (w, h) = (size.width as f64, size.height as f64);
        let mut out: Vec<[f32; 3]> = (0..size.area())
            .map(|i| {
                let (x, y) = ((i % size.width) as f64, (i / size.width) as f64);
                let mut rgb = [150.0 - 40.0 * x / w, 120.0 + 30.0 * y / h, 130.0 + 30.0 * x / w - 20.0 * y / h];
                if let Some(touch) = touch {
                    touch_up(&mut rgb, touch, Vec2::new(x, y), self.sensor.skin, self.sensor.pitch_px);
                }
                rgb.map(|v| v as f32)
            })
            .collect();
        let reach = self.sensor.marker_diameter_px / 2.0 + 5.0 * self.edge_px;
        for &dot in now {
            let span = |c: f64, end: usize| {
                let from = (c - reach).ceil().clamp(0.0, end as f64) as usize;
                from..(c + reach + 1.0).floor().clamp(from as f64, end as f64) as usize
            };
            for y in span(dot.y, size.height) {
                for x in span(dot.x, size.width) {
                    let shadow = self.shadow((Vec2::new(x as f64, y as f64) - dot).length()) * self.contrast_levels;
                    out[y * size.width + x].iter_mut().for_each(|v| *v -= shadow as f32);
                }
            }
        }
        out
    }

    /// The image a camera would deliver: noise from a seed, then JPEG.
    pub fn paint(&self, now: &[Vec2], touch: Option<&Touch>, seed: u64) -> Vec<u8> {
        let mut random = Random::new(seed.wrapping_add(77));
        let size = self.sensor.image_px;
        let mut rgb: Vec<u8> = Vec::with_capacity(3 * size.area());
        for levels in self.ideal(now, touch) {
            // The same noise in all three channels, so that the grey image has exactly this noise.
            let noise = random.normal() * self.noise_levels;
            rgb.extend(levels.map(|v| (f64::from(v) + noise + 0.5) as u8)); // rounded, and within 0 to 255
        }
        match self.jpeg_quality {
            None => rgb,
            Some(quality) => decode(&encode(&rgb, size, quality)),
        }
    }

    /// The positions of the dots at rest.
    pub fn at_rest(&self) -> Vec<Vec2> {
        self.rest.clone()
    }
}

/// Shading of a pressed dome on a smooth gel; the weave of a pressed fabric.
fn touch_up(rgb: &mut [f64; 3], touch: &Touch, p: Vec2, skin: Skin, pitch_px: f64) {
    let depth = touch.depth(p);
    let k = touch.strength_levels;
    // Exact to the last bit, and skips most of the image: erfc is exactly 2 below -6, and negligible above 6.
    let inside =
        if (0.5..1.5).contains(&depth) { 0.5 * libm::erfc((depth - 1.0) * 12.0) } else { f64::from(depth < 0.5) };
    if inside < 1e-4 {
        return;
    }
    match skin {
        Skin::Smooth => {
            let slope = (p - touch.centre) / (touch.radii_px.length() / std::f64::consts::SQRT_2) * (k * inside);
            rgb[0] += slope.x + 0.5 * k * inside;
            rgb[1] += slope.y;
            rgb[2] -= slope.x + 0.4 * k * inside;
        }
        Skin::Fabric => {
            let q = (p - touch.centre) * (2.0 * std::f64::consts::PI / (0.38 * pitch_px));
            let weave = libm::sin(q.x) * libm::sin(q.y) * k * inside;
            rgb.iter_mut().for_each(|v| *v += weave);
        }
    }
}

pub fn encode(rgb: &[u8], size: SizePx, quality: u8) -> Vec<u8> {
    let mut jpeg = Vec::new();
    jpeg_encoder::Encoder::new(&mut jpeg, quality)
        .encode(rgb, size.width as u16, size.height as u16, jpeg_encoder::ColorType::Rgb)
        .expect("a picture can be encoded");
    jpeg
}

fn decode(jpeg: &[u8]) -> Vec<u8> {
    zune_jpeg::JpegDecoder::new(std::io::Cursor::new(jpeg)).decode().expect("our own JPEG can be decoded")
}

/// A frame of painted pixels.
pub fn frame(rgb: &[u8], size: SizePx, seq: u64) -> Frame<'_> {
    Frame { pixels: Pixels::Rgb(Rgb::new(rgb, size).expect("a whole picture")), seq, time_ns: None }
}
