//! What is exactly known of the hand and of what it holds.

use crate::contact::{Pose, Wrench};
use crate::plants::{BottleTruth, CapTruth, GroundTruth};
use serde::Serialize;

/// What is true at the end of a step, and what has added up since the start.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct HandTruth {
    /// Time since the start, in ns.
    pub time_ns: u64,
    /// Angle of the wrist about the axis along the fingers since the start, in rad, positive from Y to Z.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Distance between the fingertips, in mm; None where somebody else plays the gripper.
    pub opening_mm: Option<f64>,
    /// Normal force per finger, in N.
    pub grip_force_n: f64,
    /// What the object exerts on the gel of the left and of the right finger, each in its own frame; the torque is
    /// about the middle of the contact.
    pub wrench: [Wrench; 2],
    /// Where the object's reference point is, in the frame of the left finger.
    pub pose: Pose,
    /// Area under pressure on one finger, in mm2.
    pub contact_area_mm2: f64,
    /// phi: area that did not slide in the last step over area in contact; None without contact.
    pub stick_ratio: Option<f64>,
    /// Share of the friction that is used, see [`GrossRule::FrictionUsed`](crate::world::GrossRule); None without
    /// contact or motion.
    pub friction_used_fraction: Option<f64>,
    /// Least normal force per finger that would hold the present load, in N: sqrt(F^2 + (T / a)^2) / mu with the
    /// tangential force F, the torque T about the middle of the contact and the mean lever a of friction. Exact for
    /// a pure force, and for a pure torque as far as a stays the same; in between the limit surface is taken for an
    /// ellipsoid (Howe and Cutkosky, IJRR 15 (1996) 557), which is good to some 10 %.
    pub required_n: f64,
    /// Whether the object slid as a whole in the last step: phi < 0.01 or 0.99 of the friction used, while at least
    /// half of the grip was required.
    pub gross: bool,
    /// Steps in which that was so.
    pub gross_steps_count: u64,
    /// When it first was so, in ns; None when it never was.
    pub first_gross_ns: Option<u64>,
    /// Way of the object over the pads while it slid as a whole, added up, in mm; rotation counts at the lever of
    /// every cell.
    pub slid_mm: f64,
    /// Largest pressure, in MPa.
    pub peak_pressure_mpa: f64,
    /// Largest displacement gradient of the gel's surface, as a fraction.
    pub largest_strain_fraction: f64,
    /// Whether that, or the strain of a soft object, is beyond what a linear gel stands for.
    pub beyond_linear: bool,
    /// Whether the contact reaches the border of the pad.
    pub at_border: bool,
    /// Whether both solvers met their tolerance in every step so far.
    pub converged: bool,
    /// Of a cap.
    pub cap: Option<CapTruth>,
    /// Of a bottle.
    pub bottle: Option<BottleTruth>,
    /// Of a tool and the ground.
    pub ground: Option<GroundTruth>,
}
