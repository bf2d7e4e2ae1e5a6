//! The line protocol: text that anyone can answer who already holds a gripper by another driver. Its description is in
//! docs/grippers.md; the wrist speaks it too ([`crate::wrist`]).

mod message;

pub use message::{Answer, VERSION, ask, number_of};

use super::config::{Config, ns};
use super::ledger::Ledger;
use super::text::Lines;
use super::{Driver, Error, Request};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// What is wanted; the newest want counts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Want {
    Nothing,
    Force(f64),
    Open,
    Home,
    Acknowledge,
}

/// A command on the way: its number, its words, when it was sent.
#[derive(Debug, Clone)]
struct Awaited {
    number: u64,
    words: String,
    want: Want,
    since_ns: u64,
}

/// The driver.
#[derive(Debug)]
pub struct LineGripper {
    ledger: Ledger,
    lines: Lines,
    number: u64,
    want: Want,
    done: Want,
    awaited: Option<Awaited>,
    is_stated: bool,
    is_leaving: bool,
}

impl LineGripper {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str, config: Config) -> Self {
        LineGripper {
            ledger: Ledger::new(address, config),
            lines: Lines::default(),
            number: 0,
            want: Want::Nothing,
            done: Want::Nothing,
            awaited: None,
            is_stated: false,
            is_leaving: false,
        }
    }

    fn advance(&mut self, now_ns: u64) {
        let is_idle = self.want == Want::Nothing || self.want == self.done;
        if !self.ledger.is_linked || self.awaited.is_some() || self.is_leaving || is_idle {
            return;
        }
        let config = &self.ledger.config;
        let words = match self.want {
            Want::Nothing => return,
            Want::Force(force_n) => ask("GRASP", &[("force_n", config.to_own_n(force_n))]),
            Want::Open => ask("RELEASE", &[("opening_mm", config.open_mm)]),
            Want::Home => ask("HOME", &[]),
            Want::Acknowledge => ask("ACKNOWLEDGE", &[]),
        };
        self.number += 1;
        self.ledger.outgoing.extend(format!("{} {words}\n", self.number).into_bytes());
        self.awaited = Some(Awaited { number: self.number, words, want: self.want, since_ns: now_ns });
    }

    fn take(&mut self, now_ns: u64, line: Option<&str>) {
        let Some(answer) = line.and_then(Answer::parse) else {
            return self.ledger.tell(DriverEvent::Garbled { bytes_count: line.map_or(1, str::len) });
        };
        self.ledger.heard_ns = now_ns;
        match answer {
            Answer::Hello(VERSION) => {}
            Answer::Hello(version) => {
                self.ledger.refused("HELLO", format!("version {version}, expected {VERSION}"));
            }
            Answer::Gripper(rest) => self.take_state(now_ns, rest),
            Answer::Wrist(_) => {}
            Answer::Ack { number, words } => {
                let Some(awaited) = self.awaited.take_if(|awaited| awaited.number == number) else { return };
                if awaited.words == words {
                    self.done = awaited.want;
                    match awaited.want {
                        Want::Force(force_n) => self.ledger.state.target_n = Some(force_n),
                        Want::Home | Want::Acknowledge => self.want = Want::Nothing,
                        _ => {}
                    }
                } else {
                    self.want = Want::Nothing;
                    self.ledger.refused("a command", format!("`{words}` taken over instead of `{}`", awaited.words));
                }
            }
            Answer::Err { number, why } => {
                if self.awaited.take_if(|awaited| awaited.number == number).is_some() {
                    self.want = Want::Nothing;
                    self.ledger.refused("a command", format!("`{why}`"));
                }
            }
        }
    }

    fn take_state(&mut self, now_ns: u64, rest: &str) {
        let jaws = match rest.split_whitespace().skip_while(|word| *word != "jaws").nth(1) {
            Some("open") => Jaws::Open,
            Some("closing") => Jaws::Closing,
            Some("holding") => Jaws::Holding,
            Some("nothing") => Jaws::Nothing,
            Some("lost") => Jaws::Lost,
            Some("stopped") => Jaws::Stopped,
            _ => Jaws::Unknown,
        };
        if jaws == Jaws::Stopped && self.ledger.state.jaws != Jaws::Stopped {
            self.ledger.tell(DriverEvent::FastStop { why: "the other side says so".into() });
            (self.want, self.done) = (Want::Nothing, Want::Nothing);
        }
        let config = &self.ledger.config;
        let force_n = |key| number_of(rest, key).and_then(|own_n| config.from_own_n(own_n));
        let (measured_n, target_n) = (force_n("force_n"), force_n("target_n"));
        let state = &mut self.ledger.state;
        state.time_ns = now_ns;
        state.jaws = jaws;
        state.force_n = measured_n;
        // Ours counts while it is on; after a new link the other side's does.
        state.target_n = if matches!(self.done, Want::Force(_)) { state.target_n } else { target_n };
        state.opening_mm = number_of(rest, "opening_mm");
        self.is_stated = true;
    }

    fn grip(&mut self, command: GripCommand) -> Result<(), Error> {
        let address = || self.ledger.address.clone();
        if !self.is_stated {
            return Err(Error::NotReady { address: address(), expected: "a GRIPPER line" });
        }
        if self.ledger.state.jaws == Jaws::Stopped {
            return Err(Error::FastStop { address: address(), why: "the other side says so".into() });
        }
        self.want = match command {
            GripCommand::Release => Want::Open,
            GripCommand::Hold { force_n } => Want::Force(self.ledger.admit(force_n)?),
        };
        Ok(())
    }
}

impl Talker for LineGripper {
    fn linked(&mut self, now_ns: u64) {
        self.ledger.linked(now_ns);
        self.lines.clear();
        (self.want, self.done, self.awaited) = (Want::Nothing, Want::Nothing, None);
        (self.is_stated, self.is_leaving) = (false, false);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.ledger.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(now_ns, line));
        self.lines = lines;
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        let reply_ns = ns(self.ledger.config.reply_ms);
        if self.awaited.take_if(|awaited| now_ns.saturating_sub(awaited.since_ns) > reply_ns).is_some() {
            self.want = Want::Nothing;
            self.ledger.unanswered("a command");
        }
        self.advance(now_ns);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for LineGripper {
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error> {
        self.ledger.ready_for(now_ns, order)?;
        match order {
            Request::Grip(command) => self.grip(command)?,
            Request::Home if self.ledger.state.jaws == Jaws::Holding => {
                return Err(self.ledger.holds_something("home"));
            }
            Request::Home => (self.want, self.done) = (Want::Home, Want::Nothing),
            Request::Acknowledge => (self.want, self.done) = (Want::Acknowledge, Want::Nothing),
            Request::Leave => {
                self.number += 1;
                self.ledger.outgoing.extend(format!("{} BYE\n", self.number).into_bytes());
                self.is_leaving = true;
            }
        }
        self.advance(now_ns);
        Ok(())
    }

    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.ledger.report(now_ns)
    }

    fn is_busy(&self) -> bool {
        let is_new = self.ledger.is_linked && !self.is_stated;
        is_new || self.awaited.is_some() || (self.want != Want::Nothing && self.want != self.done)
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
