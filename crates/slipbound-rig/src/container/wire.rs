//! The parts of protocol buffers that messages of images and of lines over them need.

/// A field of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field<'a> {
    /// A whole number.
    Number(u64),
    /// Bytes, a text, or a message within.
    Bytes(&'a [u8]),
}

/// Writes a number as seven bits a byte.
fn put_varint(into: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        into.push(value as u8 | 0x80);
        value >>= 7;
    }
    into.push(value as u8);
}

/// Writes a whole number.
pub(super) fn put_number(into: &mut Vec<u8>, field: u64, value: u64) {
    put_varint(into, field << 3);
    put_varint(into, value);
}

/// Writes a whole number of four bytes.
pub(super) fn put_fixed32(into: &mut Vec<u8>, field: u64, value: u32) {
    put_varint(into, field << 3 | 5);
    into.extend_from_slice(&value.to_le_bytes());
}

/// Writes an eight-byte floating-point number.
pub(super) fn put_double(into: &mut Vec<u8>, field: u64, value: f64) {
    put_varint(into, field << 3 | 1);
    into.extend_from_slice(&value.to_le_bytes());
}

/// Writes bytes, a text or a message.
pub(super) fn put_bytes(into: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    put_varint(into, field << 3 | 2);
    put_varint(into, bytes.len() as u64);
    into.extend_from_slice(bytes);
}

/// Takes the first field off a message: its number and value. None at the end, and where the bytes are not a field.
pub(super) fn take_field<'a>(message: &mut &'a [u8]) -> Option<(u64, Field<'a>)> {
    let key = take_varint(message)?;
    let field = match key & 7 {
        0 => Field::Number(take_varint(message)?),
        1 => Field::Number(u64::from_le_bytes(take(message, 8)?.try_into().ok()?)),
        2 => {
            let length = take_varint(message)?;
            Field::Bytes(take(message, usize::try_from(length).ok()?)?)
        }
        5 => Field::Number(u64::from(u32::from_le_bytes(take(message, 4)?.try_into().ok()?))),
        _ => return None,
    };
    Some((key >> 3, field))
}

fn take_varint(from: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = take(from, 1)?[0];
        value |= u64::from(byte & 0x7F) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

fn take<'a>(from: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = from.split_at_checked(count)?;
    *from = rest;
    Some(taken)
}
