//! Counters of a finger's images, for the diagnostics.

use crate::lifecycle::State;
use crate::msg::{DiagnosticStatus, KeyValue};

/// Latencies beyond this come from two clocks that do not agree, ns.
const LATENCY_MOST_NS: u64 = 60_000_000_000;

/// Time between two diagnostics, ns.
pub(crate) const DIAGNOSTICS_NS: u64 = 1_000_000_000;

/// Counters of the images of one finger.
#[derive(Debug, Clone, Default)]
pub struct FingerCounters {
    /// Images received.
    pub received_count: u64,
    /// Reports published.
    pub reports_count: u64,
    /// Images that never arrived, by the gaps in their numbers.
    pub missing_count: u64,
    /// Images that arrived while others were judged, and were skipped for newer ones.
    pub passed_over_count: u64,
    /// Images that could not be decoded.
    pub torn_count: u64,
    /// How often the network was joined again.
    pub rejoined_count: u64,
    /// Messages that could not be read, and reports that could not be sent.
    pub failed_count: u64,
    /// The last failure, in words.
    pub last_failure: Option<String>,
    /// Whether the rest frame is known.
    pub has_rest: bool,
    /// The verdict published last.
    pub state: String,
    next_seq: Option<u64>,
    counted_at_ns: u64,
    reports_before_count: u64,
    received_before_count: u64,
    lost_before_count: u64,
    /// Reports since the last status that are no verdict.
    unjudged_count: u64,
    latencies_ns: Vec<u64>,
}

impl FingerCounters {
    /// An image has been received.
    pub fn received(&mut self, seq: u64) {
        self.received_count += 1;
        self.missing_count += self.next_seq.map_or(0, |next| seq.saturating_sub(next));
        self.next_seq = Some(seq + 1);
    }

    /// A report has been published `now_ns`, of an image with this stamp, both ns since 1970.
    pub fn published(&mut self, now_ns: u64, stamp_ns: Option<u64>, state: &str) {
        self.reports_count += 1;
        self.unjudged_count += u64::from(state == "unjudged");
        if self.state != state {
            self.state.replace_range(.., state);
        }
        if let Some(ns) = stamp_ns.and_then(|stamp_ns| now_ns.checked_sub(stamp_ns)).filter(|ns| *ns < LATENCY_MOST_NS)
        {
            self.latencies_ns.push(ns);
        }
    }

    /// An image could not be decoded.
    pub fn torn(&mut self, why: &str) {
        self.torn_count += 1;
        self.last_failure = Some(why.to_owned());
    }

    /// Something failed.
    pub fn failed(&mut self, why: String) {
        self.failed_count += 1;
        self.last_failure = Some(why);
    }

    /// Images that were lost in transit or here.
    pub fn lost_count(&self) -> u64 {
        self.missing_count + self.passed_over_count + self.torn_count
    }

