//! When a cycle is due, with cameras: as soon as the frames have arrived.

use crate::source::Arrivals;

/// A camera that is waited for, or not.
struct Camera {
    arrivals: Arrivals,
    /// Whether the others wait for it: its frames come soon enough after theirs.
    leads: bool,
    /// Since when its newest frame waits, ns.
    since_ns: Option<u64>,
    /// When its last frame came, ns, and how long after the one before.
    came_ns: Option<u64>,
    between_ns: u64,
}

/// Time between two frames of a camera that has sent one only, ns: that of 10 Hz.
const BETWEEN_NS: u64 = 100_000_000;

impl Camera {
    fn look(&mut self, now_ns: u64) {
        if !self.arrivals.is_waiting() {
            self.since_ns = None;
        } else if self.since_ns.is_none() {
            self.since_ns = Some(now_ns);
            let came_ns = self.came_ns.replace(now_ns);
            self.between_ns = came_ns.map_or(BETWEEN_NS, |came_ns| now_ns.saturating_sub(came_ns));
        }
    }

    /// Whether its next frame is late by this much.
    fn is_late(&self, now_ns: u64, by_ns: u64) -> bool {
        self.came_ns.is_none_or(|came_ns| now_ns.saturating_sub(came_ns) >= self.between_ns.saturating_add(by_ns))
    }
}

/// A cycle is due when every camera that leads has a new frame, or when the first of them has waited for the others for long enough.
///
/// ```text
///   left    |     |     |     |        both lead: a cycle when the later one has come
///   right     |     |     |     |
///   cycle     ^     ^     ^     ^
///
///   left    |        |        |        the right one comes too long after the left one to be waited for:
///   right        |        |        |   its frame waits, and goes with the next one of the left
///   cycle   ^        ^        ^
/// ```
///
/// A camera that blocks delays one cycle by that time, and no further one. When all that lead are late by that time, a
/// frame of any other camera is enough.
pub struct FramesDue {
    cameras: Vec<Camera>,
    longest_ns: u64,
    /// Since when the last cycle waited for frames, ns.
    waited_from_ns: Option<u64>,
}

impl FramesDue {
    /// For the cameras of these [`Arrivals`]; a frame waits for those of the other cameras for `longest_ns` at most.
    pub fn new(cameras: impl IntoIterator<Item = Arrivals>, longest_ns: u64) -> Self {
        let camera = |arrivals| Camera { arrivals, leads: true, since_ns: None, came_ns: None, between_ns: BETWEEN_NS };
        FramesDue { cameras: cameras.into_iter().map(camera).collect(), longest_ns, waited_from_ns: None }
    }

    /// Whether a cycle is due. True once per cycle.
    pub fn is_due(&mut self, now_ns: u64) -> bool {
        // Every camera is polled, because those without a frame then wake this thread when they have one.
        self.cameras.iter_mut().for_each(|camera| camera.look(now_ns));
        let since_ns = self.cameras.iter().filter(|camera| camera.leads).filter_map(|camera| camera.since_ns).min();
        let is_due = match since_ns {
            None => {
                let waits = self.cameras.iter().any(|camera| camera.since_ns.is_some());
                waits && self.cameras.iter().all(|camera| !camera.leads || camera.is_late(now_ns, self.longest_ns))
            }
            Some(since_ns) => {
                let is_complete = self.cameras.iter().all(|camera| !camera.leads || camera.since_ns.is_some());
                is_complete || now_ns.saturating_sub(since_ns) >= self.longest_ns
            }
        };
        if is_due {
            self.begin(since_ns, now_ns);
        }
        is_due
    }

