use super::*;
use crate::contact::body::length;
use crate::contact::grid::Grid;
use crate::contact::{Body, Drive, FingerSettings, Inertia, Pose, Wrench};
use crate::layer::Gel;
use slipbound::plane::Vec2;

const PATCH: Region = Region { column: 12, row: 10, width_cells: 40, height_cells: 28 };

/// Result of a pull.
struct Pulled {
    solution: TangentialSolution,
    /// Largest distance of a cell from equilibrium, as a fraction of the largest bound.
    worst_fraction: f64,
    /// Force and torque of full slip, in the units of the load: sums of the bounds, alone and times their levers.
    full_slip: (f64, f64),
}

/// A patch under a dome of pressure, with a body of a given mass that is pulled and turned until some cells slide.
fn pull(mass_kg: f64, stop: Stop) -> Pulled {
    let mut solver = Tangential::new(Grid::fast().cells_count());
    pull_on(&mut solver, PATCH, mass_kg, stop)
}

/// The same on a patch inside [`PATCH`], by a solver that may have solved others before.
fn pull_on(solver: &mut Tangential, patch: Region, mass_kg: f64, stop: Stop) -> Pulled {
    let (grid, gel) = (Grid::fast(), Gel::default());
    let (stride, count) = (grid.width_cells, grid.cells_count());
    let mut response = Response::of_layer(&grid, |k| gel.compliance(k));
    let cells: Vec<u32> = patch.cells(stride).map(|i| i as u32).collect();
    let lever: Vec<_> = (0..count).map(|i| grid.centre_mm(i)).map(|c| Complex64::new(c.x, c.y)).collect();
    let mut bound = vec![0.0; count];
    let mut full_slip = (0.0, 0.0);
    for &i in &cells {
        let i = i as usize;
        let r = lever[i];
        let (x, y) = (r.re / 14.0, r.im / 10.0);
        bound[i] = 0.08 * (1.0 - x * x) * (1.0 - y * y);
        full_slip.0 += bound[i];
        full_slip.1 += bound[i] * length(r);
    }
    let area = grid.cell_area_mm2();
    let wrench = Wrench { force_n: Vec2::new(7.0, 2.0), torque_n_mm: 40.0 };
    let inertia = Inertia { mass_kg, gyration_radius_mm: 20.0, centre_of_mass_mm: Vec2::new(3.0, -2.0) };
    let body = Body { drive: Drive::Free(inertia), fingers_count: 1 };
    let (free, resistance) =
        body.step((Pose::default(), Pose::default()), wrench, Motion::ZERO, 1.0 / 120.0, area, Complex64::ZERO);
    let push = vec![Complex64::ZERO; count];
    let problem = TangentialProblem {
        cells: &cells,
        push: &push,
        bound: &bound,
        target: &lever.iter().map(|&r| free.at(r)).collect::<Vec<_>>(),
        lever: &lever,
        resistance,
        interface: &[],
        stiffness_mpa_per_mm: gel.shear_modulus_mpa() / grid.cell_mm,
        stop,
    };
    let mut traction = vec![Complex64::ZERO; count];
    let solution =
        solver.solve(&mut OneSurface { response: &mut response, window: PATCH, stride }, &problem, &mut traction);
    // Recomputed from the tractions alone: A q + B W B^T q - w.
    let mut shift = vec![Complex64::ZERO; count];
    response.shift_of_traction(PATCH, stride, &traction, &mut shift);
    let back = resistance.expect("a body that gives way").retreat(solution.load);
    let (mut worst, mut sliding) = (0.0f64, 0);
    for &i in &cells {
        let i = i as usize;
        let gradient = shift[i] + back.at(lever[i]) - problem.target[i];
        let moved = within(push[i], bound[i], traction[i] - gradient * problem.stiffness_mpa_per_mm);
        worst = worst.max(length(moved - traction[i]));
        sliding += usize::from(length(traction[i]) > 0.999 * bound[i]);
    }
    assert!((100..cells.len() - 100).contains(&sliding), "{sliding} of {} cells slide", cells.len());
    Pulled { solution, worst_fraction: worst / bound.iter().copied().fold(0.0, f64::max), full_slip }
}

#[test]
fn a_light_body_takes_no_more_iterations_than_a_heavy_one() {
    let stop = Stop { most_iterations_count: 1000, ..FingerSettings::fast().tangential_stop };
    for mass_kg in [1.0, 0.1, 1e-3] {
        let Pulled { solution, .. } = pull(mass_kg, stop);
        assert!(solution.converged && solution.iterations <= 25, "{mass_kg} kg: {solution:?}");
    }
}

#[test]
fn a_body_comes_to_the_equilibrium_of_its_equations() {
    let stop = Stop { tolerance_fraction: 1e-9, most_iterations_count: 200 };
    // With a body of a gram, rounding prevents the last step from following the body.
    for mass_kg in [1.0, 0.1] {
        let Pulled { solution, worst_fraction, .. } = pull(mass_kg, stop);
        assert!(solution.converged && worst_fraction < 1e-8, "{mass_kg} kg: {worst_fraction:e}, {solution:?}");
    }
}

/// The tolerance is that of one traction. The errors of all cells must not add up to a load: force and torque are
/// within a tenth of it.
#[test]
fn small_errors_of_the_cells_do_not_add_up_to_a_load() {
    let stop = FingerSettings::fast().tangential_stop;
    for mass_kg in [1.0, 0.1, 1e-3] {
        let Pulled { solution, full_slip: (force, torque), .. } = pull(mass_kg, stop);
        let exact = pull(mass_kg, Stop { tolerance_fraction: 1e-9, most_iterations_count: 1000 }).solution;
        assert!(solution.converged && exact.converged);
        let missed = added(solution.load, exact.load, -1.0);
        let (force, torque) = (length(missed.shift) / force, missed.turn.abs() / torque);
        assert!(
            force.max(torque) < 0.1 * stop.tolerance_fraction,
            "{mass_kg} kg: {force:e} of force, {torque:e} of torque"
        );
    }
}

/// A gel that springs back releases cells: steps that were made on them must not enter the solution of the smaller
/// contact.
#[test]
fn a_contact_that_has_shrunk_is_solved_as_if_it_had_never_been_larger() {
    let stop = FingerSettings::fast().tangential_stop;
    let smaller = Region { width_cells: PATCH.width_cells - 6, ..PATCH };
    let mut solver = Tangential::new(Grid::fast().cells_count());
    pull_on(&mut solver, PATCH, 0.1, Stop { most_iterations_count: 3, ..stop });
    let [used, new] = [&mut solver, &mut Tangential::new(Grid::fast().cells_count())]
        .map(|solver| pull_on(solver, smaller, 0.1, stop).solution);
    assert!(used.converged);
    assert_eq!(used, new);
}
