//! The folder of a sweep: its description, its records so far, and finally its tables.
//!
//! ```text
//!   sweep.json     protocol, seed, number of trials, version, detectors; of a shard, which one it is
//!   trials.jsonl   a record a line, in the order of the trials
//!   table.md, table.json, report.html
//! ```

use super::error::{FolderError, SweepError};
use super::record::{KEYS, TrialRecord};
use super::shard::Shard;
use super::table::Sweep;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Largest number of trials of a sweep.
pub const TRIALS_MOST: u64 = 10_000_000;

/// Contents of sweep.json.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    format: String,
    sweep: Sweep,
    detectors: Vec<String>,
    shard: Shard,
}

const FORMAT: &str = "slipbound-eval-1";

impl SweepFile {
    /// Refuses what no sweep can have; `path` is its file.
    fn check(&self, path: &Path) -> Result<(), FolderError> {
        let refuse = |key: &str, expected: String, got: String| {
            Err(FolderError::Value { path: path.to_owned(), key: key.into(), expected, got })
        };
        let is_twice = |(n, name): (usize, &String)| self.detectors[..n].contains(name);
        if self.detectors.is_empty() || self.detectors.iter().enumerate().any(is_twice) {
            return refuse("detectors", "one or more, each once".into(), format!("`{}`", self.detectors.join(", ")));
        }
        if !(1..=TRIALS_MOST).contains(&self.sweep.trials_count) {
            return refuse("sweep.trials_count", format!("1 to {TRIALS_MOST}"), self.sweep.trials_count.to_string());
        }
        match (1..=self.shard.of).contains(&self.shard.number) {
            true => Ok(()),
            false => refuse("shard", "I/N with I from 1 to N".into(), self.shard.to_string()),
        }
    }
}

/// The first file exists as soon as a sweep has begun; the others may remain from a sweep that was killed before.
pub(super) const SWEEP_FILE: &str = "sweep.json";
const BEFORE_IT: [&str; 2] = ["trials.jsonl", "sweep.json.unfinished"];

fn file(path: &Path) -> impl FnOnce(io::Error) -> FolderError + '_ {
    move |source| FolderError::Write { path: path.to_owned(), source }
}

fn unread(path: &Path) -> impl FnOnce(io::Error) -> FolderError + '_ {
    move |source| FolderError::Read { path: path.to_owned(), source }
}

/// Refuses a non-empty folder without the file `mark`, which identifies the folder as ours; names in `before_it` may
/// exist without it. Creates no folder.
pub fn refuse_used(folder: &Path, mark: &str, before_it: &[&str]) -> Result<(), FolderError> {
    // Other errors are reported when the folder is created.
    let names = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let found = names.map(|name| name.to_string_lossy().into_owned()).find(|name| !before_it.contains(&name.as_str()));
    match found.filter(|_| !folder.join(mark).exists()) {
        None => Ok(()),
        Some(found) => Err(FolderError::NotEmpty { folder: folder.to_owned(), expected: mark.to_owned(), found }),
    }
}

/// The folder of a sweep or of a shard of one.
#[derive(Debug)]
pub struct SweepFolder {
    path: PathBuf,
    about: SweepFile,
    records: Vec<TrialRecord>,
    lines: File,
}

