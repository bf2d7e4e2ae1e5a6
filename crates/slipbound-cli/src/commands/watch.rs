//! `slipbound watch`: judge every frame of a recording or a simulated scene.
//!
//! ```text
//!   SOURCE --read ahead--> rest --> monitor --step--> report --> JSON, overlay, timings, lines, summary
//! ```

mod args;
mod outputs;
mod overwriting;
mod rest;

pub use args::Watch;

use super::recording;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use outputs::Outputs;
use slipbound::events::SlipEvents;
use slipbound::image::SizePx;
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor;
use slipbound_rig::report_summary::{ReportSummary, torn};
use slipbound_rig::source::ReadAhead;
use slipbound_rig::{config, sensors};
use std::sync::atomic::Ordering;

/// An overlay video of a recording without times is played at this rate.
const OVERLAY_RATE_HZ: u32 = 10;

/// What follows from markers that do not stand the sensor's pitch apart.
const UNJUDGED: &str = "no frame is judged until the sensor file fits, or the settings say rest.check_spacing = false";

impl Watch {
    /// Judges the recording from its first frame to its last.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = match &self.settings {
            Some(file) => config::load_settings(file).map_err(Failure::arguments)?,
            None => Settings::default(),
        };
        let sensor = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        let mut recording = recording::open(&self.source)?;
        overwriting::refuse(self)?;
        let mut terminal = Terminal::with_bar(recording.frames_count(), self.json_on_stdout());

        let found = rest::find(self, &mut recording, &settings, |size| self.sensor_for(size, sensor.as_ref()))?;
        found.notes.iter().for_each(|note| terminal.note(note));
        let mut monitor = SlipMonitor::new(&found.sensor, &settings, found.rest).map_err(Failure::arguments)?;
        let doubt = monitor.refusal().map(|reason| format!("{reason}; {UNJUDGED}"));
        doubt.iter().for_each(|doubt| terminal.note(&format!("{}: {doubt}", self.source)));
        let notes: Vec<String> = found.report_note.into_iter().chain(doubt).collect();
        let origin = outputs::Origin {
            clock: recording.clock(),
            rest: found.origin,
            note: (!notes.is_empty()).then(|| notes.join("; ")),
            rate_hz: recording.rate_hz().unwrap_or(OVERLAY_RATE_HZ),
        };
        let mut outputs = Outputs::open(self, origin, &monitor)?;

        let mut summary = ReportSummary::new();
        let ended = self.judge(&mut recording, &mut monitor, &mut outputs, &mut summary, &mut terminal);
        terminal.clear_bar();
        if matches!(ended, Err(Failure::ReaderLeft)) {
            return ended.map(|()| Outcome::Done);
        }
        let closed = outputs.close();
        for line in summary.lines() {
            terminal.say(&line)?;
        }
        ended.and(closed)?;
        Ok(if summary.torn_count() > 0 { Outcome::DataLost } else { Outcome::Done })
    }

    /// The loop: a frame in, its report out to every output.
    fn judge(
        &self,
        recording: &mut ReadAhead,
        monitor: &mut SlipMonitor,
        outputs: &mut Outputs,
        summary: &mut ReportSummary,
        terminal: &mut Terminal,
    ) -> Result<(), Failure> {
        let interrupted = interruption::listen()?;
        let mut events = SlipEvents::new();
        let mut buffer = FrameBuffer::default();
        loop {
            let next = recording.next(&mut buffer);
            if interrupted.load(Ordering::Relaxed) {
                let frames_count = summary.frames_count();
                return Err(anyhow!("interrupted after {frames_count} frames; what was judged is kept").into());
            }
            outputs.stopwatch.restart();
            let mut torn_why = None;
            let report = match next? {
                Next::Silent => continue,
                Next::Frame => {
                    let frame = buffer.frame().map_err(|e| Failure::work(&self.source, e))?;
                    monitor.step_probed(&frame, None, &mut outputs.stopwatch)
                }
                Next::Torn { reason } => {
                    terminal.note(&format!("{}: {}", self.source, torn(&buffer, &reason)));
                    torn_why = Some(reason);
                    monitor.torn(buffer.seq, buffer.time_ns)
                }
                Next::End => {
                    return match events.end() {
                        Some(event) => terminal.say(&summary.event(&event)),
                        None => Ok(()),
                    };
                }
            };
            outputs.write(&buffer, &report, monitor)?;
            summary.see(&report, &buffer, torn_why.as_deref());
            for event in events.see(&report) {
                terminal.say(&summary.event(&event))?;
            }
            terminal.advance();
        }
    }

    /// The finger asked for, or the only built-in one whose frames have just this size.
    fn sensor_for(&self, frames: SizePx, asked: Option<&Sensor>) -> Result<(Sensor, Option<String>), Failure> {
        if let Some(sensor) = asked {
            return Ok((sensor.clone(), None));
        }
        if let Some(sensor) = recording::simulated_sensor(&self.source)? {
            return Ok((sensor, None));
        }
        match sensors::of_frames(frames).map_err(Failure::arguments)?.as_slice() {
            [only] => {
                let note = format!("no --sensor given: took {} for its frames of {frames}", only.name);
                Ok((only.clone(), Some(note)))
            }
            several => {
                let source = &self.source;
                let names: Vec<&str> = several.iter().map(|s| s.name.as_str()).collect();
                Err(Failure::Arguments(match names.is_empty() {
                    true => anyhow!(
                        "{source}: no built-in finger has frames of {frames}: expected --sensor, got none \
                         (`slipbound sensors` lists the built-in fingers; your own is a FILE.toml)"
                    ),
                    false => anyhow!(
                        "{source}: more than one built-in finger has frames of {frames}: expected --sensor with one \
                         of {}, got none (`slipbound sensors` tells them apart)",
                        names.join(", ")
                    ),
                }))
            }
        }
    }
}
