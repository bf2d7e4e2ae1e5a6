//! Every slip of a recording as a line: `{"slip":1,"finger":"finger","first_seq":59,...}`.
//!
//! A slip lasts from the first frame that shows it to the last. It is counted by the rules of [`slipbound::events`], so
//! its number is the same in the terminal and on the page. Unknown values are null.

use serde::Serialize;
use slipbound::events::{Episode, SlipEpisodes, SlipObservation};
use slipbound::monitor::{SlipKind, SlipReport, SlipState};
use std::io::{self, Write};

/// A line.
#[derive(Debug, Serialize)]
struct Line<'a> {
    slip: u32,
    finger: &'a str,
    first_seq: u64,
    first_time_ns: Option<u64>,
    last_seq: u64,
    last_time_ns: Option<u64>,
    /// Frames that showed it.
    frames_count: u32,
    /// Kind and direction when it began.
    kind: Option<SlipKind>,
    direction_rad: Option<f64>,
    /// Largest slip of a marker since the reference, in marker pitches and, where the pitch is known, in mm.
    max_pitch: f64,
    max_mm: Option<f64>,
    /// Whether the whole contact slid in one of its frames.
    gross: bool,
    /// Whether the recording ended before the slip did; only then in the line.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    ongoing: bool,
}

/// Folds the reports of a finger into slips and writes them.
#[derive(Debug)]
pub struct ReportSlips<W: Write> {
    to: W,
    finger: String,
    episodes: SlipEpisodes,
    running: Option<Extremes>,
}

#[derive(Debug, Clone, Copy)]
struct Extremes {
    kind: Option<SlipKind>,
    direction_rad: Option<f64>,
    max_pitch: f64,
    max_mm: Option<f64>,
    gross: bool,
}

impl<W: Write> ReportSlips<W> {
    /// Before the first frame.
    pub fn new(to: W, finger: &str) -> Self {
        ReportSlips { to, finger: finger.to_owned(), episodes: SlipEpisodes::default(), running: None }
    }

    /// Takes the report of a frame; writes the slip that it ends.
    pub fn frame(&mut self, report: &SlipReport) -> io::Result<()> {
        let observation = SlipObservation::of_finger(report);
        let change = self.episodes.see(&observation);
        if let Some(ended) = change.ended {
            self.write(&ended, false)?;
        }
        let slip = &report.slip;
        if change.began.is_some() {
            let (kind, direction_rad) = (slip.kind, slip.direction_rad);
            self.running = Some(Extremes { kind, direction_rad, max_pitch: 0.0, max_mm: None, gross: false });
        }
        if let Some(running) = self.running.as_mut().filter(|_| observation.slips) {
            running.max_pitch = running.max_pitch.max(slip.max_pitch);
            running.max_mm = slip.max_mm.map(|mm| running.max_mm.map_or(mm, |most| most.max(mm))).or(running.max_mm);
            running.gross |= report.state == SlipState::Gross;
        }
        Ok(())
    }

    /// Writes the slip still in progress at the end of the recording.
    pub fn finish(mut self) -> io::Result<()> {
        match self.episodes.end() {
            Some(ended) => self.write(&ended, true),
            None => Ok(()),
        }
    }

    fn write(&mut self, ended: &Episode, ongoing: bool) -> io::Result<()> {
        let Some(Extremes { kind, direction_rad, max_pitch, max_mm, gross }) = self.running.take() else {
            return Ok(());
        };
        let line = Line {
            slip: ended.number,
            finger: &self.finger,
            first_seq: ended.first.seq,
            first_time_ns: ended.first.time_ns,
            last_seq: ended.last.seq,
            last_time_ns: ended.last.time_ns,
            frames_count: ended.frames_count,
            kind,
            direction_rad,
            max_pitch,
            max_mm,
            gross,
            ongoing,
        };
        let mut text = serde_json::to_string(&line)?;
        text.push('\n');
        self.to.write_all(text.as_bytes())
    }
}
