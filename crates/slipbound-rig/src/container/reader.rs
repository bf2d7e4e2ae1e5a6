//! Frames out of an MCAP file: of our own recordings, of Foxglove's, of ROS 2.

use super::frame_record::{Fate, FrameRecord, camera_topic, frame_topic};
use super::pictures;
use super::records::Records;
use crate::source::Error;
use mcap::records::{MessageHeader, Record};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// The frames of one topic. From a recording of ours only the judged ones, if any were judged; they keep their numbers
/// and times.
pub struct McapSource {
    path: PathBuf,
    records: Records,
    /// An image that was read and not yet returned.
    peeked: Option<(MessageHeader, Vec<u8>)>,
    topic: String,
    schemas: HashMap<u16, String>,
    /// Schema and encoding of every channel of the topic.
    channels: HashMap<u16, (String, String)>,
    /// The records of every frame of a recording of ours, in order; None for other files.
    known: Option<Known>,
    /// The number after that of the last frame.
    seq: u64,
    is_over: bool,
}

/// What a recording of ours states about its frames.
struct Known {
    frames: HashMap<u64, FrameRecord>,
    judges: bool,
    /// Torn frames without bytes, to be reported at their place.
    bare: Vec<FrameRecord>,
}

impl McapSource {
    /// Opens `FILE.mcap` or `FILE.mcap#TOPIC`. Fails when it holds no images, or those of several topics if none is
    /// named.
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
            (0, Some(why)) => return Err(wrong(format!("expected topics with images, got none before {why}"))),
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
            // Torn, or its bytes were lost on the way to the disk.
            let bare = records.iter().filter(|r| !r.is_kept && r.fate != Fate::Skipped);
            let mut bare: Vec<FrameRecord> = bare.cloned().collect();
            bare.sort_by_key(|record| std::cmp::Reverse(record.seq));
            Known { judges, bare, frames: records.into_iter().map(|record| (record.seq, record)).collect() }
        });
        Ok(McapSource {
            path: path.to_owned(),
            records: Records::open(path)?,
            peeked: None,
            topic,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            known,
            seq: 0,
            is_over: false,
        })
    }

    /// Sets the frame's number and time; returns whether the frame is to be returned.
    fn stamp(&mut self, sequence: u32, log_ns: u64, stamp_ns: Option<u64>, into: &mut FrameBuffer) -> bool {
        into.label.clear();
        let Some(known) = &self.known else {
            (into.seq, into.time_ns, into.clock) = (self.seq, stamp_ns.or(Some(log_ns)), Clock::Container);
            self.seq += 1;
            return true;
        };
        // Numbers beyond 32 bits have lost their upper half: one recording never has them.
        let Some(record) = known.frames.get(&u64::from(sequence)) else {
            // The program was killed between the two messages: whether the frame was judged is not known.
            (into.seq, into.time_ns, into.clock) = (sequence.into(), stamp_ns.or(Some(log_ns)), Clock::Container);
            self.seq = into.seq + 1;
            return !known.judges;
        };
        (into.seq, into.time_ns, into.clock) = (record.seq, record.time_ns, record.clock);
        self.seq = into.seq + 1;
        record.fate != Fate::Skipped
    }

    /// The result for a file that cannot be followed, or whose bytes are not those that were written.
    fn damaged(&self, reason: &str, into: &mut FrameBuffer) -> Next {
        into.encoded.clear();
        into.label.clear();
        (into.seq, into.time_ns) = (self.seq, None);
        Next::Torn { reason: format!("{}: {reason}", self.path.display()) }
    }

    /// A torn frame without bytes that comes before the frame with this number.
    fn bare_before(&mut self, seq: u64, into: &mut FrameBuffer) -> Option<Next> {
        let known = self.known.as_mut()?;
        let record = known.bare.pop_if(|record| record.seq < seq)?;
        (into.seq, into.time_ns, into.clock) = (record.seq, record.time_ns, record.clock);
        into.encoded.clear();
        let lost = || "its bytes were not recorded: the disk did not keep up".to_owned();
        Some(Next::Torn { reason: record.torn.unwrap_or_else(lost) })
    }
}

/// Ending of the name of a finger's sensor file in a recording.
const SENSOR: &str = ".sensor.toml";

/// The sensor file in a recording of ours: its name and text. `wanted`: the topic or finger, where the recording has
/// several. None where there is none, or the choice is ambiguous.
pub fn attached_sensor(path: &Path, wanted: Option<&str>) -> Result<Option<(String, String)>, Error> {
    let finger = wanted.map(|topic| topic.strip_prefix('/').and_then(|t| t.strip_suffix("/camera")).unwrap_or(topic));
    let name = finger.map(|finger| format!("{finger}{SENSOR}"));
    let (mut records, mut found) = (Records::open(path)?, Vec::new());
    while let Some(record) = records.next_record() {
        let Record::Attachment { header, data, .. } = record else { continue };
        if name.as_ref().map_or(header.name.ends_with(SENSOR), |name| *name == header.name) {
            found.push((header.name, String::from_utf8_lossy(&data).into_owned()));
        }
        if name.is_some() && !found.is_empty() {
            break;
        }
    }
    Ok(found.pop().filter(|_| found.is_empty()))
}

impl FrameSource for McapSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        loop {
            if let Some(reason) = self.records.damaged.take() {
                return Ok(self.damaged(&reason, into));
            }
            if self.is_over {
                return Ok(self.bare_before(u64::MAX, into).unwrap_or(Next::End));
            }
            // A torn frame without bytes comes before the next image.
            let next_seq = self.peeked.as_ref().map(|(header, _)| u64::from(header.sequence));
            if let Some(next) = next_seq.and_then(|seq| self.bare_before(seq, into)) {
                return Ok(next);
            }
            if let Some((header, message)) = self.peeked.take() {
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
            let Some(record) = self.records.next_record() else {
                self.is_over = true;
                if let Some(reason) = self.records.broken.take() {
                    return Ok(self.damaged(&reason, into));
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
                    self.peeked = Some((header, data.into_owned()));
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
        while let Some(record) = records.next_record() {
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
