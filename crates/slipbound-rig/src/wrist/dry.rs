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
        let (expected, got) = (command.motion.to_string(), "a rate or a bound out of range".into());
        Err(Error::Refused { address: "dry".into(), expected, got }.into())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.drive.advance_to(now_ns());
        Ok(self.drive.state())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::port::WristMotion;

    #[test]
    fn a_motion_that_cannot_be_is_refused_in_words() {
        let motion = WristMotion::Lower { rate_mm_per_s: 2.5, most_mm: -1.0 };
        let refused = Dry::default().command(WristCommand::new(motion)).expect_err("refused").to_string();
        let expected =
            "dry: expected `lower at 2.5 mm/s by at most -1 mm` to be taken over, got a rate or a bound out of range";
        assert_eq!(refused, expected);
    }
}
