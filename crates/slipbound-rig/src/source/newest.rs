//! A source on a thread of its own, so that a blocking source never stalls the loop.
//!
//! ```text
//!   thread: source.next (may block)  --frame--> slot    the newest frame wins, what it replaces is counted
//!                                    --frame--> queue   or every frame is kept, and the thread waits when it is full
//!   loop:   next (never blocks)      <--------- Frame, Torn, Silent, End
//! ```

use super::camera::is_news;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, Thread};
use std::time::Duration;

/// What the thread has read and the loop has not yet taken.
#[derive(Default)]
struct Slot {
    waiting: VecDeque<(FrameBuffer, Next)>,
    free: Vec<FrameBuffer>,
    end: Option<Result<(), SourceError>>,
    replaced_count: u64,
    is_abandoned: bool,
    /// The thread has ended, and with it the source.
    is_closed: bool,
    /// The thread that asked last and found nothing: it is woken when something arrives.
    asks: Option<Thread>,
}

impl Slot {
    fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.end.is_none()
    }

    fn wake(&mut self) {
        self.asks.take().iter().for_each(Thread::unpark);
    }
}

struct Shared {
    slot: Mutex<Slot>,
    taken: Condvar,
}

impl Shared {
    /// A thread that panicked while it held the lock leaves the slot as it was.
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A source whose frames are read on a thread of its own. [`FrameSource::next`] never blocks: it is
/// [`Next::Silent`] while nothing new has come.
pub struct Newest {
    shared: Arc<Shared>,
    frames_count: Option<u64>,
}

/// Shows the driver of the loop whether a frame is waiting.
#[derive(Clone)]
pub struct Arrivals(Arc<Shared>);

impl Arrivals {
    /// Whether a frame, or the end of the source, waits to be taken. While nothing does, the calling thread is unparked
    /// ([`thread::park_timeout`]) when something comes.
    pub fn is_waiting(&self) -> bool {
        let mut slot = self.0.lock();
        if slot.is_empty() {
            slot.asks = Some(thread::current());
        }
        !slot.is_empty()
    }

    /// Whether the source is closed, so that it can be opened again: soon after its reader is dropped.
    pub fn is_closed(&self) -> bool {
        self.0.lock().is_closed
    }

    /// Frames that a newer one replaced before they were taken: they were never judged.
    pub fn replaced_count(&self) -> u64 {
        self.0.lock().replaced_count
    }
}

/// Longest wait of [`Awaited`].
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// A blocking [`Newest`]: `next` waits for a frame, for a tenth of a second at most.
pub struct Awaited(pub Newest);

impl FrameSource for Awaited {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if !self.0.arrivals().is_waiting() {
            thread::park_timeout(LONGEST_WAIT); // an arrival unparks this thread
        }
        self.0.next(into)
    }

    fn frames_count(&self) -> Option<u64> {
        self.0.frames_count()
    }
}

impl Newest {
    /// For cameras: only the newest frame is kept, and before it what a camera that is back says.
    pub fn new(source: Box<dyn FrameSource + Send>) -> Self {
        Newest::with_room(source, None)
    }

    /// For recordings: every frame is delivered in order, at most `room_count` are read ahead.
    pub fn every_frame(source: Box<dyn FrameSource + Send>, room_count: usize) -> Self {
        Newest::with_room(source, Some(room_count.max(1)))
    }

    fn with_room(source: Box<dyn FrameSource + Send>, room_count: Option<usize>) -> Self {
        let frames_count = source.frames_count();
        let shared = Arc::new(Shared { slot: Mutex::default(), taken: Condvar::new() });
        let theirs = shared.clone();
        thread::spawn(move || {
            read(source, &theirs, room_count);
            theirs.lock().is_closed = true;
        });
        Newest { shared, frames_count }
    }

    /// A handle that shows whether a frame is waiting.
    pub fn arrivals(&self) -> Arrivals {
        Arrivals(self.shared.clone())
    }

