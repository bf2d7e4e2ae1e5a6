//! The records of an MCAP file in order, those in its chunks too, up to where it is cut off or damaged.
//!
//! ```text
//!   magic | kind 1, length 8, record | .. | chunk: sizes, checksum, compression, records | .. | footer | magic
//! ```
//!
//! The claims of a file are checked first: no length makes the reader allocate more memory than there are bytes, and no
//! record is longer than the rest of its chunk.

use super::mcap_writer::LIBRARY;
use super::unpack::{Lz4, Unpack, Unpacker, Zstd};
use crate::source::Error;
use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use mcap::records::{Record, op};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Longest record that is read, bytes; a damaged length asks for more.
pub(super) const LONGEST_RECORD_BYTES: u64 = 256 << 20;
/// Most that a chunk may hold, unpacked, bytes; tools write chunks of 1 to 8 MB.
const MOST_CHUNK_BYTES: u64 = 1 << 30;
/// Length of a chunk that was being written when its program was killed.
const NOT_CLOSED: u64 = u64::MAX;
/// Most that is read from the disk, or unpacked, at a time, bytes.
const PIECE_BYTES: usize = 1 << 16;
/// Kind and length of a record, bytes.
const HEAD_BYTES: usize = 9;
/// A chunk's head up to the name of its compression, bytes; that name is a few letters.
const CHUNK_HEAD_BYTES: usize = 32;
const LONGEST_NAME_BYTES: u32 = 64;

static CHECKSUM: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// Why reading ends, in words.
type Broken = String;

/// The records of a file up to its end, or to where it cannot be followed.
pub(super) struct Records {
    input: BufReader<File>,
    chunk: Option<Chunk>,
    chunks_count: u64,
    /// Whether we wrote it: then a summary comes before its end.
    is_ours: bool,
    is_over: bool,
    /// Why it could not be followed further.
    pub broken: Option<String>,
    /// What is wrong with the chunk that was read last.
    pub damaged: Option<String>,
    /// Attachments whose bytes are not those that were written.
    damaged_attachments_count: u64,
}

/// A chunk that is being read.
struct Chunk {
    /// None where it is not compressed.
    packing: Option<Box<dyn Unpacker>>,
    /// Bytes of it that are still in the file, and bytes that follow it in its record.
    packed_left: u64,
    after_bytes: u64,
    /// Read from the file and not yet unpacked.
    packed: Vec<u8>,
    /// Bytes still to be unpacked.
    left: u64,
    /// Unpacked bytes, and how many of them were used.
    out: Vec<u8>,
    used: usize,
    /// The stored checksum, 0 for none; and that of the unpacked bytes.
    checksum: u32,
    digest: Digest<'static, u32, Table<16>>,
}

