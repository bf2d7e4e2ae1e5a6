//! The surface of the gel, as computed by the contact.

use crate::contact::{Displacement, Grid};
use slipbound::plane::Vec2;

/// Input of a camera: displacement and pressure of every cell.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// The cells.
    pub grid: &'a Grid,
    /// Displacement of the gel's surface, cell by cell.
    pub displacement: &'a [Displacement],
    /// Pressure in MPa, 0 or above, cell by cell.
    pub pressure_mpa: &'a [f64],
}

impl<'a> Surface<'a> {
    /// Displacement of the piece that is at `rest_mm` without contact: bilinear between cell centres, constant beyond
    /// the outermost ones.
    pub fn displacement_at(&self, rest_mm: Vec2) -> Displacement {
        let mut sum = Displacement::default();
        for (cell, share) in self.around(rest_mm) {
            sum.shift_mm += self.displacement[cell].shift_mm * share;
            sum.depth_mm += self.displacement[cell].depth_mm * share;
        }
        sum
    }

    /// The four cells around a point and their weights.
    fn around(&self, rest_mm: Vec2) -> [(usize, f64); 4] {
        let half = self.grid.half_size_mm();
        let place = |at_mm: f64, half_mm: f64, cells: usize| {
            let at = ((at_mm + half_mm) / self.grid.cell_mm - 0.5).clamp(0.0, (cells - 1) as f64);
            let low = (at as usize).min(cells - 2);
            (low, at - low as f64)
        };
        let (column, fx) = place(rest_mm.x, half.x, self.grid.width_cells);
        let (row, fy) = place(rest_mm.y, half.y, self.grid.height_cells);
        let corner = row * self.grid.width_cells + column;
        let below = corner + self.grid.width_cells;
        [
            (corner, (1.0 - fx) * (1.0 - fy)),
            (corner + 1, fx * (1.0 - fy)),
            (below, (1.0 - fx) * fy),
            (below + 1, fx * fy),
        ]
    }
}
