//! Sources whose frames are recorded.

use super::frame_record::{Fate, FrameRecord};
use super::recorder::{Inlet, Item};
use crate::link::time_of_day_ns;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::io::{self, Write};

/// The way into the recording. `waits`: whether it waits for the disk; otherwise what the disk does not take is lost, and
/// counted.
struct Tap {
    inlet: Inlet,
    waits: bool,
}

impl Tap {
    fn put(&self, item: Item) {
        match self.waits {
            true => self.inlet.send(item),
            false => drop(self.inlet.offer(item)), // counted there
        }
    }
}

/// A frame that has come, whole or torn, and why it is torn.
struct Came {
    torn: Option<String>,
}

impl Came {
    /// None if no frame has come.
    fn of(next: &Next) -> Option<Self> {
        match next {
            Next::Frame => Some(Came { torn: None }),
            Next::Torn { reason } => Some(Came { torn: Some(reason.clone()) }),
            Next::Silent | Next::End => None,
        }
    }
}

/// A source that also records every frame that arrives, before it is decided whether to judge it.
pub struct TappedSource<S> {
    source: S,
    finger: usize,
    tap: Tap,
}

impl<S> TappedSource<S> {
    /// Records this source as the finger with this number. `waits`: whether it waits for the disk and for
    /// [`Recorder::begin`](super::Recorder::begin), as a recording can. A camera's frame is lost instead, and counted.
    /// Before the recording begins or accepts frames, those of a camera are read and dropped, so that no unrecorded
    /// frame is judged and the first recorded frame is not an old one.
    pub fn new(source: S, finger: usize, inlet: Inlet, waits: bool) -> Self {
        TappedSource { source, finger, tap: Tap { inlet, waits } }
    }
}

impl<S: FrameSource> FrameSource for TappedSource<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let Some(Came { torn }) = Came::of(&next) else { return Ok(next) };
        if !self.tap.waits && !self.tap.inlet.accepts_frames() {
            return Ok(Next::Silent);
        }
        // Pixels are copied only if they are what is recorded.
        let pixels = if into.encoded.is_empty() && torn.is_none() { into.pixels.clone() } else { Vec::new() };
        let frame = FrameBuffer { encoded: into.encoded.clone(), pixels, label: String::new(), ..*into };
        self.tap.put(Item::Frame { finger: self.finger, frame: Box::new(frame), torn, log_ns: time_of_day_ns() });
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}

/// A source whose frames are judged: every frame taken is marked in the recording.
pub struct MarkedSource<S> {
    source: S,
    finger: usize,
    tap: Tap,
}

impl<S> MarkedSource<S> {
    /// Marks the frames of the finger with this number. `waits` as in [`TappedSource::new`].
    pub fn new(source: S, finger: usize, inlet: Inlet, waits: bool) -> Self {
        MarkedSource { source, finger, tap: Tap { inlet, waits } }
    }
}

impl<S: FrameSource> FrameSource for MarkedSource<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let Some(Came { torn }) = Came::of(&next) else { return Ok(next) };
        let (seq, time_ns, clock) = (into.seq, into.time_ns, into.clock);
        let record = FrameRecord { seq, time_ns, clock, fate: Fate::Judged, torn, is_kept: true };
        self.tap.put(Item::Taken { finger: self.finger, record });
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}

/// The output of a [`ReportJson`](crate::report_json::ReportJson) that puts the reports of a finger into the recording.
pub struct ReportLines {
    tap: Tap,
    topic: String,
    line: Vec<u8>,
}

impl ReportLines {
    /// `waits` as in [`TappedSource::new`].
    pub fn new(inlet: Inlet, finger: &str, waits: bool) -> Self {
        ReportLines { tap: Tap { inlet, waits }, topic: format!("/{finger}/report"), line: Vec::new() }
    }
}

impl Write for ReportLines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.line.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    /// A line is complete when it is flushed.
    fn flush(&mut self) -> io::Result<()> {
        let mut line = std::mem::take(&mut self.line);
        if line.ends_with(b"\n") {
            line.pop();
        }
        if !line.is_empty() {
            self.tap.put(Item::Line { topic: self.topic.clone(), log_ns: time_of_day_ns(), json: line });
        }
        Ok(())
    }
}