    /// Frames that a newer one replaced before they were taken.
    pub fn replaced_count(&self) -> u64 {
        self.arrivals().replaced_count()
    }
}

/// If the source panics, the reader of its frames gets an error that says so.
struct PanicGuard<'a>(&'a Shared);

impl Drop for PanicGuard<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            let text = "the thread that reads its frames has panicked";
            let mut slot = self.0.lock();
            slot.end = Some(Err(SourceError::new(SourceErrorKind::Other, text)));
            slot.wake();
        }
    }
}

/// Reads until the source ends or fails, or its frames are no longer taken.
fn read(mut source: Box<dyn FrameSource + Send>, shared: &Shared, room_count: Option<usize>) {
    let _guard = PanicGuard(shared);
    let mut frame = FrameBuffer::default();
    loop {
        let next = source.next(&mut frame);
        let mut slot = shared.lock();
        if slot.is_abandoned {
            return;
        }
        match next {
            Ok(Next::Silent) => continue,
            Ok(Next::End) => {
                slot.end = Some(Ok(()));
                return slot.wake();
            }
            Err(error) => {
                slot.end = Some(Err(error));
                return slot.wake();
            }
            Ok(next) => {
                match room_count {
                    None => {
                        // News of the camera stays until it is taken, once.
                        let mut place = 0;
                        while let Some((_, old)) = slot.waiting.get(place) {
                            if is_news(old) && *old != next {
                                place += 1;
                                continue;
                            }
                            let replaced = slot.waiting.remove(place);
                            slot.free.extend(replaced.map(|(old, _)| old));
                            slot.replaced_count += 1;
                        }
                    }
                    Some(room_count) => {
                        while slot.waiting.len() >= room_count && !slot.is_abandoned {
                            slot = shared.taken.wait(slot).unwrap_or_else(PoisonError::into_inner);
                        }
                    }
                }
                let empty = slot.free.pop().unwrap_or_default();
                slot.waiting.push_back((std::mem::replace(&mut frame, empty), next));
                slot.wake();
            }
        }
    }
}

impl FrameSource for Newest {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let mut slot = self.shared.lock();
        if let Some((mut frame, next)) = slot.waiting.pop_front() {
            std::mem::swap(into, &mut frame);
            slot.free.push(frame);
            self.shared.taken.notify_one();
            return Ok(next);
        }
        match slot.end.take() {
            None => Ok(Next::Silent),
            Some(Ok(())) => {
                slot.end = Some(Ok(())); // asked again, it is still over
                Ok(Next::End)
            }
            Some(Err(error)) => Err(error),
        }
    }

    fn frames_count(&self) -> Option<u64> {
        self.frames_count
    }
}

/// The thread ends at its next frame; one that is blocked in its source is left behind.
impl Drop for Newest {
    fn drop(&mut self) {
        self.shared.lock().is_abandoned = true;
        self.shared.taken.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
    use std::time::Instant;

    /// A source that waits for its next frame.
    struct Blocking(Receiver<Result<Next, SourceError>>, u64);

    impl FrameSource for Blocking {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            self.1 += 1;
            into.seq = self.1;
            self.0.recv().unwrap_or(Ok(Next::End))
        }
    }

    fn blocking() -> (SyncSender<Result<Next, SourceError>>, Box<Blocking>) {
        let (to, from) = sync_channel(0);
        (to, Box::new(Blocking(from, 0)))
    }

