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
//! A stand holds the tool until the pads have had it for a while; then it gives way, evenly.

use super::{Ask, HandPlace, Held, Symmetry};
use crate::contact::{Drive, Inertia, Pose, Springs, Truth, Wrench};
use crate::hand::HandTruth;
use crate::scenes::GRAVITY_MM_PER_S2;
use serde::Serialize;
use slipbound::plane::Vec2;

/// Stiffness of the ground under a foot, in N/mm. Estimate.
const GROUND_N_PER_MM: f64 = 50.0;

/// Stiffness of the arm, in N/mm, in series with the ground. Estimate.
const ARM_N_PER_MM: f64 = 20.0;

/// How long the pads have a tool before its stand gives way, in s.
const STAND_S: f64 = 0.15;

/// Time in which it gives way, in s.
const HANDOVER_S: f64 = 0.2;

/// Way over the pads after which something held is no longer held, in mm.
pub(super) const LOST_AFTER_MM: f64 = 15.0;

/// Weight in N of a mass in kg.
pub(super) fn weight_n(mass_kg: f64) -> f64 {
    mass_kg * GRAVITY_MM_PER_S2 * 1e-3
}

/// Two feet over a flat ground that pushes back as springs do and pulls at nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Feet {
    /// Where they are on the object, in mm.
    pub feet_mm: [Vec2; 2],
    /// Stiffness under each, in N/mm.
    pub stiffness_n_per_mm: f64,
    /// How far below the start of the hand the ground is, in mm.
    pub ground_mm: f64,
}

impl Feet {
    /// From the object's reference point, with the object turned as it is.
    fn levers_mm(&self, turn_rad: f64) -> [Vec2; 2] {
        let (s, c) = turn_rad.sin_cos();
        self.feet_mm.map(|foot| Vec2::new(c * foot.x - s * foot.y, s * foot.x + c * foot.y))
    }

    /// How far the feet are above the ground, in mm; negative where the springs give.
    pub fn gaps_mm(&self, pose: Pose, lowered_mm: f64) -> [f64; 2] {
        let down_mm = pose.position_mm.x + lowered_mm;
        self.levers_mm(pose.turn_rad).map(|lever| self.ground_mm - down_mm - lever.x)
    }

    /// What the ground pushes with under each foot, in N.
    pub fn forces_n(&self, pose: Pose, lowered_mm: f64) -> [f64; 2] {
        self.gaps_mm(pose, lowered_mm).map(|gap_mm| (-gap_mm).max(0.0) * self.stiffness_n_per_mm)
    }

    /// The springs of a step and their force where the object now is. A foot counts when it is going to be on the
    /// ground at the end of the step: moving over the pads as it did in the last one (`moved`), or falling. One that
    /// stands counts for a step more, whatever it did last: let go too early it would fall into the ground. Guessed
    /// wrong, it comes down, or leaves, a step late.
    pub fn springs(&self, contact: &Truth, moved: Pose, lowered_mm: f64, step_s: f64) -> (Springs, Wrench) {
        let (mut springs, mut push) = (Springs::default(), Wrench::default());
        let pose = contact.pose;
        let falls_mm = if contact.contact_cells_count == 0 { GRAVITY_MM_PER_S2 * step_s * step_s } else { 0.0 };
        let gaps_mm = self.gaps_mm(pose, lowered_mm);
        for (lever, gap_mm) in self.levers_mm(pose.turn_rad).into_iter().zip(gaps_mm) {
            let sinks_mm = moved.position_mm.x - lever.y * moved.turn_rad + falls_mm;
            if gap_mm > sinks_mm.max(0.0) {
                continue;
            }
            let k = self.stiffness_n_per_mm;
            let along = [1.0, 0.0, -lever.y]; // how the foot goes down as the object moves
            for (i, row) in springs.stiffness.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry += k * along[i] * along[j];
                }
            }
            push.force_n.x += k * gap_mm;
            push.torque_n_mm -= k * gap_mm * lever.y;
        }
        (springs, push)
    }
}

