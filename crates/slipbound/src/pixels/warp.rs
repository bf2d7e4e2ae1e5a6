//! One channel, one byte per pixel -> the same channel resampled through a fixed map (rectification, flips, crop).
//!
//! ```text
//!   out (x, y) = src at map(x, y)        l --fx-- r      fx, fy in 0..=128 (128ths of a px);
//!                                        |  *     |      128 only at the right or lower border,
//!   bilinear, 0 where map leaves src     l'------ r'     where l is the last pixel but one
//! ```

use super::wide::wide;
use crate::image::{Mask, SizePx};
use crate::plane::Vec2;

/// Fractions of a pixel the table resolves: a sample is taken at most 1/256 px from the mapped position.
const FRACTIONS: u16 = 128;
/// Value of `fraction_y` for a pixel whose source lies outside.
const OUTSIDE: u8 = 255;
/// Number of pixels that are interpolated at once.
const BATCH: usize = 32;

/// A map from output pixels to source pixels, precomputed: 2 to 4 bytes per output pixel, 6 for a map that scatters
/// neighbours.
#[derive(Debug, Clone)]
pub struct WarpTable {
    out_size: SizePx,
    src_size: SizePx,
    batches: Vec<Batch>,
    /// For each batch that is not contiguous in the source, in order: the offset of each pixel from the batch's first.
    offsets: Offsets,
    fraction_x: Vec<u8>,
    fraction_y: Vec<u8>,
    valid: Mask,
}

/// Source of a batch of output pixels.
#[derive(Debug, Clone, Copy)]
struct Batch {
    /// The smallest index of the upper left source pixels.
    first: u32,
    /// Whether the pixels are contiguous in the source, too.
    side_by_side: bool,
}

/// Differences of indices in the source.
#[derive(Debug, Clone)]
enum Offsets {
    Near(Vec<u16>),
    /// For a map that scatters some neighbours far apart.
    Far(Vec<u32>),
}

impl WarpTable {
    /// Tabulates `map`, which gives the place in the source for an output pixel, both in px with pixel centres at whole
    /// numbers. The source needs at least 2 x 2 pixels and fewer than 2^32, else a panic.
    pub fn new(out_size: SizePx, src_size: SizePx, map: impl Fn(Vec2) -> Vec2) -> Self {
        Self::tabulate(out_size, src_size, |p| (map(p), true))
    }

    /// The same, but beyond the border the source's outermost pixels are repeated, because black would make an edge.
    /// Those output pixels are not [`valid`](Self::valid) either.
    pub fn held_at_border(out_size: SizePx, src_size: SizePx, map: impl Fn(Vec2) -> Vec2) -> Self {
        let last = Vec2::new((src_size.width - 1) as f64, (src_size.height - 1) as f64);
        let is_inside = |v: f64, size: usize| whole_and_fraction(v, size).is_some();
        Self::tabulate(out_size, src_size, |p| {
            let p = map(p);
            let inside = is_inside(p.x, src_size.width) && is_inside(p.y, src_size.height);
            let held = Vec2::new(p.x.clamp(0.0, last.x), p.y.clamp(0.0, last.y));
            if inside { (p, true) } else { (held, false) }
        })
    }

