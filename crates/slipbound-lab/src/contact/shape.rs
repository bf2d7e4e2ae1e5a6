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
    /// Height of the surface above its lowest point in mm, 0 or above; infinite beside the object. `from_centre` is the
    /// position in the object's frame, in mm. `on_skin` differs from it by the roll of the object: it gives the piece
    /// of skin at that position, for relief that turns with the object.
    fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64;

    /// [`Shape::gap_mm`] of many points, each with its piece of skin.
    fn gaps_mm(&self, points: &[(Vec2, Vec2)], gaps_mm: &mut [f64]) {
        for (gap_mm, &(from_centre, on_skin)) in gaps_mm.iter_mut().zip(points) {
            *gap_mm = self.gap_mm(from_centre, on_skin);
        }
    }

    /// Gradient of the gap where it is finite, along x and y of the object's frame. By default a central difference
    /// with a step of [`SLOPE_STEP_MM`]; at a side, the difference towards the face.
    fn slope(&self, from_centre: Vec2, on_skin: Vec2) -> Slope {
        slope_by_differences(self, from_centre, on_skin)
    }

    /// Half the size of the part that touches, in mm, along the object's x and y; it must fit on the gel. 0 along a
    /// direction in which only the curvature limits the contact.
    fn half_size_mm(&self) -> Vec2;

    /// Refuses numbers outside the ranges of the fields.
    fn check(&self) -> Result<(), SettingError>;
}

/// Step of the difference for shapes without an analytic slope, in mm.
pub const SLOPE_STEP_MM: f64 = 1e-4;

/// Gradient of the gap, per mm from the centre and per mm on the skin: an object that rolls in place moves only its
/// skin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slope {
    /// With a fixed skin: the profile.
    pub profile: Vec2,
    /// With a fixed profile: relief that turns with the object.
    pub skin: Vec2,
}

impl Slope {
    /// The slope of a smooth object.
    fn of_profile(x: f64, y: f64) -> Self {
        Slope { profile: Vec2::new(x, y), skin: Vec2::ZERO }
    }
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

