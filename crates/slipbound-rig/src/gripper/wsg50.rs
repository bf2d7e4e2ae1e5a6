//! Weiss WSG-50, binary interface.
//!
//! The protocol first asks the gripper to send its states by itself, then has at most one command in flight at a time.
//! A command that is superseded before it was sent is never sent: the newest goal counts.
//!
//! ```text
//!   force F:  (stop, if it opens) -> limit F -> grasp, if not yet given since the last release
//!                                       '-> while holding: wait for the measured force to follow, else grasp again
//!   release:  (stop, if it closes) -> release, or move where nothing is held
//! ```

pub mod frame;
mod phase;
mod telemetry;
pub mod words;

use super::config::ForceChange;
use super::driver_state::DriverState;
use super::error::Error;
use super::goal::Goal;
use super::protocol::Protocol;
use crate::link::InFlight;
use frame::{Frame, Parser};
use phase::{Command, Phase};
use slipbound::port::{DriverEvent, GripCommand, Jaws};
use telemetry::Telemetry;
use words::status;

/// How often an unanswered command that may safely arrive twice is sent again.
const REPEATS_COUNT: u32 = 2;

/// Least change of force at which it can be seen whether the gripper follows, N per finger: several of its steps.
const FOLLOWS_FROM_N: f64 = 2.0;

/// The protocol.
#[derive(Debug, Default)]
pub struct Wsg50 {
    parser: Parser,
    telemetry: Telemetry,
    goal: Goal,
    phase: Phase,
    in_flight: Option<InFlight<Command>>,
    /// Answers to force limits that may still come: an unanswered limit is sent again.
    owed_count: u32,
    /// Since when the gripper is asked for its limit, after which no such answer can come, ns.
    verifying_ns: Option<u64>,
    /// Whether a limit was set during a grasp, with nothing held, or with an unknown force: whether the jaws have it is
    /// not known.
    is_limit_untried: bool,
    /// How a change of force last reached the jaws, as reported.
    force_path: Option<&'static str>,
}

impl Wsg50 {
    fn why_stopped(&self, driver: &DriverState) -> String {
        let faults = self.telemetry.faults();
        match (faults.is_empty(), driver.has_lost_link()) {
            (false, _) => faults,
            (true, true) => words::LINK_CUT.into(),
            (true, false) => {
                "no fault is reported: a link of another program was cut, or somebody sent a fast stop".into()
            }
        }
    }

    fn send(&mut self, driver: &mut DriverState, command: Command, payload: &[u8]) {
        frame::write(&mut driver.outgoing, command.id(), payload);
        self.in_flight = Some(InFlight::new(driver.now_ns(), command));
    }

    /// Sends a new limit, unless an answer to an earlier one could be mistaken for its own.
    fn approach_limit(&mut self, driver: &mut DriverState, own_n: f64) {
        let (now_ns, reply_ns) = (driver.now_ns(), driver.config.reply_ms * 1_000_000);
        match self.verifying_ns {
            Some(since_ns) if self.owed_count > 0 && now_ns.saturating_sub(since_ns) <= reply_ns => {}
            None if self.owed_count > 0 => {
                self.verifying_ns = Some(now_ns);
                self.telemetry.ask_limit(driver);
            }
            _ => {
                (self.owed_count, self.verifying_ns) = (0, None);
                self.send_limit(driver, own_n);
            }
        }
    }

    fn send_limit(&mut self, driver: &mut DriverState, own_n: f64) {
        self.owed_count += 1;
        self.send(driver, Command::SetLimit { own_n }, &(own_n as f32).to_le_bytes());
    }

    fn send_motion(&mut self, driver: &mut DriverState, command: Command, width_mm: f64) {
        let mut payload = Vec::with_capacity(9);
        if command == Command::Move {
            payload.push(0); // absolute, clamp on block
        }
        payload.extend((width_mm as f32).to_le_bytes());
        payload.extend((driver.config.speed_mm_per_s as f32).to_le_bytes());
        self.send(driver, command, &payload);
    }

