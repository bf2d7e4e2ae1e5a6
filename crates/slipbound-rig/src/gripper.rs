//! Parallel grippers by their own protocols.
//!
//! | address | gripper | driver |
//! |---|---|---|
//! | `wsg50://HOST:1000` | Weiss WSG-50, binary interface | [`wsg50`] |
//! | `gcl://HOST:PORT` | Weiss WSG-50, text interface | [`gcl`] |
//! | `robotiq:///dev/ttyUSB0` | Robotiq 2F-85, Modbus RTU | [`robotiq`] |
//! | `robotiq://HOST:63352` | Robotiq 2F-85 behind a UR controller | [`robotiq`] |
//! | `line://HOST:PORT` | whatever answers the line protocol (docs/grippers.md) | [`mod@line`] |
//! | `dry` | none: takes every command, moves nothing | [`dry`] |
//!
//! Settings may follow the address: `wsg50://192.168.1.20:1000?part_width_mm=28&most_n=40`. Newtons are per finger.
//! A driver is a state machine told the time; [`Device`] is its thin end at a socket or a serial line. No call waits
//! for the jaws; `poll` carries the bytes, so it is to be called every few ms. Whatever breaks, the gripper is left with the force it has.
//!
//! ```
//! use slipbound::port::{GripCommand, Gripper};
//!
//! let mut gripper = slipbound_rig::gripper::open("dry?most_n=40", None)?;
//! gripper.command(GripCommand::Hold { force_n: 55.0 })?;
//! assert_eq!(gripper.poll()?.target_n, Some(40.0)); // kept inside its range
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```

pub mod check_hold;
pub mod config;
mod device;
mod driver;
pub mod dry;
mod error;
pub mod gcl;
mod ledger;
pub mod line;
pub mod robotiq;
pub(crate) mod text;
pub mod wsg50;

pub use config::Config;
pub use device::Device;
pub use driver::{Driver, Request};
pub use error::Error;

use crate::link::{Dial, TcpDial};
use config::Kind;
use slipbound::port::Gripper;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Longest wait for a connection.
const CONNECT_WAIT: Duration = Duration::from_secs(2);

/// Opens a gripper: connects, asks for its state, moves nothing. `config`: a TOML file of settings. Waits at most some
/// seconds for the first sign of life; afterwards no call waits.
pub fn open(address: &str, config: Option<&Path>) -> Result<Box<dyn Gripper + Send>, Error> {
    Ok(Box::new(Device::open(address, config)?))
}

/// The driver of an address without its link, for whoever carries the bytes in another way; connects nothing.
pub fn driver(address: &str, config: Option<&Path>) -> Result<Box<dyn Driver>, Error> {
    Ok(parts(address, config)?.0)
}

/// What speaks, and how its link is made (not at all for `dry`).
type Parts = (Box<dyn Driver>, Option<Arc<dyn Dial>>);

/// An address taken apart.
fn parts(address: &str, file: Option<&Path>) -> Result<Parts, Error> {
    let (place, query) = address.split_once('?').unwrap_or((address, ""));
    let wrong = |why: &str| Error::Address { address: address.into(), why: why.into() };
    let (scheme, rest) = match place.split_once("://") {
        Some(parts) => parts,
        None if place == "dry" => ("dry", ""),
        None => return Err(wrong("there is no `://` in it")),
    };
    let kind = match scheme {
        "wsg50" => Kind::Wsg50,
        "gcl" => Kind::Gcl,
        "robotiq" => Kind::Robotiq,
        "line" => Kind::Line,
        "dry" => Kind::Dry,
        other => return Err(wrong(&format!("got the protocol `{other}`"))),
    };
    let config = Config::load(kind, file, address, query)?;
    if kind == Kind::Dry {
        return Ok((Box::new(dry::Dry::new(place, config)), None));
    }
    if kind == Kind::Robotiq && rest.starts_with('/') {
        return Ok((Box::new(robotiq::Serial::new(place, config)), Some(serial(rest, wrong)?)));
    }
    let has_port = rest.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    if !has_port {
        return Err(wrong(&format!("expected HOST:PORT, got `{rest}`")));
    }
    let driver: Box<dyn Driver> = match kind {
        Kind::Wsg50 => Box::new(wsg50::Wsg50::new(place, config)),
        Kind::Gcl => Box::new(gcl::Gcl::new(place, config)),
        Kind::Robotiq => Box::new(robotiq::Socket::new(place, config)),
        Kind::Line | Kind::Dry => Box::new(line::LineGripper::new(place, config)),
    };
    Ok((driver, Some(Arc::new(TcpDial { authority: rest.into(), timeout: CONNECT_WAIT }))))
}

#[cfg(feature = "serial")]
fn serial(device: &str, _wrong: impl Fn(&str) -> Error) -> Result<Arc<dyn Dial>, Error> {
    Ok(Arc::new(crate::link::SerialDial { device: device.into() }))
}

#[cfg(not(feature = "serial"))]
fn serial(_device: &str, wrong: impl Fn(&str) -> Error) -> Result<Arc<dyn Dial>, Error> {
    Err(wrong("this build has no serial lines (feature `serial`)"))
}
