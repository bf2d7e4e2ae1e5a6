//! `slipbound watch`: judges every frame of a recording, a simulated scene, or a camera.
//!
//! ```text
//!   SOURCE --read ahead--> rest --> monitor --step--> report --> JSON, overlay, timings, lines, summary
//! ```

mod args;
mod batch;
mod outputs;
mod overwriting;
mod rest;
mod stall_detector;

pub use args::{Watch, live_count};
pub use stall_detector::StallDetector;

use super::finger;
use super::recording::{self, LiveCamera};
use crate::interruption;
use crate::outcome::{Failure, Outcome, unless_reader_left};
use crate::terminal::Terminal;
use anyhow::anyhow;
use args::RestArgument;
use outputs::Outputs;
use slipbound::events::{SlipEvent, SlipEvents};
use slipbound::finger_pipeline::RecordingMonitor;
use slipbound::image::SizePx;
use slipbound::monitor::{Settings, SlipMonitor, SlipState};
use slipbound::port::{FrameBuffer, FrameSource, Next};
use slipbound::sensor::Sensor;
use slipbound_rig::container::Recorder;
use slipbound_rig::link::now_ns;
use slipbound_rig::report_summary::{ReportSummary, torn, when};
use slipbound_rig::source::{ReadAhead, doubt};
use slipbound_rig::{config, sensors};
use std::slice;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Playback rate of the overlay video of a recording without times.
const OVERLAY_RATE_HZ: u32 = 10;

/// The consequence of a marker spacing that differs from the sensor's pitch.
const UNJUDGED: &str = "no frame is judged until the sensor file fits, or the settings say rest.check_spacing = false";

/// Closes a recording; returns whether everything is in it.
fn finish(recorder: Recorder, terminal: &Terminal) -> Result<bool, Failure> {
    let written = recorder.finish().map_err(|e| Failure::Work(e.into()))?;
    if written.lost_count > 0 {
        terminal.note(&format!("{} frames or lines were not recorded: the disk did not keep up", written.lost_count));
    }
    Ok(written.lost_count == 0)
}

/// A recording that was judged to its end.
struct JudgedRecording {
    outcome: Outcome,
    summary: ReportSummary,
    /// When the first slip began: its time, or its frame where there is none.
    first_slip: Option<String>,
}

/// One of several recordings, for which the terminal shows only a row.
struct BatchMode {
    interrupted: Arc<AtomicBool>,
}

/// What is shown of a recording while it is judged.
struct Progress<'a> {
    terminal: Terminal,
    summary: ReportSummary,
    first_slip: Option<String>,
    batch: Option<&'a BatchMode>,
}

impl Progress<'_> {
    fn event(
        &mut self,
        event: &SlipEvent,
        outputs: &mut Outputs,
        frame: &FrameBuffer,
        monitor: &SlipMonitor,
    ) -> Result<(), Failure> {
        let words = self.summary.event(event);
        if let SlipEvent::Begins { seq, time_ns, .. } = event {
            self.first_slip.get_or_insert_with(|| when(*seq, *time_ns));
        }
        outputs.event(event, &words, frame, monitor);
        if self.batch.is_some() { Ok(()) } else { self.terminal.say(&words) }
    }
}

impl Watch {
    /// Judges the recording, or every one of several.
    pub fn run(&self) -> Result<Outcome, Failure> {
        match self.sources.as_slice() {
            [source] => {
                let one = Watch { source: source.clone(), ..self.clone() };
                one.judge_all(None).map(|judged| judged.outcome)
            }
            _ => self.run_batch(),
        }
    }

