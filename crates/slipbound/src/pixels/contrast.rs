//! Contrast of square cells: grey image -> mean difference of neighbouring pixels, one number per cell.

use super::wide::wide;
use crate::image::Gray;

/// Maximum side of a cell in px: the sum over its column still fits 16 bits.
pub const MOST_CELL_PX: usize = 64;

/// Writes for each cell of `cell_px` x `cell_px` pixels (at most [`MOST_CELL_PX`]), row by row, the mean absolute
/// difference between a pixel and those to its right and below, in levels. `sums`: scratch memory, one number per pixel
/// of a row. `out` has one number per whole cell of the image.
pub fn cell_contrast(grey: Gray<'_>, cell_px: usize, sums: &mut [u16], out: &mut [f32]) {
    debug_assert!(cell_px <= MOST_CELL_PX, "a sum of {cell_px} pixels overflows");
    let size = grey.size();
    let columns = size.width / cell_px;
    let per_pixel = 1.0 / (2 * cell_px * cell_px) as f32;
    let sums = &mut sums[..size.width];
    for (cell_row, out) in out.chunks_exact_mut(columns.max(1)).enumerate() {
        sums.fill(0);
        for y in cell_row * cell_px..(cell_row + 1) * cell_px {
            let row = grey.row(y);
            let below = grey.row((y + 1).min(size.height - 1));
            // The last row has no pixels below.
            add_differences(row, below, sums);
        }
        for (out, cell) in out.iter_mut().zip(sums.chunks_exact(cell_px)) {
            *out = cell.iter().map(|&sum| u32::from(sum)).sum::<u32>() as f32 * per_pixel;
        }
    }
}

wide! {
    /// Adds the differences of each pixel of a row to the one to its right, except for the last, and to the one below.
    fn add_differences(row: &[u8], below: &[u8], sums: &mut [u16]) {
        let last = row.len() - 1;
        let (right, below, sums) = (&row[1..][..last], &below[..=last], &mut sums[..=last]);
        for i in 0..last {
            sums[i] += u16::from(row[i].abs_diff(right[i])) + u16::from(row[i].abs_diff(below[i]));
        }
        sums[last] += u16::from(row[last].abs_diff(below[last]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;

    #[test]
    fn stripes_have_contrast_across_them_only() {
        let size = SizePx::new(8, 8);
        let grey: Vec<u8> = (0..64).map(|i| if i % 8 >= 4 { 50 } else { (i % 2 * 10) as u8 }).collect();
        let (mut sums, mut out) = (vec![0; 8], vec![0.0; 4]);
        cell_contrast(Gray::new(&grey, size).expect("whole"), 4, &mut sums, &mut out);
        // Three steps of 10 and one of 40 in each of four rows, over 32 differences.
        assert_eq!(out, [(3.0 * 10.0 + 40.0) * 4.0 / 32.0, 0.0, 8.75, 0.0]);
    }

    #[test]
    fn the_largest_cell_of_black_and_white_does_not_overflow_and_the_border_has_no_neighbour() {
        let side = MOST_CELL_PX;
        let board: Vec<u8> =
            (0..side * side).map(|i| if (i % side + i / side).is_multiple_of(2) { 0 } else { 255 }).collect();
        let (mut sums, mut out) = (vec![0; side], vec![0.0; 1]);
        cell_contrast(Gray::new(&board, SizePx::new(side, side)).expect("whole"), side, &mut sums, &mut out);
        let steps = 2 * side * (side - 1);
        assert!((out[0] - (255 * steps) as f32 / (2 * side * side) as f32).abs() < 1e-3, "{}", out[0]);
    }
}
