//! The wrist's driver at a socket, and a wrist that is not there.

use super::{Error, LineWrist};
use crate::link::{Dial, Link, Talker, Wire, now_ns};
use slipbound::plant::WristDrive;
use slipbound::port::{Wrist, WristCommand, WristError, WristMotion, WristState};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Longest wait for the first state, ns.
const FIRST_STATE_NS: u64 = 2_000_000_000;

/// Longest wait for the last pause to be sent, ns.
const FAREWELL_NS: u64 = 50_000_000;

/// A wrist that is there. A lost link is made anew; the wrist pauses by itself meanwhile.
pub struct Device {
    driver: LineWrist,
    wire: Wire,
}

impl Device {
    /// A driver at a link that is already there; with `dial` it is made anew when it is lost.
    pub fn with_link(mut driver: LineWrist, link: Option<Box<dyn Link>>, dial: Option<Arc<dyn Dial>>) -> Self {
        if link.is_some() {
            driver.linked(now_ns());
        }
        Device { driver, wire: Wire::new(link, dial) }
    }

    pub(super) fn await_first_state(&mut self) -> Result<(), Error> {
        let from_ns = now_ns();
        while !self.driver.is_stated() {
            self.wire.pump(now_ns(), &mut self.driver);
            if now_ns() - from_ns > FIRST_STATE_NS {
                return self.driver.report(now_ns()).map(drop);
            }
            thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }
}

impl Wrist for Device {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.wire.pump(now_ns(), &mut self.driver);
        let taken = self.driver.command(now_ns(), command);
        self.wire.send(now_ns(), &mut self.driver);
        Ok(taken?)
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.wire.pump(now_ns(), &mut self.driver);
        let state = self.driver.report(now_ns());
        if matches!(state, Err(Error::Silent { .. })) && self.wire.is_kept() {
            self.wire.lose(now_ns(), &mut self.driver, "nothing came through it");
        }
        Ok(state?)
    }

    fn poll_io(&mut self) {
        self.wire.pump(now_ns(), &mut self.driver);
    }
}

/// Leaves the wrist pausing.
impl Drop for Device {
    fn drop(&mut self) {
        let from_ns = now_ns();
        if !self.wire.is_linked() || self.driver.command(from_ns, WristCommand::new(WristMotion::Pause)).is_err() {
            return;
        }
        while self.wire.is_linked() && !self.driver.outgoing().is_empty() && now_ns() - from_ns < FAREWELL_NS {
            self.wire.send(now_ns(), &mut self.driver);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// No wrist: takes every motion it could do, and keeps book of where it would be.
#[derive(Debug, Default)]
pub struct Dry {
    drive: WristDrive,
}

impl Wrist for Dry {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.drive.advance_to(now_ns());
        if self.drive.command(command) {
            return Ok(());
        }
        let (expected, got) = (format!("{:?}", command.motion), "a number that cannot be".into());
        Err(Error::Refused { address: "dry".into(), expected, got }.into())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.drive.advance_to(now_ns());
        Ok(self.drive.state())
    }
}
