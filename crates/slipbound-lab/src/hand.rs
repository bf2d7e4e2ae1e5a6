//! A hand made of numbers: two soft fingers on a parallel gripper, a wrist, and what they hold, in lock-step.
//!
//! ```text
//!   SimGripper --> jaws  --.                         .--> SimCamera 0 (left)
//!   SimWrist   --> wrist --+--> HandWorld (a Plant) -+--> SimCamera 1 (right)
//!                          |    contact, cap in its thread  `--> HandTruth
//!              advance_frame: 1/30 s in four steps
//! ```
//!
//! Hand frame: X along the fingers, towards their tips and down, with gravity; Y across them; Z the closing direction,
//! from the left finger (0) to the right one (1); right-handed. Finger frames have x = X and z into their own gel, so
//! y = -Y on the left finger and y = Y on the right one. The wrist turns about X, positive from Y to Z.
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
mod drives;
mod scene;
mod truth;
mod world;

pub use drives::{SimGripper, SimWrist};
pub use scene::{HAND_KEYS, HAND_TASKS, HandKey, HandScene};
pub use truth::HandTruth;
pub use world::HandWorld;

use crate::world::SUBSTEPS_COUNT;
use cameras::Cameras;
use slipbound::plane::Vec2;
use slipbound::plant::{JawCommand, JawDrive, JawSettings, Plant, WristDrive};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;
use std::cell::RefCell;
use std::rc::Rc;

/// Time in which the jaws get to where they are at the start, in ns.
const BEFORE_START_NS: u64 = 10_000_000_000;

/// What the handles share.
#[derive(Debug)]
struct Inner {
    world: HandWorld,
    cameras: Cameras,
    /// On a clock of its own, `BEFORE_START_NS` ahead.
    jaws: JawDrive,
    wrist: WristDrive,
    longest_ns: u64,
    /// Whether somebody else plays gripper and wrist.
    is_plant: bool,
}

impl Inner {
    fn now_ns(&self) -> u64 {
        self.world.now_ns()
    }

    /// Whether gripper and wrist can be used.
    fn alive(&self) -> Result<(), SettingError> {
        if self.is_plant {
            return Err(SettingError {
                key: "simulated hand".into(),
                got: "its own gripper or wrist".into(),
                expected: "the one that drives its plant".into(),
            });
        }
        self.world.error().map_or(Ok(()), |error| Err(error.clone()))
    }

    /// Jaws, wrist and world to the next frame.
    fn advance_frame(&mut self) {
        let from = self.world.steps_count();
        for step in 1..=SUBSTEPS_COUNT {
            let to_ns = world::time_ns(from + step);
            self.jaws.advance_to(BEFORE_START_NS + to_ns, self.world.width_mm());
            self.wrist.advance_to(to_ns);
            let wrist = self.wrist.state();
            self.world.press(self.jaws.force_n());
            self.world.place_wrist(wrist.angle_rad, wrist.lowered_mm);
            self.world.advance_to(to_ns);
        }
    }
}

/// A simulated hand; a handle, whose parts are handed out by [`SimHand::camera`], [`SimHand::gripper`] and
/// [`SimHand::wrist`].
#[derive(Debug, Clone)]
pub struct SimHand(Rc<RefCell<Inner>>);

impl SimHand {
    /// The hand of a scene at time 0: the jaws open, the object untouched. Refuses what the object or the contact
    /// cannot be.
    pub fn new(scene: &HandScene) -> Result<Self, SettingError> {
        let world = HandWorld::new(scene)?;
        let cameras = Cameras::new(scene, &world);
        let mut jaws = JawDrive::new(JawSettings::default())?;
        let opening_mm = scene.width_mm() + scene.number("start_mm").unwrap_or(0.0);
        jaws.command(JawCommand::MoveTo { opening_mm });
        jaws.advance_to(BEFORE_START_NS, world.width_mm());
        Ok(SimHand(Rc::new(RefCell::new(Inner {
            world,
            cameras,
            jaws,
            wrist: WristDrive::new(),
            is_plant: false,
            longest_ns: (scene.longest_s() * 1e9) as u64,
        }))))
    }

