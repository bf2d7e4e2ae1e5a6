//! Flags, one byte a pixel -> bits, 64 pixels a word.

/// Packs 64 flags, each 0 or 1; flag i becomes bit i.
#[inline]
pub(crate) fn pack_64(flags: &[u8; 64]) -> u64 {
    // The factor moves flag i of 8, at bit 8 i, to bit 56 + i; no two products meet in one bit.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut word = 0;
    for (i, eight) in flags.as_chunks::<8>().0.iter().enumerate() {
        word |= (u64::from_le_bytes(*eight).wrapping_mul(GATHER) >> 56) << (8 * i);
    }
    word
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
