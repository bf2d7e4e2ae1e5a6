//! How imprint and gel have moved of late: what the verdict on gross slip looks at.

use super::sliding::{Motion3, dot, length, minus};
use crate::monitor::passed::passed_s;

/// Most frames remembered: 0.4 s at 240 frames/s.
const MOST_COUNT: usize = 96;

/// Times that are looked back over, s. A frame counts for the time that lies nearest.
pub(in crate::monitor) const WINDOWS_S: [f64; 4] = [1.0 / 30.0, 2.0 / 30.0, 0.1, 0.2];

/// How far back a pace is looked for, s; above 120 frames/s as far as frames are remembered.
const PACE_S: f64 = 0.8;

/// Over this way of the imprint the pace is taken, pitches.
const PACE_PITCH: f64 = 0.13;

/// Least motion by which a share is divided, pitches: noise.
const LEAST_PITCH: f64 = 0.013;

/// Motion over a window.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::monitor) struct Moved {
    /// Of the imprint over the gel, pitches in the whole window.
    pub over_pitch: f64,
    /// How far the gel went along in that direction, over it.
    pub carried_fraction: f64,
    /// Of the gel, pitches in the whole window.
    pub gel_pitch: f64,
}

/// What is known of the motion up to a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::monitor) struct Recent {
    /// By window.
    pub windows: [Moved; WINDOWS_S.len()],
    /// How far the gel is sheared since the reference, pitches.
    pub sheared_pitch: f64,
    /// Speed of the imprint over its last 0.13 pitch, pitches/s; 0 where it took longer than is looked back.
    pub pace_pitch_per_s: f64,
    /// How far the gel went along meanwhile, over it; 1 where nothing slides.
    pub pace_carried_fraction: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Step {
    over_gel: Motion3,
    of_gel: Motion3,
    at_s: f64,
}

/// The last frames.
#[derive(Debug, Clone)]
pub(super) struct RecentMotion {
    pitch_px: f64,
    steps: [Step; MOST_COUNT],
    count: usize,
    last_ns: Option<u64>,
}

impl RecentMotion {
    pub(super) fn new(pitch_px: f64) -> Self {
        RecentMotion { pitch_px, steps: [Step::default(); MOST_COUNT], count: 0, last_ns: None }
    }

    pub(super) fn restart(&mut self) {
        (self.count, self.last_ns) = (0, None);
    }

    /// Takes a frame: how far the imprint is over the gel and how far the gel is sheared, both since the reference, px.
    pub(super) fn take(&mut self, over_gel: Motion3, of_gel: Motion3, time_ns: Option<u64>) -> Recent {
        let passed_s = passed_s(std::mem::replace(&mut self.last_ns, time_ns), time_ns);
        let at_s = if self.count == 0 { 0.0 } else { self.back(1).at_s + passed_s };
        let now = Step { over_gel, of_gel, at_s };
        self.steps[self.count % MOST_COUNT] = now;
        self.count += 1;
        let (pace_pitch_per_s, pace_carried_fraction) = self.pace(&now);
        Recent {
            windows: WINDOWS_S.map(|window_s| self.moved(&now, window_s)),
            sheared_pitch: length(of_gel) / self.pitch_px,
            pace_pitch_per_s,
            pace_carried_fraction,
        }
    }

    /// So many frames back from where the next one goes: 1 is the newest.
    fn back(&self, frames_count: usize) -> &Step {
        &self.steps[(self.count - frames_count) % MOST_COUNT]
    }

    /// Frames that are known before the newest.
    fn known_before(&self) -> usize {
        self.count.min(MOST_COUNT) - 1
    }

