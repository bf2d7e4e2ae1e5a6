//! A recording whose first frames are inspected before they are judged: frames read ahead are given again.

use crate::printable::without_passwords;
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};
use std::collections::VecDeque;

/// A live source that gives only torn frames is read ahead for this long, ns.
const TORN_NS: u64 = 5_000_000_000;

/// A frame that was read ahead.
#[derive(Debug)]
pub struct AheadFrame {
    /// The frame; of a torn one neither bytes nor pixels are kept.
    pub buffer: FrameBuffer,
    /// Why it is torn; None when it is whole.
    pub torn: Option<String>,
}

/// A source with the frames that were read ahead in front of it. As a [`FrameSource`] it gives every frame once, in order,
/// and a failure after the frames that came before it.
pub struct ReadAhead {
    source: Box<dyn FrameSource + Send>,
    ahead: VecDeque<AheadFrame>,
    /// The failure that ended the reading ahead.
    failed: Option<SourceError>,
    /// Of a live source, which has no end.
    live: Option<Live>,
}

/// What is known of a live source.
struct Live {
    /// Its address, for messages.
    uri: String,
    /// The time, ns.
    now_ns: Box<dyn Fn() -> u64 + Send>,
}

impl ReadAhead {
    /// Nothing is read yet.
    pub fn new(source: Box<dyn FrameSource + Send>) -> Self {
        ReadAhead { source, ahead: VecDeque::new(), failed: None, live: None }
    }

    /// The same for a source that does not end by itself: it fails when it gives nothing but torn frames for 5 s by
    /// this clock, ns, while it is read ahead. `uri`: its name in messages.
    pub fn live(source: Box<dyn FrameSource + Send>, uri: &str, now_ns: impl Fn() -> u64 + Send + 'static) -> Self {
        let live = Live { uri: without_passwords(uri).into_owned(), now_ns: Box::new(now_ns) };
        ReadAhead { live: Some(live), ..ReadAhead::new(source) }
    }

    /// Reads on until this many complete frames wait, or the source ends or fails; returns all that wait, torn ones
    /// too.
    pub fn read_ahead(&mut self, whole_count: usize) -> impl Iterator<Item = &AheadFrame> {
        self.read_ahead_seen(whole_count, |_| {})
    }

    /// The same; `see` is told after every look at the source whether it was silent.
    pub fn read_ahead_seen(
        &mut self,
        whole_count: usize,
        mut see: impl FnMut(bool),
    ) -> impl Iterator<Item = &AheadFrame> {
        let mut missing_count = whole_count.saturating_sub(self.ahead.iter().filter(|a| a.torn.is_none()).count());
        let mut torn_since_ns = None;
        while missing_count > 0 && self.failed.is_none() {
            let mut buffer = FrameBuffer::default();
            let next = self.source.next(&mut buffer);
            see(matches!(next, Ok(Next::Silent)));
            match next {
                Ok(Next::Frame) => {
                    missing_count -= 1;
                    torn_since_ns = None;
                    self.ahead.push_back(AheadFrame { buffer, torn: None });
                }
                Ok(Next::Torn { reason }) => {
                    let buffer = FrameBuffer { encoded: Vec::new(), pixels: Vec::new(), ..buffer };
                    self.ahead.push_back(AheadFrame { buffer, torn: Some(reason) });
                    let Some(live) = &self.live else { continue };
                    let now_ns = (live.now_ns)();
                    if now_ns.saturating_sub(*torn_since_ns.get_or_insert(now_ns)) >= TORN_NS {
                        self.failed = Some(self.nothing_but_torn(&live.uri));
                    }
                }
                Ok(Next::Silent) => {}
                Ok(Next::End) => break,
                Err(error) => self.failed = Some(error),
            }
        }
        self.ahead.iter()
    }

    fn nothing_but_torn(&self, uri: &str) -> SourceError {
        let torn: Vec<&str> = self.ahead.iter().rev().map_while(|ahead| ahead.torn.as_deref()).collect();
        let (seconds, count, first) = (TORN_NS / 1_000_000_000, torn.len(), torn.last().unwrap_or(&""));
        let text =
            format!("{uri}: expected a whole frame within {seconds} s, got {count} torn ones, the first: {first}");
        SourceError::new(SourceErrorKind::Format, text).of_file(uri)
    }

    /// Removes and returns the error that ended reading ahead.
    pub fn take_failure(&mut self) -> Option<SourceError> {
        self.failed.take()
    }

    /// The clock of the frame times, that of the last waiting frame, because the stamps of a camera may be rejected
    /// from some frame on; unknown when none waits.
    pub fn clock(&self) -> Clock {
        self.ahead.back().map_or(Clock::Unknown, |ahead| ahead.buffer.clock)
    }

    /// Frames per second between the first and the last waiting frame, rounded; None without times or with those of two
    /// clocks, and below one.
    pub fn rate_hz(&self) -> Option<u32> {
        let (first, last) = (&self.ahead.front()?.buffer, &self.ahead.back()?.buffer);
        let last_ns = last.time_ns.filter(|_| last.clock == first.clock)?;
        let passed_ns = last_ns.checked_sub(first.time_ns?)?;
        let rate_hz = last.seq.checked_sub(first.seq)? as f64 * 1e9 / passed_ns as f64;
        (rate_hz >= 1.0 && rate_hz.is_finite()).then(|| rate_hz.round() as u32)
    }
}

