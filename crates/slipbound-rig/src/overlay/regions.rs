//! A mask enlarged with a smooth border.

use slipbound::image::{Mask, SizePx};

/// The border is smoothed over this many mask pixels: two box averages of 5 turn a step into a slope of 1/5 a pixel.
const BOX_PX: usize = 5;
/// The sum of two box averages, both ways, deep inside a region.
const FULL: f32 = (BOX_PX * BOX_PX * BOX_PX * BOX_PX) as f32;
/// Width of the outline on the canvas.
const OUTLINE_PX: f32 = 2.6;

/// A mask at the size of a panel: how far each pixel lies inside it.
#[derive(Debug, Clone)]
pub(super) struct Region {
    mask_size: SizePx,
    scale: f64,
    /// 0 outside to [`FULL`] inside.
    soft: Vec<u16>,
    scratch: Vec<u16>,
    /// The mask pixels left of and above each column and row of the panel, and the share of their right and lower
    /// neighbours.
    columns: Vec<(usize, f32)>,
    rows: Vec<(usize, f32)>,
    /// A row of the panel before it is enlarged sideways, in shares of [`FULL`].
    row: Vec<f32>,
    empty: bool,
}

impl Region {
    pub fn new(mask_size: SizePx, panel: SizePx, scale: f64) -> Self {
        let none = vec![0; mask_size.area()];
        let places = |panel_px: usize, mask_px: usize| {
            let place = |i: usize| {
                let v = ((i as f64 + 0.5) / scale - 0.5).clamp(0.0, (mask_px - 1) as f64);
                let whole = (v as usize).min(mask_px - 2);
                (whole, (v - whole as f64) as f32)
            };
            (0..panel_px).map(place).collect::<Vec<_>>()
        };
        let (columns, rows) = (places(panel.width, mask_size.width), places(panel.height, mask_size.height));
        let row = vec![0.0; mask_size.width];
        Region { mask_size, scale, soft: none.clone(), scratch: none, columns, rows, row, empty: true }
    }

    /// Takes a mask and smooths it.
    pub fn take(&mut self, mask: &Mask) {
        self.empty = mask.area_px2() == 0;
        if self.empty {
            return;
        }
        let width = self.mask_size.width;
        for (y, row) in self.soft.chunks_exact_mut(width).enumerate() {
            for (x, soft) in row.iter_mut().enumerate() {
                *soft = u16::from(mask.get(x as isize, y as isize));
            }
        }
        for _ in 0..2 {
            box_sums_along_rows(&self.soft, &mut self.scratch, width);
            box_sums_along_columns(&self.scratch, &mut self.soft, width);
        }
    }

    /// Calls `paint` with the index of every panel pixel in the region or on its outline, and the share of either.
    pub fn for_each(&mut self, mut paint: impl FnMut(usize, f32, f32)) {
        if self.empty {
            return;
        }
        let width = self.mask_size.width;
        let slope_px = BOX_PX as f32 * self.scale as f32;
        let panel_width = self.columns.len();
        for (y, &(row, fy)) in self.rows.iter().enumerate() {
            let (upper, lower) = (&self.soft[row * width..][..width], &self.soft[(row + 1) * width..][..width]);
            if upper.iter().chain(lower).all(|&soft| soft == 0) {
                continue;
            }
            for ((mixed, &upper), &lower) in self.row.iter_mut().zip(upper).zip(lower) {
                *mixed = (f32::from(upper) * (1.0 - fy) + f32::from(lower) * fy) / FULL;
            }
            for (x, &(column, fx)) in self.columns.iter().enumerate() {
                let soft = self.row[column] * (1.0 - fx) + self.row[column + 1] * fx;
                let inside_px = (soft - 0.5) * slope_px;
                let share = (inside_px + 0.5).clamp(0.0, 1.0);
                let outline = (OUTLINE_PX / 2.0 + 0.5 - inside_px.abs()).clamp(0.0, 1.0);
                if share > 0.0 || outline > 0.0 {
                    paint(y * panel_width + x, share, outline);
                }
            }
        }
    }
}

/// Sum of the [`BOX_PX`] pixels round each, along its row; the border value continues beyond the border.
fn box_sums_along_rows(from: &[u16], to: &mut [u16], width: usize) {
    let half = BOX_PX / 2;
    for (from, to) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
        for (to, window) in to[half.min(width)..].iter_mut().zip(from.windows(BOX_PX)) {
            *to = window.iter().sum();
        }
        for x in (0..half.min(width)).chain(width.saturating_sub(half)..width) {
            to[x] = (0..BOX_PX).map(|k| from[(x + k).saturating_sub(half).min(width - 1)]).sum();
        }
    }
}

/// The same along columns.
fn box_sums_along_columns(from: &[u16], to: &mut [u16], width: usize) {
    let half = BOX_PX / 2;
    let last = from.len() / width - 1;
    for (y, to) in to.chunks_exact_mut(width).enumerate() {
        to.fill(0);
        for k in 0..BOX_PX {
            let from = &from[(y + k).saturating_sub(half).min(last) * width..][..width];
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
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
