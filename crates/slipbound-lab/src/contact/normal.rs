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

impl Normal {
    pub fn new(cells: usize) -> Self {
        let field = || vec![0.0; cells];
        Normal { depth: field(), direction: field(), answer: field(), misfit: field() }
    }

    /// Solves on a window. `gap` is the gap at zero depth without pressure (infinite beside the object); `pressure` is
    /// the first guess on entry and the solution on return; it must be zero outside the window.
    #[allow(clippy::too_many_arguments)] // the operands of the equation; a struct would only rename them
    pub fn solve(
        &mut self,
        response: &mut Response,
        window: Region,
        stride: usize,
        cell_area_mm2: f64,
        gap: &[f64],
        grip: Grip,
        stop: Stop,
        pressure: &mut [f64],
    ) -> Pressed {
        let lowest = window.cells(stride).map(|i| gap[i]).fold(f64::INFINITY, f64::min);
        let load = match grip {
            Grip::ForceN(force_n) => force_n,
            Grip::DepthMm(_) => 0.0,
        };
        let idle = match grip {
            Grip::ForceN(force_n) => force_n == 0.0,
            Grip::DepthMm(depth_mm) => depth_mm <= lowest,
        };
        if idle || !lowest.is_finite() {
            window.cells(stride).for_each(|i| pressure[i] = 0.0);
            let depth_mm = match grip {
                Grip::ForceN(_) => lowest,
                Grip::DepthMm(depth_mm) => depth_mm,
            };
            return Pressed {
                depth_mm: if depth_mm.is_finite() { depth_mm } else { 0.0 },
                iterations: 0,
                converged: idle,
            };
        }
        self.first_guess(response, window, stride, cell_area_mm2, gap, grip, pressure);
        response.depth_of_pressure(window, stride, pressure, &mut self.depth);
        window.cells(stride).for_each(|i| self.direction[i] = 0.0);

        let (mut conjugate, mut before, mut depth_mm) = (0.0, 1.0, 0.0);
        for iterations in 0..=stop.most_iterations_count {
            // Residual of the gap; under force control the depth is the mean over the contact.
            let (mut sum, mut count, mut peak) = (0.0, 0usize, 0.0f64);
            for i in window.cells(stride) {
                self.misfit[i] = gap[i] + self.depth[i];
                peak = peak.max(self.depth[i].abs());
                if pressure[i] > 0.0 {
                    sum += self.misfit[i];
                    count += 1;
                }
            }
            depth_mm = match grip {
                Grip::ForceN(_) => sum / count as f64,
                Grip::DepthMm(depth_mm) => depth_mm,
            };
            let (mut worst, mut squares) = (0.0f64, 0.0);
            for i in window.cells(stride) {
                self.misfit[i] -= depth_mm;
                if pressure[i] > 0.0 {
                    worst = worst.max(self.misfit[i].abs());
                    squares += self.misfit[i] * self.misfit[i];
                } else {
                    worst = worst.max(-self.misfit[i]);
                }
            }
            if worst <= stop.tolerance_fraction * peak {
                return Pressed { depth_mm, iterations, converged: true };
            }
            if iterations == stop.most_iterations_count {
                break;
            }
            let keep = conjugate * squares / before;
            before = squares;
            for i in window.cells(stride) {
                self.direction[i] = if pressure[i] > 0.0 { self.misfit[i] + keep * self.direction[i] } else { 0.0 };
            }
            response.depth_of_pressure(window, stride, &self.direction, &mut self.answer);
            let mut mean = 0.0;
            if matches!(grip, Grip::ForceN(_)) {
                mean = window.cells(stride).filter(|&i| pressure[i] > 0.0).map(|i| self.answer[i]).sum::<f64>()
                    / count as f64;
            }
            let (mut along, mut curve) = (0.0, 0.0);
            for i in window.cells(stride).filter(|&i| pressure[i] > 0.0) {
                along += self.misfit[i] * self.direction[i];
                curve += (self.answer[i] - mean) * self.direction[i];
            }
            let step = along / curve;
            if !step.is_finite() || step <= 0.0 {
                break; // no descent left at rounding level
            }
            let (mut clipped, mut met) = (false, false);
            for i in window.cells(stride) {
                if pressure[i] > 0.0 {
                    pressure[i] -= step * self.direction[i];
                    if pressure[i] < 0.0 {
                        pressure[i] = 0.0;
                        clipped = true;
                    }
                }
            }
            for i in window.cells(stride) {
                if pressure[i] == 0.0 && self.misfit[i] < 0.0 && self.direction[i] == 0.0 {
                    pressure[i] = -step * self.misfit[i];
                    met = true;
                }
            }
            conjugate = if met { 0.0 } else { 1.0 };
            if let Grip::ForceN(_) = grip {
                rescale(window, stride, cell_area_mm2, load, pressure);
            }
            if clipped || met {
                response.depth_of_pressure(window, stride, pressure, &mut self.depth);
            } else {
                window.cells(stride).for_each(|i| self.depth[i] -= step * self.answer[i]);
            }
        }
        Pressed { depth_mm, iterations: stop.most_iterations_count, converged: false }
    }

    /// The old pressure scaled to the new load; without an old one, a layer of springs as stiff as the contact will be.
    #[allow(clippy::too_many_arguments)] // as `solve`
    fn first_guess(
        &mut self,
        response: &mut Response,
        window: Region,
        stride: usize,
        cell_area_mm2: f64,
        gap: &[f64],
        grip: Grip,
        pressure: &mut [f64],
    ) {
        // The object may have left cells that were under pressure.
        window.cells(stride).filter(|&i| gap[i].is_infinite()).for_each(|i| pressure[i] = 0.0);
        let old: f64 = window.cells(stride).map(|i| pressure[i]).sum();
        match grip {
            Grip::ForceN(load) if old > 0.0 => rescale(window, stride, cell_area_mm2, load, pressure),
            Grip::ForceN(load) => {
                window.cells(stride).for_each(|i| pressure[i] = if gap[i].is_finite() { 1.0 } else { 0.0 });
                rescale(window, stride, cell_area_mm2, load, pressure);
            }
            Grip::DepthMm(depth_mm) if old == 0.0 => {
                for i in window.cells(stride) {
                    pressure[i] = (depth_mm - gap[i]).max(0.0);
                }
                response.depth_of_pressure(window, stride, pressure, &mut self.depth);
                let peak = |f: &[f64]| window.cells(stride).map(|i| f[i]).fold(0.0, f64::max);
                let scale = peak(pressure) / peak(&self.depth).max(f64::MIN_POSITIVE);
                window.cells(stride).for_each(|i| pressure[i] *= scale);
            }
            Grip::DepthMm(_) => {}
        }
    }
}

fn rescale(window: Region, stride: usize, cell_area_mm2: f64, load_n: f64, pressure: &mut [f64]) {
    let sum = window.cells(stride).map(|i| pressure[i]).sum::<f64>() * cell_area_mm2;
    let scale = load_n / sum;
    if scale.is_finite() {
        window.cells(stride).for_each(|i| pressure[i] *= scale);
    }
}
