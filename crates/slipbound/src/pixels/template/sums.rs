//! Samples for the fit of a template: a rectangle of samples between pixels, and its sums: integers, the same in any
//! order.

use crate::pixels::wide::wide;

/// Number of pixels that are sampled in parallel; windows are at least as wide.
pub(super) const LANES: usize = 16;
/// Number of pixels that are weighted in parallel.
pub(super) const WEIGHED_LANES: usize = 32;
/// Lists of samples and weights have a multiple of this length, zeros at the end.
pub(super) const ROUND: usize = 64;
/// Sampled value of the middle of the range, in sixteenths of levels.
const MIDDLE_STEPS: i16 = 2048;

wide! {
    /// The twin of [`avx2::bilinear`] and [`avx512::bilinear`], which give the same samples.
    fn bilinear_plain(grey: &[u8], stride: usize, width: usize, shift: [i16; 2], out: &mut [i16]) {
        let [fx, fy] = shift;
        for at in columns(width) {
            let mut rows = grey[at..].chunks(stride);
            let Some(mut upper) = rows.next().and_then(|row| between_columns(row, fx)) else { return };
            for (out, row) in out[at..].chunks_mut(width).zip(rows) {
                let Some(lower) = between_columns(row, fx) else { return };
                let Some(out) = out.first_chunk_mut::<LANES>() else { return };
                for i in 0..LANES {
                    // Sixteenths of sixteenths would overflow: the last step uses halves of levels.
                    out[i] = upper[i] + ((((lower[i] - upper[i]) >> 1) * fy) >> 3) - MIDDLE_STEPS;
                }
                upper = lower;
            }
        }
    }

    /// The twin of [`avx2::products`] and [`avx512::products`], which give the same sums.
    fn products_plain<const LISTS: usize>(samples: &[i16], weights: &[[[i8; WEIGHED_LANES]; LISTS]]) -> [i64; LISTS] {
        let mut sums = [0; LISTS];
        for (samples, weights) in samples.as_chunks::<WEIGHED_LANES>().0.iter().zip(weights) {
            for k in 0..LISTS {
                let mut part = 0;
                for i in 0..WEIGHED_LANES {
                    part += i32::from(samples[i]) * i32::from(weights[k][i]);
                }
                sums[k] += i64::from(part);
            }
        }
        sums
    }

    /// Sum of squares, each with its weight in 256ths.
    pub(super) fn energy(samples: &[i16], share: &[i16]) -> i64 {
        let mut sum = 0i64;
        for (a, s) in samples.chunks(4 * ROUND).zip(share.chunks(4 * ROUND)) {
            let mut part = 0i32;
            for (&a, &s) in a.iter().zip(s) {
                let shared = ((i32::from(a) * i32::from(s)) >> 8) as i16;
                part = part.wrapping_add(i32::from(shared) * i32::from(a));
            }
            sum += i64::from(part);
        }
        sum
    }
}

/// Samples of a row, `fx` sixteenths of the way to the next pixel, in sixteenths of levels.
#[inline(always)]
fn between_columns(row: &[u8], fx: i16) -> Option<[i16; LANES]> {
    let pixels = row.first_chunk::<{ LANES + 1 }>()?;
    let mut out = [0; LANES];
    for i in 0..LANES {
        let (left, right) = (i16::from(pixels[i]), i16::from(pixels[i + 1]));
        out[i] = left * 16 + (right - left) * fx;
    }
    Some(out)
}

/// Start columns of the lanes in a row of samples: the last lanes may overlap those before them.
fn columns(width: usize) -> impl Iterator<Item = usize> {
    (0..width.div_ceil(LANES)).map(move |k| (k * LANES).min(width - LANES))
}

/// A rectangle of samples between pixels, offset by these sixteenths along x and y; minus the middle of the range.
pub(super) fn bilinear(grey: &[u8], stride: usize, width: usize, shift: [i16; 2], out: &mut [i16]) {
    #[cfg(target_arch = "x86_64")]
    {
        use crate::pixels::wide::{Vectors, vectors};
        // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature of the one kernel, or AVX-512
        // with VBMI, the features of the other.
        #[allow(unsafe_code)]
        if vectors() >= Vectors::Avx512Vnni && width <= avx512::WIDEST {
            return unsafe { avx512::bilinear(grey, stride, width, shift, out) };
        } else if vectors() >= Vectors::Avx2 {
            return unsafe { avx2::bilinear(grey, stride, width, shift, out) };
        }
    }
    bilinear_plain(grey, stride, width, shift, out);
}

