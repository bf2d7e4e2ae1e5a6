//! Motion-JPEG AVI files, written so that a recording broken off half way can still be read.
//!
//! Lengths and the index are filled in by [`AviWriter::finish`]; until then the lengths read "unknown" (all ones),
//! and readers that walk the file, ours among them, see every frame written so far.

use slipbound::image::SizePx;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Lengths in a RIFF file have 32 bits; half of that is safe in every player.
pub const MAX_BYTES: u64 = 2_000_000_000;
/// Placeholder for a length that is not known yet.
const UNKNOWN: u32 = u32::MAX;
/// avih: the file has an index.
const HAS_INDEX: u32 = 0x10;
/// idx1: the frame decodes without any other.
const KEY_FRAME: u32 = 0x10;

/// Offsets of the fields that are filled in last.
const RIFF_LENGTH_AT: u64 = 4;
const FRAMES_COUNT_AT: u64 = 48;
const STREAM_FRAMES_COUNT_AT: u64 = 140;
const MOVI_LENGTH_AT: u64 = 216;
/// Content of the reserved words in our files.
const SIGNATURE: [u8; 16] = *b"slipbound\0\0\0\0\0\0\0";
const SIGNATURE_AT: usize = 72;
/// Start of the list of frames: offsets of index entries count from here.
const MOVI_AT: u64 = 220;

/// An AVI file that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// AVI files end at 2 GB. What was written before can still be finished.
    #[error("{}: expected at most {most_bytes} bytes, got {bytes_count}; write pictures into a folder instead", path.display())]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Its greatest length.
        most_bytes: u64,
        /// Its length with the frame that does not fit.
        bytes_count: u64,
    },
}

/// Writes JPEG images of one size as a Motion-JPEG AVI file.
#[derive(Debug)]
pub struct AviWriter {
    path: PathBuf,
    to: BufWriter<File>,
    at: u64,
    most_bytes: u64,
    /// Offset from the list's name and length of each frame.
    index: Vec<(u32, u32)>,
    finished: bool,
}

impl AviWriter {
    /// Creates the file; one that is there already is overwritten. `rate_hz`: at which it will be played.
    pub fn create(path: &Path, size: SizePx, rate_hz: u32) -> Result<Self, Error> {
        let failed = |source| Error::Write { path: path.to_owned(), source };
        let mut to = BufWriter::new(File::create(path).map_err(failed)?);
        let header = header(size, rate_hz);
        to.write_all(&header).and_then(|()| to.flush()).map_err(failed)?;
        let at = header.len() as u64;
        Ok(AviWriter { path: path.to_owned(), to, at, most_bytes: MAX_BYTES, index: Vec::new(), finished: false })
    }

    /// The same with a lower limit of its length than [`MAX_BYTES`].
    #[must_use]
    pub fn with_most_bytes(mut self, most_bytes: u64) -> Self {
        self.most_bytes = most_bytes.min(MAX_BYTES);
        self
    }

    /// Appends an image: a whole JPEG of the size given to [`AviWriter::create`].
    pub fn push(&mut self, jpeg: &[u8]) -> Result<(), Error> {
        let padded = jpeg.len().next_multiple_of(2) as u64;
        let index_bytes = 8 + 16 * (self.index.len() as u64 + 1);
        let bytes_count = self.at + 8 + padded + index_bytes;
        if bytes_count > self.most_bytes {
            return Err(Error::TooLong { path: self.path.clone(), most_bytes: self.most_bytes, bytes_count });
        }
        self.index.push(((self.at - MOVI_AT) as u32, jpeg.len() as u32));
        self.write(b"00dc")?;
        self.write(&(jpeg.len() as u32).to_le_bytes())?;
        self.write(jpeg)?;
        if jpeg.len() % 2 == 1 {
            self.write(&[0])?;
        }
        Ok(())
    }

    /// Writes the index and fills in the lengths.
    pub fn finish(mut self) -> Result<(), Error> {
        self.close()
    }

