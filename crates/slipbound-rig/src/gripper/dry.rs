//! No gripper: takes every command over, writes it down, moves nothing.

use super::config::Config;
use super::ledger::Ledger;
use super::{Driver, Error, Request};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// The driver of nothing.
#[derive(Debug)]
pub struct Dry {
    ledger: Ledger,
}

impl Dry {
    /// A driver that needs no link.
    pub fn new(address: &str, config: Config) -> Self {
        let mut ledger = Ledger::new(address, config);
        ledger.state.jaws = Jaws::Open;
        Dry { ledger }
    }
}

impl Talker for Dry {
    fn linked(&mut self, _now_ns: u64) {}

    fn unlinked(&mut self, _now_ns: u64, _why: &str) {}

    fn receive(&mut self, _now_ns: u64, _bytes: &[u8]) {}

    fn tick(&mut self, now_ns: u64) {
        self.ledger.state.time_ns = now_ns;
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for Dry {
    fn order(&mut self, _now_ns: u64, order: Request) -> Result<(), Error> {
        let Request::Grip(command) = order else { return Ok(()) };
        let state = match command {
            GripCommand::Release => (None, Jaws::Open),
            GripCommand::Hold { force_n } => (Some(self.ledger.admit(force_n)?), Jaws::Holding),
        };
        let is_new = (self.ledger.state.target_n, self.ledger.state.jaws) != state;
        (self.ledger.state.target_n, self.ledger.state.jaws) = state;
        if is_new {
            self.ledger.tell(DriverEvent::Dry { command });
        }
        Ok(())
    }

    fn state(&mut self, _now_ns: u64) -> Result<GripperState, Error> {
        Ok(self.ledger.state)
    }

    fn is_busy(&self) -> bool {
        false
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.ledger.next_event()
    }

    fn config(&self) -> &Config {
        &self.ledger.config
    }

    fn permit_lowering(&mut self, permitted: bool) {
        self.ledger.permit_lowering(permitted);
    }
}
