//! Fits the table behind stick ratio and margin (`slipbound::monitor`, step 5) to simulated trials.
//!
//! ```text
//!   training split (its own seeds) --World--> frames --SlipMonitor--> features      rows
//!                                     `--------------------truth f, phi ----------> rows --boosting--> trees.txt
//! ```
//!
//! The table is judged on objects that it was not fitted to: [`left_out`] fits once for every object without it. The
//! errors found there are what the shipped estimates state.

mod boosting;
mod row;
mod split;

pub use boosting::{Ensemble, Fitting};
pub use row::{Row, RowError, read_rows, write_rows};
pub use split::{TRAINING_SEED, rows_of, training_trial};

use slipbound::monitor::{FEATURES_COUNT, GEOMETRIC_COUNT};
use std::collections::BTreeSet;
use std::fmt::Write;

/// What an ensemble is fitted with.
pub const VALUES: Fitting = Fitting { trees_count: 200, shrinkage: 0.1, least_rows: 40.0, ridge: 2.0 };

/// What the errors are fitted with.
pub const ERRORS: Fitting = Fitting { trees_count: 30, shrinkage: 0.15, least_rows: 150.0, ridge: 5.0 };

/// The features of a row as an estimate without grip force sees them.
fn alone(row: &Row) -> Row {
    let mut row = row.clone();
    row.features[GEOMETRIC_COUNT..FEATURES_COUNT].fill(0.0);
    row
}

/// Estimates of every row by trees that were fitted without its object.
pub fn left_out(rows: &[Row]) -> Vec<[f64; 2]> {
    let objects: BTreeSet<&str> = rows.iter().map(|row| row.object.as_str()).collect();
    let mut estimates = vec![[0.0; 2]; rows.len()];
    for object in objects {
        let (out, rest): (Vec<_>, Vec<_>) = (0..rows.len()).partition(|&at| rows[at].object == object);
        let training: Vec<Row> = rest.iter().map(|&at| rows[at].clone()).collect();
        let ensemble = Ensemble::fit(&training, |row| row.targets, &VALUES);
        for at in out {
            estimates[at] = ensemble.at(&rows[at].features);
        }
    }
    estimates
}

/// The whole table, as `slipbound` reads it, and the left-out estimates with and without grip force.
pub fn table(rows: &[Row]) -> (String, Vec<[f64; 2]>, Vec<[f64; 2]>) {
    let bare: Vec<Row> = rows.iter().map(alone).collect();
    let mut text = String::new();
    let mut fit = |name: &str, rows: &[Row]| {
        let estimates = left_out(rows);
        let errors: Vec<Row> = rows
            .iter()
            .zip(&estimates)
            .map(|(row, said)| Row {
                targets: [(row.targets[0] - said[0]).abs(), (row.targets[1] - said[1]).abs()],
                ..row.clone()
            })
            .collect();
        let values = Ensemble::fit(rows, |row| row.targets, &VALUES);
        let errors = Ensemble::fit(&errors, |row| row.targets, &ERRORS);
        // Writing to a string cannot fail.
        let _ = write!(text, "{}{}", values.written(name), errors.written(&format!("{name}_error")));
        estimates
    };
    let with_grip = fit("grip", rows);
    let without = fit("alone", &bare);
    (text, with_grip, without)
}
