//! Compressed chunks, unpacked as the reader goes, in memory that does not grow with what a damaged file claims.
//!
//! ```text
//!   chunk bytes -> units (a frame's head, a block) -> one unit unpacked at a time -> the reader, up to the size in the chunk's head
//! ```

mod lz4;
mod zstd;

pub use lz4::Lz4;
pub use zstd::Zstd;

/// What a step has done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Bytes of the input that are used up.
    pub used: usize,
    /// Bytes written.
    pub wrote: usize,
    /// How long the input should be for the next step, where nothing was done.
    pub wanted_bytes: usize,
}

/// A compressed chunk, as far as it is unpacked. Made anew for every chunk.
pub trait Unpacker: Send {
    /// Unpacks a little of `src` into `dst`; does nothing when it needs more input. Holds at most a block and what later blocks
    /// may refer to.
    fn step(&mut self, src: &[u8], dst: &mut [u8]) -> Result<Step, String>;
}

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

/// A chunk of a format.
#[derive(Default)]
pub struct Unpack<F> {
    format: F,
    /// What is unpacked, and how much of it was given.
    out: Vec<u8>,
    given: usize,
}

impl<F: Format> Unpacker for Unpack<F> {
    fn step(&mut self, src: &[u8], dst: &mut [u8]) -> Result<Step, String> {
        if self.given < self.out.len() {
            let wrote = dst.len().min(self.out.len() - self.given);
            dst[..wrote].copy_from_slice(&self.out[self.given..self.given + wrote]);
            self.given += wrote;
            return Ok(Step { used: 0, wrote, wanted_bytes: 0 });
        }
        let wanted_bytes = self.format.unit_bytes(src);
        let Some(unit) = src.get(..wanted_bytes) else { return Ok(Step { used: 0, wrote: 0, wanted_bytes }) };
        self.given = self.format.forget(&mut self.out, self.given);
        self.format.unpack(unit, &mut self.out)?;
        Ok(Step { used: unit.len(), wrote: 0, wanted_bytes })
    }
}

#[cfg(test)]
mod tests;
