//! Frames out of an MCAP file: of our own recordings, of Foxglove's, of ROS 2.

use super::frame_record::{Fate, FrameRecord, camera_topic, frame_topic};
use super::pictures;
use crate::source::Error;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest record that is read, bytes; a damaged length asks for more.
const LONGEST_RECORD_BYTES: usize = 256 << 20;
/// Most that is read from the disk at a time, bytes.
const PIECE_BYTES: usize = 1 << 20;

/// The frames of one topic. Of a recording of ours only those that were judged, where somebody judged; its numbers and times
/// are those that the frames had.
pub struct McapSource {
    path: PathBuf,
    records: Records,
    topic: String,
    schemas: HashMap<u16, String>,
    /// Schema and encoding of every channel of the topic.
    channels: HashMap<u16, (String, String)>,
    /// What is known of every frame of a recording of ours, in its order; None for others' files.
    known: Option<Known>,
    /// The number after that of the last frame.
    seq: u64,
    is_over: bool,
}

/// What a recording of ours says of its frames.
struct Known {
    frames: HashMap<u64, FrameRecord>,
    judges: bool,
    /// Torn frames without bytes, to be told where they were.
    bare: Vec<FrameRecord>,
}

impl McapSource {
    /// Opens `FILE.mcap` or `FILE.mcap#TOPIC`. Fails when it holds no pictures, or those of several topics and none is named.
    pub fn open(path: &Path, wanted: Option<&str>) -> Result<Self, Error> {
        let wrong = |why: String| Error::Mcap { path: path.to_owned(), why };
        let survey = Survey::of(path)?;
        let mut topics = survey.topics;
        if let Some(wanted) = wanted {
            topics.retain(|name| name == wanted || *name == camera_topic(wanted));
        }
        let names: Vec<String> = topics.iter().cloned().collect();
        let topic = match (names.len(), survey.broken) {
            (1, _) => topics.into_iter().next(),
            (0, Some(why)) => return Err(wrong(format!("expected topics with pictures, got none before {why}"))),
            _ => None,
        };
        let Some(topic) = topic else {
            let expected = pictures::SCHEMAS.join(", ");
            return Err(wrong(match names.as_slice() {
                [] => format!(
                    "expected a topic{} with {expected}, got none",
                    wanted.map_or(String::new(), |w| format!(" {w}"))
                ),
                several => format!("expected FILE.mcap#TOPIC with one of {}", several.join(", ")),
            }));
        };
        let frames = frame_topic(&topic).and_then(|name| survey.frames.get(&name).cloned());
        let known = frames.map(|records| {
            let judges = records.iter().any(|record| record.fate != Fate::Recorded);
            let bare = records.iter().filter(|r| r.torn.is_some() && !r.is_kept && r.fate != Fate::Skipped);
            let mut bare: Vec<FrameRecord> = bare.cloned().collect();
            bare.sort_by_key(|record| std::cmp::Reverse(record.seq));
            Known { judges, bare, frames: records.into_iter().map(|record| (record.seq, record)).collect() }
        });
        Ok(McapSource {
            path: path.to_owned(),
            records: Records::open(path)?,
            topic,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            known,
            seq: 0,
            is_over: false,
        })
    }

    /// The frame's number, time and whether it is to be given, from what is known of it.
    fn stamp(&mut self, sequence: u32, log_ns: u64, stamp_ns: Option<u64>, into: &mut FrameBuffer) -> bool {
        into.label.clear();
        let Some(known) = &self.known else {
            (into.seq, into.time_ns, into.clock) = (self.seq, stamp_ns.or(Some(log_ns)), Clock::Container);
            self.seq += 1;
            return true;
        };
        // Numbers beyond 32 bits have lost their upper half: they never come in one recording.
        let Some(record) = known.frames.get(&u64::from(sequence)) else { return !known.judges };
        (into.seq, into.time_ns, into.clock) = (record.seq, record.time_ns, record.clock);
        self.seq = into.seq + 1;
        record.fate != Fate::Skipped
    }

    /// A torn frame without bytes that comes before the frame with this number.
    fn bare_before(&mut self, seq: u64, into: &mut FrameBuffer) -> Option<Next> {
        let known = self.known.as_mut()?;
        let record = known.bare.pop_if(|record| record.seq < seq)?;
        (into.seq, into.time_ns, into.clock) = (record.seq, record.time_ns, record.clock);
        into.encoded.clear();
        Some(Next::Torn { reason: record.torn.unwrap_or_default() })
    }
}

