//! A checksum of an image, to detect repeated images.

use super::wide::wide;

/// Number of words that are mixed in parallel: large enough that the compiler keeps the loop and vectorises it.
const LINES: usize = 256;

wide! {
    /// A 64-bit checksum of bytes (words mixed by multiplication and rotation; not cryptographic). Images that differ
    /// in one level have different checksums.
    pub fn checksum(bytes: &[u8]) -> u64 {
        // Independent lines of words, so that no multiplication waits for another.
        let mut lines = [0u32; LINES];
        let (blocks, rest) = bytes.as_chunks::<{ 4 * LINES }>();
        for block in blocks {
            for (line, word) in lines.iter_mut().zip(block.as_chunks::<4>().0) {
                *line = (*line ^ u32::from_le_bytes(*word)).wrapping_mul(0x9E37_79B1).rotate_left(13);
            }
        }
        let mix = |sum: u64, word: u64| (sum ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
        let sum = lines.into_iter().fold(bytes.len() as u64, |sum, line| mix(sum, u64::from(line)));
        rest.iter().fold(sum, |sum, &byte| mix(sum, u64::from(byte)))
    }
}

#[cfg(test)]
mod tests {
    use super::checksum;

    #[test]
    fn one_level_anywhere_makes_another_sum() {
        let picture: Vec<u8> = (0..3003u32).map(|i| (i * i % 251) as u8).collect();
        let mut sums = vec![checksum(&picture), checksum(&picture[..3002]), checksum(&[])];
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
