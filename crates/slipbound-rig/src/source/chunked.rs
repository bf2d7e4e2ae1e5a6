//! Decodes `Transfer-Encoding: chunked` as the bytes arrive: pure, incremental, keeps nothing but a number.
//!
//! ```text
//!   1a2b;extension CRLF | 0x1a2b bytes of the stream | CRLF | .. | 0 CRLF  end
//! ```
//!
//! We request by HTTP/1.0, which has no chunks, but small cameras (every ESP32) send them whatever the request was.

/// Longest line with the length of a chunk, bytes.
const LONGEST_LINE_BYTES: usize = 1 << 10;

/// An invalid length of a chunk. The connection should be reopened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected the length of a chunk of the stream, in hexadecimal digits on a line of its own")]
pub(super) struct Fault;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// On the line with the length of a chunk: the length as far as it was read, None before its first digit.
    Length {
        bytes: Option<u64>,
        is_over: bool,
        line_bytes: usize,
    },
    /// This many bytes of the chunk are still to come.
    Chunk(u64),
    /// Before the end of the line that ends a chunk.
    ChunkEnd,
    End,
}

const LINE: State = State::Length { bytes: None, is_over: false, line_bytes: 0 };

/// Takes chunked bytes, returns those of the stream.
#[derive(Debug)]
pub(super) struct Chunked(State);

impl Chunked {
    pub fn new() -> Self {
        Chunked(LINE)
    }

    /// Passes the stream's bytes within `bytes` to `into`, one run after the other. False once the last chunk has come.
    pub fn unpack(&mut self, mut bytes: &[u8], mut into: impl FnMut(&[u8])) -> Result<bool, Fault> {
        while let Some((&first, later)) = bytes.split_first() {
            match self.0 {
                State::End => break,
                State::Chunk(left_bytes) => {
                    let here_bytes = usize::try_from(left_bytes).unwrap_or(usize::MAX).min(bytes.len());
                    into(&bytes[..here_bytes]);
                    bytes = &bytes[here_bytes..];
                    let left_bytes = left_bytes - here_bytes as u64;
                    self.0 = if left_bytes == 0 { State::ChunkEnd } else { State::Chunk(left_bytes) };
                }
                State::ChunkEnd => {
                    bytes = later;
                    self.0 = match first {
                        b'\n' => LINE,
                        b'\r' => State::ChunkEnd,
                        _ => return Err(Fault),
                    };
                }
                State::Length { bytes: length, is_over, line_bytes } => {
                    bytes = later;
                    self.0 = on_line(first, length, is_over, line_bytes)?;
                }
            }
        }
        Ok(self.0 != State::End)
    }
}

/// What comes after one more byte on the line of a length.
fn on_line(byte: u8, length: Option<u64>, is_over: bool, line_bytes: usize) -> Result<State, Fault> {
    if line_bytes == LONGEST_LINE_BYTES {
        return Err(Fault);
    }
    let line_bytes = line_bytes + 1;
    match (byte, length) {
        (b'\n', Some(0)) => Ok(State::End),
        (b'\n', Some(bytes)) => Ok(State::Chunk(bytes)),
        (b'\r' | b' ' | b'\t' | b';', Some(_)) => Ok(State::Length { bytes: length, is_over: true, line_bytes }),
        (_, Some(_)) if is_over => Ok(State::Length { bytes: length, is_over, line_bytes }),
        _ => {
            let digit = char::from(byte).to_digit(16).ok_or(Fault)?;
            let bytes = length.unwrap_or(0).checked_mul(16).ok_or(Fault)? + u64::from(digit);
            Ok(State::Length { bytes: Some(bytes), is_over, line_bytes })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The output for bytes in pieces of this length, and whether more may come.
    fn unpacked(bytes: &[u8], piece: usize) -> (Vec<u8>, Result<bool, Fault>) {
        let (mut chunked, mut out, mut goes_on) = (Chunked::new(), Vec::new(), Ok(true));
        for piece in bytes.chunks(piece) {
            goes_on = chunked.unpack(piece, |run| out.extend_from_slice(run));
            if goes_on != Ok(true) {
                break;
            }
        }
        (out, goes_on)
    }

    #[test]
    fn lengths_are_taken_out_wherever_the_bytes_are_split() {
        let bytes = b"4\r\nabcd\r\n00A;name=\"4\"\r\n0123\r\n6789\r\n1 \r\n\n\r\n0\r\nTrailer: x\r\n\r\n";
        for piece in 1..=bytes.len() {
            assert_eq!(unpacked(bytes, piece), (b"abcd0123\r\n6789\n".to_vec(), Ok(false)), "pieces of {piece}");
        }
        assert_eq!(unpacked(b"8\r\nabc", 2), (b"abc".to_vec(), Ok(true)));
    }

    #[test]
    fn what_is_no_length_is_a_fault() {
        let endless = [b"1;".to_vec(), vec![b'x'; LONGEST_LINE_BYTES]].concat();
        for bytes in [&b"--cam\r\n"[..], b"-1\r\n", b"2\r\nabc", b"10000000000000000\r\n", b"1g\r\n", &endless] {
            assert_eq!(unpacked(bytes, 3).1, Err(Fault), "{}", String::from_utf8_lossy(bytes));
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(b'1'), Just(b'\n'), Just(b'f')], 0..300),
            piece in 1usize..9,
        ) {
            let (whole, ended) = unpacked(&bytes, bytes.len().max(1));
            prop_assert!(whole.len() <= bytes.len());
            prop_assert_eq!((whole, ended), unpacked(&bytes, piece));
        }
    }
}
