//! Emulated grippers and an emulated wrist: the device side of the real protocols, moved by [`JawDrive`] and
//! [`WristDrive`], with any [`Plant`] between the jaws. Like the drivers, they are state machines that receive the time
//! as an argument.
//!
//! | name | firmware | protocol |
//! |---|---|---|
//! | `wsg50` | [`wsg50::Wsg50`] | WSG-50 binary interface |
//! | `gcl` | [`gcl::Gcl`] | WSG-50 text interface |
//! | `robotiq-rtu` | [`robotiq::Serial`] | Robotiq 2F-85, Modbus RTU |
//! | `robotiq` | [`robotiq::Socket`] | Robotiq 2F-85 behind a UR controller |
//! | `line` | [`line::Line`] | the line protocol, gripper and wrist |
//!
//! They can be made to fail ([`Faults`]). They keep holding an object when the link is cut.
//!
//! [`JawDrive`]: slipbound::plant::JawDrive
//! [`Plant`]: slipbound::plant::Plant
//! [`WristDrive`]: slipbound::plant::WristDrive

mod block;
mod block_log;
mod camera_server;
mod emulated;
mod fault;
pub mod faults;
mod firmware;
mod force_sensor;
pub mod gcl;
mod jaws;
pub mod line;
mod lockstep_pair;
mod names;
mod paced_drive;
pub mod robotiq;
mod server;
mod weiss;
pub mod wsg50;

pub use block::Block;
pub use block_log::LoggedBlock;
pub use camera_server::CameraServer;
pub use emulated::Emulator;
pub use fault::Fault;
pub use faults::Faults;
pub use firmware::Firmware;
pub use force_sensor::SensorFaults;
pub use jaws::EmulatedJaws;
pub use lockstep_pair::{LockstepPair, OnlyMoved};
pub use names::{NAMES, by_name};
pub use server::{Server, serve_link, serve_tcp};
