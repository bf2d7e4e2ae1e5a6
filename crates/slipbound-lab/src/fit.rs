//! Fits the tables behind stick ratio and margin (`slipbound::monitor`, step 5) and behind the verdict on gross slip to simulated trials.
//!
//! ```text
//!   training split (its own seeds) --World--> frames --SlipMonitor--> features              rows
//!                                     `---------------truth: f, phi, whether it slides ---> rows --boosting--> trees.txt
//! ```
//!
//! A table is judged on objects that it was not fitted to: [`left_out`] fits once for every object without it. The
//! errors found there are what the shipped estimates state.

mod boosting;
mod gross_rows;
mod row;
mod split;

pub use boosting::{Ensemble, Fitting, Loss};
pub use gross_rows::gross_rows_of;
pub use row::{Row, RowError, read_rows, write_rows};
pub use split::{TRAINING_SEED, rows_of, training_trial};

use slipbound::monitor::{FEATURES_COUNT, GEOMETRIC_COUNT};
use std::collections::BTreeSet;
use std::fmt::Write;

/// What an ensemble is fitted with.
pub const VALUES: Fitting =
    Fitting { loss: Loss::Squares, trees_count: 200, shrinkage: 0.1, least_rows: 40.0, ridge: 2.0 };

/// What the errors are fitted with.
pub const ERRORS: Fitting =
    Fitting { loss: Loss::Squares, trees_count: 30, shrinkage: 0.15, least_rows: 150.0, ridge: 5.0 };

/// What the verdict on gross slip is fitted with.
pub const GROSS: Fitting =
    Fitting { loss: Loss::Logistic, trees_count: 300, shrinkage: 0.1, least_rows: 3.0, ridge: 3.0 };

/// The features of a row as an estimate without grip force sees them.
fn alone(row: &Row) -> Row {
    let mut row = row.clone();
    row.features[GEOMETRIC_COUNT..FEATURES_COUNT].fill(0.0);
    row
}

/// What trees say of every row that were fitted without its object.
pub fn left_out<const N: usize>(rows: &[Row], targets: impl Fn(&Row) -> [f64; N], how: &Fitting) -> Vec<[f64; N]> {
    let objects: BTreeSet<&str> = rows.iter().map(|row| row.object.as_str()).collect();
    let mut estimates = vec![[0.0; N]; rows.len()];
    for object in objects {
        let (out, rest): (Vec<_>, Vec<_>) = (0..rows.len()).partition(|&at| rows[at].object == object);
        let training: Vec<Row> = rest.iter().map(|&at| rows[at].clone()).collect();
        let ensemble = Ensemble::fit(&training, &targets, how);
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
        let estimates = left_out(rows, |row| row.targets, &VALUES);
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

/// The table of the verdict on gross slip, as `slipbound` reads it, and the probabilities that trees without a row's object say, of the
/// rows with the grip force and of those without.
pub fn gross_table(rows: &[Vec<Row>; 2]) -> (String, [Vec<f64>; 2]) {
    let slides = |row: &Row| [row.targets[0]];
    let names = ["grip", "alone"];
    let text = names.iter().zip(rows).map(|(name, rows)| Ensemble::fit(rows, slides, &GROSS).written(name)).collect();
    let likely = |rows: &Vec<Row>| {
        let odds = left_out(rows, slides, &GROSS);
        odds.iter().map(|[odds]| 1.0 / (1.0 + (-odds).exp())).collect()
    };
    (text, [likely(&rows[0]), likely(&rows[1])])
}
