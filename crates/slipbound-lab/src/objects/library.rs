//! The entries.

use super::form::Form;
use super::object::Object;
use super::relief::Relief;
use crate::layer::SoftObject;
use slipbound::setting::SettingError;

const PLAIN: Object = Object {
    name: "",
    form: Form::Ball { radius_mm: 15.0 },
    relief: Relief::Smooth,
    softness: None,
    mu: 0.8,
    mass_kg: 0.1,
    gyration_radius_mm: 30.0,
    texture: "smooth",
    note: "",
};

/// The ten objects of the paper in its order, then the cap of its bottle experiments. All numbers are estimates.
pub const OBJECTS: [Object; 11] = [
    Object {
        name: "tape_roll",
        form: Form::Cylinder { radius_mm: 45.0, length_mm: 24.0, edge_radius_mm: 1.0 },
        mu: 0.9,
        mass_kg: 0.12,
        gyration_radius_mm: 50.0,
        texture: "smooth, tacky",
        note: "a 24 mm wide roll held at its rim",
        ..PLAIN
    },
    Object {
        name: "crayons_box",
        form: Form::Flat { length_mm: 30.0, width_mm: 22.0, edge_radius_mm: 1.0 },
        mu: 0.52,
        mass_kg: 0.10,
        gyration_radius_mm: 35.0,
        texture: "smooth print",
        note: "CUT DOWN from 60 x 40, which covers the pad; the sag of its panel is left out",
        ..PLAIN
    },
    Object {
        name: "scissors",
        form: Form::Flat { length_mm: 24.0, width_mm: 8.0, edge_radius_mm: 2.0 },
        mu: 0.65,
        mass_kg: 0.08,
        gyration_radius_mm: 60.0,
        note: "one handle: a small, strong contact",
        ..PLAIN
    },
    Object {
        name: "water_bottle",
        form: Form::Cylinder { radius_mm: 32.0, length_mm: 28.0, edge_radius_mm: 1.0 },
        relief: Relief::Rings { depth_mm: 0.2, spacing_mm: 9.0 },
        softness: Some(SoftObject { modulus_mpa: 0.8, poisson_ratio: 0.3, thickness_mm: 4.0 }),
        mu: 0.6,
        mass_kg: 0.05,
        gyration_radius_mm: 60.0,
        texture: "smooth ribs",
        note: "empty; its thin wall stands as a soft layer, which gives in shear too, so it is taken stiffer than a wall",
    },
    Object {
        name: "super_glue",
        form: Form::Cylinder { radius_mm: 9.0, length_mm: 28.0, edge_radius_mm: 1.0 },
        mu: 0.65,
        mass_kg: 0.03,
        texture: "label edge",
        note: "CUT DOWN from 40 mm, which reaches past the pad; without the edge of its label",
        ..PLAIN
    },
    Object {
        name: "brain_foam",
        form: Form::Ball { radius_mm: 35.0 },
        relief: Relief::Windings { depth_mm: 1.0, spacing_mm: 6.0 },
        softness: Some(SoftObject { modulus_mpa: 0.1, poisson_ratio: 0.3, thickness_mm: 10.0 }),
        mu: 1.0,
        mass_kg: 0.03,
        texture: "bumpy",
        note: "softer than the gel: it strains far beyond the linear range",
        ..PLAIN
    },
    Object {
        name: "toy_duck",
        form: Form::Ball { radius_mm: 20.0 },
        softness: Some(SoftObject { modulus_mpa: 0.8, poisson_ratio: 0.4, thickness_mm: 6.0 }),
        mu: 0.85,
        mass_kg: 0.05,
        texture: "smooth PVC",
        note: "a hollow body as a soft layer",
        ..PLAIN
    },
    Object {
        name: "screwdriver",
        form: Form::Cylinder { radius_mm: 13.0, length_mm: 30.0, edge_radius_mm: 1.0 },
        relief: Relief::Grooves { depth_mm: 0.8, spacing_mm: std::f64::consts::TAU * 13.0 / 6.0 },
        mu: 0.8,
        mass_kg: 0.10,
        gyration_radius_mm: 60.0,
        texture: "six flutes",
        note: "its handle, a ridge towards the pad",
        ..PLAIN
    },
    Object {
        name: "scrub_sponge",
        form: Form::Flat { length_mm: 30.0, width_mm: 22.0, edge_radius_mm: 1.0 },
        relief: Relief::Bumps { depth_mm: 0.3, spacing_mm: 3.0 },
        softness: Some(SoftObject { modulus_mpa: 0.06, poisson_ratio: 0.1, thickness_mm: 5.0 }),
        mu: 0.7,
        mass_kg: 0.01,
        texture: "rough side",
        note: "CUT DOWN to the pad; far softer than the gel: it strains beyond the linear range from a few N",
        ..PLAIN
    },
    Object {
        name: "blue_tube",
        form: Form::Cylinder { radius_mm: 10.0, length_mm: 28.0, edge_radius_mm: 1.0 },
        mu: 0.7,
        mass_kg: 0.08,
        gyration_radius_mm: 50.0,
        note: "a piece of a longer tube",
        ..PLAIN
    },
    Object {
        name: "bottle_cap",
        form: Form::Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 0.5 },
        relief: Relief::Grooves { depth_mm: 0.15, spacing_mm: std::f64::consts::TAU * 14.0 / 60.0 },
        mu: 0.75,
        mass_kg: 0.003,
        gyration_radius_mm: 10.0,
        texture: "knurl",
        note: "28 mm; every second of its 120 knurls: 0.73 mm would be finer than two cells of the grid",
        ..PLAIN
    },
];

impl Object {
    /// The object of a name; the error lists the names.
    pub fn named(name: &str) -> Result<&'static Object, SettingError> {
        OBJECTS
            .iter()
            .find(|object| object.name == name)
            .ok_or_else(|| SettingError::none_of("object", name, &OBJECTS.map(|object| object.name)))
    }
}
