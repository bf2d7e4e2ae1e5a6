//! ROS 2 image messages as stored in a bag: `sensor_msgs/msg/CompressedImage` and `Image` in CDR.
//!
//! ```text
//!   00 01 00 00 | int32 s | uint32 ns | string frame_id | .. fields; each aligned to its own size, counted after byte 4
//! ```

use super::foxglove::Picture;

/// The schema of a compressed image.
pub const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";
/// The schema of an image as pixels.
pub const RAW: &str = "sensor_msgs/msg/Image";

/// Reads a message of either schema; None for anything else.
pub fn read<'a>(schema: &str, message: &'a [u8]) -> Option<Picture<'a>> {
    let (head, fields) = message.split_first_chunk::<4>()?;
    let mut reader = Reader { bytes: fields, at: 0, is_little_endian: head[1] & 1 == 1 };
    if head[0] != 0 || head[1] > 1 {
        return None; // another encoding, of a later version of the standard
    }
    let (seconds, nanos) = (reader.number()?, reader.number()?);
    reader.bytes()?; // frame_id
    let stamp_ns = (u64::from(seconds) * 1_000_000_000).checked_add(u64::from(nanos)).filter(|ns| *ns > 0);
    if schema == COMPRESSED {
        let encoding = reader.text()?;
        return Some(Picture { stamp_ns, encoding, bytes: reader.bytes()?, ..Picture::default() });
    }
    let (height, width) = (reader.number()?, reader.number()?);
    let encoding = reader.text()?;
    reader.at += 1; // is_bigendian, of pixels with more than a byte
    let row_bytes = u64::from(reader.number()?);
    Some(Picture { stamp_ns, size: (width.into(), height.into()), encoding, row_bytes, bytes: reader.bytes()? })
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little_endian: bool,
}

impl<'a> Reader<'a> {
    fn number(&mut self) -> Option<u32> {
        let at = self.at.next_multiple_of(4);
        let bytes = *self.bytes.get(at..)?.first_chunk()?;
        self.at = at + 4;
        Some(if self.is_little_endian { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = usize::try_from(self.number()?).ok()?;
        let bytes = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(bytes)
    }

    /// A text, terminated by a zero.
    fn text(&mut self) -> Option<&'a str> {
        let bytes = self.bytes()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_image_of_either_byte_order_is_read() {
        for (order, of) in [(1u8, u32::to_le_bytes as fn(u32) -> [u8; 4]), (0, u32::to_be_bytes)] {
            let mut bytes = vec![0, order, 0, 0];
            let put = |bytes: &mut Vec<u8>, value: u32| {
                let at = bytes.len() - 4;
                bytes.resize(4 + at.next_multiple_of(4), 0);
                bytes.extend_from_slice(&of(value));
            };
            [12, 500, 3].into_iter().for_each(|value| put(&mut bytes, value));
            bytes.extend_from_slice(b"ab\0"); // frame_id, then padding
            [2, 3, 6].into_iter().for_each(|value| put(&mut bytes, value));
            bytes.extend_from_slice(b"mono8\0\0"); // encoding, is_bigendian
            [4, 8].into_iter().for_each(|value| put(&mut bytes, value));
            bytes.extend_from_slice(&[1, 2, 3, 9, 4, 5, 6, 9]);
            let picture = read(RAW, &bytes).expect("a message");
            assert_eq!((picture.stamp_ns, picture.size), (Some(12_000_000_500), (3, 2)));
            assert_eq!((picture.encoding, picture.row_bytes, picture.bytes[6]), ("mono8", 4, 6));
            for cut in 0..bytes.len() {
                assert!(read(RAW, &bytes[..cut]).is_none(), "cut at {cut}");
            }
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(mut bytes in proptest::collection::vec(any::<u8>(), 4..200), order in 0u8..2) {
            (bytes[0], bytes[1]) = (0, order);
            let _ = (read(COMPRESSED, &bytes), read(RAW, &bytes));
        }
    }
}
