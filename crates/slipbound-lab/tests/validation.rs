//! The validation table, asserted: `cargo run --release -p slipbound-lab --example validate` prints the same rows.

use slipbound_lab::validation::{CASES, rows};

fn holds(name: &str) {
    let rows = rows(name).expect("a case of the table");
    assert!(!rows.is_empty());
    let failed: Vec<String> = rows.iter().filter(|row| !row.holds()).map(ToString::to_string).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

macro_rules! cases {
    ($($name:ident),*) => {
        $(#[test] fn $name() { holds(stringify!($name)); })*

        #[test]
        fn every_case_is_tested() {
            let tested = [$(stringify!($name)),*];
            assert_eq!(tested.to_vec(), CASES.map(|(name, _)| name).to_vec());
        }
    };
}

cases!(
    compliance,
    hertz,
    cattaneo_mindlin,
    torsion,
    sphere_on_layer,
    friction_bound,
    friction_work,
    filling_bottle,
    grid_convergence,
    energy_cycle,
    sliding_heat,
    inclined_face,
    shear_rate,
    free_rotation,
    gross_load
);

#[test]
fn a_row_that_is_not_a_number_does_not_hold() {
    let mut row = rows("hertz").expect("a case").remove(0);
    assert!(row.holds());
    row.error_fraction = f64::NAN;
    assert!(!row.holds());
}
