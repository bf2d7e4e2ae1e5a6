//! Writes a run folder as the loop goes, and reads it again.

use super::error::Error;
use super::event::{Event, EventLog, TimedEvent};
use super::info::{FORMAT_VERSION, Row, RunInfo};
use super::line;
use super::page::{Page, Picture, picture};
use super::page_data::PageData;
use crate::config::hand::finger_name;
use crate::config::read_most;
use crate::line_file::LineFile;
use slipbound::control::Cycle;
use slipbound::image::Rgb;
use slipbound::monitor::SlipReport;
use slipbound::task::Ending;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder of this name, or with the next number that is free: `run`, `run-2`, `run-3`, ...
pub fn free_folder(name: &str) -> PathBuf {
    let names = std::iter::once(name.to_owned()).chain((2..).map(|n| format!("{name}-{n}")));
    names.map(PathBuf::from).find(|folder| !folder.exists()).unwrap_or_else(|| name.into())
}

/// Refuses a folder that is not empty, in which no run can begin; creates none.
pub fn refuse_used_folder(folder: &Path) -> Result<(), Error> {
    match fs::read_dir(folder).ok().and_then(|mut entries| entries.next()) {
        Some(Ok(entry)) => {
            let found = entry.file_name().to_string_lossy().into_owned();
            Err(Error::NotEmpty { folder: folder.to_owned(), found })
        }
        // Any other problem is reported when it is created.
        Some(Err(_)) | None => Ok(()),
    }
}

/// Creates a missing folder; refuses one that is not empty.
pub(crate) fn prepare_folder(folder: &Path) -> Result<(), Error> {
    let failed = |source| Error::Write { path: folder.to_owned(), source };
    fs::create_dir_all(folder).map_err(failed)?;
    match fs::read_dir(folder).map_err(failed)?.next() {
        None => Ok(()),
        Some(entry) => {
            let found = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
            Err(Error::NotEmpty { folder: folder.to_owned(), found })
        }
    }
}

/// Writes a run as it goes.
#[derive(Debug)]
pub struct RunFolder {
    folder: PathBuf,
    info: RunInfo,
    reports: Lines,
    events: Lines,
    log: EventLog,
    /// For the page.
    page_data: PageData,
    /// Names of the images of the last slip, without their extensions.
    stems: Vec<String>,
    /// Time of the last event, ns.
    last_event_ns: u64,
}

impl RunFolder {
    /// Starts a run in a folder that is new or empty; fails for any other. Writes `run.toml`.
    pub fn create(folder: &Path, info: &RunInfo) -> Result<Self, Error> {
        info.fingers.iter().try_for_each(|finger| refuse_finger_name(folder, &finger.name))?;
        prepare_folder(folder)?;
        write_toml(folder.join("run.toml"), info.to_toml())?;
        for finger in &info.fingers {
            write_toml(folder.join(finger.sensor_file()), toml::to_string(&finger.sensor))?;
            let rest = finger.rest_file().map_err(|e| Error::Encode { path: folder.to_owned(), why: e.to_string() })?;
            if let Some((name, bytes)) = rest {
                write_whole(&folder.join(name), &bytes)?;
            }
        }
        Ok(RunFolder {
            folder: folder.to_owned(),
            info: info.clone(),
            reports: Lines::create(folder.join("reports.jsonl"))?,
            events: Lines::create(folder.join("events.jsonl"))?,
            log: EventLog::new(info),
            page_data: PageData::new(),
            stems: Vec::new(),
            last_event_ns: 0,
        })
    }

    /// Appends a cycle and its events.
    pub fn cycle(&mut self, cycle: &Cycle) -> Result<(), Error> {
        self.cycle_with_reports(cycle, &[])
    }

    /// The same with the report of each finger in this cycle: the page shows their slip in marker pitches, and the event
    /// of a slip names the fingers that show it.
    pub fn cycle_with_reports(&mut self, cycle: &Cycle, reports: &[Option<&SlipReport>]) -> Result<(), Error> {
        let moved = reports.iter().flatten().filter(|report| report.motion.is_some());
        let slip_pitch = moved.map(|report| report.slip.max_pitch).reduce(f64::max);
        let line = line::write(cycle).map_err(|why| Error::Encode { path: self.reports.path.clone(), why })?;
        self.reports.push(&line)?;
        self.page_data.cycle(cycle, slip_pitch);
        for event in self.log.see(cycle, reports) {
            self.event(cycle.time_ns, event)?;
        }
        Ok(())
    }

    /// Number of slips that have begun. When a call of [`RunFolder::cycle`] raises it, call [`RunFolder::picture`] for
    /// every finger.
    pub fn slips_count(&self) -> u32 {
        self.log.slips_count()
    }