    fn approach_force(&mut self, driver: &mut DriverState, force_n: f64) {
        let own_n = f64::from(driver.config.to_own_n(force_n) as f32);
        match self.phase {
            Phase::Homing { .. } | Phase::Opening { .. } => self.send(driver, Command::Stop, &[]),
            _ if self.telemetry.limit_own_n != Some(own_n) => self.approach_limit(driver, own_n),
            Phase::Idle | Phase::Opened => self.give_grasp(driver),
            Phase::Following { from_n, to_n, until_ns } => self.check_following(driver, from_n, to_n, until_ns),
            Phase::Grasped if self.may_try_limit(driver) => {
                self.is_limit_untried = false;
                self.follow(driver, own_n);
            }
            Phase::Grasping { .. } | Phase::Grasped => {}
        }
    }

    /// Whether it can be seen now if the force follows a limit that was set when it could not.
    fn may_try_limit(&self, driver: &DriverState) -> bool {
        self.is_limit_untried && self.telemetry.is_holding() && driver.gripper.force_n.is_some()
    }

    fn give_grasp(&mut self, driver: &mut DriverState) {
        let Some(width_mm) = driver.config.part_width_mm else {
            let is_following = matches!(self.phase, Phase::Following { .. });
            let command = if is_following { "a force that does not follow its limit" } else { "grasp" };
            (self.goal, self.phase) = (Goal::Keep, self.phase.ended());
            return driver.raise_fault(width_unset(driver, command));
        };
        (self.phase, self.is_limit_untried) = (Phase::Grasped, false);
        self.send_motion(driver, Command::Grasp, width_mm);
    }

    /// A grasp that was not accepted is given again with the next command to hold, if nothing is held.
    fn forget_grasp(&mut self, command: Command) {
        if command == Command::Grasp && !self.telemetry.is_holding() {
            self.phase = Phase::Idle;
        }
    }

    /// What is left of the goal once a command has failed: what was requested since stays.
    fn goal_after_failure(&self, driver: &DriverState, command: Command) -> Goal {
        let own_n = |force_n| f64::from(driver.config.to_own_n(force_n) as f32);
        let is_newer = match (command, self.goal) {
            (Command::SetLimit { own_n: sent_n }, Goal::Hold { force_n }) => own_n(force_n) != sent_n,
            (Command::Grasp, Goal::Hold { force_n }) => {
                self.telemetry.limit_own_n.is_some_and(|limit_n| own_n(force_n) != limit_n)
            }
            (Command::SetLimit { .. } | Command::Grasp, Goal::Open) => true,
            (Command::Release | Command::Move, Goal::Hold { .. }) => true,
            _ => false,
        };
        if is_newer { self.goal } else { Goal::Keep }
    }

    /// An opening motion that failed is given again with the next command to release.
    fn forget_release(&mut self, command: Command) {
        if matches!(command, Command::Release | Command::Move) && self.goal == Goal::Open {
            self.goal = Goal::Keep;
        }
    }

    fn open(&mut self, driver: &mut DriverState) {
        match self.phase {
            Phase::Opening { .. } | Phase::Opened => {}
            Phase::Grasping { .. } => self.send(driver, Command::Stop, &[]),
            // Whether it still holds what it held before it was stopped, the next state tells.
            Phase::Idle if self.telemetry.is_grasp_old && self.telemetry.is_holding() => {}
            Phase::Idle | Phase::Homing { .. } | Phase::Grasped | Phase::Following { .. } => {
                let command = if self.telemetry.is_holding() { Command::Release } else { Command::Move };
                self.phase = Phase::Opened;
                self.send_motion(driver, command, driver.release_mm());
            }
        }
    }

    /// Checks whether the measured force follows the new limit; if it does not in time, the grasp is given again, but
    /// not on jaws that hold no more: whatever is between them by then would be gripped.
    fn check_following(&mut self, driver: &mut DriverState, from_n: f64, to_n: f64, until_ns: u64) {
        if !self.telemetry.is_holding() {
            (self.phase, self.is_limit_untried) = (Phase::Grasped, true);
            return;
        }
        // Neither a force that is not told nor one from before a stall shows that the limit has no effect.
        let Some(measured_n) = driver.gripper.force_n else {
            (self.phase, self.is_limit_untried) = (Phase::Grasped, true);
            return;
        };
        if (measured_n - to_n).abs() <= 0.5 * (from_n - to_n).abs() {
            self.phase = Phase::Grasped;
            self.report_path(driver, "setting the force limit alone");
        } else if self.telemetry.force_told_ns() >= until_ns {
            let moved_n = (measured_n - from_n) * (to_n - from_n).signum();
            if driver.config.force_change == ForceChange::Auto && moved_n >= FOLLOWS_FROM_N {
                // The force follows a limit that keeps changing.
                let until_ns = driver.now_ns() + driver.config.follow_ms * 1_000_000;
                self.phase = Phase::Following { from_n: measured_n, to_n, until_ns };
                return;
            }
            if driver.config.part_width_mm.is_some() {
                self.report_path(driver, "setting the force limit and giving the grasp again");
            }
            self.give_grasp(driver);
        }
    }

