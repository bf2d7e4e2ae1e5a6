//! The 2F-85 by Modbus RTU.

use super::actuator::{Actuator, Goal};
use super::rtu::{self, Answer, Parser};
use super::status::{Status, bit};
use crate::gripper::config::Config;
use crate::gripper::driver_state::DriverState;
use crate::gripper::error::Error;
use crate::gripper::protocol::Protocol;
use crate::link::InFlight;
use slipbound::port::{DriverEvent, GripCommand};

/// How often an unanswered request is sent again before it is reported.
const REPEATS_COUNT: u32 = 2;

/// Most answers taken from what is received at once: one request is in flight, so one answer is expected.
const MOST_ANSWERS: usize = 8;

/// A message to the gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Message {
    Read,
    Write { goal: Goal, outputs: [u8; 6] },
}

/// The protocol.
#[derive(Debug, Default)]
pub struct Serial {
    parser: Parser,
    actuator: Actuator,
    /// The outputs that the gripper is known to have accepted last; None where that is not known.
    outputs: Option<[u8; 6]>,
    in_flight: Option<InFlight<Message>>,
    read_ns: Option<u64>,
    /// Whether a read is due before the next write that changes the force alone.
    reads_first: bool,
}

fn outputs(goal: Goal, config: &Config) -> Option<[u8; 6]> {
    match goal {
        Goal::Keep => None,
        Goal::Deactivate => Some([0; 6]),
        Goal::Activate => Some([bit::ACTIVATE, 0, 0, 0, 0, 0]),
        Goal::Hold { .. } | Goal::Open { .. } => {
            let to = goal.target(config)?;
            Some([bit::ACTIVATE | bit::GO_TO, 0, 0, to.position, to.speed, to.force])
        }
    }
}

impl Serial {
    /// The outputs for the goal, where the gripper does not have them yet.
    fn wanted(&self, driver: &DriverState) -> Option<[u8; 6]> {
        outputs(self.actuator.goal, &driver.config).filter(|wanted| self.outputs != Some(*wanted))
    }

    fn changes_force_alone(&self, wanted: &[u8; 6]) -> bool {
        self.outputs.is_some_and(|outputs| outputs[..5] == wanted[..5])
    }

    fn send(&mut self, driver: &mut DriverState, sent: InFlight<Message>) {
        self.parser.clear();
        match sent.message {
            Message::Read => rtu::request_read(&mut driver.outgoing),
            Message::Write { outputs, .. } => rtu::request_write(&mut driver.outgoing, outputs),
        }
        driver.asked();
        self.in_flight = Some(sent);
    }

    fn take(&mut self, driver: &mut DriverState, answer: Answer) {
        let Some(sent) = &self.in_flight else { return };
        match (sent.message, answer) {
            (Message::Read, Answer::Inputs(bytes)) => {
                if self.actuator.take_status(driver, Status::from_bytes(bytes)) {
                    self.outputs = None;
                }
            }
            (Message::Write { goal, outputs }, Answer::Written) => {
                self.outputs = Some(outputs);
                self.actuator.take_over(driver, goal);
            }
            (Message::Read, Answer::Refused(code)) => driver.raise_refused("read", format!("Modbus exception {code}")),
            (Message::Write { goal, .. }, Answer::Refused(code)) => {
                self.actuator.abandon(goal);
                driver.raise_refused("write", format!("Modbus exception {code}"));
            }
            _ => return, // the answer to an abandoned request
        }
        driver.heard();
        self.in_flight = None;
    }
}

impl Protocol for Serial {
    fn linked(&mut self, driver: &mut DriverState) {
        *self = Serial { actuator: self.actuator.relinked(driver), ..Serial::default() };
    }

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        let mut answers = [None; MOST_ANSWERS];
        let mut count = 0;
        self.parser.feed_answers(bytes, |answer| {
            if let Some(slot) = answers.get_mut(count) {
                *slot = Some(answer);
                count += 1;
            }
        });
        let bytes_count = self.parser.take_passed_over_count();
        if bytes_count > 0 {
            driver.push_event(DriverEvent::Garbled { bytes_count });
        }
        for answer in answers.into_iter().flatten() {
            self.take(driver, answer);
        }
    }

    fn tick(&mut self, driver: &mut DriverState) {
        match InFlight::take_overdue(&mut self.in_flight, driver.now_ns(), driver.config.reply_ms) {
            Some(sent) if sent.sent_count <= REPEATS_COUNT => {
                let sent = sent.again(driver.now_ns());
                self.send(driver, sent);
            }
            Some(InFlight { message: Message::Write { goal, .. }, .. }) => {
                // It may have arrived: the same outputs are written again when requested again.
                self.actuator.give_up(driver, goal);
                self.outputs = None;
                driver.raise_unanswered("write");
            }
            // A read is sent again in turn; silence is reported separately.
            Some(InFlight { message: Message::Read, .. }) | None => {}
        }
    }

    fn advance(&mut self, driver: &mut DriverState) {
        if self.in_flight.is_some() {
            return;
        }
        let (now_ns, period_ns) = (driver.now_ns(), driver.config.update_ms * 1_000_000);
        let is_read_due = self.read_ns.is_none_or(|read_ns| now_ns.saturating_sub(read_ns) >= period_ns);
        // A force that keeps changing must not displace the reads.
        let reads_first = |wanted: &[u8; 6]| self.reads_first && is_read_due && self.changes_force_alone(wanted);
        let message = match self.wanted(driver).filter(|wanted| !reads_first(wanted)) {
            Some(outputs) => Message::Write { goal: self.actuator.goal, outputs },
            None if is_read_due => {
                self.read_ns = Some(now_ns);
                Message::Read
            }
            None => return,
        };
        self.reads_first = message != Message::Read;
        let sent = InFlight::new(driver.now_ns(), message);
        self.send(driver, sent);
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
        self.outputs = None; // of an earlier homing: it is to be answered again
        Ok(())
    }

    fn force_on_its_way(&self, _driver: &DriverState) -> Option<f64> {
        match self.in_flight.as_ref()?.message {
            Message::Write { goal, .. } => goal.force_n(),
            _ => None,
        }
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        let is_writing = self.in_flight.as_ref().is_some_and(|sent| sent.message != Message::Read);
        is_writing || self.wanted(driver).is_some() || self.actuator.is_busy(driver)
    }
}
