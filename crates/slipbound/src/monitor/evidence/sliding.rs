//! Whether the object slides as a whole: it moves over the gel, and the gel is no longer carried along.
//!
//! ```text
//!   sticking:  object ---->   gel ---->      creeping at the rim:  object ---->   gel -->      sliding:  object ---->   gel .
//!              over the gel: nothing                               less than the gel moves               all of it over the gel
//! ```
//!
//! Motion of the object over the gel is that of its imprint; motion of the gel that of the markers in contact.

/// Motion along x, along y, and turn times arm, px.
pub(super) type Motion3 = [f64; 3];

/// Number of frames to look back over: at 30 Hz a slide of 0.25 mm/s is detected with a pitch of 1.5 mm.
const BACK_FRAMES_COUNT: usize = 24;

/// Settings of the verdict, in px and shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlidingSettings {
    /// The imprint must have moved this far over the gel.
    pub(super) least_px: f64,
    /// Meanwhile the gel may have moved along by at most this share of it.
    pub(super) along_fraction: f64,
    /// The gel must be sheared this far in the direction of the slide: a rolling contact moves, too, but does not pull.
    pub(super) sheared_px: f64,
    /// A pattern that changes by this much from one frame to the next has jumped.
    pub(super) jump_change: f64,
}

/// One frame.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    over_gel: Motion3,
    of_gel: Motion3,
    time_ns: Option<u64>,
}

/// A slide in progress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sliding {
    /// Its speed, px/s; None where frames have no time or the imprint has jumped further than can be tracked.
    pub(super) speed_px_per_s: Option<f64>,
}

/// The last frames.
#[derive(Debug, Clone)]
pub(super) struct SlidingWatch {
    settings: SlidingSettings,
    steps: [Step; BACK_FRAMES_COUNT],
    count: usize,
    /// Fewest frames in which the slide covered the least motion; None while nothing slides.
    pace_frames: Option<usize>,
}

impl SlidingWatch {
    pub(super) fn new(settings: SlidingSettings) -> Self {
        SlidingWatch { settings, steps: [Step::default(); BACK_FRAMES_COUNT], count: 0, pace_frames: None }
    }

    /// Discards all frames.
    pub(super) fn restart(&mut self) {
        (self.count, self.pace_frames) = (0, None);
    }

    /// Adds a frame: motion of the imprint over the gel and shear of the gel, both since the reference, and change of
    /// the pattern since the last frame.
    pub(super) fn take(
        &mut self,
        over_gel: Motion3,
        of_gel: Motion3,
        change: f64,
        time_ns: Option<u64>,
    ) -> Option<Sliding> {
        let now = Step { over_gel, of_gel, time_ns };
        let sliding = self.look_back(&now).or_else(|| self.jump(&now, change));
        self.steps[self.count % BACK_FRAMES_COUNT] = now;
        self.count += 1;
        if sliding.is_none() && self.pace_frames.take().is_some() {
            // Motion before a stop does not count for a later slide.
            (self.steps[0], self.count) = (now, 1);
        }
        sliding
    }

    /// The shortest time back over which the imprint has moved far enough decides whether the gel moved along.
    fn look_back(&mut self, now: &Step) -> Option<Sliding> {
        // A stopped slide is reported for no longer than two looks at the imprint and three frames.
        let most = self.pace_frames.map_or(BACK_FRAMES_COUNT, |pace| 2 * pace + 3);
        for back in 1..=most.min(self.count).min(BACK_FRAMES_COUNT) {
            let then = self.steps[(self.count - back) % BACK_FRAMES_COUNT];
            let over = minus(now.over_gel, then.over_gel);
            let length_px = length(over);
            if length_px < self.settings.least_px {
                continue;
            }
            let ahead = over.map(|part| part / length_px);
            let along_px = dot(minus(now.of_gel, then.of_gel), ahead);
            let sheared = dot(now.of_gel, ahead) >= self.settings.sheared_px;
            if !sheared || along_px > self.settings.along_fraction * length_px {
                return None;
            }
            // The fastest pace counts: after a stop, the same motion lies further back with every frame.
            self.pace_frames = Some(self.pace_frames.map_or(back, |pace| pace.min(back)));
            let elapsed_s = now.time_ns.zip(then.time_ns).map(|(a, b)| a.saturating_sub(b) as f64 * 1e-9);
            return Some(Sliding { speed_px_per_s: elapsed_s.filter(|s| *s > 0.0).map(|s| length_px / s) });
        }
        None
    }

