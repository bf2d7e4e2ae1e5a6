//! The held object beyond its contact with the pads: a cap in its thread, a bottle that fills, a tool over the ground.
//!
//! ```text
//!   hand (wrist angle, lowered, force) --> HeldObject::contact_input --> drive, pose, roll, wrench --> Finger::step
//!                                          HeldObject::after_step <----- where the object went, what the pads carry
//! ```
//!
//! One of two identical fingers is computed, the left one; all planes and signs here are in its frame: x down along the
//! finger, y = -Y of the hand, z = -Z, into its gel. The right finger has the same contact or its mirror image, see
//! [`Symmetry`].

mod bottle;
mod cap;
mod ground;
mod held;
mod support;
mod truth;

pub use bottle::{Bottle, BottleSettings, PullPulse};
pub use cap::{Cap, Thread};
pub use ground::{Tool, ToolSettings};
pub(crate) use held::FINGERS_COUNT;
pub use held::{ContactInput, HandState, HeldObject, Symmetry};
pub use truth::{BottleTruth, CapTruth, GroundTruth, ObjectTruth};