    fn report_path(&mut self, driver: &mut DriverState, path: &'static str) {
        if self.force_path != Some(path) {
            self.force_path = Some(path);
            driver.push_event(DriverEvent::ForcePath { path });
        }
    }

    fn take(&mut self, driver: &mut DriverState, frame: &Frame) {
        let Some((code, rest)) = frame.reply() else { return };
        driver.heard();
        self.count_answer(frame.id);
        let (was_known, was_stopped) = (self.telemetry.system.is_some(), self.telemetry.is_stopped());
        if self.telemetry.take(driver, frame.id, code, rest) {
            if self.telemetry.is_stopped() && !was_stopped {
                self.handle_fast_stop(driver);
            }
            if self.telemetry.system.is_some() && !was_known && !self.telemetry.is_stopped() {
                driver.forget_lost_link(); // it has latched nothing
            }
        } else if let Some(sent) = self.in_flight.take_if(|sent| sent.message.id() == frame.id) {
            self.take_answer(driver, sent.message, code);
        } else if let Some((command, _)) = self.phase.motion().filter(|(command, _)| command.id() == frame.id) {
            // PENDING may be reported more than once.
            if code != status::PENDING {
                self.take_end(driver, command, code);
            }
        } // else the second answer to a command that was sent twice
    }

    /// Answers come in the order of what was sent.
    fn count_answer(&mut self, id: u8) {
        let is_setting = self.in_flight.as_ref().is_some_and(|sent| matches!(sent.message, Command::SetLimit { .. }));
        match id {
            words::id::SET_LIMIT => self.owed_count = self.owed_count.saturating_sub(1),
            words::id::GET_LIMIT if !is_setting => (self.owed_count, self.verifying_ns) = (0, None),
            _ => {}
        }
    }

    fn handle_fast_stop(&mut self, driver: &mut DriverState) {
        let why = self.why_stopped(driver);
        driver.push_event(DriverEvent::FastStop { why });
        (self.goal, self.phase) = (Goal::Keep, self.phase.ended());
        let is_ours = driver.has_lost_link() && self.telemetry.faults().is_empty();
        if is_ours && driver.config.acknowledge_own_fast_stop {
            driver.push_event(DriverEvent::Acknowledged);
            self.goal = Goal::Acknowledge;
        }
    }

    /// The first answer to the command in flight.
    fn take_answer(&mut self, driver: &mut DriverState, command: Command, code: u16) {
        let since_ns = driver.now_ns();
        match (command, code) {
            (Command::SetLimit { own_n }, status::OK) => self.take_limit(driver, own_n),
            (Command::Stop, status::OK) => self.become_idle(),
            (Command::Acknowledge, status::OK) => {
                self.become_idle();
                driver.forget_lost_link();
            }
            // The last answer is still to come.
            (Command::Stop | Command::Acknowledge, status::PENDING) => {
                self.in_flight = Some(InFlight::new(since_ns, command));
            }
            (Command::Home, status::PENDING) => self.phase = Phase::Homing { since_ns },
            (Command::Grasp, status::PENDING) => self.phase = Phase::Grasping { since_ns },
            (Command::Release | Command::Move, status::PENDING) => self.phase = Phase::Opening { command, since_ns },
            (Command::Home | Command::Grasp | Command::Release | Command::Move, status::OK | status::ABORTED) => {}
            (Command::Disconnect, _) => {}
            (command, code) => {
                self.goal = self.goal_after_failure(driver, command);
                self.forget_grasp(command);
                driver.raise_refused(command.name(), status::in_words(code));
            }
        }
    }

