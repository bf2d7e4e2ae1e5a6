//! Grey image -> mask of the pixels darker than a level, the same everywhere or one per pixel.

use super::bits::pack_64;
use crate::image::Mask;

/// Sets exactly the pixels of `grey` (rows without a gap, of the size of `out`) below `level`.
pub fn below_level(grey: &[u8], level: u8, out: &mut Mask) {
    let size = out.size();
    assert_eq!(grey.len(), size.area(), "grey image of another size than the mask");
    let levels = [level; 64];
    for (y, row) in grey.chunks_exact(size.width).enumerate() {
        let (whole, rest) = row.as_chunks::<64>();
        let words = out.row_mut(y);
        for (word, pixels) in words.iter_mut().zip(whole) {
            *word = word_below(pixels, &levels);
        }
        if !rest.is_empty() {
            words[whole.len()] = word_below(&padded(rest), &padded(&levels[..rest.len()]));
        }
    }
}

/// Sets exactly the pixels of `grey` that lie below the same pixel of `levels`.
pub fn below_levels(grey: &[u8], levels: &[u8], out: &mut Mask) {
    let size = out.size();
    assert_eq!(grey.len(), size.area(), "grey image of another size than the mask");
    assert_eq!(levels.len(), size.area(), "level image of another size than the mask");
    for (y, (row, levels)) in grey.chunks_exact(size.width).zip(levels.chunks_exact(size.width)).enumerate() {
        let (whole, rest) = row.as_chunks::<64>();
        let (whole_levels, rest_levels) = levels.as_chunks::<64>();
        let words = out.row_mut(y);
        for ((word, pixels), levels) in words.iter_mut().zip(whole).zip(whole_levels) {
            *word = word_below(pixels, levels);
        }
        if !rest.is_empty() {
            words[whole.len()] = word_below(&padded(rest), &padded(rest_levels));
        }
    }
}

/// Sets exactly the pixels of `grey` more than `levels` above or below the same pixel of `background`.
pub fn far_from(grey: &[u8], background: &[u8], levels: u8, out: &mut Mask) {
    let size = out.size();
    assert_eq!(grey.len(), size.area(), "grey image of another size than the mask");
    assert_eq!(background.len(), size.area(), "background of another size than the mask");
    for (y, (row, under)) in grey.chunks_exact(size.width).zip(background.chunks_exact(size.width)).enumerate() {
        for (word, (row, under)) in out.row_mut(y).iter_mut().zip(row.chunks(64).zip(under.chunks(64))) {
            let far = row.iter().zip(under).map(|(g, u)| u64::from(g.abs_diff(*u) > levels));
            *word = far.enumerate().fold(0, |word, (bit, far)| word | far << bit);
        }
    }
}

/// Sets exactly the pixels whose value, rows without a gap, is at least `level`.
pub fn at_least(values: &[f32], level: f32, out: &mut Mask) {
    let size = out.size();
    assert_eq!(values.len(), size.area(), "values of another size than the mask");
    for (y, row) in values.chunks_exact(size.width).enumerate() {
        for (word, row) in out.row_mut(y).iter_mut().zip(row.chunks(64)) {
            let mut flags = [0; 64];
            flags.iter_mut().zip(row).for_each(|(flag, &v)| *flag = u8::from(v >= level));
            *word = pack_64(&flags);
        }
    }
}

#[inline]
fn word_below(grey: &[u8; 64], levels: &[u8; 64]) -> u64 {
    let mut flags = [0; 64];
    for ((flag, g), level) in flags.iter_mut().zip(grey).zip(levels) {
        *flag = (g < level) as u8;
    }
    pack_64(&flags)
}

/// The end of a row, zeros after it: 0 < 0 is false, so no bit beyond the width is set.
fn padded(rest: &[u8]) -> [u8; 64] {
    let mut out = [0; 64];
    out[..rest.len()].copy_from_slice(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;

    #[test]
    fn far_is_on_both_sides_and_not_at_the_level_itself() {
        let size = SizePx::new(70, 2);
        let mut mask = Mask::new(size);
        let grey: Vec<u8> = (0..140)
            .map(|i| {
                if i == 3 {
                    79
                } else if i == 69 {
                    121
                } else {
                    80
                }
            })
            .collect();
        far_from(&grey, &[100; 140], 20, &mut mask);
        assert_eq!((mask.area_px2(), mask.get(3, 0), mask.get(69, 0)), (2, true, true));
    }

    #[test]
    fn at_the_level_itself_is_at_least_the_level_and_nan_is_not() {
        let mut mask = Mask::new(SizePx::new(67, 2));
        let values: Vec<f32> = (0..134).map(|i| if i == 70 { f32::NAN } else { i as f32 }).collect();
        at_least(&values, 66.0, &mut mask);
        assert_eq!((mask.area_px2(), mask.get(65, 0), mask.get(66, 0), mask.get(3, 1)), (67, false, true, false));
    }

    #[test]
    fn darker_than_the_level() {
        let grey = [9, 10, 11, 12, 10, 9, 8, 0, 255, 10];
        let mut mask = Mask::new(SizePx::new(5, 2));
        below_level(&grey, 10, &mut mask);
        assert_eq!(
            mask,
            Mask::from_picture(
                "#....
                 ###.."
            )
        );
        below_levels(&grey, &[10, 10, 12, 12, 11, 0, 8, 1, 255, 255], &mut mask);
        assert_eq!(
            mask,
            Mask::from_picture(
                "#.#.#
                 ..#.#"
            )
        );
    }

    #[test]
    fn rows_of_several_words_match_pixel_by_pixel() {
        for width in [63, 64, 65, 130] {
            let size = SizePx::new(width, 3);
            let grey: Vec<u8> = (0..size.area()).map(|i| (i * 37 % 256) as u8).collect();
            let levels: Vec<u8> = (0..size.area()).map(|i| (i * 101 % 256) as u8).collect();
            let (mut one, mut each) = (Mask::new(size), Mask::new(size));
            below_level(&grey, 255, &mut one);
            below_levels(&grey, &levels, &mut each);
            for i in 0..size.area() {
                let (x, y) = ((i % width) as isize, (i / width) as isize);
                assert_eq!(one.get(x, y), grey[i] < 255);
                assert_eq!(each.get(x, y), grey[i] < levels[i]);
            }
            let extra = !one.last_word();
            assert_eq!(one.row(0).last().expect("a word") & extra, 0, "bits beyond the width");
        }
    }
}
