//! Half-space kernels for validation: closed-form integrals over a square cell (A. E. H. Love 1929 for pressure,
//! V. Cerruti for in-plane traction; K. L. Johnson 1985, sections 3.2 and 3.6), convolved without wrap-around.

use super::grid::Grid;
use super::response::{Kernel, Response};
use std::f64::consts::PI;

/// ln(a + r), r = |(a, b)|, without cancellation when a is negative.
fn ln_sum(a: f64, b: f64) -> f64 {
    let r = libm::hypot(a, b);
    if a >= 0.0 { libm::log(a + r) } else { libm::log(b * b / (r - a)) }
}

/// Integral over a cell of side `cell` at offset (x, y), from the corner function of the integrand.
fn over_cell(x: f64, y: f64, cell: f64, corner: impl Fn(f64, f64) -> f64) -> f64 {
    let (x0, x1, y0, y1) = (x - 0.5 * cell, x + 0.5 * cell, y - 0.5 * cell, y + 0.5 * cell);
    corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
}

/// Displacements of a half-space at offset (x, y) mm from a cell under unit traction.
fn cell_kernel(shear_modulus_mpa: f64, nu: f64, cell: f64, x: f64, y: f64) -> Kernel {
    let inverse = over_cell(x, y, cell, |x, y| x * ln_sum(y, x) + y * ln_sum(x, y)); // 1/r
    let xx = over_cell(x, y, cell, |x, y| y * ln_sum(x, y)); // x^2/r^3
    let yy = over_cell(x, y, cell, |x, y| x * ln_sum(y, x)); // y^2/r^3
    let xy = over_cell(x, y, cell, |x, y| -libm::hypot(x, y)); // xy/r^3
    let xz = over_cell(x, y, cell, |x, y| y * libm::log(libm::hypot(x, y)) - y + x * libm::atan(y / x)); // x/r^2
    let yz = over_cell(x, y, cell, |x, y| x * libm::log(libm::hypot(x, y)) - x + y * libm::atan(x / y)); // y/r^2
    let c = 1.0 / (2.0 * PI * shear_modulus_mpa);
    let odd = -0.5 * c * (1.0 - 2.0 * nu);
    Kernel {
        xx: c * ((1.0 - nu) * inverse + nu * xx),
        yy: c * ((1.0 - nu) * inverse + nu * yy),
        xy: c * nu * xy,
        zz: c * (1.0 - nu) * inverse,
        xz: odd * xz,
        yz: odd * yz,
    }
}

/// The response of a half-space on the cells of a grid; its padded size must be twice its size or more.
pub(crate) fn half_space_response(grid: &Grid, shear_modulus_mpa: f64, poisson: f64) -> Response {
    Response::of_kernel(
        [grid.padded_width_cells, grid.padded_height_cells],
        [grid.width_cells, grid.height_cells],
        |dx, dy| {
            let (x, y) = (dx as f64 * grid.cell_mm, dy as f64 * grid.cell_mm);
            cell_kernel(shear_modulus_mpa, poisson, grid.cell_mm, x, y)
        },
    )
}
