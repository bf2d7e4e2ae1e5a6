//! A coarse field of values, one per cell -> the mask of pixels where the field, interpolated, reaches a level.

use super::threshold::at_least;
use crate::image::Mask;

/// Pixels of a row whose values are computed in parallel.
const LANES: usize = 8;

/// Sets the pixels of `out` at which the bilinear interpolation of `values` (row by row, `columns` of them, each at the
/// centre of a cell of `cell_px` px) is at least `level`; beyond the outermost centres the field is constant. `cells`:
/// scratch memory, one pixel per value; afterwards it marks the values of at least `level`.
pub fn mask_above(values: &[f32], columns: usize, cell_px: usize, level: f32, cells: &mut Mask, out: &mut Mask) {
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
    at_least(values, level, cells);
    let last_word = columns / 64;
    for i in 0..=rows {
        let (above, below) = (i.saturating_sub(1), i.min(rows - 1));
        let reached = Reached { above: cells.row(above), below: cells.row(below), columns };
        let (above, below) = (&values[above * columns..][..columns], &values[below * columns..][..columns]);
        let ys = square(i, rows, size.height);
        for word in 0..=last_word {
            let (all, any) = reached.corners(word);
            // Runs of squares of which all four corners reach the level are set at once.
            let mut runs = all;
            while runs != 0 {
                let from = runs.trailing_zeros() as usize;
                let count = (runs >> from).trailing_ones() as usize;
                let (first, last) = (64 * word + from, 64 * word + from + count - 1);
                let xs = square(first, columns, size.width).start..square(last, columns, size.width).end;
                ys.clone().for_each(|y| set_range(out.row_mut(y), xs.start, xs.end));
                runs &= if from + count == 64 { 0 } else { u64::MAX << (from + count) };
            }
            let mut cut = any & !all;
            while cut != 0 {
                let j = 64 * word + cut.trailing_zeros() as usize;
                cut &= cut - 1;
                let (left, right) = (j.saturating_sub(1), j.min(columns - 1));
                let corners = [above[left], above[right], below[left], below[right]];
                let xs = square(j, columns, size.width);
                let share = |px: usize, i: usize| (px as f32 - half) * per_px - (i as f32 - 1.0);
                for xs in xs.clone().step_by(LANES).map(|x| x..xs.end.min(x + LANES)) {
                    let across: [f32; LANES] =
                        std::array::from_fn(|k| if k < xs.len() { share(xs.start + k, j) } else { f32::NAN });
                    for y in ys.clone() {
                        let down = share(y, i);
                        let a = corners[0] + (corners[2] - corners[0]) * down;
                        let b = corners[1] + (corners[3] - corners[1]) * down;
                        // Rounding preserves order: along a row the value is monotonic, so it crosses the level once.
                        let count: u32 = across.iter().map(|share| u32::from(a + (b - a) * share >= level)).sum();
                        let from = if b >= a { xs.end - count as usize } else { xs.start };
                        set_range(out.row_mut(y), from, from + count as usize);
                    }
                }
            }
        }
    }
}

/// The cells of two rows that reach the level, one bit per cell.
struct Reached<'a> {
    above: &'a [u64],
    below: &'a [u64],
    columns: usize,
}

impl Reached<'_> {
    /// Of 64 squares, those of which all four corners reach the level, and those of which at least one does. Square j
    /// has the cells j - 1 and j as its left and right corners; beyond the border the outermost cells are repeated.
    fn corners(&self, word: usize) -> (u64, u64) {
        let bits = |row: &[u64]| {
            let here = row.get(word).copied().unwrap_or(0);
            let before = if word == 0 { here & 1 } else { row[word - 1] >> 63 };
            let left = here << 1 | before;
            // The last square: its right corners are those of the last cell.
            let last = self.columns / 64 == word;
            let right = if last { here | left & 1 << (self.columns % 64) } else { here };
            (left, right)
        };
        let ((a, b), (c, d)) = (bits(self.above), bits(self.below));
        (a & b & c & d, a | b | c | d)
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
        mask_above(&values, 3, 4, 1.0, &mut Mask::new(SizePx::new(3, 3)), &mut mask);
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
        let mut cells = Mask::new(SizePx::new(16, 2));
        mask_above(&[5.0; 32], 16, 8, 1.0, &mut cells, &mut mask);
        assert_eq!(mask.area_px2(), 131 * 9);
        mask_above(&[0.5; 32], 16, 8, 1.0, &mut cells, &mut mask);
        assert_eq!(mask.area_px2(), 0);
    }

    #[test]
    fn every_pixel_is_that_of_the_interpolated_field() {
        for (columns, rows, cell_px, width, height) in
            [(9, 5, 4, 36, 20), (64, 3, 2, 129, 7), (130, 4, 3, 391, 13), (63, 2, 5, 315, 10)]
        {
            let values: Vec<f32> = (0..columns * rows)
                .map(|i| ((i * 7919) % 97 % 13) as f32 - if i % 31 < 12 { 5.0 } else { -4.0 })
                .collect();
            let (size, level) = (SizePx::new(width, height), 3.0);
            let mut mask = Mask::new(size);
            mask_above(&values, columns, cell_px, level, &mut Mask::new(SizePx::new(columns, rows)), &mut mask);
            let place = |px: usize, cells: usize| {
                let at = (px as f32 - (cell_px as f32 - 1.0) / 2.0) / cell_px as f32;
                let first = (at.floor().max(0.0) as usize).min(cells - 1);
                let next = if at < 0.0 { first } else { (first + 1).min(cells - 1) };
                (first, next, at - at.floor())
            };
            for i in 0..size.area() {
                let ((left, right, dx), (top, bottom, dy)) = (place(i % width, columns), place(i / width, rows));
                let at = |x: usize, y: usize| values[y * columns + x];
                let (a, b) = (
                    at(left, top) + (at(left, bottom) - at(left, top)) * dy,
                    at(right, top) + (at(right, bottom) - at(right, top)) * dy,
                );
                let v = a + (b - a) * dx;
                if (v - level).abs() > 1e-4 {
                    assert_eq!(
                        mask.get((i % width) as isize, (i / width) as isize),
                        v > level,
                        "pixel {i} of {size}: {v}"
                    );
                }
            }
        }
    }
}
