//! Errors of a gripper, one variant a cause.

use crate::config;
use slipbound::port::{GripperError, GripperErrorKind};
use std::io;

/// A gripper that cannot be opened, or a command that it did not accept. Whatever the cause, the force is unchanged.
/// Every text names the address, what was expected and what was got.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Not the address of a gripper.
    #[error(
        "{address}: expected wsg50://HOST:PORT, gcl://HOST:PORT, robotiq:///dev/..., robotiq://HOST:PORT, line://HOST:PORT or dry; {why}"
    )]
    Address {
        /// What was asked for.
        address: String,
        /// What is wrong with it.
        why: String,
    },
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] config::Error),
    /// Nothing answers there.
    #[error("{address}: expected a gripper, cannot connect: {source}")]
    Connect {
        /// Where.
        address: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The link is lost; it is being reconnected.
    #[error("{address}: the link is lost ({why}); the gripper keeps its force, reconnecting")]
    Lost {
        /// Where.
        address: String,
        /// The system's reason.
        why: String,
    },
    /// The link is up, but nothing comes through it.
    #[error(
        "{address}: expected a sign of life every {expected_ms} ms, got none for {got_ms} ms; the gripper keeps its force"
    )]
    Silent {
        /// Where.
        address: String,
        /// Longest silence allowed, ms.
        expected_ms: u64,
        /// Silence so far, ms.
        got_ms: u64,
    },
    /// The gripper answers, but not what its jaws do.
    #[error(
        "{address}: expected to be told what the jaws do, got only other answers for {got_ms} ms; the gripper keeps its force"
    )]
    Untold {
        /// Where.
        address: String,
        /// Time since it was last told, ms.
        got_ms: u64,
    },
    /// The link is up, but nothing that comes through it is a message, and nothing ever was.
    #[error("{address}: expected a gripper, got {bytes_count} bytes that are no message: is it another interface?")]
    Unread {
        /// Where.
        address: String,
        /// Bytes so far.
        bytes_count: usize,
    },
    /// A message in which the state of the jaws is none that the protocol knows.
    #[error("{address}: expected jaws to be unknown, open, closing, holding, nothing, lost or stopped, got `{got}`")]
    Jaws {
        /// Where.
        address: String,
        /// The word.
        got: String,
    },
    /// No answer to a command in time.
    #[error("{address}: expected an answer to {command} within {expected_ms} ms, got none")]
    Unanswered {
        /// Where.
        address: String,
        /// The command.
        command: &'static str,
        /// Time allowed, ms.
        expected_ms: u64,
    },
    /// The gripper refused.
    #[error("{address}: expected {command} to be done, got {got}")]
    Refused {
        /// Where.
        address: String,
        /// The command.
        command: &'static str,
        /// Its answer.
        got: String,
    },
    /// A force that is not a number.
    #[error("{address}: expected a force from {least_n} N to {most_n} N per finger, got {got_n}")]
    Force {
        /// Where.
        address: String,
        /// Least force, N per finger.
        least_n: f64,
        /// Largest force, N per finger.
        most_n: f64,
        /// What was asked for.
        got_n: f64,
    },
    /// A lower force while something is held, and it is not known whether this gripper keeps its grip during the
    /// change.
    #[error(
        "{address}: a lower force was asked for while holding ({} N to {} N per finger), but this gripper has not been shown to hold on through that: run check-hold, then set lowering = \"allow\"",
        hundredths(*.from_n),
        hundredths(*.to_n)
    )]
    Lowering {
        /// Where.
        address: String,
        /// The force it holds with, N per finger.
        from_n: f64,
        /// What was asked for, N per finger.
        to_n: f64,
    },
    /// The gripper has stopped itself.
    #[error(
        "{address}: expected a gripper that may move, got a latched fast stop: {why}; acknowledge it when the cause is gone"
    )]
    FastStop {
        /// Where.
        address: String,
        /// Why, as far as it is known.
        why: String,
    },
    /// The gripper reports a fault.
    #[error("{address}: expected a gripper that may move, got {why}; home clears it")]
    Fault {
        /// Where.
        address: String,
        /// The fault.
        why: String,
    },
    /// It must be homed or activated first.
    #[error(
        "{address}: expected a gripper that knows where its jaws are, got one that is not homed; take the object out and run home"
    )]
    NotHomed {
        /// Where.
        address: String,
    },
    /// The driver does not know enough of the gripper yet to command it safely.
    #[error("{address}: expected {expected}, got no state yet; try again in a moment")]
    NotReady {
        /// Where.
        address: String,
        /// What it waits for.
        expected: &'static str,
    },
    /// A setting without which the command cannot be given.
    #[error("{address}: {command} needs the setting {key}: {why}")]
    Unset {
        /// Where.
        address: String,
        /// The command.
        command: &'static str,
        /// The key.
        key: &'static str,
        /// What it is for.
        why: &'static str,
    },
    /// This gripper cannot do that.
    #[error("{address}: this gripper has no command {command}")]
    Unable {
        /// Where.
        address: String,
        /// The command.
        command: &'static str,
    },
}

/// A force as it is read: nobody measures it more exactly.
fn hundredths(force_n: f64) -> f64 {
    (force_n * 100.0).round() / 100.0
}

impl Error {
    /// The kind of the error, for callers of the port.
    pub fn kind(&self) -> GripperErrorKind {
        match self {
            Error::Address { .. } | Error::Config(_) | Error::Unset { .. } => GripperErrorKind::Settings,
            Error::Connect { .. }
            | Error::Lost { .. }
            | Error::Silent { .. }
            | Error::Untold { .. }
            | Error::Unread { .. }
            | Error::Jaws { .. } => GripperErrorKind::Link,
            Error::Unanswered { .. } => GripperErrorKind::Unanswered,
            Error::Refused { .. } | Error::Unable { .. } => GripperErrorKind::Refused,
            Error::Force { .. } => GripperErrorKind::Value,
            Error::Lowering { .. } => GripperErrorKind::Lowering,
            Error::FastStop { .. } | Error::Fault { .. } => GripperErrorKind::Stopped,
            Error::NotHomed { .. } => GripperErrorKind::NotHomed,
            Error::NotReady { .. } => GripperErrorKind::NotReady,
        }
    }
}

impl From<Error> for GripperError {
    fn from(error: Error) -> Self {
        GripperError::new(error.kind(), error)
    }
}
