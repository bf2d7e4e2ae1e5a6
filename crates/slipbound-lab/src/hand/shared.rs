//! What the handles of a simulated hand share: world, cameras, jaws and wrist behind one lock.

use super::cameras::Cameras;
use super::scene::HandScene;
use super::world::{HandWorld, time_ns};
use crate::world::SUBSTEPS_COUNT;
use slipbound::plant::{JawCommand, JawDrive, JawSettings, Plant, WristDrive};
use slipbound::setting::SettingError;
use std::sync::{Arc, Mutex, MutexGuard};

/// Time in which the jaws reach their start position, in ns.
const BEFORE_START_NS: u64 = 10_000_000_000;

/// The parts of a hand.
#[derive(Debug)]
pub(super) struct HandParts {
    pub world: HandWorld,
    pub cameras: Cameras,
    /// On their own clock, `BEFORE_START_NS` ahead.
    pub jaws: JawDrive,
    pub wrist: WristDrive,
    pub longest_ns: u64,
    /// Whether gripper and wrist are outside the simulator.
    pub is_plant: bool,
}

impl HandParts {
    fn new(scene: &HandScene) -> Result<Self, SettingError> {
        let world = HandWorld::new(scene)?;
        let cameras = Cameras::new(scene, &world);
        let mut jaws = JawDrive::new(JawSettings::default())?;
        let opening_mm = scene.width_mm() + scene.number("start_mm").unwrap_or(0.0);
        jaws.command(JawCommand::MoveTo { opening_mm });
        jaws.advance_to(BEFORE_START_NS, world.width_mm());
        let longest_ns = (scene.longest_s() * 1e9) as u64;
        Ok(HandParts { world, cameras, jaws, wrist: WristDrive::new(), longest_ns, is_plant: false })
    }

    pub fn now_ns(&self) -> u64 {
        self.world.now_ns()
    }

    /// Refuses gripper and wrist while others drive the plant, and after an error that stopped the run.
    pub fn check_usable(&self) -> Result<(), SettingError> {
        if self.is_plant {
            return Err(SettingError {
                key: "simulated hand".into(),
                got: "its own gripper or wrist".into(),
                expected: "the one that drives its plant".into(),
            });
        }
        self.world.error().map_or(Ok(()), |error| Err(error.clone()))
    }

    /// Advances jaws, wrist and world to the next frame.
    pub fn advance_frame(&mut self) {
        let from = self.world.steps_count();
        for step in 1..=SUBSTEPS_COUNT {
            let to_ns = time_ns(from + step);
            self.jaws.advance_to(BEFORE_START_NS + to_ns, self.world.width_mm());
            self.wrist.advance_to(to_ns);
            let wrist = self.wrist.state();
            self.world.press(self.jaws.force_n());
            self.world.place_wrist(wrist.angle_rad, wrist.lowered_mm);
            self.world.advance_to(to_ns);
        }
    }
}

/// The parts behind a lock, so that every handle can be on its own thread. The lock is held for one call.
#[derive(Debug, Clone)]
pub(super) struct SharedHand(Arc<Mutex<HandParts>>);

impl SharedHand {
    /// The hand of a scene at time 0.
    pub fn new(scene: &HandScene) -> Result<Self, SettingError> {
        Ok(SharedHand(Arc::new(Mutex::new(HandParts::new(scene)?))))
    }

    /// The parts. If a thread panicked while it held the lock, they may be half a step apart: the run is then stopped,
    /// and every handle returns that error.
    pub fn lock(&self) -> MutexGuard<'_, HandParts> {
        self.0.lock().unwrap_or_else(|poisoned| {
            let mut parts = poisoned.into_inner();
            parts.world.stop(SettingError {
                key: "simulated hand".into(),
                got: "a thread that panicked in the middle of one".into(),
                expected: "whole steps".into(),
            });
            parts
        })
    }
}
