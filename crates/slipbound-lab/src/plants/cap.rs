//! A cap on its bottle, turned between the two pads about the axis along the fingers.
//!
//! ```text
//!         Y ^   ___
//!           | /  ^  \     seen along X, down onto the cap: R radius, pads at the left and the right (Z)
//!    left [||    phi  ||] right      T = 2 R F_y
//!             \ ___ /     the wrist turns by theta, the cap by phi: over a pad it moves R (theta - phi)
//! ```
//!
//! The thread resists with a torque that depends on how far the cap has been turned. It only resists: while the load of
//! the pads is lower, the cap does not move, and it never springs back. As it turns it moves along X by its pitch,
//! which shears the pads unless the wrist follows.

use super::held::{ContactInput, FINGERS_COUNT, HandState, HeldObject, Symmetry};
use super::truth::{CapTruth, ObjectTruth};
use crate::contact::{Drive, Pose, Rail, Truth, Wrench};
use slipbound::plane::Vec2;
use std::f64::consts::TAU;

/// Torque against the rate of turning, in N mm s/rad: 5 N mm at 20 deg/s. It makes the motion of a turning cap well
/// posed and is small compared with everything else.
const VISCOUS_N_MM_S_PER_RAD: f64 = 14.3;

/// Growth of the torque after contact with the seal, in N mm/rad. Estimate.
const SEAL_N_MM_PER_RAD: f64 = 600.0;

/// Growth of the torque at the end stop, in N mm/rad. Estimate.
const STOP_N_MM_PER_RAD: f64 = 12_000.0;

/// Angle within which a cap that has broken loose loses most of its torque, in rad: 2 deg. Estimate.
const BREAK_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// The torque of a thread over the angle turned in the sense of the task.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Thread {
    /// Closing: it runs freely, compresses its seal, then reaches its end stop.
    Screw {
        /// Running torque, in N mm.
        run_n_mm: f64,
        /// Where the seal begins, in rad.
        seal_rad: f64,
        /// Where the end stop begins, in rad.
        stop_rad: f64,
    },
    /// Opening: it breaks loose, then runs.
    Unscrew {
        /// Running torque, in N mm.
        run_n_mm: f64,
        /// Break-loose torque, in N mm.
        break_n_mm: f64,
    },
}

impl Thread {
    /// Resisting torque in N mm at a turn of `turned_rad`, 0 or above.
    pub fn torque_n_mm(&self, turned_rad: f64) -> f64 {
        match *self {
            Thread::Screw { run_n_mm, seal_rad, stop_rad } => {
                run_n_mm
                    + SEAL_N_MM_PER_RAD * (turned_rad - seal_rad).max(0.0)
                    + STOP_N_MM_PER_RAD * (turned_rad - stop_rad).max(0.0)
            }
            Thread::Unscrew { run_n_mm, break_n_mm } => {
                run_n_mm + (break_n_mm - run_n_mm) * libm::exp(-turned_rad / BREAK_RAD)
            }
        }
    }

    /// The sense of the task about X: a right-handed thread closes from Y to Z and moves down.
    fn sense(&self) -> f64 {
        match self {
            Thread::Screw { .. } => 1.0,
            Thread::Unscrew { .. } => -1.0,
        }
    }
}

/// A cap in its thread.
#[derive(Debug, Clone)]
pub struct Cap {
    radius_mm: f64,
    mu: f64,
    thread: Thread,
    pitch_mm_per_rad: f64,
    /// Turn in the last step, in rad.
    step_rad: f64,
    truth: CapTruth,
}

impl Cap {
    /// A cap that has not been turned; `pitch_mm` is its travel along X per turn.
    pub fn new(radius_mm: f64, mu: f64, thread: Thread, pitch_mm: f64) -> Self {
        let truth = CapTruth { thread_n_mm: thread.torque_n_mm(0.0), ..CapTruth::default() };
        Cap { radius_mm, mu, thread, pitch_mm_per_rad: pitch_mm / TAU, step_rad: 0.0, truth }
    }

