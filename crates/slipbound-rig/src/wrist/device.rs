//! A wrist's driver on a socket: the part that reads the clock.

use super::error::Error;
use super::line::LineWrist;
use crate::link::{Connection, Connector, Endpoint, Link, now_ns};
use slipbound::port::{Wrist, WristCommand, WristError, WristMotion, WristState};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Longest wait for the first state, ns.
const FIRST_STATE_NS: u64 = 2_000_000_000;

/// Longest wait for the last pause to be sent, ns.
const FAREWELL_NS: u64 = 50_000_000;

/// A wrist on a link. A lost link is reconnected; the wrist pauses by itself meanwhile.
pub struct Device {
    driver: LineWrist,
    connection: Connection,
}

impl Device {
    /// A driver on a link that is already up; with a connector it is reconnected when it is lost.
    pub fn with_link(
        mut driver: LineWrist,
        link: Option<Box<dyn Link>>,
        connector: Option<Arc<dyn Connector>>,
    ) -> Self {
        if link.is_some() {
            driver.linked(now_ns());
        }
        Device { driver, connection: Connection::new(link, connector) }
    }

    pub(super) fn await_first_state(&mut self) -> Result<(), Error> {
        let from_ns = now_ns();
        loop {
            self.poll_io();
            match self.driver.report(now_ns()) {
                Ok(_) if self.driver.is_stated() => return Ok(()),
                Err(error) if now_ns() - from_ns > FIRST_STATE_NS => return Err(error),
                _ => thread::sleep(Duration::from_millis(1)),
            }
        }
    }
}

impl Wrist for Device {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.poll_io();
        let taken = self.driver.command(now_ns(), command);
        self.connection.send(now_ns(), &mut self.driver);
        Ok(taken?)
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.poll_io();
        let state = self.driver.report(now_ns());
        if matches!(state, Err(Error::Silent { .. })) && self.connection.reconnects() {
            self.connection.give_up(now_ns(), &mut self.driver, "no WRIST line came through it");
        }
        Ok(state?)
    }

    fn poll_io(&mut self) {
        self.connection.poll_io(now_ns(), &mut self.driver);
    }
}

/// Leaves the wrist pausing.
impl Drop for Device {
    fn drop(&mut self) {
        let pause = WristCommand::new(WristMotion::Pause);
        if self.connection.is_up() && self.driver.command(now_ns(), pause).is_ok() {
            self.connection.flush(&mut self.driver, FAREWELL_NS);
        }
    }
}
