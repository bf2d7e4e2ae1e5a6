//! The arm behind the hand, by the line protocol (docs/grippers.md): `line://HOST:PORT`, or `dry` for none.
//!
//! Every motion is bounded by an angle or a distance and by a time to live, which the wrist itself keeps: when
//! nothing more comes, it pauses. No call waits.

mod device;
mod error;
mod line;

pub use device::{Device, Dry};
pub use error::Error;
pub use line::LineWrist;

use crate::link::{Dial, TcpDial};
use slipbound::port::Wrist;
use std::sync::Arc;
use std::time::Duration;

/// Longest wait for a connection.
const CONNECT_WAIT: Duration = Duration::from_secs(2);

/// Opens a wrist: connects, moves nothing. Waits at most some seconds for the first sign of life.
pub fn open(address: &str) -> Result<Box<dyn Wrist + Send>, Error> {
    if address == "dry" {
        return Ok(Box::new(Dry::default()));
    }
    let wrong = || Error::Address { address: address.into() };
    let authority = address.strip_prefix("line://").ok_or_else(wrong)?;
    let (host, port) = authority.rsplit_once(':').ok_or_else(wrong)?;
    if host.is_empty() || port.parse::<u16>().is_err() {
        return Err(wrong());
    }
    let dial = TcpDial { authority: authority.into(), timeout: CONNECT_WAIT };
    let link = dial.dial().map_err(|source| Error::Connect { address: address.into(), source })?;
    let mut device = Device::with_link(LineWrist::new(address), Some(link), Some(Arc::new(dial)));
    device.await_first_state()?;
    Ok(Box::new(device))
}
