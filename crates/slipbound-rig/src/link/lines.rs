//! Lines of text from a stream of bytes.

/// Longest accepted line, bytes.
const LONGEST: usize = 256;

/// Appends a line of text.
pub(crate) fn write_line(into: &mut Vec<u8>, line: &str) {
    into.extend(line.as_bytes());
    into.push(b'\n');
}

/// Splits a stream into lines, however the bytes arrive. Keeps at most one line's worth.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    buffer: Vec<u8>,
    is_too_long: bool,
}

impl Lines {
    /// Takes bytes and calls `found` with every line that is now complete, without its end. A line that is too long or
    /// is not ASCII is reported as `None`.
    pub fn feed(&mut self, bytes: &[u8], mut found: impl FnMut(Option<&str>)) {
        for byte in bytes {
            match byte {
                b'\n' => {
                    let line = std::str::from_utf8(&self.buffer).ok().filter(|line| line.is_ascii());
                    found(line.filter(|_| !self.is_too_long).map(str::trim));
                    self.clear();
                }
                _ if self.buffer.len() >= LONGEST => self.is_too_long = true,
                byte => self.buffer.push(*byte),
            }
        }
    }

    /// Drops an incomplete line.
    pub fn clear(&mut self) {
        self.buffer.clear();
        self.is_too_long = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_however_they_come() {
        let text = [b"POS=1\r\nFORCE=2\n".as_slice(), &[b'x'; 700], b"\n\xFF\nACK HOME\nFIN".as_slice()].concat();
        for step in [1, 3, 7, 2000] {
            let (mut lines, mut found) = (Lines::default(), Vec::new());
            for bytes in text.chunks(step) {
                lines.feed(bytes, |line| found.push(line.map(str::to_owned)));
                assert!(lines.buffer.len() <= LONGEST);
            }
            let expected = [Some("POS=1"), Some("FORCE=2"), None, None, Some("ACK HOME")];
            assert_eq!(found, expected.map(|line| line.map(str::to_owned)), "{step}");
        }
    }
}
