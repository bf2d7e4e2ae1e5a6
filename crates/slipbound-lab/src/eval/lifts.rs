//! Protocol `lifts`: clips in which an object is lifted; did it slip?
//!
//! ```text
//!   frame 0: rest and reference, the object is held already       frames 0..4: watched, not scored
//!   frames from 5 on: greatest value of each evidence --scale--> score, over 1: it slips
//!                     scale: shipped; with --refit the medians of the clips of all other objects
//! ```
//!
//! The verdict uses only the frames: no name, no label, no opening of the gripper.

mod refit;
mod shuffles;

use super::clip_record::note_of_uncounted;
use super::clip_verdict::{Latch, judged};
use super::clip_watch::{RestFrom, Seen, is_judged};
use super::clips::Clips;
use super::error::EvalError;
use super::protocol::Protocol;
use super::record::TrialRecord;
use super::statistics::{auc, share_of};
use super::table::{Cell, Table};
use crate::rivals::{DETECTORS, Entry, named};
use refit::{Example, left_out_scale};
use slipbound::monitor::EvidenceSettings;
use slipbound::sensor::Sensor;
use std::sync::OnceLock;

/// Frames before this one get no score: markers first move at index 5 to 7.
const SCORED_FROM_FRAME: u64 = 5;

/// The protocol `lifts`.
#[derive(Debug)]
pub struct Lifts {
    clips: Clips,
    sensor: Sensor,
    refit: bool,
    /// The evidence of every clip, for `--refit`; None where it cannot be judged.
    evidence: OnceLock<Result<Vec<Option<Latch>>, String>>,
}

impl Lifts {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "lifts";

    /// The clips of a folder, from a finger.
    pub fn new(clips: Clips, sensor: Sensor, refit: bool) -> Self {
        Lifts { clips, sensor, refit, evidence: OnceLock::new() }
    }

    fn object(&self, name: &str) -> &str {
        self.clips.labels.get(name).map_or("", |label| &label.object)
    }

    /// The scale for a clip.
    fn scale(&self, name: &str) -> Result<EvidenceSettings, EvalError> {
        if !self.refit {
            return Ok(EvidenceSettings::default());
        }
        let all = self.evidence.get_or_init(|| self.evidence_of_all().map_err(|error| error.to_string()));
        let all = all.as_ref().map_err(|text| EvalError::other(text.clone()))?;
        let known: Vec<Example<'_>> = (self.clips.names.iter().zip(all))
            .filter_map(|(clip, latch)| {
                let label = self.clips.labels.get(clip)?;
                Some(Example { object: &label.object, slips: label.slips, latch: (*latch)? })
            })
            .collect();
        left_out_scale(&known, self.object(name)).ok_or_else(|| {
            let expected = "--refit: expected labels.csv with slipped and held clips of other objects";
            EvalError::other(format!("{expected} than that of {name}, got none"))
        })
    }

