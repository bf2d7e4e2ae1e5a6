//! One verdict per frame -> a few events: slip begins, slip ends.
//!
//! ```text
//!   signs of slip:   . . x x . x . . . . . . . x x ...
//!   episodes:            |-- 1 --|<- 0.2 s ->| |- 2 ...
//! ```
//!
//! One rule for recordings, closed loops and replays, so that all number slips alike: a slip ends after 0.2 s without a
//! sign of it (1.5 s if no frame that can be judged came in that time), or when contact is lost.

use crate::hand::HandReport;
use crate::monitor::{SlipKind, SlipReport, SlipState};
use serde::Serialize;

/// A slip is over after this time without a sign of it. It is less than a controller needs for a step and its pause, so
/// that the next slip counts as a new one.
const QUIET_NS: u64 = 200_000_000;

/// The same if no frame that can be judged came in between: at least one frame a second is needed to follow a slip.
const UNOBSERVED_NS: u64 = 1_500_000_000;

/// The same where frames have no time: 0.2 s at 30 Hz.
const QUIET_FRAMES_COUNT: u64 = 6;

/// Whether one frame or one cycle shows slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SlipObservation {
    /// Number of the frame.
    pub seq: u64,
    /// Its time, ns; None where it is not known.
    pub time_ns: Option<u64>,
    /// Whether it was judged; a cycle without a frame was not.
    pub is_judged: bool,
    /// Whether it shows slip.
    pub slips: bool,
    /// Whether contact was lost.
    pub contact_lost: bool,
}

impl SlipObservation {
    /// From the report of a finger.
    pub fn of_finger(report: &SlipReport) -> Self {
        SlipObservation { seq: report.seq, time_ns: report.time_ns, ..Self::of_state(report.state) }
    }

    /// From the report of the hand in a cycle.
    pub fn of_hand(now_ns: u64, hand: &HandReport) -> Self {
        SlipObservation { seq: hand.seq, time_ns: Some(now_ns), ..Self::of_state(hand.state) }
    }

    fn of_state(state: SlipState) -> Self {
        let (is_judged, slips) = (state != SlipState::Unjudged, state.is_slip());
        SlipObservation { seq: 0, time_ns: None, is_judged, slips, contact_lost: state == SlipState::NoContact }
    }
}

/// A frame by number and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameStamp {
    /// Number of the frame.
    pub seq: u64,
    /// Its time, ns; None where it is not known.
    pub time_ns: Option<u64>,
}

/// A slip from the first sign of it to the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Episode {
    /// Its number, from 1.
    pub number: u32,
    /// The first frame that showed it.
    pub first: FrameStamp,
    /// The last frame that showed it.
    pub last: FrameStamp,
    /// Frames that showed it.
    pub frames_count: u32,
}

/// The slips that an observation ends and begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EpisodeChange {
    /// The slip that is over.
    pub ended: Option<Episode>,
    /// The slip that begins.
    pub began: Option<Episode>,
}

/// Folds observations into episodes.
#[derive(Debug, Clone, Default)]
pub struct SlipEpisodes {
    running: Option<Episode>,
    /// Whether a frame without slip has come since its last sign.
    was_quiet: bool,
    count: u32,
}

impl SlipEpisodes {
    /// Slips that have begun so far.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Takes the next observation; returns what it ends and begins.
    pub fn see(&mut self, observation: &SlipObservation) -> EpisodeChange {
        let mut change = EpisodeChange::default();
        if self.running.is_some_and(|running| observation.contact_lost || self.is_over(&running, observation)) {
            change.ended = self.running.take();
        }
        self.was_quiet = !observation.slips && (self.was_quiet || observation.is_judged);
        if !observation.slips {
            return change;
        }
        let now = FrameStamp { seq: observation.seq, time_ns: observation.time_ns };
        match &mut self.running {
            Some(running) => {
                running.last = now;
                running.frames_count += 1;
            }
            None => {
                self.count += 1;
                self.running = Some(Episode { number: self.count, first: now, last: now, frames_count: 1 });
                change.began = self.running;
            }
        }
        change
    }

    /// Whether a slip with this last sign is over by the time of `observation`.
    fn is_over(&self, running: &Episode, observation: &SlipObservation) -> bool {
        // Between two frames of a slow camera there was no frame without slip.
        let is_quiet = self.was_quiet || observation.is_judged && !observation.slips;
        let quiet_ns = if is_quiet { QUIET_NS } else { UNOBSERVED_NS };
        match (running.last.time_ns, observation.time_ns) {
            // A clock that was set back counts, too.
            (Some(last_ns), Some(now_ns)) => now_ns.abs_diff(last_ns) >= quiet_ns,
            _ => observation.seq.saturating_sub(running.last.seq) >= QUIET_FRAMES_COUNT,
        }
    }

    /// Ends the slip still in progress when the recording or the loop is over.
    pub fn end(&mut self) -> Option<Episode> {
        self.running.take()
    }
}

/// A slip event of one finger.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum SlipEvent {
    /// Part of the contact began to slip.
    Begins {
        /// The slip's number, from 1.
        slip: u32,
        /// Number of the frame that shows it.
        seq: u64,
        /// Time of that frame, ns.
        time_ns: Option<u64>,
        /// What kind of motion slips.
        kind: Option<SlipKind>,
        /// Direction in which the object slides, radians; None when it turns.
        direction_rad: Option<f64>,
    },
    /// The slip stopped, or contact was lost, or the recording ended.
    Ends {
        /// The slip's number.
        slip: u32,
        /// Number of the last frame that showed slip.
        seq: u64,
        /// Time of that frame, ns.
        time_ns: Option<u64>,
        /// Frames that showed slip.
        frames_count: u32,
        /// Whether the recording ended before the slip did.
        ongoing: bool,
    },
}

/// Folds the reports of one finger into events.
#[derive(Debug, Clone, Default)]
pub struct SlipEvents {
    episodes: SlipEpisodes,
}

impl SlipEvents {
    /// Before the first report.
    pub fn new() -> Self {
        SlipEvents::default()
    }

    /// Takes the next report; returns what it ends and what it begins, in this order.
    pub fn see(&mut self, report: &SlipReport) -> impl Iterator<Item = SlipEvent> + use<> {
        let change = self.episodes.see(&SlipObservation::of_finger(report));
        let begins = change.began.map(|slip| SlipEvent::Begins {
            slip: slip.number,
            seq: report.seq,
            time_ns: report.time_ns,
            kind: report.slip.kind,
            direction_rad: report.slip.direction_rad,
        });
        change.ended.map(|slip| ends(slip, false)).into_iter().chain(begins)
    }

    /// Ends the slip still in progress when the recording is over.
    pub fn end(&mut self) -> Option<SlipEvent> {
        self.episodes.end().map(|slip| ends(slip, true))
    }
}

fn ends(slip: Episode, ongoing: bool) -> SlipEvent {
    let FrameStamp { seq, time_ns } = slip.last;
    SlipEvent::Ends { slip: slip.number, seq, time_ns, frames_count: slip.frames_count, ongoing }
}
