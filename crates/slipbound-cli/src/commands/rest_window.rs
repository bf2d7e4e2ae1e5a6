//! The first frames of a recording or a camera, and the rest frame among them: for `watch` and `tare`.

use crate::outcome::Failure;
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::finger_pipeline::{FoundRest, RestFinder};
use slipbound::image::SizePx;
use slipbound::monitor::{RestKind, RestLook, Settings};
use slipbound::port::FrameBuffer;
use slipbound::sensor::{Sensor, Skin};
use slipbound_rig::report_summary::{frame_name, of_other_size, torn};
use slipbound_rig::source::{AheadFrame, ReadAhead, most_common_size};
use std::fmt::Display;

/// The frames in which the rest frame is searched.
pub struct Window<'a> {
    source: &'a str,
    /// The complete frames.
    pub frames: Vec<&'a FrameBuffer>,
    /// The size that most of them have.
    pub size: SizePx,
    /// How many others were torn.
    pub torn_count: usize,
    /// Which was the first of them, and why.
    first_torn: Option<String>,
}

impl<'a> Window<'a> {
    /// Reads until this many complete frames are there, or the source ends. `silence`: told after every look at the source
    /// whether it was silent.
    pub fn read(
        source: &'a str,
        recording: &'a mut ReadAhead,
        count: u32,
        silence: impl FnMut(bool),
    ) -> Result<Self, Failure> {
        let count = count as usize;
        let whole = recording.read_ahead_seen(count, silence).filter(|frame| frame.torn.is_none());
        let Some(size) = most_common_size(whole.map(|frame| &frame.buffer)) else {
            let first_torn = recording.read_ahead(count).find_map(|a| Some(torn(&a.buffer, a.torn.as_deref()?)));
            return Err(match (recording.take_failure(), first_torn) {
                (Some(error), _) => error.into(),
                (None, Some(first)) => anyhow!("{source}: expected at least one whole frame, got none; {first}").into(),
                (None, None) => anyhow!("{source}: expected frames, got none").into(),
            });
        };
        let window: Vec<&AheadFrame> = recording.read_ahead(count).collect();
        let frames: Vec<&FrameBuffer> = window.iter().filter(|a| a.torn.is_none()).map(|a| &a.buffer).collect();
        let first_torn = window.iter().find_map(|a| Some(torn(&a.buffer, a.torn.as_deref()?)));
        Ok(Window { source, torn_count: window.len() - frames.len(), first_torn, frames, size })
    }

    /// Tells of the frames that are torn or of another size; returns whether there are any.
    pub fn note_lost(&self, terminal: &Terminal) -> bool {
        note_torn(terminal, self.source, self.torn_count, self.first_torn.as_deref());
        let mut others = self.frames.iter().filter(|frame| frame.size != self.size);
        let first_other = others.next().map(|first| of_other_size(first, self.size));
        let others_count = usize::from(first_other.is_some()) + others.count();
        note_other_size(terminal, self.source, others_count, first_other.as_deref());
        self.torn_count + others_count > 0
    }

    /// The error for facts or settings that do not fit these frames.
    pub fn refused(&self, sensor: &Sensor, e: impl Display) -> Failure {
        let (source, size) = (self.source, self.size);
        Failure::Arguments(anyhow!("{source}: frames of {size}: sensor {}: {e}", sensor.name))
    }

    /// The rest frame. `untouched`: the option that requires an untouched finger; a finger in contact is then an error.
    pub fn rest(
        &self,
        sensor: &Sensor,
        settings: &Settings,
        untouched: Option<&dyn Display>,
    ) -> Result<FoundRest, Failure> {
        let source = self.source;
        let mut finder = RestFinder::new(sensor, settings, self.size).map_err(|e| self.refused(sensor, e))?;
        for frame in &self.frames {
            finder.see(frame).map_err(|e| Failure::work(source, e))?;
        }
        let (looks, bare) = (finder.looks().map(|(_, look)| *look).collect::<Vec<_>>(), finder.bare_sharpness());
        let found = finder.find().map_err(|e| Failure::work(source, e))?;
        match untouched.filter(|_| found.rest.kind() == RestKind::InContact) {
            None => Ok(found),
            Some(asker) if found.is_moving => {
                let (count, first) = (self.frames.len(), "a finger that nothing touches, and stationary frames of it");
                Err(anyhow!("{asker}: {source}: expected {first}, got none among the first {count} frames").into())
            }
            Some(asker) => {
                let advice = advice_where_touched(sensor.skin);
                let expected = format!("expected a finger that nothing touches, got one in contact: {advice}");
                let seen = self.frames.iter().zip(looks).find(|(frame, _)| frame.seq == found.seqs.start);
                let seen = seen
                    .map_or_else(String::new, |(frame, look)| format!("; {}", imprint(frame, look, bare, sensor.skin)));
                Err(anyhow!("{asker}: {source}: {expected}{seen}").into())
            }
        }
    }
}

/// Tells of the torn frames of a source.
pub fn note_torn(terminal: &Terminal, source: &str, count: usize, first: Option<&str>) {
    let Some(first) = first else { return };
    let all = if count > 1 { format!("; {count} are torn in all") } else { String::new() };
    terminal.note(&format!("{source}: {first}{all}"));
}

/// Tells of the frames of another size.
pub fn note_other_size(terminal: &Terminal, source: &str, count: usize, first: Option<&str>) {
    let Some(first) = first else { return };
    let count = frames_in_words(count);
    terminal.note(&format!("{source}: {count} of another size passed over; the first is {first}"));
}

/// A number of frames, in words.
pub fn frames_in_words(count: usize) -> String {
    format!("{count} frame{}", if count == 1 { "" } else { "s" })
}

/// What to do about a finger that looks touched.
pub fn advice_where_touched(skin: Skin) -> &'static str {
    match skin {
        Skin::Fabric => "free it and start again",
        // A weave looks like an imprint on a gel.
        Skin::Smooth => {
            "free it and start again, or, where a weave covers the gel: `slipbound calibrate --skin fabric`"
        }
    }
}

/// The evidence in a frame that something touches the finger.
fn imprint(frame: &FrameBuffer, look: RestLook, bare: f64, skin: Skin) -> String {
    let (name, seen) = (frame_name(frame), look.sharpness);
    match skin {
        _ if !look.touched => format!("{name} shows a light touch, which is gone in a later frame"),
        Skin::Smooth => {
            format!(
                "{name} shows an imprint: it is {seen:.1} levels sharp between the markers, at most {bare:.1} untouched"
            )
        }
        Skin::Fabric => {
            let (seen, bare) = (100.0 * seen, 100.0 * bare);
            format!("{name} shows an imprint: {seen:.1} % of it look like pressed weave, at most {bare:.1} % untouched")
        }
    }
}
