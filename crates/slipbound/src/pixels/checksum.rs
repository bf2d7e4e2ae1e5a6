//! A number that differs between pictures: to notice one that repeats.

/// A checksum of bytes, 64 bits (words mixed by multiplication and rotation; not for secrets). Pictures that differ in one level have
/// different ones.
pub fn checksum(bytes: &[u8]) -> u64 {
    const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
    // Four lines of words side by side, so that no multiplication waits for another.
    let mut lines = [1u64, 2, 3, 4];
    let (words, rest) = bytes.as_chunks::<32>();
    for four in words {
        for (line, word) in lines.iter_mut().zip(four.as_chunks::<8>().0) {
            *line = (*line ^ u64::from_le_bytes(*word)).wrapping_mul(ODD).rotate_left(29);
        }
    }
    let mix = |sum: u64, word: u64| (sum ^ word).wrapping_mul(ODD).rotate_left(29);
    let sum = lines.into_iter().fold(bytes.len() as u64, mix);
    rest.iter().fold(sum, |sum, &byte| mix(sum, u64::from(byte)))
}

#[cfg(test)]
mod tests {
    use super::checksum;

    #[test]
    fn one_level_anywhere_makes_another_sum() {
        let picture: Vec<u8> = (0..1003u32).map(|i| (i * i % 251) as u8).collect();
        let mut sums = vec![checksum(&picture), checksum(&picture[..1002]), checksum(&[])];
        for i in 0..picture.len() {
            let mut other = picture.clone();
            other[i] ^= 1;
            sums.push(checksum(&other));
        }
        let count = sums.len();
        sums.sort_unstable();
        sums.dedup();
        assert_eq!(sums.len(), count);
        assert_eq!(checksum(&picture), checksum(&picture.clone()));
    }
}
