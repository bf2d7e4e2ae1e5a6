//! Support of an object from below, its weight, and small sums that bottle and tool share.

use crate::contact::{Inertia, Pose, Springs, Truth, Wrench};
use crate::scenes::GRAVITY_MM_PER_S2;
use slipbound::plane::Vec2;

/// Sliding distance over the pads after which an object counts as lost, in mm.
pub(super) const LOST_AFTER_MM: f64 = 15.0;

/// Weight in N of a mass in kg.
pub(super) fn weight_n(mass_kg: f64) -> f64 {
    mass_kg * GRAVITY_MM_PER_S2 * 1e-3
}

/// Two feet over a flat ground that pushes back like springs and never pulls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Feet {
    /// Their positions on the object, in mm.
    pub feet_mm: [Vec2; 2],
    /// Stiffness under each, in N/mm.
    pub stiffness_n_per_mm: f64,
    /// Distance of the ground below the start of the hand, in mm.
    pub ground_mm: f64,
}

impl Feet {
    /// Positions relative to the object's reference point, for the object's rotation.
    fn levers_mm(&self, turn_rad: f64) -> [Vec2; 2] {
        let (s, c) = libm::sincos(turn_rad);
        self.feet_mm.map(|foot| Vec2::new(c * foot.x - s * foot.y, s * foot.x + c * foot.y))
    }

    /// Gaps between the feet and the ground, in mm; negative if the springs are compressed.
    pub fn gaps_mm(&self, pose: Pose, lowered_mm: f64) -> [f64; 2] {
        let down_mm = pose.position_mm.x + lowered_mm;
        self.levers_mm(pose.turn_rad).map(|lever| self.ground_mm - down_mm - lever.x)
    }

    /// Force of the ground under each foot, in N.
    pub fn forces_n(&self, pose: Pose, lowered_mm: f64) -> [f64; 2] {
        self.gaps_mm(pose, lowered_mm).map(|gap_mm| (-gap_mm).max(0.0) * self.stiffness_n_per_mm)
    }

    /// The springs of a step and their force at the object's present pose. A foot counts if it will be on the ground at
    /// the end of the step: moving over the pads as in the last step (`moved`), or falling. A foot on the ground counts
    /// for one more step, whatever its last motion: released too early it would fall into the ground. With a wrong
    /// guess it touches down, or leaves, a step late.
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
            let along = [1.0, 0.0, -lever.y]; // lowering of the foot as the object moves
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
    let (s, c) = libm::sincos(turn_rad);
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
