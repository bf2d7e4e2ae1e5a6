//! A simulated hand behind real sockets on this computer, in real time.
//!
//! ```text
//!   a thread of its own: emulators at two ports -> world -> cameras --frames, truth--> the loop
//!                             ^                                                          |
//!                             '------------ TCP, the wire protocols ----- drivers <------'
//! ```

use crate::chronicle::Chronicle;
use crate::closed_loop::{ClosedLoop, Eye};
use crate::live;
use crate::simulated::{kind, mounting};
use crate::spoiled::{Spoiled, Spoiler};
use crate::through::{LinkFaults, Through, wrist_emulator};
use anyhow::{Context, anyhow};
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::task::TaskSettings;
use slipbound_lab::hand::{HandScene, HandTruth, SimHand};
use slipbound_rig::emulator::{Faulty, OnlyMoved, Server};
use slipbound_rig::link::now_ns;
use slipbound_rig::{gripper, wrist};
use std::cell::RefCell;
use std::net::{Ipv4Addr, TcpListener};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Time between two looks of the emulators at their links.
const PAUSE: Duration = Duration::from_millis(1);

/// What every camera saw, and what was true.
struct Sight {
    frames: Vec<FrameBuffer>,
    truth: HandTruth,
}

/// The newest frame of a finger, until it is taken.
type Slot = Rc<RefCell<Option<FrameBuffer>>>;

/// A finger's source: what the world's thread has sent.
struct Fed {
    slot: Slot,
}

impl FrameSource for Fed {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(match self.slot.borrow_mut().take() {
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
    around: ClosedLoop,
    slots: Vec<Slot>,
    sights: Receiver<Sight>,
    gripper: String,
    wrist: String,
    go_on: Arc<AtomicBool>,
    world: Option<JoinHandle<anyhow::Result<()>>>,
}

impl Loopback {
    /// Starts the world and its emulators at free ports.
    pub fn start(
        scene: &HandScene,
        settings: &TaskSettings,
        monitor: &Settings,
        spoiler: Option<Spoiler>,
        through: &Through,
        faults: &LinkFaults,
    ) -> anyhow::Result<Self> {
        let sensors = SimHand::new(scene)?;
        let slots: Vec<Slot> = (0..scene.fingers_count()).map(|_| Slot::default()).collect();
        let eyes = slots.iter().enumerate().map(|(finger, slot)| {
            let (mounting, name) = mounting(finger, spoiler.is_some_and(|spoiler| spoiler.swaps()));
            let fed = Fed { slot: slot.clone() };
            let source = Spoiled::new(fed, spoiler.filter(|spoiler| spoiler.hits(finger)));
            Eye::new(name, mounting, sensors.sensor(finger), monitor.clone(), Box::new(source))
        });
        let task = settings.task(kind(scene)?, sensors.sensor(0).shear_stiffness_mpa_per_mm())?;
        let around = ClosedLoop::new(eyes.collect(), task)?;
        let bind = || TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("cannot listen on this computer");
        let (gripper_port, wrist_port) = (bind()?, bind()?);
        let gripper = through.address(&gripper_port.local_addr()?.to_string(), scene.width_mm());
        let wrist = format!("line://{}", wrist_port.local_addr()?);
        let emulators = (through.emulator(&faults.gripper)?, wrist_emulator(&faults.wrist)?);
        let ports = (Server::new(gripper_port)?, Server::new(wrist_port)?);
        let (send, sights) = sync_channel(2);
        let go_on = Arc::new(AtomicBool::new(true));
        let (scene, goes_on) = (scene.clone(), go_on.clone());
        let world = thread::spawn(move || world(&scene, ports, emulators, &send, &goes_on));
        Ok(Loopback { around, slots, sights, gripper, wrist, go_on, world: Some(world) })
    }

    /// Runs the loop to its end; the truth at the end besides.
    pub fn run(
        mut self,
        interrupted: &AtomicBool,
        chronicle: &mut Chronicle,
    ) -> (anyhow::Result<()>, Option<HandTruth>) {
        let truth = RefCell::new(None);
        let ran = self.try_run(interrupted, chronicle, &truth);
        // The world goes on without the loop: what is let go of now was not held.
        let until_ns = now_ns() + AFTERWARDS_NS;
        while now_ns() < until_ns {
            truth.replace(self.sights.recv_timeout(PAUSE).ok().map(|sight| sight.truth).or(truth.take()));
        }
        self.go_on.store(false, Ordering::Relaxed);
        let ended = self
            .world
            .take()
            .map_or(Ok(()), |world| world.join().unwrap_or_else(|_| Err(anyhow!("the simulated world broke down"))));
        (ran.and(ended), truth.into_inner())
    }

    fn try_run(
        &mut self,
        interrupted: &AtomicBool,
        chronicle: &mut Chronicle,
        truth: &RefCell<Option<HandTruth>>,
    ) -> anyhow::Result<()> {
        let mut gripper = gripper::Device::open(&self.gripper, None)?;
        let mut wrist = wrist::open(&self.wrist)?;
        let is_due = || {
            let Some(sight) = self.sights.try_iter().last() else { return false };
            for (slot, frame) in self.slots.iter().zip(sight.frames) {
                slot.replace(Some(frame));
            }
            truth.replace(Some(sight.truth));
            true
        };
        live::run(&mut self.around, &mut gripper, wrist.as_mut(), interrupted, is_due, |around, told| {
            chronicle.turn(around, told, truth.borrow().as_ref())
        })
    }
}

/// Time the world goes on for after the loop, ns.
const AFTERWARDS_NS: u64 = 1_000_000_000;

/// The world and the emulators that press and move it, until told to stop or the scene is over.
fn world(
    scene: &HandScene,
    (mut gripper_port, mut wrist_port): (Server, Server),
    (mut gripper, mut wrist): (Faulty, Faulty),
    send: &SyncSender<Sight>,
    go_on: &AtomicBool,
) -> anyhow::Result<()> {
    let hand = SimHand::new(scene)?;
    let mut plant = hand.plant();
    let mut cameras: Vec<_> = (0..scene.fingers_count()).map(|finger| hand.camera(finger)).collect();
    let from_ns = now_ns();
    let mut seen = None;
    while go_on.load(Ordering::Relaxed) {
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
            // A loop that is busy misses frames, as with a real camera.
            let _ = send.try_send(Sight { frames, truth: hand.truth() });
        }
        thread::sleep(PAUSE);
    }
    Ok(())
}
