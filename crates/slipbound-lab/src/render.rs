//! The camera behind the gel: surface of the gel -> colour picture, and the true place of every marker in it.
//!
//! ```text
//!   contact cells: displacement, pressure
//!        | which piece of gel is seen where (view.rs), shading, texture contrast: once a node, 0.4 mm apart
//!        v
//!   pixels: light * (1 + shade + texture) * (1 - dot), blurred, with noise
//! ```
//!
//! The model is that of docs/simulator.md, "The camera". Same settings and seeds, same bytes.

mod atlas;
mod settings;
mod surface;
mod view;

pub use settings::{CameraSettings, Dots, Light, Texture};
pub use surface::Surface;

use crate::contact::Grid;
use crate::random::Random;
use atlas::Atlas;
use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;
use view::View;

/// Distance of the nodes at which geometry and light are computed once a frame, in mm.
const NODE_MM: f64 = 0.4;
/// Numbers kept before they repeat at another offset; a power of two.
const NOISE_COUNT: usize = 1 << 15;
/// What a frame needs at a node: offset of the piece seen there (x, y in mm), shade of red, green and blue, contrast
/// of the texture; two spare lanes.
type Node = [f32; 8];

/// What never changes at a pixel.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    /// The plane of the gel there, mm.
    plane_mm: [f32; 2],
    /// Light of red, green and blue, levels; glare included.
    light_levels: [f32; 3],
    /// 0 beyond the gel, 1 on it.
    gel: f32,
}

/// One camera with its skin; owns all memory a frame needs.
#[derive(Debug, Clone)]
pub struct Renderer {
    settings: CameraSettings,
    view: View,
    atlas: Atlas,
    pixels: Vec<Pixel>,
    nodes: Vec<Node>,
    columns: usize,
    origin_mm: Vec2,
    /// Which pixels show the gel; the others show the housing, which never changes.
    on_gel: Vec<u32>,
    /// Levels before blur and noise.
    ideal: Vec<f32>,
    /// The last five rows, blurred along themselves.
    softened: [Vec<f32>; 5],
    blur: [f32; 3],
    noise: Vec<f32>,
    stuck: Vec<(usize, u8)>,
}

impl Renderer {
    /// GelSlim of the paper; the seed decides where its dots, threads and defects lie.
    pub fn gelslim(seed: u64) -> Self {
        Self::new(CameraSettings::gelslim(), seed)
    }

    /// GelSight Mini with markers.
    pub fn gelsight_mini(seed: u64) -> Self {
        Self::new(CameraSettings::gelsight_mini(), seed)
    }

    /// A camera and a skin; the seed decides where the dots, threads and defects of the skin lie.
    pub fn new(settings: CameraSettings, seed: u64) -> Self {
        let mut random = Random::of(seed, 0xCA3E);
        let view = View::new(&settings);
        let size = settings.sensor.image_px;
        let atlas = Atlas::new(&settings, &mut random);
        let pixels: Vec<Pixel> = (0..size.area()).map(|i| pixel(&settings, &view, size, i)).collect();
        let reach = |axis: usize| {
            let all = || pixels.iter().map(move |p| f64::from(p.plane_mm[axis]));
            (all().fold(f64::MAX, f64::min), all().fold(f64::MIN, f64::max))
        };
        let ((left, right), (top, bottom)) = (reach(0), reach(1));
        let count = |from: f64, to: f64| ((to - from) / NODE_MM).ceil() as usize + 2;
        let (columns, rows) = (count(left, right), count(top, bottom));
        let tap = |d: f64| (-0.5 * (d / settings.blur_px).powi(2)).exp();
        let sum = tap(0.0) + 2.0 * tap(1.0) + 2.0 * tap(2.0);
        let blur = [0.0, 1.0, 2.0].map(|d| (tap(d) / sum) as f32);
        let stuck = (0..settings.stuck_pixels_count)
            .map(|i| ((random.next_u64() % size.area() as u64) as usize, if i % 2 == 0 { 250 } else { 2 }))
            .collect();
        let normal = |r: &mut Random| ((0..12).map(|_| r.fraction()).sum::<f64>() - 6.0) as f32;
        Renderer {
            noise: (0..NOISE_COUNT).map(|_| normal(&mut random)).collect(),
            nodes: vec![[0.0; 8]; columns * rows],
            columns,
            origin_mm: Vec2::new(left, top),
            on_gel: (0..size.area() as u32).filter(|&i| pixels[i as usize].gel > 0.0).collect(),
            ideal: pixels.iter().flat_map(|p| p.light_levels).collect(),
            softened: std::array::from_fn(|_| vec![0.0; 3 * size.width]),
            blur,
            stuck,
            pixels,
            atlas,
            view,
            settings,
        }
    }

