//! What a compressed format must provide to be unpacked unit by unit.

/// A compressed format as a sequence of units, each with its length in its first bytes.
pub trait Format: Send + Default {
    /// Length of the next unit, bytes, as far as its first bytes state it: more than `first` has, or final. Never zero.
    fn unit_bytes(&self, first: &[u8]) -> usize;

    /// Unpacks a complete unit to the end of `out`; the error states what was expected and got.
    fn unpack(&mut self, unit: &[u8], out: &mut Vec<u8>) -> Result<(), String>;

    /// Drops from `out` what no later unit refers to. `given`: how many of its bytes were given; returns how many of
    /// the rest were.
    fn forget(&mut self, out: &mut Vec<u8>, given: usize) -> usize {
        out.drain(..given);
        0
    }
}
