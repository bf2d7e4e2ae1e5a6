//! Modbus RTU: the two functions of a 2F-85 that the driver needs, and in [`Request`] all that it has.
//!
//! ```text
//!   write:  09 10 03E8 0003 06 | 6 bytes | crc     answer  09 10 03E8 0003 crc
//!   read:   09 04 07D0 0003 crc                    answer  09 04 06 | 6 bytes | crc
//!                                                  refusal 09 (90 or 84) code crc
//! ```

mod frame;
mod request;

pub use frame::SLAVE;
pub use request::{Registers, Request};

use frame::{Look, READ, REFUSED, WRITE, WRITE_ONE, message, sound};

/// The first output register.
pub const FIRST_OUTPUT: u16 = 1000;

/// The first input register.
pub const FIRST_INPUT: u16 = 2000;

/// Number of registers of each.
pub const REGISTERS_COUNT: u16 = 3;

/// Where the outputs are, and how many registers.
const OUTPUT: [u8; 4] = [0x03, 0xE8, 0x00, 0x03];

/// Where the inputs are.
const INPUT: [u8; 2] = [0x07, 0xD0];

/// Longest message of either side, bytes: Modbus has no longer ones.
const LONGEST: usize = 256;

/// Appends the request to write the six output bytes.
pub fn request_write(into: &mut Vec<u8>, outputs: [u8; 6]) {
    message(into, &[&[SLAVE, WRITE], &OUTPUT, &[6], &outputs]);
}

/// Appends the request to read the six input bytes.
pub fn request_read(into: &mut Vec<u8>) {
    message(into, &[&[SLAVE, READ], &INPUT, &[0, 3]]);
}

/// Appends the answer to a write: the value for function 6, else the number of registers.
pub fn answer_write(into: &mut Vec<u8>, function: u8, registers: Registers, bytes: [u8; 6]) {
    let last = if function == WRITE_ONE { [bytes[0], bytes[1]] } else { registers.count.to_be_bytes() };
    message(into, &[&[SLAVE, function], &registers.first.to_be_bytes(), &last]);
}

/// Appends the answer to a read by this function (3, 4 or 23): the bytes of the registers.
pub fn answer_read(into: &mut Vec<u8>, function: u8, registers: &[u8]) {
    message(into, &[&[SLAVE, function, registers.len() as u8], registers]);
}

/// Appends a refusal.
pub fn answer_refused(into: &mut Vec<u8>, function: u8, code: u8) {
    message(into, &[&[SLAVE, function | REFUSED, code]]);
}

/// What a gripper answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The six input bytes.
    Inputs([u8; 6]),
    /// The outputs were written.
    Written,
    /// The function was refused, with this code.
    Refused(u8),
}

/// Finds messages in a byte stream. Keeps at most one message's worth.
#[derive(Debug, Default)]
pub struct Parser {
    held: Vec<u8>,
    /// Bytes that belong to no message.
    passed_over_count: usize,
}

impl Parser {
    /// Takes a gripper's bytes and calls `found` with every answer that is now complete.
    pub fn feed_answers(&mut self, bytes: &[u8], found: impl FnMut(Answer)) {
        self.feed(bytes, answer, found);
    }

    /// Takes a master's bytes and calls `found` with every request that is now complete.
    pub fn feed_requests(&mut self, bytes: &[u8], found: impl FnMut(Request)) {
        self.feed(bytes, request::request, found);
    }

    /// The line has been silent, which ends a master's message: nothing else ends one with an unknown function. Bytes
    /// that form no message are dropped.
    pub fn end_request(&mut self, found: impl FnMut(Request)) {
        let ended = (0..self.held.len()).find_map(|start| request::ended(&self.held[start..]));
        self.held.clear();
        ended.into_iter().for_each(found);
    }

    /// Whether a message has begun and is incomplete.
    pub fn is_within(&self) -> bool {
        !self.held.is_empty()
    }

    /// Number of bytes since the last call that belong to no message.
    pub fn take_passed_over_count(&mut self) -> usize {
        std::mem::take(&mut self.passed_over_count)
    }

    /// Drops an incomplete message.
    pub fn clear(&mut self) {
        self.held.clear();
    }

