//! Pixel operations of the faults.

use slipbound::image::SizePx;
use slipbound::port::PixelFormat;

/// Every byte times a gain, rounded, at most 255.
pub(super) fn multiply(bytes: &mut [u8], gain: f64) {
    if gain == 1.0 {
        return;
    }
    let table: [u8; 256] = std::array::from_fn(|level| (level as f64 * gain).round().min(255.0) as u8);
    for byte in bytes {
        *byte = table[usize::from(*byte)];
    }
}

/// Every pixel becomes the mean of `over_px` pixels of its row around it, an odd number; near the ends, of the existing
/// ones.
pub(super) fn blur_rows(bytes: &mut [u8], row_bytes: usize, channels: usize, over_px: usize) {
    let half = over_px / 2;
    let width = row_bytes / channels;
    let mut sums = vec![0u32; width + 1];
    for row in bytes.chunks_exact_mut(row_bytes) {
        for channel in 0..channels {
            for x in 0..width {
                sums[x + 1] = sums[x] + u32::from(row[x * channels + channel]);
            }
            for x in 0..width {
                let (from, to) = (x.saturating_sub(half), (x + half + 1).min(width));
                let count = (to - from) as u32;
                row[x * channels + channel] = ((sums[to] - sums[from] + count / 2) / count) as u8;
            }
        }
    }
}

/// Paints squares (left, top, side in px) with the mean colour of their border.
pub(super) fn hide_spots(bytes: &mut [u8], size: SizePx, format: PixelFormat, spots: &[[usize; 3]]) {
    let channels = format.bytes_per_pixel();
    for &[left, top, side] in spots {
        let (right, bottom) = ((left + side).min(size.width), (top + side).min(size.height));
        if right <= left || bottom <= top {
            continue;
        }
        for channel in 0..channels {
            let at = |x: usize, y: usize| (y * size.width + x) * channels + channel;
            let rim = (left..right).flat_map(|x| [at(x, top), at(x, bottom - 1)]);
            let rim = rim.chain((top..bottom).flat_map(|y| [at(left, y), at(right - 1, y)]));
            let (sum, count) = rim.fold((0u32, 0u32), |(sum, count), i| (sum + u32::from(bytes[i]), count + 1));
            let mean = (sum / count) as u8;
            for y in top..bottom {
                for x in left..right {
                    bytes[at(x, y)] = mean;
                }
            }
        }
    }
}
