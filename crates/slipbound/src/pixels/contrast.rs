//! Contrast of square cells: grey picture -> mean difference of neighbouring pixels, one number a cell.

use crate::image::Gray;

/// Writes for each cell of `cell_px` x `cell_px` pixels, row by row, the mean absolute difference between a pixel and
/// those to its right and below, in levels. `out` holds as many whole cells as the picture has.
pub fn cell_contrast(grey: Gray<'_>, cell_px: usize, sums: &mut [u32], out: &mut [f32]) {
    let size = grey.size();
    let columns = size.width / cell_px;
    let per_pixel = 1.0 / (2 * cell_px * cell_px) as f32;
    for (cell_row, out) in out.chunks_exact_mut(columns.max(1)).enumerate() {
        sums[..columns].fill(0);
        for y in cell_row * cell_px..(cell_row + 1) * cell_px {
            let row = grey.row(y);
            let below = grey.row((y + 1).min(size.height - 1));
            for (column, sum) in sums[..columns].iter_mut().enumerate() {
                let (from, to) = (column * cell_px, (column + 1) * cell_px);
                // The last pixel of a row has none to its right.
                let right = &row[from + 1..(to + 1).min(size.width)];
                let steps = |of: &[u8], with: &[u8]| -> u32 {
                    of.iter().zip(with).map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
                };
                *sum += steps(&row[from..to], right) + steps(&row[from..to], &below[from..to]);
            }
        }
        for (out, &sum) in out.iter_mut().zip(sums.iter()) {
            *out = sum as f32 * per_pixel;
        }
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
        let (mut sums, mut out) = (vec![0; 2], vec![0.0; 4]);
        cell_contrast(Gray::new(&grey, size).expect("whole"), 4, &mut sums, &mut out);
        // Three steps of 10 and one of 40 in each of four rows, over 32 differences.
        assert_eq!(out, [(3.0 * 10.0 + 40.0) * 4.0 / 32.0, 0.0, 8.75, 0.0]);
    }
}
