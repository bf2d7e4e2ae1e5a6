//! A Robotiq 2F-85: by Modbus RTU ([`Serial`]), or by the text socket of a UR controller ([`Socket`]).

mod gripper;
mod serial;
mod socket;

pub use serial::Serial;
pub use socket::Socket;
