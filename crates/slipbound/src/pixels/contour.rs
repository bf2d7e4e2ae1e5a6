//! A coarse field of values, one a cell -> the mask of pixels where the field, interpolated, exceeds a level.

use crate::image::Mask;

/// Sets the pixels of `out` at which the bilinear interpolation of `values` (row by row, `columns` of them, each
/// at the centre of a cell of `cell_px` px) is at least `level`; beyond the outermost centres the field is constant.
pub fn mask_above(values: &[f32], columns: usize, cell_px: usize, level: f32, out: &mut Mask) {
    out.clear();
    let rows = values.len() / columns.max(1);
    if rows == 0 || columns == 0 {
        return;
    }
    let size = out.size();
    let half = (cell_px as f32 - 1.0) / 2.0;
    let per_px = 1.0 / cell_px as f32;
    for y in 0..size.height {
        let at = ((y as f32 - half) * per_px).clamp(0.0, (rows - 1) as f32);
        let above = at as usize;
        let below = (above + 1).min(rows - 1);
        let share = at - above as f32;
        let value = |column: usize| {
            let (a, b) = (values[above * columns + column], values[below * columns + column]);
            a + (b - a) * share
        };
        let words = out.row_mut(y);
        let mut left = value(0);
        if left >= level {
            set_range(words, 0, (half.floor() as usize + 1).min(size.width));
        }
        for column in 1..columns {
            let right = value(column);
            let from_px = (column - 1) as f32 * cell_px as f32 + half;
            let (first, end) = (from_px.ceil() as usize, ((from_px + cell_px as f32).ceil() as usize).min(size.width));
            if left >= level && right >= level {
                set_range(words, first, end);
            } else if left >= level || right >= level {
                for x in first..end {
                    let v = left + (right - left) * ((x as f32 - from_px) * per_px);
                    words[x / 64] |= u64::from(v >= level) << (x % 64);
                }
            }
            left = right;
        }
        if left >= level {
            let from = ((columns - 1) as f32 * cell_px as f32 + half).ceil() as usize;
            set_range(words, from.min(size.width), size.width);
        }
    }
}

/// Sets the bits `first..end` of a row.
fn set_range(words: &mut [u64], first: usize, end: usize) {
    let mut x = first;
    while x < end {
        let (word, bit) = (x / 64, x % 64);
        let bits = (end - x).min(64 - bit);
        let ones = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
        words[word] |= ones << bit;
        x += bits;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;

    #[test]
    fn the_contour_runs_halfway_between_a_cell_above_and_cells_below() {
        let mut values = [0.0f32; 9];
        values[4] = 2.0;
        let mut mask = Mask::new(SizePx::new(12, 12));
        mask_above(&values, 3, 4, 1.0, &mut mask);
        let expected = Mask::from_picture(
            "............
             ............
             ............
             ............
             .....##.....
             ....####....
             ....####....
             .....##.....
             ............
             ............
             ............
             ............",
        );
        assert_eq!(mask, expected, "{mask:?}");
    }

    #[test]
    fn a_field_above_the_level_everywhere_fills_the_image_to_its_borders() {
        let mut mask = Mask::new(SizePx::new(131, 9));
        mask_above(&[5.0; 32], 16, 8, 1.0, &mut mask);
        assert_eq!(mask.area_px(), 131 * 9);
        mask_above(&[0.5; 32], 16, 8, 1.0, &mut mask);
        assert_eq!(mask.area_px(), 0);
    }
}
