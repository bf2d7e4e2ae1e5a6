//! The objects of the paper, and a bottle cap: an entry each, see [`OBJECTS`].
//!
//! ```text
//!   Object = form (what the hand feels) + relief (what is cut into it) + stuff (softness, friction, mass)
//! ```
//!
//! Every number of shape, stiffness and friction is an ESTIMATE of ours from the kind of object; none was measured
//! on the objects of the paper, which are not published with their sizes. Only the part that faces the pad is
//! described: a bottle is the piece of cylinder that fits on it.

mod form;
mod library;
mod relief;

pub use form::Form;
pub use library::OBJECTS;
pub use relief::Relief;

use crate::contact::shape::{Shape, Slope, slope_by_differences};
use crate::layer::{SoftObject, above_zero};
use serde::Serialize;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// An object to be held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Object {
    /// What it is called in scenes.
    pub name: &'static str,
    /// The part that faces the pad, without its relief.
    pub form: Form,
    /// What is cut into the form.
    pub relief: Relief,
    /// How it gives; None for what is rigid beside the gel.
    pub softness: Option<SoftObject>,
    /// Friction coefficient on the gel when a scene names none.
    pub mu: f64,
    /// Mass in kg; of the bottle, empty.
    pub mass_kg: f64,
    /// Radius of gyration about the point that is held, in mm.
    pub gyration_radius_mm: f64,
    /// What its surface looks like.
    pub texture: &'static str,
    /// What to know before trusting it.
    pub note: &'static str,
}

impl Object {
    /// The object of a name; the error lists the names.
    pub fn named(name: &str) -> Result<&'static Object, SettingError> {
        OBJECTS.iter().find(|object| object.name == name).ok_or_else(|| SettingError {
            key: "object".into(),
            got: name.into(),
            expected: format!("one of {}", OBJECTS.map(|object| object.name).join(", ")),
        })
    }

    /// Its surface, to be pressed on the gel.
    pub fn surface(&self) -> ObjectSurface {
        ObjectSurface { form: self.form, relief: self.relief }
    }
}

/// A form with its relief as one height field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectSurface {
    /// Without the relief.
    pub form: Form,
    /// What is cut into it.
    pub relief: Relief,
}

impl Shape for ObjectSurface {
    fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64 {
        let gap_mm = self.form.shape().gap_mm(from_centre, on_skin);
        if gap_mm.is_finite() {
            gap_mm + self.relief.depth_at_mm(self.form.unrolled_mm(from_centre, on_skin))
        } else {
            gap_mm
        }
    }

    fn slope(&self, from_centre: Vec2, on_skin: Vec2) -> Slope {
        match self.relief {
            Relief::Smooth => self.form.shape().slope(from_centre, on_skin),
            _ => slope_by_differences(self, from_centre, on_skin),
        }
    }

    fn half_size_mm(&self) -> Vec2 {
        self.form.shape().half_size_mm()
    }

    fn check(&self) -> Result<(), SettingError> {
        self.form.shape().check()?;
        for (key, value) in self.relief.lengths_mm() {
            above_zero(key, value)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Finger, FingerSettings, Friction};

    #[test]
    fn every_object_fits_on_the_pad_and_has_sound_numbers() {
        assert_eq!(OBJECTS.len(), 11);
        for object in &OBJECTS {
            let settings = FingerSettings {
                soft_object: object.softness,
                friction: Friction::constant(object.mu),
                ..FingerSettings::fast()
            };
            if let Err(error) = Finger::new(settings, object.surface()) {
                panic!("{}: {error}", object.name);
            }
            assert!((0.35..=1.2).contains(&object.mu) && object.mass_kg > 0.0, "{object:?}");
            assert!(object.gyration_radius_mm > 0.0 && !object.note.is_empty(), "{object:?}");
            assert_eq!(OBJECTS.iter().filter(|other| other.name == object.name).count(), 1, "{}", object.name);
        }
    }

    #[test]
    fn a_surface_reaches_its_lowest_point_and_goes_no_lower() {
        for object in &OBJECTS {
            let surface = object.surface();
            let mut lowest_mm = f64::INFINITY;
            for i in 0..400 {
                for j in 0..400 {
                    let at = Vec2::new(-10.0 + 0.05 * f64::from(i), -10.0 + 0.05 * f64::from(j));
                    lowest_mm = lowest_mm.min(surface.gap_mm(at, at));
                }
            }
            assert!((0.0..0.05).contains(&lowest_mm), "{}: {lowest_mm} mm", object.name);
        }
    }

    #[test]
    fn relief_turns_with_an_object_that_rolls() {
        let surface = Object::named("screwdriver").expect("there is one").surface();
        let at = |centre_y: f64, skin_y: f64| surface.gap_mm(Vec2::new(0.0, centre_y), Vec2::new(0.0, skin_y));
        // Six flutes on a radius of 13 mm: one comes by every 13.6 mm of way.
        let way_mm = std::f64::consts::TAU * 13.0 / 6.0;
        assert!((at(0.0, 0.0) - at(0.0, way_mm)).abs() < 1e-12);
        assert!(at(0.0, 0.5 * way_mm) > 0.7, "half a flute further the ridge has gone");
    }

    #[test]
    fn an_unknown_object_is_told_the_known_ones() {
        let error = Object::named("spoon").expect_err("no such object");
        assert!(error.to_string().starts_with("object: expected one of tape_roll, crayons_box"), "{error}");
        assert!(error.to_string().ends_with("got spoon"), "{error}");
    }
}
