//! The file of a recording: its schemas, one channel per topic, messages.

use super::{annotations, foxglove};
use mcap::records::{MessageHeader, Metadata, op};
use mcap::{Attachment, MAGIC, McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};

/// Library name in our recordings; its version follows.
pub(super) const LIBRARY: &str = "slipbound ";

/// A chunk is closed beyond this size, bytes.
const CHUNK_BYTES: u64 = 8 << 20;

/// The schema of a report, the same as that of its JSON lines.
const REPORT_SCHEMA: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/report.schema.json"));
/// A schema that accepts any object.
const OBJECT_SCHEMA: &[u8] = br#"{"type":"object"}"#;
const FRAME_SCHEMA: &[u8] =
    br#"{"type":"object","title":"slipbound.Frame","required":["seq","time_ns","clock","fate","torn","is_kept"],
"properties":{"seq":{"type":"integer"},"time_ns":{"type":["integer","null"]},"clock":{"type":"string"},
"fate":{"enum":["judged","skipped","recorded"]},"torn":{"type":["string","null"]},"is_kept":{"type":"boolean"}}}"#;

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An image as it was received.
    Compressed,
    /// An image as pixels.
    Raw,
    /// A [`FrameRecord`](super::FrameRecord).
    Frame,
    /// A line of a report.
    Report,
    /// A line of `reports.jsonl` of a run.
    Cycle,
    /// A line of `events.jsonl` of a run.
    Event,
    /// A line of `frames.jsonl` of a run.
    CycleFrames,
    /// Results on an image, to be drawn over it.
    Annotations,
}

impl Kind {
    /// All, in numerical order.
    const ALL: [Kind; 8] = [
        Kind::Compressed,
        Kind::Raw,
        Kind::Frame,
        Kind::Report,
        Kind::Cycle,
        Kind::Event,
        Kind::CycleFrames,
        Kind::Annotations,
    ];

    /// The kind of a topic with lines of JSON.
    pub fn of_lines(topic: &str) -> Self {
        match topic {
            "/event" => Kind::Event,
            "/cycle/frames" => Kind::CycleFrames,
            topic if topic.ends_with("/report") => Kind::Report,
            topic if topic.ends_with("/frame") => Kind::Frame,
            _ => Kind::Cycle,
        }
    }

    fn is_binary(self) -> bool {
        matches!(self, Kind::Compressed | Kind::Raw | Kind::Annotations)
    }

    fn schema(self) -> (&'static str, Vec<u8>) {
        match self {
            Kind::Compressed => (foxglove::COMPRESSED, foxglove::description(foxglove::COMPRESSED)),
            Kind::Raw => (foxglove::RAW, foxglove::description(foxglove::RAW)),
            Kind::Frame => ("slipbound.Frame", FRAME_SCHEMA.to_vec()),
            Kind::Report => ("slipbound.Report", REPORT_SCHEMA.to_vec()),
            Kind::Cycle => ("slipbound.Cycle", OBJECT_SCHEMA.to_vec()),
            Kind::Event => ("slipbound.Event", OBJECT_SCHEMA.to_vec()),
            Kind::CycleFrames => ("slipbound.CycleFrames", OBJECT_SCHEMA.to_vec()),
            Kind::Annotations => (annotations::SCHEMA, annotations::description()),
        }
    }
}

/// Times of a message, ns.
#[derive(Debug, Clone, Copy)]
pub struct Times {
    /// When it was handed in.
    pub log_ns: u64,
    /// Time of the frame, or the same.
    pub stamp_ns: u64,
}

impl Times {
    /// Both the same.
    pub fn both(ns: u64) -> Self {
        Times { log_ns: ns, stamp_ns: ns }
    }
}

/// The end of a file whose program was killed: end of data and a footer without checksum or summary, magic.
///
/// ```text
///   kind 15, length 4, 0 | kind 2, length 20, 0, 0, 0 | magic
/// ```
const END: [u8; 50] = {
    let mut end = [0; 50];
    (end[0], end[1], end[13], end[14]) = (op::DATA_END, 4, op::FOOTER, 20);
    let mut i = 0;
    while i < MAGIC.len() {
        end[42 + i] = MAGIC[i];
        i += 1;
    }
    end
};

