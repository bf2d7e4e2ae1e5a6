//! The cells in contact and their pressure: p >= 0, gap >= 0, p gap = 0, by the conjugate gradients of I. A. Polonsky
//! and L. M. Keer, Wear 231 (1999) 206-219.

use super::grid::Region;
use super::response::Response;
use serde::{Deserialize, Serialize};
use slipbound::setting::SettingError;

/// What holds the object against the gel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grip {
    /// Normal force per finger in N, 0 or above.
    ForceN(f64),
    /// How deep the object's lowest point is below the flat gel, in mm; negative above the gel.
    DepthMm(f64),
}

impl Grip {
    /// Refuses forces that are negative or not finite, and depths that are not finite.
    pub fn check(&self) -> Result<(), SettingError> {
        match *self {
            Grip::ForceN(force_n) => crate::layer::zero_or_above("grip.force_n", force_n),
            Grip::DepthMm(depth_mm) if depth_mm.is_finite() => Ok(()),
            Grip::DepthMm(depth_mm) => Err(SettingError {
                key: "grip.depth_mm".into(),
                got: depth_mm.to_string(),
                expected: "a finite number".into(),
            }),
        }
    }
}

/// When a solver stops.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Largest error left, as a fraction: of the largest displacement for the gap, of the largest friction bound
    /// for the traction. Between 1e-14 and 0.1.
    pub tolerance_fraction: f64,
    /// Iterations after which it gives up and reports no convergence. 1 or more.
    pub most_iterations_count: u32,
}

/// The pressure that is looked for: on which cells, against which object, held how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NormalProblem<'a> {
    /// The cells that may touch.
    pub window: Region,
    /// Cells in a row of the grid.
    pub stride: usize,
    /// Area of a cell, mm2.
    pub cell_area_mm2: f64,
    /// By cell: the gap at zero depth without pressure, mm; infinite beside the object.
    pub gap: &'a [f64],
    /// Force or depth of the object.
    pub grip: Grip,
    /// When to stop.
    pub stop: Stop,
}

impl NormalProblem<'_> {
    fn cells(&self) -> impl Iterator<Item = usize> {
        self.window.cells(self.stride)
    }

    /// The result where the object is held without touching, or is not above the window; None where it touches.
    fn without_contact(&self) -> Option<Pressed> {
        let lowest_mm = self.cells().map(|i| self.gap[i]).fold(f64::INFINITY, f64::min);
        let (is_idle, depth_mm) = match self.grip {
            Grip::ForceN(force_n) => (force_n == 0.0, lowest_mm),
            Grip::DepthMm(depth_mm) => (depth_mm <= lowest_mm, depth_mm),
        };
        (is_idle || !lowest_mm.is_finite()).then_some(Pressed {
            depth_mm: if depth_mm.is_finite() { depth_mm } else { 0.0 },
            iterations: 0,
            converged: is_idle,
        })
    }

    /// Scales the pressure to a force; leaves it where there is none.
    fn rescale(&self, force_n: f64, pressure: &mut [f64]) {
        let sum_n = self.cells().map(|i| pressure[i]).sum::<f64>() * self.cell_area_mm2;
        let scale = force_n / sum_n;
        if scale.is_finite() {
            self.cells().for_each(|i| pressure[i] *= scale);
        }
    }
}

/// Result of a normal solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pressed {
    pub depth_mm: f64,
    pub iterations: u32,
    pub converged: bool,
}

/// Scratch of the normal solver.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    depth: Vec<f64>,
    direction: Vec<f64>,
    answer: Vec<f64>,
    misfit: Vec<f64>,
}

/// How far the gap is from closed under pressure, and from open elsewhere.
struct Misfit {
    /// Depth of the object: under force control that which the gel under pressure has on average.
    depth_mm: f64,
    /// Cells under pressure.
    pressed_count: usize,
    /// Largest error of a cell: gap under pressure, or overlap without, mm.
    worst_mm: f64,
    /// Sum of squares of the gap under pressure, mm2.
    squares: f64,
    /// Largest displacement of the gel, mm.
    peak_mm: f64,
}

/// How a step changed the cells under pressure.
struct Change {
    /// A cell left the contact.
    has_left: bool,
    /// A cell entered it.
    has_met: bool,
}

impl Normal {
    pub fn new(cells: usize) -> Self {
        let field = || vec![0.0; cells];
        Normal { depth: field(), direction: field(), answer: field(), misfit: field() }
    }

    /// Solves a problem. `pressure` is the first guess on entry and the solution on return; it must be zero outside the
    /// window.
    pub fn solve(&mut self, response: &mut Response, problem: &NormalProblem<'_>, pressure: &mut [f64]) -> Pressed {
        let &NormalProblem { window, stride, grip, stop, .. } = problem;
        if let Some(pressed) = problem.without_contact() {
            problem.cells().for_each(|i| pressure[i] = 0.0);
            return pressed;
        }
        self.first_guess(response, problem, pressure);
        response.depth_of_pressure(window, stride, pressure, &mut self.depth);
        problem.cells().for_each(|i| self.direction[i] = 0.0);

        let (mut conjugate, mut squares_before, mut depth_mm) = (0.0, 1.0, 0.0);
        for iterations in 0..=stop.most_iterations_count {
            let misfit = self.measure(problem, pressure);
            depth_mm = misfit.depth_mm;
            if misfit.worst_mm <= stop.tolerance_fraction * misfit.peak_mm {
                return Pressed { depth_mm, iterations, converged: true };
            }
            if iterations == stop.most_iterations_count {
                break;
            }
            self.aim(problem, pressure, conjugate * misfit.squares / squares_before);
            squares_before = misfit.squares;
            response.depth_of_pressure(window, stride, &self.direction, &mut self.answer);
            let step = self.step_length(problem, pressure, misfit.pressed_count);
            if !step.is_finite() || step <= 0.0 {
                break; // no descent left at rounding level
            }
            let change = self.descend(problem, step, pressure);
            conjugate = if change.has_met { 0.0 } else { 1.0 };
            if let Grip::ForceN(force_n) = grip {
                problem.rescale(force_n, pressure);
            }
            if change.has_left || change.has_met {
                response.depth_of_pressure(window, stride, pressure, &mut self.depth);
            } else {
                problem.cells().for_each(|i| self.depth[i] -= step * self.answer[i]);
            }
        }
        Pressed { depth_mm, iterations: stop.most_iterations_count, converged: false }
    }

