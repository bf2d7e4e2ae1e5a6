//! The driver of every gripper: the state and the guarantees they share, around a [`Protocol`].

use super::config::Config;
use super::driver_state::DriverState;
use super::error::Error;
use super::protocol::Protocol;
use super::request::Request;
use crate::link::Endpoint;
use slipbound::port::{DriverEvent, GripCommand, GripperState};

/// A gripper's driver without its link. It owns what does not depend on the protocol: address and settings, the state
/// of the link, the newest state of the gripper, faults and events, which forces are admitted, the bytes to be sent.
///
/// `Driver` alone is for any protocol, as named by an address; `Driver<Wsg50>`, for example, for that one.
#[derive(Debug)]
pub struct Driver<P: Protocol = Box<dyn Protocol>> {
    state: DriverState,
    protocol: P,
}

impl<P: Protocol> Driver<P> {
    /// A driver whose link is not yet up. `address` is for messages.
    pub fn new(address: &str, config: Config, protocol: P) -> Self {
        let mut state = DriverState::new(address, config, protocol.needs_link());
        state.gripper.jaws = protocol.jaws_at_start();
        Driver { state, protocol }
    }

    /// Accepts a request. An error means that it was not accepted.
    pub fn request(&mut self, now_ns: u64, request: Request) -> Result<(), Error> {
        self.state.set_time(now_ns);
        let jaws_told = self.check_jaws();
        let (state, protocol) = (&mut self.state, &mut self.protocol);
        match request {
            // A farewell needs a link that is up, not one that answers.
            Request::Leave if state.is_linked() => {}
            _ => state.check_link()?,
        }
        match request {
            Request::Grip(command) => {
                protocol.check_ready(state)?;
                jaws_told?;
                let command = match command {
                    GripCommand::Hold { force_n } => {
                        let on_its_way_n = protocol.force_on_its_way(state);
                        GripCommand::Hold { force_n: state.admit(force_n, on_its_way_n)? }
                    }
                    GripCommand::Release => GripCommand::Release,
                };
                protocol.grip(state, command)?;
            }
            Request::Home => {
                jaws_told?;
                protocol.home(state)?;
            }
            Request::Acknowledge => protocol.acknowledge(state)?,
            Request::Leave => {
                state.doubt_target(protocol.force_on_its_way(state));
                protocol.leave(state);
                state.leave_link();
            }
        }
        self.advance();
        Ok(())
    }

    /// The newest state of the gripper, or what is wrong with the link or with an earlier request; the latter is
    /// reported once.
    pub fn state(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.state.set_time(now_ns);
        if self.state.is_linked() {
            self.protocol.check_version(&self.state)?;
        }
        let state = self.state.report()?;
        self.check_jaws()?;
        Ok(state)
    }

    /// A gripper that answers but no longer tells what its jaws do may have opened them.
    fn check_jaws(&self) -> Result<(), Error> {
        let Some(since_ns) = self.protocol.jaws_untold_since_ns(&self.state) else { return Ok(()) };
        let got_ms = self.state.now_ns().saturating_sub(since_ns) / 1_000_000;
        match got_ms > self.state.config.silence_ms {
            true => Err(Error::Untold { address: self.state.address(), got_ms }),
            false => Ok(()),
        }
    }

    /// Whether a request is still under way, or the first state is still awaited.
    pub fn is_busy(&self) -> bool {
        self.protocol.is_busy(&self.state)
    }

    /// Removes and returns the oldest event.
    pub fn next_event(&mut self) -> Option<DriverEvent> {
        self.state.next_event()
    }

    /// Its settings.
    pub fn config(&self) -> &Config {
        &self.state.config
    }

    /// Permits lowering the force while an object is held, whatever the settings say (true), or leaves that to the
    /// settings (false). Used by `check-hold`.
    pub fn permit_lowering(&mut self, permitted: bool) {
        self.state.permit_lowering(permitted);
    }

    /// Lets the protocol send what is due, where something may be sent.
    fn advance(&mut self) {
        if self.state.may_send() {
            self.protocol.advance(&mut self.state);
        }
    }
}

impl<P: Protocol> Endpoint for Driver<P> {
    fn linked(&mut self, now_ns: u64) {
        self.state.set_time(now_ns);
        self.state.doubt_target(self.protocol.force_on_its_way(&self.state));
        self.state.linked();
        self.protocol.linked(&mut self.state);
        self.advance();
    }

    fn unlinked(&mut self, now_ns: u64, why: &str) {
        self.state.set_time(now_ns);
        self.state.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        self.state.set_time(now_ns);
        self.protocol.receive(&mut self.state, bytes);
        self.state.track_grasp();
        self.advance();
    }

    fn tick(&mut self, now_ns: u64) {
        self.state.set_time(now_ns);
        if self.state.may_send() {
            self.protocol.tick(&mut self.state);
            self.protocol.advance(&mut self.state);
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.state.outgoing
    }
}
