//! Flags, one byte a pixel -> bits, 64 pixels a word.

/// Packs 64 flags, each 0 or 1; flag i becomes bit i.
#[inline]
pub(crate) fn pack_64(flags: &[u8; 64]) -> u64 {
    // Flag 8 k + j comes to lie at bit 8 j + k: an 8 x 8 table of bits, to be transposed. (Gathering each eight flags
    // by a multiplication is as fast with SSE2, and four times slower where LLVM vectorises the product for AVX2.)
    let mut table = 0;
    for (k, eight) in flags.as_chunks::<8>().0.iter().enumerate() {
        table |= u64::from_le_bytes(*eight) << k;
    }
    transpose_8x8(table)
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

    #[test]
    fn flag_i_becomes_bit_i() {
        for i in 0..64 {
            let mut flags = [0; 64];
            flags[i] = 1;
            assert_eq!(pack_64(&flags), 1 << i);
        }
        assert_eq!(pack_64(&[1; 64]), u64::MAX);
    }
}
