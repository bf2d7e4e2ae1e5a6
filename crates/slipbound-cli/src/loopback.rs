//! A simulated hand behind real sockets on this computer, in real time.
//!
//! ```text
//!   a thread of its own: emulators at two ports -> world -> cameras --frames, truth--> the loop
//!                             ^                                                          |
//!                             '------------ TCP, the wire protocols ----- drivers <------'
//! ```

use crate::emulated::{EmulatedGripper, LinkFaults, wrist_emulator};
use crate::run_output::{QueuedOutput, RunScorer};
use anyhow::{Context, anyhow};
use slipbound::control::{ControlLoop, CycleObserver, CycleView};
use slipbound::monitor::Settings;
use slipbound::plant::Plant;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::task::{Missing, TaskSettings};
use slipbound_lab::faults::CameraFault;
use slipbound_lab::hand::{HandScene, HandTruth, SimHand};
use slipbound_lab::lockstep::finger;
use slipbound_rig::emulator::{Emulator, OnlyMoved, Server};
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime::{self, MonitorWorkers};
use slipbound_rig::{gripper, wrist};
use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Time between two polls of the links by the emulators.
const PAUSE: Duration = Duration::from_millis(1);

/// A frame of every camera, and the truth at its time.
pub struct WorldFrame {
    /// Of every finger.
    pub frames: Vec<FrameBuffer>,
    /// The ground truth.
    pub truth: HandTruth,
}

/// The newest frame of a finger, until it is taken.
type Slot = Arc<Mutex<Option<FrameBuffer>>>;

/// A finger's source: the frames sent by the world's thread.
struct SlotSource {
    slot: Slot,
}

impl FrameSource for SlotSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(match self.slot.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(frame) => {
                *into = frame;
                Next::Frame
            }
            None => Next::Silent,
        })
    }
}

/// The world's thread, and the loop that is not yet running.
pub struct Loopback {
    control: ControlLoop,
    slots: Vec<Slot>,
    world_frames: Receiver<WorldFrame>,
    gripper: String,
    wrist: String,
    is_running: Arc<AtomicBool>,
    world: Option<JoinHandle<anyhow::Result<()>>>,
}

impl Loopback {
    /// Starts the world and its emulators at free ports.
    pub fn start(
        scene: &HandScene,
        settings: &TaskSettings,
        monitor: &Settings,
        fault: Option<CameraFault>,
        emulated: &EmulatedGripper,
        faults: &LinkFaults,
    ) -> anyhow::Result<Self> {
        let hand = SimHand::new(scene)?;
        let slots: Vec<Slot> = (0..scene.fingers_count()).map(|_| Slot::default()).collect();
        let pipeline = |(i, slot): (usize, &Slot)| {
            finger(scene, &hand, i, monitor, fault, Box::new(SlotSource { slot: slot.clone() }))
        };
        let fingers = slots.iter().enumerate().map(pipeline).collect();
        let task = settings.task(scene.task(), hand.sensor(0).shear_stiffness_mpa_per_mm())?;
        let control = ControlLoop::new(fingers, task)?.with_runner(Box::new(MonitorWorkers::new()));
        let bind = || TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("cannot listen on this computer");
        let (gripper_port, wrist_port) = (bind()?, bind()?);
        let gripper = emulated.address(&gripper_port.local_addr()?.to_string(), scene.width_mm());
        let wrist = format!("line://{}", wrist_port.local_addr()?);
        let emulators = (emulated.emulator(&faults.gripper)?, wrist_emulator(&faults.wrist)?);
        let ports = (Server::new(gripper_port)?, Server::new(wrist_port)?);
        let (send, world_frames) = sync_channel(2);
        let is_running = Arc::new(AtomicBool::new(true));
        let (scene, runs) = (scene.clone(), is_running.clone());
        let world = thread::spawn(move || world(&scene, ports, emulators, &send, &runs));
        Ok(Loopback { control, slots, world_frames, gripper, wrist, is_running, world: Some(world) })
    }

