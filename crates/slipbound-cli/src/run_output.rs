//! What a run writes: cycles in, its folder, its recording and lines on the terminal out.
//!
//! ```text
//!             in lock-step: RunOutput              in real time: QueuedOutput, each behind a queue of its own
//!   cycle --> RunRecorder, McapObserver, McapAnnotations, Console
//! ```

mod console;
mod scorer;

pub use scorer::{FrameTally, RunScorer};

use self::console::Console;
use crate::outcome::{Failure, Outcome, unless_reader_left};
use crate::terminal::Terminal;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::task::Ending;
use slipbound_rig::container::{McapAnnotations, McapObserver};
use slipbound_rig::printable::without_passwords;
use slipbound_rig::realtime::{Finished, QueuedObserver};
use slipbound_rig::run::{CameraLimits, Row, RunInfo, RunRecorder};
use std::path::Path;
use std::time::Duration;

/// Cycles that may wait for the disk or the terminal: four seconds at 30 Hz.
const QUEUE_DEPTH_COUNT: usize = 128;

/// Longest wait at the end for the disk, and for the terminal, to take the queue.
pub const LONGEST_DISK: Duration = Duration::from_secs(10);
const LONGEST_TERMINAL: Duration = Duration::from_secs(1);

/// What sees every cycle: the folder, the recording, the terminal.
pub struct Parts<R, M, C> {
    recorder: Option<R>,
    container: Option<M>,
    /// Never queued: it needs the monitors, and hands in without waiting.
    annotations: Option<McapAnnotations>,
    console: C,
}

impl<R: CycleObserver, M: CycleObserver, C: CycleObserver> CycleObserver for Parts<R, M, C> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.recorder.after_cycle(view);
        self.container.after_cycle(view);
        self.annotations.after_cycle(view);
        self.console.after_cycle(view);
    }
}

/// The parts on threads of their own.
pub type QueuedOutput = Parts<QueuedObserver<RunRecorder>, QueuedObserver<McapObserver>, QueuedObserver<Console>>;

/// The folder of a run, its recording, and the terminal.
pub struct RunOutput {
    parts: Parts<RunRecorder, McapObserver, Console>,
    /// Cycles lost on the way to the folder.
    lost_count: u64,
    /// Other losses.
    lost: Vec<String>,
}

impl RunOutput {
    /// Begins a run in a folder that is new or empty.
    pub fn create(folder: &Path, info: &RunInfo, keeps_frames: bool) -> Result<Self, Failure> {
        let recorder = Some(RunRecorder::create(folder, info, keeps_frames)?);
        let console = Console::new(Terminal::with_status());
        let parts = Parts { recorder, container: None, annotations: None, console };
        Ok(RunOutput { parts, lost_count: 0, lost: Vec::new() })
    }

    /// The same, into a recording too.
    #[must_use]
    pub fn recording(self, container: Option<McapObserver>) -> Self {
        let annotations = container.as_ref().map(McapObserver::annotations);
        RunOutput { parts: Parts { annotations, container, ..self.parts }, ..self }
    }

    /// The same with other limits for reports about cameras.
    #[must_use]
    pub fn limited(self, limits: CameraLimits) -> Self {
        let Parts { recorder, container, annotations, console } = self.parts;
        let recorder = recorder.map(|recorder| recorder.limited(limits));
        let container = container.map(|container| container.limited(limits));
        RunOutput { parts: Parts { recorder, container, annotations, console: console.limited(limits) }, ..self }
    }

    /// No cycle is to follow, only notes and the results.
    pub fn end_cycles(&mut self) {
        if let Some(recorder) = &mut self.parts.recorder {
            recorder.end_cycles();
        }
        if let Some(container) = &mut self.parts.container {
            container.end_cycles();
        }
    }

    /// A note that no cycle shows.
    pub fn note(&mut self, now_ns: u64, text: &str) {
        let text = &*without_passwords(text);
        if let Some(recorder) = &mut self.parts.recorder {
            recorder.note(now_ns, text);
        }
        if let Some(container) = &mut self.parts.container {
            container.note(now_ns, text);
        }
        self.parts.console.note(now_ns, text);
    }

