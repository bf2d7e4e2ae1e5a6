//! Fits the tables behind stick ratio and margin (`slipbound::monitor`, step 6) and behind the gross slip verdict to
//! simulated trials.
//!
//! ```text
//!   training split (its own seeds) --World--> frames --SlipMonitor--> features              rows
//!                                     `---------------truth: f, phi, whether it slides ---> rows --boosting--> trees.txt
//! ```
//!
//! A table is evaluated on held-out objects: [`left_out`] fits once for every object without that object. The errors
//! found there are the stated errors of the shipped estimates.

mod boosting;
mod gross_rows;
mod random_shapes;
mod row;
mod split;

pub use boosting::{Ensemble, Fitting, Loss};
pub use gross_rows::gross_rows_of;
pub use random_shapes::RANDOM_SHAPE;
pub use row::{Row, RowError, read_rows, write_rows};
pub use split::{TRAINING_SEED, rows_of, training_trial};

use slipbound::monitor::{FEATURES_COUNT, GEOMETRIC_COUNT};
use std::collections::BTreeSet;

/// How an ensemble of values is fitted.
pub const VALUES: Fitting =
    Fitting { loss: Loss::Squares, trees_count: 200, depth: 6, shrinkage: 0.1, least_rows: 100.0, ridge: 5.0 };

/// How the errors are fitted.
pub const ERRORS: Fitting =
    Fitting { loss: Loss::Squares, trees_count: 30, depth: 3, shrinkage: 0.15, least_rows: 150.0, ridge: 5.0 };

/// How the gross slip verdict is fitted.
pub const GROSS: Fitting =
    Fitting { loss: Loss::Logistic, trees_count: 300, depth: 6, shrinkage: 0.1, least_rows: 30.0, ridge: 3.0 };

/// Index of the load in the features: the first feature that needs the grip force.
const LOAD: usize = GEOMETRIC_COUNT;
/// Index of `moving`. Whether a load still grows tells trees how much of a ramp to gross slip remains. A bottle that fills
/// for ten seconds is no such ramp.
const MOVING: usize = 19;

/// Least load feature and used fraction of a training frame: a frame with hardly any load contains no information on
/// the friction.
const LEAST_LOAD: f64 = 0.02;
const LEAST_USED: f64 = 0.02;

/// Friction at which the weight of a row is unchanged.
const MIDDLE_MU: f64 = 0.5;

/// Target: the logarithm of the used fraction; None without load. A ramp to gross slip passes a given load faster at
/// higher friction, so that most frames with that load would be of slippery contacts: the weights compensate for that.
fn used(row: &Row) -> Option<Row> {
    let [used, _] = row.targets;
    let pulls = row.features[LOAD] > LEAST_LOAD && used > LEAST_USED;
    let mut row = Row { weight: row.weight * row.mu / MIDDLE_MU, targets: [libm::log(used), 0.0], ..row.clone() };
    row.features[MOVING] = 0.0;
    pulls.then_some(row)
}

/// Target: the stick ratio.
fn stick(row: &Row) -> Option<Row> {
    Some(Row { targets: [row.targets[1], 0.0], ..row.clone() })
}

/// A row for an estimate without grip force. Target: the used fraction.
fn alone_used(row: &Row) -> Option<Row> {
    let mut row = row.clone();
    row.features[GEOMETRIC_COUNT..FEATURES_COUNT].fill(0.0);
    Some(row)
}

/// The same. Target: the stick ratio.
fn alone_stick(row: &Row) -> Option<Row> {
    alone_used(row).as_ref().and_then(stick)
}

