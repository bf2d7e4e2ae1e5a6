//! `slipbound latency`: from a frame to the bytes of a grip command in the socket, as a table.

use crate::closed_loop::{ClosedLoop, Eye, Turned};
use crate::outcome::{Failure, Outcome};
use crate::simulated::{Simulated, mounting};
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::grip::Guard;
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Gripper, Next, SourceError};
use slipbound::sensor::Sensor;
use slipbound::task::{Observation, Phase, Task, TaskKind, TaskSettings, TaskStep};
use slipbound_lab::hand::HandScene;
use slipbound_rig::emulator::{Block, Faults, Faulty, by_name, serve_tcp};
use slipbound_rig::gripper::{Device, Request};
use slipbound_rig::link::now_ns;
use slipbound_rig::source::decode_image;
use slipbound_rig::wrist;
use std::net::{Ipv4Addr, TcpListener};
use std::rc::Rc;
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

/// Time between two looks at the link while no frame is due.
const PAUSE: Duration = Duration::from_micros(500);

/// So that the second measurement begins with a grasp like the first.
const RELEASE: Request = Request::Grip(GripCommand::Release);

/// Longest wait for the emulator to hold, frames.
const GRASP_FRAMES_COUNT: u32 = 3000;

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

/// Simulated frames of a finger over and over, as JPEG or as pixels.
struct Reel {
    frames: Rc<Vec<FrameBuffer>>,
    next: usize,
    /// From here it starts again; what goes before is the open hand.
    again_from: usize,
    is_jpeg: bool,
}

impl FrameSource for Reel {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let frame = &self.frames[self.next];
        if self.is_jpeg {
            into.encoded.clone_from(&frame.encoded);
            decode_image(into)?;
        } else {
            (into.format, into.size) = (frame.format, frame.size);
            into.pixels.clone_from(&frame.pixels);
        }
        (into.seq, into.time_ns) = (into.seq + 1, Some(now_ns()));
        self.next = if self.next + 1 < self.frames.len() { self.next + 1 } else { self.again_from };
        Ok(Next::Frame)
    }
}

/// A task whose force goes to and fro a little.
struct Nudged {
    inner: Box<dyn Task + Send>,
    is_up: bool,
}

impl Task for Nudged {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        let mut step = self.inner.step(observation);
        if step.phase != Phase::Grasping {
            self.is_up = !self.is_up;
            step.grip.force_n -= if self.is_up { 0.0 } else { NUDGE_N };
        }
        step
    }

    fn grip(&self) -> &Guard {
        self.inner.grip()
    }
}

/// What was measured.
#[derive(Default)]
struct Measured {
    /// From a frame to its command, ns.
    took_ns: Vec<u64>,
    /// Commands the gripper had confirmed when the next frame was due.
    confirmed_count: usize,
}

/// Frames of every finger, and from which one on something is held.
struct Recorded {
    fingers: Vec<Rc<Vec<FrameBuffer>>>,
    again_from: usize,
    sensors: Vec<Sensor>,
}

