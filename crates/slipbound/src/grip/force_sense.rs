//! Correction of a gripper's force reading: its bias is learned while the jaws are open, its noise is measured and
//! averaged out, and a reading that has settled near a constant command is replaced by the commanded force.
//!
//! ```text
//!   reading --- idle reading ---> / noise > --- both settled, and within the driver's error bound? --> commanded force
//!                                 average        | no
//!                                                '--------------------------------------------------> average
//! ```
//!
//! A state may repeat the reading before it: a gripper tells its opening and its jaws in messages of their own, or its
//! sensor is slower than its messages. A repetition carries no information on the noise and is not averaged.
//!
//! The loop, `gripper grasp`, `gripper release` and `check-hold` all use it. A reading without bias and noise is not
//! changed. Commands and faults are based on the result; the record of a run holds the raw reading.

use crate::port::{GripperState, Jaws};

/// Number of readings from which the noise is measured.
const NOISE_COUNT: usize = 24;

/// Quartile of the absolute second difference of white noise over its standard deviation: 0.3186 times sqrt(6). The few
/// readings in which the force changes do not affect the quartile.
const QUARTILE_PER_SD: f64 = 0.780;

/// Noise below which a reading is not filtered, N per finger.
const CLEAN_SD_N: f64 = 0.1;

/// Target noise of the average, N per finger, and the maximum number of readings averaged: half a second at 30 Hz.
const AVERAGE_SD_N: f64 = 0.35;
const MOST_READINGS_COUNT: f64 = 15.0;

/// Longest time for which an equal reading can be a repetition, ns: a sensor at 5 Hz.
const MOST_REPEATED_NS: u64 = 200_000_000;

/// Time for which an average must stay within its band to count as settled, ns.
const STILL_NS: u64 = 200_000_000;

/// Time for which the command must be constant before the remaining difference to the reading counts as a sensor error,
/// ns: jaws follow a moving command with a lag.
const TARGET_STANDS_NS: u64 = 400_000_000;

/// Minimum width of the settling band, N per finger, and the band in standard deviations of the average.
const STILL_N: f64 = 0.25;
const STILL_SD: f64 = 3.0;

/// Error bound of a reading where the driver states none: this force, N per finger, and this share of it.
const ERROR_N: f64 = 2.0;
const ERROR_FRACTION: f64 = 0.2;

/// Difference between command and reading of a clean sensor that is not corrected, N per finger, or as a share.
const EXACT_N: f64 = 0.5;
const EXACT_FRACTION: f64 = 0.05;

/// Smallest share of the commanded force at which a low reading can still be that force.
const LEAST_FRACTION: f64 = 0.5;

/// Maximum number of idle readings averaged; beyond it the oldest lose weight.
const IDLE_COUNT: u32 = 30;

/// Corrects the force reading of a gripper. One per gripper and link.
#[derive(Debug, Clone)]
pub struct ForceSense {
    idle_n: f64,
    idle_count: u32,
    /// Whether the idle reading was set from outside.
    is_idle_set: bool,
    readings_n: [f64; NOISE_COUNT],
    readings_count: usize,
    /// Time of the state with the last new reading, ns, and that reading, N.
    last: Option<(u64, f64)>,
    /// When the reading last changed, ns, and the time from one change to the next: that between two readings.
    changed_ns: u64,
    usual_ns: u64,
    average_n: Option<f64>,
    /// Consecutive readings that leave the average on the same side.
    leaves_count: i32,
    /// Since when the average has been settled, ns, and at which value.
    still: Option<(u64, f64)>,
    is_still: bool,
    /// Since when this force has been commanded, ns and N.
    target: Option<(u64, f64)>,
    /// Factor on the average.
    gain: f64,
}

impl Default for ForceSense {
    fn default() -> Self {
        ForceSense {
            idle_n: 0.0,
            idle_count: 0,
            is_idle_set: false,
            readings_n: [0.0; NOISE_COUNT],
            readings_count: 0,
            last: None,
            changed_ns: 0,
            usual_ns: 0,
            average_n: None,
            leaves_count: 0,
            still: None,
            is_still: true,
            target: None,
            gain: 1.0,
        }
    }
}

