//! Weiss WSG-50, text interface (Gripper Control Language).
//!
//! The protocol asks for position, force and state in turn and has one question or command in flight at a time. In the
//! manual's basic commands the force is only a part of `GRIP`, and `GRIP` is not possible while a part is held: a new
//! force while holding is sent once, and refused from then on if the gripper refuses it. For a force that follows the
//! slip use the binary interface.

mod message;
mod motion;
mod questions;

use super::config::Config;
use super::driver_state::DriverState;
use super::error::Error;
use super::goal::Goal;
use super::protocol::Protocol;
use super::wsg50::words::{LINK_CUT, grasp, status};
use crate::link::{InFlight, Lines, write_line};
use message::{Message, QUESTIONS, is_name};
use motion::Motion;
use questions::Questions;
use slipbound::port::{DriverEvent, GripCommand, Jaws};

/// A grip that ended in an error, until the gripper's state shows the outcome.
#[derive(Debug)]
struct FailedGrip {
    why: String,
    since_ns: u64,
}

/// The protocol.
#[derive(Debug, Default)]
pub struct Gcl {
    lines: Lines,
    questions: Questions,
    /// Whether a question is due before the next grip after an answered one.
    asks_first: bool,
    goal: Goal,
    in_flight: Option<InFlight<Message>>,
    motion: Option<Motion>,
    /// The motion that our STOP has ended, until the gripper reports its end.
    stopped: Option<&'static str>,
    failed_grip: Option<FailedGrip>,
    /// The force of the last grip that was answered, N per finger.
    gripped_n: Option<f64>,
    /// The same for the previous link, until the state shows whether it still holds.
    gripped_before_n: Option<f64>,
    /// Whether a later command was never answered: it may have arrived.
    is_in_doubt: bool,
    /// Whether any command was ever sent: what is held until then was gripped by somebody else.
    has_commanded: bool,
    is_release_given: bool,
    is_stopped: bool,
    /// Whether it has reported that it must be homed first.
    is_unhomed: bool,
    is_regrip_refused: bool,
}

impl Gcl {
    fn send(&mut self, driver: &mut DriverState, message: Message, line: &str) {
        write_line(&mut driver.outgoing, line);
        driver.asked();
        self.asks_first = !matches!(message, Message::Question(_));
        self.has_commanded |= self.asks_first;
        self.in_flight = Some(InFlight::new(driver.now_ns(), message));
    }

    fn command(&mut self, driver: &mut DriverState, name: &'static str) {
        self.send(driver, Message::Command(name), &format!("{name}()"));
    }

    fn send_grip(&mut self, driver: &mut DriverState, force_n: f64) {
        let Config { speed_mm_per_s, part_width_mm, .. } = driver.config;
        let own_n = driver.config.to_own_n(force_n);
        let line = match part_width_mm {
            Some(width_mm) => format!("GRIP({own_n:.2},{width_mm:.2},{speed_mm_per_s:.2})"),
            None => format!("GRIP({own_n:.2})"),
        };
        self.send(driver, Message::Grip { force_n }, &line);
    }

    fn open(&mut self, driver: &mut DriverState) {
        let (open_mm, speed_mm_per_s) = (driver.release_mm(), driver.config.speed_mm_per_s);
        self.is_release_given = true;
        self.gripped_n = None;
        match driver.gripper.opening_mm.filter(|_| self.is_holding()) {
            Some(from_mm) => {
                // The opening is told in hundredths of a mm: beyond the stroke the release would be refused.
                let way_mm = open_mm.min(driver.config.stroke_mm() - 0.01) - from_mm;
                let way_mm = way_mm.max(0.0);
                let line = format!("RELEASE({way_mm:.2},{speed_mm_per_s:.2})");
                self.send(driver, Message::Command("RELEASE"), &line);
            }
            None => {
                self.send(driver, Message::Command("MOVE"), &format!("MOVE({open_mm:.2},{speed_mm_per_s:.2})"));
            }
        }
    }

