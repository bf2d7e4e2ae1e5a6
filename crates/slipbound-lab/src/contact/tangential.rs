//! Who sticks: one step of Coulomb friction, J. J. Kalker's variational form. Find tractions q with |q| <= bound
//! in every contact cell that minimise 1/2 q.A q - q.w; then A q - w is minus the slip of the object over the
//! gel, zero where the bound is not reached.
//!
//! Spectral projected gradient: step lengths of J. Barzilai and J. M. Borwein (1988), the two of them in turn,
//! projection on the discs, exact line search (E. G. Birgin, J. M. Martinez and M. Raydan, 2000).

use super::body::{Motion, Resistance};
use super::grid::Region;
use super::normal::Stop;
use super::response::Response;
use rustfft::num_complex::Complex64;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// How a tangential solution came out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Held {
    pub iterations: u32,
    pub converged: bool,
    /// Total of the tractions on the gel: force in N and torque about the object's reference point.
    pub load: Motion,
}

/// The data of one step. Slices are per cell of the grid.
pub(crate) struct Question<'a> {
    /// Window around the contact.
    pub window: Region,
    /// Width of the grid in cells.
    pub stride: usize,
    /// The contact cells, in order.
    pub cells: &'a [u32],
    /// Largest traction of each cell in MPa.
    pub bound: &'a [f64],
    /// w in mm: where the surface would be if it stuck without traction.
    pub target: &'a [Complex64],
    /// Position of each cell relative to the object's reference point, x + iy in mm.
    pub lever: &'a [Complex64],
    /// Displacement of the object against the load, which is unknown: the rank-three term. None when guided.
    pub resistance: Option<Resistance>,
    /// Interface compliance of each cell in mm/MPa; empty for none.
    pub interface: &'a [f64],
    /// Length of a step that is safe for the stiffest wave: G / cell, MPa per mm.
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

/// The nearest traction that friction can carry.
#[inline(always)]
fn within(bound: f64, q: Complex64) -> Complex64 {
    let squared = q.norm_sqr();
    if squared <= bound * bound { q } else { q * (bound / squared.sqrt()) }
}

#[inline(always)]
fn dot(a: Complex64, b: Complex64) -> f64 {
    a.re * b.re + a.im * b.im
}

impl Tangential {
    pub fn new(cells: usize) -> Self {
        Tangential { direction: vec![ZERO; cells], answer: vec![ZERO; cells], gradient: vec![ZERO; cells] }
    }

    /// Solves; `traction` comes in as the first guess, zero outside the contact, and goes out as the solution.
    pub fn solve(&mut self, response: &mut Response, question: &Question<'_>, traction: &mut [Complex64]) -> Held {
        let Question { cells, bound, stop, stiffness_mpa_per_mm: safe, .. } = *question;
        let most = cells.iter().map(|&i| bound[i as usize]).fold(0.0, f64::max);
        for &i in cells {
            let i = i as usize;
            traction[i] = within(bound[i], traction[i]);
        }
        self.yielding(response, question, traction, true);
        for &i in cells {
            let i = i as usize;
            self.gradient[i] = self.answer[i] - question.target[i];
            self.direction[i] = ZERO;
        }
        let mut length = safe;
        let mut held = Held { iterations: 0, converged: false, load: Motion::ZERO };
        for iterations in 0..=stop.most_iterations_count {
            held.iterations = iterations;
            let (mut worst, mut descent) = (0.0f64, 0.0);
            for &i in cells {
                let i = i as usize;
                let (q, g) = (traction[i], self.gradient[i]);
                worst = worst.max((within(bound[i], q - g * safe) - q).norm_sqr());
                let d = within(bound[i], q - g * length) - q;
                descent -= dot(g, d);
                self.direction[i] = d;
            }
            if worst.sqrt() <= stop.tolerance_fraction * most {
                held.converged = true;
                break;
            }
            if iterations == stop.most_iterations_count {
                break;
            }
            self.yielding(response, question, traction, false);
            let (mut curve, mut squares, mut answers) = (0.0, 0.0, 0.0);
            for &i in cells {
                let i = i as usize;
                let (d, a) = (self.direction[i], self.answer[i]);
                curve += dot(d, a);
                squares += d.norm_sqr();
                answers += a.norm_sqr();
            }
            let step = (descent / curve).clamp(0.0, 1.0);
            if step.is_nan() {
                break; // no direction left at rounding level
            }
            for &i in cells {
                let i = i as usize;
                traction[i] += self.direction[i] * step;
                self.gradient[i] += self.answer[i] * step;
            }
            length = if iterations % 2 == 0 { squares / curve } else { curve / answers };
        }
        // One last projection puts every sliding cell on its bound, where friction is defined.
        for &i in cells {
            let i = i as usize;
            traction[i] = within(bound[i], traction[i] - self.gradient[i] * safe);
        }
        held.load = load_of(question, cells.iter().map(|&i| (i as usize, traction[i as usize])));
        held
    }

    /// A q (or A d): elastic, interface and rigid yielding of the contact cells into `answer`.
    fn yielding(&mut self, response: &mut Response, question: &Question<'_>, traction: &[Complex64], start: bool) {
        let field = if start { traction } else { &self.direction };
        response.shift_of_traction(question.window, question.stride, field, &mut self.answer);
        if !question.interface.is_empty() {
            for &i in question.cells {
                let i = i as usize;
                self.answer[i] += field[i] * question.interface[i];
            }
        }
        if let Some(resistance) = question.resistance {
            let load = load_of(question, question.cells.iter().map(|&i| (i as usize, field[i as usize])));
            let back = resistance.retreat(load);
            for &i in question.cells {
                let i = i as usize;
                self.answer[i] += back.at(question.lever[i]);
            }
        }
    }
}

/// B^T q: force and torque, still per unit of cell area unless the resistance scales it.
fn load_of(question: &Question<'_>, tractions: impl Iterator<Item = (usize, Complex64)>) -> Motion {
    let mut load = Motion::ZERO;
    for (i, q) in tractions {
        load.shift += q;
        let r = question.lever[i];
        load.turn += r.re * q.im - r.im * q.re;
    }
    load
}
