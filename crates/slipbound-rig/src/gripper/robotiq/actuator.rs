//! What both interfaces of a 2F-85 keep: target of the jaws, activation, and reported status.

use super::status::{CLOSED, Status};
use crate::gripper::config::Config;
use crate::gripper::driver_state::DriverState;
use crate::gripper::error::Error;
use slipbound::port::{DriverEvent, GripCommand, Jaws};

/// The goal of the jaws; the newest one counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum Goal {
    /// Nothing: leave everything as it is.
    #[default]
    Keep,
    /// Hold with this force, N per finger.
    Hold { force_n: f64 },
    /// Open to here, mm.
    Open { opening_mm: f64 },
    /// The first half of homing: deactivate.
    Deactivate,
    /// The second half: activate.
    Activate,
}

/// Number of the force with which they open.
const OPENING_FORCE: u8 = 0;

/// Number of the force that is sent with both halves of homing.
const HOMING_FORCE: u8 = 0;

/// Target of the jaws: position and force as the gripper's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Target {
    pub position: u8,
    pub speed: u8,
    pub force: u8,
}

impl Goal {
    /// The force to hold with, N per finger.
    pub fn force_n(self) -> Option<f64> {
        match self {
            Goal::Hold { force_n } => Some(force_n),
            _ => None,
        }
    }

    /// Target of the jaws; None where this goal has none.
    pub fn target(self, config: &Config) -> Option<Target> {
        let speed = config.speed_count();
        match self {
            Goal::Hold { force_n } => Some(Target { position: CLOSED, speed, force: config.force_count(force_n) }),
            Goal::Open { opening_mm } => {
                Some(Target { position: config.position_count(opening_mm), speed, force: OPENING_FORCE })
            }
            Goal::Keep | Goal::Deactivate | Goal::Activate => None,
        }
    }
}

/// The gripper as its interfaces see it.
#[derive(Debug, Default)]
pub(super) struct Actuator {
    pub goal: Goal,
    /// None until everything has been received once since the link was made.
    status: Option<Status>,
    /// When that was received, or the link made, ns.
    pub status_ns: u64,
    /// Whether it has held something, and has been closed or closing ever since.
    has_held: bool,
    is_homing: bool,
    /// Whether it has accepted to deactivate; its status tells when it has done so.
    has_accepted_deactivation: bool,
}

impl Actuator {
    /// The same at the start of a new link, on which nothing has been told yet.
    pub fn relinked(&self, driver: &mut DriverState) -> Self {
        let has_held = self.held_so_far(driver.gripper.jaws);
        (driver.gripper.jaws, driver.gripper.opening_mm) = (Jaws::Unknown, None);
        Actuator { has_held, status_ns: driver.now_ns(), ..Actuator::default() }
    }

    /// Whether something has been held, these jaws included, and they have been closed or closing ever since. Jaws of
    /// which nothing is known, on a new link, change nothing.
    fn held_so_far(&self, jaws: Jaws) -> bool {
        match jaws {
            Jaws::Holding | Jaws::Lost => true,
            Jaws::Closing | Jaws::Unknown => self.has_held,
            Jaws::Nothing | Jaws::Open | Jaws::Stopped => false,
        }
    }

