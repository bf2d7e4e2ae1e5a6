//! What is not done anew in every frame of a fast camera: the contact region on one side, the search for spots and the evidence of sliding
//! on the other, in turns.
//!
//! ```text
//!   90 Hz, periods of 12.5 ms   frame             0   1   2   3   4   5        60 Hz   frame             0   1   2
//!                               contact           x       x       x                    contact           x   x   x
//!                               search, evidence  x           x       x                search, evidence  x   x   x
//! ```
//! A region changes little in a hundredth of a second, a marker goes on as it moved, and evidence is about motion over 33 to 200 ms.

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

    /// Whether its period is over since it was done.
    fn is_over(&self, time_ns: Option<u64>) -> bool {
        passed(self.done_ns, time_ns, self.period_ns)
    }

    /// Whether it is done in this frame.
    fn take(&mut self, time_ns: Option<u64>, due: bool) -> bool {
        if due {
            self.done_ns = time_ns;
        }
        due
    }
}

/// Whether so much time has passed. Without times it has, and after a clock that was set back.
fn passed(since_ns: Option<u64>, time_ns: Option<u64>, period_ns: u64) -> bool {
    let Some((since_ns, now_ns)) = since_ns.zip(time_ns) else { return true };
    now_ns.checked_sub(since_ns).is_none_or(|ns| ns >= period_ns)
}

/// Watches the times of the frames that are judged.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    frame_ns: Option<u64>,
    contact: Turn,
    search: Turn,
    evidence: Turn,
}

impl Pace {
    /// Nothing is done more often than once in its period, ms; 0: in every frame.
    pub(super) fn new(contact_ms: f64, search_ms: f64, evidence_ms: f64) -> Self {
        let [contact, search, evidence] = [contact_ms, search_ms, evidence_ms].map(Turn::new);
        Pace { frame_ns: None, contact, search, evidence }
    }

    // Deviation: D21 turns
    /// What is due in a frame. A frame without a time gets everything, as does one while nothing touches.
    pub(super) fn see(&mut self, time_ns: Option<u64>, touches: bool) -> Due {
        let last_ns = std::mem::replace(&mut self.frame_ns, time_ns);
        let contact = !touches || self.contact.is_over(time_ns);
        self.contact.take(time_ns, contact);
        // After the contact they wait for the next frame, where that comes before long.
        let waits = |turn: &Turn| touches && contact && !passed(last_ns, time_ns, turn.period_ns);
        let due = |turn: &mut Turn| {
            let due = !touches || (turn.is_over(time_ns) && !waits(turn));
            turn.take(time_ns, due)
        };
        Due { contact, search: due(&mut self.search), evidence: due(&mut self.evidence) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of so many frames get the contact region and which the evidence, of a camera with this period.
    fn turns(pace: &mut Pace, period_us: u64, frames_count: u64) -> [String; 2] {
        let due: Vec<Due> = (1..=frames_count).map(|i| pace.see(Some(1_000 * period_us * i), true)).collect();
        let text = |of: fn(&Due) -> bool| due.iter().map(|d| if of(d) { 'x' } else { '.' }).collect();
        [text(|d| d.contact), text(|d| d.evidence)]
    }

    #[test]
    fn a_fast_camera_gets_them_in_turns_and_a_slow_one_in_every_frame() {
        for (period_us, contact, evidence) in [
            (33_333, "xxxxxxxx", "xxxxxxxx"),
            (16_667, "xxxxxxxx", "xxxxxxxx"),
            (12_500, "xxxxxxxx", "xxxxxxxx"),
            (11_111, "x.x.x.x.", "x..x.x.x"),
            (8_333, "x.x.x.x.", "x..x.x.x"),
            (5_000, "x..x..x.", "x...x..x"),
        ] {
            assert_eq!(turns(&mut Pace::new(12.5, 12.5, 12.5), period_us, 8), [contact, evidence], "{period_us} us");
        }
        assert_eq!(turns(&mut Pace::new(0.0, 0.0, 0.0), 1_000, 4), ["xxxx", "xxxx"]);
        assert_eq!(turns(&mut Pace::new(0.0, 12.5, 12.5), 11_111, 5)[0], "xxxxx");
    }

    #[test]
    fn neither_waits_for_ever_where_frames_come_unevenly() {
        let mut pace = Pace::new(12.5, 12.5, 12.5);
        let (mut now_ns, mut contact_ns, mut evidence_ns) = (0u64, 0u64, 0u64);
        for i in 0..2_000u64 {
            now_ns += 4_000_000 + (i.wrapping_mul(2_654_435_761) >> 7) % 12_000_000;
            let due = pace.see(Some(now_ns), true);
            contact_ns = if due.contact { now_ns } else { contact_ns };
            evidence_ns = if due.evidence { now_ns } else { evidence_ns };
            assert!(now_ns - contact_ns < 12_500_000 && now_ns - evidence_ns < 25_000_000, "frame {i}");
        }
    }

    #[test]
    fn everything_is_due_without_times_without_contact_and_after_a_clock_is_set_back() {
        let all = Due { contact: true, search: true, evidence: true };
        let mut pace = Pace::new(12.5, 12.5, 12.5);
        assert!((0..5).all(|_| pace.see(None, true) == all));
        assert!((0..5).all(|i| pace.see(Some(1_000_000 * i), false) == all));
        assert_ne!(pace.see(Some(6_000_000), true), all);
        assert_eq!(pace.see(Some(1_000_000), true), all);
    }
}
