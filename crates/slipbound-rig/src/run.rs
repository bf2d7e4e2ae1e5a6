//! The folder that a closed loop leaves behind.
//!
//! ```text
//!   run.toml             task, controller, source, seed, fingers, all settings, version
//!   reports.jsonl        a cycle a line: what was seen, what was commanded, what was true; exact, for replay
//!   events.jsonl         an event a line: phases, slips, steps of the grip, fingers lost and back, notes, results
//!   slip_003_left.png    what a finger saw when slip 3 began
//!   report.html          all of it to look at, in one file that needs no other
//! ```
//!
//! Every line is flushed as soon as it is written, so a loop that breaks off leaves all but its page.

mod error;
mod event;
mod line;
mod page;

pub use error::Error;
pub use event::{Event, TimedEvent};

use serde::{Deserialize, Serialize};
use slipbound::grip::GripController;
use slipbound::hand::HandReport;
use slipbound::image::Rgb;
use slipbound::plant::PlantTruth;
use slipbound::port::{GripCommand, GripperState, WristCommand, WristState};
use slipbound::task::{Ending, Observation, Phase, Task, TaskStep};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Grows when a reader of the old files could misread the new ones; new keys alone do not count.
pub const FORMAT_VERSION: u32 = 1;

/// What a run is, said once, in `run.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Name of the task.
    pub task: String,
    /// Name of the grip controller.
    pub controller: String,
    /// The scene, or the hardware, as the user named it.
    pub source: String,
    /// What a simulation's chances were drawn from.
    pub seed: u64,
    /// All settings.
    pub settings: toml::Table,
    /// Names of the fingers, in the order of [`HandReport::health`].
    pub fingers: Vec<String>,
}

/// One cycle of the loop, one line of `reports.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cycle {
    /// Time of the loop, ns.
    pub time_ns: u64,
    /// What the fingers said.
    pub hand: HandReport,
    /// What the gripper said.
    pub gripper: GripperState,
    /// What the wrist said.
    pub wrist: WristState,
    /// What the gripper was told.
    pub grip_command: GripCommand,
    /// What the task wanted of the wrist; while there is `trouble` it was paused instead.
    pub wrist_command: WristCommand,
    /// What the task was doing.
    pub phase: Phase,
    /// The slip margin the controller reckoned with, 0 to 1; None for a controller that has none.
    pub margin: Option<f64>,
    /// Alarms of the controller so far.
    pub alarms_count: u32,
    /// What was true, where that is known.
    pub truth: Option<PlantTruth>,
    /// Whether gripper or wrist were in trouble: a lost link, a refusal, a force that does not follow.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub trouble: bool,
}

impl Cycle {
    /// What a task was shown and what it answered, without truth.
    pub fn of(task: &dyn Task, observation: &Observation<'_>, step: &TaskStep) -> Self {
        Cycle {
            time_ns: observation.now_ns,
            hand: *observation.hand,
            gripper: *observation.gripper,
            wrist: *observation.wrist,
            grip_command: step.grip,
            wrist_command: step.wrist,
            phase: step.phase,
            margin: task.grip().margin(),
            alarms_count: task.grip().alarms_count(),
            truth: None,
            trouble: false,
        }
    }
}

/// One line of the table of results.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// Its value with its unit.
    pub value: String,
    /// What it should be; empty where nothing was set.
    pub target: String,
    /// Whether it is what it should be; None where nothing was set.
    pub ok: Option<bool>,
}

/// Writes a run as it goes.
#[derive(Debug)]
pub struct RunFolder {
    folder: PathBuf,
    info: RunInfo,
    reports: Lines,
    events: Lines,
    watch: event::Watch,
    cycles: Vec<Cycle>,
    timed_events: Vec<TimedEvent>,
    pictures: Vec<page::Picture>,
    /// A failure of [`RunFolder::note`], told by the next call that can.
    failure: Option<Error>,
}

impl RunFolder {
    /// Starts a run in a folder that is new or empty; any other is refused. Writes `run.toml`.
    pub fn create(folder: &Path, info: &RunInfo) -> Result<Self, Error> {
        let failed = |source| Error::Write { path: folder.to_owned(), source };
        fs::create_dir_all(folder).map_err(failed)?;
        if let Some(entry) = fs::read_dir(folder).map_err(failed)?.next() {
            let found = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
            return Err(Error::NotEmpty { folder: folder.to_owned(), found });
        }
        let path = folder.join("run.toml");
        let text =
            toml::to_string(&info.table()).map_err(|e| Error::Encode { path: path.clone(), why: e.to_string() })?;
        fs::write(&path, text).map_err(|source| Error::Write { path, source })?;
        Ok(RunFolder {
            folder: folder.to_owned(),
            info: info.clone(),
            reports: Lines::create(folder.join("reports.jsonl"))?,
            events: Lines::create(folder.join("events.jsonl"))?,
            watch: event::Watch::new(info.fingers.clone()),
            cycles: Vec::new(),
            timed_events: Vec::new(),
            pictures: Vec::new(),
            failure: None,
        })
    }

    /// Appends a cycle, and the events that it brings.
    pub fn cycle(&mut self, cycle: &Cycle) -> Result<(), Error> {
        self.check()?;
        let line = line::write(cycle).map_err(|why| Error::Encode { path: self.reports.path.clone(), why })?;
        self.reports.push(&line)?;
        self.cycles.push(cycle.clone());
        for event in self.watch.see(cycle) {
            self.event(cycle.time_ns, event)?;
        }
        Ok(())
    }