    fn feed<T>(&mut self, mut bytes: &[u8], look: fn(&[u8]) -> Look<T>, mut found: impl FnMut(T)) {
        while !bytes.is_empty() {
            let room = (LONGEST - self.held.len()).min(bytes.len());
            self.held.extend_from_slice(&bytes[..room]);
            bytes = &bytes[room..];
            let mut start = 0;
            loop {
                match look(&self.held[start..]) {
                    Look::Whole(message, length) => {
                        found(message);
                        start += length;
                    }
                    Look::Short if self.held.len() - start < LONGEST => break,
                    Look::None | Look::Short => {
                        start += 1;
                        self.passed_over_count += 1;
                    }
                }
            }
            self.held.drain(..start);
        }
    }
}

fn answer(bytes: &[u8]) -> Look<Answer> {
    match bytes {
        [] | [SLAVE] => Look::Short,
        [SLAVE, READ] => Look::Short,
        [SLAVE, READ, 6, ..] => sound(bytes, 11, |body| body[3..].first_chunk().copied().map(Answer::Inputs)),
        [SLAVE, WRITE, ..] => sound(bytes, 8, |body| (body[2..] == OUTPUT).then_some(Answer::Written)),
        [SLAVE, function, ..] if [READ | REFUSED, WRITE | REFUSED].contains(function) => {
            sound(bytes, 5, |body| Some(Answer::Refused(body[2])))
        }
        _ => Look::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(hex: &str) -> Vec<u8> {
        hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("a byte")).collect()
    }

    fn answers(bytes: &[u8]) -> Vec<Answer> {
        let mut found = Vec::new();
        Parser::default().feed_answers(bytes, |answer| found.push(answer));
        found
    }

    fn requests(bytes: &[u8]) -> Vec<Request> {
        let mut found = Vec::new();
        Parser::default().feed_requests(bytes, |request| found.push(request));
        found
    }

    /// Frames printed in the maker's manual for the 2F-85 and 2F-140.
    #[test]
    fn the_manuals_frames_are_written_and_read() {
        let mut out = Vec::new();
        request_write(&mut out, [0x09, 0, 0, 0, 0xFF, 0xFF]);
        assert_eq!(out, bytes("09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19"));
        let (registers, bytes_written) = (Registers { first: 1000, count: 3 }, [0x09, 0, 0, 0, 0xFF, 0xFF]);
        assert_eq!(requests(&out), [Request::Write { function: 16, registers, bytes: bytes_written }]);
        out.clear();
        answer_write(&mut out, 16, registers, bytes_written);
        assert_eq!(out, bytes("09 10 03 E8 00 03 01 30"));
        assert_eq!(answers(&out), [Answer::Written]);
        out.clear();
        request_read(&mut out);
        assert_eq!(out, bytes("09 04 07 D0 00 03 B1 CE"));
        let inputs = |count| Registers { first: 2000, count };
        assert_eq!(requests(&out), [Request::Read { function: 4, registers: inputs(3) }]);
        assert_eq!(requests(&bytes("09 03 07 D0 00 01 85 CF")), [Request::Read { function: 3, registers: inputs(1) }]);
        out.clear();
        answer_read(&mut out, 4, &[0xF9, 0, 0, 0, 0x0D, 0]);
        assert_eq!(out, bytes("09 04 06 F9 00 00 00 0D 00 17 AA"));
        assert_eq!(answers(&out), [Answer::Inputs([0xF9, 0, 0, 0, 0x0D, 0])]);
        out.clear();
        answer_read(&mut out, 4, &[0x31, 0]);
        assert_eq!(out, bytes("09 04 02 31 00 4D 61"));
    }

    #[test]
    fn messages_are_found_between_garbage_and_no_single_byte_can_be_changed() {
        let good = bytes("09 04 06 F9 00 00 00 0D 00 17 AA");
        for place in 0..good.len() {
            for change in 1..=255 {
                let mut bad = good.clone();
                bad[place] ^= change;
                assert_eq!(answers(&bad), [], "byte {place} by {change:#x}");
                bad.extend(&good);
                bad.extend([0; LONGEST]);
                assert_eq!(answers(&bad).len(), 1, "byte {place} by {change:#x}");
            }
        }
        let mut parser = Parser::default();
        let mut count = 0;
        for byte in [&good[..5], &[9, 9, 4, 16], &good, &[0x90, 9], &good].concat() {
            parser.feed_answers(&[byte], |_| count += 1);
            assert!(parser.held.len() <= LONGEST);
        }
        assert_eq!(count, 2);
    }
}
