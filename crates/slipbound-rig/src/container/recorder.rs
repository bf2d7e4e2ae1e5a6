//! Writes a recording, on a thread of its own.

use super::deferred_truncation::DeferredTruncation;
use super::foxglove;
use super::frame_record::{Fate, FrameRecord, annotations_topic, camera_topic};
use super::mcap_writer::{Kind, McapWriter, Times};
use crate::link::{now_ns, time_of_day_ns};
use slipbound::port::FrameBuffer;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SendError, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Items that may wait for the disk: one to two seconds of two fingers.
const QUEUE_COUNT: usize = 128;
/// A chunk is closed after this time, so that no more is lost when the program is killed, ns.
const CHUNK_NS: u64 = 500_000_000;
/// A recording that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be created.
    #[error("{}: cannot write: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file was created, but could not be written to its end; what came before is readable.
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
    /// The file took nothing more at the end.
    #[error("{}: not finished: it has taken nothing for {waited_s} s", path.display())]
    Blocked {
        /// The file.
        path: PathBuf,
        /// How long it was waited for, s.
        waited_s: u64,
    },
    /// The writing thread has panicked.
    #[error("{}: the thread that writes it has panicked", path.display())]
    Thread {
        /// The file.
        path: PathBuf,
    },
}

impl Error {
    /// The error of a file that cannot be written on, with the operating system's message where that is the reason.
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

/// An item on its way to the file.
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
    /// The results on a frame; `stamp_ns` is that of the frame's image.
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
    /// The old file may be replaced.
    Begin,
    /// Normal end: nothing more follows.
    End,
    /// Nothing more follows, because something else has failed.
    CutOff,
}

/// The input for frames and lines. Clones write to the same file.
#[derive(Clone)]
pub struct Inlet {
    to: SyncSender<Item>,
    lost: Arc<AtomicU64>,
    /// Whether something was lost that a replay needs.
    gap: Arc<AtomicBool>,
    accepts: Arc<AtomicBool>,
}

impl Inlet {
    /// Hands in an item if there is room; otherwise it is lost and counted. False when it was lost.
    pub(super) fn offer(&self, item: Item) -> bool {
        let refused = self.to.try_send(item).err();
        if let Some(TrySendError::Full(item) | TrySendError::Disconnected(item)) = &refused {
            self.count_lost(item);
        }
        refused.is_none()
    }

    fn count_lost(&self, item: &Item) {
        self.lost.fetch_add(1, Ordering::Relaxed);
        // Annotations follow from the frames.
        if !matches!(item, Item::Annotations { .. }) {
            self.gap.store(true, Ordering::Relaxed);
        }
    }

    /// Whether anything was lost that a replay needs.
    pub(super) fn has_gap(&self) -> bool {
        self.gap.load(Ordering::Relaxed)
    }

    /// Whether frames of cameras are recorded yet.
    pub(super) fn accepts_frames(&self) -> bool {
        self.accepts.load(Ordering::Acquire)
    }

    /// Hands in an item that must not be lost: waits for room.
    pub(super) fn send(&self, item: Item) {
        if let Err(SendError(item)) = self.to.send(item) {
            self.count_lost(&item);
        }
    }
}

/// A recording that is being written. If dropped before [`Recorder::finish`], it keeps what was recorded, and its
/// reader is told that it is cut off; if nothing was recorded, the old file stays.
pub struct Recorder {
    path: PathBuf,
    inlet: Inlet,
    /// How many items the thread has taken.
    taken: Arc<AtomicU64>,
    /// None once it is finished.
    thread: Option<JoinHandle<Result<u64, mcap::McapError>>>,
}

impl Recorder {
    /// Prepares a recording of these fingers. The first whole frame or line after [`Recorder::begin`], or
    /// [`Recorder::finish`], replaces the old file. Items handed in earlier wait for that, except frames of cameras,
    /// which are dropped ([`TappedSource`](super::TappedSource)) until [`Recorder::accept_frames`]. `judges`: whether frames will be marked as judged
    /// ([`MarkedSource`](super::MarkedSource)); otherwise all are only recorded.
    pub fn create(path: &Path, fingers: &[String], judges: bool) -> Result<Self, Error> {
        let file = DeferredTruncation::open(path).map_err(|source| Error::Create { path: path.to_owned(), source })?;
        let fingers = fingers.to_vec();
        let (to, items) = sync_channel(QUEUE_COUNT);
        let taken = Arc::<AtomicU64>::default();
        let counted = taken.clone();
        let thread = thread::spawn(move || write_all(file, fingers, judges, &items, &counted));
        let inlet = Inlet { to, lost: Arc::default(), gap: Arc::default(), accepts: Arc::default() };
        Ok(Recorder { path: path.to_owned(), inlet, taken, thread: Some(thread) })
    }

    /// From here on frames of cameras wait, too: before a camera is opened whose first frame is to be recorded.
    pub fn accept_frames(&self) {
        self.inlet.accepts.store(true, Ordering::Release);
    }

