//! Shapes of objects: how high their surface is above the flat gel.

use crate::layer::{above_zero, zero_or_above};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// A height field the gel is pressed against.
///
/// ```text
///   object  \         /
///            \__   __/      gap_mm: from the plane of the lowest point up to the surface
///   - - - - - - \_/- - - -
/// ```
pub trait Shape: std::fmt::Debug + Send + Sync {
    /// Height of the surface above its lowest point in mm, 0 or above; infinite beside the object. `from_centre`
    /// is the position in the object's frame, in mm. `on_skin` differs from it by the roll of the object: it says
    /// which piece of skin is there, for relief that turns with the object.
    fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64;

    /// Half the size of the part that touches, in mm, along the object's x and y: what must fit on the gel. 0 along
    /// a direction in which only the curvature limits the contact.
    fn half_size_mm(&self) -> Vec2;

    /// Refuses numbers outside the ranges of the fields.
    fn check(&self) -> Result<(), SettingError>;
}

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Radius in mm, above 0.
    pub radius_mm: f64,
}

impl Shape for Sphere {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        arc(self.radius_mm, from_centre.length_squared())
    }

    fn half_size_mm(&self) -> Vec2 {
        Vec2::ZERO
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("sphere.radius_mm", self.radius_mm)
    }
}

/// A paraboloid r^2 / 2R, the profile of Hertz's theory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paraboloid {
    /// Radius of curvature R at the lowest point in mm, above 0.
    pub radius_mm: f64,
}

impl Shape for Paraboloid {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        from_centre.length_squared() / (2.0 * self.radius_mm)
    }

    fn half_size_mm(&self) -> Vec2 {
        Vec2::ZERO
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("paraboloid.radius_mm", self.radius_mm)
    }
}

/// A cylinder with its axis along the object's x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Radius in mm, above 0.
    pub radius_mm: f64,
    /// Length in mm, above 0.
    pub length_mm: f64,
    /// Radius of the rounded rims at its ends in mm, 0 or above, at most half the length.
    pub edge_radius_mm: f64,
}

impl Shape for Cylinder {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        let beyond = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        arc(self.radius_mm, from_centre.y * from_centre.y) + arc(self.edge_radius_mm, beyond * beyond)
    }

    fn half_size_mm(&self) -> Vec2 {
        Vec2::new(0.5 * self.length_mm, 0.0)
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("cylinder.radius_mm", self.radius_mm)?;
        above_zero("cylinder.length_mm", self.length_mm)?;
        edge("cylinder.edge_radius_mm", self.edge_radius_mm, 0.5 * self.length_mm)
    }
}

/// A flat face with rounded edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatBox {
    /// Length along the object's x in mm, above 0.
    pub length_mm: f64,
    /// Width along the object's y in mm, above 0.
    pub width_mm: f64,
    /// Radius of the rounded edges in mm, 0 or above, at most half the shorter side.
    pub edge_radius_mm: f64,
}

impl Shape for FlatBox {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        let x = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        let y = past_flat(from_centre.y, 0.5 * self.width_mm, self.edge_radius_mm);
        arc(self.edge_radius_mm, x * x + y * y)
    }

    fn half_size_mm(&self) -> Vec2 {
        Vec2::new(0.5 * self.length_mm, 0.5 * self.width_mm)
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("flat_box.length_mm", self.length_mm)?;
        above_zero("flat_box.width_mm", self.width_mm)?;
        edge("flat_box.edge_radius_mm", self.edge_radius_mm, 0.5 * self.length_mm.min(self.width_mm))
    }
}

/// R - sqrt(R^2 - d^2): an arc of radius R at distance d from its lowest point; infinite beyond its side.
fn arc(radius: f64, squared: f64) -> f64 {
    let inside = radius * radius - squared;
    if inside < 0.0 {
        return f64::INFINITY;
    }
    squared / (radius + inside.sqrt()).max(f64::MIN_POSITIVE)
}

/// How far a point is past the flat part of a face whose edge begins `edge` before its half length; 0 on it.
fn past_flat(at: f64, half: f64, edge: f64) -> f64 {
    (at.abs() - (half - edge)).max(0.0)
}

fn edge(key: &str, radius: f64, most: f64) -> Result<(), SettingError> {
    zero_or_above(key, radius)?;
    if radius <= most {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: radius.to_string(), expected: format!("at most {most}") })
}
