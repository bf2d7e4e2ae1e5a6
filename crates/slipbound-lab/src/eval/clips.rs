//! Recorded clips in folders, with labels, and the results of every detector on their frames.
//!
//! ```text
//!   FOLDER/clip/...     --frames--> monitor (ours, the paper's) --> detectors --> Seen
//!   FOLDER/labels.csv   --truth, for scoring alone-----------------------------> tables
//! ```

use crate::eval::digest::Digest;
use crate::eval::error::EvalError;
use crate::eval::record::{TrialRecord, UNJUDGED};
use crate::rivals::{Detector, Entry, Inputs};
use slipbound::finger_pipeline::{RecordingMonitor, RestFinder};
use slipbound::monitor::{
    EvidenceReport, EvidenceSettings, Rest, RestBuilder, RestError, RestKind, SlipMonitor, SlipState,
};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};
use slipbound::sensor::Sensor;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Opens a recording by its path.
pub type OpenSource = fn(&str) -> Result<Box<dyn FrameSource + Send>, SourceError>;

/// Why a folder of clips cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ClipsError {
    /// The folder cannot be read.
    #[error("{path}: expected a folder of clips")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// There are no folders in it.
    #[error("{path}: expected folders with clips, got none")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// The name of a clip is not text.
    #[error("{path:?}: expected the name of a clip in UTF-8")]
    Name {
        /// The folder of the clip.
        path: PathBuf,
    },
    /// labels.csv cannot be read.
    #[error("{path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// labels.csv is not as expected.
    #[error("{path}: {problem}")]
    Labels {
        /// The file.
        path: PathBuf,
        /// What was expected and got.
        problem: String,
    },
}

/// The label of a clip in labels.csv.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The held object.
    pub object: String,
    /// Whether it slipped.
    pub slips: bool,
}

/// A folder of clips.
#[derive(Debug, Clone)]
pub struct Clips {
    folder: PathBuf,
    open: OpenSource,
    /// Names of the clips, in alphabetical order, whatever their labels.
    pub names: Vec<String>,
    /// Labels by clip; empty without labels.csv.
    pub labels: BTreeMap<String, Label>,
    /// The number of clips, and a digest of their names, the names and sizes of their files, and their labels.
    pub contents: String,
}

impl Clips {
    /// Reads a folder: each folder in it is a clip, to be read by `open`. The first column of the optional `labels.csv`
    /// is the name of the clip; it also has columns `object` and `slip`.
    pub fn open(folder: &Path, open: OpenSource) -> Result<Self, ClipsError> {
        let path = || folder.to_owned();
        let entries = fs::read_dir(folder).map_err(|source| ClipsError::Folder { path: path(), source })?;
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|source| ClipsError::Read { path: path(), source })?;
            if entry.path().is_dir() {
                let name = entry.file_name().into_string();
                names.push(name.map_err(|_| ClipsError::Name { path: entry.path() })?);
            }
        }
        if names.is_empty() {
            return Err(ClipsError::Empty { path: path() });
        }
        names.sort();
        let file = folder.join("labels.csv");
        let labels = match file.exists() {
            true => {
                let text = fs::read_to_string(&file);
                let text = text.map_err(|source| ClipsError::Read { path: file.clone(), source })?;
                labels(&text).map_err(|problem| ClipsError::Labels { path: file, problem })?
            }
            false => BTreeMap::new(),
        };
        let contents = contents(folder, &names, &labels)?;
        Ok(Clips { folder: folder.to_owned(), open, names, labels, contents })
    }

    /// Folder of a clip.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Runs detectors on a recording, in the order of `entries`; the results by detector, then by frame; none for a
    /// detector whose monitor cannot be created for the recording. [`EvalError::Unjudged`] where no frame could be
    /// judged by the monitor that all but the paper's own method share, or by that method's if it is asked alone.
    pub fn watch(
        &self,
        path: &Path,
        sensor: &Sensor,
        rest_from: RestFrom,
        entries: &[&'static Entry],
    ) -> Result<Vec<Vec<Seen>>, EvalError> {
        watch(self.open, path, sensor, rest_from, entries)
    }

    /// The records of a clip that cannot be judged: no alarm, no truth, and the reason. One bad clip does not end a sweep.
    pub(super) fn unjudged(&self, number: u64, detectors: &[&'static Entry], problem: &str) -> Vec<TrialRecord> {
        let name = &self.names[number as usize];
        let record = |entry: &&'static Entry| {
            TrialRecord {
                number,
                trial: name.clone(),
                object: object_of_name(name).into(),
                detector: entry.name.into(),
                truth: None,
                verdict: false,
                score: 0.0,
                first_alarm_frame: None,
                more: Default::default(),
            }
            .with(UNJUDGED, problem)
        };
        detectors.iter().map(record).collect()
    }

    /// How an error names the trial of a clip.
    pub(super) fn trial(&self, number: u64) -> String {
        let name = self.names.get(number as usize).map_or("", String::as_str);
        format!("trial {number}, {name}")
    }

    /// Whether a clip's object slipped; None without a label.
    pub fn truth(&self, name: &str) -> Option<bool> {
        self.labels.get(name).map(|label| label.slips)
    }
}

