//! A finger: from its images in order to its reports, by the library's rest finder and monitor. Independent of ROS's
//! network.
//!
//! ```text
//!   idle --look--> looking for rest --found--> judging --tare--> judging, and looking for a new rest frame
//!    ^                   |                     |    ^                | untouched: that becomes the rest frame
//!    '-------forget------'---------------------'    '----------------' touched, dark or failing image: old one kept
//! ```

use slipbound::finger_pipeline::RestFinder;
use slipbound::monitor::{RestError, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::port::{FrameBuffer, GripSample};
use slipbound::sensor::Sensor;

/// A finger between its images.
pub struct Finger {
    sensor: Sensor,
    settings: Settings,
    finder: Option<RestFinder>,
    monitor: Option<SlipMonitor>,
    rest_kind: Option<RestKind>,
    last_state: Option<SlipState>,
    is_taring: bool,
    looks_for_rest: bool,
}

/// Why an image in this state is none of a finger at rest.
fn no_rest_in(state: SlipState) -> String {
    match state {
        SlipState::Unjudged => "expected a finger at rest, got an image that could not be judged".into(),
        _ => "expected a finger that nothing touches, got one in contact".into(),
    }
}

/// Result of an image.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameOutcome {
    /// It was skipped: the rest frame is neither known nor looked for.
    Idle,
    /// It was used for the rest frame; there is no report.
    AtRest,
    /// It completed the rest frame; there is no report.
    RestFound(RestKind),
    /// It was judged.
    Judged(SlipReport),
    /// It was judged, and a tare has ended with it: done, or why not.
    Tared(SlipReport, Result<(), String>),
    /// It cannot be used; the reason.
    Refused(String),
}

impl Finger {
    /// A finger before its first image, idle.
    pub fn new(sensor: Sensor, settings: Settings) -> Self {
        let (finder, monitor, rest_kind, last_state) = (None, None, None, None);
        let (is_taring, looks_for_rest) = (false, false);
        Finger { sensor, settings, finder, monitor, rest_kind, last_state, is_taring, looks_for_rest }
    }

    /// Looks for the rest frame from the next image on, if it is not known.
    pub fn look(&mut self) {
        self.looks_for_rest = true;
    }

    /// Forgets the rest frame and everything based on it, including a tare; idle from now on.
    pub fn forget(&mut self) {
        (self.finder, self.monitor, self.rest_kind, self.last_state) = (None, None, None, None);
        (self.is_taring, self.looks_for_rest) = (false, false);
    }

    /// Whether it ignores images.
    pub fn is_idle(&self) -> bool {
        self.monitor.is_none() && !self.looks_for_rest
    }

