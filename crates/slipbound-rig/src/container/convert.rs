//! A run folder as a recording and back: the same lines, frames and files under the same names.
//!
//! ```text
//!   reports.jsonl  events.jsonl  frames.jsonl     /cycle  /event  /cycle/frames     a line a message, byte for byte
//!   left/000012.jpg  left.frames.jsonl            /left/camera  /left/frame         every frame as it came
//!   left.report.jsonl                             /left/report
//!   NAME.metadata.json                            metadata NAME
//!   every other file                              attachment of that name
//! ```
//!
//! A folder has no annotations: they follow from frames and reports. Frames that came as pixels are left out too,
//! because a folder holds encoded ones; they are counted.

use super::foxglove;
use super::frame_record::{Fate, FrameRecord, camera_topic};
use super::mcap_writer::{Kind, McapWriter, Times};
use super::recorder;
use super::records::{LONGEST_RECORD_BYTES, Records};
use crate::config::{read_most, read_most_bytes};
use crate::replaced_file::ReplacedFile;
use crate::run::frames::{ListedFrame, frame_file, listed};
use crate::run::{self, Error};
use mcap::records::Record;
use slipbound::port::{Clock, FrameBuffer};
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Files of JSON lines, and the topics of their lines.
const LINES: [(&str, &str); 3] =
    [("frames.jsonl", "/cycle/frames"), ("reports.jsonl", "/cycle"), ("events.jsonl", "/event")];
/// Endings of the files with a finger's frame records, its reports, and facts.
const RECORDS: &str = ".frames.jsonl";
const REPORT: &str = ".report.jsonl";
const FACTS: &str = ".metadata.json";
/// Media type of settings.
const TOML: &str = "text/toml";

/// Largest file that is attached, bytes: with its name, the record is one that can be read again.
const MOST_ATTACHMENT_BYTES: u64 = LONGEST_RECORD_BYTES - (1 << 16);

/// What was converted, and what was not.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Converted {
    /// Frames.
    pub frames_count: u64,
    /// Lines of reports, cycles, events.
    pub lines_count: u64,
    /// Other files.
    pub files_count: u64,
    /// What the other form cannot hold, in words.
    pub left_out: Vec<String>,
}

/// Why something could not be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The folder cannot be read or written.
    #[error(transparent)]
    Folder(#[from] Error),
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] recorder::Error),
    /// The recording cannot be read.
    #[error(transparent)]
    Source(#[from] crate::source::Error),
    /// A recording that names a file outside the folder.
    #[error("{}: expected names of files in one folder, got `{name}`", path.display())]
    Name {
        /// The recording.
        path: PathBuf,
        /// The name.
        name: String,
    },
}

/// Writes the run in `folder` into a recording, which is replaced once it is complete: on failure the old one stays.
pub fn to_mcap(folder: &Path, file: &Path) -> Result<Converted, ConvertError> {
    let names = names_of(folder)?;
    // Settings files beyond a size limit are refused: nothing could read them later.
    let mut settings = HashMap::new();
    for name in names.iter().filter(|name| media_type(name) == TOML) {
        let path = folder.join(name);
        settings.insert(name.clone(), read_most_bytes(&path).map_err(|source| Error::Read { path, source })?);
    }
    let create = |source| recorder::Error::Create { path: file.to_owned(), source };
    let mut replaced = ReplacedFile::create(file).map_err(create)?;
    let wrong = |e| recorder::Error::of_writing(file, e);
    let mut run = RunToMcap {
        folder,
        file,
        names,
        fingers: Vec::new(),
        writer: McapWriter::create(replaced.file().try_clone().map_err(create)?).map_err(wrong)?,
        converted: Converted::default(),
        missing: Vec::new(),
    };
    let lines = run.write_files(settings)?;
    run.fingers = run_fingers(folder).unwrap_or_default();
    for line in &lines {
        run.write_line(line)?;
    }
    let RunToMcap { writer, mut converted, missing, .. } = run;
    if let Some(first) = missing.first() {
        let count = missing.len();
        converted
            .left_out
            .push(format!("{count} frames without a file, the first {first} (lost, or it came as pixels)"));
    }
    writer.finish().map_err(wrong)?;
    replaced.keep().map_err(|e| wrong(e.into()))?;
    Ok(converted)
}

