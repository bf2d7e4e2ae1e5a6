//! Schedule of the steps that do not run in every frame of a fast camera: contact region, search for spots and evidence
//! of sliding take turns.
//!
//! ```text
//!   90 Hz, periods of 25 ms       frame      0   1   2   3   4   5   6   7   8   9  10        30 Hz   frame      0   1   2
//!                                 contact    x           x           x           x                    contact    x   x   x
//!     a marker is missing:        search     x   x           x           x           x                search     x   x   x
//!     none is:                    search     x                   x                   x                search     x   x   x
//!                                 evidence   x       x           x           x                        evidence   x   x   x
//! ```
//! Region, evidence and the search for a missing marker run at least as often as with a camera at 30 Hz; markers that
//! were found are tracked in between. A region changes little in that time, and evidence is about motion over 33 to 200
//! ms.

use super::frame_period::frame_period_ns;

/// Which steps a frame gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Due {
    pub(super) contact: bool,
    pub(super) search: bool,
    pub(super) evidence: bool,
}

/// A step, its period, and when it was last done.
#[derive(Debug, Clone)]
struct Turn {
    period_ns: u64,
    done_ns: Option<u64>,
}

impl Turn {
    fn new(period_ms: f64) -> Self {
        Turn { period_ns: (1e6 * period_ms).round() as u64, done_ns: None }
    }

    /// Whether `periods` periods have passed since it was done; true without times.
    fn is_over(&self, time_ns: Option<u64>, periods: u64) -> bool {
        let Some((since_ns, now_ns)) = self.done_ns.zip(time_ns) else { return true };
        now_ns.saturating_sub(since_ns) >= periods * self.period_ns
    }

    /// Whether it is done in this frame: when `periods` periods are over. If something is due `before` it, it waits,
    /// until one more period is over.
    fn take(&mut self, time_ns: Option<u64>, periods: u64, touches: bool, before: bool) -> bool {
        let waits = before && !self.is_over(time_ns, periods + 1);
        let due = !touches || (self.is_over(time_ns, periods) && !waits);
        if due {
            self.done_ns = time_ns;
        }
        due
    }
}

/// Periods between two searches while no marker is missing: tracking then finds each of them in every frame.
const PERIODS_WHEN_COMPLETE: u64 = 2;

/// Watches the times of the frames that are judged.
#[derive(Debug, Clone)]
pub(super) struct StepSchedule {
    frame_ns: Option<u64>,
    contact: Turn,
    search: Turn,
    evidence: Turn,
}

impl StepSchedule {
    /// Each step is done at most once per period, ms; 0: in every frame.
    pub(super) fn new(contact_ms: f64, search_ms: f64, evidence_ms: f64) -> Self {
        let [contact, search, evidence] = [contact_ms, search_ms, evidence_ms].map(Turn::new);
        StepSchedule { frame_ns: None, contact, search, evidence }
    }

