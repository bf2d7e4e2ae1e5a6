//! The grid of gel cells. It is Lagrangian: a cell is a piece of gel surface and keeps its index as it moves.

use crate::layer::above_zero;
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Cells of the gel surface, in rows along x.
///
/// ```text
///      o---> x    cell (0, 0) is at the corner of least x and y;
///      |          the origin is the middle of the grid;
///      v y        cell number = row * width + column
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Cells along x, 8 or more.
    pub width_cells: usize,
    /// Cells along y, 8 or more.
    pub height_cells: usize,
    /// Side of the square cells in mm.
    pub cell_mm: f64,
    /// Cells along x of the periodic domain of the transforms, at least `width_cells` and even, 2^a 3^b 5^c: the rest
    /// is padding. The response of a bonded layer decays within 3 to 4 thicknesses, so 12 mm are enough for 3 mm of
    /// gel.
    pub padded_width_cells: usize,
    /// Cells along y of the periodic domain, at least `height_cells`.
    pub padded_height_cells: usize,
}

impl Grid {
    /// 96 x 72 cells over 40 x 30 mm, padded to 128 x 96: load within 0.6 % of a grid of 160 x 120.
    pub fn standard() -> Self {
        Grid {
            width_cells: 96,
            height_cells: 72,
            cell_mm: 40.0 / 96.0,
            padded_width_cells: 128,
            padded_height_cells: 96,
        }
    }

    /// 64 x 48 cells over 40 x 30 mm, padded to 96 x 72: load within 0.9 %.
    pub fn fast() -> Self {
        Grid {
            width_cells: 64,
            height_cells: 48,
            cell_mm: 40.0 / 64.0,
            padded_width_cells: 96,
            padded_height_cells: 72,
        }
    }

    /// A grid whose padding is at least `padding_mm` wide, with a size that the transforms support (2^a 3^b 5^c, even).
    pub fn padded(width_cells: usize, height_cells: usize, cell_mm: f64, padding_mm: f64) -> Self {
        let pad = (padding_mm / cell_mm).ceil() as usize;
        Grid {
            width_cells,
            height_cells,
            cell_mm,
            padded_width_cells: smooth_even_at_least(width_cells + pad),
            padded_height_cells: smooth_even_at_least(height_cells + pad),
        }
    }

    /// Refuses grids that are empty or too small, or whose padded size is below the size, odd, or not of the form 2^a
    /// 3^b 5^c.
    pub fn check(&self) -> Result<(), SettingError> {
        let bad = |key: &str, got: usize, expected: String| {
            Err(SettingError { key: key.into(), got: got.to_string(), expected })
        };
        above_zero("grid.cell_mm", self.cell_mm)?;
        for (key, padded_key, cells, padded) in [
            ("grid.width_cells", "grid.padded_width_cells", self.width_cells, self.padded_width_cells),
            ("grid.height_cells", "grid.padded_height_cells", self.height_cells, self.padded_height_cells),
        ] {
            if !(8..=4096).contains(&cells) {
                return bad(key, cells, "8 to 4096".into());
            }
            if padded < cells || padded > 8192 || smooth_even_at_least(padded) != padded {
                return bad(padded_key, padded, format!("an even number 2^a 3^b 5^c from {cells} to 8192"));
            }
        }
        Ok(())
    }

    /// Number of cells.
    pub fn cells_count(&self) -> usize {
        self.width_cells * self.height_cells
    }

    /// Area of a cell in mm2.
    pub fn cell_area_mm2(&self) -> f64 {
        self.cell_mm * self.cell_mm
    }

    /// Middle of a cell at rest, in mm.
    pub fn centre_mm(&self, cell: usize) -> Vec2 {
        let (column, row) = (cell % self.width_cells, cell / self.width_cells);
        Vec2::new(
            (column as f64 + 0.5 - 0.5 * self.width_cells as f64) * self.cell_mm,
            (row as f64 + 0.5 - 0.5 * self.height_cells as f64) * self.cell_mm,
        )
    }

    /// Half the width and height of the gel in mm.
    pub fn half_size_mm(&self) -> Vec2 {
        Vec2::new(self.width_cells as f64, self.height_cells as f64) * (0.5 * self.cell_mm)
    }

    /// All cells.
    pub fn whole(&self) -> Region {
        Region { column: 0, row: 0, width_cells: self.width_cells, height_cells: self.height_cells }
    }

    /// Wave numbers (rad/mm) of column `kx` and row `ky` of the transforms, and whether one of them is the
    /// Nyquist wave number, at which odd kernels vanish.
    pub(crate) fn wave(&self, kx: usize, ky: usize) -> (f64, f64, bool) {
        let one = |k: usize, n: usize| {
            let signed = if k > n / 2 { k as f64 - n as f64 } else { k as f64 };
            std::f64::consts::TAU * signed / (n as f64 * self.cell_mm)
        };
        let nyquist = kx == self.padded_width_cells / 2 || ky == self.padded_height_cells / 2;
        (one(kx, self.padded_width_cells), one(ky, self.padded_height_cells), nyquist)
    }
}

/// The least even number of the form 2^a 3^b 5^c that is at least `n`.
pub(crate) fn smooth_even_at_least(n: usize) -> usize {
    (n.max(2)..)
        .find(|&m| {
            let mut rest = m;
            for prime in [2, 3, 5] {
                while rest % prime == 0 {
                    rest /= prime;
                }
            }
            rest == 1 && m % 2 == 0
        })
        .expect("powers of two have no end")
}

/// A rectangle of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// First column.
    pub column: usize,
    /// First row.
    pub row: usize,
    /// Columns.
    pub width_cells: usize,
    /// Rows.
    pub height_cells: usize,
}

impl Region {
    /// The smallest rectangle around the cells for which `inside` holds; None when there are none.
    pub fn around(grid: &Grid, inside: impl Fn(usize) -> bool) -> Option<Region> {
        let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
        for row in 0..grid.height_cells {
            for column in 0..grid.width_cells {
                if inside(row * grid.width_cells + column) {
                    (left, right) = (left.min(column), right.max(column));
                    (top, bottom) = (top.min(row), bottom.max(row));
                }
            }
        }
        (left != usize::MAX).then(|| Region {
            column: left,
            row: top,
            width_cells: right - left + 1,
            height_cells: bottom - top + 1,
        })
    }

    /// The rectangle with `margin_cells` more on every side, cut at the border of the grid.
    pub fn grown(&self, grid: &Grid, margin_cells: usize) -> Region {
        let column = self.column.saturating_sub(margin_cells);
        let row = self.row.saturating_sub(margin_cells);
        Region {
            column,
            row,
            width_cells: (self.column + self.width_cells + margin_cells).min(grid.width_cells) - column,
            height_cells: (self.row + self.height_cells + margin_cells).min(grid.height_cells) - row,
        }
    }

    /// Indices of its cells, row by row, for a grid `width_cells` wide.
    pub fn cells(self, width_cells: usize) -> impl Iterator<Item = usize> {
        (self.row..self.row + self.height_cells).flat_map(move |row| {
            let first = row * width_cells + self.column;
            first..first + self.width_cells
        })
    }

    /// Whether a cell lies in it.
    pub fn contains(&self, cell: usize, width_cells: usize) -> bool {
        let (column, row) = (cell % width_cells, cell / width_cells);
        (self.column..self.column + self.width_cells).contains(&column)
            && (self.row..self.row + self.height_cells).contains(&row)
    }
}
