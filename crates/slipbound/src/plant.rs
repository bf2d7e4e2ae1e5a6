//! The plant: the object between the jaws and its response to being pressed, turned and lowered; the motion of jaws and
//! wrist on command; and the ground truth of a cycle. Pure state; the time is an argument. The simulator and every
//! emulator use these models, so that closed loops behave the same with either.

mod jaws;
mod truth;
mod wrist;

pub use jaws::{JawCommand, JawDrive, JawSettings};
pub use truth::PlantTruth;
pub use wrist::WristDrive;

/// Standard acceleration of gravity, m/s2 (ISO 80000-3): the weight of an object in N over its mass in kg.
pub const GRAVITY_M_PER_S2: f64 = 9.80665;

/// The object between the jaws: the simulated world, or a rigid block for testing a driver. The simulated gripper and
/// wrist (the simulator's own, or an emulator with the real wire protocol) press and move it, then advance the time.
pub trait Plant {
    /// Opening at which the fingertips touch the object, in mm; None when nothing is there.
    fn width_mm(&self) -> Option<f64>;

    /// Normal force per finger from now on, in newtons; 0 when the jaws are off the object.
    fn press(&mut self, force_n: f64);

    /// Where the wrist is from now on: angle about the axis along the fingers since the start in rad, distance
    /// lowered since the start in mm.
    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64);

    /// Advances the time to `now_ns` nanoseconds since the start, which must not decrease.
    fn advance_to(&mut self, now_ns: u64);
}
