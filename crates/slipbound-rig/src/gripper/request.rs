//! What can be asked of a gripper.

use slipbound::port::GripCommand;

/// What can be asked of a gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Grip, or release.
    Grip(GripCommand),
    /// Find out where the jaws are. Moves them: nothing may be held.
    Home,
    /// Acknowledge a latched fast stop. Moves nothing by itself.
    Acknowledge,
    /// Say that the link is about to be closed, so that no fast stop latches. Nothing is sent after it.
    Leave,
}