    /// Judges the recording from its first frame to its last.
    fn judge_all(&self, batch: Option<&BatchMode>) -> Result<JudgedRecording, Failure> {
        let settings = self.settings()?;
        let sensor = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        overwriting::refuse(slice::from_ref(self))?;
        rest::refuse_second_reading(self)?;
        let fingers = [self.finger.clone()];
        let recorder = self.record.as_deref().map(|path| Recorder::create(path, &fingers, true)).transpose()?;
        recorder.iter().for_each(Recorder::accept_frames); // a camera's frames may come before it counts as opened
        let (mut recording, camera) = recording::open_watched(&self.source, recorder.as_ref())?;
        if let (Some(recorder), Some(_)) = (&recorder, &camera) {
            recorder.begin(); // with the frames in which the rest frame is found
        }
        let terminal = Terminal::with_bar(recording.frames_count(), self.json_on_stdout());
        doubt(&self.source).iter().for_each(|doubt| terminal.note(doubt));

        if let Some(camera) = &camera {
            let facts: Vec<String> = camera.facts.iter().map(|(name, value)| format!("{name} {value}")).collect();
            terminal.note(&format!("{}; Ctrl-C ends", facts.join(", ")));
        }
        let (monitor, sensor, origin) = self.at_rest(&mut recording, &settings, sensor.as_ref(), &terminal)?;
        if let Some(recorder) = &recorder {
            self.describe(recorder, &sensor, &settings, camera.as_ref())?;
        }
        let is_named = self.rest.as_ref().is_some_and(|rest| *rest != RestArgument::Held);
        let mut outputs = Outputs::open(self, origin, &monitor, recorder.as_ref())?;
        let mut monitor = match is_named {
            true => RecordingMonitor::with_known_rest(monitor),
            false => RecordingMonitor::with_rest_of_first_frames(monitor).map_err(Failure::arguments)?,
        };
        if let (Some(recorder), None) = (&recorder, &camera) {
            recorder.begin();
        }

        let mut progress = Progress { terminal, summary: ReportSummary::new(), first_slip: None, batch };
        // Marked when they are judged, not when they are read ahead.
        let inlet = recorder.as_ref().map(Recorder::inlet);
        let mut recording = recording::marked(recording, inlet, 0, camera.is_none());
        let mut stalls = camera.as_ref().map(|_| StallDetector::new(self.max_silence_ms));
        let ended = self.judge(recording.as_mut(), &mut monitor, &mut outputs, &mut progress, stalls.as_mut());
        self.conclude(ended, progress, outputs, recorder, camera)
    }

    /// The settings of the file, with what `--rest` says.
    fn settings(&self) -> Result<Settings, Failure> {
        let mut settings = match &self.settings {
            Some(file) => config::load_settings(file).map_err(Failure::arguments)?,
            None => Settings::default(),
        };
        settings.rest.held |= self.rest == Some(RestArgument::Held);
        if let Some(RestArgument::Live(count)) = self.rest {
            (settings.rest.window_count, settings.rest.held) = (count, false);
        }
        Ok(settings)
    }

    /// Finds the rest frame: the monitor that counts from it, its finger, and the content of the report's header.
    fn at_rest(
        &self,
        recording: &mut ReadAhead,
        settings: &Settings,
        sensor: Option<&Sensor>,
        terminal: &Terminal,
    ) -> Result<(SlipMonitor, Sensor, outputs::Origin), Failure> {
        let mut stalls = StallDetector::new(self.max_silence_ms);
        let silence = |is_silent| stalls.note(&self.source, now_ns(), is_silent, terminal);
        let sensor_for = |size: SizePx, saved: Option<(&Sensor, &str)>| finger::of(&self.source, size, sensor, saved);
        let found = rest::find(self, recording, settings, silence, sensor_for)?;
        found.notes.iter().for_each(|note| terminal.note(note));
        let monitor = SlipMonitor::new(&found.sensor, settings, found.rest).map_err(Failure::arguments)?;
        let doubt = monitor.refusal().map(|reason| format!("{reason}; {UNJUDGED}"));
        doubt.iter().for_each(|doubt| terminal.note(&format!("{}: {doubt}", self.source)));
        let notes: Vec<String> = found.report_note.into_iter().chain(doubt).collect();
        let origin = outputs::Origin {
            clock: recording.clock(),
            rest: found.origin,
            note: (!notes.is_empty()).then(|| notes.join("; ")),
            rate_hz: recording.rate_hz().unwrap_or(OVERLAY_RATE_HZ),
        };
        Ok((monitor, found.sensor, origin))
    }