/// Sums of products of the samples with each list of weights.
pub(super) fn products<const LISTS: usize>(samples: &[i16], weights: &[[[i8; WEIGHED_LANES]; LISTS]]) -> [i64; LISTS] {
    #[cfg(target_arch = "x86_64")]
    {
        use crate::pixels::wide::{Vectors, vectors};
        // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature of the one kernel, or AVX-512
        // with VNNI, the features of the other.
        #[allow(unsafe_code)]
        if vectors() >= Vectors::Avx512Vnni {
            return unsafe { avx512::products(samples, weights) };
        } else if vectors() >= Vectors::Avx2 {
            return unsafe { avx2::products(samples, weights) };
        }
    }
    products_plain(samples, weights)
}

/// Each sample is loaded once for all lists, and their sums stay in registers: a third of the time of the compiled
/// twin.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{LANES, MIDDLE_STEPS, WEIGHED_LANES, columns};
    use crate::pixels::lanes::{bytes, put, signed_bytes, sum, words};
    use std::arch::x86_64::*;

    /// Rounds whose products are added in 32 bits: four of a sample and a weight per round, each at most 2048 x 128.
    const ROUNDS: usize = 1024;

    #[target_feature(enable = "avx2")]
    pub(super) fn bilinear(grey: &[u8], stride: usize, width: usize, [fx, fy]: [i16; 2], out: &mut [i16]) {
        // Weights of the left and the right pixel, alternating.
        let along = _mm256_set1_epi16(fx << 8 | (16 - fx));
        let across = _mm256_set1_epi16(fy);
        let middle = _mm256_set1_epi16(MIDDLE_STEPS);
        let between = |at: usize| {
            let pixels = grey.get(at..)?.first_chunk::<{ LANES + 1 }>()?;
            let (left, right) = (bytes(pixels.first_chunk()?), bytes(pixels.last_chunk()?));
            let pairs = _mm256_set_m128i(_mm_unpackhi_epi8(left, right), _mm_unpacklo_epi8(left, right));
            Some(_mm256_maddubs_epi16(pairs, along))
        };
        for column in columns(width) {
            let (mut from, mut to) = (column, column);
            let Some(mut upper) = between(from) else { return };
            while let Some(out) = out.get_mut(to..).and_then(|out| out.first_chunk_mut()) {
                (from, to) = (from + stride, to + width);
                let Some(lower) = between(from) else { return };
                let half = _mm256_srai_epi16::<1>(_mm256_sub_epi16(lower, upper));
                let down = _mm256_srai_epi16::<3>(_mm256_mullo_epi16(half, across));
                put(out, _mm256_sub_epi16(_mm256_add_epi16(upper, down), middle));
                upper = lower;
            }
        }
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn products<const LISTS: usize>(
        samples: &[i16],
        weights: &[[[i8; WEIGHED_LANES]; LISTS]],
    ) -> [i64; LISTS] {
        let mut sums = [0; LISTS];
        let parts = samples.as_chunks::<WEIGHED_LANES>().0.chunks(ROUNDS).zip(weights.chunks(ROUNDS));
        for (samples, weights) in parts {
            let mut part = [_mm256_setzero_si256(); LISTS];
            for (samples, weights) in samples.iter().zip(weights) {
                for (half, samples) in samples.as_chunks::<LANES>().0.iter().enumerate() {
                    let samples = words(samples);
                    for (part, weights) in part.iter_mut().zip(weights) {
                        let weights = signed_bytes(&weights.as_chunks().0[half]);
                        *part = _mm256_add_epi32(*part, _mm256_madd_epi16(samples, weights));
                    }
                }
            }
            for (all, part) in sums.iter_mut().zip(part) {
                *all += sum(part);
            }
        }
        sums
    }
}

/// A third of the instructions of [`avx2`].
#[cfg(target_arch = "x86_64")]
mod avx512 {
    use super::{MIDDLE_STEPS, WEIGHED_LANES};
    use crate::pixels::lanes::{load, sum_of_16, wide_bytes, wide_words};
    use std::arch::x86_64::*;

    /// Largest width of a window whose rows are one vector each.
    pub(super) const WIDEST: usize = 32;
    /// As in [`super::avx2`]: two products per round.
    const ROUNDS: usize = 2048;

