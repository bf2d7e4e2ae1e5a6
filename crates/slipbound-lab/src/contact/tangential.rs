//! One step of Coulomb friction in J. J. Kalker's variational form: which cells stick. Find tractions q with |q| <=
//! bound in every contact cell that minimise 1/2 q.A q - q.w; then A q - w is minus the slip of the object over the
//! gel, zero where the bound is not reached.
//!
//! Friction is not the only in-plane traction: on an inclined surface pressure pushes sideways, too. q is the whole
//! in-plane traction, and friction its difference from that push: |q - push| <= bound.
//!
//! Spectral projected gradient: step lengths of J. Barzilai and J. M. Borwein (1988), the two of them alternating,
//! projection on the discs, exact line search (E. G. Birgin, J. M. Martinez and M. Raydan, 2000).
//!
//! A compliant body adds the rank-three term B W B^T to A, which outweighs the gel's part forty times for 0.1 kg under
//! a box that covers the pad. Projected gradients converge slowly there. So its part of every step is solved exactly (a
//! step in the metric 1/length + B W B^T; Birgin, Martinez and Raydan, IMA J. Numer. Anal. 23, 2003), by Newton's
//! method in the three numbers of the rigid motion, which costs sweeps over the cells but no transform.

mod product;
mod rigid;

use self::rigid::{Spread, added, work};
use super::body::{Motion, Resistance};
use super::grid::Region;
use super::normal::Stop;
use super::response::Response;
use num_complex::Complex64;
use product::dot;

/// Share of a step's descent that its rigid motion may leave unused: 1e-2 costs up to twice the iterations, 1e-6 saves
/// none compared with 1e-4.
const RIGID_TOLERANCE_FRACTION: f64 = 1e-4;

/// Sweeps of Newton's method for one rigid motion; usually one or two suffice.
const MOST_SWEEPS_COUNT: u32 = 12;

/// Rounding error of friction, as a share of the largest push.
const PUSH_ROUNDING_FRACTION: f64 = 1e-10;

/// Result of a tangential solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TangentialSolution {
    pub iterations: u32,
    pub converged: bool,
    /// Total of the tractions on the gel: force in N and torque about the object's reference point.
    pub load: Motion,
}

impl TangentialSolution {
    /// The result without contact.
    pub fn nothing() -> Self {
        TangentialSolution { iterations: 0, converged: true, load: Motion::ZERO }
    }
}

/// In-plane displacement of the surface under tractions.
pub(crate) trait Surface {
    /// u_x + i u_y of every contact cell from the tractions on all of them.
    fn shift_of_traction(&mut self, traction: &[Complex64], shift: &mut [Complex64]);
}

/// The surface of one gel.
pub(crate) struct OneSurface<'a> {
    /// Response of gel and object together, for a window of that size.
    pub response: &'a mut Response,
    /// Window around the contact.
    pub window: Region,
    /// Width of the grid in cells.
    pub stride: usize,
}

impl Surface for OneSurface<'_> {
    fn shift_of_traction(&mut self, traction: &[Complex64], shift: &mut [Complex64]) {
        self.response.shift_of_traction(self.window, self.stride, traction, shift);
    }
}

/// The data of one step. Slices are per cell of the grid.
pub(crate) struct TangentialProblem<'a> {
    /// The contact cells, in order.
    pub cells: &'a [u32],
    /// In-plane traction of the pressure on each cell in MPa: friction is the difference from it.
    pub push: &'a [Complex64],
    /// Largest friction of each cell in MPa.
    pub bound: &'a [f64],
    /// w in mm: position of the surface if it stuck without traction.
    pub target: &'a [Complex64],
    /// Position of each cell relative to the object's reference point, x + iy in mm.
    pub lever: &'a [Complex64],
    /// Displacement of the object against the unknown load: the rank-three term. None when guided.
    pub resistance: Option<Resistance>,
    /// Interface compliance of each cell in mm/MPa; empty for none.
    pub interface: &'a [f64],
    /// Step length that is stable for the stiffest wave: G / cell, MPa per mm.
    pub stiffness_mpa_per_mm: f64,
    /// When to stop.
    pub stop: Stop,
}

/// Scratch of the tangential solver.
#[derive(Debug, Clone)]
pub(crate) struct Tangential {
    direction: Vec<Complex64>,
    answer: Vec<Complex64>,
    /// A q - w after the last solution, on the contact cells.
    pub gradient: Vec<Complex64>,
}

/// Projection of a traction on what friction can carry in addition to the push of the pressure.
#[inline(always)]
fn within(push: Complex64, bound: f64, q: Complex64) -> Complex64 {
    let friction = q - push;
    let squared = friction.norm_sqr();
    if squared <= bound * bound { q } else { push + friction * (bound / squared.sqrt()) }
}

impl Tangential {
    pub fn new(cells: usize) -> Self {
        Tangential {
            direction: vec![Complex64::ZERO; cells],
            answer: vec![Complex64::ZERO; cells],
            gradient: vec![Complex64::ZERO; cells],
        }
    }

