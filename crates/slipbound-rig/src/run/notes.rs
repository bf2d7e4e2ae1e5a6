//! Messages about a run for its user: faults, driver events, refusals of the gripper.

use crate::source::is_news;
use slipbound::control::{CycleOutcome, CycleView, Fault};
use slipbound::finger_pipeline::FingerView;
use slipbound::monitor::{Reason, RestKind, SlipState};
use slipbound::port::{Clock, Next};

/// Limits beyond which cameras are reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CameraLimits {
    /// A finger without a frame for longer, ns.
    pub max_silence_ns: u64,
    /// Frames of two fingers in one cycle whose camera stamps differ by more, ns.
    pub max_skew_ns: u64,
}

impl Default for CameraLimits {
    fn default() -> Self {
        CameraLimits { max_silence_ns: 300_000_000, max_skew_ns: 20_000_000 }
    }
}

/// Folds the views of cycles into lines, each reported once.
#[derive(Debug, Default)]
pub struct RunNotes {
    limits: CameraLimits,
    /// Whether the frames of two fingers were too far apart at the last check.
    is_skewed: bool,
    /// Faults reported since the last cycle without a fault.
    faults: Vec<Fault>,
    is_lowering_told: bool,
    /// The force of the last command, N per finger, and whether its rise while the hand is unsure was reported.
    grip_n: Option<f64>,
    is_rise_told: bool,
    /// Fingers reported because they start in contact, and those reported because their markers are not those of their
    /// sensor file.
    in_contact: Vec<String>,
    misfits: Vec<String>,
    /// Fingers whose first torn frame was reported, and those that were reported to have no rest frame yet.
    torn: Vec<String>,
    without_rest: Vec<String>,
    /// When each finger last had a frame, ns, and whether its silence was reported.
    heard: Vec<(u64, bool)>,
}

impl RunNotes {
    /// With these limits instead of the default ones.
    pub fn new(limits: CameraLimits) -> Self {
        RunNotes { limits, ..RunNotes::default() }
    }

    /// The lines of a cycle, in reading order; mostly none.
    pub fn see(&mut self, view: &CycleView<'_>) -> Vec<String> {
        let mut lines: Vec<String> = view.driver_events.iter().map(|event| format!("gripper: {event}")).collect();
        match view.fault {
            Some(fault) if !self.faults.iter().any(|told| told.is_like(fault)) => {
                self.faults.push(fault.clone());
                lines.push(format!("{fault}; the wrist pauses, the grip stays"));
            }
            Some(_) => {}
            None if !self.faults.is_empty() => {
                self.faults.clear();
                if !view.outcome.is_some_and(CycleOutcome::has_ended) {
                    lines.push("gripper and wrist are back; going on".into());
                }
            }
            None => {}
        }
        if let (Some(why), false) = (view.refused_lowering, self.is_lowering_told) {
            self.is_lowering_told = true;
            lines.push(why.to_owned());
        }
        lines.extend(self.rise_while_unsure(view));
        lines.extend(self.skew(view));
        let max_silence_ns = self.limits.max_silence_ns;
        self.heard.resize(view.fingers.len(), (view.now_ns, false));
        for (finger, (heard_ns, is_told)) in view.fingers.iter().zip(&mut self.heard) {
            let silent_ns = view.now_ns.saturating_sub(*heard_ns);
            match finger.next {
                Next::Frame | Next::Torn { .. } => {
                    if std::mem::take(is_told) {
                        lines.push(format!("{}: frames again after {:.1} s", finger.name, silent_ns as f64 * 1e-9));
                    }
                    *heard_ns = view.now_ns;
                }
                Next::Silent if silent_ns > max_silence_ns && !*is_told => {
                    *is_told = true;
                    lines.push(format!("{}: no frame for {:.1} s", finger.name, max_silence_ns as f64 * 1e-9));
                }
                Next::Silent | Next::End => {}
            }
        }
        for finger in view.fingers {
            let is_told = |told: &[String]| told.iter().any(|name| name == finger.name);
            match finger.next {
                Next::Torn { reason } if is_news(finger.next) => lines.push(format!("{}: {reason}", finger.name)),
                Next::Torn { reason } if !is_told(&self.torn) => {
                    self.torn.push(finger.name.to_owned());
                    lines.push(format!("{}: the first torn frame: {reason}", finger.name));
                }
                _ => {}
            }
            if let (Some(error), false) = (finger.rest_error, is_told(&self.without_rest)) {
                self.without_rest.push(finger.name.to_owned());
                lines.push(format!("{}: {error}; nothing is commanded before there is one", finger.name));
            }
            let reason = finger.report.and_then(|report| report.reason);
            if let Some(reason @ Reason::MarkerSpacing { .. }) = reason.filter(|_| !is_told(&self.misfits)) {
                self.misfits.push(finger.name.to_owned());
                lines.push(format!("{}: no frame can be judged: {reason}", finger.name));
            }
            let starts_in_contact = finger.rest_kind == Some(RestKind::InContact);
            // If the markers do not match, that is not known either.
            if starts_in_contact && !is_told(&self.in_contact) && !is_told(&self.misfits) {
                self.in_contact.push(finger.name.to_owned());
                lines.push(format!(
                    "{}: starts in contact: displacement counts from the first stationary frames, not from the unloaded gel",
                    finger.name
                ));
            }
        }
        lines
    }