    // Deviation: D21 turns
    /// The steps due in a frame: all in a frame without a time, in one whose time repeats that of the frame before, is
    /// set back or in another unit, and without contact. `complete`: whether every marker in view was found in the last
    /// frame, so that none must be searched for.
    pub(super) fn see(&mut self, time_ns: Option<u64>, touches: bool, complete: bool) -> Due {
        let last_ns = std::mem::replace(&mut self.frame_ns, time_ns);
        let frame_ns = frame_period_ns(last_ns, time_ns);
        let time_ns = time_ns.filter(|_| last_ns.is_none() || frame_ns.is_some());
        // Whether `frames` more frames come within its period.
        let has_room = |turn: &Turn, frames: u64| frame_ns.is_some_and(|ns| frames.saturating_mul(ns) < turn.period_ns);
        let contact = self.contact.take(time_ns, 1, touches, false);
        let next_soon = has_room(&self.search, 1);
        let periods = if complete && next_soon { PERIODS_WHEN_COMPLETE } else { 1 };
        let search = self.search.take(time_ns, periods, touches, contact && next_soon);
        let after_either = (contact && has_room(&self.evidence, 1)) || (search && has_room(&self.evidence, 2));
        let evidence = self.evidence.take(time_ns, 1, touches, after_either);
        Due { contact, search, evidence }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which frames of a camera with this period get the contact region, the search and the evidence.
    fn turns(schedule: &mut StepSchedule, period_us: u64, frames_count: u64, complete: bool) -> [String; 3] {
        let due = (1..=frames_count).map(|i| schedule.see(Some(1_000 * period_us * i), true, complete));
        let due: Vec<Due> = due.collect();
        let text = |of: fn(&Due) -> bool| due.iter().map(|d| if of(d) { 'x' } else { '.' }).collect();
        [text(|d| d.contact), text(|d| d.search), text(|d| d.evidence)]
    }

    #[test]
    fn a_fast_camera_gets_them_in_turns_and_a_slow_one_in_every_frame() {
        for (period_us, contact, search, evidence) in [
            (33_333, "xxxxxxxxx", "xxxxxxxxx", "xxxxxxxxx"),
            (25_000, "xxxxxxxxx", "xxxxxxxxx", "xxxxxxxxx"),
            (16_667, "x.x.x.x.x", "x..x.x.x.", "x..x.x.x."),
            (12_500, "x.x.x.x.x", "x..x.x.x.", "x..x.x.x."),
            (11_111, "x..x..x..", "x...x..x.", "x....x..x"),
            (8_333, "x...x...x", "x....x...", "x.....x.."),
            (5_000, "x....x...", "x.....x..", "x......x."),
        ] {
            let seen = turns(&mut StepSchedule::new(25.0, 25.0, 25.0), period_us, 9, false);
            assert_eq!(seen, [contact, search, evidence], "{period_us} us");
        }
        assert_eq!(turns(&mut StepSchedule::new(0.0, 0.0, 0.0), 1_000, 4, false), ["xxxx"; 3]);
        assert_eq!(turns(&mut StepSchedule::new(0.0, 25.0, 25.0), 11_111, 5, false)[0], "xxxxx");
    }

    #[test]
    fn while_no_marker_is_missing_a_fast_camera_is_searched_more_rarely() {
        for (period_us, search) in
            [(33_333, "xxxxxxxxxxxxx"), (25_000, "xxxxxxxxxxxxx"), (16_667, "x..x...x...x."), (11_112, "x....x....x..")]
        {
            let [_, seen, _] = turns(&mut StepSchedule::new(25.0, 25.0, 25.0), period_us, 13, true);
            assert_eq!(seen, search, "{period_us} us");
        }
        assert_eq!(turns(&mut StepSchedule::new(0.0, 0.0, 0.0), 1_000, 4, true), ["xxxx"; 3]);
        let mut schedule = StepSchedule::new(25.0, 25.0, 25.0);
        let searched = |schedule: &mut StepSchedule, i: u64, complete: bool| {
            schedule.see(Some(11_111_000 * i), true, complete).search
        };
        assert!((1..=4).map(|i| searched(&mut schedule, i, true)).skip(1).all(|search| !search), "none is missing");
        assert!(searched(&mut schedule, 5, false) || searched(&mut schedule, 6, false), "one is missing now");
    }

    #[test]
    fn none_waits_for_ever_whatever_the_periods_and_however_unevenly_frames_come() {
        for (contact_ms, search_ms, evidence_ms) in
            [(25.0, 25.0, 25.0), (12.5, 12.5, 25.0), (0.0, 12.5, 12.5), (12.5, 0.0, 40.0), (50.0, 12.5, 0.0)]
        {
            // The longest time that may pass: one period more than set.
            for (complete, search_periods) in [(false, 2.0), (true, 3.0)] {
                let mut schedule = StepSchedule::new(contact_ms, search_ms, evidence_ms);
                let (mut now_ns, mut done_ns) = (0u64, [0u64; 3]);
                for i in 0..2_000u64 {
                    now_ns += 4_000_000 + (i.wrapping_mul(2_654_435_761) >> 7) % 12_000_000;
                    let Due { contact, search, evidence } = schedule.see(Some(now_ns), true, complete);
                    let longest_ms = [2.0 * contact_ms, search_periods * search_ms, 2.0 * evidence_ms];
                    for ((done_ns, due), longest_ms) in
                        done_ns.iter_mut().zip([contact, search, evidence]).zip(longest_ms)
                    {
                        *done_ns = if due { now_ns } else { *done_ns };
                        assert!(now_ns - *done_ns <= (1e6 * longest_ms) as u64, "frame {i}, {longest_ms} ms");
                    }
                }
            }
        }
    }

    #[test]
    fn everything_is_due_without_times_that_go_on_in_ns_and_without_contact() {
        let all = Due { contact: true, search: true, evidence: true };
        let mut schedule = StepSchedule::new(25.0, 25.0, 25.0);
        assert!((0..5).all(|_| schedule.see(None, true, true) == all));
        assert!((0..5).all(|i| schedule.see(Some(1_000_000 * i), false, true) == all));
        assert_ne!(schedule.see(Some(6_000_000), true, true), all);
        assert_eq!(schedule.see(Some(1_000_000), true, true), all);
        assert!((0..5).all(|_| schedule.see(Some(1_000_000), true, true) == all), "a time that stands still is none");
        for unit in [1, 1_000, 3_000] {
            // Frames at 30 Hz in milliseconds, and at 30 and 10 Hz in microseconds.
            let mut schedule = StepSchedule::new(25.0, 25.0, 25.0);
            assert!((0..9).all(|i| schedule.see(Some(33 * unit * i), true, true) == all), "{unit}");
        }
        let mut schedule = StepSchedule::new(25.0, 25.0, 25.0);
        let back = (0..9u64).filter(|i| schedule.see(Some(10_000_000 * (i % 2)), true, true) == all);
        assert!(back.count() >= 5, "set back by every other frame");
    }

    /// The largest number stands for "unknown" with some writers.
    #[test]
    fn any_two_times_can_follow_each_other() {
        let mut schedule = StepSchedule::new(25.0, 25.0, 25.0);
        schedule.see(Some(0), true, false);
        schedule.see(Some(u64::MAX), true, false);
        schedule.see(Some(0), true, true);
    }
}
