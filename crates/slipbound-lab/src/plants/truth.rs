//! What is true of the thing that is held, by kind.

use serde::Serialize;

/// What is true of a cap.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct CapTruth {
    /// How far it has been turned in the sense of the task, in rad, 0 or above.
    pub angle_rad: f64,
    /// Torque about X that both pads exert on it, in N mm, positive in the sense of the task.
    pub torque_n_mm: f64,
    /// Torque that the thread holds against, in N mm.
    pub thread_n_mm: f64,
    /// Largest torque that friction can carry at the present force, 2 mu P R, in N mm.
    pub limit_n_mm: f64,
    /// Whether it turned in the last step.
    pub yields: bool,
}

/// What is true of a bottle.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BottleTruth {
    /// Its mass, in kg.
    pub mass_kg: f64,
    /// Load on it besides pads and table, in N: weight, inertia of the hand's motion, pull.
    pub load_n: f64,
    /// The pull alone, in N.
    pub pull_n: f64,
    /// Force of the table on it, in N.
    pub table_n: f64,
    /// How far its bottom is above the table, in mm; negative where the table gives.
    pub above_table_mm: f64,
    /// When it left the table, in s since the start; None while it has not.
    pub lifted_at_s: Option<f64>,
    /// Whether it slid out of the fingers: more than 15 mm, or let go in the air. Nothing changes after that.
    pub dropped: bool,
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

/// What is true of the thing that is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObjectTruth {
    /// Of a cap in its thread.
    Cap(CapTruth),
    /// Of a bottle.
    Bottle(BottleTruth),
    /// Of a tool and the ground below it.
    Ground(GroundTruth),
}