    /// Closes the outputs, shows the summary, and says whether anything was lost.
    fn conclude(
        &self,
        ended: Result<(), Failure>,
        progress: Progress<'_>,
        mut outputs: Outputs,
        recorder: Option<Recorder>,
        camera: Option<LiveCamera>,
    ) -> Result<JudgedRecording, Failure> {
        let Progress { mut terminal, summary, first_slip, batch } = progress;
        terminal.clear_bar();
        if matches!(ended, Err(Failure::ReaderLeft)) {
            // What is kept elsewhere is whole all the same.
            let drawn = outputs.finish_overlay();
            outputs.close(&summary).and(drawn.map(drop))?;
            recorder.map_or(Ok(true), |recorder| finish(recorder, &terminal))?;
            return Err(Failure::ReaderLeft);
        }
        let drawn = outputs.finish_overlay();
        let overlay_is_whole = outputs.overlay_is_whole();
        drawn.iter().flatten().for_each(|note| terminal.note(note)); // whatever else fails
        let closed = outputs.close(&summary).and(drawn.map(drop));
        let lines = if batch.is_some() { Vec::new() } else { summary.lines() };
        let camera_line = camera.iter().map(|camera| format!("camera: {}", camera.line()));
        let said = lines.into_iter().chain(camera_line).try_for_each(|line| terminal.say(&line));
        // A failure leaves the recording without its end: its reader is told that it is cut off.
        ended.and(closed)?;
        let is_lossless = recorder.map_or(Ok(true), |recorder| finish(recorder, &terminal));
        unless_reader_left(said)?;
        let frames_count = summary.frames_count();
        if frames_count > 0 && summary.count(SlipState::Unjudged) == frames_count {
            let why = summary.lines().split_off(1).join("; ");
            return Err(anyhow!("{}: none of {frames_count} frames could be judged: {why}", self.source).into());
        }
        // A torn frame that was replaced by a newer one is lost all the same.
        let torn_count = summary.torn_count() + camera.map_or(0, |camera| camera.tally.counts().torn_count);
        let is_whole = is_lossless? && torn_count + summary.other_size_count() == 0 && overlay_is_whole;
        Ok(JudgedRecording { outcome: if is_whole { Outcome::Done } else { Outcome::DataLost }, summary, first_slip })
    }

    /// Adds to a recording what is needed to judge it again anywhere: the finger at the resolution of its sensor file.
    fn describe(
        &self,
        recorder: &Recorder,
        sensor: &Sensor,
        settings: &Settings,
        camera: Option<&LiveCamera>,
    ) -> Result<(), Failure> {
        let sensor = toml::to_string(sensor).map_err(|e| Failure::work("sensor", e))?;
        recorder.attach(&format!("{}.sensor.toml", self.finger), "text/toml", sensor.into_bytes());
        let settings = toml::to_string(settings).map_err(|e| Failure::work("settings", e))?;
        recorder.attach("settings.toml", "text/toml", settings.into_bytes());
        if let Some(camera) = camera {
            recorder.metadata(&format!("slipbound.camera.{}", self.finger), camera.facts.clone());
        }
        Ok(())
    }

