//! Foxglove's image messages, in protocol buffers, with the descriptions that let other programs read them.

use super::wire::{Field, put_bytes, put_fixed32, put_number, take_field};
use slipbound::port::{FrameBuffer, PixelFormat};

/// The schema of an image as it was received.
pub const COMPRESSED: &str = "foxglove.CompressedImage";
/// The schema of an image as pixels.
pub const RAW: &str = "foxglove.RawImage";

pub(super) const TIMESTAMP: &str = ".google.protobuf.Timestamp";
/// The field of a `FileDescriptorSet` that is a file.
pub(super) const FIELD_OF_MESSAGES: u64 = 1;

/// Field types, as a description numbers them.
pub(super) const DOUBLE: u64 = 1;
const INT64: u64 = 3;
const INT32: u64 = 5;
const FIXED32: u64 = 7;
pub(super) const STRING: u64 = 9;
pub(super) const MESSAGE: u64 = 11;
const BYTES: u64 = 12;

/// Name, number and type of a field.
type FieldFact = (&'static str, u64, u64);

/// The same for any field.
#[derive(Debug, Clone, Copy)]
pub(super) struct TypedField {
    pub name: &'static str,
    pub number: u64,
    pub kind: u64,
    /// The full name of its message or enumeration; empty for others.
    pub of: &'static str,
    pub is_repeated: bool,
}

const COMPRESSED_FIELDS: [FieldFact; 4] =
    [("timestamp", 1, MESSAGE), ("frame_id", 4, STRING), ("data", 2, BYTES), ("format", 3, STRING)];
const RAW_FIELDS: [FieldFact; 7] = [
    ("timestamp", 1, MESSAGE),
    ("frame_id", 7, STRING),
    ("width", 2, FIXED32),
    ("height", 3, FIXED32),
    ("encoding", 4, STRING),
    ("step", 5, FIXED32),
    ("data", 6, BYTES),
];

/// The description (`FileDescriptorSet`) of [`COMPRESSED`] or [`RAW`].
pub fn description(schema: &str) -> Vec<u8> {
    let (name, fields) = match schema {
        COMPRESSED => ("CompressedImage", &COMPRESSED_FIELDS[..]),
        _ => ("RawImage", &RAW_FIELDS[..]),
    };
    let time = "google/protobuf/timestamp.proto";
    let mut set = Vec::new();
    put_bytes(&mut set, FIELD_OF_MESSAGES, &file(time, "google.protobuf", &[], &timestamp()));
    put_bytes(
        &mut set,
        FIELD_OF_MESSAGES,
        &file(&format!("foxglove/{name}.proto"), "foxglove", &[time], &message(name, fields)),
    );
    set
}

/// The description of a time.
pub(super) fn timestamp() -> Vec<u8> {
    message("Timestamp", &[("seconds", 1, INT64), ("nanos", 2, INT32)])
}

/// The description of a file with one message.
pub(super) fn file(name: &str, package: &str, needs: &[&str], message: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, name.as_bytes());
    put_bytes(&mut out, 2, package.as_bytes());
    needs.iter().for_each(|need| put_bytes(&mut out, 3, need.as_bytes()));
    put_bytes(&mut out, 4, message);
    put_bytes(&mut out, 12, b"proto3");
    out
}

fn message(name: &str, fields: &[FieldFact]) -> Vec<u8> {
    let typed = |&(name, number, kind): &FieldFact| {
        let of = if kind == MESSAGE { TIMESTAMP } else { "" };
        TypedField { name, number, kind, of, is_repeated: false }
    };
    typed_message(name, &fields.iter().map(typed).collect::<Vec<_>>())
}

/// The description of a message.
pub(super) fn typed_message(name: &str, fields: &[TypedField]) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, name.as_bytes());
    for &TypedField { name, number, kind, of, is_repeated } in fields {
        let mut field = Vec::new();
        put_bytes(&mut field, 1, name.as_bytes());
        put_number(&mut field, 3, number);
        put_number(&mut field, 4, if is_repeated { 3 } else { 1 }); // repeated or optional
        put_number(&mut field, 5, kind);
        if !of.is_empty() {
            put_bytes(&mut field, 6, of.as_bytes());
        }
        put_bytes(&mut out, 2, &field);
    }
    out
}

/// A time as a message.
pub(super) fn put_stamp(stamp_ns: u64) -> Vec<u8> {
    let mut stamp = Vec::with_capacity(12);
    put_number(&mut stamp, 1, stamp_ns / 1_000_000_000);
    put_number(&mut stamp, 2, stamp_ns % 1_000_000_000);
    stamp
}