    /// The next question. Returns whether one was due.
    fn ask(&mut self, driver: &mut DriverState) -> bool {
        let Some(name) = self.questions.next_due(driver) else { return false };
        self.send(driver, Message::Question(name), &format!("{name}?"));
        true
    }

    /// What the jaws do after a stop.
    fn ask_for_grasp(&mut self, driver: &mut DriverState) {
        self.questions.put_grasp_first();
        self.ask(driver);
    }

    fn take(&mut self, driver: &mut DriverState, line: Option<&str>) {
        let Some(line) = line else {
            return driver.push_event(DriverEvent::Garbled { bytes_count: 1 });
        };
        if let Some((name, value)) = line.split_once('=') {
            // With this mark a value is unsolicited, and answers no question.
            let (name, is_answer) = name.strip_prefix('@').map_or((name, true), |name| (name, false));
            return self.take_value(driver, name, value, is_answer);
        }
        let mut words = line.split_whitespace();
        let (kind, name) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        match kind {
            "ACK" => self.take_answer(driver, name),
            "FIN" => {
                driver.heard();
                self.motion.take_if(|motion| motion.name == name);
                self.stopped.take_if(|stopped| *stopped == name);
            }
            "ERR" => {
                let (name, code) = match words.next() {
                    Some(code) => (name, code),
                    None => (self.meant(), name),
                };
                self.take_error(driver, name, code);
            }
            "" | "END" => {}
            _ => driver.push_event(DriverEvent::Garbled { bytes_count: line.len() }),
        }
    }

    fn take_value(&mut self, driver: &mut DriverState, name: &str, value: &str, is_answer: bool) {
        // No finite number is an answer all the same: the value is unknown.
        let number = value.parse::<f64>().ok();
        if number.is_some() && is_name(name) && !QUESTIONS.contains(&name) {
            return driver.heard(); // a value that somebody else has asked for
        }
        let Some(number) = number.filter(|_| QUESTIONS.contains(&name)) else {
            return driver.push_event(DriverEvent::Garbled { bytes_count: name.len() + value.len() });
        };
        driver.heard();
        if is_answer {
            self.take_in_flight(name);
        }
        self.questions.take(driver, name, Some(number));
        if name == "GRIPSTATE" {
            self.take_grasp(driver);
        }
        driver.gripper.jaws = self.jaws();
    }

    /// A new state of the jaws.
    fn take_grasp(&mut self, driver: &mut DriverState) {
        let grasp = self.questions.grasp;
        if grasp.is_some_and(|grasp| grasp != grasp::ERROR) && !self.is_stopped {
            driver.forget_lost_link(); // it has latched nothing
        }
        if let Some(force_n) = self.gripped_before_n.take().filter(|_| self.is_holding()) {
            self.gripped_n = Some(force_n);
        }
        self.end_untold_motion(driver);
        if grasp != Some(grasp::GRASPING) {
            self.report_failed_grip(driver);
        }
    }

    fn jaws(&self) -> Jaws {
        if self.is_stopped { Jaws::Stopped } else { grasp::jaws(self.questions.grasp) }
    }

    /// The end of a motion of which nothing was understood: the state of the jaws shows what became of it.
    fn end_untold_motion(&mut self, driver: &mut DriverState) {
        let (grasp, now_ns, wait_ns) = (self.questions.grasp, driver.now_ns(), driver.config.reply_ms * 1_000_000);
        let Some(motion) = self.motion.take_if(|motion| motion.has_ended(grasp, now_ns, wait_ns)) else { return };
        match (motion.name, grasp) {
            ("GRIP", Some(grasp::HOLDING | grasp::NO_PART | grasp::PART_LOST)) => {}
            ("GRIP", _) => self.refuse_grip(driver, self.gripped_n, "an end that was not understood".into()),
            (_, Some(grasp::IDLE)) => {}
            (name, _) => self.forget_release(name),
        }
    }

    fn take_in_flight(&mut self, name: &str) -> Option<Message> {
        self.in_flight.take_if(|sent| sent.message.name() == name).map(|sent| sent.message)
    }