impl FrameSource for ReadAhead {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if let Some(ahead) = self.ahead.pop_front() {
            *into = ahead.buffer;
            return Ok(ahead.torn.map_or(Next::Frame, |reason| Next::Torn { reason }));
        }
        match self.failed.take() {
            Some(error) => Err(error),
            None => self.source.next(into),
        }
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}

/// The size that most frames have; of equally many the first. None without frames.
pub fn most_common_size<'a>(frames: impl IntoIterator<Item = &'a FrameBuffer>) -> Option<SizePx> {
    let sizes: Vec<SizePx> = frames.into_iter().map(|frame| frame.size).collect();
    let count = |size: SizePx| sizes.iter().filter(|other| **other == size).count();
    sizes.iter().copied().rev().max_by_key(|&size| count(size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Whole and torn frames 40 ms apart, then a failure.
    struct Script {
        given_count: u64,
        torn: Vec<u64>,
        fails_at: u64,
    }

    impl FrameSource for Script {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            (into.seq, into.time_ns, into.clock) =
                (self.given_count, Some(self.given_count * 40_000_000), Clock::Device);
            self.given_count += 1;
            match into.seq {
                seq if seq == self.fails_at => {
                    Err(SourceError::new(SourceErrorKind::Disconnected, "the camera is gone"))
                }
                seq if self.torn.contains(&seq) => Ok(Next::Torn { reason: "cut".into() }),
                _ => Ok(Next::Frame),
            }
        }
    }

    fn script(torn: &[u64], fails_at: u64) -> ReadAhead {
        ReadAhead::new(Box::new(Script { given_count: 0, torn: torn.to_vec(), fails_at }))
    }

    #[test]
    fn frames_read_ahead_are_given_once_in_order_and_a_failure_after_them() {
        let mut source = script(&[1], 4);
        let ahead: Vec<_> = source.read_ahead(2).map(|a| (a.buffer.seq, a.torn.is_some())).collect();
        assert_eq!(ahead, [(0, false), (1, true), (2, false)]);
        assert_eq!((source.clock(), source.rate_hz()), (Clock::Device, Some(25)));
        assert_eq!(source.read_ahead(9).count(), 4, "up to the failure");
        let mut buffer = FrameBuffer::default();
        let mut given = Vec::new();
        let error = loop {
            match source.next(&mut buffer) {
                Ok(next) => given.push((buffer.seq, next == Next::Frame)),
                Err(error) => break error,
            }
        };
        assert_eq!(given, [(0, true), (1, false), (2, true), (3, true)]);
        assert_eq!(error.to_string(), "the camera is gone");
    }

    #[test]
    fn a_failure_before_the_first_frame_can_be_taken() {
        let mut source = script(&[], 0);
        assert_eq!(source.read_ahead(3).count(), 0);
        assert!(source.take_failure().is_some());
        assert_eq!((source.clock(), source.rate_hz()), (Clock::Unknown, None));
    }

    #[test]
    fn a_live_source_of_torn_frames_fails_after_five_seconds_and_keeps_none_of_their_bytes() {
        /// Every frame takes 100 ms of a clock, and a megabyte; one in the middle is whole.
        struct Garbage(Arc<AtomicU64>, Option<u64>);
        impl FrameSource for Garbage {
            fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
                let number = self.0.fetch_add(100_000_000, Ordering::Relaxed) / 100_000_000;
                if number > 1000 {
                    return Ok(Next::End);
                }
                (into.encoded, into.pixels) = (vec![b'x'; 1 << 20], vec![1; 1 << 20]);
                let reason = format!("no JPEG {number}");
                Ok(if self.1 == Some(number) { Next::Frame } else { Next::Torn { reason } })
            }
        }
        for (whole, count, first) in [(None, 51, "no JPEG 0"), (Some(40), 51, "no JPEG 41")] {
            let clock = Arc::new(AtomicU64::new(0));
            let now = clock.clone();
            let source = Box::new(Garbage(clock, whole));
            let mut source = ReadAhead::live(source, "http://here/", move || now.load(Ordering::Relaxed));
            let all: Vec<&AheadFrame> = source.read_ahead(3).collect();
            assert_eq!(all.len(), count + whole.map_or(0, |at| at as usize + 1));
            let kept = all.iter().filter(|a| !a.buffer.encoded.is_empty() || !a.buffer.pixels.is_empty());
            assert_eq!(kept.count(), usize::from(whole.is_some()), "only what is whole");
            let why = source.take_failure().expect("it fails").to_string();
            let expected =
                format!("http://here/: expected a whole frame within 5 s, got {count} torn ones, the first: {first}");
            assert_eq!(why, expected);
        }
        // A recording ends by itself.
        let mut recording = ReadAhead::new(Box::new(Garbage(Arc::default(), None)));
        assert_eq!((recording.read_ahead(3).count(), recording.take_failure().is_none()), (1001, true));
    }

    #[test]
    fn the_most_common_size_wins_then_the_first() {
        let of = |width| FrameBuffer { size: SizePx::new(width, 1), ..FrameBuffer::default() };
        let (a, b) = (of(1), of(2));
        assert_eq!(most_common_size([&a, &b, &b]), Some(b.size));
        assert_eq!(most_common_size([&a, &b]), Some(a.size));
        assert_eq!(most_common_size([]), None);
    }
}
