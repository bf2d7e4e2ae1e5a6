//! Writes a control loop's reports, cycles, events and frames into its recording.

use super::annotations;
use super::frame_record::{Fate, FrameRecord};
use super::mcap_writer::Times;
use super::recorder::{Inlet, Item};
use super::tap::ReportLines;
use crate::link::time_of_day_ns;
use crate::report_json::{Header, ReportJson, RestOrigin};
use crate::run::event::EventLog;
use crate::run::{CameraLimits, Event, RunInfo, RunNotes, TimedEvent, frames, line, lost_text};
use slipbound::control::{CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerView;
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::{FrameBuffer, Next};
use std::thread;
use std::time::Duration;

/// The event text where a replay can no longer follow.
const UNLISTED: &str = "a replay goes to here, because something was not written";

/// How often a note after the last cycle is offered to a disk that does not keep up, and the pause between.
const NOTE_TRIES_COUNT: u32 = 100;
const NOTE_PAUSE: Duration = Duration::from_millis(10);

/// Records every report and every cycle.
pub struct McapObserver {
    inlet: Inlet,
    info: RunInfo,
    sources: Vec<String>,
    reports: Vec<Option<ReportJson<ReportLines>>>,
    log: EventLog,
    notes: RunNotes,
    /// Whether it records frames too and waits for the disk.
    keeps_frames: bool,
    /// Whether any cycle was lost before it got here, and how many since the last one that arrived.
    has_gap: bool,
    /// Whether the events say that frames are not kept from there on.
    has_told_gap: bool,
    lost_count: u64,
    /// Time of the last cycle, ns.
    last_ns: u64,
}

impl McapObserver {
    /// For a loop with frames from `sources`. It does not wait for the disk.
    pub fn new(inlet: Inlet, info: RunInfo, sources: Vec<String>) -> Self {
        let reports = info.fingers.iter().map(|_| None).collect();
        let log = EventLog::new(&info);
        let notes = RunNotes::default();
        McapObserver {
            inlet,
            info,
            sources,
            reports,
            log,
            notes,
            keeps_frames: false,
            has_gap: false,
            has_told_gap: false,
            lost_count: 0,
            last_ns: 0,
        }
    }

    /// Records a note that does not follow from a cycle, for example why the loop ended.
    pub fn note(&mut self, time_ns: u64, text: &str) {
        for _ in 0..NOTE_TRIES_COUNT {
            if self.try_note(time_ns, text) {
                return;
            }
            thread::sleep(NOTE_PAUSE); // no cycle waits for it
        }
        self.event(time_ns, Event::Note { text: text.into() });
    }

    /// No cycle is to follow: a slip in progress ends with the last one.
    pub fn end_cycles(&mut self) {
        if let Some(event) = self.log.end() {
            self.event(self.last_ns, event);
        }
    }

    /// `count` cycles before the next one were lost before they got here. The frames of each cycle are recorded up to
    /// this gap only, because a replay goes cycle by cycle; the events report the loss.
    pub fn lost_cycles(&mut self, count: u64) {
        self.has_gap = true;
        self.lost_count += count;
    }

    /// The same, for fingers whose sources are not tapped: keeps every frame that the loop took, and waits for the disk.
    #[must_use]
    pub fn keeping_frames(self) -> Self {
        McapObserver { keeps_frames: true, ..self }
    }

    /// Whether it needs the bytes of every frame.
    pub fn takes_frames(&self) -> bool {
        self.keeps_frames
    }

    /// The same with other limits for reports about cameras.
    #[must_use]
    pub fn limited(self, limits: CameraLimits) -> Self {
        McapObserver { notes: RunNotes::new(limits), ..self }
    }

    /// The recorder of the lines over the images. It needs the monitors, so it comes before any queue.
    pub fn annotations(&self) -> McapAnnotations {
        McapAnnotations { inlet: self.inlet.clone(), waits: self.keeps_frames }
    }

    fn line(&self, topic: &str, json: String) {
        match self.keeps_frames {
            true => self.inlet.line_blocking(topic, json.into_bytes()),
            false => self.inlet.line(topic, json.into_bytes()),
        }
    }

    /// Records the report of a finger, after a header that states its kind of rest frame.
    fn report(&mut self, number: usize, finger: &FingerView<'_>) -> Option<()> {
        let (report, kind) = (finger.report?, finger.rest_kind?);
        let lines = self.reports.get_mut(number)?;
        if lines.is_none() {
            let header = Header {
                finger: finger.name,
                sensor: &self.info.fingers.get(number)?.sensor,
                settings: &self.info.monitor_settings,
                source: self.sources.get(number).map_or("", String::as_str),
                clock: finger.frame.clock,
                rest: RestOrigin { kind: kind.into(), frames: None },
                note: None,
            };
            let to = ReportLines::new(self.inlet.clone(), finger.name, self.keeps_frames);
            // Handing in cannot fail: what is lost is counted.
            *lines = ReportJson::new(to, &header).ok();
        }
        lines.as_mut()?.frame(report, None).ok()
    }

    fn frame(&self, number: usize, finger: &FingerView<'_>) {
        let torn = match finger.next {
            Next::Frame => None,
            Next::Torn { reason } => Some(reason.clone()),
            Next::Silent | Next::End => return,
        };
        let FrameBuffer { seq, time_ns, clock, .. } = *finger.frame;
        let pixels = if finger.frame.encoded.is_empty() { finger.frame.pixels.clone() } else { Vec::new() };
        let encoded = finger.frame.encoded.clone();
        let frame = Box::new(FrameBuffer { encoded, pixels, label: String::new(), ..*finger.frame });
        let record = FrameRecord { seq, time_ns, clock, fate: Fate::Judged, torn: torn.clone(), is_kept: true };
        self.inlet.send(Item::Frame { finger: number, frame, torn, log_ns: time_of_day_ns() });
        self.inlet.send(Item::Taken { finger: number, record });
    }

    fn event(&self, time_ns: u64, event: Event) {
        if let Ok(json) = serde_json::to_string(&TimedEvent { time_ns, event }) {
            self.line("/event", json);
        }
    }

    /// A note that may be handed in again: returns whether it was taken.
    fn try_note(&self, time_ns: u64, text: &str) -> bool {
        let event = Event::Note { text: text.into() };
        let json = serde_json::to_string(&TimedEvent { time_ns, event });
        json.map_or(true, |json| self.inlet.try_line("/event", json.into_bytes()))
    }
}

impl CycleObserver for McapObserver {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for (number, finger) in view.fingers.iter().enumerate() {
            if self.keeps_frames {
                self.frame(number, finger);
            }
            self.report(number, finger);
        }
        if self.lost_count > 0 && self.try_note(view.now_ns, &lost_text(self.lost_count)) {
            self.lost_count = 0;
        }
        for text in self.notes.see(view) {
            self.event(view.now_ns, Event::Note { text });
        }
        let cycle = view.cycle();
        if let Some(cycle) = &cycle {
            match line::write(cycle) {
                Ok(json) => self.line("/cycle", json),
                Err(_) => self.has_gap = true,
            }
        }
        let has_gap = self.has_gap || self.inlet.has_gap();
        if has_gap && !self.has_told_gap {
            self.has_told_gap = self.try_note(view.now_ns, UNLISTED);
        }
        // After the cycle: with a line of frames alone, a replay would run a cycle that was not recorded.
        if let (false, Some(Ok(json))) = (has_gap, frames::line(view)) {
            self.line("/cycle/frames", json);
        }
        let Some(cycle) = cycle else { return };
        self.last_ns = cycle.time_ns;
        let reports: Vec<_> = view.fingers.iter().map(|finger| finger.report).collect();
        for event in self.log.see(&cycle, &reports) {
            self.event(cycle.time_ns, event);
        }
    }
}

/// Records the results on every judged frame, to be drawn over it.
pub struct McapAnnotations {
    inlet: Inlet,
    waits: bool,
}

impl McapAnnotations {
    /// `waits`: whether it waits for the disk instead of losing any.
    pub fn new(inlet: Inlet, waits: bool) -> Self {
        McapAnnotations { inlet, waits }
    }

    /// Records the results on a frame of the monitor that has just judged it.
    pub fn record(&self, finger: &str, frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) {
        let log_ns = time_of_day_ns();
        let stamp_ns = frame.time_ns.unwrap_or(log_ns);
        let bytes = annotations::write(monitor.sensor(), report, monitor.markers(), stamp_ns);
        let times = Times { log_ns, stamp_ns };
        let item = Item::Annotations { finger: finger.to_owned(), seq: frame.seq, times, bytes };
        match self.waits {
            true => self.inlet.send(item),
            false => drop(self.inlet.offer(item)), // counted there
        }
    }
}

impl CycleObserver for McapAnnotations {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for finger in view.fingers.iter().filter(|finger| *finger.next == Next::Frame) {
            if let (Some(report), Some(monitor)) = (finger.report, finger.monitor) {
                self.record(finger.name, finger.frame, report, monitor);
            }
        }
    }
}