    /// Everything that could be refused is ready: from here on the recording replaces the old file.
    pub fn begin(&self) {
        self.accept_frames();
        self.inlet.send(Item::Begin);
    }

    /// The input for frames and lines.
    pub fn inlet(&self) -> Inlet {
        self.inlet.clone()
    }

    /// Adds a file to the recording: a sensor file, settings.
    pub fn attach(&self, name: &str, media_type: &'static str, bytes: Vec<u8>) {
        self.inlet.send(Item::Attachment { name: name.into(), media_type, bytes });
    }

    /// Adds facts under a name.
    pub fn metadata(&self, name: &str, facts: impl IntoIterator<Item = (String, String)>) {
        self.inlet.send(Item::Metadata { name: name.into(), facts: facts.into_iter().collect() });
    }

    /// Whether writing has stopped before the end; [`Recorder::finish`] says why.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// The same, but a file that takes nothing for this long is left as it is.
    pub fn finish_within(mut self, longest: Duration) -> Result<Written, Error> {
        let mut progress = (self.taken.load(Ordering::Relaxed), Instant::now());
        let mut item = Item::End;
        while let Err(TrySendError::Full(refused)) = self.inlet.to.try_send(item) {
            item = refused;
            self.wait(&mut progress, longest)?;
        }
        while !self.has_failed() {
            self.wait(&mut progress, longest)?;
        }
        self.join()
    }

    /// A moment; fails where nothing was taken for too long, and then nobody waits for the file any more.
    fn wait(&mut self, (count, since): &mut (u64, Instant), longest: Duration) -> Result<(), Error> {
        let now_count = self.taken.load(Ordering::Relaxed);
        if now_count != *count {
            (*count, *since) = (now_count, Instant::now());
        }
        if since.elapsed() >= longest {
            self.thread = None;
            return Err(Error::Blocked { path: self.path.clone(), waited_s: longest.as_secs() });
        }
        thread::sleep(Duration::from_millis(5));
        Ok(())
    }

    /// Closes the file. Anything handed in later is counted as lost, without an error.
    pub fn finish(mut self) -> Result<Written, Error> {
        self.inlet.send(Item::End);
        self.join()
    }

    fn join(&mut self) -> Result<Written, Error> {
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
            let _ = self.inlet.to.send(Item::CutOff); // a thread that has ended has closed the file
            let _ = thread.join();
        }
    }
}

impl Inlet {
    /// Records a line of JSON on a topic, with the present time. It is lost, and counted, when the disk does not keep
    /// up.
    pub fn line(&self, topic: &str, json: Vec<u8>) {
        self.offer(Item::Line { topic: topic.into(), log_ns: time_of_day_ns(), json });
    }

    /// The same, but is not lost where there is no room: it is to be handed in again. Returns whether it was taken.
    pub(super) fn try_line(&self, topic: &str, json: Vec<u8>) -> bool {
        let item = Item::Line { topic: topic.into(), log_ns: time_of_day_ns(), json };
        !matches!(self.to.try_send(item), Err(TrySendError::Full(_)))
    }

    /// The same, but waits for the disk and never loses a line.
    pub fn line_blocking(&self, topic: &str, json: Vec<u8>) {
        self.send(Item::Line { topic: topic.into(), log_ns: time_of_day_ns(), json });
    }
}

/// Waits for the recording to begin and for its first whole frame or line, then writes until the end; returns the number of
/// frames.
fn write_all(
    file: DeferredTruncation,
    fingers: Vec<String>,
    judges: bool,
    items: &Receiver<Item>,
    taken: &AtomicU64,
) -> Result<u64, mcap::McapError> {
    let mut waiting = Vec::new();
    let (mut has_begun, mut is_recorded) = (false, false);
    while !(has_begun && is_recorded) {
        let received = items.recv();
        taken.fetch_add(1, Ordering::Relaxed);
        match received {
            Ok(Item::CutOff) | Err(_) => return Ok(0), // nothing was recorded: the file stays as it was
            Ok(Item::Begin) => has_begun = true,
            Ok(item) => {
                has_begun |= matches!(item, Item::End);
                is_recorded |= match &item {
                    Item::Attachment { .. } | Item::Metadata { .. } => false,
                    Item::Frame { torn, .. } => torn.is_none(),
                    _ => true,
                };
                let is_torn = |item: &Item| matches!(item, Item::Frame { torn: Some(_), .. });
                // A source may give nothing else for hours.
                if is_torn(&item) && waiting.iter().filter(|item| is_torn(item)).count() >= QUEUE_COUNT {
                    let oldest = waiting.iter().position(is_torn);
                    oldest.map(|oldest| waiting.remove(oldest));
                }
                waiting.push(item);
            }
        }
    }
    let fingers = fingers.into_iter().map(|name| Finger { name, pending: VecDeque::new() }).collect();
    let writer = McapWriter::create(file.begin()?)?;
    WriterThread { writer, fingers, judges, frames_count: 0 }.run(waiting, items, taken)
}

/// The file, on its thread.
struct WriterThread {
    writer: McapWriter,
    fingers: Vec<Finger>,
    judges: bool,
    frames_count: u64,
}

