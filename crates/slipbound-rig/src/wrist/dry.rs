//! No wrist.

use super::error::Error;
use crate::link::now_ns;
use slipbound::plant::WristDrive;
use slipbound::port::{Wrist, WristCommand, WristError, WristState};

/// No wrist: accepts every valid motion and computes the resulting position.
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