/// See [`Clips::contents`].
fn contents(folder: &Path, names: &[String], labels: &BTreeMap<String, Label>) -> Result<String, ClipsError> {
    let mut digest = Digest::new();
    for name in names {
        let mut files = Vec::new();
        add_files(&folder.join(name), name, &mut files)?;
        files.sort();
        digest.add(name);
        files.iter().for_each(|file| digest.add(file));
    }
    for (name, label) in labels {
        [name.as_str(), &label.object, if label.slips { "1" } else { "0" }].iter().for_each(|part| digest.add(part));
    }
    Ok(format!("{} clips, {}", names.len(), digest.word()))
}

/// Name and size of each file below a folder that is not hidden.
fn add_files(folder: &Path, name: &str, files: &mut Vec<String>) -> Result<(), ClipsError> {
    let failed = |source| ClipsError::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let own = entry.file_name().to_string_lossy().into_owned();
        let name = format!("{name}/{own}");
        let about = fs::metadata(entry.path()).map_err(failed)?;
        match about.is_dir() {
            _ if own.starts_with('.') => {}
            true => add_files(&entry.path(), &name, files)?,
            false => files.push(format!("{name} {}", about.len())),
        }
    }
    Ok(())
}

/// The held object, from the name of a clip: its words up to the first number.
pub fn object_of_name(name: &str) -> &str {
    let is_number = |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_digit());
    let mut end = 0;
    for word in name.split('_') {
        if end > 0 && is_number(word) {
            return &name[..end - 1];
        }
        end += word.len() + 1;
    }
    name
}

fn labels(text: &str) -> Result<BTreeMap<String, Label>, String> {
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let place = |name: &str| {
        let found = columns.iter().position(|column| *column == name);
        found.ok_or_else(|| format!("expected a column {name}, got {}", columns.join(", ")))
    };
    let (object, slip) = (place("object")?, place("slip")?);
    let mut labels = BTreeMap::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let slips = match cells.get(slip) {
            Some(&"1") => true,
            Some(&"0") => false,
            other => return Err(format!("slip: expected 0 or 1, got {other:?} in `{line}`")),
        };
        let object = cells.get(object).copied().unwrap_or_default().to_owned();
        labels.insert(cells[0].to_owned(), Label { object, slips });
    }
    Ok(labels)
}

/// The result of a detector on a frame.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Number of the frame.
    pub frame: u64,
    /// Whether the frame could be judged.
    pub is_judged: bool,
    /// Whether something touches the finger.
    pub touches: bool,
    /// Its score.
    pub score: f64,
    /// Whether it raises the alarm.
    pub alarms: bool,
    /// The evidence of our monitor.
    pub evidence: Option<EvidenceReport>,
}

/// Source of a recording's rest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RestFrom {
    /// The first frame, in which the finger is already touched.
    FirstFrame,
    /// Chosen among the first frames, for each of them among that frame and those before it.
    FirstFrames,
}

/// What a table says of the clips that could not be judged; empty where there are none.
pub(super) fn note_of_unjudged(records: &[TrialRecord]) -> String {
    let mut some: Vec<(&str, &str)> =
        records.iter().filter_map(|record| Some((record.trial.as_str(), record.unjudged()?))).collect();
    some.dedup();
    let each: Vec<String> = some.iter().map(|(name, problem)| format!("{name} ({problem})")).collect();
    match each.is_empty() {
        true => String::new(),
        false => format!(" Not judged, and not counted: {}.", each.join(", ")),
    }
}

