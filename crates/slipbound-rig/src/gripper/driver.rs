//! What every driver is, and what can be asked of it.

use super::{Config, Error};
use crate::link::Talker;
use slipbound::port::{GripCommand, GripperState};
use std::fmt;

/// What can be asked of a gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Grip, or let go.
    Grip(GripCommand),
    /// Find out where the jaws are. Moves them: nothing may be held.
    Home,
    /// Acknowledge a latched fast stop. Moves nothing by itself.
    Acknowledge,
    /// Say that the link is about to be closed, so that no fast stop latches.
    Leave,
}

/// Something worth writing down.
#[derive(Debug, Clone, PartialEq)]
pub enum Note {
    /// The link is there.
    Linked,
    /// The link is gone.
    Unlinked {
        /// Why.
        why: String,
    },
    /// A force outside the configured range was brought inside.
    Clamped {
        /// What was asked for, N per finger.
        asked_n: f64,
        /// What is sent, N per finger.
        given_n: f64,
    },
    /// How a change of force reaches the jaws.
    ForcePath {
        /// In words.
        path: &'static str,
    },
    /// A fast stop is latched.
    FastStop {
        /// Why, as far as it is known.
        why: String,
    },
    /// A fast stop was acknowledged by the driver itself, as its settings allow.
    Acknowledged,
    /// Bytes that were no message.
    Garbled {
        /// How many in a row.
        bytes_count: usize,
    },
    /// A command was taken over by a gripper that is not there.
    Dry {
        /// The command.
        command: GripCommand,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Note::Linked => write!(f, "linked"),
            Note::Unlinked { why } => write!(f, "link lost ({why}); the gripper keeps its force"),
            Note::Clamped { asked_n, given_n } => write!(f, "{asked_n} N per finger asked for, {given_n} N given"),
            Note::ForcePath { path } => write!(f, "force is changed by {path}"),
            Note::FastStop { why } => write!(f, "fast stop latched: {why}"),
            Note::Acknowledged => write!(f, "fast stop acknowledged: it came from our own lost link"),
            Note::Garbled { bytes_count } => write!(f, "{bytes_count} bytes passed over that were no message"),
            Note::Dry { command } => write!(f, "taken over by nothing: {command:?}"),
        }
    }
}

/// A driver without its link: a [`Talker`] that takes orders.
pub trait Driver: Talker {
    /// Takes over an order. An error means that it was not taken over.
    fn order(&mut self, now_ns: u64, order: Order) -> Result<(), Error>;

    /// The newest state, or what is wrong with the link or with an order taken over before; the latter is told once.
    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error>;

    /// Whether an order is still under way, or the first state is still awaited.
    fn is_busy(&self) -> bool;

    /// The next thing worth writing down.
    fn next_note(&mut self) -> Option<Note>;

    /// Its settings.
    fn config(&self) -> &Config;

    /// Permits lower forces while something is held, whatever the settings say, or leaves that to them again;
    /// `check-hold` does.
    fn permit_lowering(&mut self, permitted: bool);
}
