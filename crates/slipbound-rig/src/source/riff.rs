//! The structure of an AVI file, followed chunk by chunk. The index at the end is not needed, so a recording
//! whose program died before writing it is read as far as it goes.
//!
//! ```text
//!   RIFF length "AVI "                       every chunk: four signs, length, content, padded to an even length
//!     LIST length "hdrl"
//!       avih
//!       LIST length "strl"  strh (kind, rate)  strf (size, codec)      once per stream
//!     LIST length "movi"
//!       00dc jpeg  00dc jpeg  01wb sound ...   also inside LIST length "rec "
//!     idx1
//!   RIFF length "AVIX" ...                   more of the same beyond 1 GB
//! ```

use super::Error;
use slipbound::image::SizePx;
use std::collections::VecDeque;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Frames per second as a fraction, as the header states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rate {
    /// Frames ...
    pub frames: u32,
    /// ... in this many seconds.
    pub seconds: u32,
}

/// Frame rates outside this range are ignored: the fastest finger cameras give 240 to 1000, time lapses one frame in
/// some seconds.
pub(super) const LEAST_RATE_HZ: f64 = 0.1;
pub(super) const MOST_RATE_HZ: f64 = 1000.0;

impl Rate {
    /// Whether it states a rate that no camera has.
    pub(super) fn is_doubtful(self) -> bool {
        let rate_hz = f64::from(self.frames) / f64::from(self.seconds);
        self.frames > 0 && self.seconds > 0 && !(LEAST_RATE_HZ..=MOST_RATE_HZ).contains(&rate_hz)
    }

    /// When frame `seq` would have been exposed, counted from frame 0; None for a rate without meaning, and for one
    /// that no camera has.
    pub fn time_ns(self, seq: u64) -> Option<u64> {
        if self.frames == 0 || self.seconds == 0 || self.is_doubtful() {
            return None;
        }
        u64::try_from(u128::from(seq) * u128::from(self.seconds) * 1_000_000_000 / u128::from(self.frames)).ok()
    }
}

/// What the header says of the first video stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Video {
    /// Four signs naming the codec.
    pub codec: [u8; 4],
    /// Size of the image.
    pub size: SizePx,
    /// The frame rate claimed.
    pub rate: Rate,
    /// The number of frames claimed; 0 in a recording that was cut off.
    pub frames_count: u32,
    stream: u8,
}

impl Video {
    /// Whether the frames are JPEG images.
    pub fn is_motion_jpeg(&self) -> bool {
        matches!(self.codec.to_ascii_uppercase().as_slice(), b"MJPG" | b"JPEG" | b"AVRN" | b"DMB1")
    }

    /// The codec's signs as text.
    pub fn codec_name(&self) -> String {
        self.codec.escape_ascii().to_string()
    }

    /// The claimed number of frames, where there is a claim.
    pub fn frames_claimed(&self) -> Option<u64> {
        (self.frames_count > 0).then_some(u64::from(self.frames_count))
    }
}

/// What a file holds, whatever its header claims.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Survey {
    /// Whole frames, dropped ones counted.
    pub frames_count: u64,
    /// Numbers of the dropped ones, in order.
    pub dropped: VecDeque<u64>,
    /// Why the rest is missing, for a file that was cut off.
    pub cut: Option<String>,
}

/// The next thing in the list of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Item {
    /// An encoded frame.
    Frame,
    /// A frame that its recorder dropped: its number and time count.
    Dropped,
    /// The file ends too early or goes on with something else; nothing follows.
    Cut(String),
    /// The file is over, as it should be.
    End,
}

