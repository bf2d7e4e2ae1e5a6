//! The plant: what is between the jaws and how it answers to being pressed, turned and lowered; how jaws and wrist move
//! when they are commanded; and what is true in a cycle where a simulation knows it. Pure state, told the time: the
//! simulator and every emulator move by these models, so that a loop closes alike through either.

mod jaws;
mod truth;
mod wrist;

pub use jaws::{JawCommand, JawDrive, JawSettings};
pub use truth::PlantTruth;
pub use wrist::WristDrive;

/// What is between the jaws: the simulated world, or a block of wood for trying a driver. Whoever plays the gripper
/// and the wrist (the simulator's own, or an emulator behind a real wire protocol) presses and moves it, then lets
/// time pass.
pub trait Plant {
    /// Opening at which the fingertips touch the object, in mm; None when nothing is there.
    fn width_mm(&self) -> Option<f64>;

    /// Normal force per finger from now on, in newtons; 0 when the jaws are off the object.
    fn press(&mut self, force_n: f64);

    /// Where the wrist is from now on: angle about the axis along the fingers since the start in rad, distance
    /// lowered since the start in mm.
    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64);

    /// Lets time pass up to `now_ns` nanoseconds since the start. Time never goes back.
    fn advance_to(&mut self, now_ns: u64);
}
