//! The 2F-85 by the text socket of a UR controller: `SET NAME value ...` is answered by `ack`, `GET NAME` by
//! `NAME value`, both possibly without an end of line. One request is in flight at a time. A gripper that ends its lines
//! may pause anywhere within one. If the first answer has no line end within the reply time, the gripper does not end
//! its lines: a value then counts when nothing more has come for a moment.

use super::actuator::{Actuator, Goal};
use super::status::Status;
use crate::gripper::driver_state::DriverState;
use crate::gripper::error::Error;
use crate::gripper::protocol::{MISSES_COUNT, Protocol};
use crate::link::{InFlight, write_line};
use slipbound::port::{DriverEvent, GripCommand};

/// Questions, asked in turn.
const QUESTIONS: [&str; 5] = ["STA", "OBJ", "PRE", "POS", "FLT"];

/// Silence after which a value without an end of line counts as complete, ns, where lines have none.
const QUIET_NS: u64 = 5_000_000;

/// Longest answer, bytes; more is garbage.
const LONGEST: usize = 32;

/// The answer to a command.
const ACKNOWLEDGED: &[u8] = b"ack";

/// A message to the gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Message {
    Get(&'static str),
    Set(Goal),
}

/// The protocol.
#[derive(Debug, Default)]
pub struct Socket {
    buffer: Vec<u8>,
    received_ns: u64,
    /// Whether its values end with a line; None before the first.
    ends_lines: Option<bool>,
    actuator: Actuator,
    /// The answers so far.
    status: Status,
    /// Which of [`QUESTIONS`] have been answered in this round; None between two rounds.
    is_heard: Option<[bool; QUESTIONS.len()]>,
    /// How many rounds in a row gave no status, and how many no position.
    misses_count: u32,
    position_misses_count: u32,
    question: usize,
    round_ns: Option<u64>,
    /// Whether a round has ended since the force that it is set to was last asked for.
    may_ask_force: bool,
    /// How often that has been asked for since the link was made.
    force_asked_count: u32,
    /// The goal that the gripper last accepted; `Keep` where that is not known.
    done: Goal,
    /// Whether a question is due before the next command that changes the force alone.
    asks_first: bool,
    in_flight: Option<InFlight<Message>>,
    /// What came in place of the acknowledgement of the command in flight.
    refusal: Option<String>,
}

impl Socket {
    fn is_on_the_way(&self) -> bool {
        self.actuator.goal != Goal::Keep && self.actuator.goal != self.done
    }

    fn changes_force_alone(&self) -> bool {
        matches!((self.actuator.goal, self.done), (Goal::Hold { .. }, Goal::Hold { .. }))
    }

    fn line(goal: Goal, driver: &DriverState) -> String {
        match (goal.target(&driver.config), goal) {
            (Some(to), _) => format!("SET POS {} SPE {} FOR {} GTO 1", to.position, to.speed, to.force),
            // It keeps what it was told: a position to go to would outlive homing, and grip.
            (None, _) => format!("SET ACT {} GTO 0 ATR 0 POS 0 SPE 0 FOR 0", u8::from(goal == Goal::Activate)),
        }
    }

