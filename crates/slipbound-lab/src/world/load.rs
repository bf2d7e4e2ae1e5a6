//! The load that would make the object slide, and the present load.

use crate::contact::{Finger, Wrench};
use slipbound::plane::Vec2;

/// The wrench of full slip: sum(bound) towards a direction, and sum(bound |r|) about the object's reference point. Each
/// is the limit when acting alone; together they exceed it.
pub(super) fn full_slip(finger: &Finger, direction_rad: f64) -> Wrench {
    let grid = finger.settings().grid;
    let about = finger.truth().pose.position_mm;
    let (mut force_n, mut torque_n_mm) = (0.0, 0.0);
    for (cell, bound_mpa) in finger.bound_mpa().iter().enumerate().filter(|(_, bound)| **bound > 0.0) {
        let skin_mm = grid.centre_mm(cell) + finger.displacement(cell).shift_mm;
        force_n += bound_mpa * grid.cell_area_mm2();
        torque_n_mm += bound_mpa * grid.cell_area_mm2() * (skin_mm - about).length();
    }
    let (s, c) = libm::sincos(direction_rad);
    Wrench { force_n: Vec2::new(c, s) * force_n, torque_n_mm }
}

/// The load of a guided object: the work in N mm that the wrench would do along the whole motion.
pub(super) fn along(wrench: &Wrench, (shift_mm, turn_rad): (Vec2, f64)) -> f64 {
    (wrench.force_n.dot(shift_mm) + wrench.torque_n_mm * turn_rad).abs()
}
