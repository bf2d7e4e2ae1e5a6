//! From the address of a wrist to its driver.

use super::device::Device;
use super::dry::Dry;
use super::error::Error;
use super::line::LineWrist;
use crate::link::{Connector, TcpConnector};
use slipbound::port::Wrist;
use std::sync::Arc;

/// Opens a wrist: connects, moves nothing. Waits a few seconds at most for the first valid message.
pub fn open(address: &str) -> Result<Box<dyn Wrist + Send>, Error> {
    if address == "dry" {
        return Ok(Box::new(Dry::default()));
    }
    let connector = address.strip_prefix("line://").and_then(TcpConnector::new);
    let connector = connector.ok_or_else(|| Error::Address { address: address.into() })?;
    let link = connector.connect().map_err(|source| Error::Connect { address: address.into(), source })?;
    let mut device = Device::with_link(LineWrist::new(address), Some(link), Some(Arc::new(connector)));
    device.await_first_state()?;
    Ok(Box::new(device))
}