impl FrameSource for McapSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        loop {
            if self.is_over {
                return Ok(self.bare_before(u64::MAX, into).unwrap_or(Next::End));
            }
            // A torn frame without bytes stands before the next picture.
            let next_seq = self.records.peeked.as_ref().map(|(header, _)| u64::from(header.sequence));
            if let Some(next) = next_seq.and_then(|seq| self.bare_before(seq, into)) {
                return Ok(next);
            }
            if let Some((header, message)) = self.records.peeked.take() {
                let (schema, encoding) = self.channels.get(&header.channel_id).cloned().unwrap_or_default();
                let read = pictures::read(&schema, &encoding, &message, into);
                let stamp_ns = read.as_ref().ok().copied().flatten();
                if !self.stamp(header.sequence, header.log_time, stamp_ns, into) {
                    continue;
                }
                return Ok(match read {
                    Ok(_) => Next::Frame,
                    Err(reason) => Next::Torn { reason },
                });
            }
            let Some(record) = self.records.next() else {
                self.is_over = true;
                if let Some(reason) = self.records.broken.take() {
                    into.encoded.clear();
                    into.label.clear();
                    (into.seq, into.time_ns) = (self.seq, None);
                    return Ok(Next::Torn { reason: format!("{}: {reason}", self.path.display()) });
                }
                continue;
            };
            match record {
                Record::Schema { header, .. } => drop(self.schemas.insert(header.id, header.name)),
                Record::Channel(channel) if channel.topic == self.topic => {
                    let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    if pictures::SCHEMAS.contains(&schema.as_str()) {
                        self.channels.insert(channel.id, (schema, channel.message_encoding));
                    }
                }
                Record::Message { header, data } if self.channels.contains_key(&header.channel_id) => {
                    self.records.peeked = Some((header, data.into_owned()));
                }
                _ => {}
            }
        }
    }
}

/// What a file holds.
struct Survey {
    topics: BTreeSet<String>,
    frames: HashMap<String, Vec<FrameRecord>>,
    broken: Option<String>,
}

impl Survey {
    fn of(path: &Path) -> Result<Self, Error> {
        let mut records = Records::open(path)?;
        let (mut schemas, mut channels) = (HashMap::new(), HashMap::new());
        let mut survey = Survey { topics: BTreeSet::new(), frames: HashMap::new(), broken: None };
        while let Some(record) = records.next() {
            match record {
                Record::Schema { header, .. } => drop(schemas.insert(header.id, header.name)),
                Record::Channel(channel) => {
                    let schema = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    let name = channel.topic;
                    if pictures::SCHEMAS.contains(&schema.as_str()) {
                        survey.topics.insert(name);
                    } else if schema == "slipbound.Frame" {
                        channels.insert(channel.id, name);
                    }
                }
                Record::Message { header, data } => {
                    if let Some(topic) = channels.get(&header.channel_id)
                        && let Ok(record) = serde_json::from_slice(&data)
                    {
                        survey.frames.entry(topic.clone()).or_default().push(record);
                    }
                }
                _ => {}
            }
        }
        survey.broken = records.broken;
        Ok(survey)
    }
}

/// The records of a file up to its end, or to where it cannot be followed.
struct Records {
    file: File,
    reader: LinearReader,
    broken: Option<String>,
    is_over: bool,
    /// A picture that was read and not yet given.
    peeked: Option<(mcap::records::MessageHeader, Vec<u8>)>,
}

impl Records {
    fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        let options = LinearReaderOptions::default().with_record_length_limit(LONGEST_RECORD_BYTES);
        let reader = LinearReader::new_with_options(options);
        Ok(Records { file, reader, broken: None, is_over: false, peeked: None })
    }

    fn next(&mut self) -> Option<Record<'static>> {
        if self.is_over {
            return None;
        }
        let why = loop {
            match self.reader.next_event() {
                None => break None,
                Some(Err(e)) => break Some(e.to_string()),
                Some(Ok(LinearReadEvent::Record { data, opcode })) => match mcap::parse_record(opcode, data) {
                    Ok(record) => return Some(record.into_owned()),
                    Err(e) => break Some(e.to_string()),
                },
                Some(Ok(LinearReadEvent::ReadRequest(hint))) => {
                    let count = hint.clamp(4096, PIECE_BYTES);
                    let read = self.file.read(self.reader.insert(count));
                    match read {
                        Ok(count) => self.reader.notify_read(count),
                        Err(e) => break Some(e.to_string()),
                    }
                }
            }
        };
        self.is_over = true;
        self.broken = why.map(|why| format!("the recording is cut off or damaged ({why}); what came before was read"));
        None
    }
}
