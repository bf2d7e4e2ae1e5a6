//! A rigid sphere on a nearly incompressible bonded layer.

use super::exact::sphere_on_layer_n;
use super::row::Row;
use crate::contact::{Grid, Grip, Normal, NormalProblem, Region, Response, Stop};
use crate::layer::layer_compliance;

/// Force at two depths against the series of Garcia and Garcia (2018).
pub fn sphere_on_layer() -> Vec<Row> {
    const MODULUS_MPA: f64 = 0.5;
    const THICKNESS_MM: f64 = 3.0;
    const RADIUS_MM: f64 = 5.0;
    const POISSON: f64 = 0.499_999;
    // 24 mm of periodic layer; the solution is on the middle 64 x 64 cells.
    let grid =
        Grid { width_cells: 600, height_cells: 600, cell_mm: 0.04, padded_width_cells: 600, padded_height_cells: 600 };
    let shear_modulus_mpa = MODULUS_MPA / (2.0 * (1.0 + POISSON));
    let whole = Response::of_layer(&grid, |k| layer_compliance(shear_modulus_mpa, POISSON, THICKNESS_MM, k));
    let window = Region { column: 268, row: 268, width_cells: 64, height_cells: 64 };
    let mut response = whole.cut_to([64, 64]);
    let gap: Vec<f64> =
        (0..grid.cells_count()).map(|i| grid.centre_mm(i).length_squared() / (2.0 * RADIUS_MM)).collect();
    [0.2, 0.275, 0.35]
        .into_iter()
        .map(|chi: f64| {
            let depth_mm = chi * chi * THICKNESS_MM * THICKNESS_MM / RADIUS_MM;
            let mut pressure = vec![0.0; grid.cells_count()];
            let problem = NormalProblem {
                window,
                stride: grid.width_cells,
                cell_area_mm2: grid.cell_area_mm2(),
                gap: &gap,
                grip: Grip::DepthMm(depth_mm),
                stop: Stop { tolerance_fraction: 1e-8, most_iterations_count: 500 },
            };
            let pressed = Normal::new(grid.cells_count()).solve(&mut response, &problem, &mut pressure);
            assert!(pressed.converged, "{pressed:?}");
            let force_n = pressure.iter().sum::<f64>() * grid.cell_area_mm2();
            let theory_n = sphere_on_layer_n(MODULUS_MPA, RADIUS_MM, THICKNESS_MM, depth_mm);
            Row::relative(format!("sphere on layer (Garcia 2018), chi {chi}: force"), theory_n, force_n, "N", 0.01)
        })
        .collect()
}
