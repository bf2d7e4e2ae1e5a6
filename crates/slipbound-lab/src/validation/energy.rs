//! Energy balance: the work done on the object equals the heat plus the energy stored in the gel.

use super::row::Row;
use crate::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use crate::contact::{Finger, FingerSettings, Leg, Path, Pose, Stop, Truth};
use crate::layer::above_zero;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Strains are near 1 at this force; at 20 N and mu 0.8 the rim of the cap is strained by 3 and more, and snaps.
const FORCE_N: f64 = 10.0;

/// Tight enough that stuck cells do not drift by the solver's tolerance.
fn exact(settings: FingerSettings) -> FingerSettings {
    let stop = Stop { tolerance_fraction: 1e-6, most_iterations_count: 3000 };
    FingerSettings { normal_stop: stop, tangential_stop: stop, ..settings }
}

fn start(settings: FingerSettings, shape: &str) -> Finger {
    match shape {
        "sphere" => Finger::new(settings, Sphere { radius_mm: 15.0 }),
        "cap" => Finger::new(settings, Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 }),
        _ => Finger::new(settings, FlatBox { length_mm: 20.0, width_mm: 15.0, edge_radius_mm: 1.0 }),
    }
    .expect("sound settings")
}

/// Work in N mm of an object from one step to the next: wrench along its motion and grip force along its depth, each
/// the mean of the two steps.
fn work_n_mm(before: &Truth, after: &Truth) -> f64 {
    let force_n = (before.wrench.force_n + after.wrench.force_n) * 0.5;
    let torque_n_mm = 0.5 * (before.wrench.torque_n_mm + after.wrench.torque_n_mm);
    let grip_n = 0.5 * (before.grip_force_n + after.grip_force_n);
    force_n.dot(after.pose.position_mm - before.pose.position_mm)
        + torque_n_mm * (after.pose.turn_rad - before.pose.turn_rad)
        + grip_n * (after.depth_mm - before.depth_mm)
}

/// Elastic energy of the gel in N mm, half of traction times displacement.
fn stored_n_mm(finger: &Finger) -> f64 {
    let cells = (0..finger.contact().len()).filter(|&cell| finger.contact()[cell]);
    let sum: f64 = cells
        .map(|cell| {
            let moved = finger.displacement(cell);
            finger.traction_mpa(cell).dot(moved.shift_mm) + finger.pressure_mpa()[cell] * moved.depth_mm
        })
        .sum();
    0.5 * sum * finger.settings().grid.cell_area_mm2()
}

/// Work that is neither heat nor stored in the gel, over the heat, when an object is pressed, pushed until it slides,
/// pushed further and brought back.
fn lost_fraction(shape: &str, aside: Vec2, substeps_count: u32) -> f64 {
    let settings =
        exact(FingerSettings { substep_s: 1.0 / (30.0 * f64::from(substeps_count)), ..FingerSettings::fast() });
    let legs = vec![
        Leg::press(FORCE_N, 0.25),
        Leg::shear(2.0 * aside.x, 2.0 * aside.y, 0.5),
        Leg::shear(2.0 * aside.x, 2.0 * aside.y, 0.5),
        Leg::shear(-4.0 * aside.x, -4.0 * aside.y, 1.0),
    ];
    let path = Path::new(legs).expect("a sound path");
    let mut finger = start(settings, shape);
    let (mut work, mut heat) = (0.0, 0.0);
    for (n, command) in path.commands(settings.substep_s).enumerate() {
        let before = *finger.truth();
        let after = *finger.step(&command).expect("a sound command");
        // Before the first contact there is no depth to start from.
        work += if n == 0 { 0.5 * after.grip_force_n * after.depth_mm } else { work_n_mm(&before, &after) };
        heat += after.dissipated_n_mm;
    }
    (work - heat - stored_n_mm(&finger)) / heat
}

/// The cycle at 4, 8, 16 and 32 steps a frame, and the order of convergence of the loss.
pub fn energy_cycle() -> Vec<Row> {
    let mut rows = Vec::new();
    let along = Vec2::new(1.0, 0.0);
    let across = Vec2::new(0.0, 1.0);
    for (name, shape, aside) in [
        ("sphere", "sphere", along),
        ("cap along its axis", "cap", along),
        ("cap across its axis", "cap", across),
        ("flat 20 x 15", "flat", along),
    ] {
        let lost = [4, 8, 16, 32].map(|substeps| (substeps, lost_fraction(shape, aside, substeps)));
        for (substeps, lost) in lost {
            let case = format!("energy lost over heat, {name}, {substeps} steps a frame");
            // The tolerance is for 16 and finer; the error of coarser ones is known, and less than what p grad g makes
            // on the flattest.
            rows.push(Row::deviation(case, lost, if substeps < 16 { 0.007 } else { 0.005 }));
        }
        let order = 0.5 * libm::log2((lost[1].1 / lost[3].1).abs());
        rows.push(Row::at_least(format!("energy lost, {name}: order in the step, 8 to 32"), 0.8, order));
    }
    rows
}

