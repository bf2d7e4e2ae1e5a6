//! A request to a gripper.

use slipbound::port::GripCommand;

/// A request to a gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Grip, or release.
    Grip(GripCommand),
    /// Home the jaws. Moves them: no object may be held.
    Home,
    /// Acknowledge a latched fast stop. Moves nothing by itself.
    Acknowledge,
    /// Announce that the link is about to be closed, so that no fast stop is latched. Nothing is sent after it.
    Leave,
}