/// Why a file cannot be followed up to its frames.
#[derive(Debug)]
pub(super) enum Fault {
    /// The operating system refused.
    Read(io::Error),
    /// It is not built like an AVI file.
    Shape { expected: &'static str, got: String },
}

impl Fault {
    /// The same with the file's name.
    pub fn at(self, path: &Path) -> Error {
        let path = path.to_owned();
        match self {
            Fault::Read(source) => Error::Read { path, source },
            Fault::Shape { expected, got } => Error::Avi { path, expected, got },
        }
    }
}

impl From<io::Error> for Fault {
    fn from(e: io::Error) -> Self {
        Fault::Read(e)
    }
}

/// A walk through an AVI file.
#[derive(Debug)]
pub(super) struct Walk<R> {
    from: R,
    at: u64,
    file_bytes: u64,
    /// Where the list of frames should end; None when its length was never written.
    list_ends: Option<u64>,
    frames_seen: u64,
    video: Video,
}

/// A chunk's four signs and its length.
struct Head {
    name: [u8; 4],
    bytes: u32,
}

impl<R: Read + Seek> Walk<R> {
    /// Reads the header and stops in front of the first frame.
    pub fn open(mut from: R) -> Result<Self, Fault> {
        let file_bytes = from.seek(SeekFrom::End(0))?;
        from.rewind()?;
        let no_video = Video {
            codec: [0; 4],
            size: SizePx::new(0, 0),
            rate: Rate { frames: 0, seconds: 0 },
            frames_count: 0,
            stream: 0,
        };
        let mut walk = Walk { from, at: 0, file_bytes, list_ends: None, frames_seen: 0, video: no_video };
        let mut found = None;
        let mut header = None;
        let mut streams: u8 = 0;
        loop {
            let Some(head) = walk.head()? else {
                let got = format!("the end of the file at byte {file_bytes}");
                return Err(Fault::Shape { expected: "a list of frames", got });
            };
            match &head.name {
                b"RIFF" | b"LIST" => match &walk.list_kind()? {
                    b"AVI " | b"hdrl" | b"strl" => {}
                    b"movi" => {
                        walk.enter_list(&head);
                        break;
                    }
                    _ => walk.skip(head.bytes.saturating_sub(4))?,
                },
                b"strh" => {
                    header = Some(walk.content::<56>(head.bytes)?);
                    streams = streams.saturating_add(1);
                }
                b"strf" => {
                    let format = walk.content::<40>(head.bytes)?;
                    if let (None, Some(h)) = (&found, header.filter(|h| h.starts_with(b"vids"))) {
                        found = Some(Video::read(&h, &format, streams - 1));
                    }
                }
                name if walk.at == 8 => {
                    let got = name.escape_ascii().to_string();
                    return Err(Fault::Shape { expected: "`RIFF` at its start", got });
                }
                _ => walk.skip(head.bytes)?,
            }
        }
        walk.video = found.ok_or(Fault::Shape { expected: "a video stream", got: format!("{streams} others") })?;
        Ok(walk)
    }

    /// What the header says.
    pub fn video(&self) -> Video {
        self.video
    }

    /// The next encoded frame into a recycled buffer.
    pub fn next(&mut self, into: &mut Vec<u8>) -> io::Result<Item> {
        self.step(Some(into))
    }

    /// Counts what is there and goes back to the first frame.
    pub fn survey(&mut self) -> io::Result<Survey> {
        let (at, list_ends) = (self.at, self.list_ends);
        let mut dropped = VecDeque::new();
        let cut = loop {
            match self.step(None)? {
                Item::Frame => {}
                Item::Dropped => dropped.push_back(self.frames_seen - 1),
                Item::Cut(reason) => break Some(reason),
                Item::End => break None,
            }
        };
        let frames_count = self.frames_seen;
        self.from.seek(SeekFrom::Start(at))?;
        (self.at, self.list_ends, self.frames_seen) = (at, list_ends, 0);
        Ok(Survey { frames_count, dropped, cut })
    }

    /// Goes on to the next frame and reads it, if there is a buffer to read it into.
    fn step(&mut self, into: Option<&mut Vec<u8>>) -> io::Result<Item> {
        loop {
            let start = self.at;
            let Some(head) = self.head()? else {
                return Ok(self.end());
            };
            if !head.name.iter().all(|b| (b' '..=b'~').contains(b)) {
                self.at = self.file_bytes; // nothing can be followed from here
                let got = head.name.escape_ascii();
                return Ok(Item::Cut(format!("the file goes on with `{got}` at byte {start}, which is no AVI chunk")));
            }
            if matches!(&head.name, b"RIFF" | b"LIST") {
                match &self.list_kind()? {
                    b"AVIX" | b"rec " => {}
                    b"movi" => self.enter_list(&head),
                    _ => self.skip(head.bytes.saturating_sub(4))?,
                }
                continue;
            }
            if !self.is_frame(&head.name) {
                self.skip(head.bytes)?;
                continue;
            }
            let left = self.file_bytes.saturating_sub(self.at);
            if u64::from(head.bytes) > left {
                self.at = self.file_bytes;
                return Ok(Item::Cut(format!(
                    "frame cut off: the file ends at byte {} with {left} of its {} bytes",
                    self.file_bytes, head.bytes
                )));
            }
            self.frames_seen += 1;
            match into {
                Some(into) => {
                    into.resize(head.bytes as usize, 0);
                    self.from.read_exact(into)?;
                    self.at += u64::from(head.bytes);
                    self.forward(u64::from(head.bytes % 2))?;
                }
                None => self.skip(head.bytes)?,
            }
            return Ok(if head.bytes == 0 { Item::Dropped } else { Item::Frame });
        }
    }