    /// `map` also gives whether a place is valid.
    fn tabulate(out_size: SizePx, src_size: SizePx, map: impl Fn(Vec2) -> (Vec2, bool)) -> Self {
        assert!(src_size.width >= 2 && src_size.height >= 2, "source of {src_size}: expected 2x2 or more");
        assert!(src_size.area() <= u32::MAX as usize, "source of {src_size}: too many pixels for the table");
        let area = out_size.area();
        let (mut from, mut fraction_x, mut fraction_y) = (vec![0; area], vec![0; area], vec![OUTSIDE; area]);
        let mut valid = Mask::new(out_size);
        for y in 0..out_size.height {
            for x in 0..out_size.width {
                let (p, is_valid) = map(Vec2::new(x as f64, y as f64));
                let (Some((column, fx)), Some((row, fy))) =
                    (whole_and_fraction(p.x, src_size.width), whole_and_fraction(p.y, src_size.height))
                else {
                    continue;
                };
                let i = y * out_size.width + x;
                from[i] = (row * src_size.width + column) as u32;
                fraction_x[i] = fx;
                fraction_y[i] = fy;
                valid.set(x, y, is_valid);
            }
        }
        // A pixel from outside may be read from anywhere inside: next to its neighbours, if they have room.
        let fits = |first: u32| first as usize + src_size.width + BATCH < src_size.area();
        let side_by_side = |from: &[u32], fy: &[u8]| {
            let known = from.iter().zip(fy).zip(0..).filter(|((_, fy), _)| **fy != OUTSIDE);
            let mut firsts = known.map(|((&from, _), i)| from.checked_sub(i));
            let first = firsts.next().unwrap_or(Some(0));
            first.filter(|&first| from.len() == BATCH && fits(first) && firsts.all(|other| other == Some(first)))
        };
        let (mut batches, mut offsets) = (Vec::with_capacity(area.div_ceil(BATCH)), Vec::new());
        for (from, fy) in from.chunks(BATCH).zip(fraction_y.chunks(BATCH)) {
            let together = side_by_side(from, fy);
            let inside = || from.iter().zip(fy).map(|(&from, &fy)| (fy != OUTSIDE).then_some(from));
            let first = together.or_else(|| inside().flatten().min()).unwrap_or(0);
            if together.is_none() {
                offsets.extend(inside().map(|from| from.map_or(0, |from| from - first)));
            }
            batches.push(Batch { first, side_by_side: together.is_some() });
        }
        let near: Result<Vec<u16>, _> = offsets.iter().map(|&offset| u16::try_from(offset)).collect();
        offsets.shrink_to_fit();
        let offsets = match near {
            Ok(near) => Offsets::Near(near),
            Err(_) => Offsets::Far(offsets),
        };
        WarpTable { out_size, src_size, batches, offsets, fraction_x, fraction_y, valid }
    }

    /// Size of the output.
    pub fn out_size(&self) -> SizePx {
        self.out_size
    }

    /// Size of the source.
    pub fn src_size(&self) -> SizePx {
        self.src_size
    }

    /// The output pixels whose source lies inside the source image.
    pub fn valid(&self) -> &Mask {
        &self.valid
    }

    /// Resamples one channel, rows without a gap in both; an output pixel that is not valid becomes 0.
    pub fn apply(&self, src: &[u8], out: &mut [u8]) {
        assert_eq!(src.len(), self.src_size.area(), "source of another size than the table's");
        assert_eq!(out.len(), self.out_size.area(), "output of another size than the table's");
        match &self.offsets {
            Offsets::Near(offsets) => self.resample(offsets, src, out),
            Offsets::Far(offsets) => self.resample(offsets, src, out),
        }
    }

    fn resample<O: Copy + Into<u32>>(&self, mut offsets: &[O], src: &[u8], out: &mut [u8]) {
        let (mut upper, mut lower) = ([0; BATCH], [0; BATCH]);
        let stride = self.src_size.width;
        let fractions = self.fraction_x.chunks(BATCH).zip(self.fraction_y.chunks(BATCH));
        for ((out, batch), (fx, fy)) in out.chunks_mut(BATCH).zip(&self.batches).zip(fractions) {
            let (n, src) = (out.len(), &src[batch.first as usize..]);
            if batch.side_by_side {
                mix_side_by_side(&src[..=BATCH], &src[stride..][..=BATCH], fx, fy, out);
            } else {
                let (own, later) = offsets.split_at(n);
                offsets = later;
                fetch(src, stride, own, &mut upper[..n], &mut lower[..n]);
                mix(&upper[..n], &lower[..n], fx, fy, out);
            }
        }
    }
}

/// Splits a coordinate into the pixel before it and the 128ths after; None outside `0..=len - 1`.
fn whole_and_fraction(at: f64, len: usize) -> Option<(usize, u8)> {
    let exact = at * f64::from(FRACTIONS);
    let last = (len - 1) * usize::from(FRACTIONS);
    if !(exact > -0.5 && exact < last as f64 + 0.5) {
        return None; // NaN, too
    }
    // The nearest one: `round` is a call where the CPU is not known to have the instruction.
    let before = exact as usize;
    let steps = before + usize::from(exact - before as f64 >= 0.5);
    let whole = (steps / usize::from(FRACTIONS)).min(len - 2);
    Some((whole, (steps - whole * usize::from(FRACTIONS)) as u8))
}