/// A recording that is being written, without any thread. If dropped before [`McapWriter::finish`], it keeps what was
/// written and ends like that of a killed program: its reader is told that it is cut off.
pub struct McapWriter {
    /// None once it is finished.
    writer: Option<Writer<BufWriter<File>>>,
    /// The same file at the same position; None where seeking is not possible, as in a pipe.
    end: Option<File>,
    /// By topic and kind: a source may give encoded images at one time and pixels at another.
    channels: BTreeMap<(String, Kind), u16>,
    schemas: [u16; Kind::ALL.len()],
}

impl McapWriter {
    /// Begins the file: chunks are not compressed.
    pub fn create(file: File) -> Result<Self, McapError> {
        let library = format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION"));
        // A chunk is written when it is complete. If it were written as it grows, a killed program would leave a head
        // that claims 2^64 bytes, at which other readers stop or fail.
        let options = WriteOptions::new().library(library).compression(None).chunk_size(Some(CHUNK_BYTES));
        let options = options.disable_seeking(true);
        let mut end = file.metadata()?.is_file().then(|| file.try_clone()).transpose()?;
        end.take_if(|end| end.stream_position().is_err());
        let mut writer = options.create(BufWriter::new(file))?;
        let mut schemas = [0; Kind::ALL.len()];
        for (into, kind) in schemas.iter_mut().zip(Kind::ALL) {
            let (name, description) = kind.schema();
            let encoding = if kind.is_binary() { "protobuf" } else { "jsonschema" };
            *into = writer.add_schema(name, encoding, &description)?;
        }
        Ok(McapWriter { writer: Some(writer), end, channels: BTreeMap::new(), schemas })
    }

    /// Writes a message of this number.
    pub fn message(&mut self, topic: &str, kind: Kind, seq: u64, times: Times, data: &[u8]) -> Result<(), McapError> {
        let writer = open(&mut self.writer)?;
        let key = (topic.to_owned(), kind);
        let channel_id = match self.channels.get(&key) {
            Some(&id) => id,
            None => {
                let schema = self.schemas[kind as usize];
                let encoding = if kind.is_binary() { "protobuf" } else { "json" };
                let id = writer.add_channel(schema, topic, encoding, &BTreeMap::new())?;
                self.channels.insert(key, id);
                id
            }
        };
        let sequence = (seq & u64::from(u32::MAX)) as u32;
        let header = MessageHeader { channel_id, sequence, log_time: times.log_ns, publish_time: times.stamp_ns };
        writer.write_to_known_channel(&header, data)
    }

    /// Writes a file that goes with the recording.
    pub fn attach(&mut self, name: String, media_type: &str, bytes: &[u8], log_ns: u64) -> Result<(), McapError> {
        let media_type = media_type.into();
        let data = bytes.into();
        open(&mut self.writer)?.attach(&Attachment { log_time: log_ns, create_time: log_ns, name, media_type, data })
    }

    /// Writes facts of a kind.
    pub fn metadata(&mut self, name: String, facts: BTreeMap<String, String>) -> Result<(), McapError> {
        open(&mut self.writer)?.write_metadata(&Metadata { name, metadata: facts })
    }

    /// Closes the chunk, so that it is not lost, and writes an end of file, which later chunks overwrite: readers that
    /// look there first, such as PyPI's `mcap`, read nothing from a file without one.
    pub fn flush(&mut self) -> Result<(), McapError> {
        open(&mut self.writer)?.flush()?;
        if let Some(end) = &mut self.end {
            end.write_all(&END)?;
            end.seek_relative(-(END.len() as i64))?;
        }
        Ok(())
    }

    /// Closes the file.
    pub fn finish(mut self) -> Result<(), McapError> {
        let finished = open(&mut self.writer)?.finish();
        self.close();
        finished.map(drop)
    }

    /// Releases the file as it is: the library would finish it.
    fn close(&mut self) {
        drop(self.writer.take().map(Writer::into_inner));
    }
}

impl Drop for McapWriter {
    fn drop(&mut self) {
        if self.writer.is_some() {
            let _ = self.flush(); // whoever drops it has failed already, and reports why
            self.close();
        }
    }
}

/// The writer of an unfinished recording.
fn open(writer: &mut Option<Writer<BufWriter<File>>>) -> Result<&mut Writer<BufWriter<File>>, McapError> {
    writer.as_mut().ok_or_else(|| McapError::Io(std::io::Error::other("it is finished")))
}
