//! Reports in words: when slip began and ended, which frames were torn, and totals at the end.

use slipbound::events::SlipEvent;
use slipbound::image::SizePx;
use slipbound::monitor::{Reason, SlipKind, SlipReport, SlipState};
use slipbound::port::FrameBuffer;

/// Counts frames by state, slips, and frames that could not be judged.
#[derive(Debug, Default)]
pub struct ReportSummary {
    states: Vec<(SlipState, u64)>,
    reasons: Vec<Unjudged>,
    slips_count: u64,
    torn_count: u64,
    other_size_count: u64,
}

/// Frames that could not be judged, for one reason.
#[derive(Debug)]
struct Unjudged {
    why: &'static str,
    count: u64,
    first: String,
}

impl ReportSummary {
    /// Before the first frame.
    pub fn new() -> Self {
        ReportSummary::default()
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
        self.other_size_count += u64::from(matches!(reason, Reason::FrameSize { .. }));
        let why = match reason {
            Reason::FrameSize { .. } => "of another size",
            Reason::Dark { .. } => "dark",
            Reason::Torn => "torn",
            Reason::Gap { .. } => "after a gap",
            Reason::MarkersLost => "with too many markers lost",
            Reason::MarkerSpacing { .. } => "with markers that do not stand a pitch apart",
            Reason::ContactQuality => "in poor contact",
        };
        match self.reasons.iter_mut().find(|u| u.why == why) {
            Some(unjudged) => unjudged.count += 1,
            None => {
                let reason = torn.map_or_else(|| reason.to_string(), str::to_owned);
                let first = format!("the first is {}: {reason}", frame_name(frame));
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
                let towards = direction_rad.map_or_else(String::new, |d| format!(", towards {} deg", whole_degrees(d)));
                format!("frame {seq}{}: slip {slip} begins{how}{towards}", at(time_ns))
            }
            SlipEvent::Ends { slip, seq, time_ns, frames_count, ongoing } => {
                let frames = counted(u64::from(frames_count), "frame");
                let how = if ongoing { "is still going on at the end" } else { "ends" };
                format!("frame {seq}{}: slip {slip} {how}; {frames} showed it", at(time_ns))
            }
        }
    }

    /// The closing lines.
    pub fn lines(&self) -> Vec<String> {
        let mut states = self.states.clone();
        states.sort_by_key(|(state, _)| *state as u8);
        let parts: Vec<String> =
            states.iter().map(|(state, count)| format!("{count} {}", state_name(*state))).collect();
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

    /// Slips seen.
    pub fn slips_count(&self) -> u64 {
        self.slips_count
    }

    /// Frames in this state.
    pub fn count(&self, state: SlipState) -> u64 {
        self.states.iter().find(|(of, _)| *of == state).map_or(0, |(_, count)| *count)
    }

    /// Frames that did not arrive whole.
    pub fn torn_count(&self) -> u64 {
        self.torn_count
    }

    /// Frames of another size than the first whole one, which the monitor cannot judge.
    pub fn other_size_count(&self) -> u64 {
        self.other_size_count
    }
}

/// A direction in whole degrees; a zero has no sign.
pub(crate) fn whole_degrees(rad: f64) -> f64 {
    rad.to_degrees().round() + 0.0
}

/// A torn frame and why, in words.
pub fn torn(frame: &FrameBuffer, reason: &str) -> String {
    format!("{} is torn: {reason}", frame_name(frame))
}

/// A frame of another size than the others, in words.
pub fn of_other_size(frame: &FrameBuffer, expected: SizePx) -> String {
    format!("{}: expected {expected}, got {}", frame_name(frame), frame.size)
}

/// Number and, where it has one, label of a frame.
pub fn frame_name(frame: &FrameBuffer) -> String {
    match frame.label.as_str() {
        "" => format!("frame {}", frame.seq),
        label => format!("frame {} ({label})", frame.seq),
    }
}

/// The time of a frame, or its number where it has none.
pub fn when(seq: u64, time_ns: Option<u64>) -> String {
    time_ns.map_or_else(|| format!("frame {seq}"), |ns| format!("{:.2} s", ns as f64 / 1e9))
}

fn at(time_ns: Option<u64>) -> String {
    time_ns.map_or_else(String::new, |ns| format!(" ({:.2} s)", ns as f64 / 1e9))
}

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A state's name as the report has it, in words.
pub(crate) fn state_name(state: SlipState) -> &'static str {
    match state {
        SlipState::NoContact => "no contact",
        SlipState::Unsure => "unsure",
        SlipState::Stick => "stick",
        SlipState::Incipient => "incipient slip",
        SlipState::Gross => "gross slip",
        SlipState::Unjudged => "unjudged",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_and_frames_are_named_by_number_time_and_label() {
        let mut summary = ReportSummary::new();
        let kind = Some(SlipKind::Both);
        let begins =
            SlipEvent::Begins { slip: 1, seq: 7, time_ns: Some(280_000_000), kind, direction_rad: Some(1.571) };
        let line = "frame 7 (0.28 s): slip 1 begins, translation and rotation, towards 90 deg";
        assert_eq!(summary.event(&begins), line);
        let ends = |ongoing| SlipEvent::Ends { slip: 1, seq: 9, time_ns: None, frames_count: 1, ongoing };
        assert_eq!(summary.event(&ends(false)), "frame 9: slip 1 ends; 1 frame showed it");
        let line = "frame 9: slip 1 is still going on at the end; 1 frame showed it";
        assert_eq!(summary.event(&ends(true)), line);
        assert_eq!(summary.lines(), ["0 frames, 1 slip"]);
        let frame = FrameBuffer { seq: 3, label: "a.png".into(), ..FrameBuffer::default() };
        assert_eq!(torn(&frame, "cut"), "frame 3 (a.png) is torn: cut");
        assert_eq!(frame_name(&FrameBuffer::default()), "frame 0");
    }
}
