//! `slipbound latency`: from a frame to the bytes of a grip command in the socket, as a table; alone, and while a disk, a
//! terminal or a camera blocks.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::control::{ControlError, ControlLoop, CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::grip::Guard;
use slipbound::hand::Mounting;
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Next, SourceError};
use slipbound::sensor::Sensor;
use slipbound::task::{Observation, Phase, Task, TaskKind, TaskSettings, TaskStep};
use slipbound_lab::hand::HandScene;
use slipbound_lab::lockstep::LockStep;
use slipbound_rig::emulator::{Block, by_name, serve_tcp};
use slipbound_rig::gripper::{Device, Request};
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime::{self, MonitorWorkers, QueuedObserver};
use slipbound_rig::source::{Newest, decode_image};
use slipbound_rig::wrist;
use std::cell::Cell;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// The frames: two fingers on a cap that is turned until they slip, seconds 0 to 4.
const SCENE: &str = "screw?longest_s=4";

/// By how much the force goes to and fro, so that every frame has a command, N.
const NUDGE_N: f64 = 0.5;

/// Width of what the emulator holds, mm.
const WIDTH_MM: f64 = 28.0;

/// Longest wait for the emulator to hold, frames.
const GRASP_FRAMES_COUNT: u32 = 3000;

/// For how long whatever blocks is blocked.
const BLOCKED: Duration = Duration::from_secs(5);

/// Cycles that may wait for a disk or a terminal.
const QUEUE_DEPTH_COUNT: usize = 128;

/// The arguments of `slipbound latency`.
#[derive(Debug, clap::Args)]
pub struct Latency {
    /// Frames to measure
    #[arg(long, value_name = "COUNT", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    frames: u32,
    /// Frames per second, 1 to 250
    #[arg(long, value_name = "HZ", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=250))]
    rate_hz: u32,
    /// Fingers with a camera
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    fingers: u8,
}

/// What else happens while it is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Besides {
    Nothing,
    /// An observer behind a queue, as the run folder is, blocks in every cycle.
    BlockedDisk,
    /// Two do: the folder and the terminal.
    BlockedTerminal,
    /// The last finger's camera blocks for seconds at a time, from a frame after the grasp on.
    BlockedCamera,
}

const ROWS: [(&str, bool, Besides); 5] = [
    ("pixels in memory", false, Besides::Nothing),
    ("JPEG in memory", true, Besides::Nothing),
    ("JPEG, the disk blocks", true, Besides::BlockedDisk),
    ("JPEG, disk and terminal block", true, Besides::BlockedTerminal),
    ("JPEG, a camera blocks", true, Besides::BlockedCamera),
];

/// Simulated frames of a finger over and over, as JPEG or as pixels.
struct Reel {
    frames: Arc<Vec<FrameBuffer>>,
    next: usize,
    /// From here it starts again; what goes before is the open hand.
    again_from: usize,
    is_jpeg: bool,
    /// From this frame on, every frame takes seconds.
    blocks_from: Option<usize>,
    given_count: usize,
}

impl FrameSource for Reel {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if self.blocks_from.is_some_and(|from| self.given_count >= from) {
            thread::sleep(BLOCKED);
        }
        self.given_count += 1;
        let frame = &self.frames[self.next];
        if self.is_jpeg {
            into.encoded.clone_from(&frame.encoded);
            decode_image(into)?;
        } else {
            (into.format, into.size) = (frame.format, frame.size);
            into.pixels.clone_from(&frame.pixels);
        }
        into.seq += 1;
        self.next = if self.next + 1 < self.frames.len() { self.next + 1 } else { self.again_from };
        Ok(Next::Frame)
    }
}

/// A task whose force goes to and fro while it holds.
struct Nudged {
    inner: Box<dyn Task + Send>,
    is_up: bool,
}

impl Task for Nudged {
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
}

/// An observer that blocks in every cycle.
struct Blocked;

impl CycleObserver for Blocked {
    fn after_cycle(&mut self, _: &CycleView<'_>) {
        thread::sleep(BLOCKED);
    }
}

/// Measures each cycle with a command after the grasp, from when it was due.
struct Stopwatch<'a> {
    due_ns: &'a Cell<u64>,
    stop: &'a AtomicBool,
    wanted_count: usize,
    took_ns: Vec<u64>,
    asked_n: Option<f64>,
    /// Commands the gripper had confirmed when the next frame was due.
    confirmed_count: usize,
    waited_count: u32,
}

