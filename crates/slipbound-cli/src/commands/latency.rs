//! `slipbound latency`: from a frame to the bytes of a grip command in the socket, as a table.

use crate::closed_loop::{ClosedLoop, Eye, Turned};
use crate::outcome::{Failure, Outcome};
use crate::simulated::{Simulated, mounting};
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::grip::Guard;
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, FrameSource, Gripper, Next, SourceError};
use slipbound::task::{Moment, Phase, Task, TaskKind, TaskSettings, TaskStep};
use slipbound_lab::hand::HandScene;
use slipbound_rig::emulator::{Block, Faults, Faulty, by_name, serve_tcp};
use slipbound_rig::gripper::Device;
use slipbound_rig::link::now_ns;
use slipbound_rig::source::decode_image;
use slipbound_rig::wrist;
use std::cell::Cell;
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

/// Simulated frames of a finger over and over, decoded from JPEG when asked for.
struct Reel {
    frames: Vec<FrameBuffer>,
    next: usize,
    /// From here it starts again; what goes before is the open hand.
    again_from: usize,
    decoded_ns: Rc<Cell<u64>>,
}

impl FrameSource for Reel {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let from_ns = now_ns();
        into.encoded.clone_from(&self.frames[self.next].encoded);
        decode_image(into)?;
        (into.seq, into.time_ns) = (into.seq + 1, Some(from_ns));
        self.next = if self.next + 1 < self.frames.len() { self.next + 1 } else { self.again_from };
        self.decoded_ns.set(self.decoded_ns.get() + now_ns() - from_ns);
        Ok(Next::Frame)
    }
}

/// A task whose force goes to and fro a little.
struct Nudged {
    inner: Box<dyn Task + Send>,
    is_up: bool,
}

impl Task for Nudged {
    fn step(&mut self, moment: &Moment<'_>) -> TaskStep {
        let mut step = self.inner.step(moment);
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

/// What was measured of each frame, ns.
#[derive(Default)]
struct Measured {
    from_jpeg: Vec<u64>,
    from_pixels: Vec<u64>,
    decoding: Vec<u64>,
    /// Commands the gripper had confirmed when the next frame was due.
    confirmed_count: usize,
}

impl Latency {
    /// Simulates the frames, then measures.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let scene = HandScene::parse(&format!("{SCENE}&fingers={}", self.fingers)).map_err(Failure::arguments)?;
        let decoded_ns = Rc::default();
        let mut around = around(&scene, &decoded_ns)?;
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
        let measured = Device::open(&address, None)
            .map_err(anyhow::Error::from)
            .and_then(|mut device| self.measure(&mut around, &mut device, &decoded_ns));
        go_on.store(false, Ordering::Relaxed);
        let _ = other_side.join(); // what it could not do shows in what was measured
        self.tell(measured?)
    }

    fn measure(
        &self,
        around: &mut ClosedLoop,
        device: &mut Device,
        decoded_ns: &Cell<u64>,
    ) -> anyhow::Result<Measured> {
        let mut wrist = wrist::open("dry")?;
        let mut measured = Measured::default();
        let (mut due_ns, mut asked_n, mut waited_count) = (now_ns(), None, 0);
        while measured.from_jpeg.len() < self.frames as usize {
            due_ns += 1_000_000_000 / u64::from(self.rate_hz);
            while now_ns() < due_ns {
                device.carry();
                thread::sleep(PAUSE);
            }
            let took_over_n = device.state()?.target_n;
            let is_confirmed = took_over_n.zip(asked_n).is_some_and(|(a, b): (f64, f64)| (a - b).abs() < 1e-3);
            measured.confirmed_count += usize::from(is_confirmed && !measured.from_jpeg.is_empty());
            decoded_ns.set(0);
            let from_ns = now_ns();
            let turned = around.turn(from_ns, device, wrist.as_mut())?;
            let total_ns = now_ns() - from_ns;
            match turned {
                Turned::Commanded(turn) if turn.step.phase != Phase::Grasping => {
                    asked_n = Some(turn.step.grip.force_n);
                    measured.from_jpeg.push(total_ns);
                    measured.from_pixels.push(total_ns - decoded_ns.get());
                    measured.decoding.push(decoded_ns.get());
                }
                _ => waited_count += 1,
            }
            anyhow::ensure!(waited_count < GRASP_FRAMES_COUNT, "the emulator never held anything");
        }
        Ok(measured)
    }

    fn tell(&self, mut measured: Measured) -> Result<Outcome, Failure> {
        let mut terminal = Terminal::plain();
        let (frames, rate_hz, fingers) = (self.frames, self.rate_hz, self.fingers);
        let confirmed_count = measured.confirmed_count;
        terminal.say(&format!(
            "{frames} frames of each of {fingers} fingers at {rate_hz} Hz, a command after each; \
             {confirmed_count} confirmed by the gripper before the next frame"
        ))?;
        terminal.say("| from | to | p50 ms | p99 ms | p99.9 ms | worst ms |\n|---|---|---|---|---|---|")?;
        for (from, to, values) in [
            ("JPEG in memory", "command bytes in the socket", &mut measured.from_jpeg),
            ("pixels in memory", "command bytes in the socket", &mut measured.from_pixels),
            ("JPEG in memory", "pixels", &mut measured.decoding),
        ] {
            values.sort_unstable();
            let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize] as f64 * 1e-6;
            let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(at);
            terminal.say(&format!("| {from} | {to} | {p50:.2} | {p99:.2} | {p999:.2} | {worst:.2} |"))?;
        }
        Ok(Outcome::Done)
    }
}

/// A loop around the frames of a scene, which holds and nudges.
fn around(scene: &HandScene, decoded_ns: &Rc<Cell<u64>>) -> Result<ClosedLoop, Failure> {
    let (mut settings, monitor) = (TaskSettings::default(), Settings::default());
    let mut simulated = Simulated::new(scene, &settings, &monitor, None)?;
    let mut reels: Vec<Vec<FrameBuffer>> = vec![Vec::new(); scene.fingers_count()];
    let mut again_from = 0;
    simulated.run(|around, told, _| {
        for (reel, eye) in reels.iter_mut().zip(&around.eyes) {
            reel.push(eye.frame.clone());
        }
        if matches!(told.turned, Turned::Commanded(turn) if turn.step.phase == Phase::Grasping) {
            again_from = reels[0].len();
        }
        Ok(())
    })?;
    if again_from >= reels[0].len() {
        return Err(anyhow!("{scene}: nothing was grasped").into());
    }
    (settings.lift.lift_mm, settings.lift.hold_ns) = (0.0, 1_000_000_000_000_000);
    let stiffness = simulated.hand.sensor(0).shear_stiffness_mpa_per_mm();
    let inner = settings.task(TaskKind::Lift, stiffness).map_err(Failure::arguments)?;
    let eyes = reels.into_iter().enumerate().map(|(finger, frames)| {
        let (mounting, name) = mounting(finger, false);
        let reel = Reel { frames, next: 0, again_from, decoded_ns: decoded_ns.clone() };
        Eye::new(name, mounting, simulated.hand.sensor(finger), monitor.clone(), Box::new(reel))
    });
    ClosedLoop::new(eyes.collect(), Box::new(Nudged { inner, is_up: false })).map_err(Failure::Work)
}
