//! Stores every frame of a closed loop and reads it back.
//!
//! ```text
//!   run/frames.jsonl      a line per cycle: what each finger's source gave
//!   run/left/000012.jpg   the frames, as they were received; the content says whether it is a JPEG or a PNG
//! ```

use super::error::Error;
use super::folder::{Lines, refuse_finger_name, write_whole};
use crate::source::decode_image;
use serde::{Deserialize, Serialize};
use slipbound::control::{CycleOutcome, CycleView, Fault, FaultKind};
use slipbound::finger_pipeline::FingerView;
use slipbound::port::{FrameBuffer, FrameSource, GripperErrorKind, Next, SourceError, SourceErrorKind};
use std::collections::VecDeque;
use std::fmt::Display;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What a finger's source gave in a cycle.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "next")]
enum Received {
    /// A frame, kept in the finger's folder.
    Frame {
        seq: u64,
        time_ns: Option<u64>,
        /// Its file.
        file: String,
    },
    /// A torn frame.
    Torn { seq: u64, time_ns: Option<u64> },
    /// Nothing.
    Silent,
}

/// A line of `frames.jsonl`: a cycle.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Line {
    /// What every finger received.
    fingers: Vec<Received>,
    /// Whether gripper or wrist could not be polled, so that nothing was commanded.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    waiting: bool,
    /// Whether that was because the link to the gripper was lost: its jaws may have been opened meanwhile.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    link_lost: bool,
}

/// Keeps frames.
#[derive(Debug)]
pub struct FrameRecorder {
    folder: PathBuf,
    lines: Lines,
}

impl FrameRecorder {
    /// Into the folder of a run.
    pub fn create(folder: &Path) -> Result<Self, Error> {
        Ok(FrameRecorder { folder: folder.to_owned(), lines: Lines::create(folder.join("frames.jsonl"))? })
    }

    /// Keeps what every finger received in a cycle. A cycle in which a source ended does not count.
    pub fn keep(&mut self, view: &CycleView<'_>) -> Result<(), Error> {
        let Some(line) = line(view) else { return Ok(()) };
        for finger in view.fingers.iter().filter(|finger| *finger.next == Next::Frame) {
            refuse_finger_name(&self.folder, finger.name)?;
            let FrameBuffer { seq, encoded, .. } = finger.frame;
            let path = self.folder.join(frame_file(finger.name, *seq));
            if encoded.is_empty() {
                let why = format!("frame {seq} came without its encoded form, which is what is recorded");
                return Err(Error::Encode { path, why });
            }
            let folder = self.folder.join(finger.name);
            fs::create_dir_all(&folder).map_err(|source| Error::Write { path: folder, source })?;
            write_whole(&path, encoded)?;
        }
        let why = |e: serde_json::Error| Error::Encode { path: self.folder.join("frames.jsonl"), why: e.to_string() };
        let line = line.map_err(why)?;
        self.lines.push(&line)
    }
}

/// The file of a frame in the folder of a run.
pub(crate) fn frame_file(finger: &str, seq: u64) -> String {
    format!("{finger}/{seq:06}.jpg")
}

/// The line of a cycle in `frames.jsonl`; None for one in which a source ended.
pub(crate) fn line(view: &CycleView<'_>) -> Option<serde_json::Result<String>> {
    if view.outcome == Some(&CycleOutcome::SourceEnded) || view.fingers.iter().any(|f| *f.next == Next::End) {
        return None;
    }
    let waiting = view.outcome.is_none_or(|outcome| *outcome == CycleOutcome::Waiting);
    let is_lost = |fault: &Fault| fault.kind == FaultKind::Gripper(GripperErrorKind::Link);
    let link_lost = waiting && view.fault.is_some_and(is_lost);
    let line = Line { fingers: view.fingers.iter().map(received).collect(), waiting, link_lost };
    Some(serde_json::to_string(&line))
}

