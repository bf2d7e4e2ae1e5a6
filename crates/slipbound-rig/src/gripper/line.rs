//! The line protocol: a text protocol for anyone who already controls a gripper by another driver. It is described in
//! docs/grippers.md; a wrist uses it too ([`crate::wrist`]).

mod message;

pub use message::{Answer, VERSION, ask, number_of};

use super::driver_state::DriverState;
use super::error::Error;
use super::goal::Goal;
use super::protocol::Protocol;
use crate::link::{InFlight, Lines, write_line};
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// Difference between an accepted force and the reported one that the steps of a gripper explain, N per finger.
const STEP_N: f64 = 0.5;

/// Whether the steps of a gripper explain the difference between these forces, N per finger.
fn is_same(one_n: f64, other_n: f64) -> bool {
    (one_n - other_n).abs() <= STEP_N
}

/// A command with its number.
#[derive(Debug, Clone)]
struct Command {
    number: u64,
    words: String,
    goal: Goal,
}

/// The protocol.
#[derive(Debug, Default)]
pub struct LineGripper {
    lines: Lines,
    /// Number of the last command sent.
    number: u64,
    goal: Goal,
    /// The goal whose command was last accepted; `Keep` where that is not known.
    done: Goal,
    in_flight: Option<InFlight<Command>>,
    /// Since when another force than the accepted one is reported, ns.
    differs_ns: Option<u64>,
    /// The last accepted force that was found replaced, and the force that was reported instead, N per finger.
    replaced_n: Option<(f64, f64)>,
    is_greeted: bool,
    /// A greeting of another version: nothing is understood on this link.
    other_version: Option<u32>,
    is_stated: bool,
}

impl LineGripper {
    fn send(&mut self, driver: &mut DriverState, words: &str) -> u64 {
        self.number += 1;
        write_line(&mut driver.outgoing, &format!("{} {words}", self.number));
        self.number
    }

    fn take(&mut self, driver: &mut DriverState, line: Option<&str>) {
        let Some(answer) = line.and_then(Answer::parse) else {
            return driver.push_event(DriverEvent::Garbled { bytes_count: line.map_or(1, str::len) });
        };
        match answer {
            Answer::Hello(version) => {
                if !std::mem::replace(&mut self.is_greeted, true) {
                    driver.heard();
                }
                self.other_version = Some(version).filter(|version| *version != VERSION);
            }
            Answer::Wrist(_) => {}
            Answer::Gripper(rest) => {
                driver.heard(); // nothing else tells that the state is new
                if self.other_version.is_none() {
                    self.take_state(driver, rest);
                }
            }
            Answer::Ack { number, words } => {
                if let Some(sent) = self.take_in_flight(number) {
                    self.take_over(driver, &sent, words);
                }
            }
            Answer::Err { number, why } => {
                if let Some(sent) = self.take_in_flight(number) {
                    self.goal = self.goal.after_failure(sent.goal);
                    driver.raise_refused("a command", format!("`{why}`"));
                }
            }
        }
    }

    fn take_in_flight(&mut self, number: u64) -> Option<Command> {
        self.in_flight.take_if(|sent| sent.message.number == number).map(|sent| sent.message)
    }

    /// The other side has accepted a command, in these words.
    fn take_over(&mut self, driver: &mut DriverState, sent: &Command, words: &str) {
        if sent.words != words {
            (self.goal, self.done) = (self.goal.after_failure(sent.goal), Goal::Keep);
            let got = format!("`{words}` taken over instead of `{}`", sent.words);
            return driver.raise_refused("a command", got);
        }
        (self.done, self.differs_ns) = (sent.goal, None);
        match sent.goal {
            Goal::Hold { force_n } => driver.settle_target(Some(force_n)),
            Goal::Home | Goal::Acknowledge => self.goal = Goal::Keep,
            Goal::Open | Goal::Keep => {}
        }
    }

    /// Our force counts while it is in effect; after a new link, and where it has been replaced, the other side's does.
    /// One that comes back although ours was accepted again is what the gripper makes of ours, by its steps or limits.
    fn take_target(&mut self, driver: &mut DriverState, target_n: Option<f64>) {
        let pair_n = self.done.force_n().zip(target_n);
        let is_ours = pair_n.is_some_and(|(ours_n, theirs_n)| is_same(ours_n, theirs_n));
        if is_ours {
            self.replaced_n = None;
        }
        let is_known = pair_n.zip(self.replaced_n).is_some_and(|((ours_n, theirs_n), (replaced_n, reported_n))| {
            ours_n == replaced_n && is_same(theirs_n, reported_n)
        });
        if self.has_differed(driver, pair_n.is_some() && !is_ours && !is_known) {
            (self.goal, self.done, self.replaced_n) = (Goal::Keep, Goal::Keep, pair_n);
        }
        if is_known || !matches!(self.done, Goal::Hold { .. }) {
            driver.settle_target(target_n);
        }
    }

