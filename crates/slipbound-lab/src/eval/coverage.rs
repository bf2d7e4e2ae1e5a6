//! Accuracy against coverage: how the accuracy of the verdict grows if the ramps with the largest stated error of the
//! margin are called unsure. (Contact quality gives no such order: on a finger in full view it is 1 in nearly all
//! ramps.)
//!
//! ```text
//!   ramps by the stated error:   0.05  0.06  0.06 ... 0.12 | 0.13 ... 0.22
//!                                <------- judged ---------> unsure from here on: coverage 0.8, accuracy of those to the left
//! ```

use super::outcome::{MARGIN_SD, Outcome};
use super::record::TrialRecord;
use super::statistics::{mean, median, quantile, share_of};
use super::table::{Cell, Table};

/// Coverages in the table, the largest first.
const COVERED: [f64; 5] = [1.0, 0.9, 0.75, 0.5, 0.25];

/// Fewest ramps of a point of a curve.
const LEAST_RAMPS: usize = 20;

/// The ramps of a detector whose margin has a stated error, in order of increasing error.
fn by_stated_error<'a>(records: &'a [TrialRecord], detector: &str) -> Vec<(f64, &'a TrialRecord)> {
    let of = records.iter().filter(|r| r.detector == detector);
    let mut ramps: Vec<_> = of.filter_map(|r| Some((r.number_of(MARGIN_SD)?, r))).collect();
    ramps.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.number.cmp(&b.1.number)));
    ramps
}

/// Whether the alarm of a ramp was in time.
pub fn in_time(record: &TrialRecord) -> Option<bool> {
    Outcome::of(record).map(|outcome| outcome == Outcome::InTime)
}

/// Whether the kind of slip at the alarm was right.
pub fn kind_right(record: &TrialRecord) -> Option<bool> {
    record.word_of("kind_true").map(|kind| record.word_of("kind_said") == Some(kind))
}

/// Whether the mean error of the margin was at most a tenth.
pub fn margin_right(record: &TrialRecord) -> Option<bool> {
    record.number_of("margin_error").map(|error| error <= 0.1)
}

/// Share of right answers (y) against the share of the ramps that are judged (x), for a detector.
pub fn curve(records: &[TrialRecord], detector: &str, right: impl Fn(&TrialRecord) -> Option<bool>) -> Vec<(f64, f64)> {
    let ramps = by_stated_error(records, detector);
    let (mut asked_count, mut right_count, mut points) = (0, 0, Vec::new());
    for (n, (_, record)) in ramps.iter().enumerate() {
        if let Some(right) = right(record) {
            (asked_count, right_count) = (asked_count + 1, right_count + usize::from(right));
        }
        if asked_count >= LEAST_RAMPS {
            points.push(((n + 1) as f64 / ramps.len() as f64, right_count as f64 / asked_count as f64));
        }
    }
    points
}

/// The table of some detectors; None if no ramp has a stated error of the margin.
pub(super) fn table<'a>(records: &[TrialRecord], detectors: impl Iterator<Item = &'a str>) -> Option<Table> {
    let mut table = Table::new(
        "Accuracy against coverage",
        "The ramps whose margin is stated as surest (median over the scored frames), when the others are called unsure.",
        &[
            "detector",
            "coverage %",
            "stated error up to",
            "in time %",
            "kind right %",
            "sense of rotation right %",
            "direction error deg, median",
            "95th pct",
            "stick ratio MAE",
            "margin MAE",
        ],
    );
    for name in detectors {
        let ramps = by_stated_error(records, name);
        for covered in COVERED {
            let judged = &ramps[..(covered * ramps.len() as f64).round() as usize];
            let Some((most, _)) = judged.last() else { continue };
            let of = |key: &str| judged.iter().filter_map(|(_, r)| r.number_of(key)).collect::<Vec<f64>>();
            let answers =
                |right: fn(&TrialRecord) -> Option<bool>| share_of(judged.iter().filter_map(|(_, r)| right(r)));
            let direction_deg = of("direction_error_deg");
            table.rows.push(vec![
                name.into(),
                format!("{:.0}", 100.0 * covered).into(),
                format!("{most:.3}").into(),
                Cell::Share(answers(in_time)),
                Cell::Share(answers(kind_right)),
                Cell::Share(answers(|r| r.flag_of("sense_right"))),
                Cell::Number(median(&direction_deg), 1),
                Cell::Number(quantile(&direction_deg, 0.95), 1),
                Cell::Number(mean(&of("stick_error")), 3),
                Cell::Number(mean(&of("margin_error")), 3),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hundred ramps: the error grows with the stated error, and from 0.1 on the kind is wrong.
    fn records() -> Vec<TrialRecord> {
        let record = |number: u64| {
            let stated = ((number * 37) % 100) as f64 / 500.0;
            TrialRecord {
                number,
                trial: format!("t{number}"),
                object: "scissors".into(),
                detector: "ours".into(),
                truth: Some(true),
                verdict: true,
                score: 1.0,
                first_alarm_frame: Some(1),
                more: Default::default(),
            }
            .with("outcome", "in_time")
            .with(MARGIN_SD, stated)
            .with("kind_true", "rotation")
            .with("kind_said", if stated >= 0.1 { "translation" } else { "rotation" })
            .with("margin_error", stated)
        };
        (0..100).map(record).collect()
    }

    #[test]
    fn fewer_and_surer_ramps_are_judged_more_exactly() {
        let records = records();
        let points = curve(&records, "ours", kind_right);
        assert_eq!((points[0], points.last().copied()), ((0.2, 1.0), Some((1.0, 0.5))));
        assert!(points.iter().any(|&(x, y)| (x, y) == (0.8, 50.0 / 80.0)), "{points:?}");
        assert_eq!(curve(&records, "ours", in_time).last(), Some(&(1.0, 1.0)));
        assert!(curve(&records, "paper", in_time).is_empty());
        let table = table(&records, ["ours", "paper"].into_iter()).expect("ramps");
        let shown = table.shown();
        assert_eq!(shown.iter().map(|row| row[1].as_str()).collect::<Vec<_>>(), ["100", "90", "75", "50", "25"]);
        assert_eq!((shown[3][2].as_str(), &shown[3][4][..5]), ("0.098", "100.0"), "{shown:?}");
        assert!(shown[4][9].starts_with("0.02") && shown[0][9].starts_with("0.099"), "{shown:?}");
        assert!(super::table(&[], ["ours"].into_iter()).is_none());
    }
}