    /// Saves the image of a finger at the latest slip: as `slip_003_left.png`, and smaller in the page. Before any slip
    /// its number is 0.
    pub fn picture(&mut self, time_ns: u64, finger: &str, caption: &str, rgb: Rgb<'_>) -> Result<(), Error> {
        refuse_finger_name(&self.folder, finger)?;
        let slip = self.slips_count();
        let of_slip = format!("slip_{slip:03}_");
        let stem = format!("{of_slip}{finger}");
        self.stems.retain(|other| other.starts_with(&of_slip));
        let file = match self.stems.iter().filter(|other| **other == stem).count() {
            0 => format!("{stem}.png"),
            same_count => format!("{stem}_{}.png", same_count + 1),
        };
        let jpeg = picture::write(&self.folder.join(&file), rgb)?;
        let (finger, caption) = (finger.to_owned(), caption.to_owned());
        self.event(time_ns, Event::Picture { slip, finger: finger.clone(), file: file.clone() })?;
        self.stems.push(stem);
        self.page_data.picture(Picture { slip, finger, caption, file, jpeg });
        Ok(())
    }

    /// Appends a note that does not follow from a cycle, for example an injected fault or a lost gripper.
    pub fn note(&mut self, time_ns: u64, text: &str) -> Result<(), Error> {
        self.event(time_ns, Event::Note { text: text.to_owned() })
    }

    /// No cycle is to follow: ends a slip still in progress. Notes of what comes after the last cycle belong behind it.
    pub fn end_cycles(&mut self) -> Result<(), Error> {
        let event = self.log.end();
        event.map_or(Ok(()), |event| self.event(self.page_data.last_ns(), event))
    }

    /// Writes the results and `report.html`; returns its path. `ending`: None for a loop that was interrupted.
    pub fn finish(mut self, results: &[Row], ending: Option<Ending>) -> Result<PathBuf, Error> {
        self.end_cycles()?;
        let time_ns = self.page_data.last_ns().max(self.last_event_ns);
        for row in results {
            self.event(time_ns, Event::Result(row.clone()))?;
        }
        let path = self.folder.join("report.html");
        let ((cycles, slips_pitch), (events, left_out)) = (self.page_data.cycles(), self.page_data.events());
        let html = Page {
            info: &self.info,
            cycles: &cycles,
            slips_pitch: &slips_pitch,
            ended_ns: self.page_data.ended_ns,
            events: &events,
            left_out,
            slips_count: self.log.slips_count(),
            pictures: &self.page_data.pictures,
            results,
            ending,
        }
        .to_string();
        write_whole(&path, html.as_bytes())?;
        Ok(path)
    }

    fn event(&mut self, time_ns: u64, event: Event) -> Result<(), Error> {
        let event = TimedEvent { time_ns, event };
        self.last_event_ns = time_ns;
        let line = serde_json::to_string(&event)
            .map_err(|e| Error::Encode { path: self.events.path.clone(), why: e.to_string() })?;
        self.page_data.event(event);
        self.events.push(&line)
    }
}

/// Refuses a finger whose files would not be in the folder under its name.
pub(super) fn refuse_finger_name(folder: &Path, name: &str) -> Result<(), Error> {
    finger_name(name).map(drop).map_err(|source| Error::FingerName { folder: folder.to_owned(), source })
}

/// Writes a file, or leaves none.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(path, bytes).map_err(|source| {
        let _ = fs::remove_file(path); // if this fails too, the first failure is reported
        Error::Write { path: path.to_owned(), source }
    })
}

fn write_toml(path: PathBuf, text: Result<String, toml::ser::Error>) -> Result<(), Error> {
    let text = text.map_err(|e| Error::Encode { path: path.clone(), why: e.to_string() })?;
    fs::write(&path, text).map_err(|source| Error::Write { path, source })
}

/// Reads a run: `run.toml`, and every cycle bit for bit. An incomplete last line is ignored; any other unreadable line
/// is an error.
pub fn read(folder: &Path) -> Result<(toml::Table, Vec<Cycle>), Error> {
    let text = |path: &Path| fs::read_to_string(path).map_err(|source| Error::Read { path: path.to_owned(), source });
    let path = folder.join("run.toml");
    let table: toml::Table = read_most(&path)
        .map_err(|source| Error::Read { path: path.clone(), source })?
        .parse()
        .map_err(|e: toml::de::Error| Error::Syntax { path: path.clone(), problem: e.to_string() })?;
    let version = table.get("format_version").and_then(toml::Value::as_integer);
    if version != Some(i64::from(FORMAT_VERSION)) {
        let got = version.map_or("none".into(), |version| version.to_string());
        let problem = format!("format_version: expected {FORMAT_VERSION}, got {got}");
        return Err(Error::Syntax { path, problem });
    }
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
pub(super) struct Lines {
    path: PathBuf,
    to: LineFile,
}

impl Lines {
    pub(super) fn create(path: PathBuf) -> Result<Self, Error> {
        match LineFile::create(&path) {
            Ok(to) => Ok(Lines { path, to }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// One write per line, so that nothing is lost when the loop is interrupted.
    pub(super) fn push(&mut self, line: &str) -> Result<(), Error> {
        writeln!(self.to, "{line}").map_err(|source| Error::Write { path: self.path.clone(), source })
    }
}