    /// Which cameras the next cycle is to wait for.
    fn begin(&mut self, since_ns: Option<u64>, now_ns: u64) {
        // If the frame of a camera came soon after those of the last cycle, that cycle should have waited for it.
        let waited_from_ns = self.waited_from_ns.replace(since_ns.unwrap_or(now_ns));
        let soon_ns = waited_from_ns.map(|from_ns| from_ns.saturating_add(self.longest_ns));
        let is_without_lead = since_ns.is_none();
        for camera in &mut self.cameras {
            let since_ns = camera.since_ns.take();
            let is_soon = since_ns.zip(soon_ns).is_none_or(|(since_ns, soon_ns)| since_ns <= soon_ns);
            camera.leads = since_ns.is_some() && (camera.leads || is_soon || is_without_lead);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Newest;
    use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
    use std::thread;
    use std::time::{Duration, Instant};

    const LONGEST_NS: u64 = 5;

    struct Scripted(Receiver<()>);

    impl FrameSource for Scripted {
        fn next(&mut self, _: &mut FrameBuffer) -> Result<Next, SourceError> {
            Ok(if self.0.recv().is_ok() { Next::Frame } else { Next::End })
        }
    }

    fn camera() -> (SyncSender<()>, Newest) {
        let (to, from) = sync_channel(1);
        (to, Newest::new(Box::new(Scripted(from))))
    }

    fn give(to: &SyncSender<()>, camera: &Newest) {
        to.send(()).expect("its thread runs");
        while !camera.arrivals().is_waiting() {
            thread::yield_now();
        }
    }

    #[test]
    fn a_cycle_is_due_when_all_frames_are_there_and_a_blocked_camera_delays_one_cycle() {
        let ((give_a, mut a), (give_b, mut b)) = (camera(), camera());
        let mut due = FramesDue::new([a.arrivals(), b.arrivals()], LONGEST_NS);
        let mut frame = FrameBuffer::default();
        assert!(!due.is_due(0));
        give(&give_a, &a);
        assert!(!due.is_due(100), "b is waited for");
        give(&give_b, &b);
        assert!(due.is_due(101));
        a.next(&mut frame).and_then(|_| b.next(&mut frame)).expect("frames");
        assert!(!due.is_due(102), "once");

        give(&give_a, &a);
        assert!(!due.is_due(200) && !due.is_due(204));
        assert!(due.is_due(205), "b is blocked");
        a.next(&mut frame).expect("a frame");
        give(&give_a, &a);
        assert!(due.is_due(300), "b is waited for no longer");
        a.next(&mut frame).expect("a frame");

        give(&give_b, &b);
        assert!(!due.is_due(380), "b is back, long after a: it goes with a's next");
        give(&give_a, &a);
        assert!(due.is_due(395));
        a.next(&mut frame).and_then(|_| b.next(&mut frame)).expect("frames");

        give(&give_b, &b);
        assert!(
            !due.is_due(480) && !due.is_due(494) && due.is_due(495),
            "a is silent for a cycle and what it may be late"
        );
        b.next(&mut frame).expect("a frame");
        give(&give_b, &b);
        assert!(due.is_due(600), "and is not waited for any more");
    }

    /// Two free-running cameras, the second this long after the first; returns how many of the cycles of their last 100
    /// frames had frames of both, of one, and the longest wait of a frame, ms.
    fn cycles(periods_ms: [u64; 2], after_ms: u64, longest_ms: u64) -> (u32, u32, u64) {
        let (mut gives, mut newest) = (Vec::new(), Vec::new());
        for (give, camera) in [camera(), camera()] {
            gives.push(give);
            newest.push(camera);
        }
        let mut due = FramesDue::new(newest.iter().map(Newest::arrivals), longest_ms);
        let mut frame = FrameBuffer::default();
        let (mut both, mut one, mut longest_wait_ms) = (0, 0, 0);
        let mut since_ms = [None; 2];
        let ends_ms = 120 * periods_ms[0];
        for now_ms in 0..ends_ms {
            for (i, starts_ms) in [0, after_ms].into_iter().enumerate() {
                if now_ms >= starts_ms && (now_ms - starts_ms) % periods_ms[i] == 0 {
                    give(&gives[i], &newest[i]);
                    since_ms[i] = Some(now_ms);
                }
            }
            if !due.is_due(now_ms) {
                continue;
            }
            for (newest, since_ms) in newest.iter_mut().zip(&since_ms) {
                if since_ms.is_some() {
                    newest.next(&mut frame).expect("a frame");
                }
            }
            if now_ms >= 20 * periods_ms[0] {
                let waits_ms = since_ms.into_iter().flatten().map(|since_ms| now_ms - since_ms);
                longest_wait_ms = waits_ms.fold(longest_wait_ms, u64::max);
                match since_ms.iter().flatten().count() {
                    2 => both += 1,
                    _ => one += 1,
                }
            }
            since_ms = [None; 2];
        }
        (both, one, longest_wait_ms)
    }

    /// Frames of two cameras with one rate are judged together, whatever their offset.
    #[test]
    fn cameras_of_one_rate_are_judged_together_at_every_offset() {
        for period_ms in [11, 33, 50, 66, 100] {
            for after_ms in [0, 1, 5, 16, 21, 25, 33, 49, 65, 99].into_iter().filter(|ms| *ms < period_ms) {
                for longest_ms in [5, 20] {
                    let (both, one, wait_ms) = cycles([period_ms; 2], after_ms, longest_ms);
                    let at =
                        format!("{period_ms} ms, {after_ms} ms apart, waits {longest_ms} ms: {both} {one} {wait_ms}");
                    assert!(both >= 98 && one == 0, "{at}");
                    assert!(wait_ms < period_ms, "{at}");
                }
            }
        }
    }

    /// One at half the rate of the other: every frame of the slow one goes with one of the fast one.
    #[test]
    fn a_slow_camera_does_not_hold_up_a_fast_one() {
        for after_ms in [0, 10, 25, 40, 60] {
            let (both, one, wait_ms) = cycles([33, 66], after_ms, 20);
            assert!((48..=52).contains(&both) && (48..=52).contains(&one), "{after_ms} ms apart: {both} {one}");
            assert!(wait_ms <= 33, "{after_ms} ms apart: {wait_ms} ms");
        }
    }

    #[test]
    fn a_frame_wakes_the_thread_that_waits_for_it() {
        let (give_a, a) = camera();
        let mut due = FramesDue::new([a.arrivals()], LONGEST_NS);
        assert!(!due.is_due(0));
        let giver = thread::spawn(move || {
            thread::sleep(Duration::from_millis(20));
            give_a.send(()).expect("its thread runs");
            give_a
        });
        let from = Instant::now();
        while !due.is_due(1) {
            thread::park_timeout(Duration::from_secs(20));
        }
        assert!(from.elapsed() < Duration::from_secs(10), "nobody woke it");
        drop(giver.join().expect("gave"));
    }
}