    /// Takes a status, which was requested after everything that was sent before. Returns whether earlier commands no
    /// longer count: a fault has begun, even if it ends by itself, the gripper is not active any more, as after a
    /// restart, or it has not deactivated.
    pub fn take_status(&mut self, driver: &mut DriverState, status: Status) -> bool {
        let fault_before = self.status.and_then(|status| status.fault_in_words());
        // Before the first status of a link it may have restarted as well.
        let was_active = self.status.is_none_or(|status| status.is_active());
        let has_restarted = was_active && !status.is_active() && !self.is_homing;
        (self.status, self.status_ns) = (Some(status), driver.now_ns());
        let begun = status.fault_in_words().filter(|_| fault_before.is_none());
        let has_begun = begun.is_some();
        if let Some(why) = begun {
            driver.push_event(DriverEvent::FastStop { why: format!("{why}; home clears it") });
            (self.goal, self.is_homing) = (Goal::Keep, false);
        }
        if has_restarted {
            self.goal = Goal::Keep;
            driver.settle_target(None);
        }
        let is_deactivating = self.goal == Goal::Deactivate && self.has_accepted_deactivation;
        let has_deactivated = is_deactivating && status.activation == 0;
        if has_deactivated {
            self.goal = Goal::Activate;
        }
        self.is_homing &= !(status.is_active() && self.goal == Goal::Keep);
        driver.gripper.time_ns = driver.now_ns();
        self.has_held = status.is_active() && self.held_so_far(driver.gripper.jaws);
        driver.gripper.jaws = status.jaws(self.has_held);
        driver.gripper.opening_mm = status.position.map(|count| driver.config.opening_of_count(count));
        has_begun || has_restarted || (is_deactivating && !has_deactivated)
    }

    /// The gripper has accepted what was sent for this goal.
    pub fn take_over(&mut self, driver: &mut DriverState, goal: Goal) {
        match goal {
            Goal::Hold { force_n } => driver.settle_target(Some(driver.config.settable_n(force_n))),
            Goal::Open { .. } => driver.settle_target(driver.config.force_of_count(OPENING_FORCE)),
            Goal::Deactivate => {
                self.has_accepted_deactivation = true;
                driver.settle_target(driver.config.force_of_count(HOMING_FORCE));
            }
            Goal::Activate if self.goal == goal => self.goal = Goal::Keep,
            _ => {}
        }
    }

    /// What was sent for this goal was never answered.
    pub fn give_up(&mut self, driver: &mut DriverState, goal: Goal) {
        self.abandon(goal);
        driver.doubt_target(goal.force_n());
    }

    /// What was sent for this goal is not done. Another force, or a release, that was requested since stays.
    pub fn abandon(&mut self, goal: Goal) {
        let is_of_jaws = |goal: Goal| matches!(goal, Goal::Hold { .. } | Goal::Open { .. });
        if !is_of_jaws(goal) || !is_of_jaws(self.goal) || self.goal == goal {
            (self.goal, self.is_homing) = (Goal::Keep, false);
        }
    }

    pub fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        let Some(status) = self.status else {
            return Err(Error::NotReady { address: driver.address(), expected: "its status" });
        };
        if let Some(why) = status.fault_in_words() {
            return Err(Error::Fault { address: driver.address(), why });
        }
        if !status.is_active() || self.is_homing {
            return Err(Error::NotHomed { address: driver.address() });
        }
        Ok(())
    }

    pub fn grip(&mut self, driver: &DriverState, command: GripCommand) {
        self.goal = match (command, self.goal) {
            (GripCommand::Hold { force_n }, _) => Goal::Hold { force_n },
            (GripCommand::Release, Goal::Open { .. }) => return,
            (GripCommand::Release, _) => Goal::Open { opening_mm: driver.release_mm() },
        };
    }

    pub fn home(&mut self, driver: &DriverState) -> Result<(), Error> {
        let Some(status) = self.status else {
            return Err(Error::NotReady { address: driver.address(), expected: "its status" });
        };
        // Only homing clears a fault, and jaws that are not active.
        if status.is_active() && status.fault_in_words().is_none() && driver.seems_to_hold() {
            return Err(driver.home_while_holding());
        }
        (self.goal, self.is_homing, self.has_accepted_deactivation) = (Goal::Deactivate, true, false);
        Ok(())
    }

    /// Whether everything has been received once since the link was made.
    pub fn is_known(&self) -> bool {
        self.status.is_some()
    }

    /// Whether the first status is awaited, homing is under way or the jaws move.
    pub fn is_busy(&self, driver: &DriverState) -> bool {
        let is_new = driver.is_linked() && self.status.is_none();
        let is_moving = self.goal != Goal::Keep && self.status.is_some_and(|status| status.is_moving());
        is_new || is_moving || self.is_homing
    }
}
