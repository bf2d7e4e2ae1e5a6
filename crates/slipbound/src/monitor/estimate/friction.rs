//! Friction of a contact, gathered over its frames: the object and the gel stay the same, what a frame tells of them does not.
//!
//! ```text
//!   a frame:  mu = load / (used x grip x sunk), the surer the more of the friction it uses
//!   known:    mean of the frames' log mu, each by what it tells beyond what is known of any contact
//!   after a regrip the field counts anew:  used <- the frame's, and load / (grip x mu x sunk), each by its error
//! ```
//!
//! `sunk`: a curved object that lies in the gel bears against its far side, and slides at more than mu P.

use crate::monitor::report::Estimate;
use crate::plane::Vec2;

/// What is known of the friction of any contact: standard deviation of the logarithm of an even choice from 0.2 to 1.3.
const ANY_LOG_SD: f64 = 0.54;
/// Frames in a row are wrong alike: so many tell as much as one.
const FRAMES_ALIKE: f64 = 12.0;
/// What a frame tells at least, so that the first one is told at all, and all frames together at most (0.13 of the friction): in units
/// of one over the variance of its logarithm.
const LEAST_TOLD: f64 = 0.5;
const MOST_TOLD: f64 = 60.0;
/// Share of that after a regrip, and the time in which it grows to that, s: the field then shows less slip than the load has made, and right
/// after it none.
const REGRIPPED_SHARE: f64 = 0.25;
const REGRIPPED_S: f64 = 0.2;
/// Standard deviation by which log mu may differ at another grip force, for a difference of 1 in the logarithm of the force: what
/// `sunk` leaves.
const DRIFT_LOG_SD: f64 = 0.2;
/// What holds a load has the friction for it, within the error of the load.
const LOAD_SURE: f64 = 0.95;
/// Growth of the load that slides with the shear of the gel, in half widths of the contact, at a traction as large as the pressure:
/// 0.5 to 1.1 for simulated spheres, cylinders and the cap between 6 and 50 N, whatever their friction.
const SUNK_GROWTH: f64 = 0.8;
/// More than that was not simulated.
const MOST_SUNK: f64 = 1.5;

/// By how much more than mu P an object slides that has sunk into the gel. `shear_px`: displacement of the gel at a traction as
/// large as the mean pressure; `half_width_px`: of the contact along the load; `pulled_fraction`: share of the force in the load, the
/// rest of which turns.
pub(super) fn sunk(shear_px: f64, half_width_px: f64, pulled_fraction: f64) -> f64 {
    (1.0 + SUNK_GROWTH * pulled_fraction * shear_px / half_width_px.max(1e-6)).min(MOST_SUNK)
}

/// Half the width of a contact along a direction, from the places of its markers: twice their standard deviation, as on a disc.
pub(super) fn half_width_px(places: impl ExactSizeIterator<Item = Vec2>, middle: Vec2, along: Vec2) -> f64 {
    let n = places.len().max(1) as f64;
    let squares: f64 = places.map(|place| (place - middle).dot(along)).map(|x| x * x).sum();
    2.0 * (squares / n).sqrt()
}

/// What a frame shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    /// Time, s.
    pub at_s: f64,
    /// Load over grip force.
    pub per_grip: f64,
    /// Grip force, N.
    pub grip_n: f64,
    /// See [`sunk`].
    pub sunk: f64,
}

/// What is known of the friction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Friction {
    log_mu: f64,
    /// One over the variance of it, by frames alone; 0 while no frame has said anything.
    told: f64,
    /// Logarithm of the grip force at which it was seen.
    log_grip: f64,
    /// When the grip last grew under load, s, and when the last frame was: slip counts anew from there.
    regripped_s: Option<f64>,
    now_s: f64,
}

impl Friction {
    /// The grip has grown under load.
    pub fn regripped(&mut self) {
        self.regripped_s = Some(self.now_s).filter(|_| self.told > 0.0);
    }

    /// Variance of log mu at a grip force, by what frames told.
    fn variance(&self, log_grip: f64, besides: f64) -> f64 {
        let drift = DRIFT_LOG_SD * (log_grip - self.log_grip);
        1.0 / (self.told + besides) + drift * drift
    }