    fn slope(&self, from_centre: Vec2, _on_skin: Vec2) -> Slope {
        let steepness = arc_slope(self.radius_mm, from_centre.length_squared());
        Slope::of_profile(steepness * from_centre.x, steepness * from_centre.y)
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

    fn slope(&self, from_centre: Vec2, _on_skin: Vec2) -> Slope {
        Slope::of_profile(from_centre.x / self.radius_mm, from_centre.y / self.radius_mm)
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
    /// Radius of the rounded rims at its ends in mm, 0 or above, at most half the length; bevelled from 27 degrees on.
    pub edge_radius_mm: f64,
}

impl Shape for Cylinder {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        let beyond = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        arc(self.radius_mm, from_centre.y * from_centre.y) + edge_gap(self.edge_radius_mm, beyond * beyond)
    }

    fn slope(&self, from_centre: Vec2, _on_skin: Vec2) -> Slope {
        let beyond = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        let end = edge_slope(self.edge_radius_mm, beyond * beyond) * beyond;
        let side = arc_slope(self.radius_mm, from_centre.y * from_centre.y) * from_centre.y;
        Slope::of_profile(end.copysign(from_centre.x), side)
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
    /// Radius of the rounded edges in mm, 0 or above, at most half the shorter side; bevelled from 27 degrees on.
    pub edge_radius_mm: f64,
}

impl Shape for FlatBox {
    fn gap_mm(&self, from_centre: Vec2, _on_skin: Vec2) -> f64 {
        let x = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        let y = past_flat(from_centre.y, 0.5 * self.width_mm, self.edge_radius_mm);
        edge_gap(self.edge_radius_mm, x * x + y * y)
    }

    fn slope(&self, from_centre: Vec2, _on_skin: Vec2) -> Slope {
        let x = past_flat(from_centre.x, 0.5 * self.length_mm, self.edge_radius_mm);
        let y = past_flat(from_centre.y, 0.5 * self.width_mm, self.edge_radius_mm);
        let steepness = edge_slope(self.edge_radius_mm, x * x + y * y);
        Slope::of_profile((steepness * x).copysign(from_centre.x), (steepness * y).copysign(from_centre.y))
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

/// The slope of any shape, from its gap.
pub fn slope_by_differences<S: Shape + ?Sized>(shape: &S, from_centre: Vec2, on_skin: Vec2) -> Slope {
    let here_mm = shape.gap_mm(from_centre, on_skin);
    let along = |before_mm: f64, after_mm: f64| match (before_mm.is_finite(), after_mm.is_finite()) {
        (true, true) => (after_mm - before_mm) / (2.0 * SLOPE_STEP_MM),
        (true, false) => (here_mm - before_mm) / SLOPE_STEP_MM,
        (false, true) => (after_mm - here_mm) / SLOPE_STEP_MM,
        (false, false) => 0.0,
    };
    let (x, y) = (Vec2::new(SLOPE_STEP_MM, 0.0), Vec2::new(0.0, SLOPE_STEP_MM));
    let profile = |at: Vec2| shape.gap_mm(at, on_skin);
    let skin = |at: Vec2| shape.gap_mm(from_centre, at);
    Slope {
        profile: Vec2::new(
            along(profile(from_centre - x), profile(from_centre + x)),
            along(profile(from_centre - y), profile(from_centre + y)),
        ),
        skin: Vec2::new(along(skin(on_skin - x), skin(on_skin + x)), along(skin(on_skin - y), skin(on_skin + y))),
    }
}

/// Steepest slope of edges: 27 degrees. A height field over cells of half a millimetre cannot have steep walls: at 45
/// degrees all pressure of the gel at the rim of a cap acts sideways, and the gel repeatedly jams and snaps free.
const BEVEL_SLOPE: f64 = 0.5;

/// R - sqrt(R^2 - d^2): an arc of radius R at distance d from its lowest point; infinite beyond its side.
fn arc(radius: f64, squared: f64) -> f64 {
    let inside = radius * radius - squared;
    if inside < 0.0 {
        return f64::INFINITY;
    }
    squared / (radius + inside.sqrt()).max(f64::MIN_POSITIVE)
}

/// The gap beside a face with rounded edges, at a distance past its flat part: an arc until it is as steep as
/// [`BEVEL_SLOPE`], then a bevel. Without a radius the edge is sharp, and there is no surface beside it.
fn edge_gap(radius: f64, squared: f64) -> f64 {
    let bevel_from = bevel_from(radius);
    if squared <= bevel_from * bevel_from || radius == 0.0 {
        return arc(radius, squared);
    }
    arc(radius, bevel_from * bevel_from) + BEVEL_SLOPE * (squared.sqrt() - bevel_from)
}

/// Its slope with respect to the distance.
fn edge_slope(radius: f64, squared: f64) -> f64 {
    let bevel_from = bevel_from(radius);
    if squared <= bevel_from * bevel_from || radius == 0.0 {
        arc_slope(radius, squared)
    } else {
        BEVEL_SLOPE / squared.sqrt()
    }
}

/// The distance at which an arc is as steep as the bevel.
fn bevel_from(radius: f64) -> f64 {
    radius * BEVEL_SLOPE / (1.0 + BEVEL_SLOPE * BEVEL_SLOPE).sqrt()
}

/// Slope of such an arc with respect to the distance: 1 / sqrt(R^2 - d^2); 0 without an arc and beyond its side.
fn arc_slope(radius: f64, squared: f64) -> f64 {
    let inside = radius * radius - squared;
    if inside > 0.0 { inside.sqrt().recip() } else { 0.0 }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A shape whose slope is computed only by differences.
    #[derive(Debug)]
    struct ByDifferences<S>(S);

    impl<S: Shape> Shape for ByDifferences<S> {
        fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64 {
            self.0.gap_mm(from_centre, on_skin)
        }

        fn half_size_mm(&self) -> Vec2 {
            self.0.half_size_mm()
        }

        fn check(&self) -> Result<(), SettingError> {
            self.0.check()
        }
    }

    fn agree(shape: impl Shape + Copy) {
        for (x, y) in [(0.0, 0.0), (3.1, -2.2), (-5.4, 1.0), (-5.3, -6.7), (2.0, 6.6), (6.4, 0.3), (-5.9, -7.2)] {
            let at = Vec2::new(x, y);
            let (known, measured) = (shape.slope(at, at), ByDifferences(shape).slope(at, at));
            let off = (known.profile - measured.profile).length() + (known.skin - measured.skin).length();
            assert!(off < 1e-6, "{shape:?} at {at:?}: {known:?} {measured:?}");
        }
    }

    #[test]
    fn slopes_are_those_of_the_gaps() {
        agree(Sphere { radius_mm: 15.0 });
        agree(Paraboloid { radius_mm: 15.0 });
        agree(Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 });
        agree(FlatBox { length_mm: 12.0, width_mm: 14.0, edge_radius_mm: 1.0 });
    }
}