    /// What the gripper reported of a part no longer counts.
    fn become_idle(&mut self) {
        (self.phase, self.telemetry.is_grasp_old) = (Phase::Idle, true);
    }

    fn take_limit(&mut self, driver: &mut DriverState, own_n: f64) {
        self.telemetry.set_limit(driver, own_n);
        let is_seen = self.telemetry.is_holding() && driver.gripper.force_n.is_some();
        match (self.phase.is_grasp_given(), is_seen) {
            (true, true) => self.follow(driver, own_n),
            (true, false) => self.is_limit_untried = true,
            (false, _) => {}
        }
    }

    /// Starts to check whether the measured force follows a new limit. A further change in the same direction keeps the
    /// deadline: otherwise a force that is raised in every cycle would extend it each time.
    fn follow(&mut self, driver: &DriverState, own_n: f64) {
        let Some(measured_n) = driver.gripper.force_n else { return };
        let to_n = driver.config.from_own_n(own_n).unwrap_or(measured_n);
        let follow_ms = match driver.config.force_change {
            ForceChange::Limit => return,
            ForceChange::Regrasp => 0,
            ForceChange::Auto => driver.config.follow_ms,
        };
        let (from_n, until_ns) = match self.phase {
            Phase::Following { from_n, to_n: last_n, until_ns } if (to_n - from_n) * (last_n - from_n) > 0.0 => {
                (from_n, until_ns)
            }
            _ => (measured_n, driver.now_ns() + follow_ms * 1_000_000),
        };
        // A small step cannot be seen; small steps add up until they can.
        let is_seen = driver.config.force_change == ForceChange::Regrasp || (to_n - from_n).abs() >= FOLLOWS_FROM_N;
        self.phase = if is_seen { Phase::Following { from_n, to_n, until_ns } } else { Phase::Grasped };
    }

    /// The end of the motion under way.
    fn take_end(&mut self, driver: &mut DriverState, command: Command, code: u16) {
        self.phase = self.phase.ended();
        match (command, code) {
            (_, status::OK | status::ABORTED) => {}
            // The grasp state reports that no part was found.
            (Command::Grasp, status::FAILED) => {}
            (command, code) => {
                self.forget_release(command);
                driver.raise_refused(command.name(), status::in_words(code));
            }
        }
    }

    fn check_deadlines(&mut self, driver: &mut DriverState) {
        if let Some(sent) = InFlight::take_overdue(&mut self.in_flight, driver.now_ns(), driver.config.reply_ms) {
            match sent.message {
                Command::SetLimit { own_n } if sent.sent_count <= REPEATS_COUNT => {
                    self.send_limit(driver, own_n);
                    self.in_flight = Some(sent.again(driver.now_ns()));
                }
                command => {
                    driver.doubt_target(command.force_n(driver));
                    // A stop that was never answered was to make way for the goal.
                    if command != Command::Stop {
                        self.goal = self.goal_after_failure(driver, command);
                    }
                    self.forget_grasp(command);
                    self.telemetry.limit_own_n = None; // it may have arrived: ask
                    driver.raise_unanswered(command.name());
                }
            }
        }
        // A release after a stop waits to be told what is held: not for ever, and it is not given long afterwards.
        let waits_to_open = self.goal == Goal::Open && self.phase == Phase::Idle && self.telemetry.is_grasp_old;
        if waits_to_open && self.telemetry.jaws_untold_since_ns(driver).is_some() {
            self.goal = Goal::Keep;
            driver.raise_unanswered(Command::Release.name());
        }
        let motion_ns = driver.config.motion_ms * 1_000_000;
        if let Some((command, since_ns)) = self.phase.motion()
            && driver.now_ns().saturating_sub(since_ns) > motion_ns
        {
            self.phase = self.phase.ended();
            self.forget_release(command);
            driver.raise_unfinished(command.name());
        }
    }
}

/// A grasp needs a width.
fn width_unset(driver: &DriverState, command: &'static str) -> Error {
    let (address, key) = (driver.address(), "part_width_mm");
    let why = "a WSG-50 calls contact far from the width it was told a collision";
    Error::Unset { address, command, key, why }
}

