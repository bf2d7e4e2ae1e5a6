//! Missing frames: on a regular grid, an unobserved motion by one pitch cannot be distinguished from none.

/// Frames are missing when the next one comes later than this and ...
const LEAST_GAP_NS: u64 = 100_000_000;
/// ... later than this many of the usual times between frames.
const GAP_PERIODS: f64 = 3.5;
/// Where frames carry no times: when the frame number increases by more than this.
const GAP_FRAMES_COUNT: u64 = 5;
/// A camera has slowed down when so many times in a row that would be gaps ...
const SLOWED_COUNT: u32 = 3;
/// ... agree with the one before within this ratio.
const SLOWED_RATIO: f64 = 1.5;
/// Weight of a new time between frames in the usual one.
const PERIOD_SHARE: f64 = 0.125;
/// Among so many first times between frames the shortest is the usual one: a camera may begin with a pause.
const FIRST_COUNT: u32 = 5;

/// Watches numbers and times of the frames that are judged.
#[derive(Debug, Clone, Default)]
pub(super) struct Gap {
    last: Option<(u64, Option<u64>)>,
    usual_ns: Option<f64>,
    /// Times between frames so far, at most [`FIRST_COUNT`].
    times_count: u32,
    /// The last time between frames, if it was too long, and how many such agree.
    long_ns: Option<(f64, u32)>,
    /// Where the last gap began: time of the last frame before it, ns.
    began_ns: Option<u64>,
}

impl Gap {
    /// Adds a frame; returns whether frames are missing before it.
    pub fn see(&mut self, seq: u64, time_ns: Option<u64>) -> bool {
        let Some((last_seq, last_ns)) = self.last.replace((seq, time_ns)) else { return false };
        let is_gap = match (last_ns, time_ns) {
            // After a clock was set back, the time without frames is unknown.
            (Some(last_ns), Some(now_ns)) if now_ns < last_ns => true,
            (Some(last_ns), Some(now_ns)) if now_ns > last_ns => {
                let since_ns = (now_ns - last_ns) as f64;
                let is_first = self.times_count < FIRST_COUNT;
                self.times_count += u32::from(is_first);
                let usual_ns = self.usual_ns.map_or(since_ns, |ns| if is_first { ns.min(since_ns) } else { ns });
                let is_long = since_ns > LEAST_GAP_NS as f64 && since_ns > GAP_PERIODS * usual_ns;
                let has_slowed = is_long && self.see_long(since_ns) >= SLOWED_COUNT;
                if !is_long || has_slowed {
                    let share = if has_slowed { 1.0 } else { PERIOD_SHARE };
                    self.usual_ns = Some(usual_ns + share * (since_ns - usual_ns));
                    self.long_ns = None;
                }
                is_long && !has_slowed
            }
            _ => seq.saturating_sub(last_seq) > GAP_FRAMES_COUNT,
        };
        if is_gap {
            // That of a clock since set back says nothing about later times.
            self.began_ns = last_ns.filter(|&last_ns| time_ns.is_none_or(|now_ns| now_ns >= last_ns));
        }
        is_gap
    }

    /// Counts a time between frames that is too long; returns how many in a row agree.
    fn see_long(&mut self, since_ns: f64) -> u32 {
        let agrees = |last_ns: f64| (last_ns / SLOWED_RATIO..=last_ns * SLOWED_RATIO).contains(&since_ns);
        let count = self.long_ns.filter(|(last_ns, _)| agrees(*last_ns)).map_or(1, |(_, count)| count + 1);
        self.long_ns = Some((since_ns, count));
        count
    }

