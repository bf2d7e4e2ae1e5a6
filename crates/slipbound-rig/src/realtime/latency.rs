//! The time from a frame to the bytes of a grip command in the link, measured on the loop as it runs on hardware; alone,
//! and while a disk, a terminal or a camera blocks.
//!
//! ```text
//!   expose, a thread --> FrameLoop, a thread a camera: decodes --Newest--> ControlLoop (a lift whose force changes) --> gripper
//!   at the rate, whatever the loop does                                        '--> Stopwatch, and observers that block
//! ```

use super::frames_due::FramesDue;
use super::queue::QueuedObserver;
use super::runner;
use super::workers::MonitorWorkers;
use crate::link::now_ns;
use crate::source::{Newest, decode_image};
use crate::wrist::Dry;
use slipbound::control::{ControlError, ControlLoop, CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::grip::Guard;
use slipbound::hand::Mounting;
use slipbound::monitor::Settings;
use slipbound::port::{Clock, FrameBuffer, FrameSource, GripCommand, Gripper, Next, SourceError, SourceErrorKind};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;
use slipbound::task::{Observation, Phase, Task, TaskKind, TaskSettings, TaskStep};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::thread;
use std::time::Duration;

/// By how much the force changes, so that every frame has a command, N per finger.
const NUDGE_N: f64 = 0.5;

/// Longest wait for the gripper to hold, frames.
const LONGEST_GRASP_COUNT: u32 = 3000;

/// How long a blocked part stays blocked.
const BLOCKED: Duration = Duration::from_secs(5);

/// Cycles that may wait for a disk or a terminal.
const QUEUE_DEPTH_COUNT: usize = 128;

/// For how long a frame waits for that of the other finger, ns.
const LONGEST_WAIT_NS: u64 = 5_000_000;

/// Two forces closer than this are the same, N.
const SAME_N: f64 = 1e-3;

/// The duration given to an endless hold, ns.
const WITHOUT_END_NS: u64 = 1_000_000_000_000_000;

/// The part that blocks while it is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blocks {
    /// Nothing does.
    Nothing,
    /// An observer behind a queue, as the run folder is, for seconds in every cycle.
    Disk,
    /// Two of them: the folder and the terminal.
    DiskAndTerminal,
    /// The camera of the last finger of several, for seconds at a time, from a frame after the grasp on.
    Camera,
}

/// A finger and its frames.
#[derive(Debug, Clone)]
pub struct FingerFrames {
    /// Its name.
    pub name: String,
    /// How it sits in the hand.
    pub mounting: Mounting,
    /// Its facts.
    pub sensor: Sensor,
    /// Its frames in order, from the open hand on; pixels, and the JPEG they are from.
    pub frames: Arc<Vec<FrameBuffer>>,
}