/// The ensembles of the table by name, each with the function from a row to the row whose first target it fits.
type Target = (&'static str, fn(&Row) -> Option<Row>);
const TARGETS: [Target; 4] =
    [("used", used), ("stick", stick), ("alone_used", alone_used), ("alone_stick", alone_stick)];

/// Predictions for every row by trees fitted without the row's object.
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

/// The prediction for a row by trees fitted without its object, with the stated error.
#[derive(Debug, Clone)]
pub struct LeftOut {
    /// The row; its first target is the true value.
    pub row: Row,
    /// The prediction.
    pub prediction: f64,
    /// The stated mean error.
    pub error: f64,
}

fn fit_with_errors(name: &str, rows: &[Row]) -> (String, Vec<LeftOut>) {
    let target = |row: &Row| [row.targets[0]];
    let predictions = left_out(rows, target, &VALUES);
    let off = |(row, [prediction]): (&Row, &[f64; 1])| Row {
        targets: [(row.targets[0] - prediction).abs(), 0.0],
        ..row.clone()
    };
    let errors: Vec<Row> = rows.iter().zip(&predictions).map(off).collect();
    let stated = left_out(&errors, target, &ERRORS);
    let [values, errors] = [Ensemble::fit(rows, target, &VALUES), Ensemble::fit(&errors, target, &ERRORS)];
    let held_out =
        |((row, [prediction]), [error]): ((&Row, [f64; 1]), [f64; 1])| LeftOut { row: row.clone(), prediction, error };
    let held_out = rows.iter().zip(predictions).zip(stated).map(held_out).collect();
    (values.written(name) + &errors.written(&format!("{name}_error")), held_out)
}

/// Names of the targets: the logarithm of the used fraction, the stick ratio, and used fraction and stick ratio without
/// the grip force.
pub fn target_names() -> [&'static str; 4] {
    TARGETS.map(|(name, _)| name)
}

/// The trees of some targets with their errors, in the format that `slipbound` reads, and their held-out predictions.
pub fn fitted(rows: &[Row], names: &[&str]) -> Vec<(&'static str, String, Vec<LeftOut>)> {
    let chosen = TARGETS.into_iter().filter(|(name, _)| names.contains(name));
    std::thread::scope(|scope| {
        let threads = chosen.map(|(name, target)| {
            let rows: Vec<Row> = rows.iter().filter_map(target).collect();
            (name, scope.spawn(move || fit_with_errors(name, &rows)))
        });
        let threads: Vec<_> = threads.collect();
        // A panic of a thread ends this thread too.
        let fits = threads.into_iter().map(|(name, thread)| (name, thread.join().expect("no panic")));
        fits.map(|(name, (text, held_out))| (name, text, held_out)).collect()
    })
}

/// The trees of a target fitted to the rows of all objects but one, with the stated errors of `old`. None if there is
/// no such target, or if `old` has no errors for it.
pub fn fitted_without(rows: &[Row], object: &str, name: &str, old: &str) -> Option<String> {
    let (_, target) = TARGETS.into_iter().find(|(known, _)| *known == name)?;
    let others: Vec<Row> = rows.iter().filter(|row| row.object != object).filter_map(target).collect();
    let trees = Ensemble::fit(&others, |row| [row.targets[0]], &VALUES).written(name);
    Some(trees + &section(old, &[&format!("{name}_error")])?)
}

/// The trees of a target and of its error in a table, unchanged; None if the table has none.
pub fn kept(table: &str, name: &str) -> Option<String> {
    section(table, &[name, &format!("{name}_error")])
}

/// The lines of some ensembles in a table.
fn section(table: &str, names: &[&str]) -> Option<String> {
    let own: Vec<String> = names.iter().map(|name| format!("ensemble {name} ")).collect();
    let mut text = String::new();
    let mut is_own = false;
    for line in table.lines() {
        if line.starts_with("ensemble ") {
            is_own = own.iter().any(|own| line.starts_with(own.as_str()));
        }
        if is_own {
            text += line;
            text.push('\n');
        }
    }
    (!text.is_empty()).then_some(text)
}

/// The table of the gross slip verdict, in the format that `slipbound` reads, and the held-out probabilities of the
/// rows with the grip force and of those without.
pub fn gross_table(rows: &[Vec<Row>; 2]) -> (String, [Vec<f64>; 2]) {
    let slides = |row: &Row| [row.targets[0]];
    let names = ["grip", "alone"];
    let text = names.iter().zip(rows).map(|(name, rows)| Ensemble::fit(rows, slides, &GROSS).written(name)).collect();
    let likely = |rows: &Vec<Row>| {
        let odds = left_out(rows, slides, &GROSS);
        odds.iter().map(|[odds]| 1.0 / (1.0 + libm::exp(-odds))).collect()
    };
    (text, [likely(&rows[0]), likely(&rows[1])])
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::monitor::FEATURE_NAMES;

    fn row(mu: f64, used: f64, moving: f64) -> Row {
        let mut features = [0.5; FEATURES_COUNT];
        (features[LOAD], features[MOVING]) = (mu * used / 0.6, moving);
        Row::new(0, "ball", 1.0, mu, [used, 0.7], &features)
    }

    #[test]
    fn features_are_where_they_are_meant() {
        assert_eq!((FEATURE_NAMES[LOAD], FEATURE_NAMES[MOVING]), ("load", "moving"));
    }

    /// Ramps to gross slip with friction coefficients from 0.2 to 1.3, evenly spaced in the logarithm.
    #[test]
    fn at_a_given_load_the_friction_is_even_by_its_logarithm() {
        let mus = (0..400).map(|i| 0.2 * libm::pow(1.3 / 0.2, (f64::from(i) + 0.5) / 400.0));
        let ramps = mus.flat_map(|mu| (1..=200).map(move |step| row(mu, f64::from(step) / 200.0, 0.1)));
        let fitted_rows: Vec<Row> = ramps.filter_map(|row| used(&row)).collect();
        let (mut weights, mut logs, mut plain, mut count) = (0.0, 0.0, 0.0, 0.0);
        for row in fitted_rows.iter().filter(|row| (0.14..0.16).contains(&row.features[LOAD])) {
            let log_mu = libm::log(0.6 * row.features[LOAD] / libm::exp(row.targets[0]));
            (weights, logs) = (weights + row.weight, logs + row.weight * log_mu);
            (plain, count) = (plain + log_mu, count + 1.0);
        }
        assert!((logs / weights + 0.673).abs() < 0.02, "{}", logs / weights);
        assert!(plain / count < -0.9, "without weights the slippery ones prevail: {}", plain / count);
    }

    #[test]
    fn trees_of_a_table_are_kept_to_the_letter() {
        let table = "# made\nensemble used 1\n1:2 3 4\nensemble used_error 5\n6:7 8 9\nensemble used_up 1\nensemble alone_used 2\n1:1 1 1\n";
        assert_eq!(kept(table, "used").expect("there"), "ensemble used 1\n1:2 3 4\nensemble used_error 5\n6:7 8 9\n");
        assert_eq!(kept(table, "alone_used").expect("there"), "ensemble alone_used 2\n1:1 1 1\n");
        assert_eq!(kept(table, "stick"), None);
    }

    #[test]
    fn a_target_hides_what_it_is_not_to_rest_on() {
        assert!(used(&row(0.5, 0.01, 0.1)).is_none() && used(&row(0.5, 0.6, 0.1)).is_some(), "nothing pulls");
        let fast = used(&row(0.5, 0.6, 0.4)).expect("a row");
        assert_eq!(fast, used(&row(0.5, 0.6, 0.01)).expect("a row"), "the pace of a load");
        assert!((fast.targets[0] - libm::log(0.6)).abs() < 1e-12);
        let without = alone_used(&row(0.5, 0.6, 0.4)).expect("a row");
        assert_eq!(without.features[GEOMETRIC_COUNT..], [0.0; FEATURES_COUNT - GEOMETRIC_COUNT]);
        assert_eq!((without.targets[0], without.features[MOVING]), (0.6, 0.4));
        let rows = [stick(&row(0.5, 0.6, 0.4)), alone_stick(&row(0.5, 0.6, 0.4))].map(|row| row.expect("a row"));
        assert_eq!(rows.map(|row| row.targets[0]), [0.7, 0.7]);
    }
}