    /// Time since the last frame before the gap, ns.
    pub fn since_ns(&self, time_ns: Option<u64>) -> Option<u64> {
        Some(time_ns?.saturating_sub(self.began_ns?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_second_is_a_gap_and_a_slow_or_stumbling_camera_is_none() {
        let ms = |ms: u64| Some(ms * 1_000_000);
        let mut gap = Gap::default();
        let times = [0, 33, 67, 100, 133, 233, 266, 300];
        assert!(times.iter().enumerate().all(|(i, &at)| !gap.see(i as u64, ms(at))), "two frames dropped");
        assert!(gap.see(8, ms(800)), "500 ms");
        assert_eq!(gap.since_ns(ms(833)), ms(533));
        assert!(!gap.see(9, ms(833)));

        let mut slow = Gap::default();
        assert!((0..20).all(|i| !slow.see(i, ms(500 * i))), "two frames a second");
        assert!(slow.see(20, ms(500 * 23)));

        let mut late = Gap::default();
        let gaps = [0, 600, 633, 666, 699, 1199].map(|at| late.see(at, ms(at)));
        assert_eq!(gaps, [false, false, false, false, false, true], "a pause after the first frame is not usual");

        let mut numbered = Gap::default();
        assert!([0, 1, 2, 6, 11].iter().all(|&seq| !numbered.see(seq, None)));
        assert!(numbered.see(17, None) && !numbered.see(3, None));
        assert_eq!(numbered.since_ns(None), None);

        let mut set_back = Gap::default();
        assert!(!set_back.see(0, ms(4000)) && set_back.see(1, ms(100)));
        assert_eq!(set_back.since_ns(ms(200)), None, "the gap began on the old clock");
    }

    #[test]
    fn a_camera_that_changes_to_a_slow_rate_is_seen_after_two_long_times_between_frames() {
        for (start_ms, slow_from) in [(vec![0, 10], 2), ((0..8).map(|i| 33 * i).collect(), 8)] {
            let mut gap = Gap::default();
            let last_ms = start_ms[start_ms.len() - 1];
            let times_ms = start_ms.into_iter().chain((1..9).map(|i| last_ms + 200 * i));
            let gaps = times_ms.enumerate().filter_map(|(i, ms)| gap.see(i as u64, Some(1_000_000 * ms)).then_some(i));
            assert_eq!(gaps.collect::<Vec<_>>(), [slow_from, slow_from + 1]);
        }
        let mut gap = Gap::default();
        let mut after_ms = {
            let (mut now_ns, mut seq) = (0, 0);
            move |gap: &mut Gap, ms: u64| {
                (now_ns, seq) = (now_ns + 1_000_000 * ms, seq + 1);
                gap.see(seq, Some(now_ns))
            }
        };
        (0..9).for_each(|_| assert!(!after_ms(&mut gap, 33)));
        for ms in [200, 400, 200, 400, 33, 200, 200, 33, 200] {
            assert_eq!(after_ms(&mut gap, ms), ms > 33, "times that do not agree, or not in a row: {ms} ms");
        }
    }

    #[test]
    fn the_usual_time_follows_a_camera_that_slows_down_and_a_gap_does_not_count() {
        let mut gap = Gap::default();
        let (mut now_ns, mut seq) = (0u64, 0u64);
        let mut after_ms = |ms: f64| {
            now_ns += (ms * 1e6) as u64;
            seq += 1;
            gap.see(seq, Some(now_ns))
        };
        // From 30 to 100 ms within four seconds: 3.5 times the usual is never reached.
        assert!((0..71).all(|i| !after_ms(30.0 + f64::from(i))));
        // At 100 ms for long: 340 is no gap, 360 is one; the usual time does not change.
        assert!((0..60).all(|_| !after_ms(100.0)));
        assert!(after_ms(360.0) && after_ms(360.0), "a gap makes no gap usual");
        assert!(!after_ms(340.0), "one frame of 340 ms counts an eighth:");
        assert!(after_ms(460.0) && !after_ms(450.0), "3.5 times 130 ms");
        // Fast cameras: a tenth of a second is no gap, however many frames that is.
        assert!((0..200).all(|_| !after_ms(5.0)));
        assert!(!after_ms(100.0) && after_ms(100.1));
    }
}