    /// That the grip rises while the hand is unsure; once until the next slip or the next contact.
    fn rise_while_unsure(&mut self, view: &CycleView<'_>) -> Option<String> {
        let cycle = view.outcome?.commanded()?;
        let now_n = cycle.grip_command.force_n();
        let from_n = std::mem::replace(&mut self.grip_n, now_n);
        match cycle.hand.state {
            SlipState::Unsure => {}
            SlipState::NoContact | SlipState::Incipient | SlipState::Gross => {
                self.is_rise_told = false;
                return None;
            }
            SlipState::Stick | SlipState::Unjudged => return None,
        }
        let from_n = from_n.zip(now_n).filter(|(from_n, now_n)| from_n < now_n && !self.is_rise_told)?.0;
        self.is_rise_told = true;
        Some(format!("the hand is unsure: the grip rises from {from_n:.1} N"))
    }

    /// How far the stamps of two fingers' frames are apart, when that exceeds the limit or no longer does.
    fn skew(&mut self, view: &CycleView<'_>) -> Option<String> {
        let stamp_ns = |finger: &FingerView<'_>| {
            let is_own = finger.frame.clock == Clock::Device && *finger.next == Next::Frame;
            finger.frame.time_ns.filter(|_| is_own)
        };
        let [left, right] = view.fingers else { return None };
        let skew_ns = stamp_ns(left)?.abs_diff(stamp_ns(right)?);
        let (is_skewed, limit_ns) = (skew_ns > self.limits.max_skew_ns, self.limits.max_skew_ns);
        if is_skewed == std::mem::replace(&mut self.is_skewed, is_skewed) {
            return None;
        }
        let ms = |ns: u64| ns as f64 * 1e-6;
        let both = format!("{} and {}", left.name, right.name);
        Some(match is_skewed {
            false => format!("{both}: frames are {:.1} ms apart again", ms(skew_ns)),
            // Such stamps are from two unsynchronised clocks.
            true if skew_ns > OTHER_CLOCK_NS => {
                format!("{both}: the cameras' clocks are {:.1} s apart", ms(skew_ns) * 1e-3)
            }
            true => {
                let (got, limit) = (ms(skew_ns), ms(limit_ns));
                format!("{both}: frames are {got:.1} ms apart by their stamps, expected at most {limit:.1} ms")
            }
        })
    }
}

