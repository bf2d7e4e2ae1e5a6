//! Verdict on a clip, or on a window of it: a detector's results on its frames -> highest score, first alarm.
//!
//! ```text
//!   rival   score of each frame, alarm of each frame   --> highest score, first alarm
//!   ours    greatest value of each evidence --scale-->     slide score, over 1: it slides
//! ```

use super::clip_watch::Seen;
use crate::rivals::Entry;
use slipbound::monitor::{EvidenceReport, EvidenceSettings};

/// The largest value of each part of the evidence over the scored frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Latch {
    /// The relaxation.
    pub relaxation: f64,
    /// The ratio of the displacement at the centre to that at the rim.
    pub centre_rim_ratio: Option<f64>,
    /// The change of the imprint.
    pub imprint_change: Option<f64>,
}

impl Latch {
    /// Adds a frame.
    pub fn see(&mut self, evidence: &EvidenceReport) {
        let most = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::max);
        self.relaxation = self.relaxation.max(evidence.relaxation);
        self.centre_rim_ratio = most(self.centre_rim_ratio, evidence.centre_rim_ratio);
        self.imprint_change = most(self.imprint_change, evidence.imprint_change);
    }

    /// The slide score on a scale.
    pub fn score(&self, scale: &EvidenceSettings) -> f64 {
        scale.slide_score(self.relaxation, self.centre_rim_ratio, self.imprint_change)
    }
}

/// Highest score and first alarm over the scored frames. Ours uses the evidence of sliding, on `scale`.
pub fn judged(entry: &Entry, seen: &[Seen], scale: &EvidenceSettings) -> (f64, Option<u64>, Latch) {
    let (mut latch, mut score, mut first_alarm) = (Latch::default(), 0.0f64, None);
    for frame in seen {
        let (now, alarms) = match (&frame.evidence, entry.is_ours()) {
            (Some(evidence), true) => {
                latch.see(evidence);
                (latch.score(scale), latch.score(scale) > 1.0)
            }
            (None, true) => (score, false),
            (_, false) => (frame.score, frame.alarms),
        };
        score = if frame.frame == seen[0].frame { now } else { score.max(now) };
        if alarms && first_alarm.is_none() {
            first_alarm = Some(frame.frame);
        }
    }
    (score, first_alarm, latch)
}
