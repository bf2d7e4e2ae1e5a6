//! A simulated hand in lock-step: two soft fingers on a parallel gripper, a wrist, and the held object.
//!
//! ```text
//!   SimGripper --> jaws  --.                         .--> SimCamera 0 (left)
//!   SimWrist   --> wrist --+--> HandWorld (a Plant) -+--> SimCamera 1 (right)
//!                          |    contact, cap in its thread  `--> HandTruth
//!              advance_frame: 1/30 s in four steps
//! ```
//!
//! Hand and finger frames are those of [`slipbound::hand`], with gravity along X; finger 0 is the left one, 1 the right
//! one. The wrist turns about X, positive from Y to Z.
//!
//! ```
//! use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Gripper, Next};
//! use slipbound_lab::hand::{HandScene, SimHand};
//!
//! let hand = SimHand::new(&HandScene::parse("screw?mu=0.6&seed=3").unwrap()).unwrap();
//! let (mut camera, mut gripper) = (hand.camera(0), hand.gripper());
//! let mut frame = FrameBuffer::default();
//! gripper.command(GripCommand::Hold { force_n: 10.0 }).unwrap();
//! for n in 0..10 {
//!     assert_eq!(camera.next(&mut frame).unwrap(), Next::Frame);
//!     assert_eq!(frame.seq, n);
//!     hand.advance_frame();
//! }
//! assert!(hand.truth().grip_force_n > 5.0 && hand.truth().slid_mm == 0.0);
//! ```

mod cameras;
mod pads;
mod ports;
mod scene;
mod shared;
mod truth;
mod world;

pub use ports::{SimCamera, SimGripper, SimPlant, SimWrist};
pub use scene::{HAND_KEYS, HAND_TASKS, HandKey, HandScene};
pub use truth::HandTruth;
pub use world::HandWorld;

use shared::SharedHand;
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;

/// A handle of a simulated hand. [`SimHand::camera`], [`SimHand::gripper`], [`SimHand::wrist`] and [`SimHand::plant`]
/// create the other handles. All of them can be moved to threads. In lock-step the same calls in the same order give
/// the same bytes, whichever threads make them.
#[derive(Debug, Clone)]
pub struct SimHand(SharedHand);

impl SimHand {
    /// The hand of a scene at time 0: the jaws open, the object untouched. Fails for invalid settings of object or
    /// contact.
    pub fn new(scene: &HandScene) -> Result<Self, SettingError> {
        SharedHand::new(scene).map(SimHand)
    }

    /// The jaws. [`GripCommand::Release`](slipbound::port::GripCommand::Release) opens them wide.
    pub fn gripper(&self) -> SimGripper {
        SimGripper::new(self.0.clone())
    }

    /// The wrist.
    pub fn wrist(&self) -> SimWrist {
        SimWrist::new(self.0.clone())
    }

    /// The camera of a finger: 0 left, 1 right.
    pub fn camera(&self, finger: usize) -> SimCamera {
        SimCamera::new(self.0.clone(), finger)
    }

    /// The world between the jaws, for a gripper and a wrist outside the simulator: emulators behind a real wire
    /// protocol. After this call they advance the time, in their own steps; gripper and wrist of this hand refuse
    /// commands, [`SimHand::advance_frame`] does nothing, and the cameras continue.
    pub fn plant(&self) -> SimPlant {
        self.0.lock().is_plant = true;
        SimPlant::new(self.0.clone())
    }

    /// The facts of a finger, with the stiffness of its gel.
    pub fn sensor(&self, finger: usize) -> Sensor {
        self.0.lock().cameras.sensor(finger)
    }

    /// Time since the start, in ns.
    pub fn now_ns(&self) -> u64 {
        self.0.lock().now_ns()
    }

    /// Whole frames since the start.
    pub fn frame(&self) -> u64 {
        self.0.lock().world.frame()
    }

    /// Advances by 1/30 s: jaws, wrist and contact in four steps. Images of all fingers are rendered when the first is
    /// read. After an error time does not advance; cameras, gripper and wrist then return it, as [`SimHand::error`]
    /// does.
    pub fn advance_frame(&self) {
        let mut parts = self.0.lock();
        if !parts.is_plant {
            parts.advance_frame();
        }
    }

    /// The error that stopped the run; None otherwise.
    pub fn error(&self) -> Option<SettingError> {
        self.0.lock().world.error().cloned()
    }

    /// The present ground truth.
    pub fn truth(&self) -> HandTruth {
        let parts = self.0.lock();
        let opening_mm = (!parts.is_plant).then(|| parts.jaws.opening_mm());
        HandTruth { opening_mm, ..parts.world.truth().clone() }
    }

    /// Displacement of every marker of a finger in its own frame, in mm; empty where there is no camera.
    pub fn marker_shifts_mm(&self, finger: usize) -> Vec<Vec2> {
        let shared::HandParts { world, cameras, .. } = &mut *self.0.lock();
        cameras.marker_shifts_mm(finger, world)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::plant::Plant;
    use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Gripper, Wrist};

    #[test]
    fn a_panic_with_the_lock_held_stops_the_run_and_every_handle_says_so() {
        let scene = HandScene::parse("screw?fingers=1").expect("a sound scene");
        let shared = SharedHand::new(&scene).expect("a sound hand");
        let held = shared.clone();
        let thread = std::thread::spawn(move || {
            let _parts = held.lock();
            panic!("in the middle of a step");
        });
        assert!(thread.join().is_err());
        let mut gripper = SimGripper::new(shared.clone());
        let error = gripper.command(GripCommand::Hold { force_n: 10.0 }).expect_err("stopped").to_string();
        assert_eq!(error, "simulated hand: expected whole steps, got a thread that panicked in the middle of one");
        assert!(gripper.poll().is_err() && SimWrist::new(shared.clone()).poll().is_err());
        assert!(SimCamera::new(shared.clone(), 0).next(&mut FrameBuffer::default()).is_err());
        SimPlant::new(shared.clone()).advance_to(1_000_000_000);
        assert_eq!(shared.lock().now_ns(), 0, "no time passes");
    }
}
