//! Camera frames of one size -> their mean, as colour pixels; a grey image -> its mean level.

use super::wide::wide;
use crate::image::{Pixels, SizePx};

/// Mean of every fourth row of a grey image, rows without a gap.
pub fn mean_levels(grey: &[u8], width: usize) -> f64 {
    let rows = grey.chunks_exact(width).step_by(4);
    let count = rows.len() * width;
    rows.map(sum_of_row).sum::<u64>() as f64 / count as f64
}

wide! {
    fn sum_of_row(row: &[u8]) -> u64 {
        row.chunks(1 << 16).map(|part| u64::from(part.iter().map(|&v| u32::from(v)).sum::<u32>())).sum()
    }
}

/// Sums of frames.
#[derive(Debug, Clone)]
pub struct FrameMean {
    size: SizePx,
    sums: Vec<u32>,
    frames_count: u32,
}

impl FrameMean {
    /// No frame yet.
    pub fn new(size: SizePx) -> Self {
        FrameMean { size, sums: vec![0; 3 * size.area()], frames_count: 0 }
    }

    /// Adds a frame of the size given to `new`, up to 2^24 of them; a grey one counts as three equal channels.
    pub fn add(&mut self, pixels: &Pixels<'_>) {
        assert_eq!(pixels.size(), self.size, "frame of another size");
        for (y, sums) in self.sums.chunks_exact_mut(3 * self.size.width).enumerate() {
            match pixels {
                Pixels::Rgb(image) => {
                    for (sums, pixel) in sums.as_chunks_mut::<3>().0.iter_mut().zip(image.row(y).as_chunks::<3>().0) {
                        sums.iter_mut().zip(image.order().rgb(*pixel)).for_each(|(s, v)| *s += u32::from(v));
                    }
                }
                Pixels::Gray(image) => {
                    for (sums, &v) in sums.chunks_exact_mut(3).zip(image.row(y)) {
                        sums.iter_mut().for_each(|s| *s += u32::from(v));
                    }
                }
            }
        }
        self.frames_count += 1;
    }

    /// The mean as bytes red, green, blue, a half rounded upwards; black without any frame.
    pub fn rgb(&self) -> Vec<u8> {
        let n = self.frames_count.max(1);
        self.sums.iter().map(|s| ((s + n / 2) / n) as u8).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{ByteOrder, Gray, Rgb};

    #[test]
    fn grey_and_colour_frames_have_one_mean() {
        let size = SizePx::new(2, 1);
        let mut mean = FrameMean::new(size);
        mean.add(&Pixels::Gray(Gray::new(&[10, 200], size).expect("whole")));
        let mut other = mean.clone();
        mean.add(&Pixels::Rgb(Rgb::new(&[20, 11, 10, 100, 200, 255], size).expect("whole")));
        assert_eq!(mean.rgb(), [15, 11, 10, 150, 200, 228]);
        let bgr = Rgb::new(&[10, 11, 20, 255, 200, 100], size).expect("whole").in_order(ByteOrder::Bgr);
        other.add(&Pixels::Rgb(bgr));
        assert_eq!(other.rgb(), mean.rgb());
    }
}
