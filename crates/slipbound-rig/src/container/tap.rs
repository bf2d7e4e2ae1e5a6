//! Sources whose frames are recorded.

use super::frame_record::{Fate, FrameRecord};
use super::recorder::{Inlet, Item, log_ns};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::io::{self, Write};

/// A source that also records every frame that arrives, before it is decided whether to judge it.
pub struct TappedSource<S> {
    source: S,
    finger: usize,
    inlet: Inlet,
    waits: bool,
}

impl<S> TappedSource<S> {
    /// Records this source as the finger with this number. `waits`: whether it waits for the disk and for
    /// [`Recorder::begin`](super::Recorder::begin), as a recording can. A camera's frame is lost instead, and counted.
    /// Before the recording begins or accepts frames, those of a camera are read and dropped, so that no unrecorded
    /// frame is judged and the first recorded frame is not an old one.
    pub fn new(source: S, finger: usize, inlet: Inlet, waits: bool) -> Self {
        TappedSource { source, finger, inlet, waits }
    }
}

impl<S: FrameSource> FrameSource for TappedSource<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let torn = match &next {
            Next::Frame => None,
            Next::Torn { reason } => Some(reason.clone()),
            Next::Silent | Next::End => return Ok(next),
        };
        if !self.waits && !self.inlet.accepts_frames() {
            return Ok(Next::Silent);
        }
        // Pixels are copied only if they are what is recorded.
        let pixels = if into.encoded.is_empty() && torn.is_none() { into.pixels.clone() } else { Vec::new() };
        let frame = FrameBuffer { encoded: into.encoded.clone(), pixels, label: String::new(), ..*into };
        let item = Item::Frame { finger: self.finger, frame: Box::new(frame), torn, log_ns: log_ns() };
        match self.waits {
            true => self.inlet.send(item),
            false => drop(self.inlet.offer(item)), // counted there
        }
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
    inlet: Inlet,
    waits: bool,
}

impl<S> MarkedSource<S> {
    /// Marks the frames of the finger with this number. `waits` as in [`TappedSource::new`].
    pub fn new(source: S, finger: usize, inlet: Inlet, waits: bool) -> Self {
        MarkedSource { source, finger, inlet, waits }
    }
}

impl<S: FrameSource> FrameSource for MarkedSource<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let torn = match &next {
            Next::Frame => None,
            Next::Torn { reason } => Some(reason.clone()),
            Next::Silent | Next::End => return Ok(next),
        };
        let (seq, time_ns, clock) = (into.seq, into.time_ns, into.clock);
        let record = FrameRecord { seq, time_ns, clock, fate: Fate::Judged, torn, is_kept: true };
        let item = Item::Taken { finger: self.finger, record };
        match self.waits {
            true => self.inlet.send(item),
            false => drop(self.inlet.offer(item)), // counted there
        }
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}

/// The output of a [`ReportJson`](crate::report_json::ReportJson) that puts the reports of a finger into the recording.
pub struct ReportLines {
    inlet: Inlet,
    topic: String,
    waits: bool,
    line: Vec<u8>,
}

impl ReportLines {
    /// `waits` as in [`TappedSource::new`].
    pub fn new(inlet: Inlet, finger: &str, waits: bool) -> Self {
        ReportLines { inlet, topic: format!("/{finger}/report"), waits, line: Vec::new() }
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
        match self.waits {
            _ if line.is_empty() => {}
            true => self.inlet.line_blocking(&self.topic, line),
            false => self.inlet.line(&self.topic, line),
        }
        Ok(())
    }
}
