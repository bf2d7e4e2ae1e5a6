//! The finger against exact solutions: one list of cases, printed by `examples/validate.rs` and asserted by
//! `tests/validation.rs`.

mod bonded;
mod bottle;
mod convergence;
mod energy;
mod exact;
mod gross;
mod half_space;
mod motion;
mod row;
mod steps;
mod transfer;

pub use row::Row;

/// The head of the table whose lines [`Row`] prints.
pub const TABLE_HEAD: &str = "| case | theory | measured | error | tolerance | verdict |\n|---|---|---|---|---|---|";

/// A part of the table.
pub type Case = fn() -> Vec<Row>;

/// All cases, by name, in the order of the table.
pub const CASES: [(&str, Case); 15] = [
    ("compliance", transfer::compliance),
    ("hertz", half_space::hertz),
    ("cattaneo_mindlin", half_space::cattaneo_mindlin),
    ("torsion", half_space::torsion),
    ("sphere_on_layer", bonded::sphere_on_layer),
    ("friction_bound", steps::friction_bound),
    ("friction_work", steps::friction_work),
    ("filling_bottle", bottle::filling_bottle),
    ("grid_convergence", convergence::grid_convergence),
    ("energy_cycle", energy::energy_cycle),
    ("sliding_heat", energy::sliding_heat),
    ("inclined_face", energy::inclined_face),
    ("shear_rate", motion::shear_rate),
    ("free_rotation", motion::free_rotation),
    ("gross_load", gross::gross_load),
];

/// The rows of a case by its name; None for a name that is not in [`CASES`].
pub fn rows(name: &str) -> Option<Vec<Row>> {
    CASES.iter().find(|(known, _)| *known == name).map(|(_, case)| case())
}
