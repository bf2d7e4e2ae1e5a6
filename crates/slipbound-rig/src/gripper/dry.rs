//! No gripper: accepts every command, logs it, moves nothing.

use super::driver_state::DriverState;
use super::error::Error;
use super::protocol::Protocol;
use slipbound::port::{DriverEvent, GripCommand, Jaws};

/// The protocol of no gripper.
#[derive(Debug, Clone, Copy, Default)]
pub struct Dry;

impl Protocol for Dry {
    fn linked(&mut self, _driver: &mut DriverState) {}

    fn receive(&mut self, _driver: &mut DriverState, _bytes: &[u8]) {}

    fn tick(&mut self, driver: &mut DriverState) {
        driver.gripper.time_ns = driver.now_ns();
    }

    fn advance(&mut self, _driver: &mut DriverState) {}

    fn check_ready(&self, _driver: &DriverState) -> Result<(), Error> {
        Ok(())
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        let jaws = match command {
            GripCommand::Hold { .. } => Jaws::Holding,
            GripCommand::Release => Jaws::Open,
        };
        if (driver.gripper.target_n, driver.gripper.jaws) != (command.force_n(), jaws) {
            (driver.gripper.target_n, driver.gripper.jaws) = (command.force_n(), jaws);
            driver.push_event(DriverEvent::Dry { command });
        }
        Ok(())
    }

    fn home(&mut self, _driver: &mut DriverState) -> Result<(), Error> {
        Ok(())
    }

    fn acknowledge(&mut self, _driver: &mut DriverState) -> Result<(), Error> {
        Ok(())
    }

    fn is_busy(&self, _driver: &DriverState) -> bool {
        false
    }

    fn needs_link(&self) -> bool {
        false
    }

    fn jaws_at_start(&self) -> Jaws {
        Jaws::Open
    }
}