    /// Size of the pictures.
    pub fn size(&self) -> SizePx {
        self.settings.sensor.image_px
    }

    /// The matching facts for the method.
    pub fn sensor(&self) -> Sensor {
        self.settings.sensor.clone()
    }

    /// Where the markers lie on the untouched gel, in the finger frame.
    pub fn markers_at_rest_mm(&self) -> &[Vec2] {
        self.atlas.markers_mm()
    }

    /// Where the camera image, as delivered, shows the middle of a marker.
    pub fn marker_px(&self, marker: usize, surface: &Surface) -> Vec2 {
        self.view.camera_from_plane(self.view.seen_at(self.markers_at_rest_mm()[marker], surface))
    }

    /// Where the rectified image shows it.
    pub fn marker_rectified_px(&self, marker: usize, surface: &Surface) -> Vec2 {
        self.view.rectified_from_plane(self.view.seen_at(self.markers_at_rest_mm()[marker], surface))
    }

    /// Where the rectified image shows a point of the gel that lies at `rest_mm` when nothing touches it.
    pub fn rectified_px(&self, rest_mm: Vec2, surface: &Surface) -> Vec2 {
        self.view.rectified_from_plane(self.view.seen_at(rest_mm, surface))
    }

    /// Draws the gel; `frame_seed` decides the noise. `rgb`: rows of red, green, blue without gaps.
    pub fn render(&mut self, surface: &Surface, frame_seed: u64, rgb: &mut [u8]) {
        assert_eq!(rgb.len(), 3 * self.size().area(), "picture of another size");
        self.look(surface);
        self.shine();
        self.expose(frame_seed, rgb);
    }

    /// What is seen at each node.
    fn look(&mut self, surface: &Surface) {
        let slopes = Slopes::of(surface.grid);
        let texture = &self.settings.texture;
        for (i, node) in self.nodes.iter_mut().enumerate() {
            let at_mm = self.origin_mm + Vec2::new((i % self.columns) as f64, (i / self.columns) as f64) * NODE_MM;
            let rest_mm = self.view.piece_seen(at_mm, surface);
            let offset = rest_mm - at_mm;
            let slope = slopes.at(surface, rest_mm);
            let pressure_mpa = surface.pressure_at(rest_mm);
            let gain = texture.gain_fraction * (1.0 - (-pressure_mpa / texture.p_ref_mpa).exp());
            let light = &self.settings.light;
            let shade = |c: usize| light.shade * (light.toward[c][0] * slope.x + light.toward[c][1] * slope.y);
            *node = [
                offset.x as f32,
                offset.y as f32,
                shade(0) as f32,
                shade(1) as f32,
                shade(2) as f32,
                (texture.rest_fraction + gain) as f32,
                0.0,
                0.0,
            ];
        }
    }

    /// Light of every pixel on the gel, without blur and noise.
    fn shine(&mut self) {
        let per_mm = (1.0 / NODE_MM) as f32;
        let (left, top) = (self.origin_mm.x as f32, self.origin_mm.y as f32);
        let darkness = self.settings.dots.darkness_fraction as f32;
        for &i in &self.on_gel {
            let pixel = &self.pixels[i as usize];
            let [x_mm, y_mm] = pixel.plane_mm;
            let (x, y) = ((x_mm - left) * per_mm, (y_mm - top) * per_mm);
            let (column, row) = (x as usize, y as usize);
            let (fx, fy) = (x - column as f32, y - row as f32);
            let upper = row * self.columns + column;
            let (above, below) = (&self.nodes[upper..upper + 2], &self.nodes[upper + self.columns..][..2]);
            let seen: Node = std::array::from_fn(|k| {
                let a = above[0][k] + (above[1][k] - above[0][k]) * fx;
                let b = below[0][k] + (below[1][k] - below[0][k]) * fx;
                a + (b - a) * fy
            });
            let (dot, thread) = self.atlas.at(x_mm + seen[0], y_mm + seen[1]);
            let (contrast, left_over) = (seen[5] * thread, 1.0 - darkness * dot * pixel.gel);
            let out = &mut self.ideal[3 * i as usize..][..3];
            for channel in 0..3 {
                let relief = 1.0 + (seen[2 + channel] + contrast) * pixel.gel;
                out[channel] = pixel.light_levels[channel] * relief * left_over;
            }
        }
    }

