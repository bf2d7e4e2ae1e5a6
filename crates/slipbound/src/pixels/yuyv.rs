//! Pixels as many cameras deliver them, two to four bytes Y U Y V, as red, green and blue.
//!
//! ITU-R BT.601, limited range: Y of 16 is black, of 235 white; colour is relative to 128. Integers of 2^-20, rounded
//! once: the same bytes everywhere, and those of OpenCV's `COLOR_YUV2RGB_YUYV`.

use crate::image::{ImageError, SizePx};

/// 255/219, 1.596, -0.813, -0.391 and 2.018 times 2^20.
const Y: i32 = 1_220_542;
const V_RED: i32 = 1_673_527;
const V_GREEN: i32 = -852_492;
const U_GREEN: i32 = -409_993;
const U_BLUE: i32 = 2_116_026;
const SHIFT: u32 = 20;
const HALF: i32 = 1 << (SHIFT - 1);

/// Converts an image whose rows begin `stride_bytes` apart into `rgb`, three bytes per pixel, rows without gaps. An odd
/// last column uses the colour of its own pair, of which the camera sends both. Fails when a buffer is too short, or
/// when the image is empty.
pub fn to_rgb(yuyv: &[u8], size: SizePx, stride_bytes: usize, rgb: &mut [u8]) -> Result<(), ImageError> {
    if size.area() == 0 {
        return Err(ImageError::Empty);
    }
    let row_bytes = 4 * size.width.div_ceil(2);
    if stride_bytes < row_bytes {
        return Err(ImageError::StrideTooSmall { expected_bytes: row_bytes, got_bytes: stride_bytes });
    }
    let too_short = |expected_bytes, got_bytes| Err(ImageError::TooShort { expected_bytes, got_bytes });
    let expected_bytes = stride_bytes * (size.height - 1) + row_bytes;
    if yuyv.len() < expected_bytes {
        return too_short(expected_bytes, yuyv.len());
    }
    if rgb.len() < 3 * size.area() {
        return too_short(3 * size.area(), rgb.len());
    }
    for (from, to) in yuyv.chunks(stride_bytes).zip(rgb.chunks_exact_mut(3 * size.width)) {
        for (pair, out) in from[..row_bytes].chunks_exact(4).zip(to.chunks_mut(6)) {
            let (u, v) = (i32::from(pair[1]) - 128, i32::from(pair[3]) - 128);
            let colour = [HALF + V_RED * v, HALF + V_GREEN * v + U_GREEN * u, HALF + U_BLUE * u];
            for (luma, pixel) in [pair[0], pair[2]].into_iter().zip(out.chunks_exact_mut(3)) {
                let luma = (i32::from(luma) - 16).max(0) * Y;
                for (value, part) in pixel.iter_mut().zip(colour) {
                    *value = ((luma + part) >> SHIFT).clamp(0, 255) as u8;
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(yuyv: &[u8], width: usize, height: usize, stride_bytes: usize) -> Result<Vec<u8>, ImageError> {
        let mut rgb = vec![7; 3 * width * height];
        to_rgb(yuyv, SizePx::new(width, height), stride_bytes, &mut rgb).map(|()| rgb)
    }

    #[test]
    fn black_white_and_the_primaries_are_those_of_bt_601() {
        for (y, u, v, expected) in [
            (16, 128, 128, [0, 0, 0]),
            (235, 128, 128, [255, 255, 255]),
            (126, 128, 128, [128, 128, 128]),
            (81, 90, 240, [254, 0, 0]),
            (145, 54, 34, [0, 255, 1]),
            (41, 240, 110, [0, 0, 255]),
            (0, 128, 128, [0, 0, 0]),
            (255, 128, 128, [255, 255, 255]),
        ] {
            assert_eq!(pixels(&[y, u, y, v], 2, 1, 4), Ok([expected, expected].concat()), "{y} {u} {v}");
        }
    }

    /// Never a level off from the standard's real-number formula, rounded.
    #[test]
    fn every_colour_is_within_a_level_of_the_exact_one() {
        for y in (0..=255).step_by(5) {
            for u in (0..=255).step_by(5) {
                for v in (0..=255).step_by(5) {
                    let got = pixels(&[y, u, y, v], 2, 1, 4).expect("a pair");
                    let (luma, u, v) =
                        (1.164 * (f64::from(y) - 16.0).max(0.0), f64::from(u) - 128.0, f64::from(v) - 128.0);
                    let exact = [luma + 1.596 * v, luma - 0.813 * v - 0.391 * u, luma + 2.018 * u];
                    for (got, exact) in got.iter().zip(exact) {
                        assert!((f64::from(*got) - exact.clamp(0.0, 255.0)).abs() <= 1.0, "{y} {u} {v}");
                    }
                }
            }
        }
    }

    #[test]
    fn padded_rows_and_odd_widths_are_taken_as_they_are() {
        let grey = |y: u8| [y, 128];
        let row = |a, b, c| [grey(a), grey(b), grey(c), grey(99), [1, 2]].concat();
        let bytes = [row(16, 126, 235), row(235, 16, 126)].concat();
        let levels: Vec<u8> = pixels(&bytes, 3, 2, 10).expect("fits").chunks(3).map(|pixel| pixel[1]).collect();
        assert_eq!(levels, [0, 128, 255, 255, 0, 128]);
    }

    #[test]
    fn buffers_that_are_too_short_are_refused() {
        assert_eq!(pixels(&[0; 4], 0, 1, 4), Err(ImageError::Empty));
        assert_eq!(pixels(&[0; 8], 2, 2, 3), Err(ImageError::StrideTooSmall { expected_bytes: 4, got_bytes: 3 }));
        assert_eq!(pixels(&[0; 7], 2, 2, 4), Err(ImageError::TooShort { expected_bytes: 8, got_bytes: 7 }));
        let short = to_rgb(&[0; 8], SizePx::new(2, 2), 4, &mut [0; 11]);
        assert_eq!(short, Err(ImageError::TooShort { expected_bytes: 12, got_bytes: 11 }));
    }
}
