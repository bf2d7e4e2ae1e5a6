//! Where a WSG-50 is between the commands that it has answered, and the commands.

use super::words::id;
use crate::gripper::driver_state::DriverState;

/// What the jaws were last commanded, and its progress.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum Phase {
    /// Neither a grasp nor a release has been given since the link was made, a stop or an acknowledgement.
    #[default]
    Idle,
    /// It looks for its end stop.
    Homing { since_ns: u64 },
    /// A grasp was given; its end is awaited.
    Grasping { since_ns: u64 },
    /// A grasp was given and has ended, whatever the outcome.
    Grasped,
    /// A new force limit was set while holding; does the measured force follow? N per finger.
    Following { from_n: f64, to_n: f64, until_ns: u64 },
    /// A release was given; its end is awaited.
    Opening { command: Command, since_ns: u64 },
    /// A release was given and has ended, whatever the outcome.
    Opened,
}

impl Phase {
    /// The command whose motion is under way, and since when.
    pub fn motion(self) -> Option<(Command, u64)> {
        match self {
            Phase::Homing { since_ns } => Some((Command::Home, since_ns)),
            Phase::Grasping { since_ns } => Some((Command::Grasp, since_ns)),
            Phase::Opening { command, since_ns } => Some((command, since_ns)),
            Phase::Idle | Phase::Grasped | Phase::Following { .. } | Phase::Opened => None,
        }
    }

    /// Whatever was under way has ended.
    pub fn ended(self) -> Self {
        match self {
            Phase::Idle | Phase::Homing { .. } => Phase::Idle,
            Phase::Grasping { .. } | Phase::Grasped | Phase::Following { .. } => Phase::Grasped,
            Phase::Opening { .. } | Phase::Opened => Phase::Opened,
        }
    }

    /// Whether the last thing given was a grasp.
    pub fn is_grasp_given(self) -> bool {
        matches!(self, Phase::Grasping { .. } | Phase::Grasped | Phase::Following { .. })
    }

    /// Whether the last thing given was a release.
    pub fn is_release_given(self) -> bool {
        matches!(self, Phase::Opening { .. } | Phase::Opened)
    }
}

/// A command; the gripper answers each one at once, and those that move it again at their end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Command {
    Home,
    Grasp,
    /// Opens with something held.
    Release,
    /// Opens with nothing held.
    Move,
    Stop,
    Acknowledge,
    /// In the gripper's own newtons.
    SetLimit {
        own_n: f64,
    },
    Disconnect,
}

impl Command {
    /// Its number on the link.
    pub fn id(self) -> u8 {
        match self {
            Command::Home => id::HOME,
            Command::Grasp => id::GRASP,
            Command::Release => id::RELEASE,
            Command::Move => id::MOVE,
            Command::Stop => id::STOP,
            Command::Acknowledge => id::ACKNOWLEDGE,
            Command::SetLimit { .. } => id::SET_LIMIT,
            Command::Disconnect => id::DISCONNECT,
        }
    }

    /// The force that it sets, N per finger.
    pub fn force_n(self, driver: &DriverState) -> Option<f64> {
        match self {
            Command::SetLimit { own_n } => driver.config.from_own_n(own_n),
            _ => None,
        }
    }

    /// For messages.
    pub fn name(self) -> &'static str {
        match self {
            Command::Home => "home",
            Command::Grasp => "grasp",
            Command::Release => "release",
            Command::Move => "move",
            Command::Stop => "stop",
            Command::Acknowledge => "acknowledge",
            Command::SetLimit { .. } => "set force limit",
            Command::Disconnect => "disconnect",
        }
    }
}
