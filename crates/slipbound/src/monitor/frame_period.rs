//! Time from a frame to the next.

/// Assumed time between frames where the source has none, s.
pub(super) const FRAME_S: f64 = 1.0 / 30.0;

/// Shorter periods are no camera's, ns: the times were given in another unit.
const LEAST_PERIOD_NS: u64 = 1_000_000;

/// Time from a frame to the next, ns; None where a time is missing, repeated, set back or in another unit.
pub(super) fn frame_period_ns(last_ns: Option<u64>, time_ns: Option<u64>) -> Option<u64> {
    let passed_ns = last_ns.zip(time_ns).and_then(|(last_ns, now_ns)| now_ns.checked_sub(last_ns));
    passed_ns.filter(|ns| *ns >= LEAST_PERIOD_NS)
}

/// The same in seconds; that of a camera at 30 Hz where it is not known.
pub(super) fn frame_period_s(last_ns: Option<u64>, time_ns: Option<u64>) -> f64 {
    frame_period_ns(last_ns, time_ns).map_or(FRAME_S, |ns| ns as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_stands_still_or_was_set_back_or_counts_something_else_is_none() {
        assert_eq!(frame_period_s(Some(1_000_000_000), Some(1_250_000_000)), 0.25);
        // Of 30 and 10 Hz.
        let milliseconds_and_microseconds =
            [(Some(33), Some(67)), (Some(33_333), Some(66_667)), (Some(0), Some(100_000))];
        let none = [(None, Some(7)), (Some(7), None), (Some(7), Some(7)), (Some(7), Some(6))];
        for (last_ns, time_ns) in none.into_iter().chain(milliseconds_and_microseconds) {
            assert_eq!(frame_period_s(last_ns, time_ns), FRAME_S, "{last_ns:?} {time_ns:?}");
        }
    }
}
