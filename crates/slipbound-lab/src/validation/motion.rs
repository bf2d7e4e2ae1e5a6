//! Motion of the object: rates and rotations.

use super::row::Row;
use crate::contact::shape::Sphere;
use crate::contact::{Body, Command, Drive, Finger, FingerSettings, Grip, Inertia, Leg, Path, Pose, Wrench};
use slipbound::plane::Vec2;

/// Force on a sphere that has been pushed by 2 mm, at a rate and with a number of steps a second.
fn pushed_n(rate_mm_per_s: f64, steps_hz: f64) -> f64 {
    let settings = FingerSettings { substep_s: 1.0 / steps_hz, ..FingerSettings::standard() };
    let path = Path::new(vec![Leg::press(20.0, 0.25), Leg::shear(2.0, 0.0, 2.0 / rate_mm_per_s)]).expect("a path");
    let mut finger = Finger::new(settings, Sphere { radius_mm: 15.0 }).expect("sound settings");
    for command in path.commands(settings.substep_s) {
        finger.step(&command).expect("a sound command");
    }
    finger.truth().wrench.force_n.x
}

/// A shear at 120 steps a second against the limit of fine steps: a quasi-static gel does not depend on the rate.
pub fn shear_rate() -> Vec<Row> {
    let limit_n = pushed_n(1.5, 960.0);
    [1.5, 30.0, 120.0]
        .into_iter()
        .map(|rate| {
            let case = format!("sphere pushed by 2 mm at {rate} mm/s: force against that of fine steps");
            Row::relative(case, limit_n, pushed_n(rate, 120.0), "N", 0.01)
        })
        .collect()
}

/// A free body whose centre of mass is 60 mm off its reference point, turned by a pure torque until it has rotated by 1
/// rad in 0.5 s, then free for 0.5 s: the centre of mass does not move, and the rest rotates about it.
pub fn free_rotation() -> Vec<Row> {
    const OFF_MM: f64 = 60.0;
    const GYRATION_MM: f64 = 40.0;
    const MASS_KG: f64 = 0.3;
    let mut rows = Vec::new();
    for substeps in [4.0, 16.0] {
        let inertia =
            Inertia { mass_kg: MASS_KG, gyration_radius_mm: GYRATION_MM, centre_of_mass_mm: Vec2::new(OFF_MM, 0.0) };
        let body = Body { drive: Drive::Free(inertia), fingers_count: 1 };
        let settings = FingerSettings { body, substep_s: 1.0 / (30.0 * substeps), ..FingerSettings::fast() };
        let mut finger = Finger::new(settings, Sphere { radius_mm: 15.0 }).expect("sound settings");
        // theta = T t^2 / 2 I; only a pure torque moves a point in the plane without moving the centre of mass.
        let torque_n_mm = 2.0 / 0.25 * MASS_KG * 1e-3 * GYRATION_MM * GYRATION_MM;
        for n in 1..=(substeps * 30.0) as u32 {
            let spun = f64::from(n) <= substeps * 15.0;
            let wrench = Wrench { force_n: Vec2::ZERO, torque_n_mm: if spun { torque_n_mm } else { 0.0 } };
            let command = Command { grip: Grip::ForceN(0.0), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench };
            let pose = finger.step(&command).expect("a sound command").pose;
            if n == (substeps * 15.0) as u32 || n == (substeps * 30.0) as u32 {
                let (s, c) = libm::sincos(pose.turn_rad);
                let due_mm = Vec2::new(OFF_MM * (1.0 - c), -OFF_MM * s);
                let lost = (pose.position_mm - due_mm).length() / OFF_MM;
                let name = if spun { "spun up" } else { "and left alone" };
                let case =
                    format!("free body, centre of mass 60 mm off, {name}, {substeps} steps a frame: off its circle");
                rows.push(Row::deviation(case, lost, 2e-3));
                let due_rad = if spun { 1.0 } else { 3.0 };
                let case = format!("free body, {name}, {substeps} steps a frame: turn");
                // Implicit Euler is a step early.
                rows.push(Row::relative(case, due_rad, pose.turn_rad, "rad", 1.5 / (substeps * 15.0)));
            }
        }
    }
    rows
}