    /// How many slips have begun. When a call of [`RunFolder::cycle`] raises it, that is the moment for a
    /// [`RunFolder::picture`] of every finger.
    pub fn slips_count(&self) -> u32 {
        self.watch.slips_count()
    }

    /// Keeps what a finger saw at the slip that began last: as `slip_003_left.png`, and smaller in the page. Before any
    /// slip its number is 0.
    pub fn picture(&mut self, time_ns: u64, finger: &str, caption: &str, rgb: Rgb<'_>) -> Result<(), Error> {
        self.check()?;
        let slip = self.slips_count();
        let name: String = finger.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let stem = format!("slip_{slip:03}_{name}");
        let same_count = self.pictures.iter().filter(|p| p.stem == stem).count();
        let file = match same_count {
            0 => format!("{stem}.png"),
            _ => format!("{stem}_{}.png", same_count + 1),
        };
        let jpeg = page::picture::write(&self.folder.join(&file), rgb)?;
        let (finger, caption) = (finger.to_owned(), caption.to_owned());
        self.event(time_ns, Event::Picture { slip, finger: finger.clone(), file: file.clone() })?;
        self.pictures.push(page::Picture { slip, stem, finger, caption, file, jpeg });
        Ok(())
    }

    /// An event that no cycle shows: a fault put in, a gripper lost. What cannot be written is told by the next call.
    pub fn note(&mut self, time_ns: u64, text: &str) {
        if let Err(error) = self.event(time_ns, Event::Note { text: text.to_owned() }) {
            self.failure.get_or_insert(error);
        }
    }

    /// Writes the results and `report.html`; answers where that is. `ending`: None for a loop that was broken off.
    pub fn finish(mut self, results: &[Row], ending: Option<Ending>) -> Result<PathBuf, Error> {
        self.check()?;
        let time_ns = self.cycles.last().map_or(0, |cycle| cycle.time_ns);
        if let Some(event) = self.watch.end() {
            self.event(time_ns, event)?;
        }
        for row in results {
            self.event(time_ns, Event::Result(row.clone()))?;
        }
        let path = self.folder.join("report.html");
        let html = page::Page {
            info: &self.info,
            cycles: &self.cycles,
            events: &self.timed_events,
            pictures: &self.pictures,
            results,
            ending,
        }
        .to_string();
        fs::write(&path, html).map_err(|source| Error::Write { path: path.clone(), source })?;
        Ok(path)
    }

    fn check(&mut self) -> Result<(), Error> {
        self.failure.take().map_or(Ok(()), Err)
    }

    fn event(&mut self, time_ns: u64, event: Event) -> Result<(), Error> {
        let event = TimedEvent { time_ns, event };
        let line = serde_json::to_string(&event)
            .map_err(|e| Error::Encode { path: self.events.path.clone(), why: e.to_string() })?;
        self.timed_events.push(event);
        self.events.push(&line)
    }
}

impl RunInfo {
    fn table(&self) -> toml::Table {
        // TOML's whole numbers have a sign: a seed beyond them is written as text.
        let seed = i64::try_from(self.seed).map_or_else(|_| self.seed.to_string().into(), toml::Value::Integer);
        let mut table = toml::Table::new();
        table.insert("format".into(), "slipbound-run".into());
        table.insert("format_version".into(), i64::from(FORMAT_VERSION).into());
        table.insert("software_version".into(), env!("CARGO_PKG_VERSION").into());
        table.insert("task".into(), self.task.clone().into());
        table.insert("controller".into(), self.controller.clone().into());
        table.insert("source".into(), self.source.clone().into());
        table.insert("seed".into(), seed);
        table.insert("fingers".into(), self.fingers.clone().into());
        table.insert("settings".into(), self.settings.clone().into());
        table
    }
}

/// Reads a run again: `run.toml`, and every cycle bit for bit. A last line that broke off while it was written is no
/// cycle; any other that cannot be read is an error.
pub fn read(folder: &Path) -> Result<(toml::Table, Vec<Cycle>), Error> {
    let text = |path: &Path| fs::read_to_string(path).map_err(|source| Error::Read { path: path.to_owned(), source });
    let path = folder.join("run.toml");
    let table = text(&path)?.parse().map_err(|e: toml::de::Error| Error::Syntax { path, problem: e.to_string() })?;
    let path = folder.join("reports.jsonl");
    let reports = text(&path)?;
    let whole = reports.rfind('\n').map_or("", |end| &reports[..end]);
    let cycle = |(i, line)| {
        line::read(line)
            .map_err(|problem| Error::Syntax { path: path.clone(), problem: format!("line {}: {problem}", i + 1) })
    };
    let cycles = whole.lines().enumerate().map(cycle).collect::<Result<_, Error>>()?;
    Ok((table, cycles))
}

/// A file that grows by lines.
#[derive(Debug)]
struct Lines {
    path: PathBuf,
    file: File,
}

impl Lines {
    fn create(path: PathBuf) -> Result<Self, Error> {
        match File::create(&path) {
            Ok(file) => Ok(Lines { path, file }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// One write a line: not buffered, so nothing is lost when the loop breaks off.
    fn push(&mut self, line: &str) -> Result<(), Error> {
        let written = self.file.write_all(format!("{line}\n").as_bytes());
        written.map_err(|source| Error::Write { path: self.path.clone(), source })
    }
}
