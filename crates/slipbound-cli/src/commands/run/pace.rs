//! When the next cycle of a hand is due: as its cameras' frames come, or at the rate at which its recordings are played.

use slipbound_rig::realtime::FramesDue;
use slipbound_rig::source::Arrivals;

/// Longest time between two cycles where frames come at a camera's rate, ns.
const LONGEST_CYCLE_NS: u64 = 100_000_000;

/// Times the cycles.
pub struct Pace {
    /// None without a camera.
    frames_due: Option<FramesDue>,
    period_ns: u64,
    due_ns: u64,
}

impl Pace {
    /// For the cameras of these [`Arrivals`], which wait for each other for `max_skew_ns` at most; without one, for
    /// recordings that are played at this rate from `now_ns` on.
    pub fn new(cameras: impl ExactSizeIterator<Item = Arrivals>, max_skew_ns: u64, rate_hz: f64, now_ns: u64) -> Self {
        let frames_due = (cameras.len() > 0).then(|| FramesDue::new(cameras, max_skew_ns));
        Pace { frames_due, period_ns: (1e9 / rate_hz) as u64, due_ns: now_ns }
    }

    /// Longest time between two cycles, ns: a recording that is played slowly is silent between two frames as intended.
    pub fn longest_cycle_ns(&self) -> u64 {
        match self.frames_due {
            Some(_) => LONGEST_CYCLE_NS,
            None => LONGEST_CYCLE_NS.max(self.period_ns + self.period_ns / 2),
        }
    }

    /// Whether a cycle is due. True once per cycle. After a delay the cycles of a recording that are late by more than a period
    /// are left out.
    pub fn is_due(&mut self, now_ns: u64) -> bool {
        if let Some(frames_due) = &mut self.frames_due {
            return frames_due.is_due(now_ns);
        }
        let is_due = now_ns >= self.due_ns;
        if is_due {
            self.due_ns = (self.due_ns + self.period_ns).max(now_ns.saturating_sub(self.period_ns));
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_recording_is_played_at_its_rate_and_leaves_out_what_is_late_by_a_period() {
        let mut pace = Pace::new(std::iter::empty(), 0, 100.0, 5 * MS);
        let due: Vec<u64> = (0..40).filter(|ms| pace.is_due(ms * MS)).collect();
        assert_eq!(due, [5, 15, 25, 35]);
        // The cycle of 45 comes at 100, and then those of 90 and 100; those of 55 to 80 are left out.
        let due: Vec<u64> = (100..125).filter(|ms| pace.is_due(ms * MS)).collect();
        assert_eq!(due, [100, 101, 102, 110, 120]);
    }

    #[test]
    fn a_slow_rate_lengthens_the_longest_cycle_and_a_fast_one_does_not() {
        let longest_ns = |rate_hz| Pace::new(std::iter::empty(), 0, rate_hz, 0).longest_cycle_ns();
        assert_eq!((longest_ns(30.0), longest_ns(2.0)), (100 * MS, 750 * MS));
    }
}