    fn until(what: impl Fn() -> bool) {
        let from = Instant::now();
        while !what() {
            assert!(from.elapsed() < Duration::from_secs(20), "it never came");
            thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_source_that_breaks_down_has_failed() {
        struct Broken;
        impl FrameSource for Broken {
            fn next(&mut self, _: &mut FrameBuffer) -> Result<Next, SourceError> {
                panic!("a decoder that breaks down, as this test wants");
            }
        }
        let mut frame = FrameBuffer::default();
        for mut newest in [Newest::new(Box::new(Broken)), Newest::every_frame(Box::new(Broken), 2)] {
            until(|| newest.arrivals().is_waiting());
            let error = newest.next(&mut frame).expect_err("failed").to_string();
            assert_eq!(error, "the thread that reads its frames has panicked");
        }
    }

    #[test]
    fn the_newest_frame_wins_and_what_it_replaces_is_counted() {
        let (give, source) = blocking();
        let mut newest = Newest::new(source);
        let mut frame = FrameBuffer::default();
        assert_eq!(newest.next(&mut frame).expect("goes on"), Next::Silent, "it does not wait");
        for _ in 0..3 {
            give.send(Ok(Next::Frame)).expect("read");
        }
        until(|| newest.replaced_count() == 2);
        assert_eq!(newest.next(&mut frame).expect("goes on"), Next::Frame);
        assert_eq!(frame.seq, 3);
        give.send(Err(SourceError::new(SourceErrorKind::Disconnected, "unplugged"))).expect("read");
        until(|| newest.arrivals().is_waiting());
        assert_eq!(newest.next(&mut frame).expect_err("unplugged").to_string(), "unplugged");
    }

    /// A hand takes a frame in a cycle of some ms; the first frame of a camera that is back follows its news at once.
    #[test]
    fn news_of_a_camera_is_not_replaced_by_its_next_frame() {
        let (give, source) = blocking();
        let mut newest = Newest::new(source);
        let torn = |reason: &str| Next::Torn { reason: reason.into() };
        let news = torn("the camera is back, and is set otherwise: gain expected 4 as at first, got 5");
        for next in [torn("cut"), news.clone(), news.clone(), Next::Frame, Next::Frame] {
            give.send(Ok(next)).expect("read");
        }
        until(|| newest.replaced_count() == 3);
        let mut frame = FrameBuffer::default();
        let mut taken = Vec::new();
        for _ in 0..3 {
            taken.push((newest.next(&mut frame).expect("goes on"), frame.seq));
        }
        assert_eq!(taken, [(news, 3), (Next::Frame, 5), (Next::Silent, 5)]);
    }

    #[test]
    fn one_that_is_awaited_is_silent_after_a_tenth_of_a_second_and_wakes_for_a_frame() {
        let (give, source) = blocking();
        let mut awaited = Awaited(Newest::new(source));
        let mut frame = FrameBuffer::default();
        let from = Instant::now();
        assert_eq!(awaited.next(&mut frame).expect("goes on"), Next::Silent);
        assert!((90..5000).contains(&from.elapsed().as_millis()), "{:?}", from.elapsed());
        give.send(Ok(Next::Frame)).expect("read");
        let mut waits_count = 0;
        while awaited.next(&mut frame).expect("goes on") == Next::Silent {
            waits_count += 1;
            assert!(waits_count < 100, "it never came");
        }
        assert_eq!((frame.seq, awaited.0.replaced_count()), (1, 0));
    }

    #[test]
    fn every_frame_of_a_recording_comes_in_its_order_and_no_more_are_read_than_there_is_room() {
        let (give, source) = blocking();
        let mut queue = Newest::every_frame(source, 2);
        let giver = thread::spawn(move || (0..5).take_while(|_| give.send(Ok(Next::Frame)).is_ok()).count());
        until(|| queue.shared.lock().waiting.len() == 2);
        let mut seqs = Vec::new();
        let mut frame = FrameBuffer::default();
        while seqs.len() < 5 {
            if queue.next(&mut frame).expect("goes on") == Next::Frame {
                seqs.push(frame.seq);
            }
            assert!(queue.shared.lock().waiting.len() <= 2);
        }
        assert_eq!((seqs, queue.replaced_count()), (vec![1, 2, 3, 4, 5], 0));
        assert_eq!(giver.join().expect("gave"), 5);
        until(|| queue.arrivals().is_waiting());
        assert_eq!(queue.next(&mut frame).expect("over"), Next::End);
        assert_eq!(queue.next(&mut frame).expect("over"), Next::End, "and stays over");
    }
}
