//! The skin as it was printed and woven: darkness of the dots and brightness of the threads, over the gel at rest.

use super::CameraSettings;
use crate::random::Random;
use slipbound::plane::Vec2;

/// Distance of the texels in mm: a quarter of the edge of a dot and finer than any pixel.
const TEXEL_MM: f32 = 0.025;

/// A texel: darkness of dots 0 to 255, brightness of threads -127 to 127.
type Texel = [i16; 2];

/// The skin, point by point.
#[derive(Debug, Clone)]
pub(super) struct Atlas {
    half_mm: [f32; 2],
    columns: usize,
    rows: usize,
    texels: Vec<Texel>,
    markers_mm: Vec<Vec2>,
}

impl Atlas {
    /// Prints the dots and weaves the fabric.
    pub fn new(settings: &CameraSettings, random: &mut Random) -> Self {
        // The gel, and what is stretched into view from beyond it.
        let half_mm = [settings.gel_half_mm.x as f32 + 4.0, settings.gel_half_mm.y as f32 + 4.0];
        let [columns, rows] = half_mm.map(|half| (2.0 * half / TEXEL_MM).ceil() as usize + 1);
        let mut atlas = Atlas { half_mm, columns, rows, texels: Vec::new(), markers_mm: Vec::new() };
        atlas.weave(settings, random);
        atlas.print(settings, random);
        atlas
    }

    /// Where the dots are, row by row.
    pub fn markers_mm(&self) -> &[Vec2] {
        &self.markers_mm
    }

    /// Darkness of a dot (0 to 1) and brightness of the weave (-1 to 1) at a point of the gel at rest.
    #[inline]
    pub fn at(&self, x_mm: f32, y_mm: f32) -> (f32, f32) {
        let x = ((x_mm + self.half_mm[0]) * (1.0 / TEXEL_MM)).clamp(0.0, (self.columns - 2) as f32);
        let y = ((y_mm + self.half_mm[1]) * (1.0 / TEXEL_MM)).clamp(0.0, (self.rows - 2) as f32);
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f32, y - row as f32);
        let upper = row * self.columns + column;
        let (above, below) = (&self.texels[upper..upper + 2], &self.texels[upper + self.columns..][..2]);
        let lane = |k: usize| {
            let a = f32::from(above[0][k]) + f32::from(above[1][k] - above[0][k]) * fx;
            let b = f32::from(below[0][k]) + f32::from(below[1][k] - below[0][k]) * fx;
            a + (b - a) * fy
        };
        (lane(0) * (1.0 / 255.0), lane(1) * (1.0 / 127.0))
    }

    fn place_mm(&self, texel: usize) -> Vec2 {
        let (column, row) = ((texel % self.columns) as f64, (texel / self.columns) as f64);
        let step = f64::from(TEXEL_MM);
        Vec2::new(column * step - f64::from(self.half_mm[0]), row * step - f64::from(self.half_mm[1]))
    }

    /// A plain weave: threads along x and along y, over and under by turns, each a little brighter or darker.
    fn weave(&mut self, settings: &CameraSettings, random: &mut Random) {
        let thread_mm = settings.texture.thread_mm;
        let threads = (2.0 * f64::from(self.half_mm[0].max(self.half_mm[1])) / thread_mm) as usize + 2;
        let mut tones = || -> Vec<f64> { (0..threads).map(|_| random.between(-0.2, 0.2)).collect() };
        let (tones_x, tones_y) = (tones(), tones());
        self.texels = (0..self.columns * self.rows)
            .map(|i| {
                let p = self.place_mm(i) + Vec2::new(f64::from(self.half_mm[0]), f64::from(self.half_mm[1]));
                let (x, y) = (p.x / thread_mm, p.y / thread_mm);
                let (column, row) = (x as usize, y as usize);
                let bow = |t: f64| (std::f64::consts::PI * t.fract()).sin();
                // The upper thread is round across and dips at its ends.
                let (upper, tone) = if (column + row) % 2 == 0 {
                    (bow(y) * (0.55 + 0.45 * bow(x)), tones_x[row])
                } else {
                    (bow(x) * (0.55 + 0.45 * bow(y)), tones_y[column])
                };
                let bright = (2.4 * upper - 1.2 + tone).clamp(-1.0, 1.0);
                [0, (bright * 127.0).round() as i16]
            })
            .collect();
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
                let dark = (255.0 * smooth * smooth * (3.0 - 2.0 * smooth)).round() as i16;
                self.texels[texel][0] = self.texels[texel][0].max(dark);
            }
        }
    }
}
