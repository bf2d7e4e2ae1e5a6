//! Writes a recording, on a thread of its own.

use super::book::{Book, Kind, Times};
use super::foxglove;
use super::frame_record::{Fate, FrameRecord, annotations_topic, camera_topic};
use super::late_file::LateFile;
use crate::link::now_ns;
use slipbound::port::FrameBuffer;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// What may wait for the disk: one to two seconds of two fingers.
const QUEUE_COUNT: usize = 128;
/// A chunk is closed after this time, so that no more is lost when the program is killed, ns.
const CHUNK_NS: u64 = 500_000_000;
/// A recording that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be made.
    #[error("{}: cannot write: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It could be made, and not be written to its end; what came before is readable.
    #[error("{}: cannot write on: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Something that the format cannot hold; what came before is readable.
    #[error("{}: cannot write on: {source}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<mcap::McapError>,
    },
    /// The thread that writes has broken down.
    #[error("{}: the thread that writes it has broken down", path.display())]
    Thread {
        /// The file.
        path: PathBuf,
    },
}

impl Error {
    /// A file that cannot be written on: with the operating system's own words, where they are the reason.
    pub(super) fn of_writing(path: &Path, error: mcap::McapError) -> Self {
        let path = path.to_owned();
        match error {
            mcap::McapError::Io(source) => Error::Write { path, source },
            other => Error::Format { path, source: Box::new(other) },
        }
    }
}

/// The result of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Written {
    /// Frames in the file.
    pub frames_count: u64,
    /// Frames and lines that are not in the file because the disk did not keep up.
    pub lost_count: u64,
}

/// What is on its way to the file.
pub(super) enum Item {
    Frame {
        finger: usize,
        frame: Box<FrameBuffer>,
        torn: Option<String>,
        log_ns: u64,
    },
    Taken {
        finger: usize,
        record: FrameRecord,
    },
    Line {
        topic: String,
        log_ns: u64,
        json: Vec<u8>,
    },
    /// What was found on a frame; `stamp_ns` is that of the frame's picture.
    Annotations {
        finger: String,
        seq: u64,
        times: Times,
        bytes: Vec<u8>,
    },
    Attachment {
        name: String,
        media_type: &'static str,
        bytes: Vec<u8>,
    },
    Metadata {
        name: String,
        facts: BTreeMap<String, String>,
    },
    /// What was there may be replaced.
    Begin,
    /// Nothing more comes: all is well.
    End,
    /// Nothing more comes, for something else has failed.
    CutOff,
}

/// Where frames and lines are handed in. Clones write to the same file.
#[derive(Clone)]
pub struct Inlet {
    to: SyncSender<Item>,
    lost: Arc<AtomicU64>,
    begun: Arc<AtomicBool>,
}

