//! The 2F-85 by Modbus RTU.

use super::rtu::{self, Answer, Parser};
use super::{CLOSED, Status, bit};
use crate::gripper::config::{Config, ns};
use crate::gripper::ledger::Ledger;
use crate::gripper::{Driver, Error, Request};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// How often an unanswered request is sent again before that is told.
const REPEATS_COUNT: u32 = 2;

/// What is wanted of the jaws; the newest want counts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Want {
    Nothing,
    Force(f64),
    Open,
    /// Deactivate, then activate.
    Reset,
    Activate,
}

/// What is on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sent {
    Read,
    Write(Want, [u8; 6]),
}

/// The driver.
#[derive(Debug)]
pub struct Serial {
    ledger: Ledger,
    parser: Parser,
    status: Option<Status>,
    outputs: Option<[u8; 6]>,
    want: Want,
    sent: Option<(Sent, u64, u32)>,
    read_ns: Option<u64>,
    is_homing: bool,
    is_leaving: bool,
}

impl Serial {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str, config: Config) -> Self {
        Serial {
            ledger: Ledger::new(address, config),
            parser: Parser::default(),
            status: None,
            outputs: None,
            want: Want::Nothing,
            sent: None,
            read_ns: None,
            is_homing: false,
            is_leaving: false,
        }
    }

    fn outputs_for(&self, want: Want) -> Option<[u8; 6]> {
        let config = &self.ledger.config;
        let go = bit::ACTIVATE | bit::GO_TO;
        match want {
            Want::Nothing => None,
            Want::Force(force_n) => Some([go, 0, 0, CLOSED, config.speed_count(), config.force_count(force_n)]),
            Want::Open => Some([go, 0, 0, config.position_count(config.open_mm), config.speed_count(), 0]),
            Want::Reset => Some([0; 6]),
            Want::Activate => Some([bit::ACTIVATE, 0, 0, 0, 0, 0]),
        }
    }

    fn advance(&mut self, now_ns: u64) {
        if !self.ledger.is_linked || self.sent.is_some() || self.is_leaving {
            return;
        }
        let wanted = self.outputs_for(self.want).filter(|outputs| self.outputs != Some(*outputs));
        let period_ns = ns(self.ledger.config.update_ms);
        let sent = match wanted {
            Some(outputs) => Sent::Write(self.want, outputs),
            None if self.read_ns.is_none_or(|read_ns| now_ns.saturating_sub(read_ns) >= period_ns) => {
                self.read_ns = Some(now_ns);
                Sent::Read
            }
            None => return,
        };
        self.send(now_ns, sent, 1);
    }

    fn send(&mut self, now_ns: u64, sent: Sent, count: u32) {
        self.parser.clear();
        match sent {
            Sent::Read => rtu::ask_read(&mut self.ledger.outgoing),
            Sent::Write(_, outputs) => rtu::ask_write(&mut self.ledger.outgoing, outputs),
        }
        self.sent = Some((sent, now_ns, count));
    }

    fn take(&mut self, now_ns: u64, answer: Answer) {
        let Some((sent, ..)) = self.sent else { return };
        match (sent, answer) {
            (Sent::Read, Answer::Inputs(bytes)) => self.take_status(now_ns, Status::from_bytes(bytes)),
            (Sent::Write(want, outputs), Answer::Written) => {
                self.outputs = Some(outputs);
                match want {
                    Want::Force(force_n) => self.ledger.state.target_n = Some(force_n),
                    Want::Reset if self.want == Want::Reset => self.want = Want::Activate,
                    Want::Activate if self.want == Want::Activate => self.want = Want::Nothing,
                    _ => {}
                }
            }
            (Sent::Read, Answer::Refused(code)) => self.ledger.refused("read", format!("Modbus exception {code}")),
            (Sent::Write(..), Answer::Refused(code)) => {
                self.want = Want::Nothing;
                self.ledger.refused("write", format!("Modbus exception {code}"));
            }
            _ => return, // the answer to a request that was given up
        }
        self.ledger.heard_ns = now_ns;
        self.sent = None;
    }

    fn take_status(&mut self, now_ns: u64, status: Status) {
        let fault_before = self.status.and_then(|status| status.fault_in_words());
        self.status = Some(status);
        if let (None, Some(why)) = (fault_before, status.fault_in_words()) {
            self.ledger.tell(DriverEvent::FastStop { why });
            self.want = Want::Nothing;
        }
        self.is_homing &= !(status.is_active() && self.want == Want::Nothing);
        let state = &mut self.ledger.state;
        state.time_ns = now_ns;
        state.jaws = status.jaws(state.jaws);
        state.opening_mm = Some(self.ledger.config.opening_of_count(status.position));
    }

    fn watch_deadline(&mut self, now_ns: u64) {
        let Some((sent, since_ns, count)) = self.sent else { return };
        if now_ns.saturating_sub(since_ns) <= ns(self.ledger.config.reply_ms) {
            return;
        }
        self.sent = None;
        if count <= REPEATS_COUNT {
            self.send(now_ns, sent, count + 1);
        } else if let Sent::Write(..) = sent {
            self.want = Want::Nothing;
            self.ledger.unanswered("write");
        }
    }

    fn grip(&mut self, command: GripCommand) -> Result<(), Error> {
        let address = || self.ledger.address.clone();
        let Some(status) = self.status else {
            return Err(Error::NotReady { address: address(), expected: "its status" });
        };
        if let Some(why) = status.fault_in_words() {
            return Err(Error::FastStop { address: address(), why });
        }
        if !status.is_active() || self.is_homing {
            return Err(Error::NotHomed { address: address() });
        }
        self.want = match command {
            GripCommand::Release => Want::Open,
            GripCommand::Hold { force_n } => Want::Force(self.ledger.admit(force_n)?),
        };
        Ok(())
    }
}

