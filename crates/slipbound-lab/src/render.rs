//! The camera behind the gel: surface of the gel -> colour image, and the true position of every marker in it.
//!
//! ```text
//!   contact cells: displacement, pressure
//!        | which piece of gel is seen where, its slope, texture contrast: at nodes a few pixels apart (nodes.rs)
//!        v
//!   pixels: light * (1 + shade + texture) * (1 - dot), blurred, with noise
//! ```
//!
//! The model is described in docs/simulator.md, "The camera". Same settings and seeds, same bytes.

mod atlas;
mod nodes;
mod rows;
mod settings;
mod surface;
mod surroundings;
mod surroundings_kind;
mod view;

pub use settings::{CameraSettings, Dots, Light, Texture};
pub use surface::Surface;
pub(crate) use surroundings_kind::SURROUNDINGS;
pub use surroundings_kind::Surroundings;

use crate::random::Random;
use atlas::Atlas;
use nodes::{LANES, Nodes};
use rows::Skin;
use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;
use std::ops::Range;
use surroundings::{Backdrop, bell};
use view::View;

/// Noise samples that are stored and reused from different offsets; a power of two.
const NOISE_COUNT: usize = 1 << 15;
/// Stream of the frame noise, combined with its seed.
const NOISE: u64 = 0x5EED;

/// One camera with its skin; owns all memory that a frame needs.
#[derive(Debug, Clone)]
pub struct Renderer {
    settings: CameraSettings,
    seed: u64,
    view: View,
    atlas: Atlas,
    nodes: Nodes,
    /// Light of every pixel, levels, including glare. Each row is planar: red, then green, then blue, as are all rows
    /// below.
    light_levels: Vec<f32>,
    /// Gel coverage of every pixel: 0 beyond the gel, 1 on it.
    gel: Vec<f32>,
    /// The pixels of each row that show the gel; the others show the housing, which never changes.
    spans: Vec<Range<usize>>,
    seen: [Vec<f32>; LANES],
    dots: Vec<f32>,
    threads: Vec<f32>,
    /// A row of levels before blur and noise.
    ideal: Vec<f32>,
    /// The last five rows, blurred along x.
    softened: [Vec<f32>; 5],
    blur: [f32; 3],
    /// A row of levels before noise, and of bytes after noise.
    levels: Vec<f32>,
    bytes: Vec<u8>,
    /// Every third noise sample, starting from the first, the second and the third: a colour of a row is one run of it.
    noise: [Vec<f32>; 3],
    stuck: Vec<(usize, u8)>,
    /// The levels of the last frame without noise, once two frames in a row show the gel unmoved; otherwise empty.
    still_levels: Vec<f32>,
}

impl Renderer {
    /// GelSlim of the paper; the seed determines the positions of dots, threads and defects.
    pub fn gelslim(seed: u64) -> Self {
        Self::new(CameraSettings::gelslim(), seed)
    }

    /// GelSight Mini with markers.
    pub fn gelsight_mini(seed: u64) -> Self {
        Self::new(CameraSettings::gelsight_mini(), seed)
    }

    /// A camera and a skin; the seed determines the positions of the skin's dots, threads and defects.
    pub fn new(settings: CameraSettings, seed: u64) -> Self {
        let mut random = Random::of(seed, 0xCA3E);
        let view = View::new(&settings);
        let size = settings.sensor.image_px;
        let atlas = Atlas::new(&settings, &mut random);
        let backdrop = Backdrop::new(&settings, seed);
        let mut light_levels = vec![0.0; 3 * size.area()];
        let mut gel = Vec::with_capacity(size.area());
        for (y, row) in light_levels.chunks_exact_mut(3 * size.width).enumerate() {
            for x in 0..size.width {
                let (levels, share) = pixel(&settings, &view, &backdrop, y * size.width + x);
                levels.iter().enumerate().for_each(|(c, level)| row[c * size.width + x] = *level);
                gel.push(share);
            }
        }
        let on = |share: &f32| *share > 0.0;
        let span = |row: &[f32]| match (row.iter().position(on), row.iter().rposition(on)) {
            (Some(first), Some(last)) => first..last + 1,
            _ => 0..0,
        };
        let spans: Vec<_> = gel.chunks_exact(size.width).map(span).collect();
        let tap = |d: f64| bell(d / settings.blur_px);
        let sum = tap(0.0) + 2.0 * tap(1.0) + 2.0 * tap(2.0);
        let blur = [0.0, 1.0, 2.0].map(|d| (tap(d) / sum) as f32);
        let stuck = (0..settings.stuck_pixels_count)
            .map(|i| ((random.next_u64() % size.area() as u64) as usize, if i % 2 == 0 { 250 } else { 2 }))
            .collect();
        let normal = |r: &mut Random| ((0..12).map(|_| r.fraction()).sum::<f64>() - 6.0) as f32;
        let noise: Vec<f32> = (0..NOISE_COUNT).map(|_| normal(&mut random)).collect();
        Renderer {
            noise: [0, 1, 2].map(|first| noise[first..].iter().copied().step_by(3).collect()),
            nodes: Nodes::new(&settings, &view, &spans),
            light_levels,
            gel,
            spans,
            seen: std::array::from_fn(|_| vec![0.0; size.width + 8]),
            dots: vec![0.0; size.width],
            threads: vec![0.0; size.width],
            ideal: vec![0.0; 3 * size.width],
            softened: std::array::from_fn(|_| vec![0.0; 3 * size.width]),
            levels: vec![0.0; 3 * size.width],
            bytes: vec![0; 3 * size.width],
            blur,
            stuck,
            still_levels: Vec::new(),
            atlas,
            view,
            seed,
            settings,
        }
    }

