//! The gripper: what it is told, what it says.

use serde::{Deserialize, Serialize};

/// Any failure of a gripper; its text names the address, what was expected and what was got.
pub type GripperError = Box<dyn std::error::Error + Send + Sync>;

/// What a gripper says of its force at the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripSample {
    /// Normal force per finger in newtons.
    pub force_n: f64,
}

/// What the arm and the jaws may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// The arm may go on; the jaws hold.
    Go,
    /// The arm stands still; the jaws hold.
    Pause,
    /// The arm stands still; the jaws open.
    Release,
}

/// What a controller wants of the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripCommand {
    /// Normal force per finger in newtons. Not used with [`Motion::Release`].
    pub force_n: f64,
    /// What the arm and the jaws may do.
    pub motion: Motion,
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
    /// Measured normal force per finger in newtons; None where the gripper cannot measure it.
    pub force_n: Option<f64>,
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
pub trait Gripper {
    /// Takes over a command. An error means that it was not taken over: the force stays where it was.
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError>;

    /// The newest state.
    fn poll(&mut self) -> Result<GripperState, GripperError>;

    /// Carries bytes between two turns of the loop, where there is a link: to be called every few ms.
    fn carry(&mut self) {}
}
