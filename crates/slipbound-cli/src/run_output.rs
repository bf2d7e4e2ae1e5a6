//! What a run writes: its folder, lines on the terminal, and its score.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use slipbound::control::{Cycle, CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerView;
use slipbound::image::SizePx;
use slipbound::port::Next;
use slipbound::task::{Ending, Phase};
use slipbound_lab::hand::HandTruth;
use slipbound_lab::score::RunScore;
use slipbound_rig::container::{McapAnnotations, McapObserver};
use slipbound_rig::realtime::{Finished, QueuedObserver};
use slipbound_rig::run::{CameraLimits, Row, RunInfo, RunNotes, RunRecorder};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Cycles that may wait for the disk or the terminal: four seconds at 30 Hz.
const QUEUE_DEPTH_COUNT: usize = 128;

/// Longest wait at the end for the disk, and for the terminal, to take the queue.
const LONGEST_DISK: Duration = Duration::from_secs(10);
const LONGEST_TERMINAL: Duration = Duration::from_secs(1);

/// Least change of the commanded force that is printed, N.
const SHOWN_STEP_N: f64 = 4.5;

/// The folder of a run, its recording, and the terminal.
pub struct RunOutput {
    recorder: Option<RunRecorder>,
    container: Option<McapObserver>,
    annotations: Option<McapAnnotations>,
    console: Console,
    /// Cycles lost on the way to the folder.
    lost_count: u64,
    /// Other losses.
    lost: Vec<String>,
}

impl RunOutput {
    /// Begins a run in a folder that is new or empty.
    pub fn create(folder: &Path, info: &RunInfo, keeps_frames: bool) -> Result<Self, Failure> {
        let recorder = RunRecorder::create(folder, info, keeps_frames)?;
        Ok(RunOutput {
            recorder: Some(recorder),
            container: None,
            annotations: None,
            console: Console::new(Terminal::with_status()),
            lost_count: 0,
            lost: Vec::new(),
        })
    }

    /// The same, into a recording too.
    #[must_use]
    pub fn recording(self, container: Option<McapObserver>) -> Self {
        RunOutput { annotations: container.as_ref().map(McapObserver::annotations), container, ..self }
    }

    /// The same with other limits for reports about cameras.
    #[must_use]
    pub fn limited(mut self, limits: CameraLimits) -> Self {
        self.recorder = self.recorder.map(|recorder| recorder.limited(limits));
        self.container = self.container.map(|container| container.limited(limits));
        self.console.notes = RunNotes::new(limits);
        self
    }

    /// A note that no cycle shows.
    pub fn note(&mut self, now_ns: u64, text: &str) {
        if let Some(recorder) = &mut self.recorder {
            recorder.note(now_ns, text);
        }
        self.console.say(&format!("{}  {text}", at(now_ns)));
    }

    /// Something that was not written: reported at the end.
    pub fn lost(&mut self, what: String) {
        self.lost.push(what);
    }

    /// A line for the user only.
    pub fn say(&mut self, line: &str) -> Result<(), Failure> {
        self.console.terminal.say(line)
    }

    /// Folder and terminal behind queues of their own, so that neither delays a cycle.
    pub fn queued(self, keeps_frames: bool) -> QueuedOutput {
        QueuedOutput {
            recorder: self.recorder.map(|recorder| {
                let lost = RunRecorder::lost_cycles;
                QueuedObserver::reporting_losses(recorder, QUEUE_DEPTH_COUNT, keeps_frames, lost)
            }),
            container: self.container.map(|container| {
                let takes_frames = container.takes_frames();
                QueuedObserver::reporting_losses(container, QUEUE_DEPTH_COUNT, takes_frames, McapObserver::lost_cycles)
            }),
            annotations: self.annotations,
            console: QueuedObserver::new(self.console, QUEUE_DEPTH_COUNT, false),
        }
    }

    /// Prints the results, writes the page, reports what was lost.
    pub fn finish(
        self,
        rows: &[Row],
        ending: Option<Ending>,
        last_line: impl FnOnce(&str) -> String,
    ) -> Result<Outcome, Failure> {
        let RunOutput { recorder, console: Console { mut terminal, .. }, lost_count, mut lost, .. } = self;
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
        said?;
        Ok(if lost.is_empty() { Outcome::Done } else { Outcome::DataLost })
    }
}

impl CycleObserver for RunOutput {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.after_cycle(view);
        }
        self.container.iter_mut().for_each(|container| container.after_cycle(view));
        self.annotations.iter_mut().for_each(|annotations| annotations.after_cycle(view));
        self.console.after_cycle(view);
    }
}

/// A [`RunOutput`] whose parts receive cycles on threads of their own.
pub struct QueuedOutput {
    recorder: Option<QueuedObserver<RunRecorder>>,
    container: Option<QueuedObserver<McapObserver>>,
    /// Not queued: it needs the monitors, and hands in without waiting.
    annotations: Option<McapAnnotations>,
    console: QueuedObserver<Console>,
}