    /// The same camera and skin with other surroundings.
    #[must_use]
    pub fn with_surroundings(self, surroundings: Surroundings) -> Self {
        Self::new(CameraSettings { surroundings, ..self.settings }, self.seed)
    }

    /// Size of the images.
    pub fn size(&self) -> SizePx {
        self.settings.sensor.image_px
    }

    /// The matching sensor facts for the method.
    pub fn sensor(&self) -> Sensor {
        self.settings.sensor.clone()
    }

    /// Positions of the markers on the untouched gel, in the finger frame.
    pub fn markers_at_rest_mm(&self) -> &[Vec2] {
        self.atlas.markers_mm()
    }

    /// Position of the centre of a marker in the camera image, as delivered.
    pub fn marker_px(&self, marker: usize, surface: &Surface) -> Vec2 {
        self.view.camera_from_plane(self.view.seen_at(self.markers_at_rest_mm()[marker], surface))
    }

    /// Its position in the rectified image.
    pub fn marker_rectified_px(&self, marker: usize, surface: &Surface) -> Vec2 {
        self.view.rectified_from_plane(self.view.seen_at(self.markers_at_rest_mm()[marker], surface))
    }

    /// Position in the rectified image of the point of the gel that is at `rest_mm` when nothing touches the gel.
    pub fn rectified_px(&self, rest_mm: Vec2, surface: &Surface) -> Vec2 {
        self.view.rectified_from_plane(self.view.seen_at(rest_mm, surface))
    }

    /// Draws the gel; `frame_seed` determines the noise. `rgb`: rows of red, green, blue without gaps.
    pub fn render(&mut self, surface: &Surface, frame_seed: u64, rgb: &mut [u8]) {
        assert_eq!(rgb.len(), 3 * self.size().area(), "picture of another size");
        if self.nodes.look(surface, &self.settings.texture) {
            self.still_levels.clear();
            self.expose(frame_seed, rgb, false);
        } else if self.still_levels.is_empty() {
            self.still_levels.resize(rgb.len(), 0.0);
            self.expose(frame_seed, rgb, true);
        } else {
            self.expose_again(frame_seed, rgb);
        }
    }

    /// Light of a row, without blur and noise, into `ideal`.
    fn illuminate(&mut self, y: usize) {
        let width = self.size().width;
        let light_levels = &self.light_levels[3 * y * width..][..3 * width];
        let span = self.spans[y].clone();
        if span.is_empty() {
            return self.ideal.copy_from_slice(light_levels);
        }
        self.nodes.spread(y, span.clone(), &mut self.seen);
        let [x_mm, y_mm, slope_x, slope_y, contrast] = self.seen.each_ref().map(|lane| &lane[span.clone()]);
        let (dots, threads) = (&mut self.dots[..span.len()], &mut self.threads[..span.len()]);
        self.atlas.fetch([x_mm, y_mm], dots, threads);
        let gel = &self.gel[y * width..][span.clone()];
        let skin = Skin { slope: [slope_x, slope_y], contrast, threads, dots, gel };
        let Light { toward, shade, .. } = &self.settings.light;
        let darkness = self.settings.dots.darkness_fraction as f32;
        let colours = self.ideal.chunks_exact_mut(width).zip(light_levels.chunks_exact(width));
        for ((ideal, light), toward) in colours.zip(toward) {
            let toward = toward.map(|t| (shade * t) as f32);
            ideal[..span.start].copy_from_slice(&light[..span.start]);
            ideal[span.end..].copy_from_slice(&light[span.end..]);
            rows::lit(skin, toward, darkness, &light[span.clone()], &mut ideal[span.clone()]);
        }
    }