    fn take_answer(&mut self, driver: &mut DriverState, name: &str) {
        let Some(message) = self.take_in_flight(name) else { return };
        driver.heard();
        match message {
            Message::Grip { force_n } => {
                (self.gripped_n, self.is_in_doubt, self.is_release_given) = (Some(force_n), false, false);
                self.failed_grip = None;
                driver.settle_target(Some(force_n));
            }
            Message::Command("STOP") => {
                self.stopped = self.motion.take().map(|motion| motion.name);
                (self.gripped_n, self.is_release_given, self.questions.is_grasp_old) = (None, false, true);
            }
            Message::Command("FSACK") => {
                (self.is_stopped, self.gripped_n, self.is_release_given) = (false, None, false);
                driver.forget_lost_link();
            }
            Message::Command(_) | Message::Question(_) => {}
        }
        if matches!(message.name(), "HOME" | "MOVE" | "GRIP" | "RELEASE") {
            self.is_unhomed = false;
            self.motion = Some(Motion::new(message.name(), driver.now_ns(), self.questions.grasp));
        }
    }

    /// The subject of an error without a name: the command in flight, or else the motion; a question hardly fails.
    fn meant(&self) -> &'static str {
        match (&self.in_flight, self.motion) {
            (Some(InFlight { message: Message::Question(_), .. }) | None, Some(motion)) => motion.name,
            (Some(sent), _) => sent.message.name(),
            (None, None) => "",
        }
    }

    fn take_error(&mut self, driver: &mut DriverState, name: &str, code: &str) {
        driver.heard();
        let (status, why) = (status::read(code), status::answered(code));
        let is_aborted = status == status::ABORTED;
        if is_aborted && self.stopped.take_if(|stopped| *stopped == name).is_some() {
            return;
        }
        // A command that has not begun is not aborted: the answer is for the motion before it.
        let ends_motion = is_aborted && self.motion.is_some_and(|motion| motion.name == name);
        let sent = if ends_motion { None } else { self.take_in_flight(name) };
        if let Some(Message::Question(name)) = sent {
            self.questions.take(driver, name, None);
            driver.gripper.jaws = self.jaws();
            return;
        }
        let name = match sent {
            Some(message) => {
                self.goal = self.goal.after_failure(message.goal());
                message.name()
            }
            None => match self.motion.take_if(|motion| motion.name == name) {
                Some(motion) => {
                    if !is_aborted {
                        self.forget_release(motion.name);
                    }
                    motion.name
                }
                None => return,
            },
        };
        let is_superseded =
            || self.in_flight.as_ref().is_some_and(|sent| !matches!(sent.message, Message::Question(_)));
        match (name, status) {
            (_, status::ABORTED) if sent.is_none() && (name != "GRIP" || is_superseded()) => {}
            // The state, which is asked in turn, shows that no part was found.
            ("GRIP", status::FAILED | status::ABORTED) if sent.is_none() => {
                self.failed_grip = Some(FailedGrip { why, since_ns: driver.now_ns() });
            }
            ("GRIP", status::DENIED) if self.is_holding() => {
                self.is_regrip_refused = true;
                // A command that was never answered was denied as well: it holds with the last answered one.
                self.is_in_doubt = false;
                if self.goal != Goal::Open {
                    self.goal = Goal::Keep; // a newer force would be denied as well
                }
                driver.settle_target(self.gripped_n);
                driver.raise_refused("a new force while holding", "a GRIP that is denied; take wsg50://");
            }
            (_, status::DENIED) => {
                (self.goal, self.is_stopped) = (Goal::Keep, true);
                let why_stopped = self.why_stopped(driver);
                driver.push_event(DriverEvent::FastStop { why: why_stopped });
                driver.gripper.jaws = Jaws::Stopped;
                driver.raise_refused(name, why);
            }
            (_, status) => {
                self.is_unhomed |= status == status::NOT_INITIALIZED;
                match name {
                    "GRIP" => self.refuse_grip(driver, sent.and_then(Message::force_n).or(self.gripped_n), why),
                    _ => driver.raise_refused(name, why),
                }
            }
        }
    }

    /// A failed grip was refused, unless the state shows that no part was found or that it was lost.
    fn report_failed_grip(&mut self, driver: &mut DriverState) {
        let Some(failed) = self.failed_grip.take() else { return };
        if !matches!(self.questions.grasp, Some(grasp::NO_PART | grasp::PART_LOST)) {
            self.refuse_grip(driver, self.gripped_n, failed.why);
        }
    }

    /// The gripper did not grip with `force_n`, N per finger; the command is sent again when it is requested again.
    fn refuse_grip(&mut self, driver: &mut DriverState, force_n: Option<f64>, why: String) {
        if !self.is_holding() {
            let failed = Goal::Hold { force_n: force_n.or(self.goal.force_n()).unwrap_or_default() };
            (self.goal, self.gripped_n) = (self.goal.after_failure(failed), None);
        }
        driver.raise_refused("GRIP", why);
    }

    /// An opening motion that failed is given again with the next command to release. One that somebody aborted is not.
    fn forget_release(&mut self, name: &str) {
        if matches!(name, "RELEASE" | "MOVE") && self.goal == Goal::Open {
            self.goal = Goal::Keep;
        }
    }

    /// Whether the gripper is known to have accepted this force, N per finger.
    fn has_gripped(&self, force_n: f64) -> bool {
        self.gripped_n == Some(force_n) && !self.is_in_doubt
    }

    /// A force with which it holds since before our first command, within the error of its reading, is in effect: a
    /// GRIP would be denied.
    fn adopt_grip(&mut self, driver: &mut DriverState, force_n: f64) {
        let is_measured =
            driver.gripper.force_n.is_some_and(|reading_n| driver.config.is_reading_of(reading_n, force_n));
        if self.is_holding() && !self.has_commanded && self.gripped_n.is_none() && is_measured {
            self.gripped_n = Some(force_n);
            driver.settle_target(Some(force_n));
        }
    }

    fn is_holding(&self) -> bool {
        self.questions.grasp == Some(grasp::HOLDING) && !self.questions.is_grasp_old
    }

    fn why_stopped(&self, driver: &DriverState) -> String {
        if driver.has_lost_link() {
            LINK_CUT.into()
        } else {
            "a command was denied; a fast stop is the likely cause (this interface does not tell)".into()
        }
    }
}