/// The weight of an object about its reference point.
pub(super) fn weight(inertia: &Inertia, turn_rad: f64) -> Wrench {
    let (s, c) = turn_rad.sin_cos();
    let e = inertia.centre_of_mass_mm;
    let force_n = weight_n(inertia.mass_kg);
    Wrench { force_n: Vec2::new(force_n, 0.0), torque_n_mm: -(s * e.x + c * e.y) * force_n }
}

pub(super) fn sum(a: Wrench, b: Wrench) -> Wrench {
    Wrench { force_n: a.force_n + b.force_n, torque_n_mm: a.torque_n_mm + b.torque_n_mm }
}

pub(super) fn difference(now: Pose, before: Pose) -> Pose {
    Pose { position_mm: now.position_mm - before.position_mm, turn_rad: now.turn_rad - before.turn_rad }
}

/// What is true of a tool and the ground.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct GroundTruth {
    /// Weight of the tool, in N.
    pub weight_n: f64,
    /// What the ground pushes with, in N.
    pub force_n: f64,
    /// The most it pushed with while the pads held the tool, in N.
    pub peak_force_n: f64,
    /// How far its feet are above the ground, in mm: at Y = -L, then at +L. Negative where the springs give.
    pub feet_gap_mm: [f64; 2],
    /// How it is turned about Z, in rad, positive from X to Y; 0 lies flat.
    pub tilt_rad: f64,
    /// Whether the stand still carries some of it.
    pub on_stand: bool,
    /// Larger of the gaps under its feet when the pads let go of it, 0 or above, in mm: how deep it fell until both
    /// stood. None until then.
    pub free_drop_mm: Option<f64>,
    /// Whether it slid out of the fingers.
    pub dropped: bool,
}

/// A tool and the ground.
#[derive(Debug, Clone)]
pub struct Tool {
    start: Pose,
    feet: Feet,
    inertia: Inertia,
    /// Time the pads have had it, in s.
    touched_s: f64,
    /// Of the last step.
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
    /// Where the centre of mass is from the grip, along Y of the untilted tool, in mm.
    pub off_mm: f64,
    /// How it is turned about Z, in rad, positive from X to Y.
    pub tilt_rad: f64,
    /// Gap under the lower foot, in mm.
    pub height_mm: f64,
}

impl Tool {
    /// A tool in its stand.
    pub fn new(settings: ToolSettings) -> Self {
        // y = -Y and turns count the other way in the frame of the left finger.
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

    /// How much of the weight the stand no longer carries.
    fn handed_over(&self) -> f64 {
        ((self.touched_s - STAND_S) / HANDOVER_S).clamp(0.0, 1.0)
    }
}

impl Held for Tool {
    fn start(&self) -> Pose {
        self.start
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Mirrored
    }

    fn ask(&mut self, contact: &Truth, hand: HandPlace, step_s: f64) -> Ask {
        let share = self.handed_over();
        let mut ask = Ask { drive: Drive::Guided, pose: self.start, roll_mm: Vec2::ZERO, wrench: Wrench::default() };
        if share == 0.0 {
            ask.pose.position_mm.x -= hand.lowered_mm;
            return ask;
        }
        let (springs, push) = self.feet.springs(contact, self.moved, hand.lowered_mm, step_s);
        ask.drive = Drive::Sprung(springs, self.inertia);
        ask.wrench = sum(push, weight(&self.inertia, contact.pose.turn_rad).scaled(share));
        ask
    }

    fn took(&mut self, contact: &Truth, hand: HandPlace, step_s: f64, slid_mm: f64) {
        let touches = contact.contact_cells_count > 0;
        let free = self.handed_over() > 0.0;
        let truth = &mut self.truth;
        if free && !touches && truth.free_drop_mm.is_none() {
            // The gaps of the step before: in this one it has begun to fall.
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

    fn tell(&self, truth: &mut HandTruth) {
        truth.ground = Some(self.truth);
    }
}