    /// The loop: reads a frame, writes its report to every output.
    fn judge(
        &self,
        recording: &mut dyn FrameSource,
        monitor: &mut RecordingMonitor,
        outputs: &mut Outputs,
        progress: &mut Progress<'_>,
        mut stalls: Option<&mut StallDetector>,
    ) -> Result<(), Failure> {
        let interrupted = match progress.batch {
            Some(batch) => batch.interrupted.clone(),
            None => interruption::listen()?,
        };
        let mut events = SlipEvents::new();
        let mut buffer = FrameBuffer::default();
        loop {
            if stalls.is_some() && interrupted.load(Ordering::Relaxed) {
                // A camera has no other end. The frames taken have been judged.
                return events
                    .end()
                    .map_or(Ok(()), |event| progress.event(&event, outputs, &buffer, monitor.monitor()));
            }
            let next = recording.next(&mut buffer);
            if stalls.is_none() && interrupted.load(Ordering::Relaxed) {
                let frames_count = progress.summary.frames_count();
                return Err(anyhow!("interrupted after {frames_count} frames; what was judged is kept").into());
            }
            outputs.stopwatch.restart();
            let mut torn_why = None;
            let next = next?;
            if let Some(line) = stalls.as_mut().and_then(|stalls| stalls.see(now_ns(), next == Next::Silent)) {
                progress.terminal.say(&format!("{}: {line}", self.source))?;
            }
            let report = match next {
                Next::Silent => continue,
                Next::Frame => {
                    let judged = monitor.step(&buffer, &mut outputs.stopwatch, &mut |_, _| {});
                    judged.map_err(|e| Failure::work(&self.source, e))?
                }
                Next::Torn { reason } => {
                    progress.terminal.note(&format!("{}: {}", self.source, torn(&buffer, &reason)));
                    torn_why = Some(reason);
                    monitor.torn(buffer.seq, buffer.time_ns)
                }
                Next::End => {
                    let event = events.end();
                    return event.map_or(Ok(()), |event| progress.event(&event, outputs, &buffer, monitor.monitor()));
                }
            };
            let note = outputs.write(&buffer, &report, monitor.monitor())?;
            note.iter().for_each(|note| progress.terminal.note(note));
            progress.summary.see(&report, &buffer, torn_why.as_deref());
            for event in events.see(&report) {
                progress.event(&event, outputs, &buffer, monitor.monitor())?;
            }
            progress.terminal.advance();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use slipbound_rig::source;
    use std::fs;
    use std::path::Path;

    #[derive(Debug, Parser)]
    struct Arguments {
        #[command(flatten)]
        watch: Watch,
    }

    /// Whole frames of a recording, which has no torn one.
    fn frames_count(path: &Path) -> usize {
        let (mut recording, mut buffer) =
            (source::open(&path.display().to_string()).expect("opens"), Default::default());
        let mut count = 0;
        loop {
            match recording.next(&mut buffer).expect("reads") {
                Next::Frame => count += 1,
                Next::End => return count,
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn a_full_overlay_video_ends_neither_the_judging_nor_the_recording() {
        let folder = tempfile::tempdir().expect("a folder");
        let [video, report, table, recorded] =
            ["drawn.avi", "run.jsonl", "run.csv", "run.mcap"].map(|name| folder.path().join(name));
        let named = [("--overlay", &video), ("--json", &report), ("--csv", &table), ("--record", &recorded)];
        let outputs = named.iter().flat_map(|(option, path)| [(*option).to_owned(), path.display().to_string()]);
        let scene = "sim:press?camera=gelsight_mini&grid=fast&hold_s=0.2";
        let words = ["watch".to_owned(), scene.to_owned()].into_iter().chain(outputs);
        let Arguments { watch } = Arguments::try_parse_from(words).expect("valid");
        let watch = Watch { overlay_most_bytes: Some(400_000), ..watch };
        assert_eq!(watch.run().expect("ends"), Outcome::DataLost);
        let lines_count = |path: &Path| fs::read_to_string(path).expect("there").lines().count();
        let judged_count = lines_count(&report) - 1;
        let drawn_count = frames_count(&video);
        assert!(drawn_count > 0 && drawn_count < judged_count, "{drawn_count} of {judged_count}");
        assert!(fs::metadata(&video).expect("there").len() <= 400_000);
        assert_eq!((lines_count(&table) - 1, frames_count(&recorded)), (judged_count, judged_count));
    }
}
