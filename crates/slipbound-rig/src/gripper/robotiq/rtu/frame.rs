//! What every message of Modbus RTU has: an address, a function, a checksum.

use crc::{CRC_16_MODBUS, Crc};

/// The gripper's address on the line.
pub const SLAVE: u8 = 9;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

pub(super) const READ_HOLDING: u8 = 3;
pub(super) const READ: u8 = 4;
pub(super) const WRITE: u8 = 16;
pub(super) const WRITE_ONE: u8 = 6;
pub(super) const READ_WRITE: u8 = 23;
pub(super) const REFUSED: u8 = 0x80;

/// What the buffered bytes begin with.
pub(super) enum Look<T> {
    /// A message, and its length.
    Whole(T, usize),
    /// No message.
    None,
    /// Perhaps a message; more bytes are needed.
    Short,
}

fn end(into: &mut Vec<u8>, start: usize) {
    let crc = CRC.checksum(&into[start..]);
    into.extend(crc.to_le_bytes());
}

/// A message of either side without its checksum.
pub(super) fn message(into: &mut Vec<u8>, parts: &[&[u8]]) {
    let start = into.len();
    for part in parts {
        into.extend_from_slice(part);
    }
    end(into, start);
}

/// A message without its checksum, if that is right.
pub(super) fn checked(message: &[u8]) -> Option<&[u8]> {
    let (body, crc) = message.split_last_chunk()?;
    (CRC.checksum(body).to_le_bytes() == *crc).then_some(body)
}

/// The first `length` bytes if they are there and their checksum is right.
pub(super) fn sound<T>(bytes: &[u8], length: usize, make: impl FnOnce(&[u8]) -> Option<T>) -> Look<T> {
    let Some(message) = bytes.get(..length) else { return Look::Short };
    checked(message).and_then(make).map_or(Look::None, |made| Look::Whole(made, length))
}
