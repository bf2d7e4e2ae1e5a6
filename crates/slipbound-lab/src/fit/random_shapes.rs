//! Random shapes for the training split: trees fitted only to the eleven objects take every other object for one of
//! them.

use crate::layer::SoftObject;
use crate::objects::{Form, OBJECTS, Object, Relief};
use crate::random::Random;

/// Object name in the rows of all random shapes.
pub const RANDOM_SHAPE: &str = "random_body";

/// Share of shapes with a smooth surface, and of rigid ones.
const SMOOTH_FRACTION: f64 = 0.5;
const RIGID_FRACTION: f64 = 0.4;

/// A random shape: a ball, a cylinder or a flat face, smooth or with relief, rigid or soft. Sizes are such that most
/// fit on the pad; moduli range from a foam (0.05 MPa) to a wall of rubber (2 MPa).
pub(super) fn random_shape(random: &mut Random) -> Object {
    let log = |random: &mut Random, low: f64, high: f64| low * libm::pow(high / low, random.fraction());
    let edge_radius_mm = random.between(0.5, 2.0);
    let form = match random.next_u64() % 3 {
        0 => Form::Ball { radius_mm: log(random, 7.0, 60.0) },
        1 => {
            Form::Cylinder { radius_mm: log(random, 6.0, 60.0), length_mm: random.between(10.0, 30.0), edge_radius_mm }
        }
        _ => Form::Flat { length_mm: random.between(10.0, 30.0), width_mm: random.between(6.0, 22.0), edge_radius_mm },
    };
    let (depth_mm, spacing_mm) = (log(random, 0.1, 1.0), log(random, 2.5, 12.0));
    let relief = if random.fraction() < SMOOTH_FRACTION {
        Relief::Smooth
    } else {
        match random.next_u64() % 4 {
            0 => Relief::Grooves { depth_mm, spacing_mm },
            1 => Relief::Rings { depth_mm, spacing_mm },
            2 => Relief::Windings { depth_mm, spacing_mm },
            _ => Relief::Bumps { depth_mm, spacing_mm },
        }
    };
    let gives = random.fraction() >= RIGID_FRACTION;
    let softness = gives.then(|| SoftObject {
        modulus_mpa: log(random, 0.05, 2.0),
        poisson_ratio: random.between(0.05, 0.42),
        thickness_mm: random.between(3.0, 12.0),
    });
    Object { name: RANDOM_SHAPE, form, relief, softness, note: "by chance", ..OBJECTS[0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_of_every_form_rigid_and_soft_and_none_is_an_object_with_a_name() {
        let shapes: Vec<Object> = (0..400).map(|number| random_shape(&mut Random::of(1, number))).collect();
        let share = |of: &dyn Fn(&Object) -> bool| shapes.iter().filter(|shape| of(shape)).count() as f64 / 400.0;
        for of in [
            &(|shape: &Object| matches!(shape.form, Form::Ball { .. })) as &dyn Fn(&Object) -> bool,
            &|shape: &Object| matches!(shape.form, Form::Cylinder { .. }),
            &|shape: &Object| matches!(shape.form, Form::Flat { .. }),
            &|shape: &Object| shape.relief == Relief::Smooth,
            &|shape: &Object| shape.softness.is_none(),
            &|shape: &Object| shape.softness.is_some_and(|soft| soft.modulus_mpa < 0.2),
        ] {
            assert!((0.15..0.6).contains(&share(of)), "{}", share(of));
        }
        let named = |shape: &Object| OBJECTS.iter().any(|object| object.form == shape.form);
        assert_eq!(share(&named), 0.0);
    }
}
