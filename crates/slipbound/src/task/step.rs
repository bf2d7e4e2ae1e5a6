//! What a task is shown in a cycle and what it answers.

use crate::grip::Guard;
use crate::hand::HandReport;
use crate::port::{GripCommand, GripperState, WristCommand, WristMotion, WristState};
use serde::{Deserialize, Serialize};

/// What a task is shown.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// Time of the loop, ns; never goes back.
    pub now_ns: u64,
    /// What the fingers say.
    pub hand: &'a HandReport,
    /// What the gripper says.
    pub gripper: &'a GripperState,
    /// What the wrist says.
    pub wrist: &'a WristState,
}

/// What a task wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaskStep {
    /// For the gripper.
    pub grip: GripCommand,
    /// For the wrist.
    pub wrist: WristCommand,
    /// What it is doing.
    pub phase: Phase,
}

/// What a task is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "phase", content = "ending")]
pub enum Phase {
    /// Taking hold of the object.
    Grasping,
    /// At work; the wrist moves.
    Working,
    /// At work; the wrist waits for the grip.
    Waiting,
    /// Letting go.
    Releasing,
    /// Over.
    Ended(Ending),
}

/// How a task ended, and on what evidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Screw: at the largest force the fingers were turned on and the shear of the gels did not grow: the cap no
    /// longer follows and carries all the torque there is.
    Tight,
    /// Screw, the paper's literal law: incipient slip at the largest force.
    SlipAtMost,
    /// Unscrew: the torque fell and stayed down while the fingers were turned on.
    Opened,
    /// Unscrew: at the largest force the fingers slide over the cap.
    Stuck,
    /// Place: the ground carries the object, and it was let go.
    Placed,
    /// Lift: held to the end of the time.
    Held,
    /// Nothing was found between the fingers.
    NothingHeld,
    /// What was held is gone.
    Lost,
    /// Place: the gripper did not take the looser grip that laying down needs; the object is held on.
    GripStays,
    /// The wrist has gone as far as it may, and nothing above was seen.
    Limit,
}

impl Ending {
    /// Whether this is what the task is for.
    pub const fn is_success(self) -> bool {
        matches!(self, Ending::Tight | Ending::SlipAtMost | Ending::Opened | Ending::Placed | Ending::Held)
    }

    /// The evidence in a sentence.
    pub const fn evidence(self) -> &'static str {
        match self {
            Ending::Tight => "at the largest force the cap no longer follows and the shear of the gels no longer grows",
            Ending::SlipAtMost => "incipient slip at the largest force",
            Ending::Opened => "the torque fell and stayed down while the fingers turned on",
            Ending::Stuck => "at the largest force the fingers slide over the cap",
            Ending::Placed => "the weight went from the fingers to the ground",
            Ending::Held => "held to the end of the time",
            Ending::NothingHeld => "nothing was found between the fingers",
            Ending::Lost => "the gripper says that what was held is gone",
            Ending::GripStays => "the gripper did not take the looser grip that laying down needs; it holds on",
            Ending::Limit => "the wrist has gone as far as it may",
        }
    }
}

/// What a task that is still taking hold waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Missing {
    /// A finger that can be judged.
    Sight,
    /// The gripper's word that it holds something.
    Hold,
    /// The fingers' contact.
    Contact,
    /// A grip that stands.
    Rest,
}

impl Missing {
    /// What is missing, in words.
    pub const fn in_words(self) -> &'static str {
        match self {
            Missing::Sight => "the fingers are blind",
            Missing::Hold => "the gripper does not say that it holds something",
            Missing::Contact => "the gripper holds something that the fingers do not feel",
            Missing::Rest => "the grip did not come to rest",
        }
    }
}

/// A task. It never fails: a hand that sees nothing is answered with a wrist that waits and a grip that stays.
pub trait Task {
    /// What to do now.
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep;

    /// The controller that holds the object.
    fn grip(&self) -> &Guard;

    /// What it waits for before its work can begin; None once it has begun, and before the first step.
    fn missing(&self) -> Option<Missing> {
        None
    }
}

/// A turn that may go on until the next renewal but one.
pub(super) fn turn(rate_rad_per_s: f64) -> WristCommand {
    WristCommand::new(WristMotion::Turn { rate_rad_per_s, most_rad: rate_rad_per_s.abs() * 0.2 })
}

/// A lowering (negative: lifting) that may go on until the next renewal but one.
pub(super) fn lower(rate_mm_per_s: f64) -> WristCommand {
    WristCommand::new(WristMotion::Lower { rate_mm_per_s, most_mm: rate_mm_per_s.abs() * 0.2 })
}

pub(super) const PAUSE: WristCommand = WristCommand::new(WristMotion::Pause);