    fn evidence_of_all(&self) -> Result<Vec<Option<Latch>>, EvalError> {
        let ours = [named("ours")?];
        let one = |name: &String| match self.watch(name, &ours) {
            Ok(seen) => Ok(Some(judged(ours[0], &seen[0], &EvidenceSettings::default()).2)),
            Err(EvalError::Unjudged { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        self.clips.names.iter().map(one).collect()
    }

    /// Results of the detectors on the scored frames.
    fn watch(&self, name: &str, detectors: &[&'static Entry]) -> Result<Vec<Vec<Seen>>, EvalError> {
        let path = self.clips.path(name);
        let mut seen = self.clips.watch(&path, &self.sensor, RestFrom::FirstFrame, detectors)?;
        let frames_count = seen.iter().map(Vec::len).max().unwrap_or(0);
        seen.iter_mut().for_each(|frames| frames.retain(|frame| frame.frame >= SCORED_FROM_FRAME));
        match is_judged(detectors, &seen) {
            true => Ok(seen),
            false => {
                let expected = format!("expected frames from number {SCORED_FROM_FRAME} on that can be judged");
                let problem = format!("{expected}, got none among {frames_count} frames");
                Err(EvalError::Unjudged { path, problem })
            }
        }
    }
}

impl Protocol for Lifts {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.clips.names.len() as u64
    }

    fn trial(&self, number: u64) -> String {
        self.clips.trial(number)
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let name = &self.clips.names[number as usize];
        let scale = self.scale(name)?;
        let seen = match self.watch(name, detectors) {
            Err(EvalError::Unjudged { problem, .. }) => return Ok(self.clips.unjudged(number, detectors, &problem)),
            seen => seen?,
        };
        let record = |(entry, seen): (&&'static Entry, &Vec<Seen>)| {
            let (score, first_alarm_frame, latch) = judged(entry, seen, &scale);
            let record = self.clips.record(number, entry, score, first_alarm_frame);
            match entry.is_ours() {
                true => record
                    .with("relaxation", latch.relaxation)
                    .with("centre_rim_ratio", latch.centre_rim_ratio)
                    .with("imprint_change", latch.imprint_change),
                false => record,
            }
        };
        Ok(detectors.iter().zip(&seen).map(record).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let (title, note, kind) = match self.refit {
            true => (
                "Lifts, each object left out",
                "Did the object slip? Scales of ours fitted to the clips of all other objects; the threshold is fixed at 1. Rivals with \
                 their own thresholds, nothing fitted.",
                "object left out",
            ),
            false => (
                "Lifts, shipped constants",
                "Did the object slip? Nothing fitted here. The scales of ours are medians of shared clips: on those clips this is \
                 training accuracy, on clips of other objects it is not.",
                "training accuracy",
            ),
        };
        let mut all = Table::new(
            title,
            &format!("{note}{}", note_of_uncounted(records)),
            &["detector", "clips", "wrong", &format!("right %, {kind}"), &format!("AUC, {kind}")],
        );
        let judged = || records.iter().filter(|record| record.unjudged().is_none());
        for entry in &DETECTORS {
            let some: Vec<&TrialRecord> = judged().filter(|r| r.detector == entry.name).collect();
            if !some.is_empty() {
                all.rows.push(row(entry.name, &some));
            }
        }
        let mut objects: Vec<&str> = records.iter().map(|r| self.object_of(r)).collect();
        objects.sort_unstable();
        objects.dedup();
        let mut by_object = Table::new(
            "Ours by object",
            "",
            &["object", "clips", "wrong", &format!("right %, {kind}"), &format!("AUC, {kind}")],
        );
        for object in objects {
            let some: Vec<&TrialRecord> =
                judged().filter(|r| r.detector == "ours" && self.object_of(r) == object).collect();
            if !some.is_empty() {
                by_object.rows.push(row(object, &some));
            }
        }
        let shuffled = self.refit.then(|| shuffles::table(&self.examples(records))).flatten();
        [all, by_object].into_iter().chain(shuffled).collect()
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![
            ("data".into(), self.clips.contents.clone()),
            ("refit".into(), self.refit.to_string()),
            ("sensor".into(), self.sensor.name.clone()),
        ]
    }
}

impl Lifts {
    /// The clips of ours with a label and the evidence of their records.
    fn examples<'a>(&'a self, records: &'a [TrialRecord]) -> Vec<Example<'a>> {
        let example = |record: &'a TrialRecord| {
            let latch = Latch {
                relaxation: record.number_of("relaxation")?,
                centre_rim_ratio: record.number_of("centre_rim_ratio"),
                imprint_change: record.number_of("imprint_change"),
            };
            Some(Example { object: self.object_of(record), slips: record.truth?, latch })
        };
        records.iter().filter(|record| record.detector == "ours").filter_map(example).collect()
    }

    /// The object of a record: from labels.csv, otherwise from the name of the clip.
    fn object_of<'a>(&'a self, record: &'a TrialRecord) -> &'a str {
        self.clips.labels.get(&record.trial).map_or(record.object.as_str(), |label| label.object.as_str())
    }
}

/// Right and wrong verdicts, and the area under the curve, of the records with a known truth, and their number.
pub fn row(name: &str, records: &[&TrialRecord]) -> Vec<Cell> {
    let scores =
        |truth: bool| -> Vec<f64> { records.iter().filter(|r| r.truth == Some(truth)).map(|r| r.score).collect() };
    let known = records.iter().filter(|r| r.truth.is_some()).count() as u64;
    let wrong = records.iter().filter(|r| r.is_right() == Some(false)).count() as u64;
    vec![
        name.into(),
        Cell::Count(known),
        if known == 0 { Cell::None } else { Cell::Count(wrong) },
        Cell::Share(share_of(records.iter().filter_map(|r| r.is_right()))),
        Cell::Number(auc(&scores(true), &scores(false)), 3),
    ]
}

#[cfg(test)]
mod tests;
