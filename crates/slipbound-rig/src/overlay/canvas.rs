//! Arrows, dots and text on an image, with smooth edges.

use super::regions::Region;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use tiny_skia::{FillRule, Paint, Path, PathBuilder, Pixmap, PremultipliedColorU8, Rect, Stroke, Transform};

/// Red, green, blue and opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Colour {
    rgb: [u8; 3],
    alpha: f32,
}

impl Colour {
    pub const fn new(r: u8, g: u8, b: u8) -> Self {
        Colour { rgb: [r, g, b], alpha: 1.0 }
    }

    pub const fn with_alpha(self, alpha: f32) -> Self {
        Colour { alpha, ..self }
    }

    fn paint(self) -> Paint<'static> {
        let [r, g, b] = self.rgb;
        let mut paint = Paint::default();
        paint.set_color_rgba8(r, g, b, (self.alpha * 255.0).round() as u8);
        paint
    }
}

/// Size and weight of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Text {
    /// 16 px.
    Small,
    /// 24 px, bold.
    Large,
}

impl Text {
    const fn raster(self) -> (FontWeight, RasterHeight) {
        match self {
            Text::Small => (FontWeight::Regular, RasterHeight::Size16),
            Text::Large => (FontWeight::Bold, RasterHeight::Size24),
        }
    }

    /// Width of a text in pixels.
    pub fn width(self, text: &str) -> i32 {
        let (weight, height) = self.raster();
        (get_raster_width(weight, height) * text.chars().count()) as i32
    }

    /// Height of a line in pixels.
    pub const fn height(self) -> i32 {
        self.raster().1.val() as i32
    }
}

/// An image to draw on; always opaque.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    pixmap: Pixmap,
}

impl Canvas {
    pub fn new(size: SizePx) -> Self {
        let pixmap = Pixmap::new(size.width as u32, size.height as u32);
        Canvas { pixmap: pixmap.expect("a panel is neither empty nor larger than 2^31 bytes") }
    }

    pub fn size(&self) -> SizePx {
        SizePx::new(self.pixmap.width() as usize, self.pixmap.height() as usize)
    }

    /// The pixels: red, green, blue.
    pub fn rgb_into(&self, rgb: &mut Vec<u8>) {
        let pixels = self.pixmap.data();
        rgb.resize(pixels.len() / 4 * 3, 0);
        for (rgb, pixel) in rgb.chunks_exact_mut(3).zip(pixels.chunks_exact(4)) {
            rgb.copy_from_slice(&pixel[..3]);
        }
    }

    /// One colour everywhere.
    pub fn fill(&mut self, colour: Colour) {
        let [r, g, b] = colour.rgb;
        self.pixmap.fill(tiny_skia::Color::from_rgba8(r, g, b, 255));
    }

    /// Copies an image of the same size: red, green, blue.
    pub fn put(&mut self, rgb: &[u8]) {
        for (pixel, rgb) in self.pixmap.pixels_mut().iter_mut().zip(rgb.chunks_exact(3)) {
            *pixel = opaque([rgb[0], rgb[1], rgb[2]]);
        }
    }

    /// Copies a smaller image to a place.
    pub fn paste(&mut self, picture: &Canvas, (left, top): (usize, usize)) {
        let (stride, width) = (self.size().width, picture.size().width);
        let to = self.pixmap.pixels_mut()[top * stride..].chunks_exact_mut(stride);
        for (to, from) in to.zip(picture.pixmap.pixels().chunks_exact(width)) {
            to[left..left + width].copy_from_slice(from);
        }
    }

    /// Tints a region and draws its outline; the region's panel is the whole image.
    pub fn region(&mut self, region: &mut Region, colour: Colour, tint: f32) {
        let pixels = self.pixmap.pixels_mut();
        region.for_each(|i, share, outline| {
            pixels[i] = blend(pixels[i], colour.rgb, (tint * share).max(0.9 * outline));
        });
    }

    /// A box with smooth edges.
    pub fn rectangle(&mut self, left: i32, top: i32, width: i32, height: i32, colour: Colour) {
        if let Some(rect) = Rect::from_xywh(left as f32, top as f32, width as f32, height as f32) {
            self.pixmap.fill_rect(rect, &colour.paint(), Transform::identity(), None);
        }
    }

