//! The ground truth of the hand and of the held object.

use crate::contact::{Pose, Truth, Wrench};
use crate::plants::{BottleTruth, CapTruth, GroundTruth, ObjectTruth};
use serde::Serialize;
use slipbound::plant::PlantTruth;

/// Ground truth at the end of a step, and sums since the start.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct HandTruth {
    /// Time since the start, in ns.
    pub time_ns: u64,
    /// Angle of the wrist about the axis along the fingers since the start, in rad, positive from Y to Z.
    pub angle_rad: f64,
    /// Distance lowered since the start, in mm.
    pub lowered_mm: f64,
    /// Distance between the fingertips, in mm; None if the gripper is outside the simulator.
    pub opening_mm: Option<f64>,
    /// Normal force per finger, in N.
    pub grip_force_n: f64,
    /// Load of the object on the gel of the left and of the right finger, each in its own frame; the torque is about
    /// the middle of the contact.
    pub wrench: [Wrench; 2],
    /// Position of the object's reference point, in the frame of the left finger.
    pub pose: Pose,
    /// Area under pressure on one finger, in mm2; the mean if the pads differ, as for the force and the values derived
    /// from it. Ratios are then of both pads together, and an object slides as a whole if it slides over both.
    pub contact_area_mm2: f64,
    /// phi: area that did not slide in the last step over area in contact; None without contact.
    pub stick_ratio: Option<f64>,
    /// Share of the friction that is used, see [`GROSS_FRICTION_FRACTION`](crate::contact::GROSS_FRICTION_FRACTION);
    /// None without contact or motion.
    pub friction_used_fraction: Option<f64>,
    /// Least normal force per finger that would hold the present load, in N: the grip times sqrt(F^2 + (T / a)^2) over
    /// the sum of the bounds, with the friction F, its torque T about the middle of the contact and the mean lever a of
    /// friction. Exact for a pure force, and for a pure torque as long as a does not change; in between the limit
    /// surface is approximated by an ellipsoid (Howe and Cutkosky, IJRR 15 (1996) 557), which is accurate to some 10 %.
    pub required_n: f64,
    /// Whether the object slid as a whole in the last step: from 0.99 of the friction used until it falls below 0.95,
    /// while at least half of the grip is required.
    pub gross: bool,
    /// Number of such steps.
    pub gross_steps_count: u64,
    /// Time of the first such step, in ns; None if there was none.
    pub first_gross_ns: Option<u64>,
    /// Total path of the object over the pads while it slid as a whole, in mm; rotation counts at the lever of every
    /// cell.
    pub slid_mm: f64,
    /// Largest pressure, in MPa.
    pub peak_pressure_mpa: f64,
    /// Largest displacement gradient of the gel's surface, as a fraction.
    pub largest_strain_fraction: f64,
    /// Whether that, or the strain of a soft object, is beyond the range of a linear gel.
    pub beyond_linear: bool,
    /// Whether the contact reaches the border of the pad.
    pub at_border: bool,
    /// Whether both solvers met their tolerance in every step so far.
    pub converged: bool,
    /// Of the left and the right pad separately; None if they are identical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pads: Option<[PadTruth; 2]>,
    /// Of a cap.
    pub cap: Option<CapTruth>,
    /// Of a bottle.
    pub bottle: Option<BottleTruth>,
    /// Of a tool and the ground.
    pub ground: Option<GroundTruth>,
}

/// Ground truth of one of two pads that differ.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct PadTruth {
    /// phi, as in [`HandTruth::stick_ratio`].
    pub stick_ratio: Option<f64>,
    /// As in [`HandTruth::friction_used_fraction`].
    pub friction_used_fraction: Option<f64>,
    /// Area under pressure, in mm2.
    pub contact_area_mm2: f64,
}

impl PadTruth {
    pub(super) fn of(contact: &Truth) -> Self {
        PadTruth {
            stick_ratio: contact.stick_ratio,
            friction_used_fraction: contact.friction_used_fraction,
            contact_area_mm2: contact.contact_area_mm2,
        }
    }
}

impl HandTruth {
    /// Adds the ground truth of the held object.
    pub(super) fn set_object(&mut self, truth: ObjectTruth) {
        match truth {
            ObjectTruth::Cap(cap) => self.cap = Some(cap),
            ObjectTruth::Bottle(bottle) => self.bottle = Some(bottle),
            ObjectTruth::Ground(ground) => self.ground = Some(ground),
        }
    }

    /// The record of a cycle for a run folder. The margin is 1 - required / applied force, at least -1, and None
    /// without contact force; torques are absolute values.
    pub fn record(&self) -> PlantTruth {
        let used_fraction = (self.grip_force_n > 0.0).then(|| self.required_n / self.grip_force_n);
        PlantTruth {
            cap_angle_rad: self.cap.map(|cap| cap.angle_rad),
            torque_n_mm: self.cap.map(|cap| cap.torque_n_mm.abs()),
            torque_limit_n_mm: self.cap.map(|cap| cap.limit_n_mm.abs()),
            load_n: self.bottle.map(|bottle| bottle.load_n),
            required_n: Some(self.required_n),
            margin: used_fraction.map(|used| (1.0 - used).max(-1.0)),
            stick_ratio: self.stick_ratio,
            slid_mm: Some(self.slid_mm),
            gross: self.gross,
            ground_force_n: self.ground.map(|ground| ground.force_n),
            mass_kg: self.bottle.map(|bottle| bottle.mass_kg),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_record_of_a_cycle_has_what_is_known_and_leaves_out_the_rest() {
        let cap = CapTruth { angle_rad: 0.3, torque_n_mm: -250.0, limit_n_mm: 420.0, ..CapTruth::default() };
        let mut truth = HandTruth { grip_force_n: 20.0, required_n: 12.0, slid_mm: 0.4, ..HandTruth::default() };
        truth.set_object(ObjectTruth::Cap(cap));
        let record = truth.record();
        assert_eq!((record.cap_angle_rad, record.torque_n_mm), (Some(0.3), Some(250.0)));
        assert_eq!((record.torque_limit_n_mm, record.required_n), (Some(420.0), Some(12.0)));
        assert!((record.margin.expect("something is pressed") - 0.4).abs() < 1e-12);
        assert_eq!((record.load_n, record.ground_force_n, record.mass_kg), (None, None, None));

        let slides = HandTruth { required_n: 90.0, ..truth.clone() };
        assert_eq!(slides.record().margin, Some(-1.0), "no further below than that");
        assert_eq!(HandTruth { grip_force_n: 0.0, ..truth }.record().margin, None, "nothing is pressed");

        let mut lifted = HandTruth::default();
        lifted.set_object(ObjectTruth::Bottle(BottleTruth { load_n: 5.0, mass_kg: 0.5, ..BottleTruth::default() }));
        assert_eq!((lifted.record().load_n, lifted.record().mass_kg), (Some(5.0), Some(0.5)));
        let mut placed = HandTruth::default();
        placed.set_object(ObjectTruth::Ground(GroundTruth { force_n: 2.0, ..GroundTruth::default() }));
        assert_eq!(placed.record().ground_force_n, Some(2.0));
    }
}