impl SweepFolder {
    /// Creates a folder, or continues one of the same sweep: its complete trials are kept unchanged, an incomplete line
    /// or trial at the end is cut off. Refuses a folder of something else, records of an unknown sweep, and a list of
    /// detectors that is empty or has duplicates.
    pub fn open(path: &Path, sweep: &Sweep, detectors: &[&str], shard: Shard) -> Result<Self, FolderError> {
        let detectors = detectors.iter().map(|&name| name.to_owned()).collect();
        let about = SweepFile { format: FORMAT.into(), sweep: sweep.clone(), detectors, shard };
        let about_path = path.join(SWEEP_FILE);
        about.check(&about_path)?;
        refuse_used(path, SWEEP_FILE, &BEFORE_IT)?;
        fs::create_dir_all(path).map_err(file(path))?;
        let lines_path = path.join("trials.jsonl");
        // Locked until the folder is dropped; the lock of a killed program is released with it.
        let lines =
            OpenOptions::new().create(true).read(true).append(true).open(&lines_path).map_err(file(&lines_path))?;
        match lines.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(FolderError::Busy { path: path.to_owned() }),
            // A file system without locks: two writers at once are then not detected.
            Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(e)) => return Err(file(&lines_path)(e)),
        }
        let length = lines.metadata().map_err(file(&lines_path))?.len();
        let records = if about_path.exists() {
            check_same(&about_path, &about, &read_about(&about_path)?, true)?;
            let (records, end) = whole_trials(&lines_path, &about)?;
            if end < length {
                lines.set_len(end).map_err(file(&lines_path))?;
            }
            records
        } else if length > 0 {
            return Err(FolderError::Value {
                path: about_path,
                key: "sweep.json".into(),
                expected: "the one beside trials.jsonl, or a folder without records".into(),
                got: "records of an unknown sweep".into(),
            });
        } else {
            write_json(&about_path, &about)?;
            Vec::new()
        };
        Ok(SweepFolder { path: path.to_owned(), about, records, lines })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The sweep.
    pub fn sweep(&self) -> &Sweep {
        &self.about.sweep
    }

    /// Which part of the sweep it holds.
    pub fn shard(&self) -> Shard {
        self.about.shard
    }

    /// All records so far, in the order of the trials.
    pub fn records(&self) -> &[TrialRecord] {
        &self.records
    }

    /// Numbers of the trials without records.
    pub fn missing(&self) -> Vec<u64> {
        let done: BTreeSet<u64> = self.records.iter().map(|record| record.number).collect();
        let all = self.about.shard.numbers(self.about.sweep.trials_count);
        all.filter(|number| !done.contains(number)).collect()
    }

    /// Appends the records of a trial and flushes them.
    pub fn keep(&mut self, records: Vec<TrialRecord>) -> Result<(), SweepError> {
        let mut text = Vec::new();
        let path = self.path.join("trials.jsonl");
        records.iter().try_for_each(|record| write_line(&mut text, record)).map_err(file(&path))?;
        self.lines.write_all(&text).and_then(|()| self.lines.flush()).map_err(file(&path))?;
        self.records.extend(records);
        Ok(())
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let path = self.path.join(name);
        fs::write(&path, bytes).map_err(file(&path))
    }

    /// The sweep of a folder.
    pub fn sweep_of(path: &Path) -> Result<Sweep, FolderError> {
        Ok(read_about(&path.join("sweep.json"))?.sweep)
    }

    /// One folder from the shards of a sweep. All shards must belong to the same sweep, be complete, and together cover
    /// it.
    pub fn merge(shards: &[PathBuf], into: &Path) -> Result<Self, FolderError> {
        let value = |path: &Path, key: &str, expected: String, got: String| FolderError::Value {
            path: path.to_owned(),
            key: key.into(),
            expected,
            got,
        };
        let mut first: Option<(PathBuf, SweepFile)> = None;
        let mut trials: BTreeMap<u64, Vec<TrialRecord>> = BTreeMap::new();
        for folder in shards {
            let (about_path, lines_path) = (folder.join("sweep.json"), folder.join("trials.jsonl"));
            let about = read_about(&about_path)?;
            if let Some((_, first)) = &first {
                check_same(&about_path, first, &about, false)?;
            }
            for records in by_trial(whole_trials(&lines_path, &about)?.0) {
                let number = records[0].number;
                match trials.get(&number) {
                    Some(before) if *before != records => {
                        let key = format!("trial {number}");
                        return Err(value(
                            &lines_path,
                            &key,
                            "what another folder says of it".into(),
                            "something else".into(),
                        ));
                    }
                    _ => trials.insert(number, records),
                };
            }
            first.get_or_insert((about_path, about));
        }
        let Some((first_path, about)) = first else {
            return Err(value(into, "merge", "one folder or more".into(), "none".into()));
        };
        let missing: Vec<u64> = (0..about.sweep.trials_count).filter(|number| !trials.contains_key(number)).collect();
        if !missing.is_empty() {
            let names: Vec<String> = missing.iter().take(10).map(u64::to_string).collect();
            let more = if missing.len() > 10 { ", ..." } else { "" };
            return Err(value(
                &first_path,
                "trials",
                format!("all {} in the folders together", about.sweep.trials_count),
                format!("none of {}{more} ({} missing)", names.join(", "), missing.len()),
            ));
        }
        let detectors: Vec<&str> = about.detectors.iter().map(String::as_str).collect();
        let mut merged = SweepFolder::open(into, &about.sweep, &detectors, Shard::WHOLE)?;
        let done: BTreeSet<u64> = merged.records.iter().map(|record| record.number).collect();
        if !done.is_empty() {
            return Err(value(into, "trials.jsonl", "a new folder".into(), format!("{} trials in it", done.len())));
        }
        for records in trials.into_values() {
            merged.keep(records).map_err(|error| match error {
                SweepError::Folder(error) => error,
                other => value(into, "trials.jsonl", "records that can be written".into(), other.to_string()),
            })?;
        }
        Ok(merged)
    }
}

fn write_line(to: &mut Vec<u8>, record: &TrialRecord) -> io::Result<()> {
    to.extend(record.line().map_err(io::Error::other)?.as_bytes());
    to.push(b'\n');
    Ok(())
}

