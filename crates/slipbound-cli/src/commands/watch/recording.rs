//! A source read ahead: the frames in which rest is looked for are judged again from the first.

use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::collections::VecDeque;

/// What comes next.
#[derive(Debug)]
pub enum Arrived {
    /// A frame, see [`Recording::frame`].
    Whole,
    /// A frame that did not arrive whole, and why.
    Torn(String),
    /// Nothing more.
    Over,
}

/// A frame read ahead; torn if there is a reason.
#[derive(Debug)]
pub struct Ahead {
    /// The frame.
    pub frame: FrameBuffer,
    /// Why it is torn.
    pub torn: Option<String>,
}

/// A source with the frames read ahead in front of it.
pub struct Recording {
    source: Box<dyn FrameSource + Send>,
    ahead: VecDeque<Ahead>,
    /// The failure that ended the reading ahead, to be told when its turn comes.
    failed: Option<SourceError>,
    current: FrameBuffer,
}

impl Recording {
    /// Nothing is read yet.
    pub fn new(source: Box<dyn FrameSource + Send>) -> Self {
        Recording { source, ahead: VecDeque::new(), failed: None, current: FrameBuffer::default() }
    }

    /// Reads on until this many whole frames wait, or the source ends; all that wait.
    pub fn read_ahead(&mut self, whole_count: usize) -> impl Iterator<Item = &Ahead> {
        let mut missing = whole_count.saturating_sub(self.ahead.iter().filter(|a| a.torn.is_none()).count());
        while missing > 0 && self.failed.is_none() {
            let mut frame = FrameBuffer::default();
            match self.source.next(&mut frame) {
                Ok(Next::Frame) => {
                    missing -= 1;
                    self.ahead.push_back(Ahead { frame, torn: None });
                }
                Ok(Next::Torn { reason }) => self.ahead.push_back(Ahead { frame, torn: Some(reason) }),
                Ok(Next::Silent) => {}
                Ok(Next::End) => break,
                Err(e) => self.failed = Some(e),
            }
        }
        self.ahead.iter()
    }

    /// The failure that ended the reading ahead, when there is not a single frame to judge before it.
    pub fn take_failure(&mut self) -> Option<SourceError> {
        self.failed.take()
    }

    /// The next frame, into [`Recording::frame`].
    pub fn next(&mut self) -> anyhow::Result<Arrived> {
        if let Some(ahead) = self.ahead.pop_front() {
            self.current = ahead.frame;
            return Ok(ahead.torn.map_or(Arrived::Whole, Arrived::Torn));
        }
        if let Some(e) = self.failed.take() {
            return Err(anyhow::Error::from_boxed(e));
        }
        loop {
            return Ok(match self.source.next(&mut self.current).map_err(anyhow::Error::from_boxed)? {
                Next::Frame => Arrived::Whole,
                Next::Torn { reason } => Arrived::Torn(reason),
                Next::Silent => continue,
                Next::End => Arrived::Over,
            });
        }
    }

    /// The frame that came last.
    pub fn frame(&self) -> &FrameBuffer {
        &self.current
    }

    /// Whose clock the frames' time is from, as the first frame waiting says.
    pub fn clock(&self) -> Clock {
        self.ahead.front().map_or(self.current.clock, |a| a.frame.clock)
    }

    /// Frames per second between the first frames waiting, where they have times.
    pub fn rate_hz(&self) -> Option<u32> {
        let (first, last) = (&self.ahead.front()?.frame, &self.ahead.back()?.frame);
        let passed_ns = last.time_ns?.checked_sub(first.time_ns?)?;
        let rate_hz = (last.seq - first.seq) as f64 * 1e9 / passed_ns as f64;
        (rate_hz >= 1.0 && rate_hz.is_finite()).then(|| rate_hz.round() as u32)
    }

    /// How many frames there are in all, where that is known.
    pub fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}
