//! The 2F-85 by the text socket of a UR controller: `SET NAME value ...` is answered by `ack`, `GET NAME` by
//! `NAME value`, both possibly without an end of line. One request is on the way at a time; a value without an end
//! counts when nothing more has come for a moment.

use super::{CLOSED, Status};
use crate::gripper::config::{Config, ns};
use crate::gripper::ledger::Ledger;
use crate::gripper::{Driver, Error, Request};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// What is asked in turn.
const QUESTIONS: [&str; 5] = ["STA", "OBJ", "PRE", "POS", "FLT"];

/// Quiet after which a value without an end of line is taken as whole, ns.
const QUIET_NS: u64 = 5_000_000;

/// Longest answer, bytes; more is garbage.
const LONGEST: usize = 32;

/// What is wanted of the jaws; the newest want counts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Want {
    Nothing,
    Force(f64),
    Open,
    Reset,
    Activate,
}

/// What is on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sent {
    Get(&'static str),
    Set(Want),
}

/// The driver.
#[derive(Debug)]
pub struct Socket {
    ledger: Ledger,
    held: Vec<u8>,
    held_ns: u64,
    status: Status,
    /// How many of the questions have been answered since the link was made.
    heard_count: usize,
    question: usize,
    round_ns: Option<u64>,
    want: Want,
    done: Want,
    sent: Option<(Sent, u64)>,
    is_homing: bool,
    is_leaving: bool,
}

impl Socket {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str, config: Config) -> Self {
        Socket {
            ledger: Ledger::new(address, config),
            held: Vec::new(),
            held_ns: 0,
            status: Status::default(),
            heard_count: 0,
            question: 0,
            round_ns: None,
            want: Want::Nothing,
            done: Want::Nothing,
            sent: None,
            is_homing: false,
            is_leaving: false,
        }
    }

    fn is_known(&self) -> bool {
        self.heard_count >= QUESTIONS.len()
    }

    fn line_for(&self, want: Want) -> Option<String> {
        let config = &self.ledger.config;
        let speed = config.speed_count();
        Some(match want {
            Want::Nothing => return None,
            Want::Force(force_n) => format!("SET POS {CLOSED} SPE {speed} FOR {} GTO 1", config.force_count(force_n)),
            Want::Open => format!("SET POS {} SPE {speed} FOR 0 GTO 1", config.position_count(config.open_mm)),
            Want::Reset => "SET ACT 0".into(),
            Want::Activate => "SET ACT 1".into(),
        })
    }

    fn advance(&mut self, now_ns: u64) {
        if !self.ledger.is_linked || self.sent.is_some() || self.is_leaving {
            return;
        }
        let (sent, line) = match self.line_for(self.want).filter(|_| self.want != self.done) {
            Some(line) => (Sent::Set(self.want), line),
            None => match self.next_question(now_ns) {
                Some(name) => (Sent::Get(name), format!("GET {name}")),
                None => return,
            },
        };
        self.held.clear();
        self.ledger.outgoing.extend(line.as_bytes());
        self.ledger.outgoing.push(b'\n');
        self.sent = Some((sent, now_ns));
    }

    /// The force it has been set to is asked for as long as it is not known; the rest in turn, once a period.
    fn next_question(&mut self, now_ns: u64) -> Option<&'static str> {
        if self.question == 0 {
            let period_ns = ns(self.ledger.config.update_ms);
            if self.round_ns.is_some_and(|round_ns| now_ns.saturating_sub(round_ns) < period_ns) {
                return None;
            }
            self.round_ns = Some(now_ns);
            if self.ledger.state.target_n.is_none() && self.is_known() {
                self.question = QUESTIONS.len();
            }
        }
        let asks_force = self.question == QUESTIONS.len();
        let name = if asks_force { "FOR" } else { QUESTIONS[self.question] };
        self.question = if asks_force { 0 } else { (self.question + 1) % QUESTIONS.len() };
        Some(name)
    }

    /// Takes what is held as an answer, if it is whole.
    fn read_answer(&mut self, now_ns: u64) {
        let Some((sent, _)) = self.sent else { return self.held.clear() };
        let end = self.held.iter().position(|byte| *byte == b'\n');
        let is_quiet = now_ns.saturating_sub(self.held_ns) >= QUIET_NS;
        let is_acknowledged = matches!(sent, Sent::Set(_)) && self.held.trim_ascii() == b"ack";
        if self.held.is_empty() || !(end.is_some() || is_quiet || is_acknowledged || self.held.len() > LONGEST) {
            return;
        }
        let held = std::mem::take(&mut self.held);
        let text = std::str::from_utf8(&held[..end.unwrap_or(held.len())]).unwrap_or("?").trim();
        let is_taken = match sent {
            Sent::Set(want) => text == "ack" && self.take_done(want),
            Sent::Get(name) => text.split_once(' ').is_some_and(|(got, value)| {
                got == name && value.trim().parse().is_ok_and(|value| self.take_value(now_ns, name, value))
            }),
        };
        if is_taken {
            self.ledger.heard_ns = now_ns;
            self.sent = None;
        } else {
            self.ledger.tell(DriverEvent::Garbled { bytes_count: held.len() });
        }
    }

    fn take_done(&mut self, want: Want) -> bool {
        self.done = want;
        match want {
            Want::Force(force_n) => self.ledger.state.target_n = Some(force_n),
            Want::Reset if self.want == Want::Reset => self.want = Want::Activate,
            Want::Activate if self.want == Want::Activate => self.want = Want::Nothing,
            _ => {}
        }
        true
    }

    fn take_value(&mut self, now_ns: u64, name: &str, value: u8) -> bool {
        let fault_before = self.status.fault_in_words();
        match name {
            "STA" if value <= 3 => self.status.activation = value,
            "OBJ" if value <= 3 => self.status.object = value,
            "PRE" => self.status.position_asked = value,
            "POS" => self.status.position = value,
            "FLT" => self.status.fault = value & 0xF,
            "FOR" => self.ledger.state.target_n = self.ledger.config.force_of_count(value),
            _ => return false,
        }
        if let (None, Some(why)) = (fault_before, self.status.fault_in_words()) {
            self.ledger.tell(DriverEvent::FastStop { why });
            self.want = Want::Nothing;
        }
        self.heard_count = (self.heard_count + 1).min(QUESTIONS.len());
        if !self.is_known() {
            return true;
        }
        self.is_homing &= !(self.status.is_active() && self.want == Want::Nothing && name == "STA");
        let state = &mut self.ledger.state;
        state.time_ns = now_ns;
        state.jaws = self.status.jaws(state.jaws);
        state.opening_mm = Some(self.ledger.config.opening_of_count(self.status.position));
        true
    }

    fn watch_deadline(&mut self, now_ns: u64) {
        let Some((sent, since_ns)) = self.sent else { return };
        if now_ns.saturating_sub(since_ns) <= ns(self.ledger.config.reply_ms) {
            return;
        }
        self.sent = None;
        // A question is asked again in its turn; silence is told by itself.
        if let Sent::Set(_) = sent {
            self.want = Want::Nothing;
            self.ledger.unanswered("SET");
        }
    }

    fn grip(&mut self, command: GripCommand) -> Result<(), Error> {
        let address = || self.ledger.address.clone();
        if !self.is_known() {
            return Err(Error::NotReady { address: address(), expected: "its status" });
        }
        if let Some(why) = self.status.fault_in_words() {
            return Err(Error::FastStop { address: address(), why });
        }
        if !self.status.is_active() || self.is_homing {
            return Err(Error::NotHomed { address: address() });
        }
        self.want = match command {
            GripCommand::Release => Want::Open,
            GripCommand::Hold { force_n } => Want::Force(self.ledger.admit(force_n)?),
        };
        Ok(())
    }
}

