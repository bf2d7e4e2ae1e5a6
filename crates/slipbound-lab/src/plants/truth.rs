//! Ground truth of the held object, by kind.

use serde::Serialize;

/// Ground truth of a cap.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct CapTruth {
    /// Turn in the sense of the task, in rad, 0 or above.
    pub angle_rad: f64,
    /// Torque about X of both pads on it, in N mm, positive in the sense of the task.
    pub torque_n_mm: f64,
    /// Resisting torque of the thread, in N mm.
    pub thread_n_mm: f64,
    /// Largest torque that friction can carry at the present force, 2 mu P R, in N mm.
    pub limit_n_mm: f64,
    /// Whether it turned in the last step.
    pub yields: bool,
}

/// Ground truth of a bottle.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BottleTruth {
    /// Its mass, in kg.
    pub mass_kg: f64,
    /// Load on it other than pads and table, in N: weight, inertia of the hand's motion, pull.
    pub load_n: f64,
    /// The pull alone, in N.
    pub pull_n: f64,
    /// Force of the table on it, in N.
    pub table_n: f64,
    /// Height of its bottom above the table, in mm; negative if the table is compressed.
    pub above_table_mm: f64,
    /// When it left the table, in s since the start; None before.
    pub lifted_at_s: Option<f64>,
    /// Whether it slid out of the fingers: by more than 15 mm, or released in the air. Nothing changes after that.
    pub dropped: bool,
}

/// Ground truth of a tool and the ground.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct GroundTruth {
    /// Weight of the tool, in N.
    pub weight_n: f64,
    /// Force of the ground, in N.
    pub force_n: f64,
    /// Largest force of the ground while the pads held the tool, in N.
    pub peak_force_n: f64,
    /// Height of its feet above the ground, in mm: at Y = -L, then at +L. Negative if the springs are compressed.
    pub feet_gap_mm: [f64; 2],
    /// Rotation about Z, in rad, positive from X to Y; 0 is flat.
    pub tilt_rad: f64,
    /// Whether the stand still carries a part of it.
    pub on_stand: bool,
    /// Larger of the gaps under its feet when the pads released it, 0 or above, in mm: its fall until both feet stood.
    /// None until then.
    pub free_drop_mm: Option<f64>,
    /// Whether it slid out of the fingers.
    pub dropped: bool,
}

/// Ground truth of the held object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObjectTruth {
    /// Of a cap in its thread.
    Cap(CapTruth),
    /// Of a bottle.
    Bottle(BottleTruth),
    /// Of a tool and the ground below it.
    Ground(GroundTruth),
}