/// The frames of a hand that opens unloaded and then holds something.
#[derive(Debug, Clone)]
pub struct HandFrames {
    /// Its fingers, of which there is at least one.
    pub fingers: Vec<FingerFrames>,
    /// The frame from which on something is held: they are repeated from here.
    pub held_from: usize,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatencyTrial {
    /// Cycles to measure, after the grasp.
    pub cycles_count: usize,
    /// Frames per second.
    pub rate_hz: u32,
    /// Whether a frame is decoded from its JPEG, as a camera's is, or copied from memory.
    pub is_jpeg: bool,
    /// What blocks meanwhile.
    pub blocks: Blocks,
}

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Latency {
    /// Time from when a frame was due to the command in the link, ns; in ascending order, at least one.
    pub took_ns: Vec<u64>,
    /// Commands that the gripper had confirmed when the next frame was due.
    pub confirmed_count: usize,
    /// Frames, of any finger whose camera does not block, due between the first and the last of these cycles that no
    /// cycle was for: newer ones had replaced them, or a camera was not ready.
    pub missed_count: u64,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum LatencyError {
    /// The loop cannot be set up.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The loop failed.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// It was interrupted before every cycle was measured.
    #[error("interrupted")]
    Interrupted,
    /// The gripper held nothing, or the loop ended before every cycle was measured.
    #[error("the gripper never held anything")]
    NothingHeld,
}

impl Latency {
    /// The time within which this share of the cycles stayed, ms; 1 is the worst.
    pub fn quantile_ms(&self, fraction: f64) -> f64 {
        let at = (self.took_ns.len().saturating_sub(1) as f64 * fraction).round() as usize;
        self.took_ns.get(at).copied().unwrap_or(0) as f64 * 1e-6
    }

    /// Share of the commands that the gripper had confirmed when the next frame was due.
    pub fn confirmed_fraction(&self) -> f64 {
        self.confirmed_count as f64 / self.took_ns.len() as f64
    }
}

impl LatencyTrial {
    /// Runs the loop over the frames in real time until it is `interrupted`; the gripper is left holding.
    pub fn run(
        &self,
        hand: &HandFrames,
        gripper: &mut dyn Gripper,
        interrupted: &AtomicBool,
    ) -> Result<Latency, LatencyError> {
        let (mut control, cameras) = self.control(hand)?;
        let Cameras { ticks, mut due } = cameras;
        let stop = AtomicBool::new(false);
        let period_ns = 1_000_000_000 / u64::from(self.rate_hz.max(1));
        let (running, ends) = channel();
        let exposure = thread::spawn(move || expose(&ticks, period_ns, &ends));
        let mut is_due = || {
            stop.fetch_or(interrupted.load(Ordering::Relaxed), Ordering::Relaxed);
            due.is_due(now_ns())
        };
        let queues_count = match self.blocks {
            Blocks::Nothing | Blocks::Camera => 0,
            Blocks::Disk => 1,
            Blocks::DiskAndTerminal => 2,
        };
        let queue = |i: usize| QueuedObserver::new(BlockedObserver, QUEUE_DEPTH_COUNT, i == 0);
        let stopwatch = Stopwatch {
            period_ns,
            due_ns: {
                let fingers_count = hand.fingers.len();
                let blocked_count = usize::from(self.blocks == Blocks::Camera && fingers_count > 1);
                vec![None; fingers_count - blocked_count]
            },
            missed_count: 0,
            stop: &stop,
            wanted_count: self.cycles_count,
            took_ns: Vec::with_capacity(self.cycles_count),
            asked_n: None,
            confirmed_count: 0,
            waited_count: 0,
        };
        let mut observer = (AllOf((0..queues_count).map(queue).collect()), stopwatch);
        let ran = runner::run(&mut control, gripper, &mut Dry::default(), &stop, &mut is_due, &mut observer);
        drop(running);
        let _ = exposure.join();
        let (_, Stopwatch { mut took_ns, confirmed_count, missed_count, .. }) = observer;
        match ran {
            Ok(()) | Err(ControlError::Interrupted) if took_ns.len() >= self.cycles_count.max(1) => {
                took_ns.sort_unstable();
                Ok(Latency { took_ns, confirmed_count, missed_count })
            }
            Err(ControlError::Interrupted) if interrupted.load(Ordering::Relaxed) => Err(LatencyError::Interrupted),
            Ok(()) | Err(ControlError::Interrupted) => Err(LatencyError::NothingHeld),
            Err(error) => Err(error.into()),
        }
    }

    /// A control loop over the frames, which holds endlessly.
    fn control(&self, hand: &HandFrames) -> Result<(ControlLoop, Cameras), SettingError> {
        let mut settings = TaskSettings::default();
        (settings.lift.lift_mm, settings.lift.hold_ns) = (0.0, WITHOUT_END_NS);
        let stiffness = hand.fingers.first().and_then(|finger| finger.sensor.shear_stiffness_mpa_per_mm());
        let inner = settings.task(TaskKind::Lift, stiffness)?;
        let last = hand.fingers.len().saturating_sub(1);
        let (mut ticks, mut arrivals) = (Vec::new(), Vec::new());
        let fingers = hand.fingers.iter().enumerate().map(|(i, finger)| {
            let (tick, exposes) = sync_channel(1);
            let blocks_from = (self.blocks == Blocks::Camera && i == last).then_some(hand.held_from + 1);
            let frames = FrameLoop {
                exposes,
                frames: finger.frames.clone(),
                next: 0,
                repeat_from: hand.held_from,
                is_jpeg: self.is_jpeg,
                blocks_from,
                given_count: 0,
            };
            let source = Newest::new(Box::new(frames));
            ticks.push(tick);
            arrivals.push(source.arrivals());
            let (sensor, settings) = (finger.sensor.clone(), Settings::default());
            FingerPipeline::new(&finger.name, finger.mounting, sensor, settings, Box::new(source))
        });
        let fingers = fingers.collect();
        let task = Box::new(NudgedTask { inner, is_up: false });
        let control = ControlLoop::new(fingers, task)?.with_runner(Box::new(MonitorWorkers::new()));
        Ok((control, Cameras { ticks, due: FramesDue::new(arrivals, LONGEST_WAIT_NS) }))
    }
}

/// Makes every camera expose once per period, at the times at which a frame is due, until `ends` is closed.
fn expose(ticks: &[SyncSender<u64>], period_ns: u64, ends: &Receiver<()>) {
    let mut due_ns = now_ns();
    while ends.recv_timeout(Duration::from_nanos(due_ns.saturating_sub(now_ns()))) == Err(RecvTimeoutError::Timeout) {
        due_ns += now_ns().saturating_sub(due_ns) / period_ns * period_ns; // this thread was late for those before
        for tick in ticks {
            let _ = tick.try_send(due_ns); // a camera that has not taken the last one is blocked: it drops this frame
        }
        due_ns += period_ns;
    }
}

/// The triggers of the cameras, which say when a frame was due, ns, and the arrivals of their frames.
struct Cameras {
    ticks: Vec<SyncSender<u64>>,
    due: FramesDue,
}

/// The frames of a finger over and over, as JPEG or as pixels, one at every tick.
struct FrameLoop {
    exposes: Receiver<u64>,
    frames: Arc<Vec<FrameBuffer>>,
    next: usize,
    /// The frames repeat from here; those before are of the open hand.
    repeat_from: usize,
    is_jpeg: bool,
    /// From this frame on, every frame takes seconds.
    blocks_from: Option<usize>,
    given_count: usize,
}

impl FrameSource for FrameLoop {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Ok(due_ns) = self.exposes.recv() else { return Ok(Next::End) }; // the trial is over
        if self.blocks_from.is_some_and(|from| self.given_count >= from) {
            thread::sleep(BLOCKED);
        }
        self.given_count += 1;
        let Some(frame) = self.frames.get(self.next) else { return Ok(Next::End) };
        if self.is_jpeg {
            into.encoded.clone_from(&frame.encoded);
            decode_image(into).map_err(|why| SourceError::new(SourceErrorKind::Format, why))?;
        } else {
            (into.format, into.size) = (frame.format, frame.size);
            into.pixels.clone_from(&frame.pixels);
        }
        into.seq = self.given_count as u64; // buffers are recycled in any order
        (into.time_ns, into.clock) = (Some(due_ns), Clock::Host);
        self.next = if self.next + 1 < self.frames.len() { self.next + 1 } else { self.repeat_from };
        Ok(Next::Frame)
    }
}

/// A task whose force goes up and down from cycle to cycle while it holds.
struct NudgedTask {
    inner: Box<dyn Task + Send>,
    is_up: bool,
}

impl Task for NudgedTask {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        let mut step = self.inner.step(observation);
        if let (GripCommand::Hold { force_n }, true) = (&mut step.grip, step.phase != Phase::Grasping) {
            self.is_up = !self.is_up;
            *force_n -= if self.is_up { 0.0 } else { NUDGE_N };
        }
        step
    }