    /// ```text
    ///   p q r s ..   --permute-->  (p q) (q r) (r s) ..   x  (16 - fx, fx)  --> one sum of two products per sample
    /// ```
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
    pub(super) fn bilinear(grey: &[u8], stride: usize, width: usize, [fx, fy]: [i16; 2], out: &mut [i16]) {
        let neighbours: [u8; 64] = std::array::from_fn(|i| i.div_ceil(2) as u8);
        let neighbours = load(&neighbours);
        let along = _mm512_set1_epi16(fx << 8 | (16 - fx));
        let across = _mm512_set1_epi16(fy);
        let middle = _mm512_set1_epi16(MIDDLE_STEPS);
        let between = |at: usize| {
            let pixels = row(grey.get(at..)?.get(..=width)?);
            Some(_mm512_maddubs_epi16(_mm512_permutexvar_epi8(neighbours, pixels), along))
        };
        let mut at = 0;
        let Some(mut upper) = between(at) else { return };
        for out in out.chunks_exact_mut(width) {
            at += stride;
            let Some(lower) = between(at) else { return };
            let half = _mm512_srai_epi16::<1>(_mm512_sub_epi16(lower, upper));
            let down = _mm512_srai_epi16::<3>(_mm512_mullo_epi16(half, across));
            put(out, _mm512_sub_epi16(_mm512_add_epi16(upper, down), middle));
            upper = lower;
        }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    pub(super) fn products<const LISTS: usize>(
        samples: &[i16],
        weights: &[[[i8; WEIGHED_LANES]; LISTS]],
    ) -> [i64; LISTS] {
        let mut sums = [0; LISTS];
        let parts = samples.as_chunks::<WEIGHED_LANES>().0.chunks(ROUNDS).zip(weights.chunks(ROUNDS));
        for (samples, weights) in parts {
            let mut part = [_mm512_setzero_si512(); LISTS];
            for (samples, weights) in samples.iter().zip(weights) {
                let samples = wide_words(samples);
                for (part, weights) in part.iter_mut().zip(weights) {
                    let weights = _mm512_cvtepi8_epi16(wide_bytes(&weights.map(i8::cast_unsigned)));
                    *part = _mm512_dpwssd_epi32(*part, samples, weights);
                }
            }
            for (all, part) in sums.iter_mut().zip(part) {
                *all += sum_of_16(part);
            }
        }
        sums
    }

    /// At most 64 bytes, then zeros.
    #[target_feature(enable = "avx512f,avx512bw")]
    fn row(bytes: &[u8]) -> __m512i {
        let filled = u64::MAX >> (64 - bytes.len());
        // SAFETY: as many bytes are read as there are; the load needs no alignment.
        #[allow(unsafe_code)]
        unsafe {
            _mm512_maskz_loadu_epi8(filled, bytes.as_ptr().cast())
        }
    }

    /// Writes the first of 32 numbers of 16 bits, as many as there is room for.
    #[target_feature(enable = "avx512f,avx512bw")]
    fn put(into: &mut [i16], numbers: __m512i) {
        let room = u32::MAX >> (32 - into.len());
        // SAFETY: as many numbers are written as there is room for; the store needs no alignment.
        #[allow(unsafe_code)]
        unsafe {
            _mm512_mask_storeu_epi16(into.as_mut_ptr(), room, numbers);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;

    #[test]
    fn wide_products_are_those_of_the_plain_twin() {
        use crate::pixels::wide::{Vectors, with_vectors};
        // The largest possible products, so many that their sum would overflow 32 bits.
        for (sample, weight) in [(-2048, 127), (2032, -127), (-2048, -127)] {
            let samples = vec![sample; 8192 * WEIGHED_LANES];
            let weights = vec![[weight, 1, weight / 2].map(|w: i8| [w; WEIGHED_LANES]); 8192];
            let sums = [Vectors::Avx512Vnni, Vectors::Avx2, Vectors::Baseline]
                .map(|widest| with_vectors(widest, || products(&samples, &weights)));
            assert_eq!(sums[0], sums[2]);
            assert_eq!(sums[1], sums[2]);
            assert_eq!(sums[0][0], 8192 * 32 * i64::from(sample) * i64::from(weight));
        }
    }

    #[test]
    fn wide_samples_are_those_of_the_plain_twin() {
        use crate::pixels::wide::{Vectors, with_vectors};
        let size = SizePx::new(64, 40);
        let noise: Vec<u8> = (0..size.area() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let extremes: Vec<u8> = noise.iter().map(|v| if *v < 128 { 0 } else { 255 }).collect();
        for (grey, width) in [(&noise, 16), (&noise, 19), (&extremes, 16), (&extremes, 32), (&extremes, 33)] {
            for shift in (0..256).map(|i| [i % 16, i / 16]) {
                let sampled = || {
                    let mut out = vec![0; width * 20];
                    bilinear(&grey[5 * size.width + 7..], size.width, width, shift, &mut out);
                    out
                };
                let wide = sampled();
                for narrower in [Vectors::Avx512, Vectors::Baseline] {
                    assert_eq!(wide, with_vectors(narrower, sampled), "{width} wide, {shift:?}, {narrower:?}");
                }
                let [fx, fy] = shift.map(f64::from);
                let at = |x: usize, y: usize| f64::from(grey[(5 + y) * size.width + 7 + x]);
                let row = |y| at(3, y) * (16.0 - fx) + at(4, y) * fx;
                let exact = row(2) + (row(3) - row(2)) * fy / 16.0 - 2048.0;
                assert!((f64::from(wide[2 * width + 3]) - exact).abs() <= 2.0, "{shift:?}");
            }
        }
    }
}
