//! What the jaws should come to.

use slipbound::port::GripCommand;

/// What the jaws should come to; the newest goal counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Goal {
    /// Nothing: leave everything as it is.
    #[default]
    Keep,
    /// Hold with this force, N per finger.
    Hold { force_n: f64 },
    /// Open.
    Open,
    /// Find out where the jaws are.
    Home,
    /// Acknowledge a fast stop.
    Acknowledge,
}

impl From<GripCommand> for Goal {
    fn from(command: GripCommand) -> Self {
        match command {
            GripCommand::Hold { force_n } => Goal::Hold { force_n },
            GripCommand::Release => Goal::Open,
        }
    }
}
