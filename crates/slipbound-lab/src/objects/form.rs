//! The form of an object where it faces the pad.

use crate::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use serde::Serialize;
use slipbound::plane::Vec2;

/// A form, by its sizes in mm.
///
/// ```text
///   ball      cylinder, axis along the object's x      flat face
///    __         ____________                            ______
///   /  \       (____________)                          |______|
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Doubly curved.
    Ball {
        /// Radius of curvature.
        radius_mm: f64,
    },
    /// Singly curved, rounded at both ends.
    Cylinder {
        /// Radius of curvature.
        radius_mm: f64,
        /// Length along x.
        length_mm: f64,
        /// Radius of the rims at its ends.
        edge_radius_mm: f64,
    },
    /// Flat with rounded edges.
    Flat {
        /// Length along x.
        length_mm: f64,
        /// Width along y.
        width_mm: f64,
        /// Radius of its edges.
        edge_radius_mm: f64,
    },
}

impl Form {
    /// The shape for the contact.
    pub(super) fn shape(&self) -> FormShape {
        match *self {
            Form::Ball { radius_mm } => FormShape::Ball(Sphere { radius_mm }),
            Form::Cylinder { radius_mm, length_mm, edge_radius_mm } => {
                FormShape::Cylinder(Cylinder { radius_mm, length_mm, edge_radius_mm })
            }
            Form::Flat { length_mm, width_mm, edge_radius_mm } => {
                FormShape::Flat(FlatBox { length_mm, width_mm, edge_radius_mm })
            }
        }
    }

    /// Position of a point of the surface on the object's skin when unrolled, in mm. Relief is defined there: knurls
    /// keep their spacing around a cylinder instead of crowding at its sides.
    pub(super) fn unrolled_mm(&self, from_centre: Vec2, on_skin: Vec2) -> Vec2 {
        match *self {
            Form::Cylinder { radius_mm, .. } => {
                let along_arc_mm = radius_mm * libm::asin((from_centre.y / radius_mm).clamp(-1.0, 1.0));
                Vec2::new(on_skin.x, along_arc_mm + on_skin.y - from_centre.y)
            }
            Form::Ball { .. } | Form::Flat { .. } => on_skin,
        }
    }

    /// In a few words, for a table.
    pub fn in_words(&self) -> String {
        match *self {
            Form::Ball { radius_mm } => format!("ball R {radius_mm}"),
            Form::Cylinder { radius_mm, length_mm, .. } => format!("cylinder R {radius_mm}, {length_mm} long"),
            Form::Flat { length_mm, width_mm, .. } => format!("flat {length_mm} x {width_mm}"),
        }
    }
}

/// A form as a shape of the contact.
#[derive(Debug, Clone, Copy)]
pub(super) enum FormShape {
    Ball(Sphere),
    Cylinder(Cylinder),
    Flat(FlatBox),
}

impl FormShape {
    /// As [`Shape::gap_mm`], without dynamic dispatch for every cell.
    #[inline]
    pub fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64 {
        match self {
            FormShape::Ball(shape) => shape.gap_mm(from_centre, on_skin),
            FormShape::Cylinder(shape) => shape.gap_mm(from_centre, on_skin),
            FormShape::Flat(shape) => shape.gap_mm(from_centre, on_skin),
        }
    }
}

impl std::ops::Deref for FormShape {
    type Target = dyn Shape;
    fn deref(&self) -> &(dyn Shape + 'static) {
        match self {
            FormShape::Ball(shape) => shape,
            FormShape::Cylinder(shape) => shape,
            FormShape::Flat(shape) => shape,
        }
    }
}
