//! The load at which an object slides as a whole must not depend on the grid.

use super::row::Row;
use crate::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use crate::contact::{Event, Finger, FingerSettings, Grid, Leg, Path, Pose};

const MU: f64 = 0.8;
const FORCE_N: f64 = 20.0;

/// Force over mu P, or torque in N mm over it, at the first step of gross slip; NaN without gross slip.
fn load_at_gross(settings: FingerSettings, shape: impl Shape + 'static, load: Leg, turning: bool) -> f64 {
    let path = Path::new(vec![Leg::press(FORCE_N, 0.25), load]).expect("a sound path");
    let mut finger = Finger::new(settings, shape).expect("sound settings");
    for command in path.commands(settings.substep_s) {
        let truth = finger.step(&command).expect("a sound command");
        if truth.time_s > 0.25 + 1e-6 && truth.events.contains(Event::Gross) {
            let load = if turning { truth.wrench.torque_n_mm } else { truth.wrench.force_n.length() };
            return load / (MU * FORCE_N);
        }
    }
    f64::NAN
}

/// Load at gross slip over mu P on three grids, in shear and in twist.
pub fn gross_load() -> Vec<Row> {
    let cap = Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 };
    let sphere = Sphere { radius_mm: 15.0 };
    let flat = FlatBox { length_mm: 20.0, width_mm: 15.0, edge_radius_mm: 1.0 };
    let mut rows = Vec::new();
    for (name, unit, turning, load) in [
        ("shear", "", false, Leg::shear(5.0, 0.0, 1.0)),
        ("shear across", "", false, Leg::shear(0.0, 5.0, 1.0)),
        ("twist", "mm", true, Leg::twist(2.0, 1.6)),
    ] {
        for object in ["cap", "sphere", "flat 20 x 15"] {
            if object == "sphere" && name == "shear across" {
                continue; // the same as along
            }
            let of = |grid: Grid| {
                let straight = FingerSettings { grid, ..FingerSettings::standard() };
                let turned = Pose { turn_rad: 0.3, ..Pose::default() };
                let settings = FingerSettings { shape_in_object: turned, ..straight };
                match object {
                    "cap" => load_at_gross(settings, cap, load, turning),
                    "sphere" => load_at_gross(settings, sphere, load, turning),
                    _ => load_at_gross(settings, flat, load, turning),
                }
            };
            let fine = of(Grid::padded(160, 120, 0.25, 12.0));
            for (cells, grid) in [("64 x 48", Grid::fast()), ("96 x 72", Grid::standard())] {
                let case = format!("load at gross slip over mu P, {object}, {name}, {cells} against 160 x 120");
                rows.push(Row::relative(case, fine, of(grid), unit, 0.02));
            }
        }
    }
    rows
}