    fn grip(&self) -> &Guard {
        self.inner.grip()
    }

    fn grip_mut(&mut self) -> &mut Guard {
        self.inner.grip_mut()
    }
}

/// An observer that blocks in every cycle.
struct BlockedObserver;

impl CycleObserver for BlockedObserver {
    fn after_cycle(&mut self, _: &CycleView<'_>) {
        thread::sleep(BLOCKED);
    }
}

/// Passes every cycle to every queue.
struct AllOf(Vec<QueuedObserver<BlockedObserver>>);

impl CycleObserver for AllOf {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.0.iter_mut().for_each(|queue| queue.after_cycle(view));
    }
}

/// Measures each cycle with a frame and a command after the grasp, from when the frame was due; then ends the loop.
struct Stopwatch<'a> {
    period_ns: u64,
    /// When the last frame of each finger was due, ns, where its camera does not block, and how many of those measured
    /// were missed before them.
    due_ns: Vec<Option<u64>>,
    missed_count: u64,
    stop: &'a AtomicBool,
    wanted_count: usize,
    took_ns: Vec<u64>,
    asked_n: Option<f64>,
    confirmed_count: usize,
    waited_count: u32,
}

impl CycleObserver for Stopwatch<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let now_ns = now_ns();
        let mut new_ns = None;
        for (finger, last_ns) in view.fingers.iter().zip(&mut self.due_ns) {
            let due_ns = finger.frame.time_ns.filter(|_| *finger.next == Next::Frame);
            if let Some((last_ns, due_ns)) = last_ns.zip(due_ns).filter(|_| !self.took_ns.is_empty()) {
                self.missed_count += (due_ns.saturating_sub(last_ns) / self.period_ns).saturating_sub(1);
            }
            *last_ns = (*last_ns).max(due_ns);
            new_ns = new_ns.max(due_ns);
        }
        let Some(cycle) = view.cycle().filter(|cycle| cycle.phase != Phase::Grasping) else {
            self.waited_count += 1;
            self.stop.fetch_or(self.waited_count > LONGEST_GRASP_COUNT, Ordering::Relaxed);
            return;
        };
        let Some(due_ns) = new_ns else { return };
        let is_confirmed = cycle.gripper.target_n.zip(self.asked_n).is_some_and(|(a, b)| (a - b).abs() < SAME_N);
        self.confirmed_count += usize::from(is_confirmed);
        self.asked_n = cycle.grip_command.force_n();
        self.took_ns.push(now_ns - due_ns);
        self.stop.fetch_or(self.took_ns.len() >= self.wanted_count, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_measured_times() {
        let latency =
            Latency { took_ns: (1..=101).map(|ms| ms * 1_000_000).collect(), confirmed_count: 50, missed_count: 0 };
        assert_eq!([0.5, 0.99, 1.0].map(|fraction| latency.quantile_ms(fraction)), [51.0, 100.0, 101.0]);
        assert!((latency.confirmed_fraction() - 50.0 / 101.0).abs() < 1e-12);
    }

    #[test]
    fn frames_are_due_at_the_rate_though_a_camera_or_the_loop_is_late() {
        let (tick, exposes) = sync_channel(1);
        let (running, ends) = channel();
        let period_ns = 2_000_000;
        let exposure = thread::spawn(move || expose(&[tick], period_ns, &ends));
        let due_ns = || exposes.recv().expect("it goes on");
        let first_ns = due_ns();
        thread::sleep(Duration::from_millis(50));
        let waited_ns = due_ns();
        let times_ns = [waited_ns, due_ns()].map(|due_ns| due_ns - first_ns);
        assert!(times_ns.iter().all(|ns| ns.is_multiple_of(period_ns)), "due at their times: {times_ns:?}");
        assert!(times_ns[1] >= 48_000_000, "those after the frame that waited were dropped: {times_ns:?}");
        drop(running);
        exposure.join().expect("it ends");
    }

    #[test]
    fn frames_are_repeated_from_where_something_is_held() {
        let frame = |grey: u8| FrameBuffer { pixels: vec![grey], ..FrameBuffer::default() };
        let frames = Arc::new((0..4).map(frame).collect());
        let (tick, exposes) = sync_channel(7);
        let (repeat_from, is_jpeg, blocks_from) = (2, false, None);
        let mut source = FrameLoop { exposes, frames, next: 0, repeat_from, is_jpeg, blocks_from, given_count: 0 };
        (0..7).for_each(|i| tick.send(100 * i).expect("there is room"));
        let mut buffer = FrameBuffer::default();
        let given: Vec<u8> = (0..7)
            .map(|_| {
                assert_eq!(source.next(&mut buffer).expect("a frame"), Next::Frame);
                buffer.pixels[0]
            })
            .collect();
        assert_eq!(given, [0, 1, 2, 3, 2, 3, 2]);
        assert_eq!((buffer.seq, buffer.time_ns), (7, Some(600)));
    }
}