    /// Motion over the pads in mm when the cap turns by one rad in the sense of the task and the hand does not move.
    fn along_mm(&self) -> Vec2 {
        Vec2::new(self.pitch_mm_per_rad, -self.radius_mm) * self.thread.sense()
    }

    /// Rolling of its profile over its skin, per rad as above: the profile stays between the pads.
    fn roll_mm(&self) -> Vec2 {
        Vec2::new(0.0, -self.along_mm().y)
    }

    /// Its pose over the pads while it does not turn.
    fn pose(&self, hand: HandState) -> Pose {
        let by_hand_mm = Vec2::new(-hand.lowered_mm, self.radius_mm * hand.angle_rad);
        Pose { position_mm: by_hand_mm + self.along_mm() * self.truth.angle_rad, turn_rad: 0.0 }
    }

    /// Torque of the pads along the thread, per rad in the sense of the task, in N mm.
    fn drive_n_mm(&self, contact: &Truth) -> f64 {
        let work_n_mm = contact.wrench.force_n.dot(self.along_mm()) + contact.on_profile_n.dot(self.roll_mm());
        -f64::from(FINGERS_COUNT) * work_n_mm
    }
}

impl HeldObject for Cap {
    fn start_pose(&self) -> Pose {
        Pose::default()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Same
    }

    fn contact_input(&mut self, contact: &Truth, hand: HandState, _step_s: f64) -> ContactInput {
        let angle_rad = self.truth.angle_rad;
        let now_n_mm = self.thread.torque_n_mm(angle_rad);
        self.truth.yields = self.drive_n_mm(contact) > now_n_mm;
        let drive = if self.truth.yields {
            // Where the torque grows it is a spring of this step. Where it falls, which no implicit step can hold, the
            // torque at the end of the step is used, estimated from the last step.
            let step_rad = self.step_rad.max(1e-4);
            let next_n_mm = self.thread.torque_n_mm(angle_rad + step_rad);
            Drive::Railed(Rail {
                shift_mm: self.along_mm(),
                turn_rad: 0.0,
                roll_mm: self.roll_mm(),
                push: -now_n_mm.min(next_n_mm),
                stiffness: ((next_n_mm - now_n_mm) / step_rad).max(0.0),
                damping_s: VISCOUS_N_MM_S_PER_RAD,
            })
        } else {
            Drive::Guided
        };
        // The round profile stays between the pads whatever the cap does; only its skin moves.
        let roll_mm = Vec2::new(0.0, -contact.pose.position_mm.y);
        ContactInput { drive, pose: self.pose(hand), roll_mm, wrench: Wrench::default() }
    }

    fn after_step(&mut self, contact: &Truth, hand: HandState, _step_s: f64, _slid_mm: f64) {
        let along_mm = self.along_mm();
        let turned_mm = contact.pose.position_mm - self.pose(hand).position_mm;
        // It never springs back: a reverse turn of the step is undone by the next one.
        let turns = self.truth.yields && contact.contact_cells_count > 0;
        self.step_rad = if turns { (turned_mm.dot(along_mm) / along_mm.length_squared()).max(0.0) } else { 0.0 };
        self.truth.angle_rad += self.step_rad;
        // Pressure on a round profile has no lever about its axis.
        let on_skin_n = contact.wrench.force_n.y - contact.on_profile_n.y;
        self.truth.torque_n_mm = f64::from(FINGERS_COUNT) * self.radius_mm * on_skin_n * self.thread.sense();
        self.truth.thread_n_mm = self.thread.torque_n_mm(self.truth.angle_rad);
        self.truth.limit_n_mm = f64::from(FINGERS_COUNT) * self.mu * contact.grip_force_n * self.radius_mm;
    }

    fn truth(&self) -> ObjectTruth {
        ObjectTruth::Cap(self.truth)
    }
}
