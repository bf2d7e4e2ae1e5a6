//! From a verdict per frame to the few moments worth a line: slip begins, slip ends.

use crate::monitor::{SlipKind, SlipReport, SlipState};
use serde::Serialize;

/// A slip is over after this many frames in a row without a new sign of it: a third of a second at 30 Hz, the
/// time in which the reference, taken anew at each sign, would show the next one.
const QUIET_FRAMES_COUNT: u32 = 10;

/// A moment worth a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum SlipEvent {
    /// Part of the contact began to slip.
    Begins {
        /// Number of the frame that shows it.
        seq: u64,
        /// Time of that frame.
        time_ns: Option<u64>,
        /// What kind of motion slips.
        kind: Option<SlipKind>,
        /// Direction in which the object slides, radians; None when it turns.
        direction_rad: Option<f64>,
    },
    /// It came to rest, or contact was lost.
    Ends {
        /// Number of the last frame that showed slip.
        seq: u64,
        /// Time of that frame.
        time_ns: Option<u64>,
        /// Frames that showed slip.
        frames_count: u32,
    },
}

/// Folds reports into events.
#[derive(Debug, Clone, Default)]
pub struct SlipEvents {
    running: Option<Running>,
}

#[derive(Debug, Clone, Copy)]
struct Running {
    last_seq: u64,
    last_time_ns: Option<u64>,
    frames_count: u32,
    quiet_frames_count: u32,
}

impl SlipEvents {
    /// Before the first report.
    pub fn new() -> Self {
        SlipEvents::default()
    }

    /// Takes the next report; says what it begins or ends.
    pub fn see(&mut self, report: &SlipReport) -> Option<SlipEvent> {
        let slips = matches!(report.state, SlipState::Incipient | SlipState::Gross);
        match (&mut self.running, slips) {
            (None, false) => None,
            (None, true) => {
                let (last_seq, last_time_ns) = (report.seq, report.time_ns);
                self.running = Some(Running { last_seq, last_time_ns, frames_count: 1, quiet_frames_count: 0 });
                let (seq, time_ns) = (report.seq, report.time_ns);
                let (kind, direction_rad) = (report.slip.kind, report.slip.direction_rad);
                Some(SlipEvent::Begins { seq, time_ns, kind, direction_rad })
            }
            (Some(running), true) => {
                running.last_seq = report.seq;
                running.last_time_ns = report.time_ns;
                running.frames_count += 1;
                running.quiet_frames_count = 0;
                None
            }
            (Some(running), false) => {
                running.quiet_frames_count += 1;
                let over = running.quiet_frames_count >= QUIET_FRAMES_COUNT || report.state == SlipState::NoContact;
                if over { self.end() } else { None }
            }
        }
    }

    /// Ends what still runs when the recording is over.
    pub fn end(&mut self) -> Option<SlipEvent> {
        self.running.take().map(|r| SlipEvent::Ends {
            seq: r.last_seq,
            time_ns: r.last_time_ns,
            frames_count: r.frames_count,
        })
    }
}