impl QueuedOutput {
    /// Waits for what is queued, for a limited time.
    pub fn finish(self) -> RunOutput {
        let recorder = self.recorder.map(|queue| queue.finish(LONGEST_DISK));
        let (recorder, lost_count) =
            recorder.map_or((None, 0), |Finished { observer, lost_count }| (observer, lost_count));
        let in_container = self.container.map_or(0, |queue| queue.finish(LONGEST_DISK).lost_count);
        // A blocked terminal loses nothing that is not in the folder.
        let console = self.console.finish(LONGEST_TERMINAL).observer.unwrap_or_else(|| Console::new(Terminal::plain()));
        // Nor does it prevent the run from writing its page and ending.
        let console = Console { terminal: console.terminal.with_timeout(LONGEST_TERMINAL), ..console };
        let lost_count = lost_count + in_container;
        RunOutput { recorder, container: None, annotations: None, console, lost_count, lost: Vec::new() }
    }
}

impl CycleObserver for QueuedOutput {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.after_cycle(view);
        }
        self.container.iter_mut().for_each(|container| container.after_cycle(view));
        self.annotations.iter_mut().for_each(|annotations| annotations.after_cycle(view));
        self.console.after_cycle(view);
    }
}

/// Prints a line where something happened, the status otherwise.
struct Console {
    terminal: Terminal,
    notes: RunNotes,
    last: Option<Cycle>,
}

impl Console {
    fn new(terminal: Terminal) -> Self {
        Console { terminal, notes: RunNotes::default(), last: None }
    }

    fn say(&mut self, line: &str) {
        let _ = self.terminal.say(line); // a terminal that is gone does not end the run: everything is in the folder
    }

    fn show_cycle(&mut self, cycle: &Cycle) {
        let at = at(cycle.time_ns);
        let before = self.last.as_ref();
        let force_n = cycle.gripper.pressed_n().unwrap_or(0.0);
        let mut lines = Vec::new();
        if before.map_or(0, |last| last.slips_count) < cycle.slips_count {
            lines.push(format!("{at}  slip {} at {force_n:.1} N", cycle.slips_count));
        }
        let commanded_n = before.and_then(|last| last.grip_command.force_n()).zip(cycle.grip_command.force_n());
        if let Some((_, to_n)) = commanded_n.filter(|(from_n, to_n)| (from_n - to_n).abs() >= SHOWN_STEP_N) {
            lines.push(format!("{at}  grip to {to_n:.1} N"));
        }
        if let Phase::Ended(ending) = cycle.phase
            && before.is_none_or(|last| last.phase != cycle.phase)
        {
            lines.push(format!("{at}  {}", ending.evidence()));
        }
        lines.iter().for_each(|line| self.say(line));
        let bar = "#".repeat((force_n / 2.0).round().clamp(0.0, 40.0) as usize);
        let angle_deg = cycle.wrist.angle_rad.to_degrees();
        self.terminal.status(&format!("{at}  {angle_deg:6.1} deg  {force_n:5.1} N {bar}"));
        self.last = Some(*cycle);
    }
}

impl CycleObserver for Console {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for line in self.notes.see(view) {
            self.say(&format!("{}  {line}", at(view.now_ns)));
        }
        if let Some(cycle) = view.cycle() {
            self.show_cycle(&cycle);
        }
    }
}

/// Counts the frames of a finger.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameTally {
    /// Frames that arrived whole.
    pub whole_count: u64,
    /// Frames that did not.
    pub torn_count: u64,
    /// Whole frames of another size than the first, for which the monitor is made.
    pub other_size_count: u64,
    first_size: Option<SizePx>,
}

impl FrameTally {
    fn see(&mut self, finger: &FingerView<'_>) {
        match finger.next {
            Next::Frame => {
                self.whole_count += 1;
                let first_size = *self.first_size.get_or_insert(finger.frame.size);
                self.other_size_count += u64::from(finger.frame.size != first_size);
            }
            Next::Torn { .. } => self.torn_count += 1,
            Next::Silent | Next::End => {}
        }
    }
}

/// Adds up the score of a run that is not in lock-step; `truth` is the present ground truth, where it is known.
pub struct RunScorer {
    /// The score so far.
    pub score: RunScore,
    /// What the task was doing last; None before the first command.
    pub phase: Option<Phase>,
    /// What the source of every finger gave.
    pub tallies: Vec<FrameTally>,
    /// The first lower force that the gripper refused.
    pub refused_lowering: Option<String>,
    /// The present ground truth, set by the thread of the simulated world.
    pub truth: Arc<Mutex<Option<HandTruth>>>,
}

impl RunScorer {
    /// Before the first cycle; see [`RunScore::new`].
    pub fn new(limit_n: f64) -> Self {
        RunScorer {
            score: RunScore::new(limit_n),
            phase: None,
            tallies: Vec::new(),
            refused_lowering: None,
            truth: Arc::default(),
        }
    }
}

impl CycleObserver for RunScorer {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if self.refused_lowering.is_none() {
            self.refused_lowering = view.refused_lowering.map(str::to_owned);
        }
        self.tallies.resize(view.fingers.len(), FrameTally::default());
        for (tally, finger) in self.tallies.iter_mut().zip(view.fingers) {
            tally.see(finger);
        }
        let truth = self.truth.lock().unwrap_or_else(PoisonError::into_inner);
        match (view.cycle(), truth.as_ref()) {
            (Some(cycle), truth) => {
                self.phase = Some(cycle.phase);
                let commanded_n = cycle.grip_command.force_n();
                self.score.add_cycle(view.now_ns, cycle.phase, commanded_n, cycle.alarms_count, truth);
            }
            (None, Some(truth)) => self.score.add_truth(truth),
            (None, None) => {}
        }
    }
}

fn at(now_ns: u64) -> String {
    format!("{:6.2} s", now_ns as f64 * 1e-9)
}