impl CycleObserver for Stopwatch<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let took_ns = now_ns() - self.due_ns.get();
        let Some(cycle) = view.cycle().filter(|cycle| cycle.phase != Phase::Grasping) else {
            self.waited_count += 1;
            self.stop.fetch_or(self.waited_count > GRASP_FRAMES_COUNT, Ordering::Relaxed);
            return;
        };
        let confirmed = cycle.gripper.target_n.zip(self.asked_n).is_some_and(|(a, b)| (a - b).abs() < 1e-3);
        self.confirmed_count += usize::from(confirmed);
        self.asked_n = cycle.grip_command.force_n();
        self.took_ns.push(took_ns);
        self.stop.fetch_or(self.took_ns.len() >= self.wanted_count, Ordering::Relaxed);
    }
}

/// Frames of every finger, and from which one on something is held.
struct Reels {
    fingers: Vec<Arc<Vec<FrameBuffer>>>,
    again_from: usize,
    hand: Vec<(String, Mounting, Sensor)>,
}

/// Keeps every frame of a simulated run.
#[derive(Default)]
struct Keep {
    frames: Vec<Vec<FrameBuffer>>,
    grasped_from: usize,
}

impl CycleObserver for Keep {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.frames.resize_with(view.fingers.len(), Vec::new);
        for (frames, finger) in self.frames.iter_mut().zip(view.fingers) {
            frames.push(finger.frame.clone());
        }
        if view.cycle().is_none_or(|cycle| cycle.phase == Phase::Grasping) {
            self.grasped_from = self.frames[0].len();
        }
    }
}

impl Latency {
    /// Simulates the frames, then measures.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let scene = HandScene::parse(&format!("{SCENE}&fingers={}", self.fingers)).map_err(Failure::arguments)?;
        let reels = Reels::simulate(&scene)?;
        let failed = |e| Failure::work("cannot listen on this computer", e);
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(failed)?;
        let address =
            format!("wsg50://{}?part_width_mm={WIDTH_MM}&lowering=allow", listener.local_addr().map_err(failed)?);
        let go_on = Arc::new(AtomicBool::new(true));
        let goes_on = go_on.clone();
        let mut emulator = by_name("wsg50").context("no emulator is called wsg50")?;
        let other_side = thread::spawn(move || {
            serve_tcp(listener, &mut emulator, &mut Block::new(WIDTH_MM), || goes_on.load(Ordering::Relaxed))
        });
        let told = self.measure_all(&reels, &address);
        go_on.store(false, Ordering::Relaxed);
        let _ = other_side.join(); // what it could not do shows in what was measured
        told
    }

    fn measure_all(&self, reels: &Reels, address: &str) -> Result<Outcome, Failure> {
        let interrupted = interruption::listen()?;
        let mut terminal = Terminal::plain();
        let (frames, rate_hz, fingers) = (self.frames, self.rate_hz, self.fingers);
        terminal.say(&format!("{frames} frames of each of {fingers} fingers at {rate_hz} Hz, a command after each"))?;
        terminal.say("| from | to | p50 ms | p99 ms | p99.9 ms | worst ms | confirmed before the next frame |")?;
        terminal.say("|---|---|---|---|---|---|---|")?;
        for (from, is_jpeg, besides) in ROWS {
            if interrupted.load(Ordering::Relaxed) {
                return Err(anyhow!("interrupted").into());
            }
            let mut device = Device::open(address, None).map_err(|e| Failure::Work(e.into()))?;
            let (mut took_ns, confirmed_count) =
                self.measure(&mut reels.control(is_jpeg, besides)?, &mut device, besides)?;
            let confirmed = 100.0 * confirmed_count as f64 / took_ns.len() as f64;
            took_ns.sort_unstable();
            let at = |share: f64| took_ns[((took_ns.len() - 1) as f64 * share).round() as usize] as f64 * 1e-6;
            let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(at);
            let times = format!("{p50:.2} | {p99:.2} | {p999:.2} | {worst:.2}");
            terminal.say(&format!("| {from} | command bytes in the socket | {times} | {confirmed:.0} % |"))?;
            // So that the next measurement begins with a grasp like the first.
            device.request(Request::Grip(GripCommand::Release)).map_err(|e| Failure::Work(e.into()))?;
        }
        Ok(Outcome::Done)
    }

    fn measure(
        &self,
        control: &mut ControlLoop,
        device: &mut Device,
        besides: Besides,
    ) -> anyhow::Result<(Vec<u64>, usize)> {
        let mut wrist = wrist::open("dry")?;
        let (due_ns, stop) = (Cell::new(now_ns()), AtomicBool::new(false));
        let period_ns = 1_000_000_000 / u64::from(self.rate_hz);
        let mut next_ns = now_ns();
        let mut is_due = || {
            let is_due = now_ns() >= next_ns;
            if is_due {
                due_ns.set(now_ns());
                next_ns = (next_ns + period_ns).max(now_ns());
            }
            is_due
        };
        let queues_count = match besides {
            Besides::Nothing | Besides::BlockedCamera => 0,
            Besides::BlockedDisk => 1,
            Besides::BlockedTerminal => 2,
        };
        let queue = |i: usize| QueuedObserver::new(Blocked, QUEUE_DEPTH_COUNT, i == 0);
        let mut queues: Vec<_> = (0..queues_count).map(queue).collect();
        let stopwatch = Stopwatch {
            due_ns: &due_ns,
            stop: &stop,
            wanted_count: self.frames as usize,
            took_ns: Vec::with_capacity(self.frames as usize),
            asked_n: None,
            confirmed_count: 0,
            waited_count: 0,
        };
        let mut observer = (AllOf(&mut queues), stopwatch);
        let ran = realtime::run(control, device, wrist.as_mut(), &stop, &mut is_due, &mut observer);
        let (_, Stopwatch { took_ns, confirmed_count, .. }) = observer;
        match ran {
            Ok(()) | Err(ControlError::Interrupted) if took_ns.len() >= self.frames as usize => {
                Ok((took_ns, confirmed_count))
            }
            Ok(()) | Err(ControlError::Interrupted) => Err(anyhow!("the emulator never held anything")),
            Err(error) => Err(error.into()),
        }
    }
}