    /// The blur of the lens, five taps each way, and the noise of the sensor with its stuck pixels.
    fn expose(&mut self, frame_seed: u64, rgb: &mut [u8]) {
        let mut random = Random::of(frame_seed, 0x5EED);
        let SizePx { width, height } = self.size();
        let line = 3 * width;
        let noise_levels = self.settings.noise_levels as f32;
        for below in 0..height + 2 {
            if below < height {
                soften(&self.ideal[below * line..][..line], self.blur, &mut self.softened[below % 5]);
            }
            let Some(y) = below.checked_sub(2) else { continue };
            // Beyond the border, the outermost rows once more.
            let row = |y: usize| &self.softened[y.min(height - 1) % 5][..line];
            let rows = [row(y.saturating_sub(2)), row(y.saturating_sub(1)), row(y), row(y + 1), row(y + 2)];
            let start = random.next_u64() as usize % (NOISE_COUNT - line);
            let out = &mut rgb[y * line..][..line];
            expose_row(rows, self.blur, &self.noise[start..start + line], noise_levels, out);
        }
        for &(pixel, level) in &self.stuck {
            rgb[3 * pixel..3 * pixel + 3].fill(level);
        }
    }
}

/// Blurs a row of interleaved colours along itself; its outermost two pixels are left as they are.
fn soften(from: &[f32], [middle, near, far]: [f32; 3], to: &mut [f32]) {
    to.copy_from_slice(from);
    let inner = from.len() - 12;
    let (a, b, c, d, e) = (&from[..inner], &from[3..], &from[6..], &from[9..], &from[12..]);
    let taps = a.iter().zip(b).zip(c).zip(d).zip(e);
    for (out, ((((a, b), c), d), e)) in to[6..6 + inner].iter_mut().zip(taps) {
        *out = far * (a + e) + near * (b + d) + middle * c;
    }
}

/// Blurs five rows across, adds noise that grows as the root of the level, and rounds.
fn expose_row(rows: [&[f32]; 5], [middle, near, far]: [f32; 3], noise: &[f32], noise_levels: f32, out: &mut [u8]) {
    let [a, b, c, d, e] = rows;
    let taps = a.iter().zip(b).zip(c).zip(d).zip(e).zip(noise);
    for (out, (((((a, b), c), d), e), n)) in out.iter_mut().zip(taps) {
        let level = far * (a + e) + near * (b + d) + middle * c;
        let spread = noise_levels * (level.max(4.0) * (1.0 / 128.0)).sqrt();
        *out = (level + spread * n + 0.5).clamp(0.0, 255.0) as u8;
    }
}

/// Gradient of the depth at a point of the gel, by differences over a cell each way.
struct Slopes {
    step_mm: f64,
}

impl Slopes {
    fn of(grid: &Grid) -> Self {
        Slopes { step_mm: grid.cell_mm }
    }

    fn at(&self, surface: &Surface, rest_mm: Vec2) -> Vec2 {
        let depth = |d: Vec2| surface.displacement_at(rest_mm + d).depth_mm;
        let (x, y) = (Vec2::new(self.step_mm, 0.0), Vec2::new(0.0, self.step_mm));
        Vec2::new(depth(x) - depth(-x), depth(y) - depth(-y)) / (2.0 * self.step_mm)
    }
}

/// What never changes at pixel `i`.
fn pixel(settings: &CameraSettings, view: &View, size: SizePx, i: usize) -> Pixel {
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
    // How far inside the gel, in mm; its border is half a millimetre soft.
    let inside = (settings.gel_half_mm.x - plane.x.abs()).min(settings.gel_half_mm.y - plane.y.abs());
    let gel = (inside / 0.5 + 0.5).clamp(0.0, 1.0);
    let glare = (-0.5 * ((settings.gel_half_mm.y - 0.9 - plane.y) / 0.7).powi(2)).exp();
    let glint = if settings.glints { glint(plane) } else { 0.0 };
    let light_levels = std::array::from_fn(|c| {
        let level: f64 = powers.iter().zip(&light.background_levels[c]).map(|(p, b)| p * b).sum();
        let lit = level.max(1.0) + light.glare_levels[c] * glare + 120.0 * glint;
        (light.housing_levels[c] + (lit - light.housing_levels[c]) * gel) as f32
    });
    // Far off the gel only the housing shows; the nodes need not reach there.
    let most = settings.gel_half_mm + Vec2::new(2.0, 2.0);
    let plane_mm = [plane.x.clamp(-most.x, most.x) as f32, plane.y.clamp(-most.y, most.y) as f32];
    Pixel { plane_mm, light_levels, gel: gel as f32 }
}

/// Two scratches of the coating near a corner.
fn glint(plane_mm: Vec2) -> f64 {
    [Vec2::new(-13.2, -11.6), Vec2::new(-12.4, -11.3)]
        .iter()
        .map(|&middle| {
            let d = plane_mm - middle;
            let (along, across) = (d.x * 0.5 + d.y * 0.87, d.x * 0.87 - d.y * 0.5);
            (-0.5 * ((along / 0.7).powi(2) + (across / 0.07).powi(2))).exp()
        })
        .sum()
}
