//! Judges a recording from its first frame on, no frame by a later one.
//!
//! ```text
//!   frame k of the window --RestFinder--> rest chosen among frames 0..=k
//!                                           | another than before: a new monitor judges frames 0..k again, unreported
//!                                           v
//!                                         SlipMonitor --> report of frame k
//! ```
//!
//! From the end of the window on, reports are those of a monitor that had the final rest frame from frame 0.

use super::RestFinder;
use crate::image::ImageError;
use crate::monitor::{Probe, Reason, RestChoice, RestError, SlipMonitor, SlipReport};
use crate::port::FrameBuffer;
use crate::setting::SettingError;

/// A monitor for a recording whose rest frame is among its first frames. Every report depends on its frame and on
/// earlier ones alone, as if the recording ended there.
///
/// A recording contains no grip force; the reports have none.
#[derive(Debug, Clone)]
pub struct RecordingMonitor {
    monitor: SlipMonitor,
    beginning: Option<Beginning>,
}

/// The state while the rest frame may still change.
#[derive(Debug, Clone)]
struct Beginning {
    finder: RestFinder,
    /// The frames that the monitor's rest frame was made from.
    chosen: Option<RestChoice>,
}

impl RecordingMonitor {
    /// A monitor whose rest frame is known from elsewhere: it judges every frame.
    pub fn with_known_rest(monitor: SlipMonitor) -> Self {
        RecordingMonitor { monitor, beginning: None }
    }

    /// A monitor that chooses its rest frame among the first frames, anew with each of them. `monitor`: one of the same
    /// finger and settings with any rest frame, which is not used; its trees ([`SlipMonitor::estimate_by`]) are not
    /// kept. Until a rest frame can be chosen it has no markers. Fails as [`RestFinder::new`].
    pub fn with_rest_of_first_frames(mut monitor: SlipMonitor) -> Result<Self, SettingError> {
        let camera_px = monitor.sensor().image_px;
        let finder = RestFinder::new(monitor.sensor(), monitor.settings(), camera_px)?;
        monitor.forget_rest();
        Ok(RecordingMonitor { monitor, beginning: Some(Beginning { finder, chosen: None }) })
    }

    /// The monitor after the last frame.
    pub fn monitor(&self) -> &SlipMonitor {
        &self.monitor
    }

    /// Judges a frame. `probe` observes its steps. When the rest frame changes, `again` receives every earlier whole
    /// frame in order, as judged against the new one: what is kept per marker begins anew with the first of them.
    pub fn step(
        &mut self,
        frame: &FrameBuffer,
        probe: &mut dyn Probe,
        again: &mut dyn FnMut(&SlipMonitor, &SlipReport),
    ) -> Result<SlipReport, ImageError> {
        let pixels = frame.frame()?;
        if let Some(beginning) = &mut self.beginning {
            let is_over = beginning.finder.is_full();
            beginning.finder.see(frame)?;
            let next = if is_over { Ok(None) } else { beginning.next_monitor(&self.monitor) };
            if let Ok(Some(monitor)) = next {
                self.monitor = monitor;
                let frames = beginning.finder.frames();
                for earlier in &frames[..frames.len() - 1] {
                    let report = self.monitor.step(&earlier.frame()?, None);
                    again(&self.monitor, &report);
                }
            }
            if beginning.chosen.is_none() {
                let reason = self.monitor.check_frame(&pixels).err().unwrap_or(Reason::MarkersLost);
                return Ok(self.before_rest(frame.seq, frame.time_ns, reason));
            }
            if beginning.finder.is_full() {
                self.beginning = None;
            }
        }
        Ok(self.monitor.step_probed(&pixels, None, probe))
    }

    /// Reports a frame that did not arrive whole.
    pub fn torn(&self, seq: u64, time_ns: Option<u64>) -> SlipReport {
        match &self.beginning {
            Some(Beginning { chosen: None, .. }) => self.before_rest(seq, time_ns, Reason::Torn),
            _ => self.monitor.torn(seq, time_ns),
        }
    }

    /// Reports a frame before any rest frame is known.
    fn before_rest(&self, seq: u64, time_ns: Option<u64>, reason: Reason) -> SlipReport {
        SlipReport { reference_seq: seq, ..self.monitor.unjudged(seq, time_ns, None, reason) }
    }
}

impl Beginning {
    /// A monitor with the rest frame that the frames so far give; None to go on with the present one. A rest frame that
    /// only grew is made anew when its noise is halved, and when it is complete: a monitor takes longer to make than a
    /// frame to judge.
    fn next_monitor(&mut self, present: &SlipMonitor) -> Result<Option<SlipMonitor>, RestError> {
        let choice = self.finder.choose()?;
        let complete_count = present.settings().rest.average_count as usize;
        let goes_on = self.chosen.as_ref().is_some_and(|chosen| {
            let (had_count, has_count) = (chosen.frames.len(), choice.frames.len());
            let is_same = chosen.kind == choice.kind && chosen.frames.start == choice.frames.start;
            let grew_enough = has_count >= 4 * had_count || has_count == complete_count || self.finder.is_full();
            is_same && (has_count == had_count || (has_count > had_count && !grew_enough))
        });
        if goes_on {
            return Ok(None);
        }
        let rest = self.finder.find()?.rest;
        let monitor = SlipMonitor::new(present.sensor(), present.settings(), rest);
        self.chosen = Some(choice);
        Ok(Some(monitor.expect("a rest frame of the same finger and settings as the monitor's")))
    }
}
