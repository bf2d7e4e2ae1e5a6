//! Shear of the gel, width of the contact -> ratio of the load at gross slip to mu P, for an object that has sunk into
//! the gel.
//!
//! ```text
//!   load --> (     )
//!   ~~~~~~~~~~\___/~~~~~~~   a curved object bears against the far side of its pit, too
//! ```

use crate::plane::Vec2;

/// Growth of the load at gross slip with the shear of the gel at a traction as large as the pressure, in half widths of
/// the contact: 0.5 to 1.1 for simulated spheres, cylinders and the cap between 6 and 50 N, whatever their friction.
const INDENTATION_GAIN_SLOPE: f64 = 0.8;
/// Larger values were not simulated.
const MAX_INDENTATION_GAIN: f64 = 1.5;

/// Ratio of the load at gross slip to mu P for an object that has sunk into the gel. `shear_px`: displacement of the
/// gel at a traction as large as the mean pressure; `half_width_px`: of the contact along the load; `pulled_fraction`:
/// share of the force in the load; the rest is torque.
pub(super) fn indentation_gain(shear_px: f64, half_width_px: f64, pulled_fraction: f64) -> f64 {
    (1.0 + INDENTATION_GAIN_SLOPE * pulled_fraction * shear_px / half_width_px.max(1e-6)).min(MAX_INDENTATION_GAIN)
}

/// Half the width of a contact along a direction, from the positions of its markers: twice their standard deviation, as
/// on a disc.
pub(super) fn half_width_px(places: impl ExactSizeIterator<Item = Vec2>, middle: Vec2, along: Vec2) -> f64 {
    let n = places.len().max(1) as f64;
    let squares: f64 = places.map(|place| (place - middle).dot(along)).map(|x| x * x).sum();
    2.0 * (squares / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_deep_slides_at_more_and_a_wide_face_does_not() {
        let places = |x_mm: f64, y_mm: f64| {
            (0..900).map(move |i| {
                Vec2::new(x_mm * (f64::from(i % 30) / 14.5 - 1.0), y_mm * (f64::from(i / 30) / 14.5 - 1.0))
            })
        };
        let width = |x_mm, y_mm, along: Vec2| {
            let places: Vec<Vec2> = places(x_mm, y_mm).collect();
            half_width_px(places.into_iter(), Vec2::ZERO, along)
        };
        // A uniform width of 2 a has the standard deviation a / sqrt 3.
        assert!((width(6.0, 2.0, Vec2::new(1.0, 0.0)) - 6.0 * 2.0 / 3f64.sqrt()).abs() < 0.3);
        assert!((width(6.0, 2.0, Vec2::new(0.0, 1.0)) - 2.0 * 2.0 / 3f64.sqrt()).abs() < 0.1);
        // The cap at 6 and at 50 N, and a box (simulated: 1.09, 1.48, 1.05), pulled; the cap turned about the pad's normal.
        assert!(
            (indentation_gain(1.1, 7.2, 1.0) - 1.12).abs() < 0.01
                && (indentation_gain(3.8, 8.8, 1.0) - 1.35).abs() < 0.01
        );
        assert!(
            indentation_gain(1.3, 13.0, 1.0) < 1.09
                && indentation_gain(3.8, 8.8, 0.0) == 1.0
                && indentation_gain(90.0, 1.0, 1.0) == MAX_INDENTATION_GAIN
        );
    }
}
