//! The wrist, which turns, lowers or lifts the hand. Every motion is bounded and must be renewed.

use crate::setting::SettingError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The kind of a [`WristError`], for a caller to match on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum WristErrorKind {
    /// The address cannot be used: nothing was sent.
    Settings,
    /// The link is lost, or no data arrives. The wrist pauses by itself.
    Link,
    /// The wrist rejected the command, or a number in it is invalid.
    Refused,
    /// Anything else.
    Other,
}

/// An error of a wrist: its kind, and a text that names the address, what was expected and what was got.
#[derive(Debug)]
pub struct WristError {
    /// The kind, for a caller to match on.
    pub kind: WristErrorKind,
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl WristError {
    /// An error of this kind with this text or cause.
    pub fn new(kind: WristErrorKind, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        WristError { kind, source: source.into() }
    }
}

impl From<SettingError> for WristError {
    fn from(error: SettingError) -> Self {
        WristError::new(WristErrorKind::Settings, error)
    }
}

impl fmt::Display for WristError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.source.fmt(f)
    }
}

impl std::error::Error for WristError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.source()
    }
}

/// Maximum turn rate that may be commanded, rad/s: a little over 60 deg/s. A cap is screwed at 20 deg/s.
pub const FASTEST_TURN_RAD_PER_S: f64 = 1.1;

/// Longest time a motion may go on without being renewed, in nanoseconds: 200 ms.
pub const LONGEST_TIME_TO_LIVE_NS: u64 = 200_000_000;

/// A motion of the hand, in the hand frame of [`crate::hand`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "motion")]
pub enum WristMotion {
    /// Turns about the axis along the fingers.
    Turn {
        /// Rate in rad/s, positive from y to z of the hand frame.
        rate_rad_per_s: f64,
        /// Angle after which it stops by itself, in rad from the angle at which the command was accepted; never
        /// negative.
        most_rad: f64,
    },
    /// Moves along gravity.
    Lower {
        /// Rate in mm/s, positive downwards.
        rate_mm_per_s: f64,
        /// Distance after which it stops by itself, in mm; never negative.
        most_mm: f64,
    },
    /// Stands still.
    Pause,
}

/// In words and units, for messages and events.
impl fmt::Display for WristMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WristMotion::Turn { rate_rad_per_s, most_rad } => {
                write!(f, "turn at {rate_rad_per_s} rad/s by at most {most_rad} rad")
            }
            WristMotion::Lower { rate_mm_per_s, most_mm } => {
                write!(f, "lower at {rate_mm_per_s} mm/s by at most {most_mm} mm")
            }
            WristMotion::Pause => f.write_str("pause"),
        }
    }
}

/// A motion and its time to live.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WristCommand {
    /// The motion.
    pub motion: WristMotion,
    /// Time after which the wrist pauses unless a new command has come, in nanoseconds; at most
    /// [`LONGEST_TIME_TO_LIVE_NS`].
    pub time_to_live_ns: u64,
}

impl WristCommand {
    /// A motion with the longest time to live.
    pub const fn new(motion: WristMotion) -> Self {
        WristCommand { motion, time_to_live_ns: LONGEST_TIME_TO_LIVE_NS }
    }
}

/// The state reported by a wrist.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WristState {
    /// Time of this state on the clock of the loop, in nanoseconds.
    pub time_ns: u64,
    /// Angle about the axis along the fingers since the start, in rad.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Whether it moves.
    pub moving: bool,
}

/// The arm that carries the hand. No call waits for a motion to end.
pub trait Wrist {
    /// Accepts a motion. An error means that it was not accepted: the last one expires and the wrist pauses.
    fn command(&mut self, command: WristCommand) -> Result<(), WristError>;

    /// The newest state.
    fn poll(&mut self) -> Result<WristState, WristError>;

    /// Sends and receives what is due on the link, where there is one, without waiting: to be called every few ms
    /// between two cycles of the loop.
    fn poll_io(&mut self) {}
}
