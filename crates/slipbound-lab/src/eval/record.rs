//! Results of a detector on a trial: a line of trials.jsonl.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The keys of every record, in the order in which a line has them.
pub const KEYS: [&str; 8] = ["number", "trial", "object", "detector", "truth", "verdict", "score", "first_alarm_frame"];

/// Key of a record whose trial could not be judged: why.
pub const UNJUDGED: &str = "unjudged";

/// Results of one detector on one trial or clip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    /// Place of the trial in the whole sweep, from 0; the same in every shard.
    pub number: u64,
    /// Name of the trial or of the clip.
    pub trial: String,
    /// The held object.
    pub object: String,
    /// `ours`, or the name of the rival.
    pub detector: String,
    /// Ground truth: it slips (or whatever the protocol asks). None if unknown, as for a clip without a label.
    pub truth: Option<bool>,
    /// The verdict of the detector.
    pub verdict: bool,
    /// Highest causal score of the counted frames, finite: a larger score means stronger evidence of slip.
    pub score: f64,
    /// Number of the first frame with an alarm; None without one.
    pub first_alarm_frame: Option<u64>,
    /// Additional values of the protocol, by name and unit, such as `f_at_alarm` or `lead_ms`.
    #[serde(flatten)]
    pub more: BTreeMap<String, Value>,
}

/// Why a line is not a record.
#[derive(Debug, thiserror::Error)]
#[error("expected a record with the keys {}: {source}", KEYS.join(", "))]
pub struct RecordLineError {
    /// What is wrong with it.
    pub source: serde_json::Error,
}

impl TrialRecord {
    /// The record with one more value. A number that is not finite is written as null.
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.more.insert(key.into(), value.into());
        self
    }

    /// An additional number; None if it is null or absent.
    pub fn number_of(&self, key: &str) -> Option<f64> {
        self.more.get(key)?.as_f64()
    }

    /// An additional word; None if it is null or absent.
    pub fn word_of(&self, key: &str) -> Option<&str> {
        self.more.get(key)?.as_str()
    }

    /// An additional yes or no; None if it is null or absent.
    pub fn flag_of(&self, key: &str) -> Option<bool> {
        self.more.get(key)?.as_bool()
    }

    /// Why the trial could not be judged; None where it was. Such a record has no truth, so it counts nowhere.
    pub fn unjudged(&self) -> Option<&str> {
        self.word_of(UNJUDGED)
    }

    /// Whether the verdict is correct; None if the truth is unknown.
    pub fn is_right(&self) -> Option<bool> {
        self.truth.map(|truth| truth == self.verdict)
    }

    /// The line, without its end.
    pub fn line(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }

    /// Reads a line.
    pub fn parse(line: &str) -> Result<Self, RecordLineError> {
        serde_json::from_str(line).map_err(|source| RecordLineError { source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_back_to_the_bit_and_its_keys_stand_in_order() {
        let record = TrialRecord {
            number: 3,
            trial: "ramp-3".into(),
            object: "scissors".into(),
            detector: "ours".into(),
            truth: Some(true),
            verdict: true,
            score: 0.1 + 0.2,
            first_alarm_frame: None,
            more: BTreeMap::new(),
        }
        .with("lead_ms", 1.0 / 3.0)
        .with("f_at_alarm", None::<f64>)
        .with("outcome", "in_time")
        .with("never", f64::NAN);
        let line = record.line().expect("a record");
        let places: Vec<usize> =
            KEYS.iter().map(|key| line.find(&format!("\"{key}\":")).unwrap_or_else(|| panic!("{key}"))).collect();
        assert!(places.is_sorted(), "{line}");
        let back = TrialRecord::parse(&line).expect("the same");
        assert_eq!(back, record);
        assert_eq!((back.number_of("lead_ms"), back.number_of("f_at_alarm")), (Some(1.0 / 3.0), None));
        assert_eq!((back.word_of("outcome"), back.number_of("never")), (Some("in_time"), None));
    }

    #[test]
    fn half_a_line_is_refused_with_the_keys_it_should_have() {
        let error = TrialRecord::parse("{\"number\":3,\"tri").expect_err("half a line").to_string();
        assert!(error.starts_with("expected a record with the keys number, trial, object, detector"), "{error}");
    }
}
