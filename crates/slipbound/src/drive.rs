//! How the jaws of a gripper and a wrist move when they are commanded: pure state, told the time. The simulator and
//! every emulator move by these, so that a loop closes alike through either.

mod jaws;
mod wrist;

pub use jaws::{JawCommand, JawDrive, JawSettings};
pub use wrist::WristDrive;