/// Every queue is shown every cycle.
struct AllOf<'a>(&'a mut Vec<QueuedObserver<Blocked>>);

impl CycleObserver for AllOf<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.0.iter_mut().for_each(|queue| queue.after_cycle(view));
    }
}

impl Reels {
    /// Runs the scene once and keeps its frames.
    fn simulate(scene: &HandScene) -> Result<Self, Failure> {
        let lockstep = LockStep::new(scene, &TaskSettings::default(), &Settings::default(), None);
        let mut lockstep = lockstep.map_err(Failure::arguments)?;
        let mut keep = Keep::default();
        lockstep.run(&|| false, &mut keep).map_err(|e| Failure::Work(e.into()))?;
        if keep.frames.first().is_none_or(|frames| keep.grasped_from >= frames.len()) {
            return Err(anyhow!("{scene}: nothing was grasped").into());
        }
        let fingers = lockstep.control().fingers().iter();
        let hand = fingers.map(|f| (f.name().to_owned(), f.mounting(), f.sensor().clone())).collect();
        let fingers = keep.frames.into_iter().map(Arc::new).collect();
        Ok(Reels { fingers, again_from: keep.grasped_from, hand })
    }

    /// A loop around the frames, which holds and nudges.
    fn control(&self, is_jpeg: bool, besides: Besides) -> Result<ControlLoop, Failure> {
        let mut settings = TaskSettings::default();
        (settings.lift.lift_mm, settings.lift.hold_ns) = (0.0, 1_000_000_000_000_000);
        let stiffness = self.hand[0].2.shear_stiffness_mpa_per_mm();
        let inner = settings.task(TaskKind::Lift, stiffness).map_err(Failure::arguments)?;
        let last = self.fingers.len() - 1;
        let fingers = self.fingers.iter().zip(&self.hand).enumerate().map(|(i, (frames, (name, mounting, sensor)))| {
            let blocks_from = (besides == Besides::BlockedCamera && i == last).then_some(self.again_from + 1);
            let again_from = self.again_from;
            let reel = Reel { frames: frames.clone(), next: 0, again_from, is_jpeg, blocks_from, given_count: 0 };
            let source: Box<dyn FrameSource + Send> = match blocks_from {
                Some(_) => Box::new(Newest::every_frame(Box::new(reel), 2)),
                None => Box::new(reel),
            };
            FingerPipeline::new(name, *mounting, sensor.clone(), Settings::default(), source)
        });
        let task = Box::new(Nudged { inner, is_up: false });
        let control = ControlLoop::new(fingers.collect(), task).map_err(Failure::arguments)?;
        Ok(control.with_runner(Box::new(MonitorWorkers::new())))
    }
}
