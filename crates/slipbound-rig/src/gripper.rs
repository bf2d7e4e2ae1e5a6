//! Parallel grippers by their own protocols.
//!
//! | address | gripper | protocol |
//! |---|---|---|
//! | `wsg50://HOST:1000` | Weiss WSG-50, binary interface | [`wsg50`] |
//! | `gcl://HOST:PORT` | Weiss WSG-50, text interface | [`gcl`] |
//! | `robotiq:///dev/ttyUSB0` | Robotiq 2F-85, Modbus RTU | [`robotiq`] |
//! | `robotiq://HOST:63352` | Robotiq 2F-85 behind a UR controller | [`robotiq`] |
//! | `line://HOST:PORT` | whatever answers the line protocol (docs/grippers.md) | [`mod@line`] |
//! | `dry` | none: takes every command, moves nothing | [`dry`] |
//!
//! Settings may follow the address: `wsg50://192.168.1.20:1000?part_width_mm=28&most_n=40`. Newtons are per finger. A
//! [`Driver`] is a state machine around a [`Protocol`] and receives the time as an argument; a [`Device`] is a driver
//! on a socket or a serial line. No call waits for the jaws; bytes are sent and received in `poll` and `poll_io`, so
//! one of them must be called every few ms. On any failure the gripper keeps its force.
//!
//! ```
//! use slipbound::port::{GripCommand, Gripper};
//!
//! let mut gripper = slipbound_rig::gripper::open("dry?most_n=40", None)?;
//! gripper.command(GripCommand::Hold { force_n: 55.0 })?;
//! assert_eq!(gripper.poll()?.target_n, Some(40.0)); // kept inside its range
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```
//!
//! If you already have a driver for your gripper, implement [`Gripper`](slipbound::port::Gripper), whose page shows
//! how.

mod address;
pub mod check_hold;
mod clamp;
pub mod config;
mod device;
mod driver;
mod driver_state;
pub mod dry;
mod error;
pub mod gcl;
mod goal;
mod grasp_tracker;
pub mod line;
mod protocol;
mod request;
pub mod robotiq;
mod session;
mod settle_detector;
pub mod wsg50;

pub use address::driver;
pub use clamp::clamp_to_gripper;
pub use config::Config;
pub use device::{Device, open};
pub use driver::Driver;
pub use driver_state::DriverState;
pub use error::Error;
pub use protocol::Protocol;
pub use request::Request;
pub use session::{Session, SessionError};
pub use settle_detector::{SettleDetector, describe};
