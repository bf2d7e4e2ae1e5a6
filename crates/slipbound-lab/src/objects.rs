//! The objects of the paper, and a bottle cap: one entry each, see [`OBJECTS`].
//!
//! ```text
//!   Object = form (what the hand feels) + relief (what is cut into it) + stuff (softness, friction, mass)
//! ```
//!
//! Every value of shape, stiffness and friction is an ESTIMATE of ours from the kind of object; none was measured on
//! the objects of the paper, whose sizes are not published. Only the part that faces the pad is described: a bottle is
//! the piece of cylinder that fits on the pad.

mod form;
mod library;
mod object;
mod relief;

pub use form::Form;
pub use library::OBJECTS;
pub use object::{Object, ObjectSurface};
pub use relief::Relief;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::shape::Shape;
    use crate::contact::{Finger, FingerSettings, Friction};
    use slipbound::plane::Vec2;

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
        // Six flutes on a radius of 13 mm: one flute every 13.6 mm of travel.
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
