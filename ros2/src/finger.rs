//! A finger: its pictures in order to its reports, by the library's rest finder and monitor. Knows nothing of ROS's network.
//!
//! ```text
//!   idle --look--> looking for rest --found--> judging --tare--> judging, and looking for a new rest
//!    ^                   |                     |    ^                | untouched: that is the rest frame from now on
//!    '-------forget------'---------------------'    '----------------' touched, dark, or a picture that fails: the old one stays
//! ```

use slipbound::finger_pipeline::RestFinder;
use slipbound::monitor::{RestError, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::port::{FrameBuffer, GripSample};
use slipbound::sensor::Sensor;

/// A finger between its pictures.
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

/// What became of a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Seen {
    /// It was passed over: the rest frame is neither known nor looked for.
    Idle,
    /// It was looked at for the rest frame; nothing is said of it.
    AtRest,
    /// The rest frame is known from now on; nothing is said of the picture.
    RestFound(RestKind),
    /// It was judged.
    Judged(SlipReport),
    /// It was judged, and with it a tare has ended: done, or why not.
    Tared(SlipReport, Result<(), String>),
    /// It cannot be used; why.
    Refused(String),
}

impl Finger {
    /// A finger before its first picture, idle.
    pub fn new(sensor: Sensor, settings: Settings) -> Self {
        let (finder, monitor, rest_kind, last_state) = (None, None, None, None);
        let (is_taring, looks_for_rest) = (false, false);
        Finger { sensor, settings, finder, monitor, rest_kind, last_state, is_taring, looks_for_rest }
    }

    /// Looks for the rest frame from the next picture on, where it is not known.
    pub fn look(&mut self) {
        self.looks_for_rest = true;
    }

    /// Forgets the rest frame and whatever rests on it, a tare too; idle from now on.
    pub fn forget(&mut self) {
        (self.finder, self.monitor, self.rest_kind, self.last_state) = (None, None, None, None);
        (self.is_taring, self.looks_for_rest) = (false, false);
    }

    /// Whether pictures are of no use to it.
    pub fn is_idle(&self) -> bool {
        self.monitor.is_none() && !self.looks_for_rest
    }

    /// Its monitor; None before the rest frame is known.
    pub fn monitor(&self) -> Option<&SlipMonitor> {
        self.monitor.as_ref()
    }

    /// What it was doing in its rest frame; None before that is known.
    pub fn rest_kind(&self) -> Option<RestKind> {
        self.rest_kind
    }

    /// Begins to take the rest frame anew from the next pictures. Refused where something touches the finger, or may.
    pub fn tare(&mut self) -> Result<(), String> {
        match self.last_state {
            _ if self.is_taring => Err("it is being tared already".into()),
            None => Err("expected a finger at rest, got one whose rest frame is not known yet".into()),
            Some(SlipState::NoContact) => {
                (self.is_taring, self.finder) = (true, None);
                Ok(())
            }
            Some(SlipState::Unjudged) => {
                Err("expected a finger at rest, got a picture that could not be judged".into())
            }
            Some(_) => Err("expected a finger that nothing touches, got one in contact".into()),
        }
    }

    /// Stops taking the rest frame anew, and keeps the old one. False where it does not take one.
    pub fn stop_tare(&mut self) -> bool {
        let was_taring = std::mem::take(&mut self.is_taring);
        if was_taring {
            self.finder = None;
        }
        was_taring
    }

    /// Takes the next whole picture.
    pub fn see(&mut self, frame: &FrameBuffer, grip: Option<GripSample>) -> Seen {
        if self.is_idle() {
            return Seen::Idle;
        }
        let pixels = match frame.frame() {
            Ok(pixels) => pixels,
            Err(e) => return Seen::Refused(e.to_string()),
        };
        let Some(monitor) = &mut self.monitor else { return self.look_for_rest(frame) };
        let report = monitor.step(&pixels, grip);
        self.last_state = Some(report.state);
        if !self.is_taring {
            return Seen::Judged(report);
        }
        let ended = match report.state {
            SlipState::NoContact => match self.look_for_rest(frame) {
                Seen::AtRest => return Seen::Judged(report),
                Seen::RestFound(_) => Ok(()),
                Seen::Refused(why) => Err(why),
                Seen::Idle | Seen::Judged(_) | Seen::Tared(..) => Err("rest was not looked for".into()),
            },
            _ => Err("expected a finger that nothing touches, got one in contact".into()),
        };
        (self.is_taring, self.finder) = (false, None);
        Seen::Tared(report, ended)
    }

    /// A picture that did not arrive whole.
    pub fn torn(&mut self, seq: u64, time_ns: Option<u64>) -> Option<SlipReport> {
        Some(self.monitor.as_ref()?.torn(seq, time_ns))
    }

    fn look_for_rest(&mut self, frame: &FrameBuffer) -> Seen {
        let finder = match &mut self.finder {
            Some(finder) => finder,
            None => match RestFinder::new(&self.sensor, &self.settings, frame.size) {
                Ok(finder) => self.finder.insert(finder),
                Err(e) => return Seen::Refused(e.to_string()),
            },
        };
        if let Err(e) = finder.see(frame) {
            self.finder = None; // of another size: from the beginning
            return Seen::Refused(e.to_string());
        }
        if !finder.is_full() {
            return Seen::AtRest;
        }
        let found = match self.finder.take().map(RestFinder::find) {
            Some(Ok(found)) => found,
            // Dark so far: it goes on looking.
            Some(Err(RestError::NoStationaryFrame { .. })) if !self.is_taring => return Seen::AtRest,
            Some(Err(e)) => return Seen::Refused(e.to_string()),
            None => return Seen::AtRest,
        };
        let kind = found.rest.kind();
        if self.is_taring && kind == RestKind::InContact {
            return Seen::Refused("expected a finger that nothing touches, got one in contact".into());
        }
        match SlipMonitor::new(&self.sensor, &self.settings, found.rest) {
            Ok(monitor) => {
                (self.monitor, self.rest_kind) = (Some(monitor), Some(kind));
                Seen::RestFound(kind)
            }
            Err(e) => Seen::Refused(e.to_string()),
        }
    }
}