impl Records {
    /// The records of a file.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        let mut input = BufReader::with_capacity(PIECE_BYTES, file);
        let mut magic = Vec::new();
        let read = input.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic);
        read.map_err(|source| Error::Read { path: path.to_owned(), source })?;
        let is_mcap = magic == mcap::MAGIC;
        let why = match mcap::MAGIC.starts_with(&magic) {
            true => "ends in its first bytes",
            false => "expected a file of MCAP, got none",
        };
        let broken = (!is_mcap).then(|| damage_message(why));
        Ok(Records {
            input,
            chunk: None,
            chunks_count: 0,
            is_ours: false,
            is_over: !is_mcap,
            broken,
            damaged: None,
            damaged_attachments_count: 0,
        })
    }

    /// What is wrong with the file, as far as it was read.
    pub fn damage(&self) -> impl Iterator<Item = String> {
        let count = self.damaged_attachments_count;
        let attachments = (count > 0).then(|| format!("{count} attachments that are damaged"));
        self.damaged.iter().chain(&self.broken).cloned().chain(attachments)
    }

    /// The next record; None at the end, and where the file cannot be followed.
    pub fn next_record(&mut self) -> Option<Record<'static>> {
        while !self.is_over {
            let read = match self.chunk.is_some() {
                true => self.in_chunk(),
                false => self.in_file(),
            };
            match read {
                Ok(Some(record)) => return Some(record),
                Ok(None) => {}
                Err(why) => {
                    self.is_over = true;
                    self.broken = Some(damage_message(&why));
                }
            }
        }
        None
    }

    /// A record of the file; None for the beginning of a chunk, and for the end.
    fn in_file(&mut self) -> Result<Option<Record<'static>>, Broken> {
        let head: [u8; HEAD_BYTES] = self.take()?;
        let (kind, length) = split_head(head);
        if kind == op::CHUNK {
            return self.begin_chunk(length).map(|()| None);
        }
        if length > LONGEST_RECORD_BYTES {
            return Err(format!("expected a record of at most {LONGEST_RECORD_BYTES} bytes, got {length}"));
        }
        let mut data = Vec::new();
        self.input.by_ref().take(length).read_to_end(&mut data).map_err(words)?;
        if data.len() as u64 != length {
            return Err("unexpected end of the file".into());
        }
        if kind == op::FOOTER {
            self.is_over = true;
            let magic: [u8; 8] = self.take()?;
            if magic != *mcap::MAGIC {
                return Err("expected the end of the file, got more".into());
            }
            let has_summary = matches!(parsed(kind, &data)?, Some(Record::Footer(footer)) if footer.summary_start != 0);
            return if self.is_ours && !has_summary {
                Err("its program was killed or has failed".into())
            } else {
                Ok(None)
            };
        }
        let record = parsed(kind, &data)?;
        self.damaged_attachments_count += u64::from(record.is_none());
        if let Some(Record::Header(header)) = &record {
            self.is_ours = header.library.starts_with(LIBRARY);
        }
        Ok(record)
    }

    fn begin_chunk(&mut self, length: u64) -> Result<(), Broken> {
        let number = self.chunks_count;
        self.chunks_count += 1;
        let wrong = |what: &str, got: u64| format!("chunk {number}: expected {what}, got {got}");
        if length == NOT_CLOSED {
            return Err(format!("chunk {number} was never closed"));
        }
        let head: [u8; CHUNK_HEAD_BYTES] = self.take()?;
        let u64_at = |at: usize| head[at..].first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        let u32_at = |at: usize| head[at..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let (left, checksum, name_bytes) = (u64_at(16), u32_at(24), u32_at(28));
        if name_bytes > LONGEST_NAME_BYTES {
            return Err(wrong("a short name of its compression", name_bytes.into()));
        }
        let mut name = vec![0; name_bytes as usize];
        self.input.read_exact(&mut name).map_err(words)?;
        let packed_left = u64::from_le_bytes(self.take()?);
        let head_bytes = CHUNK_HEAD_BYTES as u64 + u64::from(name_bytes) + 8;
        let after_bytes = length.checked_sub(head_bytes).and_then(|left| left.checked_sub(packed_left));
        let after_bytes =
            after_bytes.ok_or_else(|| wrong(&format!("at most {length} bytes in its record"), packed_left))?;
        if left > MOST_CHUNK_BYTES {
            return Err(wrong(&format!("at most {MOST_CHUNK_BYTES} bytes unpacked"), left));
        }
        let packing: Option<Box<dyn Unpacker>> = match name.as_slice() {
            b"" if left != packed_left => {
                return Err(wrong(&format!("{left} bytes that are not compressed"), packed_left));
            }
            b"" => None,
            b"zstd" => Some(Box::new(Unpack::<Zstd>::default())),
            b"lz4" => Some(Box::new(Unpack::<Lz4>::default())),
            other => {
                let got = String::from_utf8_lossy(other);
                return Err(format!("chunk {number}: expected zstd, lz4 or no compression, got `{got}`"));
            }
        };
        let digest = CHECKSUM.digest();
        let (packed, out) = (Vec::new(), Vec::new());
        self.chunk = Some(Chunk { packing, packed_left, after_bytes, packed, left, out, used: 0, checksum, digest });
        Ok(())
    }

    /// A record of the chunk; None at its end.
    fn in_chunk(&mut self) -> Result<Option<Record<'static>>, Broken> {
        let number = self.chunks_count.saturating_sub(1);
        let Some(chunk) = &mut self.chunk else { return Ok(None) };
        if chunk.left_bytes() == 0 {
            return self.end_chunk().map(|()| None);
        }
        let in_chunk = |why: Broken| format!("chunk {number}: {why}");
        let head = chunk.fill(HEAD_BYTES, &mut self.input).map_err(in_chunk)?;
        let Some(head) = head.first_chunk::<HEAD_BYTES>() else { return Ok(None) };
        let (kind, length) = split_head(*head);
        let most_bytes = (chunk.left_bytes() - HEAD_BYTES as u64).min(LONGEST_RECORD_BYTES);
        if length > most_bytes {
            return Err(format!("chunk {number}: expected a record of at most {most_bytes} bytes, got {length}"));
        }
        let count = HEAD_BYTES + length as usize;
        let record = parsed(kind, &chunk.fill(count, &mut self.input).map_err(in_chunk)?[HEAD_BYTES..]);
        chunk.used += count;
        let record = record.map_err(in_chunk)?;
        self.damaged_attachments_count += u64::from(record.is_none());
        Ok(record)
    }

    /// Skips the rest of the chunk in the file and verifies that the unpacked content is what was written.
    fn end_chunk(&mut self) -> Result<(), Broken> {
        let Some(chunk) = self.chunk.take() else { return Ok(()) };
        let past = chunk.packed_left + chunk.after_bytes;
        let passed = io::copy(&mut self.input.by_ref().take(past), &mut io::sink()).map_err(words)?;
        let (expected, got) = (chunk.checksum, chunk.digest.finalize());
        if expected != 0 && expected != got {
            let number = self.chunks_count - 1;
            self.damaged = Some(format!(
                "chunk {number}, just before this, is damaged: expected the checksum {expected:08x}, got {got:08x}"
            ));
        }
        if passed == past { Ok(()) } else { Err("unexpected end of the file".into()) }
    }

    fn take<const COUNT: usize>(&mut self) -> Result<[u8; COUNT], Broken> {
        let mut bytes = [0; COUNT];
        self.input.read_exact(&mut bytes).map_err(words)?;
        Ok(bytes)
    }
}

