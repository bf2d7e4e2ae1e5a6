//! Events of a scene over time.

use crate::contact::{Drive, Path};
use slipbound::plane::Vec2;
use slipbound::plant::GRAVITY_M_PER_S2;

/// Grip, motion and load over time, from the first touch.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadProfile {
    /// Grip, guided pose, roll.
    pub path: Path,
    /// Load on the object in addition to the path.
    pub pull: Pull,
    /// How the object moves.
    pub drive: Drive,
    /// How many fingers hold it.
    pub fingers_count: u32,
    /// Start of the load that can make it slide, in s; None without such a load.
    pub load_from_s: Option<f64>,
    /// The direction in which a guided object is loaded: translation in mm and rotation in rad of the whole motion.
    /// The load is the work that the wrench would do along it.
    pub along: (Vec2, f64),
}

impl LoadProfile {
    /// Whether the path of the object may be curved: it is moved, or pulled, and turned at once.
    pub fn may_bend(&self) -> bool {
        match self.pull {
            Pull::Ramp { twist_fraction, .. } => twist_fraction != 0.0 && twist_fraction.abs() < 1.0,
            Pull::Weight { .. } => false,
            Pull::None => self.along.0 != Vec2::ZERO && self.along.1 != 0.0,
        }
    }
}

/// Load on an object that is not guided.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Pull {
    /// None.
    #[default]
    None,
    /// A wrench of fixed direction that grows linearly: force and torque together, through the middle of the contact.
    ///
    /// Its unit is the wrench of full slip, computed when the load begins: force sum(bound) towards the direction,
    /// torque sum(bound |r|) about the middle of the contact. A share cos(a) of the force and sin(a) of the torque act
    /// together, a = `twist_fraction` x 90 deg: if the limit surface were an ellipse, the object would slide at a load
    /// of 1.
    Ramp {
        /// Of the force, in rad.
        direction_rad: f64,
        /// -1 to 1.
        twist_fraction: f64,
        /// Time from 0 to a load of 1, in s.
        ramp_s: f64,
        /// Load at which it stops growing.
        peak_fraction: f64,
    },
    /// The weight of a growing mass; it is applied linearly within `lift_s`. The load is the weight in N.
    Weight {
        /// Of gravity in the plane of the pad, in rad.
        direction_rad: f64,
        /// In s.
        lift_s: f64,
        /// When the load begins, in kg.
        mass_kg: f64,
        /// In kg/s, from the end of the lift on.
        fill_kg_per_s: f64,
        /// In kg.
        most_kg: f64,
    },
}

/// Acceleration of free fall in mm/s2.
pub(crate) const GRAVITY_MM_PER_S2: f64 = 1e3 * GRAVITY_M_PER_S2;

impl Pull {
    /// Load at a time in s since it began: in units of full slip (ramp) or N (weight).
    pub fn load(&self, since_s: f64) -> f64 {
        match *self {
            Pull::None => 0.0,
            Pull::Ramp { ramp_s, peak_fraction, .. } => (since_s / ramp_s).clamp(0.0, peak_fraction),
            Pull::Weight { lift_s, .. } => {
                self.mass_kg(since_s).unwrap_or(0.0) * 1e-3 * GRAVITY_MM_PER_S2 * (since_s / lift_s).clamp(0.0, 1.0)
            }
        }
    }

    /// Mass at a time in s since the load began; None when it is the object's own.
    pub fn mass_kg(&self, since_s: f64) -> Option<f64> {
        match *self {
            Pull::Weight { lift_s, mass_kg, fill_kg_per_s, most_kg, .. } => {
                Some((mass_kg + fill_kg_per_s * (since_s - lift_s).max(0.0)).min(most_kg.max(mass_kg)))
            }
            _ => None,
        }
    }
}