    /// Asks in turn, once per period; after each round for the force that it is set to, until it is known.
    fn next_question(&mut self, driver: &mut DriverState) -> Option<&'static str> {
        if self.question == 0 {
            self.end_round(driver);
            let (now_ns, period_ns) = (driver.now_ns(), driver.config.update_ms * 1_000_000);
            if self.round_ns.is_some_and(|round_ns| now_ns.saturating_sub(round_ns) < period_ns) {
                return None;
            }
            self.round_ns = Some(now_ns);
            // Not every gripper tells it: the rest is asked for all the same.
            let may_ask_force = std::mem::take(&mut self.may_ask_force) && self.actuator.is_known();
            // On a new link once, before anything is commanded there.
            let is_first = self.force_asked_count == 0 && self.done == Goal::Keep;
            if may_ask_force && (driver.gripper.target_n.is_none() || is_first) {
                self.question = QUESTIONS.len();
            } else {
                self.is_heard = Some(Default::default());
            }
        }
        let asks_force = self.question == QUESTIONS.len();
        self.force_asked_count = self.force_asked_count.saturating_add(u32::from(asks_force));
        let name = if asks_force { "FOR" } else { QUESTIONS[self.question] };
        self.question = if asks_force { 0 } else { (self.question + 1) % QUESTIONS.len() };
        Some(name)
    }

    /// A status is made of the answers of one round: answers from before and after a command together could look as if
    /// the jaws had arrived and found nothing. Without a fault the previous one stays, and so does the position once.
    fn end_round(&mut self, driver: &mut DriverState) {
        let Some(is_heard) = self.is_heard.take() else { return };
        self.may_ask_force = true;
        let is_missed = |name: &str| QUESTIONS.iter().zip(is_heard).any(|(asked, heard)| *asked == name && !heard);
        let is_whole = !["STA", "OBJ", "PRE"].into_iter().any(is_missed);
        self.position_misses_count = if is_missed("POS") { self.position_misses_count + 1 } else { 0 };
        if self.position_misses_count >= MISSES_COUNT {
            self.status.position = None;
        }
        self.misses_count = if is_whole { 0 } else { self.misses_count + 1 };
        if is_whole && self.actuator.take_status(driver, self.status) {
            self.done = Goal::Keep;
        }
    }

    /// Takes the buffered bytes as an answer, if it is complete.
    fn read_answer(&mut self, driver: &mut DriverState) {
        let Some(sent) = &self.in_flight else { return self.buffer.clear() };
        let (message, age_ns) = (sent.message, sent.age_ns(driver.now_ns()));
        self.pass_over(message);
        let end = self.buffer.iter().position(|byte| *byte == b'\n');
        let quiet_ns = driver.now_ns().saturating_sub(self.received_ns);
        let may_be_endless = match self.ends_lines {
            Some(ends_lines) => !ends_lines,
            None => age_ns + 2 * QUIET_NS >= driver.config.reply_ms * 1_000_000,
        };
        let is_quiet = may_be_endless && quiet_ns >= QUIET_NS; // else the rest of it may be on its way
        let is_acknowledged = matches!(message, Message::Set(_)) && self.buffer.starts_with(ACKNOWLEDGED);
        // A line end that is still to come belongs to the answer, and may take as long again.
        let is_endless = self.ends_lines == Some(false);
        let is_full = matches!(message, Message::Get(name) if is_endless && is_full(name, &self.buffer));
        let may_be_acknowledged = matches!(message, Message::Set(_)) && ACKNOWLEDGED.starts_with(&self.buffer);
        let is_quiet = is_quiet && !may_be_acknowledged;
        let is_whole = end.is_some() || is_quiet || is_acknowledged || is_full || self.buffer.len() > LONGEST;
        if self.buffer.is_empty() || !is_whole {
            return;
        }
        let buffer = std::mem::take(&mut self.buffer);
        let text = std::str::from_utf8(&buffer[..end.unwrap_or(buffer.len())]).unwrap_or("?").trim();
        let is_taken = match message {
            Message::Set(goal) if is_acknowledged => {
                self.done = goal;
                self.actuator.take_over(driver, goal);
                true
            }
            Message::Set(_) => false,
            Message::Get(name) => text.split_once(' ').is_some_and(|(got, value)| {
                got == name && number(name, value.trim()).is_some_and(|value| self.take_value(driver, name, value))
            }),
        };
        if is_taken {
            if matches!(message, Message::Get(_)) && (end.is_some() || is_quiet) {
                self.ends_lines = Some(end.is_some() || self.ends_lines == Some(true));
            }
            driver.heard();
            self.in_flight = None;
        } else {
            if end.is_some() && matches!(message, Message::Get(_)) {
                self.in_flight = None; // it is asked again in turn
            }
            if end.is_some() && matches!(message, Message::Set(_)) {
                self.refusal = Some(text.to_owned());
            }
            driver.push_event(DriverEvent::Garbled { bytes_count: buffer.len() });
        }
    }

    /// Removes bytes that answer nothing in flight: unsolicited or late values, an `ack` to no command, and the end of
    /// an answer that was known before it came.
    fn pass_over(&mut self, message: Message) {
        loop {
            let end = self.buffer.iter().position(|byte| *byte == b'\n');
            let line = end.and_then(|end| std::str::from_utf8(&self.buffer[..end]).ok());
            let is_other = |(name, value): (&str, &str)| {
                is_name(name)
                    && !matches!(message, Message::Get(asked) if asked == name)
                    && number(name, value.trim()).is_some()
            };
            let passed_count = match message {
                _ if self.buffer.first().is_some_and(u8::is_ascii_whitespace) => 1,
                Message::Get(_) if self.buffer.starts_with(ACKNOWLEDGED) => ACKNOWLEDGED.len(),
                _ if line.and_then(|line| line.split_once(' ')).is_some_and(is_other) => end.unwrap_or_default() + 1,
                _ => return,
            };
            self.buffer.drain(..passed_count);
        }
    }

    fn take_value(&mut self, driver: &mut DriverState, name: &str, value: u8) -> bool {
        match name {
            "STA" if value <= 3 => self.status.activation = value,
            "OBJ" if value <= 3 => self.status.object = value,
            "PRE" => self.status.position_asked = value,
            "POS" => self.status.position = Some(value),
            "FLT" => self.status.fault = value & 0xF,
            "FOR" => driver.settle_target(driver.config.force_of_count(value)),
            _ => return false,
        }
        let place = QUESTIONS.iter().position(|question| *question == name);
        if let (Some(place), Some(is_heard)) = (place, &mut self.is_heard) {
            is_heard[place] = true;
        }
        true
    }
}

