//! From the address of a gripper to its driver.

use super::config::{Config, Kind};
use super::driver::Driver;
use super::error::Error;
use super::protocol::Protocol;
use super::{dry, gcl, line, robotiq, wsg50};
use crate::link::{Connector, TcpConnector};
use std::path::Path;
use std::sync::Arc;

/// The driver for an address without its link, for callers that move the bytes in another way; connects nothing.
pub fn driver(address: &str, config: Option<&Path>) -> Result<Driver, Error> {
    Ok(resolve(address, config)?.0)
}

/// A driver, and how its link is made (None for `dry`).
pub(super) type Resolved = (Driver, Option<Arc<dyn Connector>>);

/// The driver and the link that an address with its settings names.
pub(super) fn resolve(address: &str, file: Option<&Path>) -> Result<Resolved, Error> {
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
    let is_serial = kind == Kind::Robotiq && rest.starts_with('/');
    let protocol: Box<dyn Protocol> = match kind {
        Kind::Wsg50 => Box::new(wsg50::Wsg50::default()),
        Kind::Gcl => Box::new(gcl::Gcl::default()),
        Kind::Robotiq if is_serial => Box::new(robotiq::Serial::default()),
        Kind::Robotiq => Box::new(robotiq::Socket::default()),
        Kind::Line => Box::new(line::LineGripper::default()),
        Kind::Dry => Box::new(dry::Dry),
    };
    let connector: Option<Arc<dyn Connector>> = match kind {
        Kind::Dry => None,
        Kind::Robotiq if is_serial => Some(serial(rest, wrong)?),
        _ => match TcpConnector::new(rest) {
            Some(connector) => Some(Arc::new(connector)),
            None => return Err(wrong(&format!("expected HOST:PORT, got `{rest}`"))),
        },
    };
    Ok((Driver::new(place, config, protocol), connector))
}

#[cfg(feature = "serial")]
fn serial(device: &str, _wrong: impl Fn(&str) -> Error) -> Result<Arc<dyn Connector>, Error> {
    Ok(Arc::new(crate::link::SerialConnector { device: device.into() }))
}

#[cfg(not(feature = "serial"))]
fn serial(_device: &str, wrong: impl Fn(&str) -> Error) -> Result<Arc<dyn Connector>, Error> {
    Err(wrong("this build has no serial lines (feature `serial`)"))
}
