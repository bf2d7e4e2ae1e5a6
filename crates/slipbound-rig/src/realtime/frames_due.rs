//! When a cycle is due, with cameras: as soon as the frames have arrived.

use crate::source::Arrivals;

/// A camera that is waited for, or not.
struct Camera {
    arrivals: Arrivals,
    /// Whether it had a frame for the last cycle.
    keeps_up: bool,
}

/// A cycle is due when every camera that had a frame for the last cycle has a new one, or when the first of them has
/// waited for the others for long enough. A camera that blocks delays one cycle by that time, and no further one.
pub struct FramesDue {
    cameras: Vec<Camera>,
    longest_ns: u64,
    since_ns: Option<u64>,
}

impl FramesDue {
    /// For the cameras of these [`Arrivals`]; a frame waits for those of the other cameras for `longest_ns` at most.
    pub fn new(cameras: impl IntoIterator<Item = Arrivals>, longest_ns: u64) -> Self {
        let cameras = cameras.into_iter().map(|arrivals| Camera { arrivals, keeps_up: true }).collect();
        FramesDue { cameras, longest_ns, since_ns: None }
    }

    /// Whether a cycle is due. True once per cycle.
    pub fn is_due(&mut self, now_ns: u64) -> bool {
        // Every camera is asked, for those without a frame wake this thread when they have one.
        let waiting_count = self.cameras.iter().filter(|camera| camera.arrivals.is_waiting()).count();
        if waiting_count == 0 {
            return false;
        }
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        let is_complete = self.cameras.iter().all(|camera| !camera.keeps_up || camera.arrivals.is_waiting());
        if !is_complete && now_ns.saturating_sub(since_ns) < self.longest_ns {
            return false;
        }
        self.since_ns = None;
        self.cameras.iter_mut().for_each(|camera| camera.keeps_up = camera.arrivals.is_waiting());
        true
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
        assert!(!due.is_due(400) && due.is_due(405), "b is back, now a is late");
        b.next(&mut frame).expect("a frame");
        give(&give_b, &b);
        assert!(due.is_due(500), "and a is not waited for");
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