    /// Something that was not written: reported at the end.
    pub fn lost(&mut self, what: String) {
        self.lost.push(what);
    }

    /// A line for the user only: a run goes on without its reader.
    pub fn say(&mut self, line: &str) -> Result<(), Failure> {
        unless_reader_left(self.parts.console.terminal.say(line))
    }

    /// Folder and terminal behind queues of their own, so that neither delays a cycle.
    pub fn queued(self, keeps_frames: bool) -> QueuedOutput {
        let Parts { recorder, container, annotations, console } = self.parts;
        Parts {
            recorder: recorder.map(|recorder| {
                let lost = RunRecorder::lost_cycles;
                QueuedObserver::reporting_losses(recorder, QUEUE_DEPTH_COUNT, keeps_frames, lost)
            }),
            container: container.map(|container| {
                let takes_frames = container.takes_frames();
                QueuedObserver::reporting_losses(container, QUEUE_DEPTH_COUNT, takes_frames, McapObserver::lost_cycles)
            }),
            annotations,
            console: QueuedObserver::new(console, QUEUE_DEPTH_COUNT, false),
        }
    }

    /// Prints the results, writes the page, reports what was lost.
    pub fn finish(
        self,
        rows: &[Row],
        ending: Option<Ending>,
        last_line: impl FnOnce(&str) -> String,
    ) -> Result<Outcome, Failure> {
        let RunOutput { parts: Parts { recorder, console: Console { mut terminal, .. }, .. }, lost_count, mut lost } =
            self;
        terminal.clear_bar();
        // The page is written even if nobody reads the terminal any more.
        let mut said: Result<(), Failure> = rows.iter().try_for_each(|row| {
            let line = format!("  {:<28}{:<22}{}", row.name, row.value, row.target);
            terminal.say(&if row.ok == Some(false) { format!("{}: missed", line.trim_end()) } else { line })
        });
        if lost_count > 0 {
            lost.push(format!("{lost_count} cycles were not written: the disk did not keep up"));
        }
        match recorder {
            None => lost.push("report.html was not written: the disk did not answer".into()),
            Some(recorder) => {
                if let count @ 1.. = recorder.unkept_count() {
                    lost.push(format!(
                        "the frames of the last {count} cycles were not kept: a replay goes up to there"
                    ));
                }
                if let (count @ 1.., Some(first)) = recorder.failures() {
                    lost.push(format!("{count} times something could not be written, the first: {first}"));
                }
                match recorder.finish(rows, ending) {
                    Ok(page) => said = said.and_then(|()| terminal.say(&last_line(&page.display().to_string()))),
                    Err(error) => lost.push(error.to_string()),
                }
            }
        }
        lost.iter().for_each(|line| terminal.note(line));
        unless_reader_left(said)?;
        Ok(if lost.is_empty() { Outcome::Done } else { Outcome::DataLost })
    }
}

impl CycleObserver for RunOutput {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.parts.after_cycle(view);
    }
}

impl QueuedOutput {
    /// Waits for what is queued, for a limited time.
    pub fn finish(self) -> RunOutput {
        let recorder = self.recorder.map(|queue| queue.finish(LONGEST_DISK));
        let (recorder, lost_count) =
            recorder.map_or((None, 0), |Finished { observer, lost_count }| (observer, lost_count));
        // A cycle that both have lost is one cycle.
        let container = self.container.map(|queue| queue.finish(LONGEST_DISK));
        let (container, in_container) =
            container.map_or((None, 0), |Finished { observer, lost_count }| (observer, lost_count));
        // A blocked terminal loses nothing that is not in the folder.
        let console = self.console.finish(LONGEST_TERMINAL).observer.unwrap_or_else(|| Console::new(Terminal::plain()));
        // Nor does it prevent the run from writing its page and ending.
        let console = console.with_timeout(LONGEST_TERMINAL);
        let lost_count = lost_count.max(in_container);
        let parts = Parts { recorder, container, annotations: None, console };
        let mut output = RunOutput { parts, lost_count, lost: Vec::new() };
        output.end_cycles();
        output
    }
}
