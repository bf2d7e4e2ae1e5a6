//! A tool that is put down: held at its middle, two feet, and the ground below.
//!
//! ```text
//!      Y <--o hand           turned by the tilt about Z (positive from X to Y)
//!           |  ____---==     feet at X = underside, Y = +-L of the tool
//!        _--|==    |        a spring under each: ground and arm in series, no friction
//!      X    v      v
//!   ______________________ ground
//! ```
//!
//! A stand holds the tool until the pads have held it for a while; then its support decreases linearly.

use super::held::{ContactInput, HandState, HeldObject, Symmetry};
use super::support::{Feet, LOST_AFTER_MM, difference, sum, weight, weight_n};
use super::truth::{GroundTruth, ObjectTruth};
use crate::contact::{Drive, Inertia, Pose, Truth};
use slipbound::plane::Vec2;

/// Stiffness of the ground under a foot, in N/mm. Estimate.
const GROUND_N_PER_MM: f64 = 50.0;

/// Stiffness of the arm, in N/mm, in series with the ground. Estimate.
const ARM_N_PER_MM: f64 = 20.0;

/// How long the pads must hold a tool before its stand releases it, in s.
const STAND_S: f64 = 0.15;

/// Duration of the release, in s.
const HANDOVER_S: f64 = 0.2;

/// A tool and the ground.
#[derive(Debug, Clone)]
pub struct Tool {
    start: Pose,
    feet: Feet,
    inertia: Inertia,
    /// Time since the pads have held it, in s.
    touched_s: f64,
    /// Motion in the last step.
    moved: Pose,
    pose: Pose,
    truth: GroundTruth,
}

/// A tool over the ground, at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolSettings {
    /// Mass, in kg.
    pub mass_kg: f64,
    /// Radius of gyration about the centre of mass, in mm.
    pub gyration_radius_mm: f64,
    /// Distance of a foot from the middle, along the tool, in mm.
    pub half_length_mm: f64,
    /// Distance of the feet below the grip, across the tool, in mm.
    pub underside_mm: f64,
    /// Offset of the centre of mass from the grip, along Y of the untilted tool, in mm.
    pub off_mm: f64,
    /// Rotation about Z, in rad, positive from X to Y.
    pub tilt_rad: f64,
    /// Gap under the lower foot, in mm.
    pub height_mm: f64,
}

impl Tool {
    /// A tool in its stand.
    pub fn new(settings: ToolSettings) -> Self {
        // In the frame of the left finger y = -Y and rotations have the opposite sign.
        let start = Pose { position_mm: Vec2::ZERO, turn_rad: -settings.tilt_rad };
        let foot = |y: f64| Vec2::new(settings.underside_mm, y);
        let mut feet = Feet {
            feet_mm: [foot(settings.half_length_mm), foot(-settings.half_length_mm)],
            stiffness_n_per_mm: 1.0 / (1.0 / GROUND_N_PER_MM + 1.0 / ARM_N_PER_MM),
            ground_mm: 0.0,
        };
        let [a, b] = feet.gaps_mm(start, 0.0);
        feet.ground_mm = settings.height_mm - a.min(b);
        let inertia = Inertia {
            mass_kg: settings.mass_kg,
            gyration_radius_mm: settings.gyration_radius_mm,
            centre_of_mass_mm: Vec2::new(0.0, -settings.off_mm),
        };
        let truth = GroundTruth {
            weight_n: weight_n(settings.mass_kg),
            feet_gap_mm: feet.gaps_mm(start, 0.0),
            tilt_rad: settings.tilt_rad,
            on_stand: true,
            ..GroundTruth::default()
        };
        Tool { start, feet, inertia, touched_s: 0.0, moved: Pose::default(), pose: start, truth }
    }

    /// Share of the weight that the stand no longer carries.
    fn handed_over(&self) -> f64 {
        ((self.touched_s - STAND_S) / HANDOVER_S).clamp(0.0, 1.0)
    }
}

impl HeldObject for Tool {
    fn start_pose(&self) -> Pose {
        self.start
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Mirrored
    }

    fn contact_input(&mut self, contact: &Truth, hand: HandState, step_s: f64) -> ContactInput {
        let share = self.handed_over();
        let mut input = ContactInput::guided(self.start);
        if share == 0.0 {
            input.pose.position_mm.x -= hand.lowered_mm;
            return input;
        }
        let (springs, push) = self.feet.springs(contact, self.moved, hand.lowered_mm, step_s);
        input.drive = Drive::Sprung(springs, self.inertia);
        input.wrench = sum(push, weight(&self.inertia, contact.pose.turn_rad).scaled(share));
        input
    }

    fn after_step(&mut self, contact: &Truth, hand: HandState, step_s: f64, slid_mm: f64) {
        let touches = contact.contact_cells_count > 0;
        let free = self.handed_over() > 0.0;
        let truth = &mut self.truth;
        if free && !touches && truth.free_drop_mm.is_none() {
            // The gaps of the previous step: in this one it has begun to fall.
            truth.free_drop_mm = Some(truth.feet_gap_mm.iter().fold(0.0, |most, gap| most.max(*gap)));
        }
        self.touched_s = if free || touches { self.touched_s + step_s } else { 0.0 };
        self.moved = difference(contact.pose, self.pose);
        self.pose = contact.pose;
        truth.on_stand = self.touched_s < STAND_S + HANDOVER_S;
        truth.feet_gap_mm = self.feet.gaps_mm(contact.pose, hand.lowered_mm);
        truth.tilt_rad = -contact.pose.turn_rad;
        truth.force_n = if free { self.feet.forces_n(contact.pose, hand.lowered_mm).iter().sum() } else { 0.0 };
        if truth.free_drop_mm.is_none() {
            truth.peak_force_n = truth.peak_force_n.max(truth.force_n);
        }
        if slid_mm > LOST_AFTER_MM && truth.force_n == 0.0 && truth.free_drop_mm.is_none() {
            truth.dropped = true;
            truth.free_drop_mm = Some(truth.feet_gap_mm.iter().fold(0.0, |most, gap| most.max(*gap)));
        }
    }

    fn is_gone(&self) -> bool {
        self.truth.dropped
    }

    fn truth(&self) -> ObjectTruth {
        ObjectTruth::Ground(self.truth)
    }
}
