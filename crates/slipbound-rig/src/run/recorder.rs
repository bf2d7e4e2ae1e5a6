//! Records a run as an observer of its loop.

use super::error::Error;
use super::folder::RunFolder;
use super::frames::FrameRecorder;
use super::info::{Row, RunInfo};
use super::notes::{CameraLimits, RunNotes};
use crate::overlay::Overlay;
use slipbound::control::{Cycle, CycleObserver, CycleView};
use slipbound::image::Rgb;
use slipbound::task::Ending;
use std::path::{Path, PathBuf};

/// Records every cycle, its events, an image of each finger at each slip, and every frame if requested. A failure to
/// write does not stop the loop: it is counted and reported at the end.
pub struct RunRecorder {
    folder: RunFolder,
    overlays: Vec<Overlay>,
    frames: Option<FrameRecorder>,
    /// Whether something was not written: later frames are not kept then, because a replay goes cycle by cycle up to
    /// the gap.
    has_gap: bool,
    /// Cycles after the gap: their frames were not kept.
    unkept_count: u64,
    /// Cycles lost before they got here, since the last one that arrived.
    lost_count: u64,
    notes: RunNotes,
    failed_count: u64,
    first_failure: Option<Error>,
}

impl RunRecorder {
    /// Begins a run in a folder that is new or empty. `keeps_frames`: every frame too, so that the run can be replayed.
    pub fn create(folder: &Path, info: &RunInfo, keeps_frames: bool) -> Result<Self, Error> {
        let run = RunFolder::create(folder, info)?;
        let frames = if keeps_frames { Some(FrameRecorder::create(folder)?) } else { None };
        Ok(RunRecorder {
            folder: run,
            overlays: info.fingers.iter().map(|finger| Overlay::new(&finger.sensor).for_stills()).collect(),
            frames,
            has_gap: false,
            unkept_count: 0,
            lost_count: 0,
            notes: RunNotes::default(),
            failed_count: 0,
            first_failure: None,
        })
    }

    /// The same with these limits for reports about cameras.
    #[must_use]
    pub fn limited(self, limits: CameraLimits) -> Self {
        RunRecorder { notes: RunNotes::new(limits), ..self }
    }

    /// Records a note that does not follow from a cycle, for example why the loop ended.
    pub fn note(&mut self, time_ns: u64, text: &str) {
        let written = self.folder.note(time_ns, text);
        self.count(written);
    }

    /// `count` cycles before the next one were lost before they got here: frames are kept up to this gap, and the
    /// events report the loss.
    pub fn lost_cycles(&mut self, count: u64) {
        self.has_gap = true;
        self.lost_count += count;
    }

    /// No cycle is to follow; see [`RunFolder::end_cycles`].
    pub fn end_cycles(&mut self) {
        let written = self.folder.end_cycles();
        self.count(written);
    }

    /// Lines and images that could not be written, and the first reason.
    pub fn failures(&self) -> (u64, Option<&Error>) {
        (self.failed_count, self.first_failure.as_ref())
    }

    /// Cycles whose frames were not kept, because something before was not written.
    pub fn unkept_count(&self) -> u64 {
        self.unkept_count
    }

    /// Writes the results and the page; returns its path. `ending`: None for a loop that was interrupted.
    pub fn finish(self, results: &[Row], ending: Option<Ending>) -> Result<PathBuf, Error> {
        self.folder.finish(results, ending)
    }

    fn count(&mut self, written: Result<(), Error>) {
        if let Err(error) = written {
            self.has_gap = true;
            self.failed_count += 1;
            self.first_failure.get_or_insert(error);
        }
    }

    fn write(&mut self, view: &CycleView<'_>, cycle: &Cycle) -> Result<(), Error> {
        let slips_count = self.folder.slips_count();
        let reports: Vec<_> = view.fingers.iter().map(|finger| finger.report).collect();
        self.folder.cycle_with_reports(cycle, &reports)?;
        if self.folder.slips_count() == slips_count {
            return Ok(());
        }
        let force = match cycle.grip_command.force_n() {
            Some(force_n) => format!("commanded from now on: {force_n:.1} N"),
            None => "the grip is released now".into(),
        };
        for (finger, overlay) in view.fingers.iter().zip(&mut self.overlays) {
            let (Some(monitor), Some(report)) = (finger.monitor, finger.report) else { continue };
            overlay.draw(finger.frame.frame().ok().as_ref(), report, monitor);
            let rgb = overlay.rgb();
            // The image size is that of the overlay.
            let Ok(picture) = Rgb::new(&rgb, overlay.size()) else { continue };
            self.folder.picture(cycle.time_ns, finger.name, &force, picture)?;
        }
        Ok(())
    }
}

/// The event text where frames are no longer kept.
const UNKEPT: &str = "frames are not kept from here on, because something was not written: a replay goes to here";

/// The event text for lost cycles.
pub(crate) fn lost_text(count: u64) -> String {
    let cycles = if count == 1 { "cycle" } else { "cycles" };
    format!("{count} {cycles} before this were not written: the disk did not keep up")
}

impl CycleObserver for RunRecorder {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if let count @ 1.. = std::mem::take(&mut self.lost_count) {
            self.note(view.now_ns, &lost_text(count));
        }
        for line in self.notes.see(view) {
            self.note(view.now_ns, &line);
        }
        if let Some(cycle) = view.cycle() {
            let written = self.write(view, &cycle);
            self.count(written);
        }
        match &mut self.frames {
            Some(_) if self.has_gap => {
                if self.unkept_count == 0 {
                    self.note(view.now_ns, UNKEPT);
                }
                self.unkept_count += 1;
            }
            Some(frames) => {
                let kept = frames.keep(view);
                self.count(kept);
            }
            None => {}
        }
    }
}