    /// Runs the loop to its end; the world runs a second longer, and the truth at its end is in the scorer. Also returns
    /// what the task waited for at the end, if its work had not begun, and the blind force that the loop was left with, if
    /// so, N per finger.
    pub fn run(
        mut self,
        stop: &AtomicBool,
        output: &mut QueuedOutput,
        scorer: &mut RunScorer,
    ) -> (anyhow::Result<()>, Option<Missing>, Option<f64>) {
        let truth = scorer.truth.clone();
        let set_truth = |now: HandTruth| *truth.lock().unwrap_or_else(PoisonError::into_inner) = Some(now);
        let ran = self.try_run(stop, output, scorer, &set_truth);
        // The world runs on without the loop: an object that falls now was not held.
        let until_ns = now_ns() + AFTERWARDS_NS;
        while now_ns() < until_ns {
            self.world_frames.recv_timeout(PAUSE).into_iter().for_each(|world_frame| set_truth(world_frame.truth));
        }
        truth.lock().unwrap_or_else(PoisonError::into_inner).iter().for_each(|truth| scorer.score.add_truth(truth));
        self.is_running.store(false, Ordering::Relaxed);
        let panicked = || Err(anyhow!("the simulated world broke down"));
        let ended = self.world.take().map_or(Ok(()), |world| world.join().unwrap_or_else(|_| panicked()));
        (ran.and(ended), self.control.task().missing(), self.control.left_with_n())
    }

    fn try_run(
        &mut self,
        stop: &AtomicBool,
        output: &mut QueuedOutput,
        scorer: &mut RunScorer,
        set_truth: &dyn Fn(HandTruth),
    ) -> anyhow::Result<()> {
        let mut gripper = gripper::Device::open(&self.gripper, None)?;
        let mut wrist = wrist::open(&self.wrist)?;
        let mut is_due = || {
            let Some(world_frame) = self.world_frames.try_iter().last() else { return false };
            for (slot, frame) in self.slots.iter().zip(world_frame.frames) {
                *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(frame);
            }
            set_truth(world_frame.truth);
            true
        };
        let mut observer = WithTruth { output, scorer };
        realtime::run(&mut self.control, &mut gripper, wrist.as_mut(), stop, &mut is_due, &mut observer)?;
        Ok(())
    }
}

/// Shows the output the truth in the scorer.
struct WithTruth<'a> {
    output: &'a mut QueuedOutput,
    scorer: &'a mut RunScorer,
}

impl CycleObserver for WithTruth<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let truth = self.scorer.truth.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(HandTruth::record);
        self.output.after_cycle(&CycleView { truth: truth.as_ref(), ..*view });
        self.scorer.after_cycle(view);
    }
}

/// Time for which the world runs on after the loop, ns.
const AFTERWARDS_NS: u64 = 1_000_000_000;

/// Runs the world and the emulators that press and move it, until stopped or the scene is over.
pub fn world(
    scene: &HandScene,
    (mut gripper_port, mut wrist_port): (Server, Server),
    (mut gripper, mut wrist): (Emulator, Emulator),
    send: &SyncSender<WorldFrame>,
    is_running: &AtomicBool,
) -> anyhow::Result<()> {
    let hand = SimHand::new(scene)?;
    let mut plant = hand.plant();
    let mut cameras: Vec<_> = (0..scene.fingers_count()).map(|finger| hand.camera(finger)).collect();
    let from_ns = now_ns();
    let mut seen = None;
    while is_running.load(Ordering::Relaxed) {
        gripper_port.serve(&mut gripper, &mut plant)?;
        wrist_port.serve(&mut wrist, &mut OnlyMoved(&mut plant))?;
        plant.advance_to(now_ns() - from_ns);
        if let Some(error) = hand.error() {
            return Err(error.into());
        }
        if seen != Some(hand.frame()) {
            seen = Some(hand.frame());
            let mut frames = Vec::new();
            for camera in &mut cameras {
                let mut frame = FrameBuffer::default();
                if camera.next(&mut frame).map_err(|e| anyhow!("{e}"))? == Next::Frame {
                    frames.push(frame);
                }
            }
            // A busy loop misses frames, as with a real camera.
            let _ = send.try_send(WorldFrame { frames, truth: hand.truth() });
        }
        thread::sleep(PAUSE);
    }
    Ok(())
}