impl Chunk {
    /// Number of bytes not used yet.
    fn left_bytes(&self) -> u64 {
        self.left + (self.out.len() - self.used) as u64
    }

    /// The next `count` unused bytes.
    fn fill(&mut self, count: usize, input: &mut BufReader<File>) -> Result<&[u8], Broken> {
        if self.out.len() - self.used < count && self.used > 0 {
            self.out.drain(..self.used);
            self.used = 0;
        }
        while self.out.len() - self.used < count {
            let room = usize::try_from(self.left).unwrap_or(PIECE_BYTES).min(PIECE_BYTES);
            if room == 0 {
                return Err(format!("expected {count} bytes more, got its end"));
            }
            let from = self.out.len();
            match &mut self.packing {
                None => {
                    let read = input.by_ref().take(room as u64).read_to_end(&mut self.out).map_err(words)?;
                    if read == 0 {
                        return Err("unexpected end of the file".into());
                    }
                    self.packed_left -= read as u64;
                }
                Some(packing) => {
                    self.out.resize(from + room, 0);
                    let unpacked =
                        unpack(packing.as_mut(), &mut self.packed, &mut self.packed_left, input, &mut self.out[from..]);
                    self.out.truncate(from + *unpacked.as_ref().unwrap_or(&0));
                    unpacked?;
                }
            }
            self.left -= (self.out.len() - from) as u64;
            self.digest.update(&self.out[from..]);
        }
        Ok(&self.out[self.used..self.used + count])
    }
}

/// Unpacks into `out`, reading more of the file as needed; returns the number of bytes, at least one.
fn unpack(
    packing: &mut dyn Unpacker,
    packed: &mut Vec<u8>,
    packed_left: &mut u64,
    input: &mut BufReader<File>,
    out: &mut [u8],
) -> Result<usize, Broken> {
    loop {
        let step = packing.step(packed, out)?;
        packed.drain(..step.used);
        if step.wrote > 0 {
            return Ok(step.wrote);
        }
        if step.used > 0 {
            continue;
        }
        let wanted = (step.wanted_bytes.saturating_sub(packed.len())).max(1) as u64;
        let wanted = wanted.max(PIECE_BYTES as u64).min(*packed_left);
        if wanted == 0 {
            return Err("expected more compressed bytes, got its end".into());
        }
        let read = input.by_ref().take(wanted).read_to_end(packed).map_err(words)?;
        *packed_left -= read as u64;
        if read == 0 {
            return Err("unexpected end of the file".into());
        }
    }
}

fn split_head([kind, length @ ..]: [u8; HEAD_BYTES]) -> (u8, u64) {
    (kind, u64::from_le_bytes(length))
}

/// None for an attachment whose bytes are not those that were written: the record is whole, and reading goes on.
fn parsed(kind: u8, data: &[u8]) -> Result<Option<Record<'static>>, Broken> {
    if kind == op::ATTACHMENT && !holds_attachment(data) {
        return Err("an attachment that is shorter than it says".into());
    }
    match mcap::parse_record(kind, data) {
        Ok(record) => Ok(Some(record.into_owned())),
        Err(mcap::McapError::BadAttachmentCrc { .. }) => Ok(None),
        Err(e) => Err(e.to_string()),
    }
}

/// Whether the lengths in an attachment are such that it ends with its checksum: two times, name, media type, data.
fn holds_attachment(data: &[u8]) -> bool {
    let Some((_, mut rest)) = data.split_at_checked(16) else { return false };
    for _ in 0..2 {
        let Some((length, after)) = rest.split_first_chunk::<4>() else { return false };
        let Some((_, after)) = after.split_at_checked(u32::from_le_bytes(*length) as usize) else { return false };
        rest = after;
    }
    let Some((length, after)) = rest.split_first_chunk::<8>() else { return false };
    u64::from_le_bytes(*length).checked_add(4).is_some_and(|most| most <= after.len() as u64)
}

fn words(e: io::Error) -> Broken {
    match e.kind() {
        io::ErrorKind::UnexpectedEof => "unexpected end of the file".into(),
        _ => e.to_string(),
    }
}

fn damage_message(why: &str) -> String {
    format!("the recording is cut off or damaged ({why}); what came before was read")
}
