//! LZ4 frames, block by block. Damage is detected by the chunk's own checksum: those of frame and block are skipped.
//!
//! ```text
//!   magic 4 | flags, size of blocks, [content size 8] [dictionary 4] check 1 | blocks: size 4, data, [check 4] | 0 4 [check 4]
//! ```

use super::format::Format;
use lz4_flex::block::decompress_into_with_dict;

const MAGIC: u32 = 0x184D_2204;
/// How far back a block refers, bytes.
const REACH_BYTES: usize = 64 << 10;
/// The bit of a block's size that says that it is not compressed.
const STORED: u32 = 1 << 31;

/// Position in a frame.
#[derive(Default)]
pub struct Lz4 {
    /// Longest block of this frame, bytes, unpacked; zero before a frame's head.
    most_block_bytes: usize,
    has_block_check: bool,
    has_content_check: bool,
    /// Whether blocks refer to those before them.
    is_linked: bool,
}

fn number(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|first| u32::from_le_bytes(*first))
}

impl Format for Lz4 {
    fn unit_bytes(&self, first: &[u8]) -> usize {
        if self.most_block_bytes == 0 {
            let Some(&flags) = first.get(4) else { return 7 };
            return 7 + if flags & 8 != 0 { 8 } else { 0 } + if flags & 1 != 0 { 4 } else { 0 };
        }
        let check = |has: bool| if has { 4 } else { 0 };
        match number(first) {
            None => 4,
            Some(0) => 4 + check(self.has_content_check),
            Some(size) => 4 + ((size & !STORED) as usize).min(self.most_block_bytes) + check(self.has_block_check),
        }
    }

    fn unpack(&mut self, unit: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
        let first = number(unit).unwrap_or(0);
        if self.most_block_bytes == 0 {
            let (flags, block) = (unit[4], unit[5]);
            let size_code = block >> 4 & 7;
            if first != MAGIC || flags >> 6 != 1 || size_code < 4 {
                return Err(format!("expected a frame of lz4, got one that begins with {:02x?}", &unit[..6]));
            }
            if flags & 1 != 0 {
                return Err("expected a frame without a dictionary, got one with".into());
            }
            self.most_block_bytes = 1 << (8 + 2 * size_code);
            self.is_linked = flags & 0x20 == 0;
            (self.has_block_check, self.has_content_check) = (flags & 0x10 != 0, flags & 4 != 0);
            return Ok(());
        }
        if first == 0 {
            self.most_block_bytes = 0;
            return Ok(());
        }
        let size = (first & !STORED) as usize;
        if size > self.most_block_bytes {
            return Err(format!("expected a block of at most {} bytes, got {size}", self.most_block_bytes));
        }
        let block = &unit[4..4 + size];
        if first & STORED != 0 {
            out.extend_from_slice(block);
            return Ok(());
        }
        let known = out.len();
        out.resize(known + self.most_block_bytes, 0);
        let (before, into) = out.split_at_mut(known);
        let count = decompress_into_with_dict(block, into, if self.is_linked { before } else { &[] });
        out.truncate(known + count.as_ref().map_or(0, |count| *count));
        count.map(drop).map_err(|e| format!("expected {size} bytes of lz4: {e}"))
    }

    fn forget(&mut self, out: &mut Vec<u8>, given: usize) -> usize {
        out.drain(..given.saturating_sub(REACH_BYTES));
        out.len()
    }
}