    /// The status of the finger since the last call, in a node of this state.
    pub fn status(
        &mut self,
        now_ns: u64,
        lifecycle: State,
        node: &str,
        finger: &str,
        serial: &str,
    ) -> DiagnosticStatus {
        let counted_at_ns = self.counted_at_ns;
        let elapsed_s = now_ns.saturating_sub(counted_at_ns) as f64 * 1e-9;
        let reports_count = self.reports_count - self.reports_before_count;
        let received_count = self.received_count - self.received_before_count;
        let lost_count = self.lost_count() - self.lost_before_count;
        (self.counted_at_ns, self.reports_before_count) = (now_ns, self.reports_count);
        (self.lost_before_count, self.received_before_count) = (self.lost_count(), self.received_count);
        let unjudged_count = std::mem::take(&mut self.unjudged_count);
        let rate_hz = (counted_at_ns > 0 && elapsed_s > 0.0).then(|| reports_count as f64 / elapsed_s);
        self.latencies_ns.sort_unstable();
        let quantile = |fraction: f64| {
            let at = (self.latencies_ns.len().saturating_sub(1) as f64 * fraction).round() as usize;
            self.latencies_ns.get(at).map_or("unknown".to_owned(), |ns| format!("{:.2}", *ns as f64 * 1e-6))
        };
        let (p50, p99) = (quantile(0.5), quantile(0.99));
        self.latencies_ns.clear();
        let (level, message) = match () {
            _ if !self.has_rest && self.received_count == 0 => (3, "no image yet".to_owned()),
            _ if !self.has_rest => (1, "the rest frame is not known yet".to_owned()),
            _ if received_count == 0 || (lifecycle == State::Active && reports_count == 0) => {
                (3, "no pictures".to_owned())
            }
            _ if unjudged_count > 0 && unjudged_count == reports_count => (1, "no picture could be judged".to_owned()),
            _ if lost_count > 0 => (1, format!("{lost_count} pictures lost")),
            _ if unjudged_count > 0 => (1, format!("{unjudged_count} of {reports_count} pictures could not be judged")),
            _ if lifecycle == State::Inactive => (0, "inactive: judged, not published".to_owned()),
            _ if lifecycle != State::Active => (0, format!("{}: not active yet", lifecycle.label())),
            _ => (0, self.state.clone()),
        };
        let value = |key: &str, value: String| KeyValue { key: key.into(), value };
        let mut values = vec![
            value("lifecycle", lifecycle.label().into()),
            value("state", self.state.clone()),
            value("rate_hz", rate_hz.map_or("unknown".into(), |rate_hz| format!("{rate_hz:.1}"))),
            value("latency_p50_ms", p50),
            value("latency_p99_ms", p99),
            value("received_count", self.received_count.to_string()),
            value("reports_count", self.reports_count.to_string()),
            value("missing_count", self.missing_count.to_string()),
            value("passed_over_count", self.passed_over_count.to_string()),
            value("torn_count", self.torn_count.to_string()),
            value("rejoined_count", self.rejoined_count.to_string()),
            value("failed_count", self.failed_count.to_string()),
        ];
        values.extend(self.last_failure.iter().map(|why| value("last_failure", why.clone())));
        DiagnosticStatus { level, name: format!("{node}: {finger}"), message, hardware_id: serial.into(), values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_rates_and_latencies_are_counted() {
        let mut counters = FingerCounters { has_rest: true, ..FingerCounters::default() };
        let first = counters.status(1_000_000_000, State::Active, "slipbound", "left", "A");
        for seq in [0, 1, 4, 5] {
            counters.received(seq);
            counters.published(2_000_000_000, Some(2_000_000_000 - 1_000_000 * (seq + 1)), "stick");
        }
        counters.published(2_000_000_000, Some(3_000_000_000), "stick"); // from the future: no latency
        let status = counters.status(3_000_000_000, State::Active, "slipbound", "left", "A");
        let value = |key: &str| status.values.iter().find(|v| v.key == key).map_or("", |v| v.value.as_str());
        assert_eq!((status.level, status.message.as_str()), (1, "2 pictures lost"));
        assert_eq!((value("missing_count"), value("rate_hz")), ("2", "2.5"));
        let (rate, of_first) = (KeyValue { key: "rate_hz".into(), value: "unknown".into() }, first.values);
        assert!(of_first.contains(&rate), "of no time yet: {of_first:?}");
        assert_eq!((value("latency_p50_ms"), value("latency_p99_ms")), ("5.00", "6.00"));
        let status = counters.status(4_000_000_000, State::Active, "slipbound", "left", "A");
        assert_eq!((status.level, status.message.as_str()), (3, "no pictures"));
        counters.received(6);
        let status = counters.status(5_000_000_000, State::Inactive, "slipbound", "left", "A");
        assert_eq!((status.level, status.message.as_str()), (0, "inactive: judged, not published"));
        assert_eq!(status.values[0], KeyValue { key: "lifecycle".into(), value: "inactive".into() });
    }

    #[test]
    fn images_that_cannot_be_judged_are_a_warning_and_a_node_that_is_not_active_yet_says_so() {
        let mut counters = FingerCounters { has_rest: true, ..FingerCounters::default() };
        let mut said = |lifecycle: State, verdicts: &[&str]| {
            for (seq, verdict) in (counters.received_count..).zip(verdicts) {
                counters.received(seq);
                if lifecycle == State::Active {
                    counters.published(0, None, verdict);
                }
            }
            let status = counters.status(0, lifecycle, "slipbound", "left", "A");
            (status.level, status.message)
        };
        assert_eq!(said(State::Unconfigured, &["stick"]), (0, "unconfigured: not active yet".into()));
        assert_eq!(said(State::Active, &["unjudged"; 3]), (1, "no picture could be judged".into()));
        assert_eq!(said(State::Active, &["unjudged", "stick"]), (1, "1 of 2 pictures could not be judged".into()));
        assert_eq!(said(State::Active, &["stick"]), (0, "stick".into()), "of this second");
    }
}