    /// The blur of the lens, five taps each way, and the noise of the sensor with its stuck pixels. `keep`: whether the
    /// levels without noise are kept for the next frame.
    fn expose(&mut self, frame_seed: u64, rgb: &mut [u8], keep: bool) {
        let mut random = Random::of(frame_seed, NOISE);
        let SizePx { width, height } = self.size();
        let line = 3 * width;
        for below in 0..height + 2 {
            if below < height {
                self.illuminate(below);
                let softened = self.softened[below % 5].chunks_exact_mut(width);
                for (ideal, softened) in self.ideal.chunks_exact(width).zip(softened) {
                    rows::blurred_along(ideal, self.blur, softened);
                }
            }
            let Some(y) = below.checked_sub(2) else { continue };
            // Beyond the border the outermost rows repeat.
            let row = |y: usize| &self.softened[y.min(height - 1) % 5][..line];
            let five = [row(y.saturating_sub(2)), row(y.saturating_sub(1)), row(y), row(y + 1), row(y + 2)];
            rows::blurred_across(five, self.blur, &mut self.levels);
            if keep {
                self.still_levels[y * line..][..line].copy_from_slice(&self.levels);
            }
            self.add_sensor_noise(&mut random, &mut rgb[y * line..][..line]);
        }
        self.stick(rgb);
    }

    /// Another frame of the unmoved gel: only the noise is new.
    fn expose_again(&mut self, frame_seed: u64, rgb: &mut [u8]) {
        let mut random = Random::of(frame_seed, NOISE);
        let line = 3 * self.size().width;
        for (y, out) in rgb.chunks_exact_mut(line).enumerate() {
            self.levels.copy_from_slice(&self.still_levels[y * line..][..line]);
            self.add_sensor_noise(&mut random, out);
        }
        self.stick(rgb);
    }

    /// The row of `levels` with the noise of the sensor.
    fn add_sensor_noise(&mut self, random: &mut Random, rgb: &mut [u8]) {
        let (width, noise_levels) = (self.size().width, self.settings.noise_levels as f32);
        let start = random.next_u64() as usize % (NOISE_COUNT - 3 * width);
        let colours = self.levels.chunks_exact(width).zip(self.bytes.chunks_exact_mut(width));
        for (c, (levels, bytes)) in colours.enumerate() {
            let noise = &self.noise[(start + c) % 3][(start + c) / 3..][..width];
            rows::noisy(levels, noise, noise_levels, bytes);
        }
        let (red, rest) = self.bytes.split_at(width);
        let (green, blue) = rest.split_at(width);
        rows::woven(red, green, blue, rgb);
    }

    fn stick(&self, rgb: &mut [u8]) {
        for &(pixel, level) in &self.stuck {
            rgb[3 * pixel..3 * pixel + 3].fill(level);
        }
    }
}

/// Light of red, green and blue at pixel `i`, in levels, and its gel coverage.
fn pixel(settings: &CameraSettings, view: &View, backdrop: &Backdrop, i: usize) -> ([f32; 3], f32) {
    let size = settings.sensor.image_px;
    let at = Vec2::new((i % size.width) as f64, (i / size.width) as f64);
    let plane = view.plane_from_camera(at);
    let rectified = settings.sensor.rectified_px();
    let half = Vec2::new(rectified.width as f64, rectified.height as f64) / 2.0;
    let place = view.rectified_from_plane(plane);
    let (u, v) = (place.x / half.x - 1.0, place.y / half.y - 1.0);
    let (u, v) = (u.clamp(-1.3, 1.3), v.clamp(-1.3, 1.3));
    let powers = [
        1.0,
        u,
        v,
        u * u,
        u * v,
        v * v,
        u * u * u,
        u * u * v,
        u * v * v,
        v * v * v,
        u * u * u * u,
        u * u * u * v,
        u * u * v * v,
        u * v * v * v,
        v * v * v * v,
    ];
    let light = &settings.light;
    let gel = backdrop.gel(plane);
    if gel <= 0.0 {
        return (backdrop.beyond(plane).map(|level| level as f32), 0.0);
    }
    let glare = bell((settings.gel_half_mm.y - 0.9 - plane.y) / 0.7);
    let glint = if settings.glints { glint(plane) } else { 0.0 };
    let lit = std::array::from_fn(|c| {
        let level: f64 = powers.iter().zip(&light.background_levels[c]).map(|(p, b)| p * b).sum();
        level.max(1.0) + light.glare_levels[c] * glare + 120.0 * glint
    });
    if gel >= 1.0 {
        return (backdrop.on_gel(plane, lit).map(|level| level as f32), 1.0);
    }
    let (lit, beyond) = (backdrop.on_gel(plane, lit), backdrop.beyond(plane));
    (std::array::from_fn(|c| (beyond[c] + (lit[c] - beyond[c]) * gel) as f32), gel as f32)
}

/// Two scratches of the coating near a corner.
fn glint(plane_mm: Vec2) -> f64 {
    [Vec2::new(-13.2, -11.6), Vec2::new(-12.4, -11.3)]
        .iter()
        .map(|&middle| {
            let d = plane_mm - middle;
            let (along, across) = (d.x * 0.5 + d.y * 0.87, d.x * 0.87 - d.y * 0.5);
            let scaled = Vec2::new(along / 0.7, across / 0.07);
            // Where the result would be below the least representable number.
            if scaled.length_squared() > 1500.0 { 0.0 } else { bell(scaled.length()) }
        })
        .sum()
}