    /// The file is over: whole, or shorter than it says.
    fn end(&self) -> Item {
        let claimed = self.video.frames_claimed().unwrap_or(0);
        match self.list_ends {
            Some(ends) if ends > self.file_bytes => Item::Cut(format!(
                "the file ends at byte {}, its frames should go on to byte {ends}; {} of {claimed} frames are there",
                self.file_bytes, self.frames_seen
            )),
            None if claimed > self.frames_seen => {
                Item::Cut(format!("the file holds {} of {claimed} frames", self.frames_seen))
            }
            _ => Item::End,
        }
    }

    /// `00dc` or `00db` for stream 0, and so on.
    fn is_frame(&self, name: &[u8; 4]) -> bool {
        let stream = self.video.stream;
        name[..2] == [b'0' + stream / 10 % 10, b'0' + stream % 10] && matches!(&name[2..], b"dc" | b"db")
    }

    /// Notes where the list just entered should end. Programs write the length last: 0 or all ones until then.
    fn enter_list(&mut self, head: &Head) {
        self.list_ends = match head.bytes {
            0 | u32::MAX => None,
            bytes => Some(self.at - 4 + u64::from(bytes)),
        };
    }

    /// The next four signs and length; None when fewer than 8 bytes are left.
    fn head(&mut self) -> io::Result<Option<Head>> {
        if self.file_bytes < self.at + 8 {
            return Ok(None);
        }
        let mut bytes = [0; 8];
        self.from.read_exact(&mut bytes)?;
        self.at += 8;
        let [a, b, c, d, length @ ..] = bytes;
        Ok(Some(Head { name: [a, b, c, d], bytes: u32::from_le_bytes(length) }))
    }

    /// The four signs that say what a list holds; blanks at the end of the file.
    fn list_kind(&mut self) -> io::Result<[u8; 4]> {
        let mut kind = *b"    ";
        if self.file_bytes >= self.at + 4 {
            self.from.read_exact(&mut kind)?;
            self.at += 4;
        }
        Ok(kind)
    }

    /// The first `N` bytes of a chunk, zeros where it is shorter; then on to the next chunk.
    fn content<const N: usize>(&mut self, bytes: u32) -> io::Result<[u8; N]> {
        let mut content = [0; N];
        let have = u64::from(bytes).min(N as u64).min(self.file_bytes.saturating_sub(self.at)) as usize;
        self.from.read_exact(&mut content[..have])?;
        self.at += have as u64;
        let rest = u64::from(bytes) - have as u64 + u64::from(bytes % 2);
        self.forward(rest)?;
        Ok(content)
    }

    /// Passes over a chunk of this length and its padding.
    fn skip(&mut self, bytes: u32) -> io::Result<()> {
        self.forward(u64::from(bytes) + u64::from(bytes % 2))
    }

    fn forward(&mut self, bytes: u64) -> io::Result<()> {
        self.at += bytes;
        self.from.seek_relative(bytes as i64)
    }
}

impl Video {
    /// From the stream's header and its BITMAPINFOHEADER.
    fn read(header: &[u8; 56], format: &[u8; 40], stream: u8) -> Video {
        let word =
            |bytes: &[u8], at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let codec = match &format[16..20] {
            [0, 0, 0, 0] => &header[4..8],
            named => named,
        };
        Video {
            codec: [codec[0], codec[1], codec[2], codec[3]],
            size: SizePx::new(word(format, 4) as usize, (word(format, 8) as i32).unsigned_abs() as usize),
            rate: Rate { frames: word(header, 24), seconds: word(header, 20) },
            frames_count: word(header, 32),
            stream,
        }
    }
}

#[cfg(test)]
mod tests;
