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
    // Square `i` lies between the centres of cells i - 1 and i; the first and last reach the border of the image.
    let square = |i: usize, cells: usize, end: usize| {
        let centre = |cell: usize| (cell * cell_px + cell_px.div_ceil(2)).min(end); // first pixel at or past it
        let from = if i == 0 { 0 } else { centre(i - 1) };
        from..if i == cells { end } else { centre(i) }
    };
    let half = (cell_px as f32 - 1.0) / 2.0;
    let per_px = 1.0 / cell_px as f32;
    for i in 0..=rows {
        let (above, below) = (i.saturating_sub(1) * columns, i.min(rows - 1) * columns);
        let (above, below) = (&values[above..above + columns], &values[below..below + columns]);
        let ys = square(i, rows, size.height);
        // A run of squares that reach the level at all four corners is set at once.
        let mut whole_from = None;
        for j in 0..=columns {
            let (left, right) = (j.saturating_sub(1), j.min(columns - 1));
            let corners = [above[left], above[right], below[left], below[right]];
            let reached = corners.map(|v| v >= level);
            let xs = square(j, columns, size.width);
            if reached == [true; 4] {
                whole_from = whole_from.or(Some(xs.start));
                continue;
            }
            if let Some(from) = whole_from.take() {
                ys.clone().for_each(|y| set_range(out.row_mut(y), from, xs.start));
            }
            if reached == [false; 4] {
                continue;
            }
            for y in ys.clone() {
                let share = |px: usize, i: usize| (px as f32 - half) * per_px - (i as f32 - 1.0);
                let down = share(y, i);
                let (a, b) =
                    (corners[0] + (corners[2] - corners[0]) * down, corners[1] + (corners[3] - corners[1]) * down);
                let words = out.row_mut(y);
                for x in xs.clone() {
                    let v = a + (b - a) * share(x, j);
                    words[x / 64] |= u64::from(v >= level) << (x % 64);
                }
            }
        }
        if let Some(from) = whole_from {
            ys.for_each(|y| set_range(out.row_mut(y), from, size.width));
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
        assert_eq!(mask.area_px2(), 131 * 9);
        mask_above(&[0.5; 32], 16, 8, 1.0, &mut mask);
        assert_eq!(mask.area_px2(), 0);
    }
}