    /// The camera of a finger: 0 left, 1 right.
    pub fn camera(&self, finger: usize) -> SimCamera {
        SimCamera { hand: Rc::clone(&self.0), finger, delivered: None }
    }

    /// The world between the jaws, for a gripper and a wrist of somebody else: an emulator behind a real wire
    /// protocol. From then on that one lets time pass, in steps of its own; gripper and wrist of this hand refuse,
    /// [`SimHand::advance_frame`] does nothing, and the cameras go on.
    pub fn plant(&self) -> SimPlant {
        self.0.borrow_mut().is_plant = true;
        SimPlant(Rc::clone(&self.0))
    }

    /// The facts of a finger, with the stiffness of its gel.
    pub fn sensor(&self, finger: usize) -> Sensor {
        self.0.borrow().cameras.sensor(finger)
    }

    /// Time since the start, in ns.
    pub fn now_ns(&self) -> u64 {
        self.0.borrow().now_ns()
    }

    /// Whole frames since the start.
    pub fn frame(&self) -> u64 {
        self.0.borrow().world.frame()
    }

    /// Lets 1/30 s pass: jaws, wrist and contact in four steps. Pictures are drawn when a camera is asked for the
    /// first of them. After an error no time passes; cameras, gripper and wrist then say what it was, as
    /// [`SimHand::error`] does.
    pub fn advance_frame(&self) {
        let mut inner = self.0.borrow_mut();
        if !inner.is_plant {
            inner.advance_frame();
        }
    }

    /// What stopped the run; None while it goes on.
    pub fn error(&self) -> Option<SettingError> {
        self.0.borrow().world.error().cloned()
    }

    /// What is true now.
    pub fn truth(&self) -> HandTruth {
        let inner = self.0.borrow();
        let opening_mm = (!inner.is_plant).then(|| inner.jaws.opening_mm());
        HandTruth { opening_mm, ..inner.world.truth().clone() }
    }

    /// Displacement of every marker of a finger in its own frame, in mm; empty where there is no camera.
    pub fn marker_shifts_mm(&self, finger: usize) -> Vec<Vec2> {
        let Inner { world, cameras, .. } = &mut *self.0.borrow_mut();
        cameras.marker_shifts_mm(finger, world)
    }
}

/// The world of a [`SimHand`] as a [`Plant`].
#[derive(Debug, Clone)]
pub struct SimPlant(Rc<RefCell<Inner>>);

impl Plant for SimPlant {
    fn width_mm(&self) -> Option<f64> {
        self.0.borrow().world.width_mm()
    }

    fn press(&mut self, force_n: f64) {
        self.0.borrow_mut().world.press(force_n);
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.0.borrow_mut().world.place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.0.borrow_mut().world.advance_to(now_ns);
    }
}

/// The camera of a finger of a [`SimHand`]: the frame of the present time, once; silence until time has passed; the
/// end after the scene's `longest_s`.
#[derive(Debug, Clone)]
pub struct SimCamera {
    hand: Rc<RefCell<Inner>>,
    finger: usize,
    delivered: Option<u64>,
}

impl FrameSource for SimCamera {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Inner { world, cameras, longest_ns, .. } = &mut *self.hand.borrow_mut();
        if let Some(error) = world.error() {
            return Err(error.clone().into());
        }
        if world.now_ns() > *longest_ns {
            return Ok(Next::End);
        }
        let frame = world.frame();
        if self.delivered == Some(frame) {
            return Ok(Next::Silent);
        }
        cameras.draw(frame, world);
        cameras.deliver(self.finger, into)?;
        self.delivered = Some(frame);
        Ok(Next::Frame)
    }
}
