//! Every frame of a closed loop, kept and given back.
//!
//! ```text
//!   run/frames.jsonl      a line per turn: what each finger's source gave
//!   run/left/000012.jpg   the frames, as they were received
//! ```

use anyhow::{Context, anyhow, bail};
use serde::{Deserialize, Serialize};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// What a finger's source gave in a turn.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "next")]
pub enum Given {
    /// A frame, kept in the finger's folder.
    Frame {
        /// Its number.
        seq: u64,
        /// Its time, ns.
        time_ns: Option<u64>,
        /// Its file.
        file: String,
    },
    /// A torn frame.
    Torn {
        /// Its number.
        seq: u64,
        /// Its time, ns.
        time_ns: Option<u64>,
    },
    /// Nothing.
    Silent,
}

/// A line of `frames.jsonl`: a turn.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Line {
    /// What every finger gave.
    fingers: Vec<Given>,
    /// Whether gripper or wrist could not be asked, so that nothing was commanded.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    waiting: bool,
}

/// Keeps frames.
#[derive(Debug)]
pub struct FrameRecorder {
    folder: PathBuf,
    lines: File,
    line: Line,
}

impl FrameRecorder {
    /// Into the folder of a run.
    pub fn create(folder: &Path) -> anyhow::Result<Self> {
        let lines = folder.join("frames.jsonl");
        let lines = File::create(&lines).with_context(|| format!("{}: cannot write", lines.display()))?;
        Ok(FrameRecorder { folder: folder.to_owned(), lines, line: Line::default() })
    }

    /// Keeps what a finger gave.
    pub fn keep(&mut self, finger: &str, next: &Next, frame: &FrameBuffer) -> anyhow::Result<()> {
        let (seq, time_ns) = (frame.seq, frame.time_ns);
        self.line.fingers.push(match next {
            Next::Frame => {
                if frame.encoded.is_empty() {
                    bail!("{finger}: frame {seq} came without its encoded form, which is what is recorded");
                }
                let folder = self.folder.join(finger);
                fs::create_dir_all(&folder).with_context(|| format!("{}: cannot make", folder.display()))?;
                let file = format!("{finger}/{seq:06}.jpg");
                let path = self.folder.join(&file);
                fs::write(&path, &frame.encoded).with_context(|| format!("{}: cannot write", path.display()))?;
                Given::Frame { seq, time_ns, file }
            }
            Next::Torn { .. } => Given::Torn { seq, time_ns },
            Next::Silent | Next::End => Given::Silent,
        });
        Ok(())
    }

    /// All fingers of a turn have been asked; `waiting`: nothing will be commanded.
    pub fn turn(&mut self, waiting: bool) -> anyhow::Result<()> {
        self.line.waiting = waiting;
        let line = serde_json::to_string(&self.line).context("frames.jsonl")?;
        self.line.fingers.clear();
        writeln!(self.lines, "{line}").context("frames.jsonl: cannot write")
    }
}

/// A finger's recorded frames as a source.
pub struct Recorded {
    folder: PathBuf,
    turns: VecDeque<Given>,
}

/// A recorded run.
pub struct Recording {
    /// The sources of all fingers.
    pub sources: Vec<Recorded>,
    /// Turn by turn, whether nothing was commanded because gripper or wrist could not be asked.
    pub waiting: VecDeque<bool>,
}

/// Reads the frames of a run.
pub fn recorded(folder: &Path, fingers_count: usize) -> anyhow::Result<Recording> {
    let path = folder.join("frames.jsonl");
    let file = File::open(&path)
        .map_err(|e| anyhow!("{}: {e}; expected a run that was made with --record", path.display()))?;
    let source = |_| Recorded { folder: folder.to_owned(), turns: VecDeque::new() };
    let mut recording = Recording { sources: (0..fingers_count).map(source).collect(), waiting: VecDeque::new() };
    for (n, line) in BufReader::new(file).lines().enumerate() {
        let line = line.with_context(|| path.display().to_string())?;
        let line: Line = serde_json::from_str(&line).with_context(|| format!("{} line {}", path.display(), n + 1))?;
        let count = line.fingers.len();
        if count != fingers_count {
            bail!("{} line {}: expected {fingers_count} fingers, got {count}", path.display(), n + 1);
        }
        recording.waiting.push_back(line.waiting);
        recording.sources.iter_mut().zip(line.fingers).for_each(|(source, given)| source.turns.push_back(given));
    }
    Ok(recording)
}

impl FrameSource for Recorded {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(match self.turns.pop_front() {
            None => Next::End,
            Some(Given::Silent) => Next::Silent,
            Some(Given::Torn { seq, time_ns }) => {
                (into.seq, into.time_ns) = (seq, time_ns);
                Next::Torn { reason: "it was torn".into() }
            }
            Some(Given::Frame { seq, time_ns, file }) => {
                let path = self.folder.join(&file);
                into.encoded = fs::read(&path).map_err(|e| anyhow!("{}: {e}", path.display()))?;
                slipbound_rig::source::decode_image(into).map_err(|e| anyhow!("{}: {e}", path.display()))?;
                (into.seq, into.time_ns) = (seq, time_ns);
                Next::Frame
            }
        })
    }
}
