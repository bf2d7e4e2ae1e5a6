//! The input and output of a task in one cycle.

use crate::grip::{ArmMotion, Guard};
use crate::hand::HandReport;
use crate::port::{GripCommand, GripperState, Jaws, LONGEST_TIME_TO_LIVE_NS, WristCommand, WristMotion, WristState};
use serde::{Deserialize, Serialize};

/// The input of a task in one cycle.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// Time of the loop, ns; never decreases.
    pub now_ns: u64,
    /// The fused report of the fingers.
    pub hand: &'a HandReport,
    /// State of the gripper.
    pub gripper: &'a GripperState,
    /// State of the wrist.
    pub wrist: &'a WristState,
}

impl Observation<'_> {
    /// Whether the gripper reports that the held object is gone.
    pub(super) fn is_lost(&self) -> bool {
        matches!(self.gripper.jaws, Jaws::Lost | Jaws::Nothing)
    }
}

/// The output of a task in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaskStep {
    /// Command for the gripper.
    pub grip: GripCommand,
    /// Command for the wrist.
    pub wrist: WristCommand,
    /// Phase of the task.
    pub phase: Phase,
}

/// Phase of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "phase", content = "ending")]
pub enum Phase {
    /// Grasping the object.
    Grasping,
    /// At work; the wrist moves.
    Working,
    /// At work; the wrist waits for the grip.
    Waiting,
    /// Releasing the object.
    Releasing,
    /// The task has ended.
    Ended(Ending),
}

impl Phase {
    /// At work, with what the arm may do.
    pub(super) const fn at_work(arm: ArmMotion) -> Self {
        match arm {
            ArmMotion::Go => Phase::Working,
            ArmMotion::Pause => Phase::Waiting,
        }
    }
}

/// How a task ended, and on what evidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Screw: at the largest force the fingers were turned further and the shear of the gels did not grow: the cap no
    /// longer follows and takes all the torque that the fingers can exert.
    Tight,
    /// Screw, the paper's literal law: incipient slip at the largest force.
    SlipAtMost,
    /// Unscrew: the torque fell and stayed low while the fingers were turned further.
    Opened,
    /// Unscrew: at the largest force the fingers slide around the cap.
    Stuck,
    /// Place: the ground carries the object, and it was released.
    Placed,
    /// Lift: held for the whole time.
    Held,
    /// No object was found between the fingers.
    NothingHeld,
    /// The object that was held is lost.
    Lost,
    /// Place: the gripper did not accept the looser grip that laying down needs; the object is still held.
    GripStays,
    /// Place: the ground carries the object, but the gripper did not open.
    NotReleased,
    /// The wrist has reached its limit before any of the above.
    Limit,
}

impl Ending {
    /// What it is called in tables and pages.
    pub const fn name(self) -> &'static str {
        match self {
            Ending::Tight => "Tight",
            Ending::SlipAtMost => "Slip at most",
            Ending::Opened => "Opened",
            Ending::Stuck => "Stuck",
            Ending::Placed => "Placed",
            Ending::Held => "Held",
            Ending::NothingHeld => "Nothing held",
            Ending::Lost => "Lost",
            Ending::GripStays => "Grip stays",
            Ending::NotReleased => "Not released",
            Ending::Limit => "Limit",
        }
    }

    /// Whether the task has succeeded.
    pub const fn is_success(self) -> bool {
        matches!(self, Ending::Tight | Ending::SlipAtMost | Ending::Opened | Ending::Placed | Ending::Held)
    }

    /// Whether it says no more than that a time was over.
    pub(crate) const fn is_timed_out(self) -> bool {
        matches!(self, Ending::Held | Ending::NothingHeld)
    }

    /// The evidence, as a sentence.
    pub const fn evidence(self) -> &'static str {
        match self {
            Ending::Tight => "at the largest force the cap no longer follows and the shear of the gels no longer grows",
            Ending::SlipAtMost => "incipient slip at the largest force",
            Ending::Opened => "the torque fell and stayed down while the fingers turned on",
            Ending::Stuck => "at the largest force the fingers slide over the cap",
            Ending::Placed => "the ground carries the object, and it was released",
            Ending::Held => "held to the end of the time",
            Ending::NothingHeld => "nothing was found between the fingers",
            Ending::Lost => "the gripper reports that the object is lost",
            Ending::GripStays => "the gripper did not take the looser grip that laying down needs; it holds on",
            Ending::NotReleased => "the ground carries the object, but the gripper did not open when told to",
            Ending::Limit => "the wrist reached its limit",
        }
    }
}

/// What a task that is still grasping waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Missing {
    /// A finger that is live.
    Sight,
    /// The gripper to report that it holds an object.
    Hold,
    /// Contact at the fingers.
    Contact,
    /// A settled grip.
    #[serde(rename = "rest")]
    SteadyGrip,
}

impl Missing {
    /// What is missing, in words.
    pub const fn in_words(self) -> &'static str {
        match self {
            Missing::Sight => "the fingers are blind",
            Missing::Hold => "the gripper does not report that it holds an object",
            Missing::Contact => "the gripper holds something that the fingers do not feel",
            Missing::SteadyGrip => "the grip did not settle",
        }
    }
}

/// A task. It never fails: while the hand is blind the wrist waits and the grip is kept.
pub trait Task {
    /// The commands for this cycle.
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep;

    /// The controller that holds the object, inside its guard.
    fn grip(&self) -> &Guard;

    /// The same, for what the loop knows of the grip: see [`Guard::raise_to`] and [`Guard::never_lower`].
    fn grip_mut(&mut self) -> &mut Guard;

    /// This cycle had a fault, or gripper or wrist could not be polled: what the task waits for may not have come
    /// meanwhile. The time up to the next step does not count.
    fn interrupt(&mut self) {}

    /// What it waits for before its work can begin; None once it has begun, and before the first step.
    fn missing(&self) -> Option<Missing> {
        None
    }
}

/// Longest duration of a motion that is not renewed, s.
const MOTION_S: f64 = LONGEST_TIME_TO_LIVE_NS as f64 * 1e-9;

/// A wrist this close to the end of its way has arrived, rad and mm: less than wrists resolve.
pub(super) const ARRIVED_RAD: f64 = 1e-4;
pub(super) const ARRIVED_MM: f64 = 0.01;

/// A turn that lasts until the renewal after the next, by at most this angle.
pub(super) fn turn(rate_rad_per_s: f64, left_rad: f64) -> WristCommand {
    let most_rad = (rate_rad_per_s.abs() * MOTION_S).min(left_rad.max(0.0));
    WristCommand::new(WristMotion::Turn { rate_rad_per_s, most_rad })
}

/// A lowering (negative: lifting) that lasts until the renewal after the next, by at most this distance.
pub(super) fn lower(rate_mm_per_s: f64, left_mm: f64) -> WristCommand {
    let most_mm = (rate_mm_per_s.abs() * MOTION_S).min(left_mm.max(0.0));
    WristCommand::new(WristMotion::Lower { rate_mm_per_s, most_mm })
}

pub(super) const PAUSE: WristCommand = WristCommand::new(WristMotion::Pause);
