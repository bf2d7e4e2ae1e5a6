//! Records of clips: a detector's verdict on a clip, or why the clip could not be judged -> TrialRecord, note of a table.

use super::clips::{Clips, object_of_name};
use super::record::{TrialRecord, UNJUDGED};
use crate::rivals::Entry;
use std::collections::BTreeSet;

impl Clips {
    /// The record of a detector on a clip: its score, and the first frame with an alarm, without which it takes the
    /// object for held.
    pub(super) fn record(&self, number: u64, entry: &Entry, score: f64, first_alarm_frame: Option<u64>) -> TrialRecord {
        let name = &self.names[number as usize];
        TrialRecord {
            number,
            trial: name.clone(),
            object: object_of_name(name).into(),
            detector: entry.name.into(),
            truth: self.truth(name),
            verdict: first_alarm_frame.is_some(),
            score,
            first_alarm_frame,
            more: Default::default(),
        }
    }

    /// The records of a clip that cannot be judged: no alarm, no truth, and the reason. One bad clip does not end a sweep.
    pub(super) fn unjudged(&self, number: u64, detectors: &[&'static Entry], problem: &str) -> Vec<TrialRecord> {
        let record = |entry: &&'static Entry| {
            TrialRecord { truth: None, ..self.record(number, entry, 0.0, None) }.with(UNJUDGED, problem)
        };
        detectors.iter().map(record).collect()
    }
}

/// What a table says of the clips that it does not count: without a label, or not judged; empty where there are none.
pub(super) fn note_of_uncounted(records: &[TrialRecord]) -> String {
    let has_no_label = |record: &&TrialRecord| record.truth.is_none() && record.unjudged().is_none();
    let unlabelled: BTreeSet<u64> = records.iter().filter(has_no_label).map(|record| record.number).collect();
    let mut note = match unlabelled.len() {
        0 => String::new(),
        count => format!(" Without a label, and not counted: {count}."),
    };
    let mut some: Vec<(&str, &str)> =
        records.iter().filter_map(|record| Some((record.trial.as_str(), record.unjudged()?))).collect();
    some.dedup();
    let each: Vec<String> = some.iter().map(|(name, problem)| format!("{name} ({problem})")).collect();
    if !each.is_empty() {
        note += &format!(" Not judged, and not counted: {}.", each.join(", "));
    }
    note
}
