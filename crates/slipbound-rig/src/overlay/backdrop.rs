//! The camera's image, rectified and enlarged in one step.

use slipbound::image::{Frame, Pixels, SizePx};
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;

/// Where a pixel of the panel comes from.
#[derive(Debug, Clone, Copy)]
struct From {
    x: u16,
    y: u16,
    /// In 256ths.
    fraction: [u16; 2],
}

/// The rectified image at the size of a panel.
#[derive(Debug, Clone)]
pub(super) struct Backdrop {
    table: Vec<Option<From>>,
    rgb: Vec<u8>,
}

impl Backdrop {
    pub fn new(sensor: &Sensor, panel: SizePx, scale: f64) -> Self {
        let camera = sensor.image_px;
        let coordinate = |v: f64, size: usize| {
            let whole = v.floor().clamp(0.0, (size - 2) as f64);
            // Half a pixel beyond the outermost centres still belongs to them.
            let on_it = (-0.5..=size as f64 - 0.5).contains(&v);
            on_it.then(|| (whole as u16, ((v - whole).clamp(0.0, 1.0) * 256.0).round() as u16))
        };
        let mut table = Vec::with_capacity(panel.area());
        for y in 0..panel.height {
            for x in 0..panel.width {
                let rectified = Vec2::new((x as f64 + 0.5) / scale - 0.5, (y as f64 + 0.5) / scale - 0.5);
                let p = sensor.camera_from_rectified(rectified);
                let from = coordinate(p.x, camera.width).zip(coordinate(p.y, camera.height));
                table.push(from.map(|((x, fx), (y, fy))| From { x, y, fraction: [fx, fy] }));
            }
        }
        Backdrop { rgb: vec![0; 3 * table.len()], table }
    }

    /// Takes a frame; it must have the size that the sensor states.
    pub fn take(&mut self, frame: &Frame<'_>) {
        for (rgb, from) in self.rgb.chunks_exact_mut(3).zip(&self.table) {
            let Some(From { x, y, fraction: [fx, fy] }) = *from else {
                rgb.fill(0);
                continue;
            };
            let (upper, lower, places) = match frame.pixels {
                Pixels::Gray(p) => (p.row(y.into()), p.row(usize::from(y) + 1), [0; 3]),
                Pixels::Rgb(p) => (p.row(y.into()), p.row(usize::from(y) + 1), p.order().rgb([0, 1, 2])),
            };
            let channels = if places == [0; 3] { 1 } else { 3 };
            let at = usize::from(x) * channels;
            for (place, out) in places.into_iter().zip(rgb.iter_mut()) {
                let i = at + place;
                let mix = |row: &[u8]| {
                    u32::from(row[i]) * (256 - u32::from(fx)) + u32::from(row[i + channels]) * u32::from(fx)
                };
                *out = ((mix(upper) * (256 - u32::from(fy)) + mix(lower) * u32::from(fy) + (1 << 15)) >> 16) as u8;
            }
        }
    }

    /// Makes the image grey and pale, so that black stands out.
    pub fn pale(&mut self) {
        for rgb in self.rgb.chunks_exact_mut(3) {
            let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(u32::from);
            let grey = (77 * r + 150 * g + 29 * b) >> 8;
            rgb.fill((150 + 105 * grey / 255) as u8);
        }
    }

    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }
}
