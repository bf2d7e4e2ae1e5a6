//! Relief of the surface of an object.

use serde::Serialize;
use slipbound::plane::Vec2;
use std::f64::consts::TAU;

/// A pattern cut into a surface, given by its depth and spacing in mm. x and y are those of the unrolled surface: on a
/// cylinder y runs around it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Relief {
    /// Smooth.
    Smooth,
    /// Grooves along x, one every `spacing_mm` of y: flutes, knurls.
    Grooves {
        /// From ridge to groove.
        depth_mm: f64,
        /// From ridge to ridge.
        spacing_mm: f64,
    },
    /// Rings across x, one every `spacing_mm` of x.
    Rings {
        /// From ridge to groove.
        depth_mm: f64,
        /// From ridge to ridge.
        spacing_mm: f64,
    },
    /// Winding ridges, as on a brain.
    Windings {
        /// From ridge to groove.
        depth_mm: f64,
        /// From ridge to ridge.
        spacing_mm: f64,
    },
    /// Irregular bumps, always the same ones.
    Bumps {
        /// From the highest bump to the lowest hollow.
        depth_mm: f64,
        /// Between the corners of the lattice on which heights are drawn.
        spacing_mm: f64,
    },
}

/// Spacing of the finest relief whose slopes are resolved, in mm: four cells of the fast grid.
const LEAST_FOLLOWED_MM: f64 = 2.5;

/// Sideways amplitude of the windings, as a share of their spacing, and its period in spacings. By eye.
const WANDER: (f64, f64) = (0.35, 2.3);

impl Relief {
    /// Depth below the ridges in mm at a point of the unrolled surface.
    pub(super) fn depth_at_mm(&self, at: Vec2) -> f64 {
        let wave = |along_mm: f64, spacing_mm: f64| 0.5 - 0.5 * libm::cos(TAU * along_mm / spacing_mm);
        match *self {
            Relief::Smooth => 0.0,
            Relief::Grooves { depth_mm, spacing_mm } => depth_mm * wave(at.y, spacing_mm),
            Relief::Rings { depth_mm, spacing_mm } => depth_mm * wave(at.x, spacing_mm),
            Relief::Windings { depth_mm, spacing_mm } => {
                let aside_mm = WANDER.0 * spacing_mm * libm::sin(TAU * at.y / (WANDER.1 * spacing_mm));
                depth_mm * wave(at.x + aside_mm, spacing_mm)
            }
            Relief::Bumps { depth_mm, spacing_mm } => depth_mm * (1.0 - bump(at.x / spacing_mm, at.y / spacing_mm)),
        }
    }

    /// Whether pressure on its slopes is resolved. Relief finer than [`LEAST_FOLLOWED_MM`] has two or three cells per
    /// ridge, which would snap from one ridge to the next: it shapes only the pressure, and its interlocking with the
    /// gel is part of the friction coefficient of the object.
    pub(super) fn pushes_sideways(&self) -> bool {
        match *self {
            Relief::Smooth => false,
            Relief::Grooves { spacing_mm, .. }
            | Relief::Rings { spacing_mm, .. }
            | Relief::Windings { spacing_mm, .. }
            | Relief::Bumps { spacing_mm, .. } => spacing_mm >= LEAST_FOLLOWED_MM,
        }
    }

    /// Its lengths by name: depth and spacing must both be above 0.
    pub(super) fn lengths_mm(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Relief::Smooth => Vec::new(),
            Relief::Grooves { depth_mm, spacing_mm }
            | Relief::Rings { depth_mm, spacing_mm }
            | Relief::Windings { depth_mm, spacing_mm }
            | Relief::Bumps { depth_mm, spacing_mm } => {
                vec![("relief.depth_mm", depth_mm), ("relief.spacing_mm", spacing_mm)]
            }
        }
    }
}

/// Heights 0 to 1 drawn at the corners of a unit lattice, smoothly interpolated.
fn bump(x: f64, y: f64) -> f64 {
    let (column, row) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (right, down) = (ease(x - column), ease(y - row));
    let corner = |dx: i64, dy: i64| height_of_corner(column as i64 + dx, row as i64 + dy);
    let upper = corner(0, 0) * (1.0 - right) + corner(1, 0) * right;
    let lower = corner(0, 1) * (1.0 - right) + corner(1, 1) * right;
    upper * (1.0 - down) + lower * down
}

/// A number 0 to 1 that is fixed for a corner.
fn height_of_corner(column: i64, row: i64) -> f64 {
    let key = (column as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (row as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    crate::random::Random::new(key).fraction()
}