/// The pairs of neighbouring source pixels, left in the low byte, right in the high one.
fn fetch<O: Copy + Into<u32>>(src: &[u8], stride: usize, offsets: &[O], upper: &mut [u16], lower: &mut [u16]) {
    for ((upper, lower), &offset) in upper.iter_mut().zip(lower).zip(offsets) {
        let offset: u32 = offset.into();
        let corner = &src[offset as usize..][..stride + 2];
        *upper = u16::from_le_bytes([corner[0], corner[1]]);
        *lower = u16::from_le_bytes([corner[stride], corner[stride + 1]]);
    }
}

wide! {
    /// Bilinear mean of pairs of pixels, left in the low byte, right in the high one.
    fn mix(upper: &[u16], lower: &[u16], fraction_x: &[u8], fraction_y: &[u8], out: &mut [u8]) {
        let fractions = fraction_x.iter().zip(fraction_y);
        for ((out, (&upper, &lower)), (&fx, &fy)) in out.iter_mut().zip(upper.iter().zip(lower)).zip(fractions) {
            *out = mixed(upper & 255, upper >> 8, lower & 255, lower >> 8, fx, fy);
        }
    }

    /// The same for contiguous pixels; the rows have one value more than there are pixels.
    fn mix_side_by_side(upper: &[u8], lower: &[u8], fraction_x: &[u8], fraction_y: &[u8], out: &mut [u8]) {
        let n = out.len();
        let (upper_left, upper_right) = (&upper[..n], &upper[1..][..n]);
        let (lower_left, lower_right) = (&lower[..n], &lower[1..][..n]);
        let (fraction_x, fraction_y) = (&fraction_x[..n], &fraction_y[..n]);
        for i in 0..n {
            let [a, b] = [upper_left, upper_right].map(|row| u16::from(row[i]));
            let [c, d] = [lower_left, lower_right].map(|row| u16::from(row[i]));
            out[i] = mixed(a, b, c, d, fraction_x[i], fraction_y[i]);
        }
    }
}

