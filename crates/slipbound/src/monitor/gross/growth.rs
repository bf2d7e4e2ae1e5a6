//! Recent growth of load and grip force: a load that grows is still carried; one that has stopped growing while the
//! imprint moves is limited by friction.

use crate::monitor::evidence::WINDOWS_S;

/// Most frames stored: the longest window at 240 frames/s, and some.
const MOST_COUNT: usize = 64;

/// Smallest divisor of a growth: practically no load.
const LEAST: f64 = 1e-9;

/// Load on a contact and the grip force in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LoadSample {
    /// Time, s, on any clock.
    pub at_s: f64,
    /// Load in the plane and torque combined, in any unit.
    pub load: f64,
    /// Grip force, N per finger; 0 where it is not known.
    pub grip_n: f64,
}

/// Growth over a window, as a share of the current value.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RelativeGrowth {
    pub load_fraction: f64,
    pub grip_fraction: f64,
}

/// The last frames.
#[derive(Debug, Clone)]
pub struct Growth {
    frames: [LoadSample; MOST_COUNT],
    count: usize,
}

impl Growth {
    pub fn new() -> Self {
        Growth { frames: [LoadSample::default(); MOST_COUNT], count: 0 }
    }

    /// Adds a frame. Returns the growth over each window, scaled from the growth since the frame nearest to its start;
    /// for a contact younger than the window, the growth so far.
    pub fn see(&mut self, now: LoadSample) -> [RelativeGrowth; WINDOWS_S.len()] {
        self.frames[self.count % MOST_COUNT] = now;
        self.count += 1;
        WINDOWS_S.map(|window_s| {
            let known = self.count.min(MOST_COUNT) - 1;
            let past = |back: usize| self.frames[(self.count - 1 - back) % MOST_COUNT];
            let off_s = |back: usize| (now.at_s - past(back).at_s - window_s).abs();
            let mut back = known.min(1);
            while back < known && off_s(back + 1) <= off_s(back) {
                back += 1;
            }
            let then = past(back);
            let elapsed_s = now.at_s - then.at_s;
            let is_young = back == known && elapsed_s < window_s;
            let times = if elapsed_s > 0.0 && !is_young { window_s / elapsed_s } else { 1.0 };
            let known_grip = now.grip_n > 0.0 && then.grip_n > 0.0;
            RelativeGrowth {
                load_fraction: times * (now.load - then.load) / now.load.max(LEAST),
                grip_fraction: if known_grip { times * (now.grip_n - then.grip_n) / now.grip_n } else { 0.0 },
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Growth after half a second in which the load grows by 4 a second and the grip by 2.
    fn after_half_a_second(frames_per_s: u64) -> [RelativeGrowth; WINDOWS_S.len()] {
        let mut growth = Growth::new();
        let mut grown = [RelativeGrowth::default(); WINDOWS_S.len()];
        for frame in 0..=frames_per_s / 2 {
            let at_s = frame as f64 / frames_per_s as f64;
            grown = growth.see(LoadSample { at_s, load: 4.0 * at_s, grip_n: 10.0 + 2.0 * at_s });
        }
        grown
    }

    #[test]
    fn growth_is_alike_at_every_frame_rate() {
        for frames_per_s in [10, 20, 30, 50, 60, 90, 240] {
            for (grown, window_s) in after_half_a_second(frames_per_s).iter().zip(WINDOWS_S) {
                let expected =
                    RelativeGrowth { load_fraction: 4.0 * window_s / 2.0, grip_fraction: 2.0 * window_s / 11.0 };
                assert!((grown.load_fraction - expected.load_fraction).abs() < 1e-9, "{frames_per_s}: {grown:?}");
                assert!((grown.grip_fraction - expected.grip_fraction).abs() < 1e-9, "{frames_per_s}: {grown:?}");
            }
        }
    }

    #[test]
    fn a_young_contact_has_grown_since_its_first_frame_and_no_load_is_divided_by() {
        let mut growth = Growth::new();
        let first = growth.see(LoadSample { at_s: 3.0, load: 2.0, grip_n: 0.0 });
        assert_eq!(first, [RelativeGrowth::default(); WINDOWS_S.len()], "nothing is known before it");
        let second = growth.see(LoadSample { at_s: 3.04, load: 4.0, grip_n: 0.0 });
        assert_eq!(second.map(|grown| (1e3 * grown.load_fraction).round()), [417.0, 500.0, 500.0, 500.0]);
        assert!(second.iter().all(|grown| grown.grip_fraction == 0.0), "{second:?}");
        let gone = growth.see(LoadSample { at_s: 3.08, load: 0.0, grip_n: 0.0 });
        assert!(gone.iter().all(|grown| grown.load_fraction.is_finite()), "{gone:?}");
    }

    #[test]
    fn neither_a_frame_that_was_dropped_nor_a_reading_that_is_missing_is_a_growth() {
        let mut growth = Growth::new();
        let mut grown = [RelativeGrowth::default(); WINDOWS_S.len()];
        for frame in (0..40u32).filter(|frame| *frame != 38) {
            let at_s = f64::from(frame) / 30.0;
            grown = growth.see(LoadSample { at_s, load: 1.0 + at_s, grip_n: 20.0 });
        }
        for (grown, window_s) in grown.iter().zip(WINDOWS_S) {
            assert!((grown.load_fraction - window_s / 2.3).abs() < 1e-9, "{grown:?}");
        }
        for grip_n in [0.0, 20.0] {
            let grown = growth.see(LoadSample { at_s: 40.0 / 30.0, load: 2.3, grip_n });
            assert!(grown.iter().all(|grown| grown.grip_fraction == 0.0), "{grip_n}: {grown:?}");
        }
    }
}
