//! Coarse grids against a fine one, during loading up to full slip.

use super::row::Row;
use crate::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use crate::contact::{Finger, FingerSettings, Grid, Leg, Path, Pose, Stop};

/// The shapes are rotated relative to the grid. With edges along the grid whole rows of cells change state at once:
/// load and stick ratio then differ from the fine grid by up to 0.014 and 0.06 (docs/simulator.md, limits).
const TURN_RAD: f64 = 0.3;

/// A shape, a name and a path whose second leg leads to full slip.
struct Trial {
    name: &'static str,
    turning: bool,
    path: Path,
    start: fn(FingerSettings) -> Finger,
}

fn finger(settings: FingerSettings, shape: impl Shape + 'static) -> Finger {
    let settings = FingerSettings { shape_in_object: Pose { turn_rad: TURN_RAD, ..Pose::default() }, ..settings };
    Finger::new(settings, shape).expect("sound settings")
}

fn trials() -> Vec<Trial> {
    let flat = |settings| finger(settings, FlatBox { length_mm: 20.0, width_mm: 15.0, edge_radius_mm: 1.0 });
    let path = |leg| Path::new(vec![Leg::press(20.0, 0.25), leg]).expect("a sound path");
    vec![
        Trial {
            name: "cap, shear",
            turning: false,
            path: path(Leg::shear(3.4, 0.0, 0.5)),
            start: |s| finger(s, Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 }),
        },
        Trial {
            name: "sphere, shear",
            turning: false,
            path: path(Leg::shear(3.4, 0.0, 0.5)),
            start: |s| finger(s, Sphere { radius_mm: 15.0 }),
        },
        Trial { name: "flat 20 x 15, shear", turning: false, path: path(Leg::shear(1.2, 0.0, 0.5)), start: flat },
        Trial { name: "flat 20 x 15, twist", turning: true, path: path(Leg::twist(0.2, 0.5)), start: flat },
    ]
}

/// Load and stick ratio along the second leg.
fn run(trial: &Trial, settings: FingerSettings) -> Vec<(f64, f64)> {
    let mut finger = (trial.start)(settings);
    let mut out = Vec::new();
    for command in trial.path.commands(settings.substep_s) {
        let truth = finger.step(&command).expect("a sound command");
        assert!(truth.converged, "{}: {truth:?}", trial.name);
        if truth.time_s > 0.25 + 1e-6 {
            let load = if trial.turning { truth.wrench.torque_n_mm } else { truth.wrench.force_n.x };
            out.push((load, truth.stick_ratio.expect("in contact")));
        }
    }
    out
}

/// Mean and largest difference of load (as a fraction of the largest) and of stick ratio from 160 x 120 cells, during
/// loading up to full slip.
pub fn grid_convergence() -> Vec<Row> {
    let plain = FingerSettings { substep_s: 1.0 / 80.0, ..FingerSettings::standard() };
    let fine = FingerSettings {
        grid: Grid::padded(160, 120, 0.25, 12.0),
        normal_stop: Stop { tolerance_fraction: 1e-6, most_iterations_count: 500 },
        tangential_stop: Stop { tolerance_fraction: 1e-5, most_iterations_count: 2000 },
        ..plain
    };
    let grids = [
        // Mean load, largest load, mean stick ratio, largest stick ratio: the limits that docs/simulator.md prints.
        ("96 x 72", Grid::standard(), [2.2e-3, 6e-3, 0.010, 0.033]),
        ("64 x 48", Grid::fast(), [3.3e-3, 9e-3, 0.044, 0.098]),
    ];
    let mut rows = Vec::new();
    for trial in trials() {
        let mut reference = run(&trial, fine);
        let gross = reference.iter().fold(0.0, |most: f64, step| most.max(step.0));
        // Past 99 % of the largest load, every grid slides as a whole.
        let last = reference.iter().position(|step| step.0 >= 0.99 * gross).expect("a load that rises");
        reference.truncate(last + 1);
        for (name, grid, tolerances) in &grids {
            let coarse = run(&trial, FingerSettings { grid: *grid, ..plain });
            let mut errors = [0.0f64; 4];
            for (c, r) in coarse.iter().zip(&reference) {
                let (load, stick) = ((c.0 - r.0).abs() / gross, (c.1 - r.1).abs());
                errors[0] += load / reference.len() as f64;
                errors[1] = errors[1].max(load);
                errors[2] += stick / reference.len() as f64;
                errors[3] = errors[3].max(stick);
            }
            for (what, (error, tolerance)) in ["load, mean", "load, worst", "stick ratio, mean", "stick ratio, worst"]
                .iter()
                .zip(errors.into_iter().zip(*tolerances))
            {
                rows.push(Row::deviation(
                    format!("{name} against 160 x 120, {}: {what}", trial.name),
                    error,
                    tolerance,
                ));
            }
        }
    }
    rows
}