impl Protocol for Gcl {
    fn linked(&mut self, driver: &mut DriverState) {
        self.is_in_doubt |= self.force_on_its_way(driver).is_some();
        // The force it was last commanded, and a fast stop, outlive a link.
        let gripped_before_n = self.gripped_n.or(self.gripped_before_n);
        let Gcl { is_in_doubt, has_commanded, is_stopped, is_unhomed, is_regrip_refused, .. } = *self;
        *self = Gcl {
            questions: Questions::new(driver.now_ns()),
            gripped_before_n,
            is_in_doubt,
            has_commanded,
            is_stopped,
            is_unhomed,
            is_regrip_refused,
            ..Gcl::default()
        };
        (driver.gripper.jaws, driver.gripper.opening_mm, driver.gripper.force_n) = (Jaws::Unknown, None, None);
    }

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(driver, line));
        self.lines = lines;
    }

    fn tick(&mut self, driver: &mut DriverState) {
        match InFlight::take_overdue(&mut self.in_flight, driver.now_ns(), driver.config.reply_ms)
            .map(|sent| sent.message)
        {
            None => {}
            // It is asked again in turn; silence is reported separately.
            Some(Message::Question(name)) => self.questions.miss(driver, name),
            // It may have arrived: the same request is sent again when repeated.
            Some(message) => {
                // A stop that was never answered was to make way for the goal.
                if message != Message::Command("STOP") {
                    self.goal = self.goal.after_failure(message.goal());
                }
                (self.is_in_doubt, self.is_release_given) = (true, false);
                driver.doubt_target(message.force_n());
                driver.raise_unanswered(message.name());
            }
        }
        let (now_ns, motion_ns) = (driver.now_ns(), driver.config.motion_ms * 1_000_000);
        if let Some(motion) = self.motion.take_if(|motion| now_ns.saturating_sub(motion.since_ns) > motion_ns) {
            self.forget_release(motion.name);
            driver.raise_unfinished(motion.name);
        }
        let reply_ns = driver.config.reply_ms * 1_000_000;
        if self.failed_grip.as_ref().is_some_and(|failed| now_ns.saturating_sub(failed.since_ns) > reply_ns) {
            self.report_failed_grip(driver);
        }
    }

    fn advance(&mut self, driver: &mut DriverState) {
        if self.in_flight.is_some() {
            return;
        }
        let moving = self.motion.map(|motion| motion.name);
        match self.goal {
            Goal::Acknowledge => {
                self.goal = Goal::Keep;
                self.command(driver, "FSACK");
            }
            Goal::Home if !self.is_stopped => {
                (self.goal, self.gripped_n, self.is_release_given) = (Goal::Keep, None, false);
                self.command(driver, "HOME");
            }
            Goal::Hold { force_n } if !self.is_stopped && !self.has_gripped(force_n) => match moving {
                // A force that keeps changing must not displace the questions.
                _ if self.asks_first && self.gripped_n.is_some() && self.ask(driver) => {}
                Some(_) => self.command(driver, "STOP"),
                None if self.questions.is_grasp_old => self.ask_for_grasp(driver),
                None => self.send_grip(driver, force_n),
            },
            Goal::Open if !self.is_stopped && !self.is_release_given => match moving {
                Some("GRIP") => self.command(driver, "STOP"),
                // What it held before it was stopped decides nothing.
                _ if self.questions.is_grasp_old => self.ask_for_grasp(driver),
                _ => self.open(driver),
            },
            _ => {
                self.ask(driver);
            }
        }
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        if self.is_stopped {
            return Err(Error::FastStop { address: driver.address(), why: self.why_stopped(driver) });
        }
        if self.questions.grasp.is_none() {
            return Err(Error::NotReady { address: driver.address(), expected: "whether it holds something" });
        }
        Ok(())
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        match command {
            GripCommand::Hold { force_n } => {
                self.adopt_grip(driver, force_n);
                if self.is_holding() && self.is_regrip_refused && !self.has_gripped(force_n) {
                    let (address, command) = (driver.address(), "a new force while holding");
                    let got = "a GRIP that was denied before; take wsg50://".into();
                    return Err(Error::Refused { address, command, got });
                }
            }
            GripCommand::Release if self.goal != Goal::Open => {
                (self.is_release_given, self.is_regrip_refused) = (false, false);
            }
            GripCommand::Release => {}
        }
        self.goal = command.into();
        Ok(())
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        self.check_ready(driver)?;
        // It may press without reporting it. One that must be homed first accepts no release: only homing is left then.
        if !self.is_unhomed && driver.seems_to_hold() {
            return Err(driver.home_while_holding());
        }
        self.goal = Goal::Home;
        Ok(())
    }

    fn acknowledge(&mut self, _driver: &mut DriverState) -> Result<(), Error> {
        self.goal = Goal::Acknowledge;
        Ok(())
    }

    fn leave(&mut self, driver: &mut DriverState) {
        self.is_in_doubt |= self.force_on_its_way(driver).is_some();
        self.goal = Goal::Keep;
        self.command(driver, "BYE");
    }

    fn force_on_its_way(&self, _driver: &DriverState) -> Option<f64> {
        self.in_flight.as_ref().and_then(|sent| sent.message.force_n())
    }

    fn jaws_untold_since_ns(&self, _driver: &DriverState) -> Option<u64> {
        self.questions.grasp_untold_since_ns()
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        let is_on_the_way = match self.goal {
            Goal::Keep => false,
            Goal::Hold { force_n } => !self.has_gripped(force_n),
            Goal::Open => !self.is_release_given,
            Goal::Home | Goal::Acknowledge => true,
        };
        let is_answered = self.in_flight.as_ref().is_none_or(|sent| matches!(sent.message, Message::Question(_)));
        let is_new = driver.is_linked() && self.questions.grasp.is_none();
        is_new || is_on_the_way || self.motion.is_some() || !is_answered
    }
}
