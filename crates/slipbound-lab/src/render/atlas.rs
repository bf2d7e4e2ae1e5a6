//! The printed and woven skin: darkness of the dots and brightness of the threads, over the gel at rest.

use super::CameraSettings;
use crate::random::Random;
use slipbound::pixels::wide::wide;
use slipbound::plane::Vec2;

/// Spacing of the texels in mm: a quarter of the edge of a dot and finer than any pixel.
const TEXEL_MM: f32 = 0.025;

/// Added to a smaller number, this leaves the integer part in the low bits of the sum.
const WHOLE: f32 = (1 << 23) as f32;
const WHOLE_MASK: u32 = (1 << 23) - 1;

/// Lookup of a row of pixels: index of the texel, weights of the texels to the right and below, the texel and its right
/// neighbour, and the two below these.
#[derive(Debug, Clone)]
struct Row {
    place: Vec<u32>,
    share: [Vec<f32>; 2],
    upper: Vec<u32>,
    lower: Vec<u32>,
}

/// The skin, point by point.
#[derive(Debug, Clone)]
pub(super) struct Atlas {
    half_mm: [f32; 2],
    columns: usize,
    rows: usize,
    /// Interleaved: darkness of dots 0 to 255, brightness of threads 1 to 255, 128 is neutral.
    texels: Vec<u8>,
    row: Row,
    markers_mm: Vec<Vec2>,
}

impl Atlas {
    /// Prints the dots and weaves the fabric.
    pub fn new(settings: &CameraSettings, random: &mut Random) -> Self {
        // The gel, and the part that may be stretched into view from beyond it.
        let half_mm = [settings.gel_half_mm.x as f32 + 4.0, settings.gel_half_mm.y as f32 + 4.0];
        let [columns, rows] = half_mm.map(|half| (2.0 * half / TEXEL_MM).ceil() as usize + 1);
        assert!(columns * rows < 1 << 23, "a skin of {columns} x {rows} texels");
        let width = settings.sensor.image_px.width + 8; // whole steps of the nodes
        let share = [vec![0.0; width], vec![0.0; width]];
        let row = Row { place: vec![0; width], share, upper: vec![0; width], lower: vec![0; width] };
        let mut atlas = Atlas { half_mm, columns, rows, texels: Vec::new(), row, markers_mm: Vec::new() };
        atlas.weave(settings, random);
        atlas.print(settings, random);
        atlas
    }

    /// Positions of the dots, row by row.
    pub fn markers_mm(&self) -> &[Vec2] {
        &self.markers_mm
    }

    /// Darkness of the dots (0 to 1) and brightness of the weave (-1 to 1) at points of the gel at rest.
    pub fn fetch(&mut self, [x_mm, y_mm]: [&[f32]; 2], dots: &mut [f32], threads: &mut [f32]) {
        let count = dots.len();
        let (half, stride) = (self.half_mm, self.columns as f32);
        let last = [self.columns, self.rows].map(|count| (count - 2) as f32);
        let Row { place, share: [share_x, share_y], upper, lower } = &mut self.row;
        let (place, share_x, share_y) = (&mut place[..count], &mut share_x[..count], &mut share_y[..count]);
        let ([half_x, half_y], [last_x, last_y]) = (half, last);
        texel_at(x_mm, half_x, last_x, share_x);
        texel_at(y_mm, half_y, last_y, share_y);
        number_of(share_x, share_y, stride, place);
        look_up(&self.texels, place, upper);
        look_up(&self.texels[2 * self.columns..], place, lower);
        mixed(&upper[..count], &lower[..count], share_x, share_y, dots, threads);
    }

    fn place_mm(&self, texel: usize) -> Vec2 {
        let (column, row) = ((texel % self.columns) as f64, (texel / self.columns) as f64);
        let step = f64::from(TEXEL_MM);
        Vec2::new(column * step - f64::from(self.half_mm[0]), row * step - f64::from(self.half_mm[1]))
    }

    /// A plain weave: threads along x and along y, alternately over and under, each slightly brighter or darker.
    fn weave(&mut self, settings: &CameraSettings, random: &mut Random) {
        let thread_mm = settings.texture.thread_mm;
        let threads = (2.0 * f64::from(self.half_mm[0].max(self.half_mm[1])) / thread_mm) as usize + 2;
        let mut tones = || -> Vec<f64> { (0..threads).map(|_| random.between(-0.2, 0.2)).collect() };
        let (tones_x, tones_y) = (tones(), tones());
        // Index of the thread and height of its bow, for every column and every row of texels.
        let along = |half_mm: f32, count: usize| -> Vec<(usize, f64)> {
            let from_mm = |texel: usize| texel as f64 * f64::from(TEXEL_MM) - f64::from(half_mm);
            let in_threads = |texel: usize| (from_mm(texel) + f64::from(half_mm)) / thread_mm;
            let bow = |t: f64| libm::sin(std::f64::consts::PI * t.fract());
            (0..count).map(in_threads).map(|t| (t as usize, bow(t))).collect()
        };
        let (columns, rows) = (along(self.half_mm[0], self.columns), along(self.half_mm[1], self.rows));
        self.texels = Vec::with_capacity(2 * columns.len() * rows.len());
        for &(row, bow_y) in &rows {
            for &(column, bow_x) in &columns {
                // The upper thread is round across and dips at its ends.
                let (upper, tone) = if (column + row) % 2 == 0 {
                    (bow_y * (0.55 + 0.45 * bow_x), tones_x[row])
                } else {
                    (bow_x * (0.55 + 0.45 * bow_y), tones_y[column])
                };
                let bright = (2.4 * upper - 1.2 + tone).clamp(-1.0, 1.0);
                self.texels.extend([0, (128 + nearest(bright * 127.0)) as u8]);
            }
        }
    }