impl ForceSense {
    /// Before anything is commanded: learns the idle reading of open jaws, unless `may_touch`, and returns the state
    /// with it subtracted. Nothing else is stored, so that a replayed run begins in the same state.
    pub fn rest(&mut self, state: &GripperState, may_touch: bool) -> GripperState {
        if !may_touch {
            self.learn_idle(state);
        }
        let reading_n = state.force_n.filter(|n| n.is_finite());
        GripperState { force_n: reading_n.map(|n| (n - self.idle_n).max(0.0)), ..*state }
    }

    /// The idle reading, N per finger.
    pub fn idle_n(&self) -> f64 {
        self.idle_n
    }

    /// Sets the idle reading, N per finger; it is not learned any more.
    pub fn set_idle(&mut self, idle_n: f64) {
        (self.idle_n, self.is_idle_set) = (idle_n, true);
    }

    /// The force, N per finger, of jaws that press with more than `start_n` without reporting a hold: the commanded one
    /// if the reading agrees with it, which is then no idle reading, else the reading.
    pub fn pressed_unreported(&mut self, state: &GripperState, start_n: f64) -> Option<f64> {
        let reading_n = state.force_n.filter(|n| n.is_finite() && *n > start_n)?;
        let agrees = |target_n: &f64| (reading_n - target_n).abs() <= error_n(state.force_error_n, *target_n);
        let commanded_n = state.target_n.filter(agrees);
        if commanded_n.is_some() {
            self.set_idle(0.0);
        }
        commanded_n.or(Some(reading_n))
    }

    /// The state with its force corrected. `may_touch`: something may be between the fingers, so the idle reading is
    /// not learned.
    pub fn see(&mut self, now_ns: u64, state: &GripperState, may_touch: bool) -> GripperState {
        let Some(reading_n) = state.force_n.filter(|n| n.is_finite()) else {
            return GripperState { force_n: None, ..*state };
        };
        if self.is_new(state.time_ns, reading_n) {
            if !may_touch {
                self.learn_idle(state);
            }
            self.take(reading_n);
        }
        let average_n = self.average_n.unwrap_or(reading_n - self.idle_n);
        self.look_still(now_ns, average_n);
        let force_n = match state.target_n.filter(|_| state.jaws == Jaws::Holding) {
            Some(target_n) => {
                let since_ns = self.target.filter(|(_, n)| *n == target_n).map_or(now_ns, |(since_ns, _)| since_ns);
                self.target = Some((since_ns, target_n));
                let target_stands = now_ns.saturating_sub(since_ns) >= TARGET_STANDS_NS;
                self.against(average_n, target_n, target_stands, state.force_error_n)
            }
            None => {
                self.target = None;
                self.gain = 1.0;
                average_n
            }
        };
        GripperState { force_n: Some(force_n.max(0.0)), ..*state }
    }

    /// Whether the force has settled. True where no force is measured.
    pub fn is_still(&self) -> bool {
        self.is_still
    }

    /// Whether this is a new reading of the sensor: another value, or the same for as long as a value usually stands.
    fn is_new(&mut self, time_ns: u64, reading_n: f64) -> bool {
        let is_same = self.last.is_some_and(|(_, last_n)| reading_n == last_n);
        let since_ns = self.last.map_or(0, |(last_ns, _)| time_ns.saturating_sub(last_ns));
        if is_same && since_ns < self.usual_ns.max(1) {
            return false;
        }
        if !is_same {
            // The shortest time counts: a sensor of coarse steps repeats values, too, which are new all the same.
            let most_ns = if self.usual_ns == 0 { MOST_REPEATED_NS } else { MOST_REPEATED_NS.min(2 * self.usual_ns) };
            self.usual_ns = time_ns.saturating_sub(self.changed_ns).min(most_ns);
            self.changed_ns = time_ns;
        }
        self.last = Some((time_ns, reading_n));
        true
    }

    /// Standard deviation of the readings, N per finger.
    pub fn noise_n(&self) -> f64 {
        if self.readings_count < NOISE_COUNT {
            return 0.0;
        }
        let at = |back: usize| self.readings_n[(self.readings_count - 1 - back) % NOISE_COUNT];
        let mut steps_n: [f64; NOISE_COUNT - 2] = std::array::from_fn(|i| (at(i) - 2.0 * at(i + 1) + at(i + 2)).abs());
        steps_n.sort_unstable_by(f64::total_cmp);
        steps_n[(NOISE_COUNT - 2) / 4] / QUARTILE_PER_SD
    }