/// See [`Clips::watch`].
fn watch(
    open: OpenSource,
    path: &Path,
    sensor: &Sensor,
    rest_from: RestFrom,
    entries: &[&'static Entry],
) -> Result<Vec<Vec<Seen>>, EvalError> {
    let uri = &path.display().to_string();
    let mut seen: Vec<Vec<Seen>> = vec![Vec::new(); entries.len()];
    let mut first_problem = None;
    for inputs in [Inputs::Frames, Inputs::PaperFrames] {
        // A recording contains no grip force, so both of our detectors use frames alone.
        let is_asked = |entry: &Entry| (entry.inputs == Inputs::PaperFrames) == (inputs == Inputs::PaperFrames);
        if !entries.iter().any(|entry| is_asked(entry)) {
            continue;
        }
        let mut monitor = match monitor(open, uri, sensor, rest_from, inputs)? {
            Ok(monitor) => monitor,
            Err(problem) => {
                first_problem.get_or_insert(problem);
                continue;
            }
        };
        let fresh = || -> Vec<(usize, Box<dyn Detector>)> {
            entries.iter().enumerate().filter(|(_, e)| is_asked(e)).map(|(n, e)| (n, e.make())).collect()
        };
        let mut detectors = fresh();
        let mut frames = open(uri).map_err(EvalError::Source)?;
        let mut buffer = FrameBuffer::default();
        loop {
            let report = match frames.next(&mut buffer)? {
                Next::Frame => {
                    let mut again = Vec::new();
                    let report = monitor.step(&buffer, &mut (), &mut |monitor, report| {
                        // Detectors keep something for every marker, and another rest frame may have others.
                        if again.is_empty() {
                            again = fresh();
                        }
                        for (_, detector) in &mut again {
                            detector.see(monitor, report);
                        }
                    })?;
                    if !again.is_empty() {
                        detectors = again;
                    }
                    report
                }
                Next::Torn { .. } => monitor.torn(buffer.seq, buffer.time_ns),
                Next::Silent => continue,
                Next::End => break,
            };
            if let Some(reason) = report.reason.filter(|_| report.state == SlipState::Unjudged) {
                first_problem.get_or_insert_with(|| {
                    format!("expected frames that can be judged, got none; frame {}: {reason}", report.seq)
                });
            }
            for (n, detector) in &mut detectors {
                let score = detector.see(monitor.monitor(), &report);
                seen[*n].push(Seen {
                    frame: report.seq,
                    is_judged: report.state != SlipState::Unjudged,
                    touches: !matches!(report.state, SlipState::NoContact | SlipState::Unjudged),
                    score,
                    alarms: detector.alarms(score, &report),
                    evidence: report.evidence,
                });
            }
        }
    }
    match is_judged(entries, &seen) {
        true => Ok(seen),
        false => {
            let problem = first_problem.unwrap_or_else(|| "expected frames, got none".into());
            Err(EvalError::Unjudged { path: path.to_owned(), problem })
        }
    }
}

/// Whether a clip counts as judged: see [`Clips::watch`]. Where only the paper's own method cannot judge, it raises no
/// alarm.
pub(super) fn is_judged(entries: &[&'static Entry], seen: &[Vec<Seen>]) -> bool {
    let is_shared = |entry: &Entry| entry.inputs != Inputs::PaperFrames;
    let has_shared = entries.iter().any(|entry| is_shared(entry));
    let counted = entries.iter().zip(seen).filter(|(entry, _)| !has_shared || is_shared(entry));
    counted.flat_map(|(_, frames)| frames).any(|frame| frame.is_judged)
}

/// A monitor for a recording; the inner error is why it has no rest frame.
fn monitor(
    open: OpenSource,
    uri: &str,
    sensor: &Sensor,
    from: RestFrom,
    inputs: Inputs,
) -> Result<Result<RecordingMonitor, String>, EvalError> {
    let settings = inputs.settings();
    let mut frames = open(uri).map_err(EvalError::Source)?;
    let mut buffer = FrameBuffer::default();
    let mut finder: Option<RestFinder> = None;
    let mut torn_count = 0;
    let rest: Result<Rest, RestError> = loop {
        match frames.next(&mut buffer)? {
            Next::Frame => {}
            Next::Torn { .. } => {
                torn_count += 1;
                continue;
            }
            Next::Silent => continue,
            Next::End => match &finder {
                Some(finder) => break finder.find().map(|found| found.rest),
                None => return Ok(Err(format!("expected a whole frame, got none ({torn_count} torn)"))),
            },
        }
        if from == RestFrom::FirstFrame {
            let mut builder = RestBuilder::new(sensor, &settings, buffer.size)?;
            break builder.add(&buffer.frame()?).and_then(|()| builder.build(RestKind::InContact));
        }
        let finder = match &mut finder {
            Some(finder) => finder,
            None => finder.insert(RestFinder::new(sensor, &settings, buffer.size)?),
        };
        finder.see(&buffer)?;
        if finder.is_full() {
            break finder.find().map(|found| found.rest);
        }
    };
    let rest = match rest {
        Ok(rest) => rest,
        Err(problem) => return Ok(Err(problem.to_string())),
    };
    let monitor = SlipMonitor::new(sensor, &settings, rest)?;
    Ok(Ok(match from {
        RestFrom::FirstFrame => RecordingMonitor::with_known_rest(monitor),
        RestFrom::FirstFrames => RecordingMonitor::with_rest_of_first_frames(monitor)?,
    }))
}

/// An error of another kind, with its own message.
pub(super) fn other(problem: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> EvalError {
    EvalError::Source(SourceError::new(SourceErrorKind::Other, problem))
}

/// The largest value of each part of the evidence over the scored frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Latch {
    /// The relaxation.
    pub relaxation: f64,
    /// The ratio of the displacement at the centre to that at the rim.
    pub centre_rim_ratio: Option<f64>,
    /// The change of the imprint.
    pub imprint_change: Option<f64>,
}

impl Latch {
    /// Adds a frame.
    pub fn see(&mut self, evidence: &EvidenceReport) {
        let most = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::max);
        self.relaxation = self.relaxation.max(evidence.relaxation);
        self.centre_rim_ratio = most(self.centre_rim_ratio, evidence.centre_rim_ratio);
        self.imprint_change = most(self.imprint_change, evidence.imprint_change);
    }

    /// The slide score on a scale.
    pub fn score(&self, scale: &EvidenceSettings) -> f64 {
        scale.slide_score(self.relaxation, self.centre_rim_ratio, self.imprint_change)
    }
}

/// Highest score and first alarm over the scored frames. Ours uses the evidence of sliding, on `scale`.
pub fn judged(entry: &Entry, seen: &[Seen], scale: &EvidenceSettings) -> (f64, Option<u64>, Latch) {
    let (mut latch, mut score, mut first_alarm) = (Latch::default(), 0.0f64, None);
    for frame in seen {
        let (now, alarms) = match (&frame.evidence, entry.is_ours()) {
            (Some(evidence), true) => {
                latch.see(evidence);
                (latch.score(scale), latch.score(scale) > 1.0)
            }
            (None, true) => (score, false),
            (_, false) => (frame.score, frame.alarms),
        };
        score = if frame.frame == seen[0].frame { now } else { score.max(now) };
        if alarms && first_alarm.is_none() {
            first_alarm = Some(frame.frame);
        }
    }
    (score, first_alarm, latch)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_what_names_say_without_their_numbers() {
        assert_eq!(object_of_name("object001_066_60"), "object001");
        assert_eq!(object_of_name("train_ball_white_thread_01"), "train_ball_white_thread");
        assert_eq!(object_of_name("7f3a"), "7f3a");
    }

    #[test]
    fn contents_tell_other_clips_and_other_labels_and_no_order_of_lines() {
        let root = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(path, text).expect("written");
        };
        let refuses: OpenSource = |_| Err(SourceError::new(SourceErrorKind::Other, "no clip"));
        let contents = || Clips::open(root.path(), refuses).expect("clips").contents;
        write("a_1/000.jpg", "12");
        write("b_1/left/000.jpg", "345");
        let bare = contents();
        assert!(bare.starts_with("2 clips, ") && bare == contents(), "{bare}");
        write("labels.csv", "clip,object,slip\na_1,a,1\nb_1,b,0\n");
        let labelled = contents();
        write("labels.csv", "clip,slip,object\nb_1,0,b\na_1,1,a\n");
        assert_eq!(contents(), labelled, "the same labels");
        write("labels.csv", "clip,object,slip\na_1,a,0\nb_1,b,0\n");
        let told_otherwise = contents();
        write("b_1/left/000.jpg", "3456");
        let longer = contents();
        write("c_1/000.jpg", "");
        let all = [bare, labelled, told_otherwise, longer, contents()];
        assert!((1..all.len()).all(|n| !all[..n].contains(&all[n])), "{all:?}");
    }

    #[test]
    fn a_clip_that_only_the_papers_own_method_can_judge_is_not_scored_for_ours() {
        let [ours, paper] = ["ours", "paper_as_written"].map(|name| crate::rivals::named(name).expect("there is one"));
        let frame = |is_judged| Seen { frame: 0, is_judged, touches: false, score: 0.0, alarms: false, evidence: None };
        assert!(!is_judged(&[ours, paper], &[vec![], vec![frame(true)]]));
        assert!(!is_judged(&[ours, paper], &[vec![frame(false)], vec![frame(true)]]));
        assert!(is_judged(&[ours, paper], &[vec![frame(false), frame(true)], vec![]]));
        assert!(is_judged(&[paper], &[vec![frame(true)]]) && !is_judged(&[paper], &[vec![]]));
    }

    #[test]
    fn labels_are_found_by_the_names_of_their_columns() {
        let read = labels("clip,object,opening,slip\na_1,cup,3,1\n\nb_2,pen,4,0\n").expect("labels");
        assert_eq!(read["a_1"], Label { object: "cup".into(), slips: true });
        assert!(!read["b_2"].slips);
        let error = labels("clip,slip\na,1\n").expect_err("no objects");
        assert_eq!(error, "expected a column object, got clip, slip");
        assert!(labels("clip,object,slip\na,b,yes\n").is_err());
    }
}