/// The message of a frame, and its schema: its encoded form where it has one, its pixels otherwise.
pub fn write(frame: &FrameBuffer, finger: &str, stamp_ns: u64) -> (&'static str, Vec<u8>) {
    let mut out = Vec::with_capacity(frame.encoded.len().max(frame.pixels.len()) + 64);
    put_bytes(&mut out, 1, &put_stamp(stamp_ns));
    if !frame.encoded.is_empty() {
        put_bytes(&mut out, 2, &frame.encoded);
        let format = if frame.encoded.starts_with(b"\x89PNG") { "png" } else { "jpeg" };
        put_bytes(&mut out, 3, format.as_bytes());
        put_bytes(&mut out, 4, finger.as_bytes());
        return (COMPRESSED, out);
    }
    let (width, height) = (frame.size.width as u32, frame.size.height as u32);
    put_fixed32(&mut out, 2, width);
    put_fixed32(&mut out, 3, height);
    let encoding = match frame.format {
        PixelFormat::Gray => "mono8",
        PixelFormat::Rgb => "rgb8",
    };
    put_bytes(&mut out, 4, encoding.as_bytes());
    put_fixed32(&mut out, 5, width * frame.format.bytes_per_pixel() as u32);
    put_bytes(&mut out, 6, &frame.pixels);
    put_bytes(&mut out, 7, finger.as_bytes());
    (RAW, out)
}

/// An image from a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Picture<'a> {
    /// Its time, ns; None where the message says zero.
    pub stamp_ns: Option<u64>,
    /// Width and height, px; zero for one that is compressed.
    pub size: (u64, u64),
    /// How its pixels are laid out.
    pub encoding: &'a str,
    /// Row stride, bytes.
    pub row_bytes: u64,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// Reads a message of either schema; None for anything else.
pub fn read<'a>(schema: &str, mut message: &'a [u8]) -> Option<Picture<'a>> {
    let facts = if schema == COMPRESSED { &COMPRESSED_FIELDS[..] } else { &RAW_FIELDS[..] };
    let mut picture = Picture::default();
    while !message.is_empty() {
        let (number, value) = take_field(&mut message)?;
        let name = facts.iter().find(|fact| fact.1 == number).map_or("", |fact| fact.0);
        match (name, value) {
            ("timestamp", Field::Bytes(stamp)) => picture.stamp_ns = read_stamp(stamp)?,
            ("data", Field::Bytes(bytes)) => picture.bytes = bytes,
            ("encoding" | "format", Field::Bytes(text)) => picture.encoding = std::str::from_utf8(text).ok()?,
            ("width", Field::Number(width)) => picture.size.0 = width,
            ("height", Field::Number(height)) => picture.size.1 = height,
            ("step", Field::Number(bytes)) => picture.row_bytes = bytes,
            _ => {}
        }
    }
    Some(picture)
}

fn read_stamp(mut stamp: &[u8]) -> Option<Option<u64>> {
    let (mut seconds, mut nanos) = (0, 0);
    while !stamp.is_empty() {
        match take_field(&mut stamp)? {
            (1, Field::Number(value)) => seconds = value,
            (2, Field::Number(value)) => nanos = value,
            _ => {}
        }
    }
    Some(seconds.checked_mul(1_000_000_000)?.checked_add(nanos).filter(|ns| *ns > 0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use slipbound::image::SizePx;

    #[test]
    fn pictures_are_read_as_they_were_written() {
        let jpeg = FrameBuffer { encoded: vec![0xFF, 0xD8, 1, 2], ..FrameBuffer::default() };
        let (schema, bytes) = write(&jpeg, "left", 3_000_000_007);
        let picture = read(schema, &bytes).expect("a message");
        assert_eq!((schema, picture.stamp_ns, picture.encoding), (COMPRESSED, Some(3_000_000_007), "jpeg"));
        assert_eq!(picture.bytes, jpeg.encoded);
        let (pixels, size) = (vec![7; 6], SizePx::new(2, 1));
        let raw = FrameBuffer { pixels, size, ..FrameBuffer::default() };
        let (schema, bytes) = write(&raw, "left", 0);
        let picture = read(schema, &bytes).expect("a message");
        assert_eq!((schema, picture.size, picture.row_bytes, picture.encoding), (RAW, (2, 1), 6, "rgb8"));
        assert_eq!((picture.bytes, picture.stamp_ns), (&raw.pixels[..], None));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = (read(COMPRESSED, &bytes), read(RAW, &bytes));
        }
    }
}
