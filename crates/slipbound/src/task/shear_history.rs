//! Shear of the gels over the turn of the wrist: does the torque still grow, is it flat, has it fallen?
//!
//! ```text
//!   shear |        ______ flat: the cap no longer follows      shear |  .-.
//!         |     .-'                                                  | /   '.______ fallen: broken loose
//!         |  .-'                                                     |/
//!         +----------------> turn                                    +------------> turn
//! ```

use super::ground::{AWAY_NS, Fingers, SETS_COUNT, fingers_of};
use crate::hand::HandReport;

/// Number of samples, evenly spaced over the turn: the longest window has [`STEPS_COUNT`] of them, so that a window
/// fills at any loop rate and wrist speed.
const SAMPLES_COUNT: usize = 64;
const STEPS_COUNT: f64 = 48.0;

/// Turns closer than this are the same, rad.
const SAME_RAD: f64 = 1e-4;

/// Change of shear below which it counts as constant, mm: three times the noise of a mean over a contact's markers.
const NOISE_MM: f64 = 0.015;

/// Share of a window that is averaged for its beginning and for its end.
const QUARTER: f64 = 0.25;

/// Share of its peak below which the shear has fallen. A sliding contact keeps its friction; the worst elastomers lose
/// a quarter of it in sliding.
const FALLEN_FRACTION: f64 = 0.7;

/// Shear over turn, since the grip last changed.
#[derive(Debug, Clone)]
pub(super) struct ShearHistory {
    /// Minimum turn between two samples, rad.
    step_rad: f64,
    samples: [(f64, f64); SAMPLES_COUNT],
    count: usize,
    peak_mm: f64,
    fallen_at_rad: Option<f64>,
}

impl ShearHistory {
    /// Stores enough samples for windows up to this one, rad.
    pub fn new(longest_window_rad: f64) -> Self {
        let step_rad = (longest_window_rad / STEPS_COUNT).max(SAME_RAD);
        ShearHistory { step_rad, samples: [(0.0, 0.0); SAMPLES_COUNT], count: 0, peak_mm: 0.0, fallen_at_rad: None }
    }

    /// For a new grip: shear is compared only with later samples. The peak is kept.
    fn restart(&mut self) {
        self.count = 0;
    }

    /// After an absence: what was turned meanwhile was not seen, so a fall counts from the next sample on.
    fn resume(&mut self) {
        self.restart();
        self.fallen_at_rad = None;
    }

    /// Adds the shear, in the sense of the task, at this turned angle. The newest sample is replaced until it is a full
    /// step away from the one before.
    fn see(&mut self, turned_rad: f64, shear_mm: f64) {
        self.peak_mm = self.peak_mm.max(shear_mm);
        let fallen = shear_mm < FALLEN_FRACTION * self.peak_mm;
        self.fallen_at_rad = if fallen { self.fallen_at_rad.or(Some(turned_rad)) } else { None };
        let is_full_step = match self.samples[..self.count] {
            [.., before, last] => (last.0 - before.0).abs() >= self.step_rad,
            _ => true,
        };
        if let Some(last) = self.samples[..self.count].last_mut() {
            match is_full_step {
                false => return *last = (turned_rad, shear_mm),
                true if (last.0 - turned_rad).abs() < SAME_RAD => return last.1 = shear_mm,
                true => {}
            }
        }
        if self.count == SAMPLES_COUNT {
            self.samples.rotate_left(1);
            self.count -= 1;
        }
        self.samples[self.count] = (turned_rad, shear_mm);
        self.count += 1;
    }

    /// Whether over the last `window_rad` of turning the shear grew by no more than `fraction` of itself: from end to
    /// end of the window, and between the means of its first and last quarter, because one frame is noisy.
    pub fn is_flat(&self, window_rad: f64, fraction: f64) -> bool {
        let samples = &self.samples[..self.count];
        let Some(&(now_rad, now_mm)) = samples.last() else { return false };
        let Some(first) = samples.iter().rposition(|(at_rad, _)| now_rad - at_rad >= window_rad) else { return false };
        let window = &samples[first..];
        let quarter_rad = QUARTER * (now_rad - window[0].0);
        let mean_mm = |some: &mut dyn Iterator<Item = &(f64, f64)>| {
            let (sum_mm, count) = some.fold((0.0, 0.0), |(sum, count), (_, mm)| (sum + mm, count + 1.0));
            sum_mm / count
        };
        let early_mm = mean_mm(&mut window.iter().take_while(|(at_rad, _)| at_rad - window[0].0 <= quarter_rad));
        let late_mm = mean_mm(&mut window.iter().rev().take_while(|(at_rad, _)| now_rad - at_rad <= quarter_rad));
        let most_mm = (fraction * now_mm.abs()).max(NOISE_MM);
        now_mm - window[0].1 <= most_mm && (late_mm - early_mm) / (1.0 - QUARTER) <= most_mm
    }

