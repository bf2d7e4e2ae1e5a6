//! Whether the stated errors of the estimates are true.
//!
//! ```text
//!   estimate .41 +- .06, truth .50:   -2 sd    -1 sd    .41    +1 sd  | +2 sd      within two sd, not within one
//!                                                                    .50
//! ```
//!
//! Errors that are distributed normally are within one standard deviation (sd) in 68 % of the frames, within two in 95 %.

use super::record::TrialRecord;
use super::statistics::{mean, mean_share};
use super::table::{Cell, Table};
use slipbound::monitor::Estimate;

/// The estimates whose errors are compared, as in the keys of records.
pub(super) const ESTIMATES: [&str; 5] = ["stick", "margin", "shear", "torque", "friction"];

/// An estimate against the truth in one frame, both in the unit of the estimate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deviation {
    /// Estimate minus truth.
    pub error: f64,
    /// Standard deviation of the error, as stated beside the estimate.
    pub stated_sd: f64,
}

impl Deviation {
    pub fn of(estimate: Estimate, truth: f64) -> Self {
        Deviation { error: estimate.value - truth, stated_sd: estimate.sd }
    }

    fn is_within(self, stated_sds: f64) -> bool {
        self.error.abs() <= stated_sds * self.stated_sd
    }
}

/// Mean of the absolute errors; None without frames.
pub(super) fn mean_size(deviations: &[Deviation]) -> Option<f64> {
    mean(&deviations.iter().map(|deviation| deviation.error.abs()).collect::<Vec<f64>>()).value
}

/// Root of the mean squared error; None without frames.
pub(super) fn rms(deviations: &[Deviation]) -> Option<f64> {
    mean(&deviations.iter().map(|deviation| deviation.error * deviation.error).collect::<Vec<f64>>())
        .value
        .map(f64::sqrt)
}

fn key(estimate: &str, stated_sds: u8) -> String {
    format!("{estimate}_within_{stated_sds}_sd")
}

/// The record with the shares of the frames in which the error is within one and two stated standard deviations.
pub(super) fn with_stated(record: TrialRecord, estimate: &str, deviations: &[Deviation]) -> TrialRecord {
    [1, 2].into_iter().fold(record, |record, stated_sds| {
        let within = deviations.iter().filter(|deviation| deviation.is_within(f64::from(stated_sds))).count();
        let share = (!deviations.is_empty()).then(|| within as f64 / deviations.len() as f64);
        record.with(&key(estimate, stated_sds), share)
    })
}

/// The table of some detectors; None if no ramp has a stated error.
pub(super) fn table<'a>(records: &[TrialRecord], detectors: impl Iterator<Item = &'a str>) -> Option<Table> {
    let mut table = Table::new(
        "Stated errors",
        "Frames in which the truth lies within one and two stated standard deviations (sd), mean over the ramps. Errors that are distributed normally: 68 and 95 %.",
        &["detector", "estimate", "ramps", "within one sd %", "within two sd %"],
    );
    for detector in detectors {
        let of: Vec<&TrialRecord> = records.iter().filter(|r| r.detector == detector).collect();
        for estimate in ESTIMATES {
            let [one, two] = [1, 2].map(|stated_sds| {
                mean_share(&of.iter().filter_map(|r| r.number_of(&key(estimate, stated_sds))).collect::<Vec<f64>>())
            });
            if one.n > 0 {
                table.rows.push(vec![
                    detector.into(),
                    estimate.into(),
                    Cell::Count(one.n),
                    Cell::Share(one),
                    Cell::Share(two),
                ]);
            }
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_share_ends_at_the_whole() {
        let record = |within: f64| {
            TrialRecord {
                number: 0,
                trial: "t".into(),
                object: "scissors".into(),
                detector: "ours".into(),
                truth: Some(true),
                verdict: true,
                score: 1.0,
                first_alarm_frame: None,
                more: Default::default(),
            }
            .with(&key("margin", 1), within)
            .with(&key("margin", 2), 1.0)
        };
        let records = [1.0, 0.99, 1.0, 0.97].map(record);
        let shown = table(&records, ["ours"].into_iter()).expect("ramps").shown();
        assert_eq!(shown, [["ours", "margin", "4", "99.0 [96.7, 100.0]", "100.0 [100.0, 100.0]"]]);
    }
}