/// Writes a file atomically: whenever the program is killed, the file is complete or absent.
fn write_json(path: &Path, value: &impl Serialize) -> Result<(), FolderError> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|error| file(path)(error.into()))?;
    text.push(b'\n');
    let unfinished = path.with_extension("json.unfinished");
    let written = File::create(&unfinished).and_then(|mut to| to.write_all(&text).and_then(|()| to.sync_all()));
    written.and_then(|()| fs::rename(&unfinished, path)).map_err(file(path))
}

fn read_about(path: &Path) -> Result<SweepFile, FolderError> {
    let text = fs::read_to_string(path).map_err(unread(path))?;
    let about: SweepFile = serde_json::from_str(&text).map_err(|error| FolderError::Value {
        path: path.to_owned(),
        key: "sweep.json".into(),
        expected: "what `slipbound eval` writes".into(),
        got: error.to_string(),
    })?;
    about.check(path)?;
    Ok(about)
}

/// Refuses another sweep than the expected one; reports the first key that differs.
fn check_same(path: &Path, expected: &SweepFile, got: &SweepFile, shard_too: bool) -> Result<(), FolderError> {
    let settings = |sweep: &Sweep| format!("{:?}", sweep.settings);
    let keys = |about: &SweepFile| {
        let sweep = &about.sweep;
        [
            ("format", about.format.clone()),
            ("sweep.protocol", sweep.protocol.clone()),
            ("sweep.seed", sweep.seed.to_string()),
            ("sweep.trials_count", sweep.trials_count.to_string()),
            ("sweep.software_version", sweep.software_version.clone()),
            ("sweep.settings", settings(sweep)),
            ("detectors", about.detectors.join(", ")),
            ("shard", if shard_too { about.shard.to_string() } else { String::new() }),
        ]
    };
    for ((key, expected), (_, got)) in keys(expected).into_iter().zip(keys(got)) {
        if expected != got {
            return Err(FolderError::Value { path: path.to_owned(), key: key.into(), expected, got });
        }
    }
    Ok(())
}

/// Records in groups, one per trial.
fn by_trial(records: Vec<TrialRecord>) -> Vec<Vec<TrialRecord>> {
    let mut trials: Vec<Vec<TrialRecord>> = Vec::new();
    for record in records {
        match trials.last_mut().filter(|trial| trial[0].number == record.number) {
            Some(trial) => trial.push(record),
            None => trials.push(vec![record]),
        }
    }
    trials
}

/// The records of complete trials, and the offset of their end, in bytes. An incomplete last line or trial is left out;
/// any other defect is an error, a missing trial before others too: what is judged is appended, so the records would no
/// longer be in the order of the trials.
fn whole_trials(path: &Path, about: &SweepFile) -> Result<(Vec<TrialRecord>, u64), FolderError> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok((Vec::new(), 0)),
        Err(error) => return Err(unread(path)(error)),
    };
    let broken = |n: usize, expected: String, got: String| FolderError::Value {
        path: path.to_owned(),
        key: format!("line {}", n + 1),
        expected,
        got,
    };
    let (mut records, mut end, mut whole_count, mut whole_end) = (Vec::<TrialRecord>::new(), 0, 0, 0);
    let mut numbers = about.shard.numbers(about.sweep.trials_count);
    for (n, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
        end += line.len() as u64;
        let Some(line) = line.strip_suffix(b"\n") else { break };
        let record = std::str::from_utf8(line).map_err(|error| error.to_string());
        let record = record.and_then(|line| TrialRecord::parse(line).map_err(|error| error.source.to_string()));
        let keys = || format!("a record with the keys {}", KEYS.join(", "));
        let record = record.map_err(|error| broken(n, keys(), error))?;
        let due = &about.detectors[records.len() - whole_count];
        let number = records.get(whole_count).map_or(record.number, |first| first.number);
        if (record.number, &record.detector) != (number, due) {
            let got = format!("{} on {}", record.detector, record.number);
            return Err(broken(n, format!("the record of {due} on trial {number}"), got));
        }
        if records.len() == whole_count {
            let due = numbers.next();
            if due != Some(number) {
                let (shard, trials_count) = (about.shard, about.sweep.trials_count);
                let end = || format!("the end, after all trials of shard {shard} of {trials_count}");
                let expected = due.map_or_else(end, |due| format!("trial {due}"));
                return Err(broken(n, expected, format!("trial {number}")));
            }
        }
        records.push(record);
        if records.len() - whole_count == about.detectors.len() {
            (whole_count, whole_end) = (records.len(), end);
        }
    }
    records.truncate(whole_count);
    Ok((records, whole_end))
}
