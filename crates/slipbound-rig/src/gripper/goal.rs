//! The goal of the jaws.

use slipbound::port::GripCommand;

/// The goal of the jaws; the newest one counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Goal {
    /// Nothing: leave everything as it is.
    #[default]
    Keep,
    /// Hold with this force, N per finger.
    Hold { force_n: f64 },
    /// Open.
    Open,
    /// Find the position of the jaws.
    Home,
    /// Acknowledge a fast stop.
    Acknowledge,
}

impl Goal {
    /// What is left of it once a command for this goal has failed: another force, or a release, that was requested since
    /// stays.
    pub fn after_failure(self, failed: Self) -> Self {
        let is_of_jaws = |goal: Self| matches!(goal, Goal::Hold { .. } | Goal::Open);
        if is_of_jaws(self) && is_of_jaws(failed) && self != failed { self } else { Goal::Keep }
    }

    /// The force to hold with, N per finger.
    pub fn force_n(self) -> Option<f64> {
        match self {
            Goal::Hold { force_n } => Some(force_n),
            _ => None,
        }
    }
}

impl From<GripCommand> for Goal {
    fn from(command: GripCommand) -> Self {
        match command {
            GripCommand::Hold { force_n } => Goal::Hold { force_n },
            GripCommand::Release => Goal::Open,
        }
    }
}
