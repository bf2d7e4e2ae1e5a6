//! Results of a finger after a step: numbers, fields per cell, displacement anywhere.

use super::body::{Body, plane};
use super::finger::Finger;
use super::settings::FingerSettings;
use super::truth::{Displacement, Truth};
use num_complex::Complex64;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

impl Finger {
    /// The ground truth after the last step.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// The settings.
    pub fn settings(&self) -> &FingerSettings {
        &self.settings
    }

    /// Changes the body during a run (a bottle that fills). Refuses numbers outside their ranges.
    pub fn set_body(&mut self, body: Body) -> Result<(), SettingError> {
        body.check()?;
        self.settings.body = body;
        Ok(())
    }

    /// Pressure of every cell in MPa, 0 or above, row by row.
    pub fn pressure_mpa(&self) -> &[f64] {
        &self.pressure
    }

    /// Largest friction in every cell in MPa, row by row, for the direction in which it acted.
    pub fn bound_mpa(&self) -> &[f64] {
        &self.bound
    }

    /// Which cells are under pressure, row by row.
    pub fn contact(&self) -> &[bool] {
        &self.contact
    }

    /// Which cells are under pressure and did not slide in the last step, row by row.
    pub fn stick(&self) -> &[bool] {
        &self.stick
    }

    /// In-plane traction of the object on a cell of the gel in MPa: friction, and the horizontal part of pressure.
    pub fn traction_mpa(&self, cell: usize) -> Vec2 {
        plane(self.traction[cell])
    }

    /// The part of it that is friction, in MPa.
    pub fn friction_mpa(&self, cell: usize) -> Vec2 {
        plane(self.traction[cell] - self.push[cell])
    }

    /// Gradient of the gap over a cell in contact, along x and y of the gel; 0 elsewhere.
    pub fn slope(&self, cell: usize) -> Vec2 {
        plane(self.slope[cell])
    }

    /// How far the object has slid over a cell since it came into contact, in mm, as a vector.
    pub fn slip_mm(&self, cell: usize) -> Vec2 {
        plane(self.slip[cell])
    }

    /// Path length that the object has slid over a cell since it came into contact, in mm.
    pub fn slipped_mm(&self, cell: usize) -> f64 {
        self.slipped[cell]
    }

    /// Displacement of a cell of the gel.
    pub fn displacement(&self, cell: usize) -> Displacement {
        Displacement { shift_mm: plane(self.gel.shift[cell]), depth_mm: self.gel.depth[cell] }
    }

    /// Displacement of the piece of gel that is at `rest_mm` without contact, bilinear between the cell centres and
    /// constant beyond the outermost ones.
    pub fn displacement_at(&self, rest_mm: Vec2) -> Displacement {
        let grid = &self.settings.grid;
        let place = |at_mm: f64, half_mm: f64, cells: usize| {
            let at = ((at_mm + half_mm) / grid.cell_mm - 0.5).clamp(0.0, (cells - 1) as f64);
            let low = (at as usize).min(cells - 2);
            (low, at - low as f64)
        };
        let half = grid.half_size_mm();
        let (column, fx) = place(rest_mm.x, half.x, grid.width_cells);
        let (row, fy) = place(rest_mm.y, half.y, grid.height_cells);
        let corner = row * grid.width_cells + column;
        let (mut shift, mut depth_mm) = (Complex64::ZERO, 0.0);
        for (cell, share) in [
            (corner, (1.0 - fx) * (1.0 - fy)),
            (corner + 1, fx * (1.0 - fy)),
            (corner + grid.width_cells, (1.0 - fx) * fy),
            (corner + grid.width_cells + 1, fx * fy),
        ] {
            shift += self.gel.shift[cell] * share;
            depth_mm += self.gel.depth[cell] * share;
        }
        Displacement { shift_mm: plane(shift), depth_mm }
    }
}