/// Whether no further digit can follow: the states have one, and no number has more than three.
fn is_full(name: &str, answer: &[u8]) -> bool {
    let value = answer.strip_prefix(name.as_bytes()).unwrap_or_default().trim_ascii();
    let digits_count = if matches!(name, "STA" | "OBJ") { 1 } else { 3 };
    value.len() == digits_count && value.iter().all(u8::is_ascii_digit)
}

/// Whether it may be the name of a value.
fn is_name(text: &str) -> bool {
    text.len() == 3 && text.bytes().all(|byte| byte.is_ascii_uppercase())
}

/// A value as a decimal or, with `0x` in front, a hexadecimal number. A fault that is no decimal one is hexadecimal.
fn number(name: &str, text: &str) -> Option<u8> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u8::from_str_radix(digits, 16).ok(),
        None if name == "FLT" => text.parse().or_else(|_| u8::from_str_radix(text, 16)).ok(),
        None => text.parse().ok(),
    }
}

impl Protocol for Socket {
    fn linked(&mut self, driver: &mut DriverState) {
        let Socket { received_ns, ends_lines, .. } = *self;
        let actuator = self.actuator.relinked(driver);
        *self = Socket { received_ns, ends_lines, actuator, ..Socket::default() };
    }

    fn receive(&mut self, driver: &mut DriverState, mut bytes: &[u8]) {
        self.received_ns = driver.now_ns();
        while !bytes.is_empty() {
            let room = (LONGEST + 1).saturating_sub(self.buffer.len()).min(bytes.len());
            self.buffer.extend_from_slice(&bytes[..room]); // a full buffer is read, as an answer or as garbage
            bytes = &bytes[room..];
            self.read_answer(driver);
        }
        // An answer without an end counts only after a moment, but shows at once that the gripper is there.
        let awaited = self.in_flight.as_ref().map(|sent| sent.message);
        if matches!(awaited, Some(Message::Get(name)) if self.buffer.starts_with(name.as_bytes())) {
            driver.heard();
        }
    }

    fn tick(&mut self, driver: &mut DriverState) {
        self.read_answer(driver);
        match InFlight::take_overdue(&mut self.in_flight, driver.now_ns(), driver.config.reply_ms)
            .map(|sent| sent.message)
        {
            Some(Message::Set(goal)) => {
                // It may have arrived: the same request is sent again when repeated.
                self.actuator.give_up(driver, goal);
                self.done = Goal::Keep;
                match self.refusal.take() {
                    Some(words) => driver.raise_refused("SET", format!("`{words}`")),
                    None => driver.raise_unanswered("SET"),
                }
            }
            // Half an answer: whether it ends its lines is to be seen anew.
            Some(Message::Get(_)) if !self.buffer.is_empty() => self.ends_lines = None,
            // A question is asked again in turn; silence is reported separately.
            Some(Message::Get(_)) | None => {}
        }
    }

    fn advance(&mut self, driver: &mut DriverState) {
        if self.in_flight.is_some() {
            return;
        }
        // A force that keeps changing must not displace the questions.
        let is_on_the_way = self.is_on_the_way();
        let asks = !is_on_the_way || (self.asks_first && self.changes_force_alone());
        let question = if asks { self.next_question(driver) } else { None };
        let (message, line) = match question {
            Some(name) => (Message::Get(name), format!("GET {name}")),
            // The status of the last round may have withdrawn the goal.
            None if is_on_the_way && self.actuator.goal != Goal::Keep => {
                let goal = self.actuator.goal;
                if !self.changes_force_alone() {
                    (self.question, self.round_ns, self.is_heard) = (0, None, None);
                }
                (Message::Set(goal), Socket::line(goal, driver))
            }
            None => return,
        };
        self.asks_first = matches!(message, Message::Set(_));
        self.refusal = None;
        self.buffer.clear();
        write_line(&mut driver.outgoing, &line);
        driver.asked();
        self.in_flight = Some(InFlight::new(driver.now_ns(), message));
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        self.actuator.check_ready(driver)
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        self.actuator.grip(driver, command);
        Ok(())
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        self.actuator.home(driver)?;
        self.done = Goal::Keep;
        Ok(())
    }

    fn force_on_its_way(&self, _driver: &DriverState) -> Option<f64> {
        match self.in_flight.as_ref()?.message {
            Message::Set(goal) => goal.force_n(),
            _ => None,
        }
    }

    fn jaws_untold_since_ns(&self, _driver: &DriverState) -> Option<u64> {
        (self.misses_count >= MISSES_COUNT).then_some(self.actuator.status_ns)
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        let message = self.in_flight.as_ref().map(|sent| sent.message);
        let is_setting = matches!(message, Some(Message::Set(_)));
        // The force is awaited once: not every gripper tells it.
        let awaits_force = match self.force_asked_count {
            0 => driver.is_linked() && driver.gripper.target_n.is_none(),
            count => count == 1 && message == Some(Message::Get("FOR")),
        };
        awaits_force || is_setting || self.is_on_the_way() || self.actuator.is_busy(driver)
    }
}