    pub fn dot(&mut self, at: Vec2, radius: f64, colour: Colour) {
        if let Some(path) = PathBuilder::from_circle(at.x as f32, at.y as f32, radius as f32) {
            self.fill_path(&path, colour);
        }
    }

    pub fn ring(&mut self, at: Vec2, radius: f64, width: f32, colour: Colour) {
        if let Some(path) = PathBuilder::from_circle(at.x as f32, at.y as f32, radius as f32) {
            self.stroke_path(&path, width, colour);
        }
    }

    /// Straight segments from point to point.
    pub fn line(&mut self, points: &[Vec2], width: f32, colour: Colour) {
        let mut path = PathBuilder::new();
        for (i, p) in points.iter().enumerate() {
            match i {
                0 => path.move_to(p.x as f32, p.y as f32),
                _ => path.line_to(p.x as f32, p.y as f32),
            }
        }
        if let Some(path) = path.finish() {
            self.stroke_path(&path, width, colour);
        }
    }

    /// An arrow with its tip at `to` and a halo of this width and colour.
    pub fn arrow(&mut self, from: Vec2, to: Vec2, width: f64, colour: Colour, halo: (f32, Colour)) {
        let Some(path) = arrow_path(from, to, width) else { return };
        self.stroke_path(&path, halo.0, halo.1);
        self.fill_path(&path, colour);
    }

    /// A line of text; `at`: its upper left corner.
    pub fn text(&mut self, (left, top): (i32, i32), size: Text, colour: Colour, text: &str) {
        let (weight, height) = size.raster();
        let SizePx { width: stride, height: rows } = self.size();
        let mut x0 = left;
        for sign in text.chars() {
            let glyph = get_raster(sign, weight, height).or_else(|| get_raster('?', weight, height));
            let Some(glyph) = glyph else { continue };
            for (y, row) in glyph.rows().enumerate() {
                for (x, &cover) in row.iter().enumerate() {
                    let (x, y) = (x0 + x as i32, top + y as i32);
                    if cover > 0 && (0..stride as i32).contains(&x) && (0..rows as i32).contains(&y) {
                        let pixel = &mut self.pixmap.pixels_mut()[y as usize * stride + x as usize];
                        *pixel = blend(*pixel, colour.rgb, colour.alpha * f32::from(cover) / 255.0);
                    }
                }
            }
            x0 += glyph.width() as i32;
        }
    }

    fn fill_path(&mut self, path: &Path, colour: Colour) {
        self.pixmap.fill_path(path, &colour.paint(), FillRule::Winding, Transform::identity(), None);
    }

    fn stroke_path(&mut self, path: &Path, width: f32, colour: Colour) {
        let stroke = Stroke { width, ..Stroke::default() };
        self.pixmap.stroke_path(path, &colour.paint(), &stroke, Transform::identity(), None);
    }
}

/// Shaft and head of an arrow; a short one is nearly all head.
fn arrow_path(from: Vec2, to: Vec2, width: f64) -> Option<Path> {
    let by = to - from;
    let length = by.length();
    let along = by / length;
    let across = along.turned();
    let head_length = (3.6 * width).min(0.75 * length);
    let head_half = 1.5 * width * (head_length / (3.6 * width)).max(0.4);
    let half = 0.5 * width * (length / (2.0 * width)).clamp(0.5, 1.0);
    let neck = to - along * head_length;
    let corners = [
        from + across * half,
        neck + across * half,
        neck + across * head_half,
        to,
        neck - across * head_half,
        neck - across * half,
        from - across * half,
    ];
    let mut path = PathBuilder::new();
    for (i, p) in corners.iter().enumerate() {
        match i {
            0 => path.move_to(p.x as f32, p.y as f32),
            _ => path.line_to(p.x as f32, p.y as f32),
        }
    }
    path.close();
    path.finish()
}

fn opaque([r, g, b]: [u8; 3]) -> PremultipliedColorU8 {
    PremultipliedColorU8::from_rgba(r, g, b, 255).expect("an opaque colour is its own product")
}

fn blend(under: PremultipliedColorU8, over: [u8; 3], alpha: f32) -> PremultipliedColorU8 {
    let mix = |u: u8, o: u8| (f32::from(u) + (f32::from(o) - f32::from(u)) * alpha + 0.5) as u8;
    opaque([mix(under.red(), over[0]), mix(under.green(), over[1]), mix(under.blue(), over[2])])
}
