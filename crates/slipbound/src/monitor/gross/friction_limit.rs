//! Whether the friction limit is reached, from the estimates alone: used fraction and stick ratio, smoothed.
//!
//! ```text
//!   used, stick (step 6) --first-order filter--> at least 0.94 used, at most 0.18 stick?  reached, until well below
//! ```
//! The filter keeps the usual error of a frame from starting or ending a slide. The result is the same whether or not
//! every step runs in every frame.

use crate::monitor::report::Estimate;
use crate::smoothing;

/// Least used fraction and largest stick ratio at the friction limit, both smoothed with this time constant, s. Chosen
/// together with the probability from which motion alone is reported, among a thousand settings, on 600 ramps of two
/// seeds, so that false alarms (below 0.8 of the load) stay below half a per cent there: two, and 567 slides reported
/// within two frames of gross slip; by motion alone, from .95 on, five and 546. On 600 ramps of a third, held-out seed:
/// five and 580.
const USED: f64 = 0.94;
const STICK: f64 = 0.18;
const SMOOTH_S: f64 = 0.04;

/// Used fraction and stick ratio with which a slide detected from the estimates alone continues.
pub(super) const CONTINUE_USED: f64 = 0.8;
pub(super) const CONTINUE_STICK: f64 = 0.3;

/// Largest time step of the filter, s, for a frame after a gap. Time without new motion of contact or load after which
/// the slide ends, s: the estimates are then those of a motion that may have ended, and one that continues moves the
/// imprint.
const STEP_S: f64 = 1.0 / 30.0;
const LASTS_S: f64 = 0.3;

#[derive(Debug, Clone, Copy)]
pub(super) struct FrictionLimit {
    at_s: Option<f64>,
    /// When contact or load last moved, so that the estimates were new.
    moved_s: Option<f64>,
    used: f64,
    stick: f64,
    /// Whether the limit is reached: all of the friction is used.
    pub is_reached: bool,
}

impl FrictionLimit {
    pub fn new() -> Self {
        FrictionLimit { at_s: None, moved_s: None, used: 0.0, stick: 1.0, is_reached: false }
    }

    /// Adds the estimates of a frame.
    pub fn see(&mut self, at_s: f64, used: f64, stick: Estimate) {
        let elapsed_s = self.at_s.replace(at_s).map_or(0.0, |before_s| (at_s - before_s).clamp(0.0, STEP_S));
        let share = smoothing::weight(elapsed_s, SMOOTH_S);
        self.used += share * (used - self.used);
        self.stick += share * (stick.value - self.stick);
        if stick.age_frames == 0 {
            self.moved_s = Some(at_s);
        }
        let is_at_limit = self.used >= USED && self.stick <= STICK
            || self.is_reached && self.used >= CONTINUE_USED && self.stick <= CONTINUE_STICK;
        self.is_reached = is_at_limit && self.moved_s.is_some_and(|moved_s| at_s - moved_s <= LASTS_S);
    }

    /// Adds a frame without estimates. The filter keeps its state: markers lost for a moment are not another motion.
    pub fn pause(&mut self) {
        self.is_reached = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Verdicts on the frames, (used, stick, age in frames) each, that follow 0.9 and 0.3, which is not enough.
    fn said_of(rate_hz: f64, then: &[(f64, f64, u32)]) -> Vec<bool> {
        let (mut limit, before) = (FrictionLimit::new(), [(0.9, 0.3, 0); 40]);
        let mut see = |(frame, &(used, value, age_frames)): (usize, &(f64, f64, u32))| {
            limit.see(frame as f64 / rate_hz, used, Estimate { value, sd: 0.1, age_frames });
            limit.is_reached
        };
        let said: Vec<bool> = before.iter().chain(then).enumerate().map(&mut see).collect();
        assert!(!said[..before.len()].contains(&true));
        said[before.len()..].to_vec()
    }

    #[test]
    fn most_used_and_hardly_any_stick_are_spent_after_the_same_time_at_every_rate() {
        for rate_hz in [30.0, 60.0, 90.0] {
            let first = said_of(rate_hz, &[(0.97, 0.1, 0); 30]).iter().position(|says| *says).expect("it is spent");
            let after_ms = 1000.0 * (first + 1) as f64 / rate_hz;
            assert!((33.0..=67.0).contains(&after_ms), "{after_ms} ms at {rate_hz} Hz");
        }
    }

    #[test]
    fn less_is_not_spent_nor_is_a_frame() {
        let never = |rate_hz, then: &[_]| !said_of(rate_hz, then).contains(&true);
        assert!(never(30.0, &[(0.935, 0.1, 0); 60]) && !never(30.0, &[(0.945, 0.1, 0); 60]), "used");
        assert!(never(30.0, &[(0.97, 0.185, 0); 60]) && !never(30.0, &[(0.97, 0.175, 0); 60]), "sticks");
        let error = [(0.96, 0.1, 0), (0.9, 0.3, 0), (0.9, 0.3, 0)];
        assert!(never(30.0, &error) && never(5.0, &error), "a frame is an error, at a slow camera, too");
        assert!(!never(30.0, &[(1.0, 0.0, 1); 9]), "estimates of a motion just before still tell");
    }

    #[test]
    fn it_ends_with_less_load_and_with_a_motion_that_ends() {
        let after_five = |then: &[(f64, f64, u32)]| {
            let said = said_of(30.0, &[&[(1.0, 0.05, 0); 5], then].concat());
            assert!(said[4], "it slides");
            said[5..].to_vec()
        };
        assert!(!after_five(&[(0.82, 0.28, 0); 60]).contains(&false), "it goes on with less than it begins with");
        for gripped in [(0.78, 0.05, 0), (0.97, 0.32, 0), (0.7, 0.4, 0)] {
            assert!(!after_five(&[gripped; 60])[20..].contains(&true), "gripped anew: {gripped:?}");
        }
        let stands: Vec<_> = (1..=30).map(|age_frames| (1.0, 0.0, age_frames)).collect();
        let stood = after_five(&stands).iter().take_while(|says| **says).count();
        assert!((8..=9).contains(&stood), "0.3 s after the last motion nothing is known of another: {stood} frames");
    }

    #[test]
    fn markers_that_are_lost_in_one_frame_do_not_end_it_for_good() {
        let mut limit = FrictionLimit::new();
        for frame in 0..10 {
            limit.see(f64::from(frame) / 30.0, 1.0, Estimate { value: 0.0, sd: 0.1, age_frames: 0 });
        }
        assert!(limit.is_reached);
        limit.pause();
        assert!(!limit.is_reached);
        limit.see(11.0 / 30.0, 1.0, Estimate { value: 0.0, sd: 0.1, age_frames: 1 });
        assert!(limit.is_reached);
    }

    #[test]
    fn nothing_has_been_seen_to_move_from_the_first_frame_on_when_it_is_old() {
        let mut limit = FrictionLimit::new();
        for frame in 0..60 {
            limit.see(f64::from(frame) / 30.0, 1.0, Estimate { value: 0.0, sd: 0.1, age_frames: frame + 1 });
            assert!(!limit.is_reached);
        }
    }
}
