//! Ground truth of a cycle in simulation: the basis of scores, kept in the run folder.

use serde::{Deserialize, Serialize};

/// Ground truth of a cycle. A field is None where it has no meaning for the task.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PlantTruth {
    /// Angle of the cap since the start, rad.
    pub cap_angle_rad: Option<f64>,
    /// Torque that the cap carries, N mm.
    pub torque_n_mm: Option<f64>,
    /// Torque that the fingers can exert at the present force before the cap turns in them, N mm.
    pub torque_limit_n_mm: Option<f64>,
    /// Tangential load on the fingers, N, both together.
    pub load_n: Option<f64>,
    /// Minimum normal force per finger that carries the load, N.
    pub required_n: Option<f64>,
    /// m = 1 - f: share of the load at gross slip that remains; below 0 after gross slip.
    pub margin: Option<f64>,
    /// phi: share of the contact area that sticks, 0 to 1.
    pub stick_ratio: Option<f64>,
    /// How far the object has slid through the fingers, mm.
    pub slid_mm: Option<f64>,
    /// Whether the whole contact slides.
    pub gross: bool,
    /// Force between object and ground, N.
    pub ground_force_n: Option<f64>,
    /// Mass of the object, kg.
    pub mass_kg: Option<f64>,
}
