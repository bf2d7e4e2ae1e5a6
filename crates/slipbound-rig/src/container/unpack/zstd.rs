//! Zstandard frames (RFC 8878), block by block.

use super::format::Format;
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

const MAGIC: u32 = 0xFD2F_B528;
/// Skippable frames: 16 numbers from this one on.
const SKIPPABLE: u32 = 0x184D_2A50;
/// Longest of those, bytes: it is buffered completely.
const LONGEST_SKIPPED_BYTES: usize = 1 << 20;
/// Length of a block's head, bytes.
const BLOCK_HEAD_BYTES: usize = 3;
/// Longest block, bytes, by the standard.
const LONGEST_BLOCK_BYTES: usize = 128 << 10;

/// The decoder, and its position in a frame.
#[derive(Default)]
pub struct Zstd {
    decoder: FrameDecoder,
    is_in_frame: bool,
    has_checksum: bool,
}

fn number(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|first| u32::from_le_bytes(*first))
}

/// Kind (0 raw, 1 one byte repeated, 2 compressed, 3 none), whether it is the last, and the size that a block's head states.
fn block_head(first: &[u8]) -> Option<(u32, bool, usize)> {
    let [a, b, c] = *first.first_chunk()?;
    let head = u32::from_le_bytes([a, b, c, 0]);
    Some((head >> 1 & 3, head & 1 == 1, (head >> 3) as usize))
}

impl Zstd {
    /// Length of the part before the blocks: 5 bytes, and what the fifth states.
    fn head_bytes(first: &[u8]) -> usize {
        let Some(&about) = first.get(4) else { return 5 };
        let is_single = about & 0x20 != 0;
        let dictionary_bytes = [0, 1, 2, 4][usize::from(about & 3)];
        let size_bytes = match about >> 6 {
            0 => usize::from(is_single),
            kind => 1 << kind,
        };
        5 + usize::from(!is_single) + dictionary_bytes + size_bytes
    }

    fn is_skippable(first: &[u8]) -> bool {
        number(first).is_some_and(|magic| magic & !15 == SKIPPABLE)
    }
}

impl Format for Zstd {
    fn unit_bytes(&self, first: &[u8]) -> usize {
        if !self.is_in_frame {
            return match Self::is_skippable(first) {
                true => {
                    first.get(4..).and_then(number).map_or(8, |size| 8 + (size as usize).min(LONGEST_SKIPPED_BYTES))
                }
                false => Self::head_bytes(first),
            };
        }
        let Some((kind, is_last, size)) = block_head(first) else { return BLOCK_HEAD_BYTES };
        let content_bytes = if kind == 1 { 1 } else { size.min(LONGEST_BLOCK_BYTES) };
        BLOCK_HEAD_BYTES + content_bytes + if is_last && self.has_checksum { 4 } else { 0 }
    }

    fn unpack(&mut self, unit: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
        if !self.is_in_frame {
            if Self::is_skippable(unit) {
                let size = unit.get(4..).and_then(number).unwrap_or(0) as usize;
                return match size == unit.len() - 8 {
                    true => Ok(()),
                    false => Err(format!("expected at most {LONGEST_SKIPPED_BYTES} bytes to pass over, got {size}")),
                };
            }
            if number(unit) != Some(MAGIC) {
                return Err(format!("expected a frame of zstd, got one that begins with {:02x?}", &unit[..4]));
            }
            self.decoder.reset(unit).map_err(|e| e.to_string())?;
            (self.is_in_frame, self.has_checksum) = (true, unit[4] & 4 != 0);
            return Ok(());
        }
        if let Some((kind, _, size)) = block_head(unit)
            && (kind == 3 || size > LONGEST_BLOCK_BYTES)
        {
            return Err(format!(
                "expected a block of at most {LONGEST_BLOCK_BYTES} bytes, got kind {kind}, {size} bytes"
            ));
        }
        let is_over =
            self.decoder.decode_blocks(unit, BlockDecodingStrategy::UptoBlocks(1)).map_err(|e| e.to_string())?;
        self.decoder.collect_to_writer(out).map_err(|e| e.to_string())?;
        self.is_in_frame = !is_over;
        Ok(())
    }
}