    fn moved(&self, now: &Step, window_s: f64) -> Moved {
        let off_s = |back: usize| (now.at_s - self.back(1 + back).at_s - window_s).abs();
        let known = self.known_before();
        let mut back = known.min(1);
        while back < known && off_s(back + 1) <= off_s(back) {
            back += 1;
        }
        let then = self.back(1 + back);
        let passed_s = now.at_s - then.at_s;
        if passed_s <= 0.0 {
            return Moved::default();
        }
        // A contact that is younger than the window has moved no faster than this.
        let whole = if back == known { 1.0 } else { window_s / passed_s } / self.pitch_px;
        let (over, gel) = (minus(now.over_gel, then.over_gel), minus(now.of_gel, then.of_gel));
        Moved {
            over_pitch: whole * length(over),
            carried_fraction: self.carried(over, gel),
            gel_pitch: whole * length(gel),
        }
    }

    fn carried(&self, over: [f64; 3], gel: [f64; 3]) -> f64 {
        let over_px = length(over);
        if over_px == 0.0 {
            return 0.0;
        }
        dot(gel, over) / over_px / over_px.max(LEAST_PITCH * self.pitch_px)
    }

    fn pace(&self, now: &Step) -> (f64, f64) {
        for back in 1..=self.known_before() {
            let then = self.back(1 + back);
            let passed_s = now.at_s - then.at_s;
            if passed_s > PACE_S {
                break;
            }
            let over = minus(now.over_gel, then.over_gel);
            if length(over) >= PACE_PITCH * self.pitch_px && passed_s > 0.0 {
                let speed = length(over) / self.pitch_px / passed_s;
                return (speed, self.carried(over, minus(now.of_gel, then.of_gel)));
            }
        }
        (0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is known after a slide at 3 pitches/s, of which the gel takes a fifth, at so many frames a second.
    fn after_a_slide(frames_per_s: u64, frames_count: u64) -> Recent {
        let mut motion = RecentMotion::new(20.0);
        let mut recent = Recent::default();
        for frame in 0..=frames_count {
            let at_s = frame as f64 / frames_per_s as f64;
            let over = 3.0 * 20.0 * at_s;
            let time_ns = Some(frame * 1_000_000_000 / frames_per_s);
            recent = motion.take([0.6 * over, 0.8 * over, 0.0], [0.12 * over, 0.16 * over, 0.0], time_ns);
        }
        recent
    }

    #[test]
    fn a_slide_looks_alike_at_every_frame_rate() {
        for frames_per_s in [30, 60, 90, 240] {
            let recent = after_a_slide(frames_per_s, frames_per_s / 2);
            for (moved, window_s) in recent.windows.iter().zip(WINDOWS_S) {
                assert!((moved.over_pitch - 3.0 * window_s).abs() < 1e-6, "{frames_per_s}: {recent:?}");
                assert!((moved.gel_pitch - 0.6 * window_s).abs() < 1e-6, "{frames_per_s}: {recent:?}");
                assert!((moved.carried_fraction - 0.2).abs() < 1e-6, "{frames_per_s}: {recent:?}");
            }
            assert!((recent.pace_pitch_per_s - 3.0).abs() < 1e-6 && (recent.pace_carried_fraction - 0.2).abs() < 1e-6);
            assert!((recent.sheared_pitch - 0.3).abs() < 1e-6, "{recent:?}");
        }
    }

    #[test]
    fn a_young_contact_is_no_fast_one_and_what_stands_has_no_pace() {
        let young = after_a_slide(30, 2);
        assert!((young.windows[3].over_pitch - 0.2).abs() < 1e-6, "{young:?}");
        let mut motion = RecentMotion::new(20.0);
        let mut stands = Recent::default();
        for frame in 0..200u64 {
            stands = motion.take([5.0, 0.0, 0.0], [9.0, 0.0, 0.0], Some(frame * 10_000_000));
        }
        assert_eq!((stands.pace_pitch_per_s, stands.pace_carried_fraction), (0.0, 1.0));
        assert_eq!(stands.windows, [Moved::default(); WINDOWS_S.len()]);
        motion.restart();
        assert_eq!(motion.take([9.0; 3], [0.0; 3], None).windows, [Moved::default(); WINDOWS_S.len()]);
    }
}
