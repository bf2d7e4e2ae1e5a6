//! A driver at a socket or a serial line: the thin end that knows the clock.

use super::{Driver, Error, Request, parts};
use crate::link::{Dial, Link, Wire, now_ns};
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperError, GripperState};
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Longest wait for the first whole state, ns.
const FIRST_STATE_NS: u64 = 2_000_000_000;

/// Longest wait for the farewell to be sent, ns.
const FAREWELL_NS: u64 = 100_000_000;

/// A gripper that is there. A lost link is made anew; what is held stays held.
pub struct Device {
    address: String,
    driver: Box<dyn Driver>,
    wire: Wire,
}

impl Device {
    /// Opens a gripper as [`super::open`] does.
    pub fn open(address: &str, config: Option<&Path>) -> Result<Self, Error> {
        let (driver, dial) = parts(address, config)?;
        let link = dial.as_ref().map(|dial| dial.dial()).transpose();
        let address = address.split('?').next().unwrap_or(address);
        let link = link.map_err(|source| Error::Connect { address: address.into(), source })?;
        let mut device = Device::with_link(address, driver, link, dial);
        device.await_first_state()?;
        Ok(device)
    }

    /// A driver at a link that is already there; with `dial` it is made anew when it is lost.
    pub fn with_link(
        address: &str,
        mut driver: Box<dyn Driver>,
        link: Option<Box<dyn Link>>,
        dial: Option<Arc<dyn Dial>>,
    ) -> Self {
        if link.is_some() {
            driver.linked(now_ns());
        }
        Device { address: address.into(), driver, wire: Wire::new(link, dial) }
    }

    fn await_first_state(&mut self) -> Result<(), Error> {
        let from_ns = now_ns();
        loop {
            self.pump();
            let is_late = now_ns() - from_ns > FIRST_STATE_NS;
            match self.driver.state(now_ns()) {
                Ok(_) if !self.driver.is_busy() => return Ok(()),
                Err(error) if is_late => return Err(error),
                Ok(_) if is_late => {
                    let (address, expected_ms) = (self.address.clone(), FIRST_STATE_NS / 1_000_000);
                    return Err(Error::Unanswered { address, command: "what is your state", expected_ms });
                }
                _ => thread::sleep(Duration::from_millis(1)),
            }
        }
    }

    fn pump(&mut self) {
        self.wire.pump(now_ns(), self.driver.as_mut());
    }

    /// Takes over an order. Does not wait for the jaws; an error means that it was not taken over.
    pub fn order(&mut self, order: Request) -> Result<(), Error> {
        self.pump();
        let taken = self.driver.order(now_ns(), order);
        self.wire.send(now_ns(), self.driver.as_mut());
        taken
    }

    /// The newest state.
    pub fn state(&mut self) -> Result<GripperState, Error> {
        self.pump();
        let state = self.driver.state(now_ns());
        if matches!(state, Err(Error::Silent { .. })) {
            self.give_up();
        }
        state
    }

    /// Whether an order is still under way.
    pub fn is_busy(&self) -> bool {
        self.driver.is_busy()
    }

    /// The next thing worth writing down.
    pub fn next_event(&mut self) -> Option<DriverEvent> {
        self.driver.next_event()
    }

    /// Permits lower forces while something is held, whatever the settings say.
    pub fn permit_lowering(&mut self, permitted: bool) {
        self.driver.permit_lowering(permitted);
    }

    /// Gives up a link through which nothing comes, not without a farewell: it may yet arrive.
    fn give_up(&mut self) {
        if !self.wire.is_kept() || !self.wire.is_linked() {
            return;
        }
        let now_ns = now_ns();
        let _ = self.driver.order(now_ns, Request::Leave); // the bytes count; an answer is not to be had
        self.wire.send(now_ns, self.driver.as_mut());
        self.wire.lose(now_ns, self.driver.as_mut(), "nothing came through it");
    }
}

impl Gripper for Device {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        Ok(self.order(Request::Grip(command))?)
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        Ok(self.state()?)
    }

    fn poll_io(&mut self) {
        self.pump();
    }
}

/// Leaves with a farewell, so that no fast stop latches. The gripper keeps its force.
impl Drop for Device {
    fn drop(&mut self) {
        let from_ns = now_ns();
        if !self.wire.is_linked() || self.driver.order(from_ns, Request::Leave).is_err() {
            return;
        }
        while self.wire.is_linked() && !self.driver.outgoing().is_empty() && now_ns() - from_ns < FAREWELL_NS {
            self.wire.send(now_ns(), self.driver.as_mut());
            thread::sleep(Duration::from_millis(1));
        }
    }
}