/// Steady sliding at 4 mm/s, at 16 steps a frame and at the 4 that are shipped: the heat equals the work of the wrench,
/// minus the energy stored in the gel meanwhile.
pub fn sliding_heat() -> Vec<Row> {
    let place = Pose { position_mm: Vec2::new(-6.0, -6.0), turn_rad: 0.0 };
    let (along, across) = (Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0));
    let mut rows = Vec::new();
    for substeps_count in [16, 4] {
        let substep_s = 1.0 / (30.0 * f64::from(substeps_count));
        let settings = exact(FingerSettings { shape_in_object: place, substep_s, ..FingerSettings::fast() });
        for (name, shape, aside, force_n) in [
            ("sphere", "sphere", along, 5.0),
            ("sphere", "sphere", along, 20.0),
            ("sphere", "sphere", along, 45.0),
            ("cap along its axis", "cap", along, FORCE_N),
            ("cap across its axis", "cap", across, FORCE_N),
            ("flat 20 x 15", "flat", along, FORCE_N),
        ] {
            let (due, heat) = slid_n_mm(settings, shape, aside, force_n);
            let case = format!(
                "steady sliding, {name}, {force_n} N, {substeps_count} steps a frame: heat against wrench x way"
            );
            // The tolerance is for 16; the error of the shipped setting is known.
            rows.push(Row::relative(case, due, heat, "N mm", if substeps_count < 16 { 0.01 } else { 5e-3 }));
        }
    }
    rows
}

/// Work in N mm while an object slides by its last 4 of 12 mm, minus the energy stored in the gel meanwhile; and the
/// heat.
fn slid_n_mm(settings: FingerSettings, shape: &str, aside: Vec2, force_n: f64) -> (f64, f64) {
    let legs = vec![
        Leg::press(force_n, 0.25),
        Leg::shear(8.0 * aside.x, 8.0 * aside.y, 2.0),
        Leg::shear(4.0 * aside.x, 4.0 * aside.y, 1.0),
    ];
    let path = Path::new(legs).expect("a sound path");
    let mut finger = start(settings, shape);
    let (mut work, mut heat, mut stored) = (0.0, 0.0, 0.0);
    for command in path.commands(settings.substep_s) {
        let before = *finger.truth();
        let after = *finger.step(&command).expect("a sound command");
        if after.time_s > 2.25 + 1e-6 {
            work += work_n_mm(&before, &after);
            heat += after.dissipated_n_mm;
        } else {
            stored = stored_n_mm(&finger);
        }
    }
    (work - (stored_n_mm(&finger) - stored), heat)
}

/// A face inclined along x with sharp sides: its lowest point is at the side of least x.
#[derive(Debug, Clone, Copy)]
struct Incline {
    half_mm: f64,
    slope: f64,
}

impl Shape for Incline {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        let on_face = from_centre.x.abs() <= self.half_mm && from_centre.y.abs() <= self.half_mm;
        if on_face { self.slope * (from_centre.x + self.half_mm) } else { f64::INFINITY }
    }

    fn half_size_mm(&self) -> Vec2 {
        Vec2::new(self.half_mm, self.half_mm)
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("incline.half_mm", self.half_mm)
    }
}

/// Horizontal over vertical force on an inclined face that slides up and down, where it has slid by a millimetre,
/// against the statics of a wedge.
pub fn inclined_face() -> Vec<Row> {
    const MU: f64 = 0.8;
    let settings = exact(FingerSettings::standard());
    [("up", 1.0), ("down", -1.0)]
        .into_iter()
        .map(|(name, way)| {
            let slope_rad = 5f64.to_radians();
            let face = Incline { half_mm: 6.0, slope: libm::tan(slope_rad) };
            let path = Path::new(vec![Leg::press(4.0, 0.25), Leg::shear(way * 6.0, 0.0, 1.5)]).expect("a sound path");
            let mut finger = Finger::new(settings, face).expect("sound settings");
            for command in path.commands(settings.substep_s) {
                finger.step(&command).expect("a sound command");
            }
            // Cells that have just come under the face still stick.
            let slid = (0..finger.contact().len()).filter(|&cell| finger.slipped_mm(cell) > 1.0);
            let (along, upright) = slid.fold((0.0, 0.0), |(along, upright), cell| {
                (along + finger.traction_mpa(cell).x, upright + finger.pressure_mpa()[cell])
            });
            let measured = way * along / upright;
            // The object slides over the gel; its face rises towards +x, so the gel in that direction is in front of
            // it.
            let theory = libm::tan(libm::atan(MU) + way * slope_rad);
            let case = format!("face inclined by 5 degrees, slid {name}: horizontal over vertical force");
            Row::relative(case, theory, measured, "", 5e-3)
        })
        .collect()
}
