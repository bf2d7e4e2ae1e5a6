//! A user's own detector, which is in no list, on the ramps: judged on the same frames and by the same definitions.
//!
//! ```text
//!   a rival's monitor --frame, report--> CustomDetector --score--> records --> the tables of `ramps`
//! ```

use super::error::EvalError;
use super::ramps::{Ramps, records};
use super::record::TrialRecord;
use super::watch::{Restarts, Seen, Watch, Watched, watch};
use crate::rivals::{DETECTORS, Entry, Inputs, ReportEstimates, named};
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::FrameBuffer;
use slipbound::setting::SettingError;

/// The rival whose place in the run a custom detector takes: it receives the same inputs as all rivals.
const PLACEHOLDER_DETECTOR: &str = "displacement";

/// A user's own detector, with the inputs of the rivals: frames, and the results of a monitor on them.
pub trait CustomDetector {
    /// Resets it: a trial begins.
    fn begin(&mut self);

    /// Judges a frame: a larger score means stronger evidence of slip, infinity too. NaN never alarms and counts as 0.
    fn see(&mut self, frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) -> f64;

    /// Makes the last frame seen its reference: the one before the load.
    fn restart(&mut self);
}

/// The rivals of these names, to be judged on the same frames as the custom detector.
pub fn rivals(names: &[&str]) -> Result<Vec<&'static Entry>, SettingError> {
    names.iter().map(|name| named(name)).collect()
}

/// The records of one ramp: the custom detector's, called `name`, then those of `beside`.
pub fn judge(
    ramps: &Ramps,
    number: u64,
    (name, threshold, detector): (&str, f64, &mut dyn CustomDetector),
    beside: &[&'static Entry],
) -> Result<Vec<TrialRecord>, EvalError> {
    check(name, threshold)?;
    let trial = ramps.trial(number)?;
    let what = Watch::new(trial.clone(), Restarts::Rivals);
    let placeholder = named(PLACEHOLDER_DETECTOR)?;
    let mut entries = beside.to_vec();
    if !entries.iter().any(|entry| entry.name == PLACEHOLDER_DETECTOR) {
        entries.push(placeholder);
    }
    debug_assert_eq!(placeholder.inputs, Inputs::Frames);
    let load_from_frame = what.load_from_frame();
    let mut seen = Vec::new();
    detector.begin();
    let mut look = |frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor| {
        let raw_score = detector.see(frame, report, monitor);
        // Records are JSON, which has no infinity.
        let score = if raw_score.is_nan() { 0.0 } else { raw_score.clamp(f64::MIN, f64::MAX) };
        seen.push(Seen {
            score,
            alarms: raw_score > threshold,
            state: report.state,
            estimates: ReportEstimates::default(),
        });
        if frame.seq + 1 == load_from_frame {
            detector.restart();
        }
    };
    let mut watched = watch(&what, &entries, Some((PLACEHOLDER_DETECTOR, &mut look)))?;
    let others = std::mem::take(&mut watched.seen);
    let record_all = |seen| {
        let watched = Watched { seen, ..watched.clone() };
        records(number, &trial.to_string(), &trial, Some(trial.mu()), &watched)
    };
    let mut all = record_all(vec![(placeholder, seen)]);
    for record in &mut all {
        record.detector = name.into();
    }
    all.extend(record_all(others).into_iter().filter(|r| beside.iter().any(|entry| entry.name == r.detector)));
    Ok(all)
}

fn check(name: &str, threshold: f64) -> Result<(), SettingError> {
    let refuse =
        |key: &str, expected: &str, got: String| Err(SettingError { key: key.into(), expected: expected.into(), got });
    if name.is_empty() || DETECTORS.iter().any(|entry| entry.name == name) {
        return refuse("name", "a name that no detector of the list has", format!("`{name}`"));
    }
    if !threshold.is_finite() {
        return refuse("threshold", "a finite number", threshold.to_string());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::{Outcome, Protocol, ramps::Ramps};
    use crate::rivals::{Detector, Displacement};

    /// A detector of the list as a user's own.
    struct Same(Displacement);

    impl CustomDetector for Same {
        fn begin(&mut self) {
            self.0 = Displacement::default();
        }

        fn see(&mut self, _: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) -> f64 {
            self.0.see(monitor, report)
        }

        fn restart(&mut self) {
            self.0.restart();
        }
    }

    /// The same score for every frame.
    struct Always(f64);

    impl CustomDetector for Always {
        fn begin(&mut self) {}

        fn see(&mut self, _: &FrameBuffer, _: &SlipReport, _: &SlipMonitor) -> f64 {
            self.0
        }

        fn restart(&mut self) {}
    }

    #[test]
    fn a_detector_of_the_list_gets_the_same_record_as_a_custom_one() {
        let ramps = Ramps::new(5, Some(2));
        let mut same = Same(Displacement::default());
        let threshold = Displacement::default().threshold();
        for number in 0..2 {
            let judged = judge(&ramps, number, ("mine", threshold, &mut same), &[]).expect("a sound trial");
            let listed = ramps.judge(number, &rivals(&[PLACEHOLDER_DETECTOR]).expect("one")).expect("a sound trial");
            assert_eq!((judged.len(), judged[0].detector.as_str()), (1, "mine"));
            assert_eq!(TrialRecord { detector: PLACEHOLDER_DETECTOR.into(), ..judged[0].clone() }, listed[0]);
            let table = ramps.tables(&judged).remove(0).markdown();
            assert!(table.contains("| mine | 1 |"), "{table}");
        }
    }

    #[test]
    fn one_that_never_responds_misses_and_one_of_a_listed_name_is_refused() {
        let ramps = Ramps::new(5, Some(1));
        let beside = rivals(&["ours_frames", "paper"]).expect("two");
        let records = judge(&ramps, 0, ("unresponsive", 1.0, &mut Always(f64::NAN)), &beside).expect("a sound trial");
        let names: Vec<&str> = records.iter().map(|r| r.detector.as_str()).collect();
        assert_eq!(names, ["unresponsive", "ours_frames", "paper"]);
        assert_eq!((Outcome::of(&records[0]), records[0].score), (Some(Outcome::Missed), 0.0));
        assert_eq!(records[1], ramps.judge(0, &beside).expect("sound")[0], "ours is not disturbed by the other");
        for (name, threshold, key) in [("paper", 1.0, "name"), ("", 1.0, "name"), ("mine", f64::NAN, "threshold")] {
            let error =
                judge(&ramps, 0, (name, threshold, &mut Always(f64::NAN)), &[]).expect_err("refused").to_string();
            assert!(error.contains(key), "{error}");
        }
        assert!(rivals(&["nobody"]).is_err());
    }

    #[test]
    fn an_infinite_score_is_an_alarm_and_nan_is_none() {
        let ramps = Ramps::new(5, Some(1));
        for (score, threshold, alarms, recorded) in
            [(f64::INFINITY, 1.0, true, f64::MAX), (f64::NEG_INFINITY, -1.0, false, 0.0), (f64::NAN, -1.0, false, 0.0)]
        {
            let records = judge(&ramps, 0, ("mine", threshold, &mut Always(score)), &[]).expect("a sound trial");
            assert_eq!((records[0].first_alarm_frame.is_some(), records[0].score), (alarms, recorded), "{score}");
        }
    }
}