impl Talker for Serial {
    fn linked(&mut self, now_ns: u64) {
        self.ledger.linked(now_ns);
        self.parser.clear();
        (self.status, self.outputs, self.sent) = (None, None, None);
        (self.want, self.read_ns, self.is_homing, self.is_leaving) = (Want::Nothing, None, false, false);
        self.advance(now_ns);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.ledger.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut parser = std::mem::take(&mut self.parser);
        let mut answers = [None; 8]; // one request is on the way, so one answer is expected
        let mut count = 0;
        parser.feed_answers(bytes, |answer| {
            if let Some(slot) = answers.get_mut(count) {
                *slot = Some(answer);
                count += 1;
            }
        });
        self.parser = parser;
        for answer in answers.into_iter().flatten() {
            self.take(now_ns, answer);
        }
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        if self.ledger.is_linked {
            self.watch_deadline(now_ns);
            self.advance(now_ns);
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for Serial {
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error> {
        self.ledger.ready_for(now_ns, order)?;
        match order {
            Request::Grip(command) => self.grip(command)?,
            Request::Home if self.ledger.state.jaws == Jaws::Holding => {
                return Err(self.ledger.holds_something("home"));
            }
            Request::Home => (self.want, self.is_homing) = (Want::Reset, true),
            Request::Acknowledge => {
                return Err(Error::Unable { address: self.ledger.address.clone(), command: "acknowledge" });
            }
            // A serial line has no farewell: nothing more is sent, the gripper keeps what it has.
            Request::Leave => self.is_leaving = true,
        }
        self.advance(now_ns);
        Ok(())
    }

    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.ledger.report(now_ns)
    }

    fn is_busy(&self) -> bool {
        let is_new = self.ledger.is_linked && self.status.is_none();
        let wants = self.outputs_for(self.want).is_some_and(|outputs| self.outputs != Some(outputs));
        let moves = self.want != Want::Nothing && self.status.is_some_and(|status| status.object == 0);
        is_new || wants || moves || self.is_homing || matches!(self.sent, Some((Sent::Write(..), ..)))
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