struct Finger {
    name: String,
    /// Frames whose fate is not known yet.
    pending: VecDeque<FrameRecord>,
}

impl WriterThread {
    /// Writes the waiting items, then further ones until the end is handed in. A chunk is closed when it is old enough.
    fn run(mut self, waiting: Vec<Item>, items: &Receiver<Item>, taken: &AtomicU64) -> Result<u64, mcap::McapError> {
        let mut flushed_ns = now_ns();
        let mut waiting = waiting.into_iter();
        let is_whole = loop {
            let left_ns = (flushed_ns + CHUNK_NS).saturating_sub(now_ns());
            let item = waiting.next().map_or_else(|| items.recv_timeout(Duration::from_nanos(left_ns)), Ok);
            taken.fetch_add(u64::from(item.is_ok()), Ordering::Relaxed);
            match item {
                Ok(Item::End) => break true,
                Ok(Item::CutOff) | Err(RecvTimeoutError::Disconnected) => break false,
                Ok(item) => self.write(item)?,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if now_ns() >= flushed_ns + CHUNK_NS {
                self.writer.flush()?;
                flushed_ns = now_ns();
            }
        };
        for finger in 0..self.fingers.len() {
            while let Some(record) = self.fingers[finger].pending.pop_front() {
                self.frame_record(finger, &FrameRecord { fate: Fate::Skipped, ..record })?;
            }
        }
        if is_whole {
            self.writer.finish()?;
        }
        Ok(self.frames_count)
    }

    fn write(&mut self, item: Item) -> Result<(), mcap::McapError> {
        match item {
            Item::Frame { finger, frame, torn, log_ns } => self.frame(finger, &frame, torn, log_ns),
            Item::Taken { finger, record } => self.taken(finger, record),
            Item::Line { topic, log_ns, json } => {
                self.writer.message(&topic, Kind::of_lines(&topic), 0, Times::both(log_ns), &json)
            }
            Item::Annotations { finger, seq, times, bytes } => {
                self.writer.message(&annotations_topic(&finger), Kind::Annotations, seq, times, &bytes)
            }
            Item::Attachment { name, media_type, bytes } => {
                self.writer.attach(name, media_type, &bytes, time_of_day_ns())
            }
            Item::Metadata { name, facts } => self.writer.metadata(name, facts),
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
            self.writer.message(&camera_topic(&name), kind, frame.seq, Times { log_ns, stamp_ns }, &bytes)?;
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

    /// A frame was taken: the frames still waiting before it were skipped.
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
        // It was judged, but its bytes never got here.
        self.frame_record(finger, &FrameRecord { is_kept: false, fate: Fate::Judged, ..record })
    }

    fn frame_record(&mut self, finger: usize, record: &FrameRecord) -> Result<(), mcap::McapError> {
        let Some(name) = self.fingers.get(finger).map(|finger| finger.name.clone()) else { return Ok(()) };
        let json = serde_json::to_vec(record).map_err(|e| mcap::McapError::Io(e.into()))?;
        self.writer.message(&format!("/{name}/frame"), Kind::Frame, record.seq, Times::both(time_of_day_ns()), &json)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    /// A file that takes nothing for as long as the test wants.
    #[test]
    fn a_recording_that_takes_nothing_is_not_waited_for_longer_than_it_may_take() {
        for items_count in [0, 1] {
            let (to, items) = sync_channel(1);
            let (leave, blocked) = channel::<()>();
            let thread = thread::spawn(move || {
                let _ = blocked.recv();
                drop(items);
                Ok(7)
            });
            let inlet = Inlet { to, lost: Arc::default(), gap: Arc::default(), accepts: Arc::default() };
            let recorder = Recorder { path: "run.mcap".into(), inlet, taken: Arc::default(), thread: Some(thread) };
            (0..items_count).for_each(|_| recorder.inlet.send(Item::Begin)); // the queue is full
            let said = recorder.finish_within(Duration::from_millis(50)).expect_err("it takes nothing");
            assert!(matches!(&said, Error::Blocked { .. }), "{said}");
            drop(leave);
        }
    }

    /// It takes an item in 30 ms, ten of them.
    #[test]
    fn a_recording_that_is_slow_is_waited_for() {
        let (to, items) = sync_channel(20);
        let taken = Arc::<AtomicU64>::default();
        let counted = taken.clone();
        let thread = thread::spawn(move || {
            let whole = items.iter().take_while(|item| !matches!(item, Item::End)).inspect(|_| {
                thread::sleep(Duration::from_millis(30));
                counted.fetch_add(1, Ordering::Relaxed);
            });
            Ok(whole.count() as u64)
        });
        let inlet = Inlet { to, lost: Arc::default(), gap: Arc::default(), accepts: Arc::default() };
        let recorder = Recorder { path: "run.mcap".into(), inlet, taken, thread: Some(thread) };
        (0..10).for_each(|_| recorder.inlet.send(Item::Begin));
        assert_eq!(recorder.finish_within(Duration::from_millis(150)).expect("it goes on").frames_count, 10);
    }
}