/// Stamps further apart are from unsynchronised clocks, ns.
const OTHER_CLOCK_NS: u64 = 1_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::monitor::RestError;
    use slipbound::port::FrameBuffer;

    fn cycle<'a>(fingers: &'a [FingerView<'a>]) -> CycleView<'a> {
        CycleView {
            now_ns: 1,
            outcome: None,
            fingers,
            fault: None,
            refused_lowering: None,
            driver_events: &[],
            truth: None,
        }
    }

    fn finger<'a>(name: &'a str, frame: &'a FrameBuffer) -> FingerView<'a> {
        let (report, monitor, rest_kind, rest_error) = (None, None, None, None);
        FingerView { name, next: &Next::Frame, frame, report, monitor, rest_kind, rest_error }
    }

    #[test]
    fn a_finger_whose_frames_are_dark_is_told_of_once() {
        let (mut notes, frame) = (RunNotes::default(), FrameBuffer::default());
        let dark = RestError::NoStationaryFrame { looked_at_count: 20, unusable_count: 19 };
        let mut told = Vec::new();
        for rest_error in [None, Some(&dark), Some(&dark), None, Some(&dark)] {
            let fingers = [finger("left", &frame), FingerView { rest_error, ..finger("right", &frame) }];
            told.extend(notes.see(&cycle(&fingers)));
        }
        let expected = "right: no rest frame among the first 20 frames (19 of them dark or of another size); nothing is \
                        commanded before there is one";
        assert_eq!(told, [expected]);
    }

    #[test]
    fn the_first_torn_frame_of_every_finger_is_told_of_with_its_reason() {
        let mut notes = RunNotes::default();
        let frame = FrameBuffer::default();
        let torn = |reason: &str| Next::Torn { reason: reason.into() };
        let mut told = Vec::new();
        for nexts in [[Next::Frame, Next::Silent], [torn("cut"), Next::Frame], [torn("empty"), torn("16UC1")]] {
            let view = |name, next| FingerView { next, ..finger(name, &frame) };
            let fingers = [view("left", &nexts[0]), view("right", &nexts[1])];
            told.extend(notes.see(&cycle(&fingers)));
        }
        assert_eq!(told, ["left: the first torn frame: cut", "right: the first torn frame: 16UC1"]);
    }

    #[test]
    fn all_news_of_a_camera_is_told_whatever_was_torn_before() {
        let (mut notes, frame) = (RunNotes::default(), FrameBuffer::default());
        let news = ["and cannot be set as at first: expected 640x480", "and is set otherwise: gain expected 4, got 5"];
        let mut told = Vec::new();
        for reason in ["cut".to_owned()].into_iter().chain(news.map(|news| format!("the camera is back, {news}"))) {
            let next = Next::Torn { reason };
            told.extend(notes.see(&cycle(&[FingerView { next: &next, ..finger("left", &frame) }])));
        }
        let expected = news.map(|news| format!("left: the camera is back, {news}"));
        assert_eq!(told[0], "left: the first torn frame: cut");
        assert_eq!(told[1..], expected);
    }

    #[test]
    fn frames_that_drift_apart_are_told_of_once_and_when_they_are_back() {
        let mut notes = RunNotes::new(CameraLimits { max_skew_ns: 5_000_000, ..CameraLimits::default() });
        let mut told = Vec::new();
        for skew_ms in [0, 4, 6, 9, 5, 3000, 1] {
            let frame = |ms: u64| FrameBuffer {
                time_ns: Some(10_000_000_000 - ms * 1_000_000),
                clock: Clock::Device,
                ..FrameBuffer::default()
            };
            let frames = [frame(0), frame(skew_ms)];
            let fingers = [finger("left", &frames[0]), finger("right", &frames[1])];
            told.extend(notes.see(&cycle(&fingers)));
        }
        assert_eq!(
            told,
            [
                "left and right: frames are 6.0 ms apart by their stamps, expected at most 5.0 ms",
                "left and right: frames are 5.0 ms apart again",
                "left and right: the cameras' clocks are 3.0 s apart",
                "left and right: frames are 1.0 ms apart again",
            ]
        );
    }
}
