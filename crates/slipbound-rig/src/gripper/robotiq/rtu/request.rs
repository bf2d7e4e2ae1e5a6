//! Requests of a master to a 2F-85: the functions 3, 4, 6, 16 and 23 of its manual, and others by their number.
//!
//! ```text
//!   3, 4  read          09 04 07D0 0003 crc
//!   6     write one     09 06 03E8 0900 crc
//!   16    write         09 10 03E8 0003 06 | 6 bytes | crc
//!   23    write, read   09 17 07D0 0002 03E9 0002 04 | 4 bytes | crc     read from, count; write to, count
//! ```

use super::frame::{Look, READ, READ_HOLDING, READ_WRITE, REFUSED, SLAVE, WRITE, WRITE_ONE, checked, sound};

/// Some registers that follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Registers {
    /// The first.
    pub first: u16,
    /// How many.
    pub count: u16,
}

/// A request to a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Read.
    Read {
        /// 3 or 4.
        function: u8,
        /// Which registers.
        registers: Registers,
    },
    /// Write.
    Write {
        /// 6 or 16.
        function: u8,
        /// Which registers.
        registers: Registers,
        /// Their bytes, of the first three; what is beyond them is 0.
        bytes: [u8; 6],
    },
    /// Write, then read, by function 23.
    WriteRead {
        /// The registers written.
        written: Registers,
        /// Their bytes, of the first three; what is beyond them is 0.
        bytes: [u8; 6],
        /// The registers read.
        read: Registers,
    },
    /// A function that it has, in a message that is too long or too short for it.
    Malformed(u8),
    /// A function that it does not have.
    Unknown(u8),
}

/// Two bytes as a number.
fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_be_bytes([bytes[at], bytes[at + 1]])
}

fn registers(bytes: &[u8], at: usize) -> Registers {
    Registers { first: word(bytes, at), count: word(bytes, at + 2) }
}

fn six(bytes: &[u8]) -> [u8; 6] {
    std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(0))
}

/// Parses a complete message without its checksum.
fn read(body: &[u8]) -> Request {
    // The values of a write follow their number of bytes, which follows the number of registers.
    let has_values = |at: usize| {
        let is_sum = |bytes: &u8| u16::from(*bytes) == 2 * (word(body, at - 2) & 0xFF) && body[at - 2] == 0;
        body.get(at).is_some_and(|bytes| is_sum(bytes) && body.len() == at + 1 + usize::from(*bytes))
    };
    match (body[1], body.len()) {
        (function @ (READ | READ_HOLDING), 6) => Request::Read { function, registers: registers(body, 2) },
        (WRITE_ONE, 6) => {
            let registers = Registers { first: word(body, 2), count: 1 };
            Request::Write { function: WRITE_ONE, registers, bytes: six(&body[4..]) }
        }
        (WRITE, _) if has_values(6) => {
            Request::Write { function: WRITE, registers: registers(body, 2), bytes: six(&body[7..]) }
        }
        (READ_WRITE, _) if has_values(10) => {
            Request::WriteRead { written: registers(body, 6), bytes: six(&body[11..]), read: registers(body, 2) }
        }
        (function @ (READ | READ_HOLDING | WRITE_ONE | WRITE | READ_WRITE), _) => Request::Malformed(function),
        (function, _) => Request::Unknown(function),
    }
}

/// The message at the start of a master's bytes. A message of unknown length is short until it is ended.
pub(super) fn request(bytes: &[u8]) -> Look<Request> {
    let length = match bytes {
        [SLAVE, READ | READ_HOLDING | WRITE_ONE, ..] => 8,
        [SLAVE, WRITE, _, _, _, _, bytes_count, ..] => 9 + usize::from(*bytes_count),
        [SLAVE, READ_WRITE, _, _, _, _, _, _, _, _, bytes_count, ..] => 13 + usize::from(*bytes_count),
        [SLAVE, function, ..] if *function >= REFUSED => return Look::None,
        [] | [SLAVE, ..] => return Look::Short,
        _ => return Look::None,
    };
    sound(bytes, length, |body| Some(read(body)))
}

/// The message in a master's bytes that a silence has ended.
pub(super) fn ended(bytes: &[u8]) -> Option<Request> {
    let is_ours = matches!(bytes, [SLAVE, 0..REFUSED, _, _, ..]);
    checked(bytes).filter(|_| is_ours).map(read)
}

#[cfg(test)]
mod tests {
    use super::super::Parser;
    use super::super::frame::message;
    use super::*;

    fn bytes(hex: &str) -> Vec<u8> {
        hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("a byte")).collect()
    }

    /// The messages found in these bytes, before and after the silence that ends them.
    fn requests(bytes: &[u8]) -> (Vec<Request>, Vec<Request>) {
        let (mut parser, mut found, mut ended) = (Parser::default(), Vec::new(), Vec::new());
        parser.feed_requests(bytes, |request| found.push(request));
        parser.end_request(|request| ended.push(request));
        assert!(!parser.is_within());
        (found, ended)
    }

    /// Function 23 of the manual for the 2F-85 and 2F-140, and what pymodbus sends.
    #[test]
    fn a_write_and_read_at_once_is_whole_by_its_own_length() {
        let (inputs, outputs) = (|count| Registers { first: 2000, count }, |first, count| Registers { first, count });
        for (frame, written, values, read) in [
            (
                "09 17 07 D0 00 02 03 E9 00 02 04 00 E6 3C C8 2D 0C",
                outputs(1001, 2),
                [0, 0xE6, 0x3C, 0xC8, 0, 0],
                inputs(2),
            ),
            (
                "09 17 07 D0 00 03 03 E8 00 03 06 09 00 00 00 FF 80 97 EE",
                outputs(1000, 3),
                [9, 0, 0, 0, 0xFF, 0x80],
                inputs(3),
            ),
        ] {
            assert_eq!(requests(&bytes(frame)), (vec![Request::WriteRead { written, bytes: values, read }], vec![]));
        }
    }

    #[test]
    fn what_is_of_no_known_length_ends_with_the_silence() {
        let framed = |body: &str| {
            let mut frame = Vec::new();
            message(&mut frame, &[&bytes(body)]);
            frame
        };
        for (body, request) in [
            ("09 16 03 E8 FF FF 00 00", Request::Unknown(22)),
            ("09 07", Request::Unknown(7)),
            ("09 2B 0E 01 00 00", Request::Unknown(43)),
            ("09 04 07 D0", Request::Malformed(4)),
        ] {
            assert_eq!(requests(&framed(body)), (vec![], vec![request]), "{body}");
        }
        let odd = framed("09 10 03 E8 00 03 02 01 00");
        assert_eq!(requests(&odd), (vec![Request::Malformed(16)], vec![]), "2 bytes are not 3 registers");
        let read = framed("09 04 07 D0 00 03");
        let registers = Registers { first: 2000, count: 3 };
        let garbled = [&[9, 22, 3][..], &read].concat();
        assert_eq!(requests(&garbled), (vec![], vec![Request::Read { function: 4, registers }]), "after garbage");
        let mut bad = framed("09 16 03 E8 FF FF 00 00");
        bad[3] ^= 1;
        assert_eq!(requests(&bad), (vec![], vec![]));
        assert_eq!(requests(&framed("01 04 07 D0 00 03")), (vec![], vec![]), "of another slave");
    }
}
