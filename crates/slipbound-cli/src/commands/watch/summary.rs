//! The lines a person reads: what was torn, when slip began and ended, and how it all went.

use slipbound::events::SlipEvent;
use slipbound::monitor::{Reason, SlipKind, SlipReport, SlipState};
use slipbound::port::FrameBuffer;

/// Frames by state, slips, and what could not be judged.
#[derive(Debug, Default)]
pub struct Summary {
    states: Vec<(SlipState, u64)>,
    reasons: Vec<Unjudged>,
    slips_count: u64,
    torn_count: u64,
}

/// Frames that could not be judged, for one reason.
#[derive(Debug)]
struct Unjudged {
    why: &'static str,
    count: u64,
    first: String,
}

impl Summary {
    /// Before the first frame.
    pub fn new() -> Self {
        Summary::default()
    }

    /// Counts a frame. `torn`: why it did not arrive whole.
    pub fn see(&mut self, report: &SlipReport, frame: &FrameBuffer, torn: Option<&str>) {
        match self.states.iter_mut().find(|(state, _)| *state == report.state) {
            Some((_, count)) => *count += 1,
            None => self.states.push((report.state, 1)),
        }
        let Some(reason) = report.reason.filter(|_| report.state == SlipState::Unjudged) else {
            return;
        };
        self.torn_count += u64::from(reason == Reason::Torn);
        let why = match reason {
            Reason::FrameSize { .. } => "of another size",
            Reason::Dark { .. } => "dark",
            Reason::Torn => "torn",
            Reason::MarkersLost => "with most markers lost",
            Reason::MarkerSpacing { .. } => "with markers that do not stand a pitch apart",
            Reason::ContactQuality => "in poor contact",
        };
        match self.reasons.iter_mut().find(|u| u.why == why) {
            Some(unjudged) => unjudged.count += 1,
            None => {
                let reason = torn.map_or_else(|| reason.to_string(), str::to_owned);
                let first = format!("the first is {}: {reason}", called(frame));
                self.reasons.push(Unjudged { why, count: 1, first });
            }
        }
    }

    /// The line of an event.
    pub fn event(&mut self, event: &SlipEvent) -> String {
        match *event {
            SlipEvent::Begins { slip, seq, time_ns, kind, direction_rad } => {
                self.slips_count = u64::from(slip);
                let how = match kind {
                    Some(SlipKind::Translation) => ", translation",
                    Some(SlipKind::Rotation) => ", rotation",
                    Some(SlipKind::Both) => ", translation and rotation",
                    None => "",
                };
                let towards =
                    direction_rad.map_or_else(String::new, |d| format!(", towards {:.0} deg", d.to_degrees()));
                format!("frame {seq}{}: slip {slip} begins{how}{towards}", at(time_ns))
            }
            SlipEvent::Ends { slip, seq, time_ns, frames_count } => {
                let frames = counted(u64::from(frames_count), "frame");
                format!("frame {seq}{}: slip {slip} ends; {frames} showed it", at(time_ns))
            }
        }
    }

    /// The closing lines.
    pub fn lines(&self) -> Vec<String> {
        let mut states = self.states.clone();
        states.sort_by_key(|(state, _)| *state as u8);
        let parts: Vec<String> = states.iter().map(|(state, count)| format!("{count} {}", name(*state))).collect();
        let (frames, slips) = (counted(self.frames_count(), "frame"), counted(self.slips_count, "slip"));
        let mut lines = vec![match parts.is_empty() {
            true => format!("{frames}, {slips}"),
            false => format!("{frames}, {slips}: {}", parts.join(", ")),
        }];
        for unjudged in &self.reasons {
            lines.push(format!("{} {}; {}", counted(unjudged.count, "frame"), unjudged.why, unjudged.first));
        }
        lines
    }

    /// Frames seen.
    pub fn frames_count(&self) -> u64 {
        self.states.iter().map(|(_, count)| count).sum()
    }

    /// Frames that did not arrive whole.
    pub fn torn_count(&self) -> u64 {
        self.torn_count
    }
}

/// What is said of a torn frame.
pub fn torn(frame: &FrameBuffer, reason: &str) -> String {
    format!("{} is torn: {reason}", called(frame))
}

/// What a person knows a frame by.
pub fn called(frame: &FrameBuffer) -> String {
    match frame.label.as_str() {
        "" => format!("frame {}", frame.seq),
        label => format!("frame {} ({label})", frame.seq),
    }
}

fn at(time_ns: Option<u64>) -> String {
    time_ns.map_or_else(String::new, |ns| format!(" ({:.3} s)", ns as f64 / 1e9))
}

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A state's name as the report has it, in words.
fn name(state: SlipState) -> &'static str {
    match state {
        SlipState::NoContact => "no contact",
        SlipState::Unsure => "unsure",
        SlipState::Stick => "stick",
        SlipState::Incipient => "incipient slip",
        SlipState::Gross => "gross slip",
        SlipState::Unjudged => "unjudged",
    }
}
