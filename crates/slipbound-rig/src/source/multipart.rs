//! The parts of a `multipart/x-mixed-replace` stream, as its bytes arrive: pure, incremental, bounded.
//!
//! ```text
//!   preamble | --name CRLF header: value CRLF .. CRLF | body | CRLF --name CRLF header .. | body | CRLF --name-- end
//!              delimiter   head                         part
//! ```
//!
//! Servers write wrong lengths, so a `Content-Length` only lets a part end early: if its last two bytes are those of a
//! JPEG, with no delimiter before them, it is complete without waiting for the next delimiter, and its frame does not
//! come one frame late. In every other case the next delimiter ends it; one within a line and before the stated length
//! is part of the image, whose bytes may spell a short name by chance. The result depends on the bytes alone, not on
//! how they were split.

/// Longest head of a part, bytes.
pub(super) const LONGEST_HEAD_BYTES: usize = 16 << 10;
/// Longest part, bytes: a raw image of 8 Mpx.
pub(super) const LONGEST_PART_BYTES: usize = 24 << 20;
/// What may come before the first delimiter, or between the end of a part and the next one, bytes.
const LONGEST_GAP_BYTES: usize = 1 << 20;

/// The last two bytes of a JPEG.
const JPEG_END: [u8; 2] = [0xFF, 0xD9];

/// A stream that cannot be followed any further. It should be reopened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum Fault {
    /// A head without an end.
    #[error("expected a part's head of at most {LONGEST_HEAD_BYTES} bytes, got more")]
    EndlessHead,
    /// A part without an end.
    #[error("expected a part of at most {LONGEST_PART_BYTES} bytes, got more")]
    EndlessPart,
    /// No delimiter where there should be one.
    #[error("expected the delimiter `--{name}` within {LONGEST_GAP_BYTES} bytes, got none")]
    NoDelimiter {
        /// The name of the boundary.
        name: String,
    },
}

/// What came next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Found {
    /// More bytes are needed.
    Nothing,
    /// A part was returned.
    Part(Head),
    /// The server states that no more parts come.
    End,
}

/// Contents of the head of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Head {
    /// `Content-Length`, bytes.
    pub length_bytes: Option<usize>,
    /// `X-Timestamp` of the camera's server, ns.
    pub time_ns: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before a delimiter.
    Gap,
    /// After a delimiter, before the end of its head.
    Head,
    /// In a part.
    Part(Head),
    End,
}

/// Takes bytes, gives parts.
#[derive(Debug)]
pub(super) struct Multipart {
    /// `--name`; servers disagree on whether the name itself begins with dashes, so those are not part of it.
    delimiter: Vec<u8>,
    state: State,
    bytes: Vec<u8>,
    /// Start of the unread bytes in `bytes`.
    from: usize,
    /// Bytes beyond `from` that were searched without success.
    searched: usize,
    /// Bytes skipped since the last part.
    gap_bytes: usize,
}

impl Multipart {
    /// For a stream with this boundary, as its `Content-Type` names it.
    pub fn new(boundary: &str) -> Self {
        let delimiter = format!("--{}", boundary.trim_start_matches('-')).into_bytes();
        Multipart { delimiter, state: State::Gap, bytes: Vec::new(), from: 0, searched: 0, gap_bytes: 0 }
    }

    /// Takes the next bytes of the stream.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.from);
        self.from = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// Bytes of a part that has begun and has not ended; none between two parts.
    pub fn begun_bytes(&self) -> usize {
        if matches!(self.state, State::Part(_)) { self.unread().len() } else { 0 }
    }

    /// The next part into `into`, or what else comes next. A fault is final.
    pub fn next(&mut self, into: &mut Vec<u8>) -> Result<Found, Fault> {
        loop {
            match self.state {
                State::End => return Ok(Found::End),
                State::Gap => {
                    let Some(at) = self.find_delimiter() else {
                        self.pass_over_gap()?;
                        return Ok(Found::Nothing);
                    };
                    self.take(at + self.delimiter.len());
                    self.state = State::Head;
                }
                State::Head => match self.read_head()? {
                    Some(state) => self.state = state,
                    None => return Ok(Found::Nothing),
                },
                State::Part(head) => {
                    let Some(end) = self.part_end(head)? else { return Ok(Found::Nothing) };
                    into.clear();
                    into.extend_from_slice(&self.unread()[..end]);
                    self.take(end);
                    self.state = State::Gap;
                    self.gap_bytes = 0;
                    return Ok(Found::Part(head));
                }
            }
        }
    }

    fn unread(&self) -> &[u8] {
        &self.bytes[self.from..]
    }

    fn take(&mut self, count: usize) {
        self.from += count;
        self.searched = 0;
    }