    /// Whether the other side has reported another force than it accepted for longer than an answer takes. Jaws that do
    /// not hold may have been opened by somebody: our force sent again would close them.
    fn has_differed(&mut self, driver: &DriverState, differs: bool) -> bool {
        let is_settled = driver.gripper.jaws == Jaws::Holding && self.in_flight.is_none() && !self.is_on_the_way();
        self.differs_ns = (differs && is_settled).then(|| self.differs_ns.unwrap_or(driver.now_ns()));
        let most_ns = driver.config.reply_ms * 1_000_000;
        self.differs_ns.is_some_and(|since_ns| driver.now_ns().saturating_sub(since_ns) > most_ns)
    }

    fn take_state(&mut self, driver: &mut DriverState, rest: &str) {
        let word = rest.split_whitespace().skip_while(|word| *word != "jaws").nth(1).unwrap_or(Jaws::Unknown.name());
        let known: Option<Jaws> = word.parse().ok();
        let jaws = known.unwrap_or(Jaws::Unknown);
        if jaws == Jaws::Stopped && driver.gripper.jaws != Jaws::Stopped {
            driver.push_event(DriverEvent::FastStop { why: "the other side says so".into() });
            (self.goal, self.done) = (Goal::Keep, Goal::Keep);
        }
        let force_n = |key| number_of(rest, key).and_then(|own_n| driver.config.from_own_n(own_n));
        let (measured_n, target_n) = (force_n("force_n"), force_n("target_n").filter(|n| *n >= 0.0));
        driver.gripper.time_ns = driver.now_ns();
        driver.gripper.jaws = jaws;
        driver.gripper.force_n = measured_n;
        self.take_target(driver, target_n);
        driver.gripper.opening_mm = number_of(rest, "opening_mm").filter(|mm| (-10.0..=1000.0).contains(mm));
        self.is_stated |= known.is_some();
        if known.is_none() {
            driver.raise_fault(Error::Jaws { address: driver.address(), got: word.into() });
        }
    }

    fn is_on_the_way(&self) -> bool {
        self.goal != Goal::Keep && self.goal != self.done
    }
}

impl Protocol for LineGripper {
    fn linked(&mut self, driver: &mut DriverState) {
        // Until it says what they are now.
        (driver.gripper.jaws, driver.gripper.opening_mm, driver.gripper.force_n) = (Jaws::Unknown, None, None);
        driver.settle_target(None);
        *self = LineGripper { number: self.number, ..LineGripper::default() };
    }

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(driver, line));
        self.lines = lines;
    }

    fn tick(&mut self, driver: &mut DriverState) {
        if let Some(sent) = InFlight::take_overdue(&mut self.in_flight, driver.now_ns(), driver.config.reply_ms) {
            let goal = sent.message.goal;
            driver.doubt_target(goal.force_n());
            // It may have arrived: the other side reports the force with which it holds.
            (self.goal, self.done) = (self.goal.after_failure(goal), Goal::Keep);
            driver.raise_unanswered("a command");
        }
    }

    fn advance(&mut self, driver: &mut DriverState) {
        if self.in_flight.is_some() || !self.is_on_the_way() {
            return;
        }
        let words = match self.goal {
            Goal::Keep => return,
            Goal::Hold { force_n } => ask("GRASP", &[("force_n", driver.config.to_own_n(force_n))]),
            Goal::Open => ask("RELEASE", &[("opening_mm", driver.release_mm())]),
            Goal::Home => ask("HOME", &[]),
            Goal::Acknowledge => ask("ACKNOWLEDGE", &[]),
        };
        let number = self.send(driver, &words);
        self.in_flight = Some(InFlight::new(driver.now_ns(), Command { number, words, goal: self.goal }));
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        if !self.is_stated {
            return Err(Error::NotReady { address: driver.address(), expected: "a GRIPPER line" });
        }
        if driver.gripper.jaws == Jaws::Stopped {
            return Err(Error::FastStop { address: driver.address(), why: "the other side says so".into() });
        }
        Ok(())
    }

    fn grip(&mut self, _driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        self.goal = command.into();
        Ok(())
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        self.check_ready(driver)?;
        // Jaws that must be homed first may accept no release: only homing is left then. Jaws that report no opening
        // are open when they say so.
        let GripperState { jaws, opening_mm, .. } = driver.gripper;
        let says_open = jaws == Jaws::Open && opening_mm.is_none();
        if jaws != Jaws::Unknown && !says_open && driver.seems_to_hold() {
            return Err(driver.home_while_holding());
        }
        (self.goal, self.done) = (Goal::Home, Goal::Keep);
        Ok(())
    }

    fn acknowledge(&mut self, _driver: &mut DriverState) -> Result<(), Error> {
        (self.goal, self.done) = (Goal::Acknowledge, Goal::Keep);
        Ok(())
    }

    fn leave(&mut self, driver: &mut DriverState) {
        self.send(driver, "BYE");
    }

    fn force_on_its_way(&self, _driver: &DriverState) -> Option<f64> {
        self.in_flight.as_ref().and_then(|sent| sent.message.goal.force_n())
    }

    fn check_version(&self, driver: &DriverState) -> Result<(), Error> {
        let Some(version) = self.other_version else { return Ok(()) };
        let got = format!("version {version}, expected {VERSION}");
        Err(Error::Refused { address: driver.address(), command: "HELLO", got })
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        let is_new = driver.is_linked() && !self.is_stated;
        is_new || self.in_flight.is_some() || self.is_on_the_way()
    }
}
