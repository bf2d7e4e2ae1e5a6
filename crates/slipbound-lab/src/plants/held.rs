//! Interface of every held object: its permitted motion, its external load, its ground truth.

use super::truth::ObjectTruth;
use crate::contact::{Drive, Pose, Truth, Wrench};
use slipbound::plane::Vec2;

/// How many fingers hold the object.
pub(crate) const FINGERS_COUNT: u32 = 2;

/// Relation of the right finger's contact, in its own frame, to the left one's in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// The same: the object turns about the axis along the fingers, so its two sides move in opposite directions.
    Same,
    /// The mirror image, y for -y: the object moves as a whole across the pads or turns about the closing direction.
    Mirrored,
}

/// Pose of the hand and its force, at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandState {
    /// Angle of the wrist about the axis along the fingers since the start, in rad, positive from Y to Z.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Normal force per finger, in N.
    pub force_n: f64,
}

/// Input of the object to the contact in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactInput {
    /// Determines the motion of the object.
    pub drive: Drive,
    /// Commanded pose.
    pub pose: Pose,
    /// Offset of its lowest point from its reference point, in mm.
    pub roll_mm: Vec2,
    /// External load on it, in addition to the pads.
    pub wrench: Wrench,
}

impl ContactInput {
    /// An object that is guided to a pose and carries no load.
    pub const fn guided(pose: Pose) -> Self {
        let wrench = Wrench { force_n: Vec2::ZERO, torque_n_mm: 0.0 };
        ContactInput { drive: Drive::Guided, pose, roll_mm: Vec2::ZERO, wrench }
    }
}

/// A held object. `Send`, so that a hand can be owned by any thread.
pub trait HeldObject: std::fmt::Debug + Send {
    /// Its pose before the first contact.
    fn start_pose(&self) -> Pose;

    /// Relation of the right finger's contact to the left one's.
    fn symmetry(&self) -> Symmetry;

    /// Its input to the contact in a step of `step_s` seconds, starting from the state after the last step.
    fn contact_input(&mut self, contact: &Truth, hand: HandState, step_s: f64) -> ContactInput;

    /// Takes the result of the step. `slid_mm` is the total sliding distance of the object over the pads.
    fn after_step(&mut self, contact: &Truth, hand: HandState, step_s: f64, slid_mm: f64);

    /// Whether it is no longer between the fingers.
    fn is_gone(&self) -> bool {
        false
    }

    /// Its ground truth.
    fn truth(&self) -> ObjectTruth;
}
