//! Invariants of every step of every load path.

use super::row::Row;
use crate::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use crate::contact::{Finger, FingerSettings, Friction, Law, Leg, Path, Pose, Stop};
use crate::layer::{Creep, Gel, SoftObject};
use slipbound::plane::Vec2;

/// The paths: press, then shear, twist, both, roll and release, forward and back.
fn paths() -> Vec<Path> {
    let press = Leg::press(20.0, 0.1);
    vec![
        Path::new(vec![press, Leg::shear(1.5, 0.4, 0.3), Leg::shear(-2.0, 0.0, 0.3), Leg::release(0.1)]),
        Path::new(vec![press, Leg::twist(0.3, 0.3), Leg::press(40.0, 0.1), Leg::twist(-0.4, 0.3)]),
        Path::new(vec![press, Leg::shear_and_twist(0.0, 1.0, 0.15, 0.3), Leg::roll(2.0, 0.0, 0.3)]),
    ]
    .into_iter()
    .map(|path| path.expect("a sound path"))
    .collect()
}

fn settings() -> Vec<(&'static str, FingerSettings)> {
    // Fine enough for every step to be one increment: the checked values are then known at the end of each.
    let plain = FingerSettings { substep_s: 1.0 / 300.0, ..FingerSettings::fast() };
    let weakening = Law::SlipWeakening { mu_static: 0.9, mu_kinetic: 0.6, distance_mm: 0.05 };
    let capped = Law::PressureDependent { adhesion_mpa: 0.005, slope: 0.5, cap_mpa: 0.06 };
    let soft = SoftObject { modulus_mpa: 0.5, poisson_ratio: 0.3, thickness_mm: 10.0 };
    let creeping = Gel { creep: Some(Creep { share_fraction: 0.1, time_s: 0.3 }), ..Gel::default() };
    vec![
        ("constant friction", plain),
        ("slip-weakening", FingerSettings { friction: Friction { law: weakening, yield_mm: 0.0 }, ..plain }),
        ("pressure-dependent", FingerSettings { friction: Friction { law: capped, yield_mm: 0.0 }, ..plain }),
        ("yielding interface", FingerSettings { friction: Friction { yield_mm: 0.02, ..plain.friction }, ..plain }),
        // A soft object is pressed deeper in the same time.
        (
            "creeping gel, soft object",
            FingerSettings { gel: creeping, soft_object: Some(soft), substep_s: 1.0 / 1200.0, ..plain },
        ),
    ]
}

/// The checked values of a finger before a step; a clone of the finger would copy its transforms.
#[derive(Debug, Default)]
struct Before {
    pose: Pose,
    contact: Vec<bool>,
    slipped_mm: Vec<f64>,
    bound_mpa: Vec<f64>,
    friction_mpa: Vec<Vec2>,
    shift_mm: Vec<Vec2>,
}

impl Before {
    fn take(&mut self, finger: &Finger) {
        let cells = 0..finger.contact().len();
        self.pose = finger.truth().pose;
        self.contact.clear();
        self.contact.extend_from_slice(finger.contact());
        self.slipped_mm.clear();
        self.slipped_mm.extend(cells.clone().map(|cell| finger.slipped_mm(cell)));
        self.bound_mpa.clear();
        self.bound_mpa.extend_from_slice(finger.bound_mpa());
        self.friction_mpa.clear();
        self.friction_mpa.extend(cells.clone().map(|cell| finger.friction_mpa(cell)));
        self.shift_mm.clear();
        self.shift_mm.extend(cells.map(|cell| finger.displacement(cell).shift_mm));
    }
}

fn every_step(settings: FingerSettings, mut look: impl FnMut(&Before, &Finger)) {
    fn run(
        settings: FingerSettings,
        shape: impl Shape + 'static,
        path: &Path,
        look: &mut impl FnMut(&Before, &Finger),
    ) {
        let mut finger = Finger::new(settings, shape).expect("sound settings");
        let mut before = Before::default();
        before.take(&finger);
        for command in path.commands(settings.substep_s) {
            let truth = finger.step(&command).expect("a sound command");
            assert!(truth.converged, "{truth:?}");
            look(&before, &finger);
            before.take(&finger);
        }
    }
    let paths = paths();
    run(settings, Sphere { radius_mm: 15.0 }, &paths[0], &mut look);
    run(settings, FlatBox { length_mm: 20.0, width_mm: 15.0, edge_radius_mm: 1.0 }, &paths[1], &mut look);
    run(settings, Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 }, &paths[2], &mut look);
}

/// Friction never exceeds its bound on the local slope, for its direction in the step before.
pub fn friction_bound() -> Vec<Row> {
    settings()
        .into_iter()
        .map(|(name, settings)| {
            let mut worst = 0.0f64;
            every_step(settings, |before, after| {
                for (cell, &pressure_mpa) in after.pressure_mpa().iter().enumerate() {
                    // From the friction law itself, with the slip at the beginning of the step.
                    let stayed = before.contact[cell];
                    let slipped_mm = if stayed { before.slipped_mm[cell] } else { 0.0 };
                    let used = match before.bound_mpa[cell] {
                        bound_mpa if bound_mpa > 0.0 => before.friction_mpa[cell] / bound_mpa,
                        _ => Vec2::ZERO,
                    };
                    let slope = after.slope(cell);
                    let bound_mpa = settings.friction.bound_on_slope_mpa(pressure_mpa, slipped_mm, slope, used);
                    let friction_mpa = after.friction_mpa(cell).length();
                    let over = if friction_mpa == 0.0 { 0.0 } else { friction_mpa / bound_mpa - 1.0 };
                    worst = worst.max(over);
                }
            });
            Row::deviation(format!("|q| over its bound, worst cell and step, {name}"), worst, 1e-9)
        })
        .collect()
}

/// Friction only dissipates work: q . (B dd - du) over every contact cell, from poses and displacements alone, for a
/// rigid object on a gel without creep.
pub fn friction_work() -> Vec<Row> {
    settings()
        .into_iter()
        .filter(|(_, settings)| settings.soft_object.is_none() && settings.friction.yield_mm == 0.0)
        .map(|(name, settings)| {
            let stop = Stop { tolerance_fraction: 1e-6, most_iterations_count: 3000 };
            let settings = FingerSettings { tangential_stop: stop, ..settings };
            let (mut put_in, mut taken_out) = (0.0f64, 0.0f64);
            every_step(settings, |before, after| {
                let (from, to) = (before.pose, after.truth().pose);
                for cell in (0..settings.grid.cells_count()).filter(|&cell| after.contact()[cell]) {
                    let at = settings.grid.centre_mm(cell) + before.shift_mm[cell] - from.position_mm;
                    let carried = to.position_mm - from.position_mm + at.turned() * (to.turn_rad - from.turn_rad);
                    let moved = after.displacement(cell).shift_mm - before.shift_mm[cell];
                    let work = after.friction_mpa(cell).dot(carried - moved);
                    if work < 0.0 {
                        put_in -= work;
                    } else {
                        taken_out += work;
                    }
                }
            });
            // Stuck cells move by the solver's tolerance, in both directions: hence not exactly 0.
            Row::deviation(format!("work put in by friction over work taken out, {name}"), put_in / taken_out, 1e-5)
        })
        .collect()
}
