//! `slipbound latency`: from a frame to the bytes of a grip command in the socket, as a table; alone, and while a disk, a
//! terminal or a camera blocks.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::control::{CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, GripCommand};
use slipbound::task::{Phase, TaskSettings};
use slipbound_lab::hand::HandScene;
use slipbound_lab::lockstep::LockStep;
use slipbound_rig::emulator::{Block, by_name, serve_tcp};
use slipbound_rig::gripper::{Device, Request};
use slipbound_rig::realtime::latency::{Blocks, FingerFrames, HandFrames, LatencyError, LatencyTrial};
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// The frames: two fingers on a cap that the wrist rotates until they slip, seconds 0 to 4.
const SCENE: &str = "screw?longest_s=4";

/// Width of what the emulator holds, mm.
const WIDTH_MM: f64 = 28.0;

/// The arguments of `slipbound latency`.
#[derive(Debug, clap::Args)]
pub struct Latency {
    /// Frames to measure
    #[arg(long, value_name = "COUNT", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    frames: u32,
    /// Frames per second, 1 to 250
    #[arg(long, value_name = "HZ", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=250))]
    rate_hz: u32,
    /// Fingers with a camera; no row with a camera that blocks if it is the only one
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    fingers: u8,
}

/// Rows of the table: name, whether frames are decoded from JPEG, what blocks.
const ROWS: [(&str, bool, Blocks); 5] = [
    ("pixels in memory", false, Blocks::Nothing),
    ("JPEG in memory", true, Blocks::Nothing),
    ("JPEG, the disk blocks", true, Blocks::Disk),
    ("JPEG, disk and terminal block", true, Blocks::DiskAndTerminal),
    ("JPEG, a camera blocks", true, Blocks::Camera),
];

/// Keeps every frame of a simulated run.
#[derive(Default)]
struct KeptFrames {
    frames: Vec<Vec<FrameBuffer>>,
    held_from: usize,
}

impl CycleObserver for KeptFrames {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.frames.resize_with(view.fingers.len(), Vec::new);
        for (frames, finger) in self.frames.iter_mut().zip(view.fingers) {
            frames.push(finger.frame.clone());
        }
        if view.cycle().is_some_and(|cycle| cycle.phase == Phase::Grasping) {
            self.held_from = self.frames[0].len();
        }
    }
}

impl Latency {
    /// Simulates the frames, then measures.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let scene = HandScene::parse(&format!("{SCENE}&fingers={}", self.fingers)).map_err(Failure::arguments)?;
        let hand = simulate(&scene)?;
        let failed = |e| Failure::work("cannot listen on this computer", e);
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(failed)?;
        let address =
            format!("wsg50://{}?part_width_mm={WIDTH_MM}&lowering=allow", listener.local_addr().map_err(failed)?);
        let is_serving = Arc::new(AtomicBool::new(true));
        let serves = is_serving.clone();
        let mut emulator = by_name("wsg50").context("no emulator is called wsg50")?;
        let emulator_thread = thread::spawn(move || {
            serve_tcp(listener, &mut emulator, &mut Block::new(WIDTH_MM), |_| serves.load(Ordering::Relaxed))
        });
        let measured = self.measure_all(&hand, &address);
        is_serving.store(false, Ordering::Relaxed);
        let _ = emulator_thread.join(); // its failure shows in the measurement
        measured
    }

    fn measure_all(&self, hand: &HandFrames, address: &str) -> Result<Outcome, Failure> {
        let interrupted = interruption::listen()?;
        let mut terminal = Terminal::plain();
        let (frames, rate_hz, fingers) = (self.frames, self.rate_hz, self.fingers);
        let of = if fingers == 1 { "one finger".to_owned() } else { format!("each of {fingers} fingers") };
        terminal.say(&format!("{frames} frames of {of} at {rate_hz} Hz, a command after each"))?;
        terminal.say("| from | to | p50 ms | p99 ms | p99.9 ms | worst ms | confirmed before the next frame |")?;
        terminal.say("|---|---|---|---|---|---|---|")?;
        // A blocked camera delivers no frame to measure from.
        let is_measured = |blocks: Blocks| blocks != Blocks::Camera || fingers > 1;
        for (from, is_jpeg, blocks) in ROWS.into_iter().filter(|(.., blocks)| is_measured(*blocks)) {
            let mut device = Device::open(address, None).map_err(|e| Failure::Work(e.into()))?;
            let trial = LatencyTrial { cycles_count: frames as usize, rate_hz, is_jpeg, blocks };
            let latency = trial.run(hand, &mut device, &interrupted).map_err(|e| match e {
                LatencyError::Setting(e) => Failure::arguments(e),
                LatencyError::Interrupted => anyhow!("interrupted").into(),
                LatencyError::NothingHeld => anyhow!("the emulator never held anything").into(),
                LatencyError::Control(e) => Failure::Work(e.into()),
            })?;
            let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(|fraction| latency.quantile_ms(fraction));
            let times = format!("{p50:.2} | {p99:.2} | {p999:.2} | {worst:.2}");
            let confirmed = 100.0 * latency.confirmed_fraction();
            terminal.say(&format!("| {from} | command bytes in the socket | {times} | {confirmed:.0} % |"))?;
            if latency.missed_count > 0 {
                let missed = latency.missed_count;
                terminal.note(&format!(
                    "{from}: {missed} of the frames due at {rate_hz} Hz had no command of their own: newer ones came first"
                ));
            }
            // The next measurement then begins with a grasp like the first.
            device.request(Request::Grip(GripCommand::Release)).map_err(|e| Failure::Work(e.into()))?;
        }
        if fingers == 1 {
            terminal.note("left out: the row in which a camera blocks, which needs two fingers (--fingers 2)");
        }
        Ok(Outcome::Done)
    }
}

/// Runs the scene once and keeps its frames.
fn simulate(scene: &HandScene) -> Result<HandFrames, Failure> {
    let lockstep = LockStep::new(scene, &TaskSettings::default(), &Settings::default(), None);
    let mut lockstep = lockstep.map_err(Failure::arguments)?;
    let mut kept = KeptFrames::default();
    lockstep.run(&|| false, &mut kept).map_err(|e| Failure::Work(e.into()))?;
    if kept.frames.first().is_none_or(|frames| kept.held_from >= frames.len()) {
        return Err(anyhow!("{scene}: nothing was grasped").into());
    }
    let finger = |(finger, frames): (&FingerPipeline, Vec<FrameBuffer>)| FingerFrames {
        name: finger.name().to_owned(),
        mounting: finger.mounting(),
        sensor: finger.sensor().clone(),
        frames: Arc::new(frames),
    };
    let fingers = lockstep.control().fingers().iter().zip(kept.frames).map(finger).collect();
    Ok(HandFrames { fingers, held_from: kept.held_from })
}
