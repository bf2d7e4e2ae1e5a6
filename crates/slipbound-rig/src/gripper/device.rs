//! A driver on a socket or a serial line: the part that reads the clock.

use super::address::{Resolved, resolve};
use super::config::Config;
use super::driver::Driver;
use super::error::Error;
use super::request::Request;
use crate::link::{Connection, Connector, Endpoint, Link, now_ns};
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperError, GripperState};
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Longest wait for the first complete state, ns: of a silent gripper, and of one that answers late. Robotiq's state
/// takes six questions, each of which may take the reply time.
const FIRST_STATE_NS: u64 = 2_000_000_000;
const LATE_STATE_NS: u64 = 5_000_000_000;

/// Longest wait for the farewell to be sent, ns.
const FAREWELL_NS: u64 = 100_000_000;

/// Opens a gripper: connects, asks for its state, moves nothing. `config`: a TOML file of settings. Waits a few seconds
/// at most for the first valid message; afterwards no call waits.
pub fn open(address: &str, config: Option<&Path>) -> Result<Box<dyn Gripper + Send>, Error> {
    Ok(Box::new(Device::open(address, config)?))
}

/// A gripper on a link. A lost link is reconnected; an object that is held stays held.
pub struct Device {
    address: String,
    driver: Driver,
    connection: Connection,
}

impl Device {
    /// Opens a gripper as [`open`] does.
    pub fn open(address: &str, config: Option<&Path>) -> Result<Self, Error> {
        let (driver, connector): Resolved = resolve(address, config)?;
        let link = connector.as_ref().map(|connector| connector.connect()).transpose();
        let address = address.split('?').next().unwrap_or(address);
        let link = link.map_err(|source| Error::Connect { address: address.into(), source })?;
        let mut device = Device::with_link(address, driver, link, connector);
        device.await_first_state()?;
        Ok(device)
    }

    /// A driver on a link that is already up; with a connector it is reconnected when it is lost.
    pub fn with_link(
        address: &str,
        mut driver: Driver,
        link: Option<Box<dyn Link>>,
        connector: Option<Arc<dyn Connector>>,
    ) -> Self {
        if link.is_some() {
            driver.linked(now_ns());
        }
        Device { address: address.into(), driver, connection: Connection::new(link, connector) }
    }

    fn await_first_state(&mut self) -> Result<(), Error> {
        let from_ns = now_ns();
        loop {
            self.poll_io();
            let waited_ns = now_ns() - from_ns;
            match self.driver.state(now_ns()) {
                Ok(_) if !self.driver.is_busy() => return Ok(()),
                Err(error) if waited_ns > FIRST_STATE_NS => return Err(error),
                Ok(_) if waited_ns > LATE_STATE_NS => {
                    let (address, expected_ms) = (self.address.clone(), LATE_STATE_NS / 1_000_000);
                    return Err(Error::Unanswered { address, command: "what is your state", expected_ms });
                }
                _ => thread::sleep(Duration::from_millis(1)),
            }
        }
    }

    /// Accepts a request. Does not wait for the jaws; an error means that it was not accepted.
    pub fn request(&mut self, request: Request) -> Result<(), Error> {
        self.poll_io();
        let taken = self.driver.request(now_ns(), request);
        self.connection.send(now_ns(), &mut self.driver);
        taken
    }

    /// The newest state.
    pub fn state(&mut self) -> Result<GripperState, Error> {
        self.poll_io();
        let state = self.driver.state(now_ns());
        if matches!(state, Err(Error::Silent { .. } | Error::Unread { .. })) {
            self.give_up_silent_link();
        }
        state
    }

    /// Its settings.
    pub fn config(&self) -> &Config {
        self.driver.config()
    }

    /// Permits lowering the force while an object is held, whatever the settings say.
    pub fn permit_lowering(&mut self, permitted: bool) {
        self.driver.permit_lowering(permitted);
    }

    /// Gives up a silent link, after a farewell, which may still arrive.
    fn give_up_silent_link(&mut self) {
        if !self.connection.reconnects() || !self.connection.is_up() {
            return;
        }
        let now_ns = now_ns();
        let _ = self.driver.request(now_ns, Request::Leave); // only its bytes matter: no answer will be read
        self.connection.send(now_ns, &mut self.driver);
        self.connection.give_up(now_ns, &mut self.driver, "nothing came through it");
    }
}

impl Gripper for Device {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        Ok(self.request(Request::Grip(command))?)
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        Ok(self.state()?)
    }

    fn poll_io(&mut self) {
        self.connection.poll_io(now_ns(), &mut self.driver);
    }

    fn is_busy(&self) -> bool {
        self.driver.is_busy()
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.driver.next_event()
    }
}

/// Sends a farewell, so that no fast stop latches. The gripper keeps its force.
impl Drop for Device {
    fn drop(&mut self) {
        if self.connection.is_up() && self.driver.request(now_ns(), Request::Leave).is_ok() {
            self.connection.flush(&mut self.driver, FAREWELL_NS);
        }
    }
}
