//! A saved rest frame, as `slipbound tare` writes it: reading returns the same rest frame, to the last bit.
//!
//! ```text
//!   line 1   {"format":"slipbound-rest","format_version":1,"software_version":..,"bytes":..,"crc32":..}   of what follows
//!   line 2   {"source":..,"frames":[from,to],"noise_px":..,"sensor":{..},"settings":{..}}                 what it was made of
//!   line 3   the rest frame
//! ```
//!
//! A file is recognised by its first line, not by its name.

use crate::replaced_file::ReplacedFile;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use slipbound::monitor::{Rest, Settings};
use slipbound::sensor::Sensor;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// How every such file begins.
pub(crate) const START: &[u8] = b"{\"format\":\"slipbound-rest\"";
/// Incremented when a reader of old files could misread new ones.
const FORMAT_VERSION: u32 = 1;
/// More than the largest rest frame needs.
const MOST_BYTES: u64 = 1 << 30;
/// Facts of a finger on which its rest frame does not depend.
const FREE_FACTS: [&str; 4] = ["description", "pitch_mm", "gel_mm", "shear"];
/// Settings on which it does depend, whichever frames were chosen.
const BINDING_SETTINGS: [&str; 2] = ["imprint", "markers"];

/// A finger at rest, and what it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct SavedRest {
    /// The rest frame.
    pub rest: Rest,
    /// Its origin and its finger.
    pub made_of: MadeOf,
}

/// What a rest frame was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MadeOf {
    /// The camera or recording, as the user named it.
    pub source: String,
    /// The frames that were averaged: from, to (exclusive).
    pub frames: [u64; 2],
    /// Median over the markers of the RMS distance from the mean position while nothing moved, px; None where too few
    /// frames showed it.
    pub noise_px: Option<f64>,
    /// The finger, at the resolution of its sensor file.
    pub sensor: Sensor,
    /// The settings of its monitor.
    pub settings: Settings,
}

/// The first line.
#[derive(Debug, Serialize, Deserialize)]
struct FirstLine {
    format: String,
    format_version: u32,
    software_version: String,
    bytes: u64,
    crc32: u32,
}

/// The part of the first line that every version has.
#[derive(Debug, Deserialize)]
struct AnyVersion {
    format_version: u32,
    #[serde(default)]
    software_version: String,
}

/// A rest file that cannot be written, read, or used.
#[derive(Debug, thiserror::Error)]
pub enum RestFileError {
    /// The operating system refused.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// It could not be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// It is not a rest file.
    #[error("{file}: expected a finger at rest as `slipbound tare` writes it, got something else")]
    Other {
        /// The file.
        file: String,
    },
    /// Another version wrote it, in another format.
    #[error(
        "{file}: expected a finger at rest of format version {expected}, got {got}, written by slipbound {software}: take it anew \
         with `slipbound tare`"
    )]
    Version {
        /// The file.
        file: String,
        /// The version read here.
        expected: u32,
        /// The version found.
        got: u32,
        /// The software that wrote it.
        software: String,
    },
    /// It is damaged: its bytes are not those that were written.
    #[error("{file}: damaged: {problem}: take it anew with `slipbound tare`")]
    Damaged {
        /// The file.
        file: String,
        /// What was expected and got.
        problem: String,
    },
    /// It belongs to another finger, or was made with other settings.
    #[error("{file}: {whose}: {key}: expected {expected}, got {got} in the file")]
    Foreign {
        /// The file.
        file: String,
        /// What is different, in words.
        whose: &'static str,
        /// The first key that differs.
        key: String,
        /// The value of the finger or of the settings.
        expected: String,
        /// The value in the file.
        got: String,
    },
}

/// Whether the file begins like a rest file; false for one that cannot be read.
pub fn is_rest(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(START.len() as u64).read_to_end(&mut start));
    read.is_ok() && start == START
}

impl SavedRest {
    /// The bytes of its file. Fails for a number that JSON cannot represent.
    pub fn to_bytes(&self) -> serde_json::Result<Vec<u8>> {
        let mut rest = serde_json::to_vec(&self.made_of)?;
        rest.push(b'\n');
        serde_json::to_writer(&mut rest, &self.rest)?;
        rest.push(b'\n');
        let first = FirstLine {
            format: "slipbound-rest".into(),
            format_version: FORMAT_VERSION,
            software_version: env!("CARGO_PKG_VERSION").into(),
            bytes: rest.len() as u64,
            crc32: crc32(&rest),
        };
        let mut bytes = serde_json::to_vec(&first)?;
        bytes.push(b'\n');
        bytes.append(&mut rest);
        Ok(bytes)
    }