    /// An imprint that has jumped, on a gel that is sheared and stands still.
    fn jump(&mut self, now: &Step, change: f64) -> Option<Sliding> {
        let then = self.steps[self.count.checked_sub(1)? % BACK_FRAMES_COUNT];
        let still = length(minus(now.of_gel, then.of_gel)) <= self.settings.least_px;
        let jumped =
            change >= self.settings.jump_change && still && length(now.of_gel) >= 2.0 * self.settings.sheared_px;
        jumped.then(|| {
            self.pace_frames = Some(1);
            Sliding { speed_px_per_s: None }
        })
    }
}

pub(super) fn minus(a: Motion3, b: Motion3) -> Motion3 {
    std::array::from_fn(|k| a[k] - b[k])
}

pub(super) fn dot(a: Motion3, b: Motion3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn length(a: Motion3) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: SlidingSettings =
        SlidingSettings { least_px: 3.0, along_fraction: 0.25, sheared_px: 1.5, jump_change: 0.5 };

    /// Whether a slide is reported in each frame; the object moves by `step_px` a frame, and the gel carries this share
    /// of it.
    fn said(carried: impl Fn(usize) -> f64, step_px: f64, frames: usize) -> Vec<bool> {
        let mut watch = SlidingWatch::new(SETTINGS);
        let (mut over, mut gel) = (0.0, 0.0);
        (0..frames)
            .map(|i| {
                gel += carried(i) * step_px;
                over += (1.0 - carried(i)) * step_px;
                watch.take([over, 0.0, 0.0], [gel, 0.0, 0.0], 0.0, Some(i as u64 * 100_000_000)).is_some()
            })
            .collect()
    }

    #[test]
    fn sticking_and_creeping_are_no_slide_and_a_slide_is_said_after_the_least_motion() {
        assert!(said(|_| 1.0, 1.0, 40).iter().all(|slides| !slides));
        assert!(said(|_| 0.5, 1.0, 40).iter().all(|slides| !slides), "half of it is still carried");
        let slide = said(|i| if i < 10 { 1.0 } else { 0.0 }, 1.0, 40);
        assert_eq!(slide.iter().position(|slides| *slides), Some(12), "3 px over the gel");
        assert!(slide[12..].iter().all(|slides| *slides));
    }

    #[test]
    fn rolling_pulls_at_nothing_and_a_stop_is_noticed() {
        assert!(said(|_| 0.0, 1.0, 40).iter().all(|slides| !slides), "the gel is not sheared");
        let mut watch = SlidingWatch::new(SETTINGS);
        let at = |i: usize| if i < 20 { i as f64 } else { 20.0 };
        let said: Vec<bool> =
            (0..60).map(|i| watch.take([at(i), 0.0, 0.0], [5.0, 0.0, 0.0], 0.0, None).is_some()).collect();
        let last = said.iter().rposition(|slides| *slides).expect("it slid");
        assert!(said[4] && last < 30, "{last}");
    }

    #[test]
    fn the_speed_is_that_of_the_imprint_and_a_jump_has_none() {
        let mut watch = SlidingWatch::new(SETTINGS);
        let mut speed = None;
        for i in 0..10 {
            speed = watch.take([0.0, 0.5 * i as f64, 0.0], [0.0, 4.0, 0.0], 0.0, Some(i * 50_000_000));
        }
        let speed = speed.and_then(|sliding| sliding.speed_px_per_s).expect("it slides");
        assert!((speed - 10.0).abs() < 1e-9, "{speed}");
        watch.restart();
        watch.take([0.0; 3], [4.0, 0.0, 0.0], 0.0, None);
        assert_eq!(watch.take([0.1; 3], [4.1, 0.0, 0.0], 0.8, None), Some(Sliding { speed_px_per_s: None }));
    }

    /// Earlier frames do not count: neither a motion that was nearly far enough nor a slide in progress.
    #[test]
    fn what_was_seen_before_a_restart_is_forgotten() {
        let mut watch = SlidingWatch::new(SETTINGS);
        let mut slides = |over_px: f64, is_anew: bool| {
            if is_anew {
                watch.restart();
            }
            watch.take([over_px, 0.0, 0.0], [5.0, 0.0, 0.0], 0.0, None).is_some()
        };
        let said: Vec<bool> = [0.0, 1.0, 2.0].iter().map(|px| slides(*px, false)).collect();
        assert_eq!(said, [false; 3]);
        assert!(!slides(4.0, true), "4 px since a frame that no longer counts");
        assert!(!slides(6.9, false) && slides(7.0, false), "3 px since the restart");
        assert!(!slides(9.0, true) && !slides(11.9, false) && slides(12.1, false));
    }
}
