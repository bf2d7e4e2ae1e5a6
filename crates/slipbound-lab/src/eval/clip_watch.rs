//! Detectors on a recording: frames -> results of every detector on every frame.
//!
//! ```text
//!   recording --first frames--> rest frame --> monitor (ours; the paper's)
//!      `-------every frame-----------------------`--report--> detectors that read it --> Seen
//! ```

use super::error::EvalError;
use crate::rivals::{Detector, Entry, Inputs};
use slipbound::finger_pipeline::{RecordingMonitor, RestFinder};
use slipbound::monitor::{
    EvidenceReport, Rest, RestBuilder, RestError, RestKind, Settings, SlipMonitor, SlipReport, SlipState,
};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};
use slipbound::sensor::Sensor;
use std::path::Path;

/// Opens a recording by its path.
pub type OpenSource = fn(&str) -> Result<Box<dyn FrameSource + Send>, SourceError>;

/// Source of a recording's rest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RestFrom {
    /// The first frame, in which the finger is already touched.
    FirstFrame,
    /// Chosen among the first frames, for each of them among that frame and those before it.
    FirstFrames,
}

/// The result of a detector on a frame.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Number of the frame.
    pub frame: u64,
    /// Its time, if the recording tells it, ns.
    pub time_ns: Option<u64>,
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