/// Names of the files in a run folder, sorted.
fn names_of(folder: &Path) -> Result<Vec<String>, ConvertError> {
    let mut names = Vec::new();
    let listing = |source| Error::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(listing)? {
        let entry = entry.map_err(listing)?;
        if entry.file_type().map_err(listing)?.is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    if !names.iter().any(|name| name == "run.toml" || name.ends_with(RECORDS)) {
        let problem = "expected a run folder with run.toml or NAME.frames.jsonl, got neither".into();
        return Err(Error::Syntax { path: folder.to_owned(), problem }.into());
    }
    Ok(names)
}

/// A run folder that is written into a recording.
struct RunToMcap<'a> {
    folder: &'a Path,
    file: &'a Path,
    /// Names of the files in the folder.
    names: Vec<String>,
    /// Names of the fingers in `run.toml`.
    fingers: Vec<String>,
    writer: McapWriter,
    converted: Converted,
    /// Frames whose file is not there.
    missing: Vec<String>,
}

impl RunToMcap<'_> {
    fn wrong(&self, error: mcap::McapError) -> recorder::Error {
        recorder::Error::of_writing(self.file, error)
    }

    /// Writes attachments and metadata; returns the lines of all other files in the order of their times. `settings`: the
    /// files that are read already.
    fn write_files(&mut self, mut settings: HashMap<String, Vec<u8>>) -> Result<Vec<Dated>, ConvertError> {
        let read = |path: &Path| fs::read(path).map_err(|source| Error::Read { path: path.to_owned(), source });
        let mut lines = Vec::new();
        for name in &self.names {
            let path = self.folder.join(name);
            let length = fs::metadata(&path).map_or(0, |facts| facts.len());
            if topic_of_lines(name).is_none() && length > MOST_ATTACHMENT_BYTES {
                let left_out =
                    format!("{name}, which has {length} bytes: an attachment has at most {MOST_ATTACHMENT_BYTES}");
                self.converted.left_out.push(left_out);
                continue;
            }
            let bytes = settings.remove(name).map_or_else(|| read(&path), Ok)?;
            if let Some(topic) = topic_of_lines(name) {
                lines.extend(dated(name, &topic, &bytes));
            } else if let Some(name) = name.strip_suffix(FACTS) {
                let facts = serde_json::from_slice(&bytes)
                    .map_err(|e| Error::Syntax { path: path.clone(), problem: e.to_string() })?;
                let written = self.writer.metadata(name.into(), facts);
                written.map_err(|e| self.wrong(e))?;
            } else {
                let written = self.writer.attach(name.clone(), media_type(name), &bytes, 0);
                written.map_err(|e| self.wrong(e))?;
                self.converted.files_count += 1;
            }
        }
        // Each topic's lines keep their order, whatever their times are.
        lines.sort_by_key(|line| line.time_ns);
        Ok(lines)
    }

    /// Writes a line, after the images of the frames that it names.
    fn write_line(&mut self, line: &Dated) -> Result<(), ConvertError> {
        let Dated { topic, time_ns, json, .. } = line;
        let (times, mut seq) = (Times::both(*time_ns), 0);
        if topic == "/cycle/frames" {
            self.write_frames_of_cycle(line)?;
        } else if let Some(finger) = topic.strip_prefix('/').and_then(|topic| topic.strip_suffix("/frame")) {
            let record: FrameRecord = serde_json::from_slice(json).map_err(|e| self.wrong_line(line, &e))?;
            seq = record.seq;
            match self.write_picture(finger, &record, times)? {
                Picture::Written => self.converted.frames_count += 1,
                // A finger without any file: its frames came as pixels, and were left out of the folder.
                Picture::Missing if self.folder.join(finger).is_dir() => {
                    self.missing.push(frame_file(finger, record.seq));
                }
                Picture::Missing | Picture::NotKept => {}
            }
        }
        let written = self.writer.message(topic, Kind::of_lines(topic), seq, times, json);
        written.map_err(|e| self.wrong(e))?;
        self.converted.lines_count += 1;
        Ok(())
    }

    /// Writes the frames of a line of `frames.jsonl`, except for fingers with a file of their own, which has more detail.
    fn write_frames_of_cycle(&mut self, line: &Dated) -> Result<(), ConvertError> {
        let text = String::from_utf8_lossy(&line.json);
        let frames = listed(&text).map_err(|e| self.wrong_line(line, &e))?;
        for (finger, frame) in self.fingers.clone().iter().zip(frames) {
            let Some(frame) = frame else { continue };
            if self.names.contains(&format!("{finger}{RECORDS}")) {
                continue;
            }
            let record = record_of(&frame);
            let json = serde_json::to_vec(&record).map_err(|e| self.wrong_line(line, &e))?;
            let times = Times::both(record.time_ns.unwrap_or(line.time_ns));
            match self.write_picture(finger, &record, times)? {
                Picture::Missing => self.missing.push(frame_file(finger, record.seq)),
                Picture::Written => self.converted.frames_count += 1,
                Picture::NotKept => {}
            }
            let written = self.writer.message(&format!("/{finger}/frame"), Kind::Frame, record.seq, times, &json);
            written.map_err(|e| self.wrong(e))?;
        }
        Ok(())
    }

    fn wrong_line(&self, line: &Dated, error: &serde_json::Error) -> Error {
        let problem = format!("line {}: {error}", line.number);
        Error::Syntax { path: self.folder.join(&*line.file), problem }
    }

    /// Writes the image of a frame, where it is kept.
    fn write_picture(&mut self, finger: &str, record: &FrameRecord, times: Times) -> Result<Picture, ConvertError> {
        if !record.is_kept {
            return Ok(Picture::NotKept);
        }
        let path = self.folder.join(frame_file(finger, record.seq));
        let encoded = match fs::read(&path) {
            Ok(encoded) => encoded,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Picture::Missing),
            Err(source) => return Err(Error::Read { path, source }.into()),
        };
        let frame = FrameBuffer { encoded, ..FrameBuffer::default() };
        let stamp_ns = record.time_ns.unwrap_or(times.log_ns);
        let (_, bytes) = foxglove::write(&frame, finger, stamp_ns);
        let times = Times { stamp_ns, ..times };
        let written = self.writer.message(&camera_topic(finger), Kind::Compressed, record.seq, times, &bytes);
        written.map_err(|e| self.wrong(e))?;
        Ok(Picture::Written)
    }
}