impl Inlet {
    /// Hands in what may wait if there is room; what does not fit is lost and counted. False when it was lost.
    pub(super) fn offer(&self, item: Item) -> bool {
        let is_taken = self.to.try_send(item).is_ok();
        if !is_taken {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        is_taken
    }

    /// Whether anything that was handed in was lost.
    pub(super) fn has_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed) > 0
    }

    /// Whether frames of cameras are recorded yet.
    pub(super) fn has_begun(&self) -> bool {
        self.begun.load(Ordering::Acquire)
    }

    /// Hands in what must not be lost: waits for room.
    pub(super) fn send(&self, item: Item) {
        if self.to.send(item).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A recording that is being written. Dropped before [`Recorder::finish`], it keeps what was recorded, and who reads it is told
/// that it is cut off; the file that was there stays if nothing was.
pub struct Recorder {
    path: PathBuf,
    inlet: Inlet,
    /// None once it is finished.
    thread: Option<JoinHandle<Result<u64, mcap::McapError>>>,
}

impl Recorder {
    /// Prepares a recording of these fingers. What is in the file is replaced by the first frame or line after
    /// [`Recorder::begin`], or by [`Recorder::finish`]: what is handed in earlier waits for that, except frames of cameras,
    /// which nobody is given then ([`TappedSource`](super::TappedSource)). `judges`: somebody will say which frames are judged ([`MarkedSource`](super::MarkedSource)); otherwise all are just recorded.
    pub fn create(path: &Path, fingers: &[String], judges: bool) -> Result<Self, Error> {
        let file = LateFile::open(path).map_err(|source| Error::Create { path: path.to_owned(), source })?;
        let fingers = fingers.to_vec();
        let (to, items) = sync_channel(QUEUE_COUNT);
        let thread = thread::spawn(move || write_all(file, fingers, judges, &items));
        let inlet = Inlet { to, lost: Arc::default(), begun: Arc::default() };
        Ok(Recorder { path: path.to_owned(), inlet, thread: Some(thread) })
    }

    /// All that could be refused is there: from now on the recording replaces what was in the file.
    pub fn begin(&self) {
        self.inlet.begun.store(true, Ordering::Release);
        self.inlet.send(Item::Begin);
    }

    /// Where frames and lines are handed in.
    pub fn inlet(&self) -> Inlet {
        self.inlet.clone()
    }

    /// A file that goes with the recording: a sensor file, settings.
    pub fn attach(&self, name: &str, media_type: &'static str, bytes: Vec<u8>) {
        self.inlet.send(Item::Attachment { name: name.into(), media_type, bytes });
    }

    /// Facts of a kind.
    pub fn metadata(&self, name: &str, facts: impl IntoIterator<Item = (String, String)>) {
        self.inlet.send(Item::Metadata { name: name.into(), facts: facts.into_iter().collect() });
    }

    /// Whether nothing is written any more, before the end: [`Recorder::finish`] says why.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Closes the file. What is still handed in later is counted as lost, without an error.
    pub fn finish(mut self) -> Result<Written, Error> {
        self.inlet.send(Item::End);
        let lost_count = self.inlet.lost.load(Ordering::Relaxed);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Ok(frames_count))) => Ok(Written { frames_count, lost_count }),
            Some(Ok(Err(e))) => Err(Error::of_writing(&self.path, e)),
            Some(Err(_)) | None => Err(Error::Thread { path: self.path.clone() }),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = self.inlet.to.send(Item::CutOff); // a thread that is gone has ended the file
            let _ = thread.join();
        }
    }
}

impl Inlet {
    /// A line of JSON on a topic, now. Lost, and counted, when the disk does not keep up.
    pub fn line(&self, topic: &str, json: Vec<u8>) {
        self.offer(Item::Line { topic: topic.into(), log_ns: log_ns(), json });
    }

    /// The same, and never lost: waits for the disk.
    pub fn line_patiently(&self, topic: &str, json: Vec<u8>) {
        self.send(Item::Line { topic: topic.into(), log_ns: log_ns(), json });
    }
}

/// The time of day in ns when the program began, by a clock that is not put back meanwhile, plus what has passed since.
pub(super) fn log_ns() -> u64 {
    static OFFSET: std::sync::OnceLock<u64> = std::sync::OnceLock::new();
    let offset_ns = *OFFSET.get_or_init(|| {
        let day = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        u64::try_from(day.as_nanos()).unwrap_or(0).saturating_sub(now_ns())
    });
    offset_ns + now_ns()
}

/// Waits until the recording has begun, and for the first thing that is recorded, then writes until the end; how many frames.
fn write_all(
    file: LateFile,
    fingers: Vec<String>,
    judges: bool,
    items: &Receiver<Item>,
) -> Result<u64, mcap::McapError> {
    let mut waiting = Vec::new();
    let (mut has_begun, mut is_recorded) = (false, false);
    while !(has_begun && is_recorded) {
        match items.recv() {
            Ok(Item::CutOff) | Err(_) => return Ok(0), // nothing was recorded: the file stays as it was
            Ok(Item::Begin) => has_begun = true,
            Ok(item) => {
                has_begun |= matches!(item, Item::End);
                is_recorded |= !matches!(item, Item::Attachment { .. } | Item::Metadata { .. });
                waiting.push(item);
            }
        }
    }
    let fingers = fingers.into_iter().map(|name| Finger { name, pending: VecDeque::new() }).collect();
    let book = Book::create(file.begin()?)?;
    Sheet { book, fingers, judges, frames_count: 0 }.run(waiting, items)
}

/// The file, on its thread.
struct Sheet {
    book: Book,
    fingers: Vec<Finger>,
    judges: bool,
    frames_count: u64,
}

struct Finger {
    name: String,
    /// Frames of which it is not known yet what becomes of them.
    pending: VecDeque<FrameRecord>,
}

