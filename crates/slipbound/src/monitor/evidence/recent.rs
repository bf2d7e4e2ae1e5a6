//! Recent motion of imprint and gel: input of the verdict on gross slip.

use super::sliding::{Motion3, dot, length, minus};
use crate::monitor::frame_period::frame_period_s;

/// Most frames stored: 0.4 s at 240 frames/s.
const MOST_COUNT: usize = 96;

/// Windows to look back over, s. Each starts at the frame nearest to its length.
pub(in crate::monitor) const WINDOWS_S: [f64; 4] = [1.0 / 30.0, 2.0 / 30.0, 0.1, 0.2];

/// How far back the pace is measured, s; above 120 frames/s as far as frames are stored.
const PACE_S: f64 = 0.8;

/// Motion of the imprint over which the pace is measured, pitches.
const PACE_PITCH: f64 = 0.13;

/// Smallest divisor of a share of motion, pitches: the noise.
const LEAST_PITCH: f64 = 0.013;

/// Motion over a window.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::monitor) struct WindowMotion {
    /// Motion of the imprint over the gel, pitches in the whole window.
    pub over_pitch: f64,
    /// Motion of the gel in that direction, divided by it.
    pub carried_fraction: f64,
    /// Motion of the gel, pitches in the whole window.
    pub gel_pitch: f64,
}

/// Recent motion up to a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::monitor) struct Recent {
    /// By window.
    pub windows: [WindowMotion; WINDOWS_S.len()],
    /// Shear of the gel since the reference, pitches.
    pub sheared_pitch: f64,
    /// Speed of the imprint over its last 0.13 pitch, pitches/s; 0 where that took longer than the look-back.
    pub pace_pitch_per_s: f64,
    /// Motion of the gel meanwhile, divided by that of the imprint; 1 where nothing slides.
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

    /// Adds a frame: motion of the imprint over the gel and shear of the gel, both since the reference, px.
    pub(super) fn take(&mut self, over_gel: Motion3, of_gel: Motion3, time_ns: Option<u64>) -> Recent {
        let elapsed_s = frame_period_s(std::mem::replace(&mut self.last_ns, time_ns), time_ns);
        let at_s = if self.count == 0 { 0.0 } else { self.back(1).at_s + elapsed_s };
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

    /// The frame this many before the next one: 1 is the newest.
    fn back(&self, frames_count: usize) -> &Step {
        &self.steps[(self.count - frames_count) % MOST_COUNT]
    }

    /// Number of stored frames before the newest.
    fn known_before(&self) -> usize {
        self.count.min(MOST_COUNT) - 1
    }

    fn moved(&self, now: &Step, window_s: f64) -> WindowMotion {
        let off_s = |back: usize| (now.at_s - self.back(1 + back).at_s - window_s).abs();
        let known = self.known_before();
        let mut back = known.min(1);
        while back < known && off_s(back + 1) <= off_s(back) {
            back += 1;
        }
        let then = self.back(1 + back);
        let elapsed_s = now.at_s - then.at_s;
        if elapsed_s <= 0.0 {
            return WindowMotion::default();
        }
        // The motion of a contact younger than the window is not extrapolated.
        let is_young = back == known && elapsed_s < window_s;
        let whole = if is_young { 1.0 } else { window_s / elapsed_s } / self.pitch_px;
        let (over, gel) = (minus(now.over_gel, then.over_gel), minus(now.of_gel, then.of_gel));
        WindowMotion {
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
            let elapsed_s = now.at_s - then.at_s;
            if elapsed_s > PACE_S {
                break;
            }
            let over = minus(now.over_gel, then.over_gel);
            if length(over) >= PACE_PITCH * self.pitch_px && elapsed_s > 0.0 {
                let speed = length(over) / self.pitch_px / elapsed_s;
                return (speed, self.carried(over, minus(now.of_gel, then.of_gel)));
            }
        }
        (0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recent motion after a slide at 3 pitches/s, of which the gel takes a fifth, at `frames_per_s`.
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
        let slow = after_a_slide(10, 1);
        for (moved, window_s) in slow.windows.iter().zip(WINDOWS_S).filter(|(_, window_s)| *window_s < 0.1) {
            assert!(
                (moved.over_pitch - 3.0 * window_s).abs() < 1e-6,
                "a tenth of a second is not a thirtieth: {slow:?}"
            );
        }
        let young = after_a_slide(30, 2);
        assert!((young.windows[3].over_pitch - 0.2).abs() < 1e-6, "{young:?}");
        let mut motion = RecentMotion::new(20.0);
        let mut stands = Recent::default();
        for frame in 0..200u64 {
            stands = motion.take([5.0, 0.0, 0.0], [9.0, 0.0, 0.0], Some(frame * 10_000_000));
        }
        assert_eq!((stands.pace_pitch_per_s, stands.pace_carried_fraction), (0.0, 1.0));
        assert_eq!(stands.windows, [WindowMotion::default(); WINDOWS_S.len()]);
        motion.restart();
        assert_eq!(motion.take([9.0; 3], [0.0; 3], None).windows, [WindowMotion::default(); WINDOWS_S.len()]);
    }
}
