//! While the markers stand still, the load may be held or the object may slide on over the gel. Estimates from the last
//! motion are better than new ones, and are scaled with the load.
//!
//! ```text
//!   motion or load has changed by a twentieth, in whatever time:  used, stick <- trees
//!   else it stands:                                                used = used then x load now / load then,  stick as then
//! ```

use super::prediction::Prediction;

/// Relative change of motion or load that counts as a new motion.
const MOVED_FRACTION: f64 = 0.05;

/// Weight of a frame with a new motion against the earlier ones; a change of motion or load by more than the second
/// share gives it all of the weight.
const NEWEST_WEIGHT: f64 = 0.6;
const ALONE_FRACTION: f64 = 0.25;

/// Estimates of the trees at the last motion.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LastMotion {
    then: Option<LastEstimate>,
}

#[derive(Debug, Clone, Copy)]
struct LastEstimate {
    prediction: Prediction,
    load: f64,
    rigid_px: f64,
    age_frames: u32,
}

/// The estimates at a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldEstimate {
    pub prediction: Prediction,
    /// Frames since the last motion.
    pub age_frames: u32,
}

impl LastMotion {
    pub fn clear(&mut self) {
        *self = LastMotion::default();
    }

    /// The grip has changed: another motion begins.
    pub fn regripped(&mut self) {
        self.then = None;
    }

    /// The unit of the load has changed: this is its value in the new one.
    pub fn load_is(&mut self, load: f64) {
        self.then.iter_mut().for_each(|then| then.load = load);
    }

    /// The estimates at this frame. `load`: over the grip force where that is known, in any unit; `floor_px`: noise
    /// floor of the motion.
    pub fn see(&mut self, prediction: Prediction, load: f64, rigid_px: f64, floor_px: f64) -> HeldEstimate {
        let Some(then) = &mut self.then else { return self.moves(prediction, load, rigid_px) };
        // The last estimate scaled with the load; after zero load there is no ratio.
        let grown = if then.load > 0.0 { load / then.load } else { 1.0 };
        let carried = Prediction { used: then.prediction.used * grown, ..then.prediction };
        let (moved_px, grown) = ((rigid_px - then.rigid_px).abs(), (load - then.load).abs());
        let changed = |share: f64| moved_px >= share * rigid_px + floor_px || grown >= share * load.max(then.load);
        if !changed(MOVED_FRACTION) {
            then.age_frames = then.age_frames.saturating_add(1);
            return HeldEstimate { prediction: carried, age_frames: then.age_frames };
        }
        let weight = if changed(ALONE_FRACTION) { 1.0 } else { NEWEST_WEIGHT };
        let prediction = Prediction { used: weight * prediction.used + (1.0 - weight) * carried.used, ..prediction };
        self.moves(prediction, load, rigid_px)
    }

    fn moves(&mut self, prediction: Prediction, load: f64, rigid_px: f64) -> HeldEstimate {
        self.then = Some(LastEstimate { prediction, load, rigid_px, age_frames: 0 });
        HeldEstimate { prediction, age_frames: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prediction(used: f64, stick: f64) -> Prediction {
        Prediction { used, used_sd: 0.1, log_used_sd: None, stick, stick_sd: 0.1 }
    }

    #[test]
    fn what_stands_is_known_from_when_it_moved_and_goes_on_with_the_load() {
        let mut last = LastMotion::default();
        for step in 1..=10 {
            let x = f64::from(step);
            last.see(prediction(0.09 * x, 1.0 - 0.09 * x), x, x, 0.1);
        }
        // The object slides on: no marker moves, and the trees estimate a held load.
        for frame in 1..=50 {
            let HeldEstimate { prediction: now, age_frames } = last.see(prediction(0.5, 0.6), 10.0, 10.0, 0.1);
            assert!(now.used > 0.83 && now.stick < 0.2, "{now:?}");
            assert_eq!(age_frames, frame, "known from the last motion");
        }
        let lighter = last.see(prediction(0.5, 0.6), 9.6, 9.9, 0.1).prediction;
        assert!((lighter.used - 0.96 * 0.87).abs() < 0.05, "a little less load: {lighter:?}");
        // A new motion.
        let HeldEstimate { prediction: moved, age_frames } = last.see(prediction(0.3, 0.8), 5.0, 6.0, 0.1);
        assert_eq!(age_frames, 0);
        assert!(moved.used < 0.4 && moved.stick > 0.4, "{moved:?}");
        let stiff = last.see(prediction(0.9, 0.1), 9.0, 6.0, 0.1).prediction;
        assert!(stiff.used > 0.6, "a load that moves nothing counts: {stiff:?}");
        last.regripped();
        assert!(
            (last.see(prediction(0.2, 0.9), 5.0, 6.0, 0.1).prediction.used - 0.2).abs() < 1e-12,
            "nothing is left of before"
        );
    }

    /// After zero load there is no ratio to scale with: the estimates of the trees are used.
    #[test]
    fn nothing_follows_from_no_load() {
        for load in [0.0, 1.0] {
            let mut last = LastMotion::default();
            last.see(prediction(0.2, 0.9), 0.0, 0.0, 0.1);
            assert_eq!(last.see(prediction(0.3, 0.8), load, 0.0, 0.1).prediction.used, 0.3, "{load}");
        }
    }

    #[test]
    fn a_slow_load_is_followed_like_a_fast_one() {
        let ends = [10, 1000].map(|steps| {
            let mut last = LastMotion::default();
            let mut now = prediction(0.0, 1.0);
            for step in 1..=steps {
                let x = f64::from(step) / f64::from(steps);
                // Friction is estimated twice too large until half of it is used.
                let used = if x < 0.5 { 0.5 * x } else { x };
                now = last.see(prediction(used, 1.0 - x), x, 10.0 * x, 0.1).prediction;
            }
            now.used
        });
        assert!((ends[0] - ends[1]).abs() < 0.05 && ends[1] > 0.93, "{ends:?}");
    }
}