impl Sheet {
    /// Writes what waits, and on until the end is handed in. A chunk is closed whenever it has become old.
    fn run(mut self, waiting: Vec<Item>, items: &Receiver<Item>) -> Result<u64, mcap::McapError> {
        let mut flushed_ns = now_ns();
        let mut waiting = waiting.into_iter();
        let is_whole = loop {
            let left_ns = (flushed_ns + CHUNK_NS).saturating_sub(now_ns());
            let item = waiting.next().map_or_else(|| items.recv_timeout(Duration::from_nanos(left_ns)), Ok);
            match item {
                Ok(Item::End) => break true,
                Ok(Item::CutOff) | Err(RecvTimeoutError::Disconnected) => break false,
                Ok(item) => self.write(item)?,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if now_ns() >= flushed_ns + CHUNK_NS {
                self.book.flush()?;
                flushed_ns = now_ns();
            }
        };
        for finger in 0..self.fingers.len() {
            while let Some(record) = self.fingers[finger].pending.pop_front() {
                self.frame_record(finger, &FrameRecord { fate: Fate::Skipped, ..record })?;
            }
        }
        if is_whole {
            self.book.finish()?;
        }
        Ok(self.frames_count)
    }

    fn write(&mut self, item: Item) -> Result<(), mcap::McapError> {
        match item {
            Item::Frame { finger, frame, torn, log_ns } => self.frame(finger, &frame, torn, log_ns),
            Item::Taken { finger, record } => self.taken(finger, record),
            Item::Line { topic, log_ns, json } => {
                self.book.message(&topic, Kind::of_lines(&topic), 0, Times::both(log_ns), &json)
            }
            Item::Annotations { finger, seq, times, bytes } => {
                self.book.message(&annotations_topic(&finger), Kind::Annotations, seq, times, &bytes)
            }
            Item::Attachment { name, media_type, bytes } => self.book.attach(name, media_type, &bytes, log_ns()),
            Item::Metadata { name, facts } => self.book.metadata(name, facts),
            Item::Begin | Item::End | Item::CutOff => Ok(()),
        }
    }

    fn frame(
        &mut self,
        finger: usize,
        frame: &FrameBuffer,
        torn: Option<String>,
        log_ns: u64,
    ) -> Result<(), mcap::McapError> {
        let Some(name) = self.fingers.get(finger).map(|finger| finger.name.clone()) else { return Ok(()) };
        let has_bytes = !frame.encoded.is_empty() || torn.is_none();
        if has_bytes {
            let stamp_ns = frame.time_ns.unwrap_or(log_ns);
            let (schema, bytes) = foxglove::write(frame, &name, stamp_ns);
            let kind = if schema == foxglove::COMPRESSED { Kind::Compressed } else { Kind::Raw };
            self.book.message(&camera_topic(&name), kind, frame.seq, Times { log_ns, stamp_ns }, &bytes)?;
            self.frames_count += 1;
        }
        let (seq, time_ns, clock) = (frame.seq, frame.time_ns, frame.clock);
        let record = FrameRecord { seq, time_ns, clock, fate: Fate::Recorded, torn, is_kept: has_bytes };
        if self.judges {
            self.fingers[finger].pending.push_back(record);
            return Ok(());
        }
        self.frame_record(finger, &record)
    }

    /// A frame was taken: those before it, that still wait, were not.
    fn taken(&mut self, finger: usize, record: FrameRecord) -> Result<(), mcap::McapError> {
        while let Some(first) = self.fingers.get_mut(finger).and_then(|finger| finger.pending.pop_front()) {
            if first.seq == record.seq {
                return self.frame_record(finger, &FrameRecord { fate: Fate::Judged, ..first });
            }
            if first.seq > record.seq {
                self.fingers[finger].pending.push_front(first);
                break;
            }
            self.frame_record(finger, &FrameRecord { fate: Fate::Skipped, ..first })?;
        }
        // It was judged, but never got here.
        self.frame_record(finger, &FrameRecord { is_kept: false, fate: Fate::Judged, ..record })
    }

    fn frame_record(&mut self, finger: usize, record: &FrameRecord) -> Result<(), mcap::McapError> {
        let Some(name) = self.fingers.get(finger).map(|finger| finger.name.clone()) else { return Ok(()) };
        let json = serde_json::to_vec(record).map_err(|e| mcap::McapError::Io(e.into()))?;
        self.book.message(&format!("/{name}/frame"), Kind::Frame, record.seq, Times::both(log_ns()), &json)
    }
}
