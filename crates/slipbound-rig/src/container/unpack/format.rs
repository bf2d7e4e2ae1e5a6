//! What a compressed format must say of itself to be unpacked unit by unit.

/// A compressed format as units, of which the first bytes say how long they are.
pub trait Format: Send + Default {
    /// Length of the next unit, bytes, as far as its first bytes say it: more than `first` has, or final. Never zero.
    fn unit_bytes(&self, first: &[u8]) -> usize;

    /// Unpacks a whole unit to the end of `out`; what was expected and got where it is none.
    fn unpack(&mut self, unit: &[u8], out: &mut Vec<u8>) -> Result<(), String>;

    /// Drops from `out`, of which so much was given, what no later unit refers to; how much of the rest was given.
    fn forget(&mut self, out: &mut Vec<u8>, given: usize) -> usize {
        out.drain(..given);
        0
    }
}
