//! The validation table, asserted: `cargo run --release -p slipbound-lab --example validate` prints the same rows, as
//! does docs/simulator.md, which `REGENERATE=1` rewrites.

use slipbound_lab::validation::{CASES, Row, TABLE_HEAD, rows};
use std::sync::OnceLock;

/// The rows of a case, computed once for all tests.
fn rows_of(name: &str) -> &'static [Row] {
    static ROWS: [OnceLock<Vec<Row>>; CASES.len()] = [const { OnceLock::new() }; CASES.len()];
    let number = CASES.iter().position(|(known, _)| *known == name).expect("a case of the table");
    ROWS[number].get_or_init(|| rows(name).expect("a case of the table"))
}

fn holds(name: &str) {
    let rows = rows_of(name);
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
fn the_page_of_the_simulator_shows_this_table_to_the_last_digit() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/simulator.md");
    let page = std::fs::read_to_string(path).expect("the page");
    let lines = CASES.iter().flat_map(|(name, _)| rows_of(name)).map(|row| format!("{row}\n"));
    let table = format!("{TABLE_HEAD}\n{}", lines.collect::<String>());
    let from = page.find(TABLE_HEAD).expect("a table on the page");
    let until = page[from..].find("\n\n").map_or(page.len(), |at| from + at + 1);
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(path, format!("{}{table}{}", &page[..from], &page[until..])).expect("written");
        return;
    }
    let (shown, made): (Vec<_>, Vec<_>) = (page[from..until].lines().collect(), table.lines().collect());
    let moved: Vec<_> = made.iter().filter(|line| !shown.contains(line)).collect();
    assert!(moved.is_empty(), "not on the page: {moved:#?}");
    assert_eq!(shown, made, "other lines, or in another order");
}

#[test]
fn a_row_that_is_not_a_number_does_not_hold() {
    let mut row = rows_of("hertz")[0].clone();
    assert!(row.holds());
    row.error_fraction = f64::NAN;
    assert!(!row.holds());
}