impl Latency {
    /// Simulates the frames, then measures.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let scene = HandScene::parse(&format!("{SCENE}&fingers={}", self.fingers)).map_err(Failure::arguments)?;
        let recorded = record(&scene)?;
        let failed = |e| Failure::work("cannot listen on this computer", e);
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(failed)?;
        let address =
            format!("wsg50://{}?part_width_mm={WIDTH_MM}&lowering=allow", listener.local_addr().map_err(failed)?);
        let go_on = Arc::new(AtomicBool::new(true));
        let goes_on = go_on.clone();
        let inner = by_name("wsg50").context("no emulator is called wsg50")?;
        let other_side = thread::spawn(move || {
            let mut emulator = Faulty::new(inner, Faults::default());
            serve_tcp(listener, &mut emulator, &mut Block::new(WIDTH_MM), || goes_on.load(Ordering::Relaxed))
        });
        let told = self.measure_both(&recorded, &address);
        go_on.store(false, Ordering::Relaxed);
        let _ = other_side.join(); // what it could not do shows in what was measured
        told
    }

    fn measure_both(&self, recorded: &Recorded, address: &str) -> Result<Outcome, Failure> {
        let mut terminal = Terminal::plain();
        let (frames, rate_hz, fingers) = (self.frames, self.rate_hz, self.fingers);
        terminal.say(&format!("{frames} frames of each of {fingers} fingers at {rate_hz} Hz, a command after each"))?;
        terminal.say("| from | to | p50 ms | p99 ms | p99.9 ms | worst ms | confirmed before the next frame |")?;
        terminal.say("|---|---|---|---|---|---|---|")?;
        for (from, is_jpeg) in [("pixels in memory", false), ("JPEG in memory", true)] {
            let mut device = Device::open(address, None).map_err(|e| Failure::Work(e.into()))?;
            let Measured { mut took_ns, confirmed_count } =
                self.measure(&mut recorded.around(is_jpeg)?, &mut device)?;
            let confirmed = 100.0 * confirmed_count as f64 / took_ns.len() as f64;
            took_ns.sort_unstable();
            let at = |share: f64| took_ns[((took_ns.len() - 1) as f64 * share).round() as usize] as f64 * 1e-6;
            let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(at);
            let times = format!("{p50:.2} | {p99:.2} | {p999:.2} | {worst:.2}");
            terminal.say(&format!("| {from} | command bytes in the socket | {times} | {confirmed:.0} % |"))?;
            device.order(RELEASE).map_err(|e| Failure::Work(e.into()))?;
        }
        Ok(Outcome::Done)
    }

    fn measure(&self, around: &mut ClosedLoop, device: &mut Device) -> anyhow::Result<Measured> {
        let mut wrist = wrist::open("dry")?;
        let mut measured = Measured::default();
        let (mut due_ns, mut asked_n, mut waited_count) = (now_ns(), None, 0);
        while measured.took_ns.len() < self.frames as usize {
            due_ns += 1_000_000_000 / u64::from(self.rate_hz);
            while now_ns() < due_ns {
                device.carry();
                thread::sleep(PAUSE);
            }
            let took_over_n = device.state()?.target_n;
            let is_confirmed = took_over_n.zip(asked_n).is_some_and(|(a, b): (f64, f64)| (a - b).abs() < 1e-3);
            measured.confirmed_count += usize::from(is_confirmed && !measured.took_ns.is_empty());
            let from_ns = now_ns();
            let turned = around.turn(from_ns, device, wrist.as_mut())?;
            let took_ns = now_ns() - from_ns;
            match turned {
                Turned::Commanded(turn) if turn.step.phase != Phase::Grasping => {
                    asked_n = Some(turn.step.grip.force_n);
                    measured.took_ns.push(took_ns);
                }
                _ => waited_count += 1,
            }
            anyhow::ensure!(waited_count < GRASP_FRAMES_COUNT, "the emulator never held anything");
        }
        Ok(measured)
    }
}

/// Runs the scene once and keeps its frames.
fn record(scene: &HandScene) -> Result<Recorded, Failure> {
    let mut simulated = Simulated::new(scene, &TaskSettings::default(), &Settings::default(), None)?;
    let mut fingers: Vec<Vec<FrameBuffer>> = vec![Vec::new(); scene.fingers_count()];
    let mut again_from = 0;
    simulated.run(|around, told, _| {
        for (frames, eye) in fingers.iter_mut().zip(&around.eyes) {
            frames.push(eye.frame.clone());
        }
        if matches!(told.turned, Turned::Commanded(turn) if turn.step.phase == Phase::Grasping) {
            again_from = fingers[0].len();
        }
        Ok(())
    })?;
    if again_from >= fingers[0].len() {
        return Err(anyhow!("{scene}: nothing was grasped").into());
    }
    let sensors = (0..fingers.len()).map(|finger| simulated.hand.sensor(finger)).collect();
    Ok(Recorded { fingers: fingers.into_iter().map(Rc::new).collect(), again_from, sensors })
}

impl Recorded {
    /// A loop around the frames, which holds and nudges.
    fn around(&self, is_jpeg: bool) -> Result<ClosedLoop, Failure> {
        let mut settings = TaskSettings::default();
        (settings.lift.lift_mm, settings.lift.hold_ns) = (0.0, 1_000_000_000_000_000);
        let stiffness = self.sensors[0].shear_stiffness_mpa_per_mm();
        let inner = settings.task(TaskKind::Lift, stiffness).map_err(Failure::arguments)?;
        let eyes = self.fingers.iter().zip(&self.sensors).enumerate().map(|(finger, (frames, sensor))| {
            let (mounting, name) = mounting(finger, false);
            let reel = Reel { frames: frames.clone(), next: 0, again_from: self.again_from, is_jpeg };
            Eye::new(name, mounting, sensor.clone(), Settings::default(), Box::new(reel))
        });
        ClosedLoop::new(eyes.collect(), Box::new(Nudged { inner, is_up: false })).map_err(Failure::Work)
    }
}
