//! `slipbound watch`: judge every frame of a recording or a simulated scene.
//!
//! ```text
//!   SOURCE --read ahead--> rest --> monitor --step--> report --> JSON, overlay, timings, lines, summary
//! ```

mod outputs;
mod overwriting;
pub(super) mod recording;
mod rest;
pub(super) mod simulation;
mod summary;
mod timings;

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use outputs::Outputs;
use recording::{Arrived, Recording};
use rest::RestArgument;
use slipbound::events::SlipEvents;
use slipbound::image::SizePx;
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::sensor::Sensor;
use slipbound_rig::{config, sensors, source};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use summary::Summary;

/// An overlay video of a recording without times is played at this rate.
const OVERLAY_RATE_HZ: u32 = 10;

/// What follows from markers that do not stand the sensor's pitch apart.
const UNJUDGED: &str = "no frame is judged until the sensor file fits, or the settings say rest.check_spacing = false";

/// The arguments of `slipbound watch`.
#[derive(Debug, clap::Args)]
pub struct Watch {
    /// An image folder, a quoted pattern ('run/*.png'), an image, a video file, or a scene to simulate:
    /// 'sim:SCENE?seed=3&force_n=20' (see `slipbound scenes`)
    source: String,
    /// The finger: a built-in name (see `slipbound sensors`) or a sensor file [default: that of the
    /// scene, else by the size of the frames]
    #[arg(long, value_name = "NAME|FILE.toml")]
    sensor: Option<String>,
    /// The finger at rest: an image, or frames A up to but not B of SOURCE [default: found among the first frames]
    #[arg(long, value_name = "IMAGE|A..B", value_parser = RestArgument::parse)]
    rest: Option<RestArgument>,
    /// Write a report of one JSON object a line; `-` is standard output
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Put the displacement and slip of every marker into the report
    #[arg(long, requires = "json")]
    markers: bool,
    /// Draw every frame with what was found on it: PNG pictures in a folder, or a video
    #[arg(long, value_name = "FOLDER|FILE.avi")]
    overlay: Option<PathBuf>,
    /// Settings that replace the defaults; `paper` stands for the paper as written
    #[arg(long, value_name = "FILE.toml|paper")]
    settings: Option<String>,
    /// Write how many microseconds each step took, one JSON object a line
    #[arg(long, value_name = "FILE")]
    timings: Option<PathBuf>,
    /// What the finger is called in the report
    #[arg(long, value_name = "NAME", default_value = "finger")]
    finger: String,
}

impl Watch {
    /// Judges the recording from its first frame to its last.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = match &self.settings {
            Some(file) => config::load_settings(file).map_err(Failure::arguments)?,
            None => Settings::default(),
        };
        let sensor = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        let mut recording = self.open()?;
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

        let mut summary = Summary::new();
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

    /// The loop: a frame in, its report out to everyone who wants it.
    fn judge(
        &self,
        recording: &mut Recording,
        monitor: &mut SlipMonitor,
        outputs: &mut Outputs,
        summary: &mut Summary,
        terminal: &mut Terminal,
    ) -> Result<(), Failure> {
        let interrupted = interruption::listen()?;
        let mut events = SlipEvents::new();
        loop {
            let arrived = recording.next();
            if interrupted.load(Ordering::Relaxed) {
                let frames_count = summary.frames_count();
                return Err(anyhow!("interrupted after {frames_count} frames; what was judged is kept").into());
            }
            let frame = recording.frame();
            outputs.stopwatch.restart();
            let mut torn = None;
            let report = match arrived? {
                Arrived::Whole => {
                    let frame = frame.frame().map_err(|e| Failure::work(&self.source, e))?;
                    monitor.step_probed(&frame, None, &mut outputs.stopwatch)
                }
                Arrived::Torn(reason) => {
                    terminal.note(&format!("{}: {}", self.source, summary::torn(frame, &reason)));
                    torn = Some(reason);
                    monitor.torn(frame.seq, frame.time_ns)
                }
                Arrived::Over => {
                    return match events.end() {
                        Some(event) => terminal.say(&summary.event(&event)),
                        None => Ok(()),
                    };
                }
            };
            outputs.write(frame, &report, monitor)?;
            summary.see(&report, frame, torn.as_deref());
            for event in events.see(&report) {
                terminal.say(&summary.event(&event))?;
            }
            terminal.advance();
        }
    }

    /// Opens the source, for a second time if need be.
    fn open(&self) -> Result<Recording, Failure> {
        if let Some(scene) = simulation::scene(&self.source) {
            return simulation::open(scene).map(Recording::new);
        }
        source::open(&self.source).map(Recording::new).map_err(|e| match e {
            source::Error::Missing { .. } | source::Error::Pattern { .. } | source::Error::NoImages { .. } => {
                Failure::arguments(e)
            }
            other => Failure::Work(other.into()),
        })
    }

    /// The finger asked for, or the only built-in one whose frames have just this size.
    fn sensor_for(&self, frames: SizePx, asked: Option<&Sensor>) -> Result<(Sensor, Option<String>), Failure> {
        if let Some(sensor) = asked {
            return Ok((sensor.clone(), None));
        }
        if let Some(scene) = simulation::scene(&self.source) {
            return simulation::sensor(scene).map(|sensor| (sensor, None));
        }
        let mut fitting = Vec::new();
        for name in sensors::names() {
            let sensor = sensors::load(name).map_err(Failure::arguments)?;
            if sensor.image_px == frames {
                fitting.push(sensor);
            }
        }
        match fitting.as_slice() {
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

    fn json_on_stdout(&self) -> bool {
        self.json.as_ref().is_some_and(|path| path.as_os_str() == "-")
    }
}