    /// How far the wrist has turned since the shear fell well below its peak; None while it has not.
    pub fn fallen_for_rad(&self, turned_rad: f64, least_peak_mm: f64) -> Option<f64> {
        let at_rad = self.fallen_at_rad.filter(|_| self.peak_mm >= least_peak_mm)?;
        Some(turned_rad - at_rad)
    }
}

/// A [`ShearHistory`] of each set of fingers: one finger alone feels another shear than both, so a finger that drops out
/// or comes back is no change of torque.
#[derive(Debug, Clone)]
pub(super) struct ShearHistories {
    of_none: ShearHistory,
    /// By when they were last seen, ns; the newest first.
    of_sets: [Option<(Fingers, u64, ShearHistory)>; SETS_COUNT],
}

impl ShearHistories {
    /// See [`ShearHistory::new`].
    pub fn new(longest_window_rad: f64) -> Self {
        ShearHistories { of_none: ShearHistory::new(longest_window_rad), of_sets: [const { None }; SETS_COUNT] }
    }

    /// For a new grip: see [`ShearHistory::restart`].
    pub fn restart(&mut self) {
        self.of_sets.iter_mut().flatten().for_each(|(.., history)| history.restart());
    }

    /// The fingers behind a report with shear; what follows is about their history.
    pub fn turn_to(&mut self, now_ns: u64, hand: &HandReport) {
        let fingers = fingers_of(hand);
        let of_these = self.of_sets.iter().position(|set| set.as_ref().is_some_and(|(of, ..)| *of == fingers));
        self.of_sets[..=of_these.unwrap_or(SETS_COUNT - 1)].rotate_right(1);
        match (&mut self.of_sets[0], of_these) {
            (Some((_, seen_ns, history)), Some(before)) => {
                let away_ns = now_ns.saturating_sub(std::mem::replace(seen_ns, now_ns));
                if before > 0 && away_ns > AWAY_NS {
                    history.resume();
                }
            }
            (newest, _) => *newest = Some((fingers, now_ns, self.of_none.clone())),
        }
    }

    /// Adds the shear that these fingers feel: see [`ShearHistory::see`].
    pub fn see(&mut self, turned_rad: f64, shear_mm: f64) {
        if let Some((.., history)) = &mut self.of_sets[0] {
            history.see(turned_rad, shear_mm);
        }
    }

    /// The history of these fingers.
    pub fn newest(&self) -> &ShearHistory {
        self.of_sets[0].as_ref().map_or(&self.of_none, |(.., history)| history)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_still_grows_is_not_flat_and_what_grew_before_the_window_does_not_count() {
        let mut history = ShearHistory::new(0.07);
        for i in 0..40 {
            let turned_rad = 0.01 * f64::from(i);
            history.see(turned_rad, (0.05 * f64::from(i)).min(1.0));
            let flat = history.is_flat(0.069, 0.03);
            assert_eq!(flat, i >= 20 + 7, "after {turned_rad} rad");
        }
        history.restart();
        assert!(!history.is_flat(0.07, 0.03), "a new grip begins anew");
    }

    #[test]
    fn a_fall_counts_from_where_it_fell_and_not_when_the_shear_comes_back() {
        let mut history = ShearHistory::new(0.2);
        for (turned_rad, shear_mm) in [(0.0, 0.2), (0.1, 1.0), (0.2, 0.3), (0.3, 0.2)] {
            history.see(turned_rad, shear_mm);
        }
        assert!((history.fallen_for_rad(0.3, 0.5).expect("fallen") - 0.1).abs() < 1e-12);
        assert_eq!(history.fallen_for_rad(0.3, 1.5), None, "a peak that was none");
        history.see(0.4, 0.9);
        assert_eq!(history.fallen_for_rad(0.4, 0.5), None);
    }

    /// 64 samples of a window that holds 480: it fills all the same, and is judged at its ends.
    #[test]
    fn a_window_fills_however_fine_the_samples_are() {
        for step_rad in [1e-5, 1e-4, 7e-4, 0.01, 0.1] {
            let mut history = ShearHistory::new(0.35);
            let (mut turned_rad, mut flat_at_rad) = (0.0, None);
            while turned_rad < 1.5 && flat_at_rad.is_none() {
                history.see(turned_rad, (2.0 * turned_rad).min(1.0));
                flat_at_rad = history.is_flat(0.35, 0.03).then_some(turned_rad);
                turned_rad += step_rad;
            }
            let at_rad = flat_at_rad.expect("flat");
            assert!((0.83..=0.85 + 1.01 * step_rad).contains(&at_rad), "{step_rad}: {at_rad}");
        }
    }
}
