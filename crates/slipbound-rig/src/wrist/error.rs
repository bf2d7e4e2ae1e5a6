//! Errors of a wrist, one variant a cause.

use slipbound::port::{WristError, WristErrorKind};
use std::io;

/// A wrist that cannot be opened, or a motion that it did not accept. Whatever the cause, the last motion expires and
/// the wrist pauses. Every text names the address, what was expected and what was got.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Not the address of a wrist.
    #[error("{address}: expected line://HOST:PORT or dry")]
    Address {
        /// What was asked for.
        address: String,
    },
    /// Nothing answers there.
    #[error("{address}: expected a wrist, cannot connect: {source}")]
    Connect {
        /// Where.
        address: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The link is lost; it is being reconnected.
    #[error("{address}: the link is lost ({why}); the wrist pauses by itself, reconnecting")]
    Lost {
        /// Where.
        address: String,
        /// The system's reason.
        why: String,
    },
    /// The link is up, but no position comes through it.
    #[error(
        "{address}: expected a sign of life every {expected_ms} ms, got no WRIST line for {got_ms} ms; the wrist pauses by itself"
    )]
    Silent {
        /// Where.
        address: String,
        /// Longest silence allowed, ms.
        expected_ms: u64,
        /// Silence so far, ms.
        got_ms: u64,
    },
    /// The link is up, but the wrist has not reported its position yet.
    #[error("{address}: expected a WRIST line that says where the wrist is, got none on this link yet")]
    Unstated {
        /// Where.
        address: String,
    },
    /// The other side speaks another version of the protocol.
    #[error("{address}: expected version {expected} of the line protocol, got {got}")]
    Version {
        /// Where.
        address: String,
        /// Ours.
        expected: u32,
        /// Theirs.
        got: u32,
    },
    /// A WRIST line does not say where the wrist is.
    #[error("{address}: expected angle_rad and lowered_mm in every WRIST line, got `{line}`")]
    Incomplete {
        /// Where.
        address: String,
        /// The line.
        line: String,
    },
    /// On a new link the wrist reports a position that its last motion cannot have reached: it counts from somewhere
    /// else now, and no distance from before is known.
    #[error(
        "{address}: expected {key} within {most} of {expected}, where it was before the link was lost, got {got}: does \
         it count from a new zero?"
    )]
    OtherZero {
        /// Where.
        address: String,
        /// Which number.
        key: &'static str,
        /// Its last value on the link before.
        expected: f64,
        /// The largest difference that the last motion explains.
        most: f64,
        /// What it is now.
        got: f64,
    },
    /// An impossible motion: not a number, a negative bound, or a time to live beyond what is allowed.
    #[error("{address}: expected {key} {expected}, got {got}")]
    Motion {
        /// Where.
        address: String,
        /// Which number.
        key: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What it was.
        got: f64,
    },
    /// No answer to a command in time.
    #[error("{address}: expected an answer within {expected_ms} ms, got none")]
    Unanswered {
        /// Where.
        address: String,
        /// Time allowed, ms.
        expected_ms: u64,
    },
    /// The wrist refused.
    #[error("{address}: expected `{expected}` to be taken over, got {got}")]
    Refused {
        /// Where.
        address: String,
        /// The command.
        expected: String,
        /// Its answer.
        got: String,
    },
}

impl Error {
    /// The kind of the error, for callers of the port.
    pub fn kind(&self) -> WristErrorKind {
        match self {
            Error::Address { .. } => WristErrorKind::Settings,
            Error::Connect { .. }
            | Error::Lost { .. }
            | Error::Silent { .. }
            | Error::Unanswered { .. }
            | Error::Unstated { .. } => WristErrorKind::Link,
            Error::Motion { .. } | Error::Refused { .. } => WristErrorKind::Refused,
            Error::OtherZero { .. } | Error::Version { .. } | Error::Incomplete { .. } => WristErrorKind::Other,
        }
    }
}

impl From<Error> for WristError {
    fn from(error: Error) -> Self {
        WristError::new(error.kind(), error)
    }
}
