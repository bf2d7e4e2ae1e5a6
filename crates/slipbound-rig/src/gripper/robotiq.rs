//! Robotiq 2F-85: Modbus RTU on a serial line ([`Serial`]), and the text socket of a UR controller that has the gripper
//! at its tool ([`Socket`]).
//!
//! The gripper takes force as a number from 0 to 255 and measures none. No primary source gives that number in newtons:
//! the setting `force_table` does, and should be measured. It is not confirmed either whether a new force reaches jaws
//! that already hold.

mod actuator;
pub mod rtu;
mod serial;
mod socket;
pub(crate) mod status;

pub use serial::Serial;
pub use socket::Socket;
