//! Every frame of a closed loop, kept and given back.
//!
//! ```text
//!   run/frames.jsonl      a line per turn: what each finger's source gave
//!   run/left/000012.jpg   the frames, as they were received
//! ```

use anyhow::{Context, anyhow, bail};
use serde::{Deserialize, Serialize};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

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

/// Keeps frames.
#[derive(Debug)]
pub struct FrameRecorder {
    folder: PathBuf,
    lines: File,
    turn: Vec<Given>,
}

impl FrameRecorder {
    /// Into the folder of a run.
    pub fn create(folder: &Path) -> anyhow::Result<Self> {
        let lines = folder.join("frames.jsonl");
        let lines = File::create(&lines).with_context(|| format!("{}: cannot write", lines.display()))?;
        Ok(FrameRecorder { folder: folder.to_owned(), lines, turn: Vec::new() })
    }

    /// Keeps what a finger gave.
    pub fn keep(&mut self, finger: &str, next: &Next, frame: &FrameBuffer) -> anyhow::Result<()> {
        let (seq, time_ns) = (frame.seq, frame.time_ns);
        self.turn.push(match next {
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

    /// All fingers of a turn have been asked.
    pub fn turn(&mut self) -> anyhow::Result<()> {
        let line = serde_json::to_string(&self.turn).context("frames.jsonl")?;
        self.turn.clear();
        writeln!(self.lines, "{line}").context("frames.jsonl: cannot write")
    }
}

/// A finger's recorded frames as a source.
pub struct Recorded {
    folder: PathBuf,
    finger: usize,
    turns: Rc<RefCell<Vec<VecDeque<Given>>>>,
}

/// The sources of all fingers of a recorded run.
pub fn recorded(folder: &Path, fingers_count: usize) -> anyhow::Result<Vec<Recorded>> {
    let path = folder.join("frames.jsonl");
    let file = File::open(&path)
        .map_err(|e| anyhow!("{}: {e}; expected a run that was made with --record", path.display()))?;
    let mut turns: Vec<VecDeque<Given>> = (0..fingers_count).map(|_| VecDeque::new()).collect();
    for (n, line) in BufReader::new(file).lines().enumerate() {
        let line = line.with_context(|| path.display().to_string())?;
        let given: Vec<Given> =
            serde_json::from_str(&line).with_context(|| format!("{} line {}", path.display(), n + 1))?;
        if given.len() != fingers_count {
            bail!("{} line {}: expected {fingers_count} fingers, got {}", path.display(), n + 1, given.len());
        }
        turns.iter_mut().zip(given).for_each(|(turns, given)| turns.push_back(given));
    }
    let turns = Rc::new(RefCell::new(turns));
    Ok((0..fingers_count).map(|finger| Recorded { folder: folder.to_owned(), finger, turns: turns.clone() }).collect())
}

impl FrameSource for Recorded {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(match self.turns.borrow_mut()[self.finger].pop_front() {
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
