//! Mean colour of square cells: colour pixels -> a coarse image of block means, three numbers per cell.

use super::wide::wide;
use crate::image::{ByteOrder, Pixels, SizePx};
use std::ops::Range;

/// A coarse image: block means in grey levels, row by row.
#[derive(Debug, Clone)]
pub struct Cells {
    cell_px: usize,
    columns: usize,
    rows: usize,
    sums: Vec<u16>,
    sums_next: Vec<u16>,
    means: Vec<[f32; 3]>,
}

impl Cells {
    /// Cells of `cell_px` x `cell_px` pixels (at most 16) on an image of `size`; the remainder at the right and lower
    /// border is not covered.
    pub fn new(size: SizePx, cell_px: usize) -> Self {
        assert!((1..=16).contains(&cell_px), "16-bit column sums hold cells of at most 16 px");
        let (columns, rows) = (size.width / cell_px, size.height / cell_px);
        let sums = vec![0; columns * cell_px * 3];
        Cells { cell_px, columns, rows, sums_next: sums.clone(), sums, means: vec![[0.0; 3]; columns * rows] }
    }

    /// Side of a cell in pixels.
    pub fn cell_px(&self) -> usize {
        self.cell_px
    }

    /// Cells in a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows of cells.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Red, green and blue means in levels, row by row; a grey image has three equal ones.
    pub fn means_levels(&self) -> &[[f32; 3]] {
        &self.means
    }

    /// Computes the means of an image of the size given to `new`.
    pub fn run(&mut self, pixels: &Pixels<'_>) {
        self.run_rows(pixels, 0..self.rows);
    }

    /// Computes the means of some rows of cells only; the others are kept.
    pub fn run_rows(&mut self, pixels: &Pixels<'_>, cell_rows: Range<usize>) {
        match pixels {
            Pixels::Rgb(image) => {
                self.run_channels::<3>(cell_rows.clone(), |y| image.row(y));
                if image.order() == ByteOrder::Bgr {
                    let cells = cell_rows.start * self.columns..cell_rows.end * self.columns;
                    self.means[cells].iter_mut().for_each(|mean| mean.reverse());
                }
            }
            Pixels::Gray(image) => self.run_channels::<1>(cell_rows, |y| image.row(y)),
        }
    }

    fn run_channels<'a, const CHANNELS: usize>(&mut self, cell_rows: Range<usize>, row: impl Fn(usize) -> &'a [u8]) {
        let (c, used) = (self.cell_px, self.columns * self.cell_px * CHANNELS);
        let per_level = 1.0 / (c * c) as f32;
        for cell_row in cell_rows {
            let means = &mut self.means[cell_row * self.columns..][..self.columns];
            let sums = &mut self.sums[..used];
            let (mut y, end) = (cell_row * c, (cell_row + 1) * c);
            let four = |y: usize| [0, 1, 2, 3].map(|below| row(y + below));
            if y + 4 <= end {
                sum_four(four(y), sums);
                y += 4;
            } else {
                sums.fill(0);
            }
            while y + 4 <= end {
                add_four(four(y), sums);
                y += 4;
            }
            (y..end).for_each(|y| add_bytes(row(y), sums));
            // Adds to each pixel those to its right: one, then three, then seven; a sum over 16 x 16 pixels still fits.
            let (mut sums, mut next, mut pixels) = (sums, &mut self.sums_next[..used], 1);
            while c.is_multiple_of(2 * pixels) {
                add_right(sums, pixels * CHANNELS, next);
                std::mem::swap(&mut sums, &mut next);
                pixels *= 2;
            }
            if pixels == c {
                scale::<CHANNELS>(sums, c * CHANNELS, per_level, means);
                continue;
            }
            for (mean, block) in means.iter_mut().zip(sums.chunks_exact(c * CHANNELS)) {
                let mut total = [0u32; CHANNELS];
                for pixel in block.chunks_exact(CHANNELS).step_by(pixels) {
                    for (t, &v) in total.iter_mut().zip(pixel) {
                        *t += u32::from(v);
                    }
                }
                *mean = std::array::from_fn(|k| total[k.min(CHANNELS - 1)] as f32 * per_level);
            }
        }
    }
}

wide! {
    /// The channels at the start of each stretch of sums, times a factor; a single channel is used for all three.
    fn scale<const CHANNELS: usize>(sums: &[u16], stretch: usize, factor: f32, means: &mut [[f32; 3]]) {
        for (mean, sums) in means.iter_mut().zip(sums.chunks_exact(stretch)) {
            *mean = std::array::from_fn(|k| f32::from(sums[k.min(CHANNELS - 1)]) * factor);
        }
    }

    fn add_bytes(row: &[u8], sums: &mut [u16]) {
        sums.iter_mut().zip(row).for_each(|(sum, &value)| *sum += u16::from(value));
    }

    /// Replaces the sums by those of four rows.
    fn sum_four(rows: [&[u8]; 4], sums: &mut [u16]) {
        let n = sums.len();
        let [a, b, c, d] = rows.map(|row| &row[..n]);
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = u16::from(a[i]) + u16::from(b[i]) + u16::from(c[i]) + u16::from(d[i]);
        }
    }

    /// Adds four rows at once: each sum is loaded and stored once for all four.
    fn add_four(rows: [&[u8]; 4], sums: &mut [u16]) {
        let n = sums.len();
        let [a, b, c, d] = rows.map(|row| &row[..n]);
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += u16::from(a[i]) + u16::from(b[i]) + u16::from(c[i]) + u16::from(d[i]);
        }
    }

    /// Adds to each sum the one `away` further on; the last `away` are unchanged. Sums beyond those of this row, left by
    /// an image with more channels, may wrap; none of them is read.
    fn add_right(sums: &[u16], away: usize, out: &mut [u16]) {
        let right = &sums[away.min(sums.len())..];
        out.iter_mut().zip(sums.iter().zip(right)).for_each(|(out, (a, b))| *out = a.wrapping_add(*b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Gray, Rgb};

    #[test]
    fn cells_are_block_means_of_each_channel() {
        let size = SizePx::new(9, 4); // the ninth column is left over
        let rgb: Vec<u8> = (0..size.area()).flat_map(|i| [(i % 9 / 4 * 100) as u8, 7, (i / 9) as u8]).collect();
        let mut cells = Cells::new(size, 4);
        cells.run(&Pixels::Rgb(Rgb::new(&rgb, size).expect("whole")));
        assert_eq!(cells.means_levels(), &[[0.0, 7.0, 1.5], [100.0, 7.0, 1.5]]);
        let expected = cells.means_levels().to_vec();
        let bgr: Vec<u8> = rgb.chunks(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
        cells.run(&Pixels::Rgb(Rgb::new(&bgr, size).expect("whole").in_order(ByteOrder::Bgr)));
        assert_eq!(cells.means_levels(), expected);
        let grey: Vec<u8> = vec![255; size.area()];
        cells.run(&Pixels::Gray(Gray::new(&grey, size).expect("whole")));
        assert_eq!(cells.means_levels(), &[[255.0; 3]; 2]);
    }

    /// Sums of the larger image are left over.
    #[test]
    fn a_grey_image_after_a_colour_one_has_its_own_means() {
        let size = SizePx::new(64, 16);
        let mut cells = Cells::new(size, 16);
        let white = vec![255; 3 * size.area()];
        cells.run(&Pixels::Rgb(Rgb::new(&white, size).expect("whole")));
        cells.run(&Pixels::Gray(Gray::new(&white[..size.area()], size).expect("whole")));
        assert_eq!(cells.means_levels(), &[[255.0; 3]; 4]);
    }
}