    fn close(&mut self) -> Result<(), Error> {
        if std::mem::replace(&mut self.finished, true) {
            return Ok(());
        }
        let movi_length = (self.at - MOVI_AT) as u32;
        let index = std::mem::take(&mut self.index);
        self.write(b"idx1")?;
        self.write(&(16 * index.len() as u32).to_le_bytes())?;
        for (offset, length) in &index {
            self.write(b"00dc")?;
            for word in [KEY_FRAME, *offset, *length] {
                self.write(&word.to_le_bytes())?;
            }
        }
        let riff_length = (self.at - 8) as u32;
        for (at, word) in [
            (RIFF_LENGTH_AT, riff_length),
            (FRAMES_COUNT_AT, index.len() as u32),
            (STREAM_FRAMES_COUNT_AT, index.len() as u32),
            (MOVI_LENGTH_AT, movi_length),
        ] {
            self.to.seek(SeekFrom::Start(at)).map_err(|source| Error::Write { path: self.path.clone(), source })?;
            self.write(&word.to_le_bytes())?;
        }
        self.to.flush().map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.at += bytes.len() as u64;
        self.to.write_all(bytes).map_err(|source| Error::Write { path: self.path.clone(), source })
    }
}

impl Drop for AviWriter {
    /// Closes an unfinished file as well as possible: its length is that of what was written.
    fn drop(&mut self) {
        let _ = self.close(); // `finish` reports failures
    }
}

/// Whether a file with this start was written by this crate.
pub(crate) fn is_ours(start: &[u8]) -> bool {
    start.starts_with(b"RIFF") && start.get(SIGNATURE_AT..).is_some_and(|rest| rest.starts_with(&SIGNATURE))
}

/// Everything in front of the first frame.
fn header(size: SizePx, rate_hz: u32) -> Vec<u8> {
    let (width, height) = (size.width as u32, size.height as u32);
    let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let microseconds = 1_000_000 / rate_hz.max(1);
    let avih = [words(&[microseconds, 0, 0, HAS_INDEX, 0, 0, 1, 0, width, height]), SIGNATURE.to_vec()].concat();
    let strh = [
        b"vidsMJPG".to_vec(),
        words(&[0, 0, 0, 1, rate_hz, 0, 0, 0, UNKNOWN, 0]),
        [[0, 0], [0, 0]].concat(),
        [(width as u16).to_le_bytes(), (height as u16).to_le_bytes()].concat(),
    ]
    .concat();
    let strf = [words(&[40, width, height, 1 | 24 << 16]), b"MJPG".to_vec(), words(&[3 * width * height, 0, 0, 0, 0])];
    let strl = [b"strl".to_vec(), chunk(b"strh", &strh), chunk(b"strf", &strf.concat())].concat();
    let hdrl = [b"hdrl".to_vec(), chunk(b"avih", &avih), chunk(b"LIST", &strl)].concat();
    [
        [b"RIFF".to_vec(), words(&[UNKNOWN]), b"AVI ".to_vec(), chunk(b"LIST", &hdrl)].concat(),
        [b"LIST".to_vec(), words(&[UNKNOWN]), b"movi".to_vec()].concat(),
    ]
    .concat()
}

fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    [name.as_slice(), &(content.len() as u32).to_le_bytes(), content].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_filled_in_last_stand_where_they_are_thought_to() {
        let header = header(SizePx::new(64, 48), 25);
        assert_eq!(header.len() as u64, MOVI_AT + 4);
        assert_eq!(&header[MOVI_AT as usize..], b"movi");
        assert_eq!(&header[MOVI_LENGTH_AT as usize - 4..MOVI_LENGTH_AT as usize], b"LIST");
        assert!(is_ours(&header));
        let word = |at: u64| u32::from_le_bytes(header[at as usize..][..4].try_into().expect("four bytes"));
        assert_eq!((word(RIFF_LENGTH_AT), word(MOVI_LENGTH_AT)), (UNKNOWN, UNKNOWN));
        assert_eq!((word(FRAMES_COUNT_AT - 4), word(FRAMES_COUNT_AT)), (HAS_INDEX, 0));
        assert_eq!((word(STREAM_FRAMES_COUNT_AT - 8), word(STREAM_FRAMES_COUNT_AT)), (25, 0));
    }
}
