//! Frames of the WSG-50's binary interface.
//!
//! ```text
//!   AA AA AA | id | length, low byte first | payload | checksum, low byte first
//! ```
//!
//! The checksum uses the table of the polynomial 0x1021 as for most significant bit first, but moves through it least
//! significant byte first. No catalogued CRC-16 does that. It starts with FFFF, covers everything from the first AA,
//! and is 0 over a frame with its checksum. It detects every change of one byte, but misses one in 10000 changes of two
//! neighbouring bytes; TCP, which has a checksum of its own, makes that acceptable.

/// What every frame begins with.
const PREAMBLE: [u8; 3] = [0xAA; 3];

/// Longest accepted payload. The longest answer this driver asks for has 6 bytes.
const LONGEST_PAYLOAD: usize = 64;

/// Bytes of a frame around its payload.
const AROUND: usize = 8;

const TABLE: [u16; 256] = table();

const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let mut crc = (i as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 { (crc << 1) ^ 0x1021 } else { crc << 1 };
            bit += 1;
        }
        table[i] = crc;
        i += 1;
    }
    table
}

/// The checksum of these bytes; 0 over a whole frame.
pub fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, byte| TABLE[usize::from((crc as u8) ^ byte)] ^ (crc >> 8))
}

/// Appends a frame. A payload beyond 65535 bytes is cut.
pub fn write(into: &mut Vec<u8>, id: u8, payload: &[u8]) {
    let length = u16::try_from(payload.len()).unwrap_or(u16::MAX);
    let start = into.len();
    into.extend(PREAMBLE);
    into.push(id);
    into.extend(length.to_le_bytes());
    into.extend(&payload[..usize::from(length)]);
    let crc = checksum(&into[start..]);
    into.extend(crc.to_le_bytes());
}

/// A complete frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// The command, or the command that it answers.
    pub id: u8,
    length: usize,
    bytes: [u8; LONGEST_PAYLOAD],
}

impl Frame {
    /// Its payload.
    pub fn payload(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// The status a reply starts with, and what follows. None when it is too short for one.
    pub fn reply(&self) -> Option<(u16, &[u8])> {
        let (status, rest) = self.payload().split_first_chunk()?;
        Some((u16::from_le_bytes(*status), rest))
    }
}

/// The first number of a payload, if it is long enough for one.
pub fn number(payload: &[u8]) -> Option<f32> {
    payload.first_chunk().map(|bytes| f32::from_le_bytes(*bytes))
}

/// Finds frames in a byte stream: split, merged, with garbage between. Keeps at most one frame's worth.
#[derive(Debug, Default)]
pub struct Parser {
    held: Vec<u8>,
    passed_over_count: usize,
}

impl Parser {
    /// Takes bytes and calls `found` with every frame that is now complete.
    pub fn feed(&mut self, mut bytes: &[u8], mut found: impl FnMut(Frame)) {
        while !bytes.is_empty() {
            let room = (LONGEST_PAYLOAD + AROUND - self.held.len()).min(bytes.len());
            self.held.extend_from_slice(&bytes[..room]);
            bytes = &bytes[room..];
            let mut start = 0;
            loop {
                match whole(&self.held[start..]) {
                    Look::Frame(frame) => {
                        found(frame);
                        start += frame.length + AROUND;
                    }
                    Look::None => {
                        start += 1;
                        self.passed_over_count += 1;
                    }
                    Look::Short => break,
                }
            }
            self.held.drain(..start);
        }
    }

    /// Number of bytes outside any frame since the last call.
    pub fn take_passed_over_count(&mut self) -> usize {
        std::mem::take(&mut self.passed_over_count)
    }

