//! What every held object answers to: where it may move, what pulls at it, what is true of it.

use super::truth::ObjectTruth;
use crate::contact::{Drive, Pose, Truth, Wrench};
use slipbound::plane::Vec2;

/// How many fingers hold the object.
pub(crate) const FINGERS_COUNT: u32 = 2;

/// What the right finger feels, in its own frame, against what the left one feels in its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// The same: the object turns about the axis along the fingers, so its two sides go opposite ways.
    Same,
    /// The mirror image, y for -y: the object moves as a whole across the pads or turns about the closing direction.
    Mirrored,
}

/// Where the hand is and how hard it presses, at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandState {
    /// Angle of the wrist about the axis along the fingers since the start, in rad, positive from Y to Z.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Normal force per finger, in N.
    pub force_n: f64,
}

/// What the object puts into the contact in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactInput {
    /// What decides where the object goes.
    pub drive: Drive,
    /// Where it is guided to.
    pub pose: Pose,
    /// How far its lowest point is from its reference point, in mm.
    pub roll_mm: Vec2,
    /// External load on it, besides the pads.
    pub wrench: Wrench,
}

impl ContactInput {
    /// An object that is guided to a pose and carries no load.
    pub const fn guided(pose: Pose) -> Self {
        let wrench = Wrench { force_n: Vec2::ZERO, torque_n_mm: 0.0 };
        ContactInput { drive: Drive::Guided, pose, roll_mm: Vec2::ZERO, wrench }
    }
}

/// Something that a hand holds. `Send`, so that a hand can be owned by any thread.
pub trait HeldObject: std::fmt::Debug + Send {
    /// Where it is before anything touches it.
    fn start_pose(&self) -> Pose;

    /// What the right finger feels.
    fn symmetry(&self) -> Symmetry;

    /// What it puts into the contact in a step of `step_s` seconds, from where the last one left it.
    fn contact_input(&mut self, contact: &Truth, hand: HandState, step_s: f64) -> ContactInput;

    /// Takes over the result of the step. `slid_mm` is how far the object has slid over the pads in all.
    fn after_step(&mut self, contact: &Truth, hand: HandState, step_s: f64, slid_mm: f64);

    /// Whether it is no longer between the fingers.
    fn is_gone(&self) -> bool {
        false
    }

    /// What is true of it.
    fn truth(&self) -> ObjectTruth;
}
