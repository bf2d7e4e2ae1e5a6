//! The gripper: what it is told, what it says.

use crate::setting::SettingError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What kind of failure a [`GripperError`] is: what a caller can act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GripperErrorKind {
    /// The address or the settings cannot be used: nothing was sent.
    Settings,
    /// The link is lost, or nothing comes through it. It is made again; the gripper keeps its force.
    Link,
    /// The gripper did not answer in time.
    Unanswered,
    /// The gripper answered that it does not do this.
    Refused,
    /// A lower force was asked for while something is held, and this gripper has not been shown to hold on through
    /// that. It keeps the higher force: no fault of the grasp.
    Lowering,
    /// A force that is not a number, or another value no gripper can take.
    Value,
    /// It has stopped itself and must be acknowledged.
    Stopped,
    /// It must be homed or activated first.
    NotHomed,
    /// Too little is known of its state yet; the same call may succeed a moment later.
    NotReady,
    /// Anything else.
    Other,
}

/// A failure of a gripper: its kind, and a text that names the address, what was expected and what was got. Whatever
/// the kind, the force stays where it was.
#[derive(Debug)]
pub struct GripperError {
    /// What a caller can act on.
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

/// Something a gripper's driver did or met that is worth a line in the log of a run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DriverEvent {
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
            DriverEvent::Garbled { bytes_count } => write!(f, "{bytes_count} bytes passed over that were no message"),
            DriverEvent::Dry { command: GripCommand::Hold { force_n } } => {
                write!(f, "dry: would hold with {force_n} N")
            }
            DriverEvent::Dry { command: GripCommand::Release } => write!(f, "dry: would release"),
        }
    }
}

/// What a gripper says of its force at the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripSample {
    /// Normal force per finger in newtons.
    pub force_n: f64,
}

/// What the gripper is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "jaws")]
pub enum GripCommand {
    /// Close on the object, or go on holding it.
    Hold {
        /// Normal force per finger in newtons.
        force_n: f64,
    },
    /// Open.
    Release,
}

impl GripCommand {
    /// The force per finger asked for, N; None for a release.
    pub const fn force_n(&self) -> Option<f64> {
        match *self {
            GripCommand::Hold { force_n } => Some(force_n),
            GripCommand::Release => None,
        }
    }
}

/// What the jaws are doing, as far as the gripper knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Jaws {
    /// Not known: not homed, or the gripper does not say.
    Unknown,
    /// Open, or opening.
    Open,
    /// On the way to the object.
    Closing,
    /// Something is held.
    Holding,
    /// Closed, with nothing between them.
    Nothing,
    /// What was held is gone.
    Lost,
    /// The gripper has stopped itself and must be acknowledged.
    Stopped,
}

/// What a gripper says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripperState {
    /// Time of this state on the clock of the loop, in nanoseconds.
    pub time_ns: u64,
    /// Measured normal force per finger in newtons, as it reads: a sensor with a bias says a force, also below 0, with
    /// nothing between the jaws. None where the gripper cannot measure it.
    pub force_n: Option<f64>,
    /// How far that may be off, N per finger, as the driver states it; None where it does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_error_n: Option<f64>,
    /// The force per finger it last took over as its target, in newtons; None before the first.
    pub target_n: Option<f64>,
    /// Distance between the fingertips in mm; None where it does not say.
    pub opening_mm: Option<f64>,
    /// What the jaws are doing.
    pub jaws: Jaws,
}

impl GripperState {
    /// The force per finger as well as it is known, N: measured, else the target it took over.
    pub fn pressed_n(&self) -> Option<f64> {
        self.force_n.or(self.target_n)
    }
}

/// A parallel gripper. Neither call waits for the jaws.
///
/// ```
#[doc = include_str!("../../examples/my_gripper.rs")]
/// ```
pub trait Gripper {
    /// Takes over a command. An error means that it was not taken over: the force stays where it was.
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError>;

    /// The newest state.
    fn poll(&mut self) -> Result<GripperState, GripperError>;

    /// Sends and receives what is due on the link, where there is one, without waiting: to be called every few ms
    /// between two cycles of the loop.
    fn poll_io(&mut self) {}

    /// Whether a command taken over is still on its way to the gripper.
    fn is_busy(&self) -> bool {
        false
    }

    /// The next thing worth a line in the log of a run, oldest first; None when all have been told.
    fn next_event(&mut self) -> Option<DriverEvent> {
        None
    }
}