    fn print(&mut self, settings: &CameraSettings, random: &mut Random) {
        let dots = &settings.dots;
        let pitch_mm = settings.sensor.pitch_mm.expect("a simulated finger knows its pitch");
        let mut normal = || (0..12).map(|_| random.fraction()).sum::<f64>() - 6.0;
        for i in 0..dots.columns_count * dots.rows_count {
            let (column, row) = ((i % dots.columns_count) as f64, (i / dots.columns_count) as f64);
            let middle = Vec2::new((dots.columns_count - 1) as f64, (dots.rows_count - 1) as f64) / 2.0;
            let off = Vec2::new(normal(), normal()) * dots.jitter_mm;
            let place = (Vec2::new(column, row) - middle) * pitch_mm + off;
            let radius_mm = (dots.radius_mm + normal() * dots.radius_jitter_mm).max(0.3 * dots.radius_mm);
            self.markers_mm.push(place);
            self.stamp(place, radius_mm, dots.edge_mm);
        }
    }

    /// One dot: full inside, fading over its edge.
    fn stamp(&mut self, place: Vec2, radius_mm: f64, edge_mm: f64) {
        let (reach, step) = (radius_mm + edge_mm, f64::from(TEXEL_MM));
        let span = |at: f64, half: f32, end: usize| {
            let from = ((at - reach + f64::from(half)) / step).floor().max(0.0) as usize;
            from.min(end)..(((at + reach + f64::from(half)) / step).ceil().max(0.0) as usize + 1).min(end)
        };
        for row in span(place.y, self.half_mm[1], self.rows) {
            for column in span(place.x, self.half_mm[0], self.columns) {
                let texel = row * self.columns + column;
                let inside = (radius_mm - (self.place_mm(texel) - place).length()) / edge_mm + 0.5;
                let smooth = inside.clamp(0.0, 1.0);
                let dark = (255.0 * smooth * smooth * (3.0 - 2.0 * smooth)).round() as u8;
                self.texels[2 * texel] = self.texels[2 * texel].max(dark);
            }
        }
    }
}

wide! {
    /// Position of points along one side of the skin, in texels.
    fn texel_at(at_mm: &[f32], half_mm: f32, last: f32, texel: &mut [f32]) {
        for (texel, at_mm) in texel.iter_mut().zip(at_mm) {
            *texel = bounded((at_mm + half_mm) * (1.0 / TEXEL_MM), last);
        }
    }

    /// The indices of texels; the positions keep the fractional part.
    fn number_of(x: &mut [f32], y: &mut [f32], stride: f32, number: &mut [u32]) {
        for (number, (x, y)) in number.iter_mut().zip(x.iter_mut().zip(y)) {
            let (column, row) = (whole(*x), whole(*y));
            (*x, *y) = (*x - column, *y - row);
            *number = (row * stride + column + WHOLE).to_bits() & WHOLE_MASK;
        }
    }

    /// Texels by their indices, each with its right neighbour. A separate loop, because a short loop keeps more loads
    /// in flight, and the loaded data is rarely in a near cache.
    fn look_up(texels: &[u8], numbers: &[u32], pairs: &mut [u32]) {
        for (pair, number) in pairs.iter_mut().zip(numbers) {
            *pair = pair_at(texels, *number);
        }
    }

    /// Dots and threads, interpolated between four texels each.
    #[allow(clippy::too_many_arguments)] // slices of one length
    fn mixed(upper: &[u32], lower: &[u32], x: &[f32], y: &[f32], dots: &mut [f32], threads: &mut [f32]) {
        let four = upper.iter().zip(lower).zip(x.iter().zip(y));
        for ((dot, thread), ((&upper, &lower), (fx, fy))) in dots.iter_mut().zip(threads).zip(four) {
            *dot = between(upper, lower, 0, *fx, *fy) * (1.0 / 255.0);
            *thread = (between(upper, lower, 8, *fx, *fy) - 128.0) * (1.0 / 127.0);
        }
    }
}

/// The value `shift` bits from the bottom of two pairs of texels, interpolated.
#[inline(always)]
fn between(upper: u32, lower: u32, shift: u32, fx: f32, fy: f32) -> f32 {
    let level = |pair: u32, at: u32| ((pair >> (at + shift)) & 255) as i32 as f32;
    let a = level(upper, 0) + (level(upper, 16) - level(upper, 0)) * fx;
    let b = level(lower, 0) + (level(lower, 16) - level(lower, 0)) * fx;
    a + (b - a) * fy
}

/// The nearest integer, halves away from 0, as `f64::round`, which is a function call without the instruction for it.
#[inline(always)]
fn nearest(x: f64) -> i32 {
    let towards_0 = x as i32;
    let rest = x - f64::from(towards_0);
    towards_0 + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)
}

/// Clamped to 0 and `most`.
#[inline(always)]
fn bounded(x: f32, most: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < most { x } else { most }
}

/// The integer below, or next to it where that is as good: x must be from 0 to a million.
#[inline(always)]
fn whole(x: f32) -> f32 {
    let near = (x + WHOLE) - WHOLE;
    if near > x { near - 1.0 } else { near }
}

/// A texel and its right neighbour in four bytes.
#[inline(always)]
fn pair_at(texels: &[u8], place: u32) -> u32 {
    let from = 2 * place as usize;
    let four = &texels[from..from + 4];
    u32::from_le_bytes([four[0], four[1], four[2], four[3]])
}