    /// The old pressure scaled to the new load; without an old one, a layer of springs as stiff as the contact will be.
    fn first_guess(&mut self, response: &mut Response, problem: &NormalProblem<'_>, pressure: &mut [f64]) {
        let gap = problem.gap;
        // The object may have left cells that were under pressure.
        problem.cells().filter(|&i| gap[i].is_infinite()).for_each(|i| pressure[i] = 0.0);
        let old: f64 = problem.cells().map(|i| pressure[i]).sum();
        match problem.grip {
            Grip::ForceN(force_n) if old > 0.0 => problem.rescale(force_n, pressure),
            Grip::ForceN(force_n) => {
                problem.cells().for_each(|i| pressure[i] = if gap[i].is_finite() { 1.0 } else { 0.0 });
                problem.rescale(force_n, pressure);
            }
            Grip::DepthMm(depth_mm) if old == 0.0 => {
                for i in problem.cells() {
                    pressure[i] = (depth_mm - gap[i]).max(0.0);
                }
                response.depth_of_pressure(problem.window, problem.stride, pressure, &mut self.depth);
                let peak = |f: &[f64]| problem.cells().map(|i| f[i]).fold(0.0, f64::max);
                let scale = peak(pressure) / peak(&self.depth).max(f64::MIN_POSITIVE);
                problem.cells().for_each(|i| pressure[i] *= scale);
            }
            Grip::DepthMm(_) => {}
        }
    }

    /// The gap of every cell between the gel displaced by `pressure` and the object, into `misfit`.
    fn measure(&mut self, problem: &NormalProblem<'_>, pressure: &[f64]) -> Misfit {
        let (mut sum_mm, mut pressed_count, mut peak_mm) = (0.0, 0usize, 0.0f64);
        for i in problem.cells() {
            self.misfit[i] = problem.gap[i] + self.depth[i];
            peak_mm = peak_mm.max(self.depth[i].abs());
            if pressure[i] > 0.0 {
                sum_mm += self.misfit[i];
                pressed_count += 1;
            }
        }
        let depth_mm = match problem.grip {
            Grip::ForceN(_) => sum_mm / pressed_count as f64,
            Grip::DepthMm(depth_mm) => depth_mm,
        };
        let (mut worst_mm, mut squares) = (0.0f64, 0.0);
        for i in problem.cells() {
            self.misfit[i] -= depth_mm;
            if pressure[i] > 0.0 {
                worst_mm = worst_mm.max(self.misfit[i].abs());
                squares += self.misfit[i] * self.misfit[i];
            } else {
                worst_mm = worst_mm.max(-self.misfit[i]);
            }
        }
        Misfit { depth_mm, pressed_count, worst_mm, squares, peak_mm }
    }

    /// The direction of descent: the misfit, and this share of the direction before.
    fn aim(&mut self, problem: &NormalProblem<'_>, pressure: &[f64], keep: f64) {
        for i in problem.cells() {
            self.direction[i] = if pressure[i] > 0.0 { self.misfit[i] + keep * self.direction[i] } else { 0.0 };
        }
    }

    /// How far along the direction the misfit is least, from the gel's answer to it; under force control the object
    /// follows the mean of the answer.
    fn step_length(&self, problem: &NormalProblem<'_>, pressure: &[f64], pressed_count: usize) -> f64 {
        let pressed = || problem.cells().filter(|&i| pressure[i] > 0.0);
        let mean = match problem.grip {
            Grip::ForceN(_) => pressed().map(|i| self.answer[i]).sum::<f64>() / pressed_count as f64,
            Grip::DepthMm(_) => 0.0,
        };
        let (mut along, mut curve) = (0.0, 0.0);
        for i in pressed() {
            along += self.misfit[i] * self.direction[i];
            curve += (self.answer[i] - mean) * self.direction[i];
        }
        along / curve
    }

    /// A step of the pressure: cells leave the contact at zero, and cells that overlap the object enter it.
    fn descend(&self, problem: &NormalProblem<'_>, step: f64, pressure: &mut [f64]) -> Change {
        let mut change = Change { has_left: false, has_met: false };
        for i in problem.cells() {
            if pressure[i] > 0.0 {
                pressure[i] -= step * self.direction[i];
                if pressure[i] < 0.0 {
                    pressure[i] = 0.0;
                    change.has_left = true;
                }
            }
        }
        for i in problem.cells() {
            if pressure[i] == 0.0 && self.misfit[i] < 0.0 && self.direction[i] == 0.0 {
                pressure[i] = -step * self.misfit[i];
                change.has_met = true;
            }
        }
        change
    }
}
