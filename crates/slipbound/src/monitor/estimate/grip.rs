//! The grip force of a contact, from the gripper's readings.
//!
//! ```text
//!   reading --> above 0, and not half or twice the mean for less than 0.05 s --> mean over 0.1 s --> held for 0.3 s
//! ```
//! Grippers are read less often than cameras, readings are noisy, and one can be wrong: none of this is a change of the
//! grip.

use crate::port::GripSample;
use crate::smoothing;

/// Time constant of the mean, s, and its largest deviation from the reading, N and as a share of it. Without that limit
/// the reading of a grip that grows at 60 N/s would be 6 N ahead of the mean, and the load would seem to use a third more
/// of it.
const MEAN_S: f64 = 0.1;
const BEHIND_N: f64 = 1.2;
const BEHIND_FRACTION: f64 = 0.05;

/// Time for which the mean holds without a reading, s: grippers are read less often than cameras.
const HOLDS_S: f64 = 0.3;

/// A reading below half or above twice the mean, and this far from it, N, counts only once a later one confirms it, at
/// least this long after it, s: no gripper changes its force as fast, and a camera may be faster than the readings.
const STRAY_FACTOR: f64 = 2.0;
const STRAY_N: f64 = 3.0;
const CONFIRMED_S: f64 = 0.05;

/// The grip force of a contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Grip {
    mean_n: Option<f64>,
    last_mean_n: Option<f64>,
    reading_n: Option<f64>,
    /// Time since the last reading, s.
    unread_s: f64,
    /// A reading that is not believed yet, N, and the time since it, s.
    doubted: Option<(f64, f64)>,
}

impl Grip {
    /// A new contact.
    pub fn clear(&mut self) {
        *self = Grip::default();
    }

    /// Takes the reading of a frame. `is_squeezed`: whether the contact has settled; then 0 N is no reading, and neither
    /// is a force that is read for a moment alone.
    pub fn take(&mut self, sample: Option<GripSample>, elapsed_s: f64, is_squeezed: bool) {
        let usable = |n: &f64| n.is_finite() && (*n > 0.0 || *n == 0.0 && !is_squeezed);
        let reading_n = sample.map(|sample| sample.force_n).filter(usable);
        self.doubted = self.doubted.map(|(force_n, since_s)| (force_n, since_s + elapsed_s));
        let Some(force_n) = reading_n.filter(|&force_n| !is_squeezed || self.believes(force_n)) else {
            self.unread_s += elapsed_s;
            if self.unread_s > HOLDS_S {
                (self.mean_n, self.reading_n) = (None, None);
            }
            return;
        };
        self.unread_s = 0.0;
        let share = smoothing::weight(elapsed_s, MEAN_S);
        let before_n = self.mean_n.unwrap_or(force_n);
        let most_n = BEHIND_N.max(BEHIND_FRACTION * force_n);
        let mean_n = (before_n + share * (force_n - before_n)).clamp(force_n - most_n, force_n + most_n);
        (self.mean_n, self.last_mean_n, self.reading_n) = (Some(mean_n), Some(mean_n), Some(force_n));
    }

    /// Whether a reading is near the mean, or confirms an earlier one that is not.
    fn believes(&mut self, force_n: f64) -> bool {
        // A reading that goes on from a doubted one in the same direction: a grip that changes fast.
        let goes_on = |mean_n: f64, (doubted_n, _): (f64, f64)| {
            (force_n - doubted_n).abs() > STRAY_N && (force_n - doubted_n) * (doubted_n - mean_n) > 0.0
        };
        if self.mean_n.zip(self.doubted).is_some_and(|(mean_n, doubted)| goes_on(mean_n, doubted)) {
            self.doubted = None;
            return true;
        }
        if self.mean_n.is_none_or(|mean_n| !is_stray(force_n, mean_n)) {
            self.doubted = None;
            return true;
        }
        match self.doubted.filter(|(doubted_n, _)| !is_stray(force_n, *doubted_n)) {
            Some((_, since_s)) if since_s >= CONFIRMED_S => {
                self.doubted = None;
                true
            }
            Some(_) => false,
            None => {
                self.doubted = Some((force_n, 0.0));
                false
            }
        }
    }

    /// The mean, N; None where there has been no reading for too long.
    pub fn mean_n(&self) -> Option<f64> {
        self.mean_n
    }

    /// The mean, or the last one known in this contact, N: the gel stays squeezed when readings fail.
    pub fn last_mean_n(&self) -> Option<f64> {
        self.last_mean_n
    }

    /// The last reading, N; None where it is too old.
    pub fn reading_n(&self) -> Option<f64> {
        self.reading_n
    }
}

fn is_stray(force_n: f64, mean_n: f64) -> bool {
    let differs = force_n > STRAY_FACTOR * mean_n || STRAY_FACTOR * force_n < mean_n;
    differs && (force_n - mean_n).abs() > STRAY_N
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means after each reading of a settled contact at 30 Hz; the first is 20 N.
    fn means(readings_n: &[Option<f64>]) -> Vec<Option<f64>> {
        let mut grip = Grip::default();
        let all = [Some(20.0); 10].iter().chain(readings_n);
        let of = |reading_n: &Option<f64>| {
            grip.take(reading_n.map(|force_n| GripSample { force_n }), 1.0 / 30.0, true);
            grip.mean_n()
        };
        all.map(of).skip(10).collect()
    }

    #[test]
    fn a_wrong_reading_is_none_and_one_that_is_confirmed_counts() {
        for wrong_n in [0.0, 1.0, 9.0, 60.0] {
            let readings_n = [wrong_n, 20.0, wrong_n, wrong_n, 20.0].map(Some);
            assert_eq!(means(&readings_n), [Some(20.0); 5], "{wrong_n}: a reading may be seen in two frames");
        }
        assert_eq!(means(&[Some(1.0), Some(60.0), Some(1.0), Some(60.0)]), [Some(20.0); 4], "no two agree");
        assert_eq!(means(&[Some(9.0), Some(9.0), Some(9.0)]), [Some(20.0), Some(20.0), Some(10.2)]);
        assert_eq!(means(&[Some(12.0)]), [Some(13.2)], "a firm gripper that lets go a little");
    }

    #[test]
    fn a_grip_that_changes_several_fold_in_a_few_frames_is_followed() {
        let grows = means(&[45.0, 60.0, 75.0, 90.0].map(Some));
        assert_eq!(grows, [20.0, 57.0, 71.25, 85.5].map(Some), "only the first reading far from the mean is doubted");
        assert_eq!(means(&[9.0, 5.0].map(Some)), [20.0, 6.2].map(Some), "likewise where it falls");
        assert_eq!(means(&[45.0, 46.0].map(Some)), [20.0, 20.0].map(Some), "the same reading, seen in two frames");
    }

    #[test]
    fn no_force_and_less_are_no_readings_and_the_last_mean_holds_for_a_while() {
        for none in [Some(0.0), Some(-20.0), Some(f64::NAN), None] {
            let told = means(&[none; 12]);
            assert_eq!((told[8], told[10]), (Some(20.0), None), "{none:?}");
        }
        let mut grip = Grip::default();
        for force_n in [0.0, 0.0, 4.0] {
            grip.take(Some(GripSample { force_n }), 1.0 / 30.0, false);
        }
        assert_eq!(grip.mean_n(), Some(2.8), "a press begins at 0 N");
        grip.take(None, 1.0, true);
        assert_eq!((grip.mean_n(), grip.reading_n(), grip.last_mean_n()), (None, None, Some(2.8)));
        grip.clear();
        assert_eq!(grip.last_mean_n(), None);
    }
}