impl Talker for Socket {
    fn linked(&mut self, now_ns: u64) {
        self.ledger.linked(now_ns);
        self.held.clear();
        (self.status, self.heard_count, self.question, self.round_ns) = (Status::default(), 0, 0, None);
        (self.want, self.done, self.sent) = (Want::Nothing, Want::Nothing, None);
        (self.is_homing, self.is_leaving) = (false, false);
        self.advance(now_ns);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.ledger.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let room = (LONGEST + 1).saturating_sub(self.held.len()).min(bytes.len());
        self.held.extend_from_slice(&bytes[..room]); // what is longer than any answer is garbage anyway
        self.held_ns = now_ns;
        self.read_answer(now_ns);
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        if self.ledger.is_linked {
            self.read_answer(now_ns);
            self.watch_deadline(now_ns);
            self.advance(now_ns);
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for Socket {
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error> {
        self.ledger.ready_for(now_ns, order)?;
        match order {
            Request::Grip(command) => self.grip(command)?,
            Request::Home if self.ledger.state.jaws == Jaws::Holding => {
                return Err(self.ledger.holds_something("home"));
            }
            Request::Home => (self.want, self.done, self.is_homing) = (Want::Reset, Want::Nothing, true),
            Request::Acknowledge => {
                return Err(Error::Unable { address: self.ledger.address.clone(), command: "acknowledge" });
            }
            Request::Leave => self.is_leaving = true,
        }
        self.advance(now_ns);
        Ok(())
    }

    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.ledger.report(now_ns)
    }

    fn is_busy(&self) -> bool {
        let is_new = self.ledger.is_linked && !self.is_known();
        let wants = self.want != Want::Nothing && self.want != self.done;
        let moves = self.want != Want::Nothing && self.status.object == 0;
        is_new || wants || moves || self.is_homing || matches!(self.sent, Some((Sent::Set(_), _)))
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
