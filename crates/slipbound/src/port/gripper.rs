//! The gripper: its commands, its state, its errors.

use crate::setting::{SettingError, named};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The kind of a [`GripperError`], for a caller to match on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GripperErrorKind {
    /// The address or the settings cannot be used: nothing was sent.
    Settings,
    /// The link is lost, or no data arrives. The driver reconnects; the gripper keeps its force.
    Link,
    /// The gripper did not answer in time.
    Unanswered,
    /// The gripper rejected the command.
    Refused,
    /// A lower force was requested while an object is held, and this gripper has not been shown to keep its grip while
    /// the force is lowered. It keeps the higher force; the loop does not count this as a fault.
    Lowering,
    /// A force that is not a number, or another invalid value.
    Value,
    /// It has stopped itself and must be acknowledged.
    Stopped,
    /// It must be homed or activated first.
    NotHomed,
    /// Its state is not known yet; the same call may succeed a moment later.
    NotReady,
    /// Anything else.
    Other,
}

/// An error of a gripper: its kind, and a text that names the address, what was expected and what was got. Whatever the
/// kind, the force is unchanged.
#[derive(Debug)]
pub struct GripperError {
    /// The kind, for a caller to match on.
    pub kind: GripperErrorKind,
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl GripperError {
    /// An error of this kind with this text or cause.
    pub fn new(kind: GripperErrorKind, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        GripperError { kind, source: source.into() }
    }
}

impl From<SettingError> for GripperError {
    fn from(error: SettingError) -> Self {
        GripperError::new(GripperErrorKind::Settings, error)
    }
}

impl fmt::Display for GripperError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.source.fmt(f)
    }
}

impl std::error::Error for GripperError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.source()
    }
}

/// An event in a gripper's driver, for the log of a run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DriverEvent {
    /// The link is up.
    Linked,
    /// The link is down.
    Unlinked {
        /// Why.
        why: String,
    },
    /// A force outside the configured range was clamped to it.
    Clamped {
        /// Requested force, N per finger.
        asked_n: f64,
        /// Force sent, N per finger.
        given_n: f64,
    },
    /// The command of the protocol that changes the force.
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
    /// Bytes that are no valid message were skipped.
    Garbled {
        /// How many in a row.
        bytes_count: usize,
    },
    /// A command was accepted by a dry gripper, which has no hardware.
    Dry {
        /// The command.
        command: GripCommand,
    },
}

impl fmt::Display for DriverEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DriverEvent::Linked => write!(f, "linked"),
            DriverEvent::Unlinked { why } => write!(f, "link lost ({why}); the gripper keeps its force"),
            DriverEvent::Clamped { asked_n, given_n } => {
                write!(f, "{asked_n} N per finger asked for, {given_n} N given")
            }
            DriverEvent::ForcePath { path } => write!(f, "force is changed by {path}"),
            DriverEvent::FastStop { why } => write!(f, "fast stop latched: {why}"),
            DriverEvent::Acknowledged => write!(f, "fast stop acknowledged: it came from our own lost link"),
            DriverEvent::Garbled { bytes_count } => write!(f, "{bytes_count} bytes skipped: not a valid message"),
            DriverEvent::Dry { command: GripCommand::Hold { force_n } } => {
                write!(f, "dry: would hold with {force_n} N")
            }
            DriverEvent::Dry { command: GripCommand::Release } => write!(f, "dry: would release"),
        }
    }
}

/// The gripper's force at the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripSample {
    /// Normal force per finger in newtons.
    pub force_n: f64,
}

/// A command for the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "jaws")]
pub enum GripCommand {
    /// Close on the object, or keep holding it.
    Hold {
        /// Normal force per finger in newtons.
        force_n: f64,
    },
    /// Open.
    Release,
}

impl GripCommand {
    /// The requested force per finger, N; None for a release.
    pub const fn force_n(&self) -> Option<f64> {
        match *self {
            GripCommand::Hold { force_n } => Some(force_n),
            GripCommand::Release => None,
        }
    }
}

/// State of the jaws, as far as the gripper knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Jaws {
    /// Unknown: not homed, or not reported by the gripper.
    Unknown,
    /// Open, or opening.
    Open,
    /// Closing on the object.
    Closing,
    /// An object is held.
    Holding,
    /// Closed with no object between them.
    Nothing,
    /// The object that was held is lost.
    Lost,
    /// The gripper has stopped itself and must be acknowledged.
    Stopped,
}

const JAWS: [(Jaws, &str); 7] = [
    (Jaws::Unknown, "unknown"),
    (Jaws::Open, "open"),
    (Jaws::Closing, "closing"),
    (Jaws::Holding, "holding"),
    (Jaws::Nothing, "nothing"),
    (Jaws::Lost, "lost"),
    (Jaws::Stopped, "stopped"),
];

named!(Jaws, "jaws", JAWS);

/// The state reported by a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripperState {
    /// Time of this state on the clock of the loop, in nanoseconds.
    pub time_ns: u64,
    /// Measured normal force per finger in newtons, uncorrected: a sensor with a bias reads a force, possibly below 0,
    /// with nothing between the jaws. None where the gripper cannot measure it.
    pub force_n: Option<f64>,
    /// Error bound of that force, N per finger, as stated by the driver; None where it states none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_error_n: Option<f64>,
    /// The last accepted target force per finger in newtons; None before the first.
    pub target_n: Option<f64>,
    /// Distance between the fingertips in mm; None where it is not reported.
    pub opening_mm: Option<f64>,
    /// State of the jaws.
    pub jaws: Jaws,
}

impl GripperState {
    /// The best known force per finger, N: the measured one, else the accepted target.
    pub fn pressed_n(&self) -> Option<f64> {
        self.force_n.or(self.target_n)
    }
}

/// A parallel gripper. No call waits for the jaws to move.
///
/// ```
#[doc = include_str!("../../examples/my_gripper.rs")]
/// ```
pub trait Gripper {
    /// Accepts a command. An error means that it was not accepted: the force stays where it was.
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError>;

    /// The newest state. An error means that the state is not known, for example because the link is lost.
    fn poll(&mut self) -> Result<GripperState, GripperError>;

    /// Sends and receives what is due on the link, where there is one, without waiting: to be called every few ms
    /// between two cycles of the loop.
    fn poll_io(&mut self) {}

    /// Whether an accepted command has not been confirmed by the gripper yet.
    fn is_busy(&self) -> bool {
        false
    }

    /// Removes and returns the oldest driver event; None when there is none.
    fn next_event(&mut self) -> Option<DriverEvent> {
        None
    }
}
