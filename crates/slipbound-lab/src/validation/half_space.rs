//! The two solvers on a half-space: Hertz, Cattaneo-Mindlin, torsion.

use super::exact::SphereOnHalfSpace;
use super::row::Row;
use crate::contact::{
    Grid, Grip, Normal, NormalProblem, OneSurface, Response, Stop, Tangential, TangentialProblem, half_space_response,
};
use num_complex::Complex64;
use std::f64::consts::PI;

const SPHERE: SphereOnHalfSpace =
    SphereOnHalfSpace { modulus_mpa: 0.2, poisson: 0.48, radius_mm: 15.0, force_n: 3.0, mu: 0.8 };

/// Cells along a contact radius: the contact fits into a window of 64 x 64 cells with a margin.
const RADIUS_CELLS: f64 = 27.0;
const SIDE_CELLS: usize = 64;

struct Bench {
    sphere: SphereOnHalfSpace,
    grid: Grid,
    response: Response,
    pressure: Vec<f64>,
    depth_mm: f64,
}

impl Bench {
    fn pressed(sphere: SphereOnHalfSpace) -> Self {
        let grid = Grid {
            width_cells: SIDE_CELLS,
            height_cells: SIDE_CELLS,
            cell_mm: sphere.contact_radius_mm() / RADIUS_CELLS,
            padded_width_cells: 2 * SIDE_CELLS,
            padded_height_cells: 2 * SIDE_CELLS,
        };
        let mut response = half_space_response(&grid, sphere.shear_modulus_mpa(), sphere.poisson);
        let gap: Vec<f64> =
            (0..grid.cells_count()).map(|i| grid.centre_mm(i).length_squared() / (2.0 * sphere.radius_mm)).collect();
        let mut pressure = vec![0.0; grid.cells_count()];
        let problem = NormalProblem {
            window: grid.whole(),
            stride: SIDE_CELLS,
            cell_area_mm2: grid.cell_area_mm2(),
            gap: &gap,
            grip: Grip::ForceN(sphere.force_n),
            stop: Stop { tolerance_fraction: 1e-9, most_iterations_count: 500 },
        };
        let pressed = Normal::new(grid.cells_count()).solve(&mut response, &problem, &mut pressure);
        assert!(pressed.converged, "{pressed:?}");
        Bench { sphere, grid, response, pressure, depth_mm: pressed.depth_mm }
    }

    fn area_radius_mm(&self, cells: usize) -> f64 {
        (cells as f64 * self.grid.cell_area_mm2() / PI).sqrt()
    }

    /// Moves the pressed sphere by a field of rigid displacements; gives force, torque and the radius that sticks.
    fn moved(&mut self, displacement: impl Fn(Complex64) -> Complex64) -> (f64, f64, f64) {
        let count = self.grid.cells_count();
        let cells: Vec<u32> = (0..count as u32).filter(|&i| self.pressure[i as usize] > 0.0).collect();
        let bound: Vec<f64> = self.pressure.iter().map(|p| self.sphere.mu * p).collect();
        let lever: Vec<Complex64> = (0..count)
            .map(|i| {
                let at = self.grid.centre_mm(i);
                Complex64::new(at.x, at.y)
            })
            .collect();
        let target: Vec<Complex64> = lever.iter().map(|&at| displacement(at)).collect();
        let mut traction = vec![Complex64::ZERO; count];
        // The theories do not include an in-plane push of the pressure, and neither does this case: traction is
        // friction.
        let push = vec![Complex64::ZERO; count];
        let problem = TangentialProblem {
            cells: &cells,
            push: &push,
            bound: &bound,
            target: &target,
            lever: &lever,
            resistance: None,
            interface: &[],
            stiffness_mpa_per_mm: self.sphere.shear_modulus_mpa() / self.grid.cell_mm,
            stop: Stop { tolerance_fraction: 1e-7, most_iterations_count: 3000 },
        };
        let window = self.grid.whole();
        let mut surface = OneSurface { response: &mut self.response, window, stride: SIDE_CELLS };
        let solution = Tangential::new(count).solve(&mut surface, &problem, &mut traction);
        assert!(solution.converged, "{solution:?}");
        let stuck = cells.iter().filter(|&&i| {
            let i = i as usize;
            traction[i].norm_sqr().sqrt() < bound[i] * (1.0 - 1e-9)
        });
        let area = self.grid.cell_area_mm2();
        (solution.load.shift.re * area, solution.load.turn * area, self.area_radius_mm(stuck.count()))
    }
}

/// Depth, radius and peak pressure under a sphere.
pub fn hertz() -> Vec<Row> {
    let bench = Bench::pressed(SPHERE);
    let cells = bench.pressure.iter().filter(|&&p| p > 0.0).count();
    let peak = bench.pressure.iter().fold(0.0, |peak: f64, &p| peak.max(p));
    vec![
        Row::relative("Hertz: depth", SPHERE.depth_mm(), bench.depth_mm, "mm", 5e-4),
        Row::relative("Hertz: contact radius", SPHERE.contact_radius_mm(), bench.area_radius_mm(cells), "mm", 0.01),
        Row::relative("Hertz: peak pressure", SPHERE.peak_pressure_mpa(), peak, "MPa", 5e-3),
    ]
}

/// Force and stick radius of a sphere pushed sideways.
pub fn cattaneo_mindlin() -> Vec<Row> {
    let mut rows = Vec::new();
    for poisson in [0.0, 0.48] {
        let sphere = SphereOnHalfSpace { poisson, ..SPHERE };
        let mut bench = Bench::pressed(sphere);
        for fraction in [0.3, 0.6, 0.9] {
            let shift_mm = sphere.shift_mm(fraction);
            let (force_n, _, stick_mm) = bench.moved(|_| Complex64::new(shift_mm, 0.0));
            let name = format!("Cattaneo-Mindlin, nu {poisson}, Q = {fraction} mu P");
            let theory_n = fraction * sphere.mu * sphere.force_n;
            rows.push(Row::relative(format!("{name}: force"), theory_n, force_n, "N", 3e-3));
            let theory_mm = sphere.stick_radius_mm(fraction);
            rows.push(Row::relative(format!("{name}: stick radius"), theory_mm, stick_mm, "mm", 0.015));
        }
    }
    rows
}

/// Torque and stick radius of a sphere turned about its normal.
pub fn torsion() -> Vec<Row> {
    let mut bench = Bench::pressed(SPHERE);
    let mut rows = Vec::new();
    for stick in [0.9, 0.7, 0.4] {
        let twist_rad = SPHERE.twist_rad(stick);
        let (_, torque_n_mm, stick_mm) = bench.moved(|at| Complex64::new(-at.im, at.re) * twist_rad);
        let name = format!("torsion (Lubkin, Jaeger), c = {stick} a");
        rows.push(Row::relative(format!("{name}: torque"), SPHERE.torque_n_mm(stick), torque_n_mm, "N mm", 1e-3));
        let theory_mm = stick * SPHERE.contact_radius_mm();
        rows.push(Row::relative(format!("{name}: stick radius"), theory_mm, stick_mm, "mm", 0.015));
    }
    rows
}