/// See [`Clips::watch`](super::clips::Clips::watch).
pub(super) fn watch(
    open: OpenSource,
    path: &Path,
    sensor: &Sensor,
    rest_from: RestFrom,
    entries: &[&'static Entry],
) -> Result<Vec<Vec<Seen>>, EvalError> {
    let recording = Recording { open, uri: path.display().to_string(), sensor, rest_from };
    let mut seen: Vec<Vec<Seen>> = vec![Vec::new(); entries.len()];
    let mut first_problem = None;
    for inputs in [Inputs::Frames, Inputs::PaperFrames] {
        // A recording contains no grip force, so both of our detectors use frames alone.
        let is_asked = |entry: &Entry| (entry.inputs == Inputs::PaperFrames) == (inputs == Inputs::PaperFrames);
        let places: Vec<usize> = (0..entries.len()).filter(|&n| is_asked(entries[n])).collect();
        if places.is_empty() {
            continue;
        }
        let asked: Vec<&'static Entry> = places.iter().map(|&n| entries[n]).collect();
        let watched = recording.watch_by(inputs, &asked).map_err(|error| unjudged_if_broken(path, error))?;
        first_problem = first_problem.or(watched.problem);
        for (n, frames) in places.into_iter().zip(watched.seen) {
            seen[n] = frames;
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

/// What is wrong with the clip itself leaves the other clips: no frames, or data that cannot be decoded. Anything else,
/// as a file that may not be read or a program that is missing, ends the sweep.
fn unjudged_if_broken(path: &Path, error: EvalError) -> EvalError {
    match error {
        EvalError::Source(error) if matches!(error.kind, SourceErrorKind::Settings | SourceErrorKind::Format) => {
            let text = error.to_string();
            // Records are the same wherever the clips are.
            let file = error.file.map(|file| format!("{file}: ")).unwrap_or_default();
            let text = text.strip_prefix(&file).unwrap_or(&text);
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            EvalError::Unjudged { path: path.to_owned(), problem: text.replace(&path.display().to_string(), &name) }
        }
        other => other,
    }
}

/// Whether a clip counts as judged: see [`Clips::watch`](super::clips::Clips::watch). Where only the paper's own method
/// cannot judge, it raises no alarm.
pub(super) fn is_judged(entries: &[&'static Entry], seen: &[Vec<Seen>]) -> bool {
    let is_shared = |entry: &Entry| entry.inputs != Inputs::PaperFrames;
    let has_shared = entries.iter().any(|entry| is_shared(entry));
    let counted = entries.iter().zip(seen).filter(|(entry, _)| !has_shared || is_shared(entry));
    counted.flat_map(|(_, frames)| frames).any(|frame| frame.is_judged)
}

/// A recording of a finger, opened anew for its rest frame and for each monitor.
struct Recording<'a> {
    open: OpenSource,
    uri: String,
    sensor: &'a Sensor,
    rest_from: RestFrom,
}

/// Results of the detectors that read one monitor.
struct Watched {
    /// By detector, then by frame.
    seen: Vec<Vec<Seen>>,
    /// Why there is no monitor, or why its first frame that cannot be judged cannot be.
    problem: Option<String>,
}

impl Recording<'_> {
    /// Runs the detectors that read the monitor of `inputs`.
    fn watch_by(&self, inputs: Inputs, entries: &[&'static Entry]) -> Result<Watched, EvalError> {
        let mut watched = Watched { seen: vec![Vec::new(); entries.len()], problem: None };
        let mut monitor = match self.monitor(&inputs.settings())? {
            Ok(monitor) => monitor,
            Err(problem) => return Ok(Watched { problem: Some(problem), ..watched }),
        };
        let mut detectors = fresh(entries);
        let mut frames = (self.open)(&self.uri)?;
        let mut buffer = FrameBuffer::default();
        loop {
            let report = match frames.next(&mut buffer)? {
                Next::Frame => step(&mut monitor, &buffer, entries, &mut detectors)?,
                Next::Torn { .. } => monitor.torn(buffer.seq, buffer.time_ns),
                Next::Silent => continue,
                Next::End => return Ok(watched),
            };
            watched.see(monitor.monitor(), &report, &mut detectors);
        }
    }

    /// A monitor for the recording; the inner error is why it has no rest frame.
    fn monitor(&self, settings: &Settings) -> Result<Result<RecordingMonitor, String>, EvalError> {
        let rest = match self.rest(settings)? {
            Ok(rest) => rest,
            Err(problem) => return Ok(Err(problem)),
        };
        let monitor = SlipMonitor::new(self.sensor, settings, rest)?;
        Ok(Ok(match self.rest_from {
            RestFrom::FirstFrame => RecordingMonitor::with_known_rest(monitor),
            RestFrom::FirstFrames => RecordingMonitor::with_rest_of_first_frames(monitor)?,
        }))
    }

    /// The rest frame; the inner error is why there is none, as that its first whole frame has another shape than the
    /// finger's.
    fn rest(&self, settings: &Settings) -> Result<Result<Rest, String>, EvalError> {
        let mut frames = (self.open)(&self.uri)?;
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
            if self.rest_from == RestFrom::FirstFrame {
                let mut builder = match RestBuilder::new(self.sensor, settings, buffer.size) {
                    Ok(builder) => builder,
                    Err(other_shape) => return Ok(Err(other_shape.to_string())),
                };
                break builder.add(&buffer.frame()?).and_then(|()| builder.build(RestKind::InContact));
            }
            let finder = match &mut finder {
                Some(finder) => finder,
                None => match RestFinder::new(self.sensor, settings, buffer.size) {
                    Ok(new) => finder.insert(new),
                    Err(other_shape) => return Ok(Err(other_shape.to_string())),
                },
            };
            finder.see(&buffer)?;
            if finder.is_full() {
                break finder.find().map(|found| found.rest);
            }
        };
        Ok(rest.map_err(|problem| problem.to_string()))
    }
}

impl Watched {
    /// Adds a report and what the detectors make of it.
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport, detectors: &mut [Box<dyn Detector>]) {
        if let Some(reason) = report.reason.filter(|_| report.state == SlipState::Unjudged) {
            self.problem.get_or_insert_with(|| {
                format!("expected frames that can be judged, got none; frame {}: {reason}", report.seq)
            });
        }
        for (frames, detector) in self.seen.iter_mut().zip(detectors) {
            let score = detector.see(monitor, report);
            frames.push(Seen {
                frame: report.seq,
                time_ns: report.time_ns,
                is_judged: report.state != SlipState::Unjudged,
                touches: !matches!(report.state, SlipState::NoContact | SlipState::Unjudged),
                score,
                alarms: detector.alarms(score, report),
                evidence: report.evidence,
            });
        }
    }
}

fn fresh(entries: &[&'static Entry]) -> Vec<Box<dyn Detector>> {
    entries.iter().map(|entry| entry.make()).collect()
}

/// The report on a frame. Where the monitor takes another rest frame, the detectors are made anew, as they keep something
/// for every marker and the other rest frame may have others, and see its frames again.
fn step(
    monitor: &mut RecordingMonitor,
    frame: &FrameBuffer,
    entries: &[&'static Entry],
    detectors: &mut Vec<Box<dyn Detector>>,
) -> Result<SlipReport, EvalError> {
    let mut again = Vec::new();
    let report = monitor.step(frame, &mut (), &mut |monitor, report| {
        if again.is_empty() {
            again = fresh(entries);
        }
        for detector in &mut again {
            detector.see(monitor, report);
        }
    })?;
    if !again.is_empty() {
        *detectors = again;
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clip_that_only_the_papers_own_method_can_judge_is_not_scored_for_ours() {
        let [ours, paper] = ["ours", "paper_as_written"].map(|name| crate::rivals::named(name).expect("there is one"));
        let frame = |is_judged| Seen {
            frame: 0,
            time_ns: None,
            is_judged,
            touches: false,
            score: 0.0,
            alarms: false,
            evidence: None,
        };
        assert!(!is_judged(&[ours, paper], &[vec![], vec![frame(true)]]));
        assert!(!is_judged(&[ours, paper], &[vec![frame(false)], vec![frame(true)]]));
        assert!(is_judged(&[ours, paper], &[vec![frame(false), frame(true)], vec![]]));
        assert!(is_judged(&[paper], &[vec![frame(true)]]) && !is_judged(&[paper], &[vec![]]));
    }
}