/// Bilinear mean in integers, to 2/128 of a level before rounding; exact where a fraction is 0 or 128.
#[inline(always)]
fn mixed(upper_left: u16, upper_right: u16, lower_left: u16, lower_right: u16, fx: u8, fy: u8) -> u8 {
    // The high half of a product of 16-bit numbers, which is one instruction for 8 or more of them.
    let high = |a: u16, b: u16| ((u32::from(a) * u32::from(b)) >> 16) as u16;
    let right = u16::from(fx);
    let left = FRACTIONS - right;
    // 256ths of a level, at most 255 * 256; and weights of 2^-15.
    let above = (upper_left * left + upper_right * right) << 1;
    let below = (lower_left * left + lower_right * right) << 1;
    let down = u16::from(fy) << 8;
    let up = (FRACTIONS << 8).wrapping_sub(down);
    let level_128ths = high(above, up).wrapping_add(high(below, down));
    let keep = if fy == OUTSIDE { 0 } else { u16::MAX };
    ((level_128ths.wrapping_add(FRACTIONS / 2) >> 7) & keep) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Homography;

    fn noise(size: SizePx) -> Vec<u8> {
        (0..size.area() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
    }

    #[test]
    fn identity_copies_every_pixel_and_flip_turns_them() {
        let size = SizePx::new(131, 3);
        let src = noise(size);
        let mut out = vec![0; size.area()];
        let same = WarpTable::new(size, size, |p| p);
        same.apply(&src, &mut out);
        assert_eq!(out, src);
        assert_eq!(same.valid().area_px2(), size.area());
        WarpTable::new(size, size, |p| Vec2::new(130.0 - p.x, 2.0 - p.y)).apply(&src, &mut out);
        out.reverse();
        assert_eq!(out, src);
    }

    #[test]
    fn outside_is_zero_and_not_valid() {
        let size = SizePx::new(6, 4);
        let table = WarpTable::new(size, size, |p| p + Vec2::new(2.0, -1.0));
        let mut out = vec![7; size.area()];
        table.apply(&[200; 24], &mut out);
        let expected = Mask::from_picture(
            "......
             ####..
             ####..
             ####..",
        );
        assert_eq!(table.valid(), &expected);
        for (i, &level) in out.iter().enumerate() {
            assert_eq!(level, if expected.get((i % 6) as isize, (i / 6) as isize) { 200 } else { 0 });
        }
        let nowhere = WarpTable::new(size, size, |_| Vec2::new(f64::NAN, 0.0));
        assert_eq!(nowhere.valid().area_px2(), 0);
    }

    #[test]
    fn a_homography_matches_bilinear_sampling_in_floating_point() {
        let (out_size, src_size) = (SizePx::new(327, 320), SizePx::new(427, 320));
        let forward = Homography([
            [0.79809213, -0.33790120, 41.21788310],
            [0.03669927, 0.84359564, -24.59355941],
            [-0.00010275817, -0.00143881538, 1.0],
        ]);
        let back = forward.inverse().expect("regular");
        let map = |p: Vec2| back.apply(p + Vec2::new(50.0, 0.0));
        // A smooth image, so that 1/256 px is well below a level.
        let level = |x: f64, y: f64| 127.0 + 60.0 * (x / 9.0).sin() + 60.0 * (y / 7.0).cos();
        let src: Vec<u8> =
            (0..src_size.area()).map(|i| level((i % 427) as f64, (i / 427) as f64).round() as u8).collect();
        let table = WarpTable::new(out_size, src_size, map);
        let mut out = vec![0; out_size.area()];
        table.apply(&src, &mut out);
        let mut judged = 0;
        for (i, &got) in out.iter().enumerate() {
            let p = map(Vec2::new((i % 327) as f64, (i / 327) as f64));
            if !(p.x > 0.0 && p.y > 0.0 && p.x < 426.0 && p.y < 319.0) {
                continue;
            }
            let (x, y) = (p.x.floor(), p.y.floor());
            let at = |dx: usize, dy: usize| f64::from(src[(y as usize + dy) * 427 + x as usize + dx]);
            let (fx, fy) = (p.x - x, p.y - y);
            let above = at(0, 0) * (1.0 - fx) + at(1, 0) * fx;
            let below = at(0, 1) * (1.0 - fx) + at(1, 1) * fx;
            let exact = above * (1.0 - fy) + below * fy;
            assert!((f64::from(got) - exact).abs() < 0.6, "pixel {i}: {got}, expected {exact}");
            judged += 1;
        }
        assert!(judged > 90_000, "only {judged} pixels judged");
    }

    #[test]
    fn neighbours_may_come_from_far_apart() {
        let (size, src_size) = (SizePx::new(70, 3), SizePx::new(640, 300));
        let src = noise(src_size);
        let place = |x: usize, y: usize| (7 * x + y, if x.is_multiple_of(2) { y } else { 290 - y });
        let table = WarpTable::new(size, src_size, |p| {
            let (x, y) = place(p.x as usize, p.y as usize);
            Vec2::new(x as f64, y as f64)
        });
        assert!(matches!(table.offsets, Offsets::Far(_)), "290 rows are more than 16 bits of pixels");
        let mut out = vec![0; size.area()];
        table.apply(&src, &mut out);
        for (i, &level) in out.iter().enumerate() {
            let (x, y) = place(i % 70, i / 70);
            assert_eq!(level, src[y * 640 + x], "pixel {i}");
        }
    }

    #[test]
    fn pixels_side_by_side_are_mixed_like_others() {
        let size = SizePx::new(640, 37);
        let src = noise(size);
        let turned = Homography([[1.0, 0.02, -5.0], [-0.02, 1.0, 6.0], [0.0, 0.0, 1.0]]);
        let mut table = WarpTable::new(size, size, |p| turned.apply(p));
        let count = table.batches.iter().filter(|batch| batch.side_by_side).count();
        let all = table.batches.len();
        assert!(count > all / 4 && count < 9 * all / 10, "both ways are judged: {count} of {all} batches");
        let (mut by_batches, mut one_by_one) = (vec![0; size.area()], vec![0; size.area()]);
        table.apply(&src, &mut by_batches);
        let Offsets::Near(offsets) = &table.offsets else { panic!("a slight turn scatters nothing") };
        let (mut apart, mut own) = (Vec::new(), offsets.chunks(BATCH));
        for batch in &mut table.batches {
            let offsets: Vec<u32> = match std::mem::take(&mut batch.side_by_side) {
                true => (0..BATCH as u32).collect(),
                false => own.next().expect("its offsets").iter().map(|&offset| offset.into()).collect(),
            };
            apart.extend(offsets);
        }
        table.offsets = Offsets::Far(apart);
        table.apply(&src, &mut one_by_one);
        assert_eq!(by_batches, one_by_one);
        // Contiguous batches may contain pixels from outside, which are black.
        for (i, level) in by_batches.iter().enumerate() {
            assert!(table.valid.get((i % 640) as isize, (i / 640) as isize) || *level == 0, "pixel {i}");
        }
    }
}