fn received(finger: &FingerView<'_>) -> Received {
    let FrameBuffer { seq, time_ns, .. } = *finger.frame;
    match finger.next {
        Next::Frame => Received::Frame { seq, time_ns, file: frame_file(finger.name, seq) },
        Next::Torn { .. } => Received::Torn { seq, time_ns },
        Next::Silent | Next::End => Received::Silent,
    }
}

/// A frame listed in a line of `frames.jsonl`.
pub(crate) struct ListedFrame {
    pub seq: u64,
    pub time_ns: Option<u64>,
    /// Its file; None for one that is torn.
    pub file: Option<String>,
}

/// The frame of every finger in a line of `frames.jsonl`; None for a finger that was silent.
pub(crate) fn listed(line: &str) -> serde_json::Result<Vec<Option<ListedFrame>>> {
    let line: Line = serde_json::from_str(line)?;
    let listed = |received| match received {
        Received::Frame { seq, time_ns, file } => Some(ListedFrame { seq, time_ns, file: Some(file) }),
        Received::Torn { seq, time_ns } => Some(ListedFrame { seq, time_ns, file: None }),
        Received::Silent => None,
    };
    Ok(line.fingers.into_iter().map(listed).collect())
}

/// A finger's recorded frames as a source.
#[derive(Debug)]
pub struct RecordedSource {
    folder: PathBuf,
    cycles: VecDeque<Received>,
}

/// Why nothing was commanded in a cycle: gripper or wrist could not be polled.
pub(super) type Waiting = Option<GripperErrorKind>;

/// The frames of every finger of a run, and for each cycle why nothing was commanded, if so.
pub(super) fn read(folder: &Path, fingers_count: usize) -> Result<(Vec<RecordedSource>, VecDeque<Waiting>), Error> {
    let path = folder.join("frames.jsonl");
    let text = fs::read_to_string(&path).map_err(|e| match e.kind() {
        ErrorKind::NotFound => {
            Error::Syntax { path: path.clone(), problem: format!("{e}; expected a run that was made with --record") }
        }
        _ => Error::Read { path: path.clone(), source: e },
    })?;
    let source = |_| RecordedSource { folder: folder.to_owned(), cycles: VecDeque::new() };
    let mut sources: Vec<RecordedSource> = (0..fingers_count).map(source).collect();
    let mut waiting = VecDeque::new();
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    for (n, line) in whole.lines().enumerate() {
        let wrong = |problem| Error::Syntax { path: path.clone(), problem: format!("line {}: {problem}", n + 1) };
        let line: Line = serde_json::from_str(line).map_err(|e| wrong(e.to_string()))?;
        let count = line.fingers.len();
        if count != fingers_count {
            return Err(wrong(format!("expected {fingers_count} fingers, got {count}")));
        }
        let why = if line.link_lost { GripperErrorKind::Link } else { GripperErrorKind::Other };
        waiting.push_back(line.waiting.then_some(why));
        sources.iter_mut().zip(line.fingers).for_each(|(source, received)| source.cycles.push_back(received));
    }
    Ok((sources, waiting))
}

impl FrameSource for RecordedSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(match self.cycles.pop_front() {
            None => Next::End,
            Some(Received::Silent) => Next::Silent,
            Some(Received::Torn { seq, time_ns }) => {
                (into.seq, into.time_ns) = (seq, time_ns);
                Next::Torn { reason: "it was torn".into() }
            }
            Some(Received::Frame { seq, time_ns, file }) => {
                let path = self.folder.join(&file);
                let failed = |kind, why: &dyn Display| {
                    SourceError::new(kind, format!("{}: {why}", path.display())).of_file(path.display())
                };
                into.encoded = fs::read(&path).map_err(|e| failed(SourceErrorKind::Unreadable, &e))?;
                decode_image(into).map_err(|e| failed(SourceErrorKind::Format, &e))?;
                (into.seq, into.time_ns) = (seq, time_ns);
                Next::Frame
            }
        })
    }
}