    /// Solves; `traction` is the first guess on entry, zero outside the contact, and the solution on return.
    pub fn solve(
        &mut self,
        surface: &mut impl Surface,
        problem: &TangentialProblem<'_>,
        traction: &mut [Complex64],
    ) -> TangentialSolution {
        let TangentialProblem { cells, push, bound, stop, stiffness_mpa_per_mm: safe, .. } = *problem;
        let most = cells.iter().map(|&i| bound[i as usize]).fold(0.0, f64::max);
        // Friction is a difference from the push; where it is far smaller than the push, its rounding error is not
        // counted as an error.
        let largest_push = cells.iter().map(|&i| push[i as usize].norm_sqr()).fold(0.0, f64::max).sqrt();
        let rounding = PUSH_ROUNDING_FRACTION * largest_push;
        for &i in cells {
            let i = i as usize;
            traction[i] = within(push[i], bound[i], traction[i]);
        }
        let (back, _) = self.yielding(surface, problem, traction, true);
        // For all cells: a surface uses the steps of its whole window, and some cells have left the contact since the
        // last solution.
        self.direction.fill(Complex64::ZERO);
        for &i in cells {
            let i = i as usize;
            self.gradient[i] = self.answer[i] + back.at(problem.lever[i]) - problem.target[i];
        }
        let mut length = safe;
        let mut solution = TangentialSolution { iterations: 0, converged: false, load: Motion::ZERO };
        for iterations in 0..=stop.most_iterations_count {
            solution.iterations = iterations;
            let (worst, mut descent) = match problem.resistance {
                None => self.aim(problem, traction, length),
                Some(_) => (self.worst(problem, traction), 0.0),
            };
            if worst <= stop.tolerance_fraction * most + rounding {
                solution.converged = true;
                break;
            }
            if iterations == stop.most_iterations_count {
                break;
            }
            if let Some(resistance) = problem.resistance {
                descent = self.aim_with_body(problem, resistance, traction, length);
            }
            let (back, lost) = self.yielding(surface, problem, traction, false);
            let (mut curve, mut squares, mut answers) = (0.0, 0.0, 0.0);
            for &i in cells {
                let i = i as usize;
                let (d, a) = (self.direction[i], self.answer[i]);
                curve += dot(d, a);
                squares += d.norm_sqr();
                answers += a.norm_sqr();
            }
            let step = (descent / (curve + lost)).clamp(0.0, 1.0);
            if step.is_nan() {
                break; // no direction left at rounding level
            }
            for &i in cells {
                let i = i as usize;
                traction[i] += self.direction[i] * step;
                self.gradient[i] += (self.answer[i] + back.at(problem.lever[i])) * step;
            }
            // For the gel alone: the body's part of a step is exact.
            length = if iterations % 2 == 0 { squares / curve } else { curve / answers };
        }
        // One last step of the safe length puts every sliding cell on its bound, where friction is defined. It is taken
        // in full, without a line search; the body's part keeps the small changes of all cells from adding up to a
        // load.
        match problem.resistance {
            None => self.aim(problem, traction, safe).1,
            Some(resistance) => self.aim_with_body(problem, resistance, traction, safe),
        };
        for &i in cells {
            let i = i as usize;
            traction[i] = within(push[i], bound[i], traction[i] + self.direction[i]);
        }
        solution.load = load_of(problem, cells.iter().map(|&i| (i as usize, traction[i as usize])));
        solution
    }

    /// Distance of the tractions from a solution: the largest change of a traction by a projected step of the safe
    /// length.
    fn worst(&self, problem: &TangentialProblem<'_>, traction: &[Complex64]) -> f64 {
        let mut worst = 0.0f64;
        for &i in problem.cells {
            let i = i as usize;
            let q = traction[i];
            let safe = q - self.gradient[i] * problem.stiffness_mpa_per_mm;
            worst = worst.max((within(problem.push[i], problem.bound[i], safe) - q).norm_sqr());
        }
        worst.sqrt()
    }

    /// The projected step of a length into `direction`, which ignores the compliance of the body. Returns
    /// [`Self::worst`] and how fast the energy falls along the step.
    fn aim(&mut self, problem: &TangentialProblem<'_>, traction: &[Complex64], length: f64) -> (f64, f64) {
        let (mut worst, mut descent) = (0.0f64, 0.0);
        for &i in problem.cells {
            let i = i as usize;
            let (q, g, push, bound) = (traction[i], self.gradient[i], problem.push[i], problem.bound[i]);
            worst = worst.max((within(push, bound, q - g * problem.stiffness_mpa_per_mm) - q).norm_sqr());
            let d = within(push, bound, q - g * length) - q;
            descent -= dot(g, d);
            self.direction[i] = d;
        }
        (worst.sqrt(), descent)
    }