/// A line and its time, ns.
struct Dated {
    /// Its file, and its number there, from 1.
    file: Rc<str>,
    number: usize,
    topic: String,
    time_ns: u64,
    json: Vec<u8>,
}

/// The complete lines of a file; each is dated by the latest time found in it or before it.
fn dated(file: &str, topic: &str, bytes: &[u8]) -> Vec<Dated> {
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(&[][..], |end| &bytes[..end]);
    let mut latest_ns = 0;
    let mut lines = Vec::new();
    let file: Rc<str> = file.into();
    for (i, json) in whole.split(|byte| *byte == b'\n').enumerate().filter(|_| !whole.is_empty()) {
        let value: serde_json::Value = serde_json::from_slice(json).unwrap_or_default();
        let own_ns = value["time_ns"].as_u64();
        let of_fingers = value["fingers"].as_array().into_iter().flatten().filter_map(|f| f["time_ns"].as_u64()).max();
        latest_ns = own_ns.or(of_fingers).unwrap_or(0).max(latest_ns);
        let (file, number) = (file.clone(), i + 1);
        lines.push(Dated { file, number, topic: topic.into(), time_ns: latest_ns, json: json.to_vec() });
    }
    lines
}

fn topic_of_lines(name: &str) -> Option<String> {
    let of_finger = |end: &str, topic: &str| Some(format!("/{}/{topic}", name.strip_suffix(end)?));
    let known = LINES.iter().find(|(file, _)| *file == name).map(|(_, topic)| (*topic).to_owned());
    known.or_else(|| of_finger(RECORDS, "frame")).or_else(|| of_finger(REPORT, "report"))
}

fn record_of(frame: &ListedFrame) -> FrameRecord {
    let torn = frame.file.is_none().then(|| "it was torn".to_owned());
    let (seq, time_ns, is_kept) = (frame.seq, frame.time_ns, frame.file.is_some());
    // A run folder does not record whose clock it was.
    FrameRecord { seq, time_ns, clock: Clock::Unknown, fate: Fate::Judged, torn, is_kept }
}

/// What became of the image of a frame.
enum Picture {
    Written,
    /// Its bytes were not recorded.
    NotKept,
    /// Its file is not there.
    Missing,
}

/// Names of the fingers in `run.toml`.
fn run_fingers(folder: &Path) -> Option<Vec<String>> {
    let table: toml::Table = read_most(&folder.join("run.toml")).ok()?.parse().ok()?;
    let fingers = table.get("fingers")?.as_array()?;
    fingers.iter().map(|finger| finger.get("name")?.as_str().map(str::to_owned)).collect()
}

fn media_type(name: &str) -> &'static str {
    match Path::new(name).extension().and_then(|e| e.to_str()) {
        Some("toml") => TOML,
        Some("html") => "text/html",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    }
}