    /// Where the next delimiter begins among the unread bytes. Searches no byte twice.
    fn find_delimiter(&mut self) -> Option<usize> {
        let unread = &self.bytes[self.from..];
        let found = find(&unread[self.searched..], &self.delimiter).map(|at| at + self.searched);
        self.searched = found.unwrap_or((unread.len() + 1).saturating_sub(self.delimiter.len()).max(self.searched));
        found
    }

    /// Drops what cannot be the beginning of a delimiter.
    fn pass_over_gap(&mut self) -> Result<(), Fault> {
        let passed = (self.unread().len() + 1).saturating_sub(self.delimiter.len());
        self.gap_bytes += passed;
        self.take(passed);
        if self.gap_bytes > LONGEST_GAP_BYTES {
            return Err(Fault::NoDelimiter { name: String::from_utf8_lossy(&self.delimiter[2..]).into_owned() });
        }
        Ok(())
    }

    /// The state after the head that begins with the first unread byte; None while it has not ended.
    fn read_head(&mut self) -> Result<Option<State>, Fault> {
        let unread = self.unread();
        let Some(start) = unread.first_chunk::<2>() else { return Ok(None) };
        if start == b"--" {
            return Ok(Some(State::End));
        }
        let window = &unread[..unread.len().min(LONGEST_HEAD_BYTES)];
        // The search includes the delimiter's own line end: a head may be empty.
        let end = [&b"\r\n\r\n"[..], b"\n\n"].iter().filter_map(|end| Some(find(window, end)? + end.len())).min();
        match end {
            Some(end) => {
                let head = Head::read(&unread[..end]);
                self.take(end);
                Ok(Some(State::Part(head)))
            }
            None if window.len() == LONGEST_HEAD_BYTES => Err(Fault::EndlessHead),
            None => Ok(None),
        }
    }

    /// Whether the bytes of a delimiter here are some of the part's own: within a line, and before the end that its head
    /// states.
    fn is_of_part(&self, at: usize, head: Head) -> bool {
        let before = &self.unread()[..at];
        let dashes = before.iter().rev().take_while(|byte| **byte == b'-').count();
        let begins_line = before[..at - dashes].last().is_none_or(|byte| *byte == b'\n');
        !begins_line && head.length_bytes.is_some_and(|length| at < length)
    }

    /// Where the part that begins with the first unread byte ends; None while that is not known.
    fn part_end(&mut self, head: Head) -> Result<Option<usize>, Fault> {
        let delimiter = loop {
            match self.find_delimiter() {
                Some(at) if self.is_of_part(at, head) => self.searched = at + 1,
                found => break found,
            }
        };
        let unread = self.unread();
        let stated = head.length_bytes.filter(|&length| {
            delimiter.is_none_or(|at| length <= at)
                && unread.get(..length).is_some_and(|part| part.ends_with(&JPEG_END))
        });
        if let Some(length) = stated {
            return Ok(Some(length));
        }
        match delimiter {
            Some(at) if at <= LONGEST_PART_BYTES => Ok(Some(without_line_end(&unread[..at]))),
            _ if unread.len() > LONGEST_PART_BYTES => Err(Fault::EndlessPart),
            _ => Ok(None),
        }
    }
}

impl Head {
    fn read(bytes: &[u8]) -> Self {
        let mut head = Head::default();
        for line in String::from_utf8_lossy(bytes).lines() {
            let Some((name, value)) = line.split_once(':') else { continue };
            let value = value.trim();
            if name.trim().eq_ignore_ascii_case("content-length") {
                head.length_bytes = value.parse().ok();
            } else if name.trim().eq_ignore_ascii_case("x-timestamp") {
                head.time_ns = seconds_to_ns(value);
            }
        }
        head
    }
}

/// `12.345678` as nanoseconds, exactly; None for anything else.
fn seconds_to_ns(text: &str) -> Option<u64> {
    let (whole, parts) = text.split_once('.').unwrap_or((text, ""));
    let parts = parts.get(..parts.len().min(9))?;
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !is_number(whole) || !is_number(parts) {
        return None;
    }
    let parts_ns: u64 = format!("{parts:0<9}").parse().ok()?;
    whole.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(parts_ns)
}

/// The length of a part without the dashes and the line end that belong to the delimiter after it.
fn without_line_end(part: &[u8]) -> usize {
    let dashes = part.iter().rev().take_while(|byte| **byte == b'-').count();
    for end in [&b"\r\n"[..], b"\n"] {
        if let Some(body) = part[..part.len() - dashes].strip_suffix(end) {
            return body.len();
        }
    }
    part.len()
}

fn find(haystack: &[u8], needle: &[u8]) -> Option<usize> {
    let first = *needle.first()?;
    let mut from = 0;
    while let Some(at) = haystack[from..].iter().position(|byte| *byte == first) {
        if haystack[from + at..].starts_with(needle) {
            return Some(from + at);
        }
        from += at + 1;
    }
    None
}

#[cfg(test)]
mod tests;