    /// The step d within the discs that minimises g.d + d.d / (2 length) + (B^T d).W (B^T d) / 2. It is the plain step
    /// against the gradient g + B W y, where y = B^T d is the load it adds: three unknowns. The solution y minimises a
    /// convex function (the dual) by Newton's method, halving steps that overshoot. Returns how fast the energy falls
    /// along d.
    fn aim_with_body(
        &mut self,
        problem: &TangentialProblem<'_>,
        resistance: Resistance,
        traction: &[Complex64],
        length: f64,
    ) -> f64 {
        let mut here = self.first_load(problem, resistance, traction, length);
        let (mut newton, mut share) = (Motion::ZERO, 0.0);
        let (mut lowest, mut slope) = (f64::INFINITY, 0.0);
        for _ in 0..MOST_SWEEPS_COUNT {
            let push = added(here, newton, share);
            let back = resistance.retreat(push);
            let sweep = self.sweep(problem, traction, length, back);
            let height = 0.5 * work(push, back) + sweep.descent - work(sweep.load, back) - 0.5 * sweep.squares / length;
            if height > lowest + 1e-4 * share * slope {
                share *= 0.5;
                continue;
            }
            (here, lowest, share) = (push, height, 1.0);
            let miss = added(sweep.load, push, -1.0);
            newton = sweep.spread.settle(resistance, length, miss);
            slope = -work(miss, resistance.retreat(newton));
            if -slope <= RIGID_TOLERANCE_FRACTION * sweep.descent && sweep.descends(length) {
                return sweep.descent;
            }
        }
        let sweep = self.sweep(problem, traction, length, resistance.retreat(here));
        if sweep.descends(length) {
            return sweep.descent;
        }
        // Without the rigid motion the plain step also descends, but makes little progress.
        self.aim(problem, traction, length).1
    }

    /// The load that a step adds if every cell inside its bound stays inside and every other cell stays as it is.
    fn first_load(
        &self,
        problem: &TangentialProblem<'_>,
        resistance: Resistance,
        traction: &[Complex64],
        length: f64,
    ) -> Motion {
        let (mut spread, mut load) = (Spread::default(), Motion::ZERO);
        for &i in problem.cells {
            let i = i as usize;
            let (bound, lever) = (problem.bound[i], problem.lever[i]);
            if (traction[i] - problem.push[i]).norm_sqr() < bound * bound * (1.0 - 1e-9) {
                load.add(lever, self.gradient[i] * -length);
                spread.add_free(lever);
            }
        }
        spread.settle(resistance, length, load)
    }

    /// The plain step against the gradient and a retreat of the body, into `direction`, with its sums.
    fn sweep(&mut self, problem: &TangentialProblem<'_>, traction: &[Complex64], length: f64, back: Motion) -> Sweep {
        let mut sweep = Sweep { descent: 0.0, squares: 0.0, load: Motion::ZERO, spread: Spread::default() };
        for &i in problem.cells {
            let i = i as usize;
            let (q, g, bound, lever) = (traction[i], self.gradient[i], problem.bound[i], problem.lever[i]);
            let push = problem.push[i];
            let z = q - (g + back.at(lever)) * length - push;
            let squared = z.norm_sqr();
            let d = if squared <= bound * bound {
                sweep.spread.add_free(lever);
                z + push - q
            } else {
                let inverse = squared.sqrt().recip();
                sweep.spread.add_sliding(Complex64::new(-z.im, z.re) * inverse, bound * inverse, lever);
                z * (bound * inverse) + push - q
            };
            sweep.descent -= dot(g, d);
            sweep.squares += d.norm_sqr();
            sweep.load.add(lever, d);
            self.direction[i] = d;
        }
        sweep
    }

    /// A q (or A d) of gel and interface on the contact cells into `answer`; returns the displacement of the body, and
    /// its work.
    fn yielding(
        &mut self,
        surface: &mut impl Surface,
        problem: &TangentialProblem<'_>,
        traction: &[Complex64],
        start: bool,
    ) -> (Motion, f64) {
        let field = if start { traction } else { &self.direction };
        surface.shift_of_traction(field, &mut self.answer);
        if !problem.interface.is_empty() {
            for &i in problem.cells {
                let i = i as usize;
                self.answer[i] += field[i] * problem.interface[i];
            }
        }
        let Some(resistance) = problem.resistance else { return (Motion::ZERO, 0.0) };
        let load = load_of(problem, problem.cells.iter().map(|&i| (i as usize, field[i as usize])));
        let back = resistance.retreat(load);
        (back, work(load, back))
    }
}

/// A step and its sums over the cells.
struct Sweep {
    /// -g.d
    descent: f64,
    /// d.d
    squares: f64,
    /// B^T d
    load: Motion,
    spread: Spread,
}

impl Sweep {
    /// Whether the energy falls along the step by at least half of the descent that a plain step guarantees.
    fn descends(&self, length: f64) -> bool {
        self.descent >= 0.5 * self.squares / length
    }
}

/// B^T q: force and torque, per unit of cell area unless the resistance scales it.
fn load_of(problem: &TangentialProblem<'_>, tractions: impl Iterator<Item = (usize, Complex64)>) -> Motion {
    let mut load = Motion::ZERO;
    for (i, q) in tractions {
        load.add(problem.lever[i], q);
    }
    load
}

#[cfg(test)]
mod tests;
