//! What every driver is, and what can be asked of it.

use super::{Config, Error};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState};

/// What can be asked of a gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Grip, or let go.
    Grip(GripCommand),
    /// Find out where the jaws are. Moves them: nothing may be held.
    Home,
    /// Acknowledge a latched fast stop. Moves nothing by itself.
    Acknowledge,
    /// Say that the link is about to be closed, so that no fast stop latches.
    Leave,
}

/// A driver without its link: a [`Talker`] that takes orders.
pub trait Driver: Talker {
    /// Takes over an order. An error means that it was not taken over.
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error>;

    /// The newest state, or what is wrong with the link or with an order taken over before; the latter is told once.
    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error>;

    /// Whether an order is still under way, or the first state is still awaited.
    fn is_busy(&self) -> bool;

    /// The next thing worth a line in the log of a run.
    fn next_event(&mut self) -> Option<DriverEvent>;

    /// Its settings.
    fn config(&self) -> &Config;

    /// Permits lower forces while something is held, whatever the settings say, or leaves that to them again;
    /// `check-hold` does.
    fn permit_lowering(&mut self, permitted: bool);
}