    fn averaged_count(&self, noise_n: f64) -> f64 {
        let ratio = noise_n / AVERAGE_SD_N;
        if noise_n < CLEAN_SD_N { 1.0 } else { (ratio * ratio).clamp(1.0, MOST_READINGS_COUNT) }
    }

    fn learn_idle(&mut self, state: &GripperState) {
        let is_idle = state.jaws == Jaws::Open && !self.is_idle_set;
        if let Some(reading_n) = state.force_n.filter(|n| is_idle && n.is_finite()) {
            self.idle_count = (self.idle_count + 1).min(IDLE_COUNT);
            self.idle_n += (reading_n - self.idle_n) / f64::from(self.idle_count);
        }
    }

    fn take(&mut self, reading_n: f64) {
        self.readings_n[self.readings_count % NOISE_COUNT] = reading_n;
        self.readings_count += 1;
        let noise_n = self.noise_n();
        let (now_n, before_n) = (reading_n - self.idle_n, self.average_n.unwrap_or(reading_n - self.idle_n));
        let share = 2.0 / (self.averaged_count(noise_n) + 1.0);
        // Two readings far off on the same side are not noise: the force has changed.
        let leaves = (now_n - before_n).abs() > STILL_SD * noise_n;
        let way = if now_n > before_n { 1 } else { -1 };
        self.leaves_count = if leaves { way * (self.leaves_count * way).max(0) + way } else { 0 };
        let has_left = self.leaves_count.abs() >= 2;
        self.average_n = Some(if has_left { now_n } else { before_n + share * (now_n - before_n) });
    }

    /// Noise of the average, and the settling band, N per finger.
    fn left_and_band_n(&self) -> (f64, f64) {
        let noise_n = self.noise_n();
        let left_n = noise_n / libm::sqrt(self.averaged_count(noise_n));
        (left_n, STILL_N.max(STILL_SD * left_n))
    }

    fn look_still(&mut self, now_ns: u64, average_n: f64) {
        let (_, band_n) = self.left_and_band_n();
        let (since_ns, still_n) = *self.still.get_or_insert((now_ns, average_n));
        let stays = (average_n - still_n).abs() <= band_n;
        if !stays {
            self.still = Some((now_ns, average_n));
        }
        self.is_still = stays && now_ns.saturating_sub(since_ns) >= STILL_NS;
    }

    /// The force of holding jaws, given the commanded force.
    fn against(&mut self, mut average_n: f64, target_n: f64, target_stands: bool, error_n: Option<f64>) -> f64 {
        let (left_n, band_n) = self.left_and_band_n();
        let exact_n = EXACT_N.max(EXACT_FRACTION * target_n);
        let stated_n = self::error_n(error_n, target_n).max(exact_n) + left_n;
        let is_as_commanded = |force_n: f64| (force_n - target_n).abs() <= stated_n && force_n > 0.0;
        // An idle reading caused by the motor itself vanishes when the jaws press.
        let untared_n = average_n + self.idle_n;
        let has_followed = self.is_still && target_stands;
        if has_followed && !is_as_commanded(average_n) && is_as_commanded(untared_n) {
            (average_n, self.average_n, self.still) = (untared_n, Some(untared_n), None);
            self.set_idle(0.0);
        }
        // A reading near zero gives no valid gain: the next force would be overestimated many times.
        let is_near = is_as_commanded(average_n) && average_n >= LEAST_FRACTION * target_n;
        let is_exact = (average_n * self.gain - target_n).abs() <= exact_n;
        if has_followed && is_near && !is_exact {
            self.gain = target_n / average_n;
        } else if has_followed && !is_as_commanded(average_n) {
            self.gain = 1.0; // what was learned at another force does not explain this one
        }
        let force_n = (average_n * self.gain).clamp(average_n - stated_n, average_n + stated_n);
        // Where the force has settled at the commanded value, the remaining noise carries no information.
        let is_noise = self.noise_n() >= CLEAN_SD_N && self.is_still && (force_n - target_n).abs() <= band_n + exact_n;
        if is_noise { target_n } else { force_n }
    }
}

