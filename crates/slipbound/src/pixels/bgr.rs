//! Pixels in the order blue, green, red, as some programs and cameras deliver them, converted to red, green, blue.

use crate::image::{ImageError, Rgb, SizePx};

/// Converts an image whose rows begin `stride_bytes` apart into `rgb`, rows without gaps. Fails when a buffer is too
/// short, or when the image is empty.
pub fn to_rgb(bgr: &[u8], size: SizePx, stride_bytes: usize, rgb: &mut [u8]) -> Result<(), ImageError> {
    let rows = Rgb::with_stride(bgr, size, stride_bytes)?;
    if rgb.len() < 3 * size.area() {
        return Err(ImageError::TooShort { expected_bytes: 3 * size.area(), got_bytes: rgb.len() });
    }
    for (y, to) in rgb.chunks_exact_mut(3 * size.width).take(size.height).enumerate() {
        for (from, to) in rows.row(y).chunks_exact(3).zip(to.chunks_exact_mut(3)) {
            to.copy_from_slice(&[from[2], from[1], from[0]]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blue_comes_last_and_padding_is_left_out() {
        let mut rgb = [0; 12];
        let bgr = [1, 2, 3, 4, 5, 6, 99, 7, 8, 9, 10, 11, 12];
        assert_eq!(to_rgb(&bgr, SizePx::new(2, 2), 7, &mut rgb), Ok(()));
        assert_eq!(rgb, [3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10]);
        assert!(to_rgb(&bgr, SizePx::new(2, 2), 7, &mut rgb[..11]).is_err(), "no room");
        assert!(to_rgb(&bgr[..12], SizePx::new(2, 2), 7, &mut rgb).is_err(), "cut");
    }
}
