//! Time from a frame to the next.

/// Assumed time between frames where the source has none, s.
pub(super) const FRAME_S: f64 = 1.0 / 30.0;

/// Seconds from a frame to the next from their times, ns; those of a camera at 30 Hz where a time is missing, repeated
/// or set back.
pub(super) fn frame_period_s(last_ns: Option<u64>, time_ns: Option<u64>) -> f64 {
    let passed_ns = last_ns.zip(time_ns).and_then(|(last_ns, now_ns)| now_ns.checked_sub(last_ns));
    passed_ns.filter(|ns| *ns > 0).map_or(FRAME_S, |ns| ns as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_stands_still_or_was_set_back_is_none() {
        assert_eq!(frame_period_s(Some(1_000_000_000), Some(1_250_000_000)), 0.25);
        for (last_ns, time_ns) in [(None, Some(7)), (Some(7), None), (Some(7), Some(7)), (Some(7), Some(6))] {
            assert_eq!(frame_period_s(last_ns, time_ns), FRAME_S, "{last_ns:?} {time_ns:?}");
        }
    }
}
