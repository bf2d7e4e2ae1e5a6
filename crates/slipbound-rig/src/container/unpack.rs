//! Unpacks compressed chunks as they are read, in memory that does not grow with the claims of a damaged file.
//!
//! ```text
//!   chunk bytes -> units (a frame's head, a block) -> one unit unpacked at a time -> the reader, up to the size in the chunk's head
//! ```

mod format;
mod lz4;
mod zstd;

use format::Format;
pub use lz4::Lz4;
pub use zstd::Zstd;

/// Result of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Bytes of the input that are used up.
    pub used: usize,
    /// Bytes written.
    pub wrote: usize,
    /// Input length that the next step needs, where nothing was done.
    pub wanted_bytes: usize,
}

/// Unpacks a compressed chunk. A new one is made for every chunk.
pub trait Unpacker: Send {
    /// Unpacks part of `src` into `dst`; does nothing when it needs more input. Holds at most a block and what later
    /// blocks may refer to.
    fn step(&mut self, src: &[u8], dst: &mut [u8]) -> Result<Step, String>;
}

/// A chunk of a format.
#[derive(Default)]
pub struct Unpack<F> {
    format: F,
    /// Unpacked bytes, and how many of them were given.
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
