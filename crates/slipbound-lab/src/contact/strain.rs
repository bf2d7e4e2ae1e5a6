//! The largest strain of the gel surface, to flag where a linear model is no longer valid.

use super::grid::Grid;
use num_complex::Complex64;

/// Largest Frobenius norm of the displacement gradient over the surface cells, as a fraction. In-plane derivatives
/// are differences over two cells; those along z follow from the tractions: sigma_xz = -q_x = G (du_x/dz +
/// du_z/dx), sigma_zz = -p.
pub(crate) fn largest_gradient(
    grid: &Grid,
    shear_modulus_mpa: f64,
    poisson: f64,
    shift: &[Complex64],
    depth: &[f64],
    traction: &[Complex64],
    pressure: &[f64],
) -> f64 {
    let (w, h) = (grid.width_cells, grid.height_cells);
    let over = 0.5 / grid.cell_mm;
    let (soft, nu) = (1.0 / shear_modulus_mpa, poisson);
    let mut largest = 0.0f64;
    for row in 1..h - 1 {
        for i in row * w + 1..(row + 1) * w - 1 {
            let along_x = (shift[i + 1] - shift[i - 1]) * over;
            let along_y = (shift[i + w] - shift[i - w]) * over;
            let slope = Complex64::new(depth[i + 1] - depth[i - 1], depth[i + w] - depth[i - w]) * over;
            let along_z = traction[i] * -soft - slope;
            let thinning = (-0.5 * pressure[i] * (1.0 - 2.0 * nu) * soft - nu * (along_x.re + along_y.im)) / (1.0 - nu);
            let squared =
                along_x.norm_sqr() + along_y.norm_sqr() + slope.norm_sqr() + along_z.norm_sqr() + thinning * thinning;
            largest = largest.max(squared);
        }
    }
    largest.sqrt()
}