impl Protocol for Wsg50 {
    fn linked(&mut self, driver: &mut DriverState) {
        let is_opening_old = driver.gripper.opening_mm.is_some() || self.telemetry.is_opening_old;
        let telemetry = Telemetry::new(driver.now_ns(), is_opening_old);
        *self = Wsg50 { telemetry, force_path: self.force_path, ..Wsg50::default() };
        (driver.gripper.jaws, driver.gripper.opening_mm, driver.gripper.force_n) = (Jaws::Unknown, None, None);
        self.telemetry.ask(driver);
    }

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed(bytes, |frame| self.take(driver, &frame));
        let bytes_count = parser.take_passed_over_count();
        if bytes_count > 0 {
            driver.push_event(DriverEvent::Garbled { bytes_count });
        }
        self.parser = parser;
        // An object held when the link is made was grasped before: no grasp is to be given again.
        if self.phase == Phase::Idle && self.telemetry.is_holding() && !self.telemetry.is_grasp_old {
            self.phase = Phase::Grasped;
        }
    }

    fn tick(&mut self, driver: &mut DriverState) {
        self.check_deadlines(driver);
        self.telemetry.forget_untold(driver);
        self.telemetry.ask(driver);
    }

    fn advance(&mut self, driver: &mut DriverState) {
        if self.in_flight.is_some() {
            return;
        }
        match self.goal {
            Goal::Keep => {}
            Goal::Acknowledge => {
                self.goal = Goal::Keep;
                self.send(driver, Command::Acknowledge, b"ack");
            }
            _ if self.telemetry.is_stopped() => {}
            Goal::Home => {
                (self.goal, self.phase) = (Goal::Keep, Phase::Idle);
                self.send(driver, Command::Home, &[0]);
            }
            Goal::Hold { force_n } => self.approach_force(driver, force_n),
            Goal::Open => self.open(driver),
        }
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        if self.telemetry.system.is_none() {
            return Err(Error::NotReady { address: driver.address(), expected: "its system state" });
        }
        if self.telemetry.is_stopped() {
            return Err(Error::FastStop { address: driver.address(), why: self.why_stopped(driver) });
        }
        if !self.telemetry.is_homed() {
            return Err(Error::NotHomed { address: driver.address() });
        }
        if self.telemetry.grasp.is_none() {
            return Err(Error::NotReady { address: driver.address(), expected: "whether it holds something" });
        }
        if self.telemetry.is_opening_old {
            return Err(Error::NotReady { address: driver.address(), expected: "how far it is open" });
        }
        Ok(())
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        match command {
            GripCommand::Hold { .. } => {
                let must_grasp = !self.phase.is_grasp_given() && !self.telemetry.is_holding();
                if driver.config.part_width_mm.is_none() && must_grasp {
                    return Err(width_unset(driver, "grasp"));
                }
            }
            // A refused release is given again on the next request.
            GripCommand::Release if self.goal != Goal::Open && self.phase == Phase::Opened => self.phase = Phase::Idle,
            GripCommand::Release => {}
        }
        self.goal = command.into();
        Ok(())
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        match self.check_ready(driver) {
            Err(Error::NotHomed { .. }) => {}
            ready => ready?,
        }
        if self.telemetry.is_homed() && driver.seems_to_hold() {
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
        self.goal = Goal::Keep;
        self.send(driver, Command::Disconnect, &[]);
    }

    fn force_on_its_way(&self, driver: &DriverState) -> Option<f64> {
        self.in_flight.as_ref().and_then(|sent| sent.message.force_n(driver))
    }

    fn jaws_untold_since_ns(&self, driver: &DriverState) -> Option<u64> {
        self.telemetry.jaws_untold_since_ns(driver)
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        let is_on_the_way = match self.goal {
            Goal::Keep => false,
            Goal::Hold { force_n } => {
                let own_n = f64::from(driver.config.to_own_n(force_n) as f32);
                self.telemetry.limit_own_n != Some(own_n) || !self.phase.is_grasp_given()
            }
            Goal::Open => !self.phase.is_release_given(),
            Goal::Home | Goal::Acknowledge => true,
        };
        let is_new = driver.is_linked() && !self.telemetry.is_complete();
        let is_moving = self.phase.motion().is_some() || matches!(self.phase, Phase::Following { .. });
        is_new || is_on_the_way || self.in_flight.is_some() || is_moving
    }
}
