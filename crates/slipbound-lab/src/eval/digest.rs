//! Short digests, to detect changes: of what a sweep reads from files, and of the program itself.

use super::error::EvalError;
use super::watch::{Restarts, Watch, watch};
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::Trial;

/// FNV-1a of 64 bits over parts of text. Detects a wrong folder, not deliberate manipulation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Digest(u64);

impl Digest {
    /// The digest of nothing.
    pub fn new() -> Self {
        Digest(0xcbf2_9ce4_8422_2325)
    }

    /// Adds the next part; the boundaries of parts count.
    pub fn add(&mut self, part: &str) {
        for byte in (part.len() as u64).to_le_bytes().into_iter().chain(part.bytes()) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// 16 hexadecimal digits.
    pub fn word(self) -> String {
        format!("{:016x}", self.0)
    }
}

/// A short trial with contact, incipient and gross slip.
const TRIAL: &str = "ramp?object=crayons_box&force_n=20&mu=0.5&ramp_s=0.2&grid=fast&seed=1";

/// The digest of a simulated trial and of what every detector says of it: builds that simulate or judge differently give
/// different ones, and their records do not belong into one table.
pub(super) fn of_method() -> Result<String, EvalError> {
    let entries: Vec<&'static Entry> = DETECTORS.iter().collect();
    let watched = watch(&Watch::new(Trial::parse(TRIAL)?, Restarts::Rivals), &entries, None)?;
    let mut digest = Digest::new();
    digest.add(&format!("{:?} {:?}", watched.truth, watched.gross));
    watched.seen.iter().for_each(|(entry, seen)| digest.add(&format!("{} {seen:?}", entry.name)));
    Ok(digest.word())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_tells_parts_and_their_ends_apart_and_is_the_same_everywhere() {
        let of = |parts: &[&str]| {
            let mut digest = Digest::new();
            parts.iter().for_each(|part| digest.add(part));
            digest.word()
        };
        assert_eq!(of(&[]), "cbf29ce484222325");
        assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
        assert_ne!(of(&["a"]), of(&["a", ""]));
        assert_eq!(of(&["a", "b"]), of(&["a", "b"]));
    }
}