    /// Writes the complete file, or leaves the old one unchanged.
    pub fn write(&self, path: &Path) -> Result<(), RestFileError> {
        use io::Write as _;
        let bytes = self.to_bytes().map_err(io::Error::from);
        let written = bytes.and_then(|bytes| {
            let mut file = ReplacedFile::create(path)?;
            file.file().write_all(&bytes)?;
            file.keep()
        });
        written.map_err(|source| RestFileError::Write { path: path.to_owned(), source })
    }

    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, RestFileError> {
        let failed = |source| RestFileError::Read { path: path.to_owned(), source };
        let (mut file, mut bytes) = (File::open(path).map_err(failed)?, Vec::new());
        // Another kind of file may never end, so no more than this is read of it.
        file.by_ref().take(START.len() as u64).read_to_end(&mut bytes).map_err(failed)?;
        if bytes == START {
            file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(failed)?;
        }
        Self::from_bytes(&bytes, &path.display().to_string())
    }

    /// Parses the content of a file; messages call it `file`.
    pub fn from_bytes(bytes: &[u8], file: &str) -> Result<Self, RestFileError> {
        let file = || file.to_owned();
        let damaged = |problem: String| RestFileError::Damaged { file: file(), problem };
        if !bytes.starts_with(START) {
            return Err(RestFileError::Other { file: file() });
        }
        let (first, rest) = line(bytes).ok_or_else(|| damaged("the first line has no end".into()))?;
        let any: AnyVersion = serde_json::from_slice(first).map_err(|e| damaged(format!("line 1: {e}")))?;
        if any.format_version != FORMAT_VERSION {
            let (got, software) = (any.format_version, any.software_version);
            return Err(RestFileError::Version { file: file(), expected: FORMAT_VERSION, got, software });
        }
        let first: FirstLine = serde_json::from_slice(first).map_err(|e| damaged(format!("line 1: {e}")))?;
        if first.bytes != rest.len() as u64 {
            return Err(damaged(format!("expected {} bytes after the first line, got {}", first.bytes, rest.len())));
        }
        if first.crc32 != crc32(rest) {
            return Err(damaged(format!("expected the CRC-32 {}, got {}", first.crc32, crc32(rest))));
        }
        let (made_of, rest) = line(rest).ok_or_else(|| damaged("the second line has no end".into()))?;
        Ok(SavedRest {
            made_of: serde_json::from_slice(made_of).map_err(|e| damaged(format!("line 2: {e}")))?,
            rest: serde_json::from_slice(rest).map_err(|e| damaged(format!("line 3: {e}")))?,
        })
    }

    /// Checks that it belongs to this finger, at any resolution, and to a monitor with these settings. `file`: its name
    /// in messages.
    pub fn check(&self, sensor: &Sensor, settings: &Settings, file: &str) -> Result<(), RestFileError> {
        let foreign =
            |whose, (key, expected, got)| RestFileError::Foreign { file: file.into(), whose, key, expected, got };
        let is_fact = |key: &str| !FREE_FACTS.contains(&key);
        let made_of = &self.made_of.sensor;
        let sized = |finger: &Sensor| match sensor.image_px == made_of.image_px {
            true => finger.clone(),
            false => finger.at_size(self.rest.size()).unwrap_or_else(|_| finger.clone()),
        };
        if let Some(difference) = difference(&sized(sensor), &sized(made_of), is_fact) {
            return Err(foreign("it is another finger's", difference));
        }
        match difference(settings, &self.made_of.settings, |key| BINDING_SETTINGS.contains(&key)) {
            Some(difference) => Err(foreign("it was made with other settings", difference)),
            None => Ok(()),
        }
    }
}

/// The bytes up to the first line end, and those after it.
fn line(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    Some((&bytes[..end], &bytes[end + 1..]))
}

fn crc32(bytes: &[u8]) -> u32 {
    const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    CRC.checksum(bytes)
}

/// The first dotted key whose values differ, and both values. Compares only the outermost keys that `counts` accepts.
fn difference(
    a: &impl Serialize,
    b: &impl Serialize,
    counts: impl Fn(&str) -> bool,
) -> Option<(String, String, String)> {
    // Both can be written as JSON: such values come from files.
    let (Ok(Value::Object(a)), Ok(Value::Object(b))) = (serde_json::to_value(a), serde_json::to_value(b)) else {
        return None;
    };
    let keys = a.keys().chain(b.keys()).filter(|key| counts(key));
    keys.filter_map(|key| first_difference(key, a.get(key), b.get(key))).next()
}

fn first_difference(key: &str, a: Option<&Value>, b: Option<&Value>) -> Option<(String, String, String)> {
    match (a, b) {
        (Some(Value::Object(a)), Some(Value::Object(b))) => {
            let within = |inner: &String| first_difference(&format!("{key}.{inner}"), a.get(inner), b.get(inner));
            a.keys().chain(b.keys()).find_map(within)
        }
        _ if a == b => None,
        _ => {
            let shown = |value: Option<&Value>| match value {
                None | Some(Value::Null) => "none".to_owned(),
                Some(Value::String(text)) => text.clone(),
                Some(other) => other.to_string(),
            };
            Some((key.to_owned(), shown(a), shown(b)))
        }
    }
}
