//! What every driver keeps: its address and settings, the newest state, what went wrong, what is to be written down.

use super::config::{Config, Lowering, ns};
use super::{Error, Request};
use slipbound::port::{DriverEvent, GripperState, Jaws};
use std::collections::VecDeque;

/// Most events kept; the oldest go first.
const EVENTS_COUNT: usize = 64;

/// Difference in force that is none, N per finger: below what any of these grippers resolves.
const SAME_FORCE_N: f64 = 0.01;

/// The ledger of one driver.
#[derive(Debug)]
pub(crate) struct Ledger {
    pub address: String,
    pub config: Config,
    pub outgoing: Vec<u8>,
    pub is_linked: bool,
    /// When something that makes sense was last heard.
    pub heard_ns: u64,
    pub state: GripperState,
    unlinked_why: String,
    lowering_permitted: bool,
    /// The last force asked for that lay outside the range, N per finger: it is noted once.
    clamped_n: Option<f64>,
    fault: Option<Error>,
    events: VecDeque<DriverEvent>,
}

impl Ledger {
    pub fn new(address: &str, config: Config) -> Self {
        let state = GripperState { time_ns: 0, force_n: None, target_n: None, opening_mm: None, jaws: Jaws::Unknown };
        Ledger {
            address: address.into(),
            lowering_permitted: config.lowering == Lowering::Allow,
            config,
            outgoing: Vec::new(),
            is_linked: false,
            heard_ns: 0,
            state,
            unlinked_why: "not yet made".into(),
            clamped_n: None,
            fault: None,
            events: VecDeque::new(),
        }
    }

    pub fn linked(&mut self, now_ns: u64) {
        self.outgoing.clear();
        self.is_linked = true;
        self.heard_ns = now_ns;
        self.fault = None;
        self.tell(DriverEvent::Linked);
    }

    pub fn unlinked(&mut self, why: &str) {
        self.outgoing.clear();
        if self.is_linked {
            self.tell(DriverEvent::Unlinked { why: why.into() });
        }
        self.is_linked = false;
        self.unlinked_why = why.into();
    }

    pub fn tell(&mut self, event: DriverEvent) {
        if self.events.len() == EVENTS_COUNT {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    pub fn next_event(&mut self) -> Option<DriverEvent> {
        self.events.pop_front()
    }

    /// Something went wrong with an order taken over before; the first such thing is told, once.
    pub fn fail(&mut self, error: Error) {
        self.fault.get_or_insert(error);
    }

    pub fn permit_lowering(&mut self, permitted: bool) {
        self.lowering_permitted = permitted || self.config.lowering == Lowering::Allow;
    }

    /// An order needs a link that is alive; a farewell only one that is there.
    pub fn ready_for(&self, now_ns: u64, order: Request) -> Result<(), Error> {
        match order {
            Request::Leave if self.is_linked => Ok(()),
            _ => self.ready(now_ns),
        }
    }

    fn ready(&self, now_ns: u64) -> Result<(), Error> {
        if !self.is_linked {
            return Err(Error::Lost { address: self.address.clone(), why: self.unlinked_why.clone() });
        }
        let silent_ns = now_ns.saturating_sub(self.heard_ns);
        if silent_ns > ns(self.config.silence_ms) {
            let got_ms = silent_ns / 1_000_000;
            return Err(Error::Silent { address: self.address.clone(), expected_ms: self.config.silence_ms, got_ms });
        }
        Ok(())
    }

    /// Whether something is, or may soon be, between the jaws. After a fast stop, say, a gripper presses without
    /// knowing that it holds.
    pub fn seems_to_hold(&self) -> bool {
        let presses = self.state.force_n.is_some_and(|force_n| force_n > 0.5 * self.config.least_n);
        presses || matches!(self.state.jaws, Jaws::Holding | Jaws::Closing | Jaws::Stopped)
    }

    /// A force as it may be sent: a number, inside its range, and not lower than the last one while something is held
    /// unless that is permitted.
    pub fn admit(&mut self, asked_n: f64) -> Result<f64, Error> {
        let Config { least_n, most_n, .. } = self.config;
        let Some(given_n) = self.config.admitted_n(asked_n) else {
            return Err(Error::Force { address: self.address.clone(), least_n, most_n, got_n: asked_n });
        };
        if self.seems_to_hold() && !self.lowering_permitted {
            let Some(from_n) = self.state.target_n.or(self.state.force_n) else {
                let expected = "the force it holds with (or a release, or lowering = \"allow\")";
                return Err(Error::NotReady { address: self.address.clone(), expected });
            };
            if given_n < from_n - SAME_FORCE_N {
                return Err(Error::Lowering { address: self.address.clone(), from_n, to_n: given_n });
            }
        }
        if given_n != asked_n && self.clamped_n != Some(asked_n) {
            self.tell(DriverEvent::Clamped { asked_n, given_n });
        }
        self.clamped_n = (given_n != asked_n).then_some(asked_n);
        Ok(given_n)
    }

    /// The state, or what is wrong.
    pub fn report(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.ready(now_ns)?;
        match self.fault.take() {
            Some(fault) => Err(fault),
            None => Ok(self.state),
        }
    }

    /// The refusal of what must not be done while something is held.
    pub fn holds_something(&self, command: &'static str) -> Error {
        let got = "something between the jaws; release it first".into();
        Error::Refused { address: self.address.clone(), command, got }
    }

    pub fn unanswered(&mut self, command: &'static str) {
        let (address, expected_ms) = (self.address.clone(), self.config.reply_ms);
        self.fail(Error::Unanswered { address, command, expected_ms });
    }

    pub fn refused(&mut self, command: &'static str, got: impl Into<String>) {
        let address = self.address.clone();
        self.fail(Error::Refused { address, command, got: got.into() });
    }
}
