//! Sixteen numbers in an AVX2 vector and 64 bytes in an AVX-512 one, for the kernels written with intrinsics.
#![cfg(target_arch = "x86_64")]

use std::arch::x86_64::*;

/// Numbers per vector.
pub(super) const LANES: usize = 16;

/// Fetches the 64 bytes `ahead` of the start of some bytes towards the caches, if there are any.
#[inline]
pub(super) fn prefetch(bytes: &[u8], ahead: usize) {
    // SAFETY: a hint, which reads nothing and never faults, wherever it points.
    #[allow(unsafe_code)]
    unsafe {
        _mm_prefetch::<_MM_HINT_T0>(bytes.as_ptr().wrapping_add(ahead).cast());
    }
}

/// Sixteen bytes.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn bytes(of: &[u8; LANES]) -> __m128i {
    let [low, high] = [of.first_chunk(), of.last_chunk()].map(|half| half.map_or(0, |half| i64::from_le_bytes(*half)));
    _mm_set_epi64x(high, low)
}

/// Sixteen numbers of 16 bits.
#[inline]
#[target_feature(enable = "avx2")]
#[rustfmt::skip]
pub(super) fn words(of: &[i16; LANES]) -> __m256i {
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *of;
    _mm256_setr_epi16(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p)
}

/// Sixteen signed bytes as numbers of 16 bits.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn signed_bytes(of: &[i8; LANES]) -> __m256i {
    _mm256_cvtepi8_epi16(bytes(&of.map(i8::cast_unsigned)))
}

/// Writes sixteen numbers of 16 bits.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn put(into: &mut [i16; LANES], numbers: __m256i) {
    let [a, b, c, d] = [
        _mm256_extract_epi64::<0>(numbers),
        _mm256_extract_epi64::<1>(numbers),
        _mm256_extract_epi64::<2>(numbers),
        _mm256_extract_epi64::<3>(numbers),
    ];
    for (four, number) in into.as_chunks_mut::<4>().0.iter_mut().zip([a, b, c, d]) {
        let [a, b, c, d] = [number, number >> 16, number >> 32, number >> 48].map(|word| word as i16);
        *four = [a, b, c, d];
    }
}

/// The sum of eight numbers of 32 bits.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn sum(of: __m256i) -> i64 {
    let half = |four: __m128i| _mm256_cvtepi32_epi64(four);
    let pairs = _mm256_add_epi64(half(_mm256_castsi256_si128(of)), half(_mm256_extracti128_si256::<1>(of)));
    let one = _mm_add_epi64(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256::<1>(pairs));
    _mm_cvtsi128_si64(one) + _mm_extract_epi64::<1>(one)
}

/// 64 bytes.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn load(bytes: &[u8; 64]) -> __m512i {
    // SAFETY: 64 bytes are there to be read; the load needs no alignment.
    #[allow(unsafe_code)]
    unsafe {
        _mm512_loadu_si512(bytes.as_ptr().cast())
    }
}

/// Writes 64 bytes.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn store(from: __m512i, to: &mut [u8; 64]) {
    // SAFETY: 64 bytes are there to be written; the store needs no alignment.
    #[allow(unsafe_code)]
    unsafe {
        _mm512_storeu_si512(to.as_mut_ptr().cast(), from);
    }
}

/// 32 bytes.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn wide_bytes(of: &[u8; 32]) -> __m256i {
    // SAFETY: 32 bytes are there to be read; the load needs no alignment.
    #[allow(unsafe_code)]
    unsafe {
        _mm256_loadu_si256(of.as_ptr().cast())
    }
}

/// 32 numbers of 16 bits.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn wide_words(of: &[i16]) -> __m512i {
    let of: &[i16; 32] = of.first_chunk().expect("as many numbers as lanes");
    // SAFETY: 64 bytes are there to be read; the load needs no alignment.
    #[allow(unsafe_code)]
    unsafe {
        _mm512_loadu_si512(of.as_ptr().cast())
    }
}

/// The sum of sixteen numbers of 32 bits.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn sum_of_16(of: __m512i) -> i64 {
    let half = |eight: __m256i| _mm512_cvtepi32_epi64(eight);
    let pairs = _mm512_add_epi64(half(_mm512_castsi512_si256(of)), half(_mm512_extracti64x4_epi64::<1>(of)));
    _mm512_reduce_add_epi64(pairs)
}