    /// Takes what a frame says. The friction, if any frame has said anything so far; `used` with what was known before.
    pub fn see(&mut self, shown: &Shown, used: Estimate) -> (Option<Estimate>, Estimate) {
        const ANY: f64 = 1.0 / (ANY_LOG_SD * ANY_LOG_SD);
        let load = shown.per_grip / shown.sunk;
        let log_grip = libm::log(shown.grip_n.max(0.1));
        self.now_s = shown.at_s;
        let seen = self.regripped_s.map(|regripped_s| ((self.now_s - regripped_s) / REGRIPPED_S).clamp(0.0, 1.0));
        let share = seen.map_or(1.0, |seen| REGRIPPED_SHARE * seen);
        if load > 1e-6 && used.value > 0.02 {
            let relative_sd = used.sd / used.value;
            let told = share * (1.0 / (relative_sd * relative_sd) - ANY).max(LEAST_TOLD) / FRAMES_ALIKE;
            let known = if self.told > 0.0 { 1.0 / self.variance(log_grip, 0.0) } else { 0.0 };
            let newest = told / (known + told);
            self.log_mu += newest * (libm::log(load / used.value) - self.log_mu);
            self.log_grip += newest * (log_grip - self.log_grip);
            self.told = (self.told + told).min(MOST_TOLD);
        }
        if self.told <= 0.0 {
            return (None, used);
        }
        // For this frame alone: one reading of the grip that is too low must not make the contact less slippery for good.
        let value = libm::exp(self.log_mu).max(LOAD_SURE * load);
        let variance = self.variance(log_grip, ANY);
        let friction = Estimate { value, sd: value * variance.sqrt(), age_frames: 0 };
        let Some(seen) = seen else { return (Some(friction), used) };
        let expected = load / value;
        let (of_frame, of_memory) = (seen / (used.sd * used.sd), 1.0 / (expected * expected * variance).max(1e-6));
        let value = (of_frame * used.value + of_memory * expected) / (of_frame + of_memory);
        (Some(friction), Estimate { value: value.min(1.2), sd: (of_frame + of_memory).recip().sqrt(), ..used })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(value: f64, sd: f64) -> Estimate {
        Estimate { value, sd, age_frames: 0 }
    }

    fn shown(per_grip: f64, grip_n: f64) -> Shown {
        Shown { at_s: 0.0, per_grip, grip_n, sunk: 1.0 }
    }

    /// Loaded up to a used fraction of 0.8 at 10 N.
    fn loaded(mu: f64) -> Friction {
        let mut friction = Friction::default();
        for step in 1..=24 {
            let f = f64::from(step) / 30.0;
            friction.see(&shown(mu * f, 10.0), used(f, 0.1));
        }
        friction
    }

    #[test]
    fn it_is_load_over_grip_over_what_is_used_of_it_and_who_knows_it_better_counts_for_more() {
        let after = |frames: &[(f64, f64, f64)]| {
            let mut friction = Friction::default();
            let see =
                |&(per_grip, value, sd): &(f64, f64, f64)| friction.see(&shown(per_grip, 10.0), used(value, sd)).0;
            frames.iter().map(see).last().flatten()
        };
        assert_eq!(after(&[(0.0, 0.5, 0.1), (0.4, 0.02, 0.01)]), None, "nothing pulls, or nothing is used");
        let first = after(&[(0.4, 0.5, 0.1)]).expect("told");
        assert!((first.value - 0.8).abs() < 1e-9 && first.sd < 0.54 * 0.8, "{first:?}");
        let [worse, better] = [0.2, 0.05].map(|sd| after(&[(0.4, 0.5, 0.1), (0.4, 0.8, sd)]).expect("told"));
        assert!(worse.value > 0.6 && better.value < 0.55 && better.sd < worse.sd, "{worse:?} {better:?}");
        let sunk = Friction::default().see(&Shown { sunk: 1.25, ..shown(0.5, 10.0) }, used(0.5, 0.1)).0;
        assert!((sunk.expect("told").value - 0.8).abs() < 1e-9, "{sunk:?}");
    }

    #[test]
    fn what_frames_near_the_slide_told_is_not_forgotten_over_many_that_tell_little() {
        let mut friction = loaded(0.8);
        let mut told = None;
        for _ in 0..90 {
            // Let off to a quarter; a frame then takes any contact for one of middling friction.
            told = friction.see(&shown(0.2, 10.0), used(0.45, 0.2)).0;
        }
        let told = told.expect("told").value;
        assert!((0.68..=0.82).contains(&told), "{told}");
    }

    #[test]
    fn what_holds_a_load_has_the_friction_for_it() {
        let mut friction = loaded(0.4);
        let (told, _) = friction.see(&shown(0.9, 10.0), used(0.6, 0.1));
        assert!(told.expect("told").value >= 0.85, "{told:?}");
        let (told, _) = friction.see(&shown(0.2, 10.0), used(0.5, 0.1));
        assert!(
            (told.expect("told").value - 0.4).abs() < 0.05,
            "a reading that was half of the grip is forgotten: {told:?}"
        );
        let sunk = Shown { sunk: 1.5, ..shown(0.9, 10.0) };
        let (told, _) = loaded(0.4).see(&sunk, used(0.6, 0.1));
        assert!((0.56..0.65).contains(&told.expect("told").value), "the far side bears a third of it: {told:?}");
    }

    #[test]
    fn right_after_a_regrip_a_frame_says_nothing_and_soon_it_counts_beside_what_was_known() {
        let mut friction = loaded(0.5);
        friction.see(&shown(0.3, 12.0), used(0.6, 0.1));
        friction.regripped();
        let (told, now) = friction.see(&shown(0.3, 12.0), used(0.2, 0.1));
        assert!((now.value - 0.6).abs() < 0.03, "its field is empty: {now:?}");
        assert!((told.expect("told").value - 0.5).abs() < 0.02, "{told:?}");
        let later = Shown { at_s: 0.3, ..shown(0.3, 12.0) };
        let now = friction.see(&later, used(0.3, 0.1)).1;
        assert!((0.35..0.55).contains(&now.value) && now.sd < 0.1, "between both, and surer than each: {now:?}");
        let sure = friction.see(&later, used(0.9, 0.01)).1;
        assert!((sure.value - 0.9).abs() < 0.02, "what a frame is sure of counts: {sure:?}");
    }

    #[test]
    fn at_another_grip_less_is_known_of_it() {
        let sd = |grip_n: f64| {
            let mut friction = loaded(0.5);
            friction.see(&shown(0.3, 10.0), used(0.6, 0.1));
            friction.regripped();
            friction.see(&shown(0.3, grip_n), used(0.6, 0.3)).1.sd
        };
        assert!(sd(60.0) > 1.2 * sd(10.0), "{} {}", sd(60.0), sd(10.0));
    }

    #[test]
    fn what_lies_deep_slides_at_more_and_a_wide_face_does_not() {
        let places = |x_mm: f64, y_mm: f64| {
            (0..900).map(move |i| {
                Vec2::new(x_mm * (f64::from(i % 30) / 14.5 - 1.0), y_mm * (f64::from(i / 30) / 14.5 - 1.0))
            })
        };
        let width = |x_mm, y_mm, along: Vec2| {
            let places: Vec<Vec2> = places(x_mm, y_mm).collect();
            half_width_px(places.into_iter(), Vec2::ZERO, along)
        };
        // A uniform width of 2 a has the standard deviation a / sqrt 3.
        assert!((width(6.0, 2.0, Vec2::new(1.0, 0.0)) - 6.0 * 2.0 / 3f64.sqrt()).abs() < 0.3);
        assert!((width(6.0, 2.0, Vec2::new(0.0, 1.0)) - 2.0 * 2.0 / 3f64.sqrt()).abs() < 0.1);
        // The cap at 6 and at 50 N, and a box (simulated: 1.09, 1.48, 1.05), pulled; the cap turned about the pad's normal.
        assert!((sunk(1.1, 7.2, 1.0) - 1.12).abs() < 0.01 && (sunk(3.8, 8.8, 1.0) - 1.35).abs() < 0.01);
        assert!(sunk(1.3, 13.0, 1.0) < 1.09 && sunk(3.8, 8.8, 0.0) == 1.0 && sunk(90.0, 1.0, 1.0) == MOST_SUNK);
    }
}