    /// Its monitor; None before the rest frame is known.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_ref()
    }

    /// Whether it was unloaded or in contact in its rest frame; None before that is known.
    pub fn rest_kind(&self) -> Option<RestKind> {
        self.rest_kind
    }

    /// Begins to renew the rest frame from the next images. Rejected where something touches the finger, or may.
    pub fn tare(&mut self) -> Result<(), String> {
        match self.last_state {
            _ if self.is_taring => Err("it is being tared already".into()),
            None => Err("expected a finger at rest, got one whose rest frame is not known yet".into()),
            Some(SlipState::NoContact) => {
                (self.is_taring, self.finder) = (true, None);
                Ok(())
            }
            Some(state) => Err(no_rest_in(state)),
        }
    }

    /// Stops renewing the rest frame and keeps the old one. False if no tare was in progress.
    pub fn stop_tare(&mut self) -> bool {
        let was_taring = std::mem::take(&mut self.is_taring);
        if was_taring {
            self.finder = None;
        }
        was_taring
    }

    /// Takes the next whole image.
    pub fn see(&mut self, frame: &FrameBuffer, grip: Option<GripSample>) -> FrameOutcome {
        if self.is_idle() {
            return FrameOutcome::Idle;
        }
        let pixels = match frame.frame() {
            Ok(pixels) => pixels,
            Err(e) => return FrameOutcome::Refused(e.to_string()),
        };
        let Some(monitor) = &mut self.monitor else { return self.look_for_rest(frame) };
        let report = monitor.step(&pixels, grip);
        self.last_state = Some(report.state);
        if !self.is_taring {
            return FrameOutcome::Judged(report);
        }
        let ended = match report.state {
            SlipState::NoContact => match self.look_for_rest(frame) {
                FrameOutcome::AtRest => return FrameOutcome::Judged(report),
                FrameOutcome::RestFound(_) => Ok(()),
                FrameOutcome::Refused(why) => Err(why),
                FrameOutcome::Idle | FrameOutcome::Judged(_) | FrameOutcome::Tared(..) => {
                    Err("rest was not looked for".into())
                }
            },
            state => Err(no_rest_in(state)),
        };
        (self.is_taring, self.finder) = (false, None);
        FrameOutcome::Tared(report, ended)
    }

    /// An image that did not arrive completely.
    pub fn torn(&mut self, seq: u64, time_ns: Option<u64>) -> Option<SlipReport> {
        Some(self.monitor.as_ref()?.torn(seq, time_ns))
    }

    fn look_for_rest(&mut self, frame: &FrameBuffer) -> FrameOutcome {
        let finder = match &mut self.finder {
            Some(finder) => finder,
            None => match RestFinder::new(&self.sensor, &self.settings, frame.size) {
                Ok(finder) => self.finder.insert(finder),
                Err(e) => return FrameOutcome::Refused(e.to_string()),
            },
        };
        if let Err(e) = finder.see(frame) {
            self.finder = None; // of another size: start again
            return FrameOutcome::Refused(e.to_string());
        }
        if !finder.is_full() {
            return FrameOutcome::AtRest;
        }
        let found = match self.finder.take().map(|finder| finder.find()) {
            Some(Ok(found)) => found,
            // Only dark images so far: it continues to look.
            Some(Err(RestError::NoStationaryFrame { .. })) if !self.is_taring => return FrameOutcome::AtRest,
            Some(Err(e)) => return FrameOutcome::Refused(e.to_string()),
            None => return FrameOutcome::AtRest,
        };
        let kind = found.rest.kind();
        if self.is_taring && kind == RestKind::InContact {
            return FrameOutcome::Refused("expected a finger that nothing touches, got one in contact".into());
        }
        match SlipMonitor::new(&self.sensor, &self.settings, found.rest) {
            Ok(monitor) => {
                (self.monitor, self.rest_kind) = (Some(monitor), Some(kind));
                FrameOutcome::RestFound(kind)
            }
            Err(e) => FrameOutcome::Refused(e.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::port::{FrameSource as _, Next};
    use slipbound_lab::scenes::Trial;
    use slipbound_lab::world::World;

    #[test]
    fn a_tare_that_meets_an_image_that_cannot_be_judged_says_so() {
        let scene = Trial::parse("press?grid=fast&rest_frames=24").expect("a scene");
        let mut world = World::new(&scene).expect("a world");
        let mut finger = Finger::new(world.sensor(), Settings::default());
        finger.look();
        let mut frame = FrameBuffer::default();
        while finger.last_state != Some(SlipState::NoContact) {
            assert_eq!(world.next(&mut frame).expect("simulates"), Next::Frame);
            finger.see(&frame, None);
        }
        finger.tare().expect("untouched");
        frame.seq += 1;
        frame.pixels.fill(0);
        let FrameOutcome::Tared(report, Err(why)) = finger.see(&frame, None) else { panic!("it was tared") };
        assert_eq!(report.state, SlipState::Unjudged, "dark");
        assert_eq!(why, "expected a finger at rest, got an image that could not be judged");
        assert_eq!(finger.tare(), Err(why), "as who asks for a tare then is told");
    }
}