/// Writes a recording into a folder that is new or empty.
pub fn to_folder(file: &Path, folder: &Path) -> Result<Converted, ConvertError> {
    let mut records = Records::open(file)?;
    run::prepare_folder(folder)?;
    let mut out = Files { folder, file, open: HashMap::new() };
    let mut converted = Converted::default();
    let (mut schemas, mut channels) = (HashMap::new(), HashMap::new());
    let (mut pixels_count, mut annotations_count) = (0u64, 0u64);
    let mut unknown: BTreeMap<(String, String), u64> = BTreeMap::new();
    while let Some(record) = records.next_record() {
        match record {
            Record::Schema { header, .. } => drop(schemas.insert(header.id, header.name)),
            Record::Channel(channel) => {
                let schema = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                channels.insert(channel.id, (channel.topic, schema));
            }
            Record::Attachment { header, data, .. } => {
                out.whole(&header.name, &data)?;
                converted.files_count += 1;
            }
            Record::Metadata(facts) => {
                let sorted: BTreeMap<_, _> = facts.metadata.into_iter().collect();
                let json = serde_json::to_vec(&sorted).map_err(|e| out.encode(e))?;
                out.whole(&format!("{}{FACTS}", facts.name), &json)?;
            }
            Record::Message { header, data } => {
                let Some((topic, schema)) = channels.get(&header.channel_id) else { continue };
                let finger = |end: &str| topic.strip_prefix('/').and_then(|topic| topic.strip_suffix(end));
                let line_file = LINES.iter().find(|(_, of)| of == topic).map(|(file, _)| (*file).to_owned());
                let line_file = line_file.or_else(|| match schema.as_str() {
                    "slipbound.Frame" => Some(format!("{}{RECORDS}", finger("/frame")?)),
                    "slipbound.Report" => Some(format!("{}{REPORT}", finger("/report")?)),
                    _ => None,
                });
                match (line_file, schema.as_str(), finger("/camera")) {
                    (Some(name), ..) => {
                        out.line(&name, &data)?;
                        converted.lines_count += 1;
                    }
                    (None, foxglove::COMPRESSED, Some(finger)) => {
                        let read = foxglove::read(foxglove::COMPRESSED, &data);
                        let picture = read.ok_or_else(|| out.encode("expected an image, got bytes that are none"))?;
                        out.frame(finger, u64::from(header.sequence), picture.bytes)?;
                        converted.frames_count += 1;
                    }
                    (None, foxglove::RAW, _) => pixels_count += 1,
                    (None, super::annotations::SCHEMA, _) => annotations_count += 1,
                    _ => *unknown.entry((topic.clone(), schema.clone())).or_default() += 1,
                }
            }
            _ => {}
        }
    }
    let told = unknown.iter().map(|((topic, schema), count)| format!("{count} messages {schema} of {topic}"));
    converted.left_out.extend(told);
    if pixels_count > 0 {
        converted.left_out.push(format!("{pixels_count} frames that came as pixels"));
    }
    if annotations_count > 0 {
        converted.left_out.push(format!("{annotations_count} annotations, which follow from the frames"));
    }
    converted.left_out.extend(records.damage());
    Ok(converted)
}

/// Files in a folder; no name leads out of it.
struct Files<'a> {
    folder: &'a Path,
    file: &'a Path,
    open: HashMap<String, File>,
}

impl Files<'_> {
    fn encode(&self, why: impl ToString) -> Error {
        Error::Encode { path: self.file.to_owned(), why: why.to_string() }
    }

    fn place(&self, name: &str) -> Result<PathBuf, ConvertError> {
        let mut parts = Path::new(name).components();
        let is_plain = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
        // A name that another system would read as a path is refused here too.
        match is_plain && !name.contains(['/', '\\', ':']) {
            true => Ok(self.folder.join(name)),
            false => Err(ConvertError::Name { path: self.file.to_owned(), name: name.into() }),
        }
    }

    fn whole(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        let path = self.place(name)?;
        Ok(fs::write(&path, bytes).map_err(|source| Error::Write { path, source })?)
    }

    fn frame(&self, finger: &str, seq: u64, bytes: &[u8]) -> Result<(), ConvertError> {
        let folder = self.place(finger)?;
        fs::create_dir_all(&folder).map_err(|source| Error::Write { path: folder, source })?;
        let path = self.folder.join(frame_file(finger, seq));
        Ok(fs::write(&path, bytes).map_err(|source| Error::Write { path, source })?)
    }

    fn line(&mut self, name: &str, json: &[u8]) -> Result<(), ConvertError> {
        let path = self.place(name)?;
        let failed = |source| Error::Write { path: path.clone(), source };
        if !self.open.contains_key(name) {
            let file = OpenOptions::new().create(true).append(true).open(&path).map_err(failed)?;
            self.open.insert(name.to_owned(), file);
        }
        let line = [json, b"\n"].concat();
        Ok(self.open.get_mut(name).map_or(Ok(()), |file| file.write_all(&line)).map_err(failed)?)
    }
}
