//! Whether a finger's newest frame is recent: its age, and its lag behind the frames of the other fingers.
//!
//! The age is measured on the loop's clock from the arrival of the frame. The lag behind another finger is measured
//! with the cameras' times, whose clocks need not agree: it is the change of their difference since the first frames,
//! some of which may have arrived late.

/// Age of a finger's newest frame, and lag of its frames behind those of another finger, beyond which it is not live,
/// ns: three frames at 30 Hz.
const STALE_NS: u64 = 100_000_000;

/// Maximum drift rate between the clocks of two cameras: a lag that grows no faster is ignored.
const CLOCK_DRIFT_FRACTION: f64 = 1e-3;

/// Jump of a camera's clock against the loop's clock that counts as a new clock, ns: the camera was plugged in again. A
/// smaller jump counts too if no lag explains it: its time runs backwards, or frames arrive earlier than ever before (a
/// clock that was set). So does a gap without frames in which the clock may have drifted by as much as a lag.
const NEW_CLOCK_NS: i128 = 1_000_000_000;

/// Number of first frames whose median difference is taken as the clock offset: half a second at 30 Hz. A single frame
/// delayed by a busy computer would distort it for minutes.
const FIRST_COUNT: usize = 15;

/// Clock offset of a finger relative to the first finger.
#[derive(Debug, Clone, Copy, Default)]
struct ClockOffset {
    /// The offset in the first frames, ns, and their number.
    first_ns: [f64; FIRST_COUNT],
    count: usize,
    /// Estimated offset, ns.
    ns: f64,
}

impl ClockOffset {
    /// How far a frame is ahead of one of the first finger, ns, from the difference of their times. `is_new`: one of
    /// them is new.
    fn lead_ns(&mut self, difference_ns: f64, is_new: bool, drift_ns: f64) -> f64 {
        if is_new && self.count < FIRST_COUNT {
            self.first_ns[self.count] = difference_ns;
            self.count += 1;
            let mut sorted_ns = self.first_ns;
            let sorted_ns = &mut sorted_ns[..self.count];
            sorted_ns.sort_unstable_by(f64::total_cmp);
            self.ns = sorted_ns[self.count / 2];
            return difference_ns - self.ns;
        }
        let lead_ns = difference_ns - self.ns;
        self.ns += lead_ns.clamp(-drift_ns, drift_ns);
        lead_ns
    }
}

/// Arrival times and delays of the frames of a finger.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Freshness {
    /// A frame that arrived since the last report: its camera time, ns, where it has one.
    new: Option<Option<u64>>,
    /// Arrival of its newest frame, ns of the loop.
    seen_ns: Option<u64>,
    /// Time of the newest frame that could be judged, ns of its camera, and its arrival, ns of the loop.
    time_ns: Option<u64>,
    timed_ns: u64,
    /// The smallest difference between the two, ns of different clocks.
    least_delay_ns: i128,
    clock_offset: ClockOffset,
    /// Whether a frame with a time has arrived since the last report, and whether its time is of a new clock.
    has_new: bool,
    is_new_clock: bool,
    is_stale: bool,
}

impl Freshness {
    /// A frame with this time has arrived; None where its time is unknown or not from the camera's clock.
    pub fn see(&mut self, time_ns: Option<u64>) {
        self.new = Some(time_ns);
    }

    /// Arrival of its newest frame, ns of the loop.
    pub fn seen_ns(&self) -> Option<u64> {
        self.seen_ns
    }

    /// Whether it is too old, or too far behind another finger's.
    pub fn is_stale(&self) -> bool {
        self.is_stale
    }

    fn is_outdated(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.timed_ns) > STALE_NS
    }

    fn advance_to(&mut self, now_ns: u64) {
        (self.has_new, self.is_new_clock) = (false, false);
        if let Some(time_ns) = self.new.take() {
            self.seen_ns = Some(now_ns);
            if let Some(time_ns) = time_ns {
                self.take_time(now_ns, time_ns);
            }
        }
        self.is_stale = self.seen_ns.is_some_and(|seen_ns| now_ns.saturating_sub(seen_ns) > STALE_NS);
    }

    fn take_time(&mut self, now_ns: u64, time_ns: u64) {
        self.has_new = true;
        // Clocks may have any offset: the difference of any two fits.
        let delay_ns = i128::from(now_ns) - i128::from(time_ns);
        match self.time_ns {
            // Offsets relative to another finger end when this one, before it in order, gets its first time.
            None => (self.least_delay_ns, self.is_new_clock) = (delay_ns, true),
            Some(last_ns) => {
                let passed_ns = now_ns.saturating_sub(self.timed_ns);
                let jump_ns = i128::from(time_ns) - i128::from(last_ns) - i128::from(passed_ns);
                let stale_ns = i128::from(STALE_NS);
                let drift_ns = (passed_ns as f64 * CLOCK_DRIFT_FRACTION) as i128;
                self.least_delay_ns += drift_ns;
                self.is_new_clock = jump_ns.abs() > NEW_CLOCK_NS
                    || drift_ns > stale_ns
                    || time_ns < last_ns && jump_ns < -stale_ns
                    || delay_ns < self.least_delay_ns - stale_ns;
                self.least_delay_ns = if self.is_new_clock { delay_ns } else { self.least_delay_ns.min(delay_ns) };
            }
        }
        (self.time_ns, self.timed_ns) = (Some(time_ns), now_ns);
    }
}

/// Advances the fingers to a time of the loop. `step_ns`: time since the last call.
pub(super) fn advance<'a>(fingers: impl Iterator<Item = &'a mut Freshness>, now_ns: u64, step_ns: u64) {
    let drift_ns = step_ns as f64 * CLOCK_DRIFT_FRACTION;
    let mut first: Option<&mut Freshness> = None;
    for finger in fingers {
        finger.advance_to(now_ns);
        let Some(time_ns) = finger.time_ns else { continue };
        let Some(first) = &mut first else {
            first = Some(finger);
            continue;
        };
        // If the first finger has a new clock, the offsets of all others are void.
        if finger.is_new_clock || first.is_new_clock {
            finger.clock_offset = ClockOffset::default();
        }
        // Without recent frames neither lag nor clock drift is known.
        if finger.is_outdated(now_ns) || first.is_outdated(now_ns) {
            continue;
        }
        let difference_ns = time_ns as f64 - first.time_ns.unwrap_or(time_ns) as f64;
        let lead_ns = finger.clock_offset.lead_ns(difference_ns, finger.has_new || first.has_new, drift_ns);
        finger.is_stale |= lead_ns < -(STALE_NS as f64);
        first.is_stale |= lead_ns > STALE_NS as f64;
    }
}
