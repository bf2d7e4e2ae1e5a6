//! A mask enlarged with a smooth border.

use slipbound::image::{Mask, SizePx};

/// The border is smoothed over this many mask pixels: two box averages of 5 turn a step into a slope of 1/5 a pixel.
const BOX_PX: usize = 5;
/// Width of the outline on the canvas.
const OUTLINE_PX: f32 = 2.6;

/// A mask at the size of a panel: how far each pixel lies inside it.
#[derive(Debug, Clone)]
pub(super) struct Region {
    mask_size: SizePx,
    panel: SizePx,
    scale: f64,
    soft: Vec<f32>,
    scratch: Vec<f32>,
    empty: bool,
}

impl Region {
    pub fn new(mask_size: SizePx, panel: SizePx, scale: f64) -> Self {
        let none = vec![0.0; mask_size.area()];
        Region { mask_size, panel, scale, soft: none.clone(), scratch: none, empty: true }
    }

    /// Takes a mask and smooths it.
    pub fn take(&mut self, mask: &Mask) {
        self.empty = mask.area_px2() == 0;
        if self.empty {
            return;
        }
        let SizePx { width, height } = self.mask_size;
        for y in 0..height {
            for x in 0..width {
                self.soft[y * width + x] = f32::from(u8::from(mask.get(x as isize, y as isize)));
            }
        }
        for _ in 0..2 {
            box_average(&self.soft, &mut self.scratch, width, height, 1, width);
            box_average(&self.scratch, &mut self.soft, height, width, width, 1);
        }
    }

    /// Calls `paint` with the index of every panel pixel in the region or on its outline, and the share of either.
    pub fn for_each(&self, mut paint: impl FnMut(usize, f32, f32)) {
        if self.empty {
            return;
        }
        let SizePx { width, height } = self.mask_size;
        let place = |i: usize, size: usize| {
            let v = ((i as f64 + 0.5) / self.scale - 0.5).clamp(0.0, (size - 1) as f64);
            let whole = (v as usize).min(size - 2);
            (whole, (v - whole as f64) as f32)
        };
        let columns: Vec<(usize, f32)> = (0..self.panel.width).map(|x| place(x, width)).collect();
        for y in 0..self.panel.height {
            let (row, fy) = place(y, height);
            let (upper, lower) = (&self.soft[row * width..][..width], &self.soft[(row + 1) * width..][..width]);
            for (x, &(column, fx)) in columns.iter().enumerate() {
                let mix = |row: &[f32]| row[column] * (1.0 - fx) + row[column + 1] * fx;
                let soft = mix(upper) * (1.0 - fy) + mix(lower) * fy;
                if soft <= 0.0 {
                    continue;
                }
                let inside_px = (soft - 0.5) * BOX_PX as f32 * self.scale as f32;
                let share = (inside_px + 0.5).clamp(0.0, 1.0);
                let outline = (OUTLINE_PX / 2.0 + 0.5 - inside_px.abs()).clamp(0.0, 1.0);
                if share > 0.0 || outline > 0.0 {
                    paint(y * self.panel.width + x, share, outline);
                }
            }
        }
    }
}

/// Running average of [`BOX_PX`] along lines of `length` pixels `step` apart, `lines` of them `line_step` apart; the
/// border value continues beyond the border.
fn box_average(from: &[f32], to: &mut [f32], length: usize, lines: usize, step: usize, line_step: usize) {
    let half = BOX_PX / 2;
    for line in 0..lines {
        let at = |i: usize| line * line_step + i * step;
        for i in 0..length {
            let window = (0..BOX_PX).map(|k| from[at((i + k).saturating_sub(half).min(length - 1))]);
            to[at(i)] = window.sum::<f32>() / BOX_PX as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_is_that_of_the_mask_and_the_outline_runs_round_it() {
        let mut mask = Mask::new(SizePx::new(40, 40));
        for y in 10..30 {
            for x in 10..30 {
                mask.set(x, y, true);
            }
        }
        let mut region = Region::new(mask.size(), SizePx::new(120, 120), 3.0);
        region.for_each(|_, _, _| panic!("empty before anything was taken over"));
        region.take(&mask);
        let (mut area, mut outline, mut middle) = (0.0, 0.0, false);
        region.for_each(|i, share, line| {
            area += share;
            outline += line;
            middle |= i == 60 * 120 + 60 && share == 1.0 && line == 0.0;
        });
        assert!((area - 3600.0).abs() < 150.0, "{area} px; the smoothing takes a little off the corners");
        assert!((outline - 4.0 * 60.0 * OUTLINE_PX).abs() < 60.0, "{outline} px");
        assert!(middle);
    }
}
