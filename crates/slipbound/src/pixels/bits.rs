//! Flags, one byte a pixel -> bits, 64 pixels a word.

/// Packs 64 flags, each 0 or 1; flag i becomes bit i.
#[inline]
pub(crate) fn pack_64(flags: &[u8; 64]) -> u64 {
    // Flag 8 k + j moves to bit 8 j + k: an 8 x 8 bit matrix to be transposed. (Gathering each eight flags by a
    // multiplication is as fast with SSE2, and four times slower where LLVM vectorises the product for AVX2.)
    let mut table = 0;
    for (k, eight) in flags.as_chunks::<8>().0.iter().enumerate() {
        table |= u64::from_le_bytes(*eight) << k;
    }
    transpose_8x8(table)
}

/// The same for a row of flags of 0 or 255; flags beyond the last 64 are dropped.
pub(crate) fn pack_row(flags: &[u8], words: &mut [u64]) {
    #[cfg(target_arch = "x86_64")]
    if super::wide::vectors() >= super::wide::Vectors::Avx2 {
        // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature the kernel needs.
        #[allow(unsafe_code)]
        return unsafe { pack_row_avx2(flags, words) };
    }
    for (word, flags) in words.iter_mut().zip(flags.as_chunks::<64>().0) {
        *word = pack_64(&flags.map(|flag| flag & 1));
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn pack_row_avx2(flags: &[u8], words: &mut [u64]) {
    use std::arch::x86_64::{_mm256_movemask_epi8, _mm256_setr_epi64x};
    let half = |flags: &[u8]| {
        let eights = flags.as_chunks::<8>().0;
        let [a, b, c, d] = std::array::from_fn(|i| i64::from_le_bytes(eights[i]));
        u64::from(_mm256_movemask_epi8(_mm256_setr_epi64x(a, b, c, d)) as u32)
    };
    for (word, flags) in words.iter_mut().zip(flags.as_chunks::<64>().0) {
        *word = half(&flags[..32]) | half(&flags[32..]) << 32;
    }
}

/// Exchanges bit 8 j + k with bit 8 k + j: within blocks of 2 x 2, then 4 x 4, then 8 x 8.
fn transpose_8x8(mut table: u64) -> u64 {
    for (distance, half) in [(7, 0x00aa_00aa_00aa_00aa), (14, 0x0000_cccc_0000_cccc), (28, 0x0000_0000_f0f0_f0f0)] {
        let differ = (table ^ table >> distance) & half;
        table ^= differ ^ differ << distance;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixels::wide::{Vectors, with_vectors};

    #[test]
    fn flag_i_becomes_bit_i() {
        for i in 0..64 {
            let mut flags = [0; 64];
            flags[i] = 1;
            assert_eq!(pack_64(&flags), 1 << i);
        }
        assert_eq!(pack_64(&[1; 64]), u64::MAX);
        let flags: Vec<u8> = (0..200u32).map(|i| if i * i % 7 < 3 { 255 } else { 0 }).collect();
        let (mut words, mut plain) = ([0; 3], [0; 3]);
        pack_row(&flags, &mut words);
        with_vectors(Vectors::Baseline, || pack_row(&flags, &mut plain));
        assert_eq!(words, plain);
        for (i, flag) in flags[..192].iter().enumerate() {
            assert_eq!(words[i / 64] >> (i % 64) & 1, u64::from(flag & 1));
        }
    }
}
