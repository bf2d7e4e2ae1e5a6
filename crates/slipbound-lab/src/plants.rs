//! What a hand holds, beyond its touch on the pads: a cap in its thread, a bottle that fills, a tool over the ground.
//!
//! ```text
//!   hand (wrist angle, lowered, force) --> Held::ask --> drive, pose, roll, wrench --> Finger::step
//!                                          Held::took <-- where the object went, what the pads carry
//! ```
//!
//! One of two identical fingers is computed, the left one; all planes and signs here are those of its frame: x down
//! along the finger, y = -Y of the hand, z = -Z, into its gel. The right finger feels the same or the mirror image,
//! see [`Symmetry`].

mod bottle;
mod cap;
mod ground;

pub use bottle::{Bottle, BottleSettings, BottleTruth, Jerk};
pub use cap::{Cap, CapTruth, Thread};
pub use ground::{GroundTruth, Tool, ToolSettings};

use crate::contact::{Drive, Pose, Truth, Wrench};
use crate::hand::HandTruth;
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
pub struct HandPlace {
    /// Angle of the wrist about the axis along the fingers since the start, in rad, positive from Y to Z.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Normal force per finger, in N.
    pub force_n: f64,
}

/// What is asked of the contact in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ask {
    /// What decides where the object goes.
    pub drive: Drive,
    /// Where it is guided to.
    pub pose: Pose,
    /// How far its lowest point is from its reference point, in mm.
    pub roll_mm: Vec2,
    /// What pulls at it, besides the pads.
    pub wrench: Wrench,
}

/// Something that a hand holds.
pub trait Held: std::fmt::Debug {
    /// Where it is before anything touches it.
    fn start(&self) -> Pose;

    /// What the right finger feels.
    fn symmetry(&self) -> Symmetry;

    /// What is asked of the contact in a step of `step_s` seconds, from where the last one left it.
    fn ask(&mut self, contact: &Truth, hand: HandPlace, step_s: f64) -> Ask;

    /// Takes note of the step. `slid_mm` is how far the object has slid over the pads in all.
    fn took(&mut self, contact: &Truth, hand: HandPlace, step_s: f64, slid_mm: f64);

    /// Whether it is no longer between the fingers.
    fn is_gone(&self) -> bool {
        false
    }

    /// Adds what is true of it.
    fn tell(&self, truth: &mut HandTruth);
}
