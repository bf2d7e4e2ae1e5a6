//! What every live source counts and reports about itself.

use slipbound::port::{FrameSource, Next};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// How the reason of a torn frame begins that is none, but news of its camera.
pub(crate) const IS_BACK: &str = "the camera is back";

/// Whether this is news of the camera, which must be told, not a frame, of which the newest is enough.
pub(crate) fn is_news(next: &Next) -> bool {
    matches!(next, Next::Torn { reason } if reason.starts_with(IS_BACK))
}

/// A live source that has been opened.
pub struct Camera {
    /// Its frames. [`FrameSource::next`] waits for a tenth of a second at most and then returns silent; while it
    /// reconnects it can take longer, up to 5 s over a network: see [`Newest`](super::Newest). It reconnects by itself after it was
    /// unplugged or cut off.
    pub source: Box<dyn FrameSource + Send>,
    /// The negotiated and locked settings, as names and values; stored in recordings.
    pub facts: Vec<(String, String)>,
    /// Counts of its frames so far.
    pub tally: Arc<CameraTally>,
}

/// Counts the frames of a camera; shared between its thread and its readers.
#[derive(Debug, Default)]
pub struct CameraTally(Mutex<CameraCounts>);

/// Counts of a camera's frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CameraCounts {
    /// Whole frames received.
    pub frames_count: u64,
    /// Frames that could not be decoded whole. They are never judged.
    pub torn_count: u64,
    /// Frames that the camera or its driver numbered but did not deliver.
    pub missing_count: u64,
    /// How often it was lost and reconnected.
    pub returns_count: u64,
    /// Whether the frames carry time stamps of the camera or its driver.
    pub has_stamps: bool,
    /// Whether a time stamp was not later than the one before it, or missing: from then on frames have their arrival
    /// time.
    pub stamps_are_distrusted: bool,
    first_ns: Option<u64>,
    last_ns: Option<u64>,
    longest_ns: u64,
    /// Sum of the squared deviations of the intervals from their mean so far, ns2.
    spread_ns2: f64,
    mean_ns: f64,
    intervals_count: u64,
}

impl CameraTally {
    /// What has been counted so far.
    pub fn counts(&self) -> CameraCounts {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn change(&self, change: impl FnOnce(&mut CameraCounts)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// A whole frame came at this time of the computer's clock.
    pub(super) fn frame(&self, now_ns: u64, has_stamp: bool) {
        self.change(|counts| counts.frame(now_ns, has_stamp));
    }
}

impl CameraCounts {
    fn frame(&mut self, now_ns: u64, has_stamp: bool) {
        self.frames_count += 1;
        self.has_stamps = has_stamp;
        self.first_ns.get_or_insert(now_ns);
        if let Some(last_ns) = self.last_ns.replace(now_ns) {
            let interval_ns = now_ns.saturating_sub(last_ns);
            self.longest_ns = self.longest_ns.max(interval_ns);
            // Welford's running mean and variance.
            self.intervals_count += 1;
            let off_ns = interval_ns as f64 - self.mean_ns;
            self.mean_ns += off_ns / self.intervals_count as f64;
            self.spread_ns2 += off_ns * (interval_ns as f64 - self.mean_ns);
        }
    }

    /// Frame rate over the whole time, Hz; None before the second frame.
    pub fn rate_hz(&self) -> Option<f64> {
        let passed_ns = self.last_ns?.checked_sub(self.first_ns?).filter(|ns| *ns > 0)?;
        Some((self.frames_count - 1) as f64 * 1e9 / passed_ns as f64)
    }

    /// Standard deviation of the time between two frames, ms; None before the third frame.
    pub fn jitter_ms(&self) -> Option<f64> {
        (self.intervals_count > 1).then(|| (self.spread_ns2 / (self.intervals_count - 1) as f64).sqrt() * 1e-6)
    }

    /// Longest time between two frames, ms.
    pub fn longest_ms(&self) -> f64 {
        self.longest_ns as f64 * 1e-6
    }
}

/// One line: measured rate, jitter, and losses.
impl fmt::Display for CameraCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} frames", self.frames_count)?;
        if let Some(rate_hz) = self.rate_hz() {
            write!(f, " at {rate_hz:.1} Hz")?;
        }
        if let Some(jitter_ms) = self.jitter_ms() {
            write!(f, ", arrival jitter {jitter_ms:.1} ms, longest gap {:.0} ms", self.longest_ms())?;
        }
        write!(f, ", {} torn, {} lost by the camera or its driver", self.torn_count, self.missing_count)?;
        write!(f, ", {} times lost and back", self.returns_count)?;
        if self.stamps_are_distrusted {
            write!(f, ", its time stamps stood still or were missing: the times are those of arrival")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_jitter_and_the_longest_gap_are_those_of_the_arrivals() {
        let tally = CameraTally::default();
        assert_eq!((tally.counts().rate_hz(), tally.counts().jitter_ms()), (None, None));
        for ms in [100, 130, 170, 200] {
            tally.frame(ms * 1_000_000, false);
        }
        let counts = tally.counts();
        assert_eq!(counts.rate_hz(), Some(30.0));
        let jitter_ms = counts.jitter_ms().expect("three intervals");
        assert!((jitter_ms - (200.0f64 / 3.0 / 2.0).sqrt()).abs() < 1e-9, "{jitter_ms}");
        assert_eq!(counts.longest_ms(), 40.0);
        let text = counts.to_string();
        assert!(text.starts_with("4 frames at 30.0 Hz, arrival jitter 5.8 ms, longest gap 40 ms, 0 torn"), "{text}");
    }
}