/// Error bound of a reading, N per finger: the one that the driver states, if any.
fn error_n(stated_n: Option<f64>, target_n: f64) -> f64 {
    stated_n.unwrap_or(ERROR_N.max(ERROR_FRACTION * target_n))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_NS: u64 = 33_333_333;

    fn state(cycle: u64, force_n: f64, target_n: f64, jaws: Jaws) -> GripperState {
        let (target_n, force_n) = (Some(target_n), Some(force_n));
        GripperState { time_ns: cycle, force_n, force_error_n: None, target_n, opening_mm: None, jaws }
    }

    /// White noise of this standard deviation, always the same sequence.
    fn noise(sd_n: f64) -> impl FnMut() -> f64 {
        let mut random = 7u64;
        move || {
            let mut draw = || {
                random = crate::random::next(random);
                (random >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            };
            sd_n * (0..12).map(|_| draw()).sum::<f64>()
        }
    }

    /// Jaws that are open for a second, close, and press with 10 N and then 20 N; the corrected force at the end of
    /// each stage.
    fn run(bias_n: f64, gain: f64, noise_n: f64) -> [f64; 3] {
        let (mut sense, mut noise) = (ForceSense::default(), noise(noise_n));
        let mut told = [0.0; 3];
        for cycle in 0..150u64 {
            let (stage, true_n, jaws) = match cycle {
                0..30 => (0, 0.0, Jaws::Open),
                30..90 => (1, 10.0 * (1.0 - libm::exp(-((cycle - 29) as f64) * 0.4)), Jaws::Holding),
                _ => (2, 20.0 - 10.0 * libm::exp(-((cycle - 89) as f64) * 0.4), Jaws::Holding),
            };
            let read_n = true_n * gain + bias_n + noise();
            let target_n = if stage == 2 { 20.0 } else { 10.0 };
            let state = state(cycle, read_n, target_n, jaws);
            told[stage] = sense.see(cycle * CYCLE_NS, &state, jaws != Jaws::Open).force_n.expect("measured");
        }
        told
    }

    #[test]
    fn a_clean_reading_passes_through_as_it_is() {
        let mut sense = ForceSense::default();
        for cycle in 0..200u64 {
            let force_n = if cycle < 30 { 0.0 } else { 10.0 * (1.0 - libm::exp(-((cycle - 29) as f64) * 0.4)) };
            let jaws = if cycle < 30 { Jaws::Open } else { Jaws::Holding };
            let state = state(cycle, force_n, 10.0, jaws);
            assert_eq!(sense.see(cycle * CYCLE_NS, &state, cycle >= 30), state, "cycle {cycle}");
        }
    }

    #[test]
    fn bias_gain_and_noise_are_taken_out_of_a_force_that_has_settled() {
        for bias_n in [-3.0, 0.0, 3.0] {
            for gain in [0.85, 1.0, 1.15] {
                for noise_n in [0.0, 0.5, 1.0, 2.0] {
                    let [open_n, low_n, high_n] = run(bias_n, gain, noise_n);
                    let what = format!("bias {bias_n} gain {gain} noise {noise_n}: {open_n} {low_n} {high_n}");
                    assert!(open_n <= 0.05 + noise_n, "{what}");
                    assert!((low_n - 10.0).abs() <= 0.51 && (high_n - 20.0).abs() <= 1.01, "{what}");
                }
            }
        }
    }

    /// A gripper that says something every 5 ms, and whose sensor is read every 20 ms, or 100 ms.
    #[test]
    fn a_repeated_reading_does_not_count_again() {
        for repeats_count in [4, 20] {
            let (mut sense, mut noise) = (ForceSense::default(), noise(0.5));
            let mut read_n = 0.0;
            for message in 0..100 * repeats_count {
                if message % repeats_count == 0 {
                    read_n = 10.0 + noise();
                }
                let time_ns = message * 5_000_000;
                sense.see(time_ns, &state(time_ns, read_n, 10.0, Jaws::Holding), true);
            }
            assert!((0.25..1.0).contains(&sense.noise_n()), "{}", sense.noise_n());
        }
    }

    /// A motor reading that is present with open jaws and absent when the jaws press.
    #[test]
    fn an_idle_reading_that_goes_when_the_jaws_press_is_noticed() {
        let mut sense = ForceSense::default();
        let mut told_n = 0.0;
        for cycle in 0..120u64 {
            let (read_n, jaws) = if cycle < 30 { (9.0, Jaws::Open) } else { (20.0, Jaws::Holding) };
            let state = state(cycle, read_n, 20.0, jaws);
            told_n = sense.see(cycle * CYCLE_NS, &state, cycle >= 30).force_n.expect("measured");
        }
        assert!((told_n - 20.0).abs() < 0.5, "{told_n}");
    }

    /// The reading is right, the jaws reach three quarters of the force.
    #[test]
    fn what_was_an_error_of_the_reading_at_a_light_grip_hides_no_shortfall_at_a_strong_one() {
        let mut sense = ForceSense::default();
        let mut told_n = |cycle: u64, target_n: f64| {
            let force_n = 0.75 * target_n;
            let state = state(cycle, force_n, target_n, Jaws::Holding);
            let state = GripperState { force_error_n: Some(1.5 + 0.15 * force_n), ..state };
            sense.see(cycle * CYCLE_NS, &state, true).force_n.expect("measured")
        };
        let light_n: Vec<f64> = (0..60).map(|cycle| told_n(cycle, 10.0)).collect();
        assert!((light_n[59] - 10.0).abs() < 1e-9, "within the error: {}", light_n[59]);
        let strong_n: Vec<f64> = (60..120).map(|cycle| told_n(cycle, 60.0)).collect();
        assert!(strong_n.iter().all(|n| *n <= 45.0 + 8.25 + 1e-9), "{strong_n:?}");
        assert!((strong_n[59] - 45.0).abs() < 1e-9, "{}", strong_n[59]);
    }

    /// A controller that raises the force slowly, with jaws that follow with a lag.
    #[test]
    fn jaws_that_follow_a_command_behind_are_no_wrong_sensor() {
        let mut sense = ForceSense::default();
        let mut true_n = 5.0;
        for cycle in 0..300u64 {
            let target_n = if cycle < 30 { 5.0 } else { 5.0 + 0.04 * (cycle - 30) as f64 };
            true_n += 0.05 * (target_n - true_n);
            let state = state(cycle, true_n, target_n, Jaws::Holding);
            let told_n = sense.see(cycle * CYCLE_NS, &state, true).force_n.expect("measured");
            assert!((told_n - true_n).abs() < 1e-9, "cycle {cycle}: {told_n} of {true_n}, {target_n} commanded");
        }
    }

    #[test]
    fn a_force_that_is_not_there_is_not_made_up() {
        let mut sense = ForceSense::default();
        for cycle in 0..120u64 {
            let state = state(cycle, 4.0, 20.0, Jaws::Holding);
            assert_eq!(sense.see(cycle * CYCLE_NS, &state, true).force_n, Some(4.0));
        }
        // A reading near zero, within the error bound of a light grip, must not multiply the grip that follows by a
        // hundred.
        let mut sense = ForceSense::default();
        for cycle in 0..120u64 {
            let (force_n, target_n) = if cycle < 60 { (0.02, 2.0) } else { (10.0, 10.0) };
            let told = sense.see(cycle * CYCLE_NS, &state(cycle, force_n, target_n, Jaws::Holding), true).force_n;
            assert!(told.is_some_and(|told_n| told_n <= force_n + 0.1), "cycle {cycle}: {told:?}");
        }
        // A drop is detected even after the force has settled.
        let mut sense = ForceSense::default();
        let told_n: Vec<f64> = (0..120u64)
            .map(|cycle| {
                let force_n = if cycle < 90 { 17.5 } else { 3.0 };
                sense
                    .see(cycle * CYCLE_NS, &state(cycle, force_n, 20.0, Jaws::Holding), true)
                    .force_n
                    .expect("measured")
            })
            .collect();
        assert!((told_n[80] - 20.0).abs() < 1e-9 && told_n[95] < 4.0, "{} {}", told_n[80], told_n[95]);
    }
}