    /// Drops an incomplete frame.
    pub fn clear(&mut self) {
        self.held.clear();
    }
}

enum Look {
    Frame(Frame),
    /// No frame starts here.
    None,
    /// Perhaps one; more bytes are needed.
    Short,
}

fn whole(bytes: &[u8]) -> Look {
    let seen = bytes.len().min(PREAMBLE.len());
    if bytes[..seen] != PREAMBLE[..seen] {
        return Look::None;
    }
    let Some(header) = bytes.first_chunk::<6>() else { return Look::Short };
    let length = usize::from(u16::from_le_bytes([header[4], header[5]]));
    if length > LONGEST_PAYLOAD {
        return Look::None;
    }
    let Some(frame) = bytes.get(..length + AROUND) else { return Look::Short };
    if checksum(frame) != 0 {
        return Look::None;
    }
    let mut payload = [0; LONGEST_PAYLOAD];
    payload[..length].copy_from_slice(&frame[6..6 + length]);
    Look::Frame(Frame { id: header[3], length, bytes: payload })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOMED: [u8; 10] = [0xAA, 0xAA, 0xAA, 0x20, 0x02, 0x00, 0x00, 0x00, 0xB3, 0xFD];
    const LIMIT_20_N: [u8; 12] = [0xAA, 0xAA, 0xAA, 0x32, 0x04, 0x00, 0x00, 0x00, 0xA0, 0x41, 0xF5, 0x22];

    fn frames(bytes: &[u8]) -> Vec<Frame> {
        let mut found = Vec::new();
        Parser::default().feed(bytes, |frame| found.push(frame));
        found
    }

    #[test]
    fn known_good_frames_are_written_and_read() {
        for (id, payload, expected) in [
            (0x01, &[][..], &[0xAA, 0xAA, 0xAA, 0x01, 0x00, 0x00, 0xE8, 0x10][..]),
            (0x20, &[0, 0], &HOMED),
            (0x32, &20f32.to_le_bytes(), &LIMIT_20_N),
            (0x24, b"ack", &[0xAA, 0xAA, 0xAA, 0x24, 0x03, 0x00, 0x61, 0x63, 0x6B, 0xDC, 0xB9]),
        ] {
            let mut bytes = Vec::new();
            write(&mut bytes, id, payload);
            assert_eq!(bytes, expected, "{id:#x}");
            let read = frames(expected);
            assert_eq!((read.len(), read[0].id, read[0].payload()), (1, id, payload));
        }
        assert_eq!(frames(&HOMED)[0].reply(), Some((0, &[][..])));
        assert_eq!(number(frames(&LIMIT_20_N)[0].payload()), Some(20.0));
    }

    /// This checksum misses some changes of two neighbouring bytes; a catalogued CRC-16 misses none.
    #[test]
    fn no_change_of_one_byte_goes_unseen_and_73_of_715275_changes_of_two_neighbours_do() {
        let mut force = Vec::new();
        write(&mut force, 0x45, &[&[0, 0], &20f32.to_le_bytes()[..]].concat());
        let mut unseen_count = 0;
        for good in [&LIMIT_20_N[..], &HOMED, &force] {
            for place in 0..good.len() {
                for change in 1..=255 {
                    let mut bytes = good.to_vec();
                    bytes[place] ^= change;
                    assert_eq!(frames(&bytes), [], "byte {place} by {change:#x}");
                    for second in 1..=255 {
                        let mut both = bytes.clone();
                        if let Some(next) = both.get_mut(place + 1).filter(|_| good == LIMIT_20_N) {
                            *next ^= second;
                            unseen_count += u32::from(checksum(&both) == 0);
                        }
                    }
                }
            }
        }
        assert_eq!(unseen_count, 73);
    }

    #[test]
    fn what_is_no_frame_is_passed_over_and_the_next_one_found() {
        let mut bytes = vec![0xAA, 0xAA, 0x01, 0xAA];
        bytes.extend(LIMIT_20_N); // begins with a fourth AA
        bytes.extend(&HOMED[..7]); // cut
        bytes.extend([0xAA, 0xAA, 0xAA, 0x45, 0xFF, 0xFF]); // endless
        bytes.extend(HOMED);
        bytes.extend([0; 80]);
        let mut parser = Parser::default();
        let mut ids = Vec::new();
        for byte in bytes {
            parser.feed(&[byte], |frame| ids.push(frame.id));
            assert!(parser.held.len() <= LONGEST_PAYLOAD + AROUND);
        }
        assert_eq!(ids, [0x32, 0x20]);
        assert!(parser.take_passed_over_count() > 12);
    }
}
