//! Robotiq 2F-85: Modbus RTU on a serial line ([`Serial`]), and the text socket of a UR controller that has the gripper
//! at its tool ([`Socket`]).
//!
//! The gripper knows force only as a number from 0 to 255 and measures none. What that number is in newtons has no
//! primary source: `force_table` of the settings says it, and should be measured. Whether a new force reaches jaws
//! that already hold is not confirmed either.

mod actuator;
pub mod rtu;
mod serial;
mod socket;
pub(crate) mod status;

pub use serial::Serial;
pub use socket::Socket;
