//! Generates the tables of boosted trees that the monitor ships, from the training split.
//!
//! `cargo run --release -p slipbound-lab --example fit_estimates -- ROWS.jsonl [--trials N] [--from N] [--only used,stick --keep OLD] [--table FILE]`:
//! `crates/slipbound/src/monitor/estimate/trees.txt`, behind stick ratio and margin. Simulates the first N trials
//! (default 600; those from `--from` on: files of rows can be joined) unless the file of rows exists, fits, writes the
//! table, and prints the accuracy of the trees on held-out objects. With `--only` the other trees are those of the
//! table OLD.
//! `... -- ROWS.jsonl --without FOLDER --keep OLD`: writes for every object in the rows FOLDER/OBJECT.txt, fitted
//! without it, with the stated errors of OLD, for `slipbound eval ramps --left-out`: all four targets. Targets that
//! `--only` leaves to OLD were fitted with the object; `alone_used` and `alone_stick` are used for `ours_frames`.
//! `... -- --gross ROWS.jsonl ...`: `crates/slipbound/src/monitor/gross/trees.txt`, behind the gross slip verdict, the
//! same way; the rows without grip force are in ROWS.jsonl.alone. Uses all cores; the result does not depend on their
//! number.

use slipbound::monitor::{FEATURES_COUNT, SLIDE_FEATURES_COUNT};
use slipbound_lab::eval::EvalError;
use slipbound_lab::fit::{
    LeftOut, RANDOM_SHAPE, Row, fitted, fitted_without, gross_rows_of, gross_table, kept, read_rows, rows_of,
    target_names, write_rows,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

fn simulate<T: Send>(from: u64, trials_count: u64, of: impl Fn(u64) -> Result<T, EvalError> + Sync) -> Vec<T> {
    let (next, found) = (AtomicU64::new(from), Mutex::new(Vec::new()));
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= trials_count {
                        break;
                    }
                    match of(number) {
                        Ok(rows) => found.lock().expect("no panic").push((number, rows)),
                        Err(error) => eprintln!("trial {number}: {error}"),
                    }
                    eprint!("\r{} of {trials_count}", number + 1);
                }
            });
        }
    });
    let mut found = found.into_inner().expect("no panic");
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, rows)| rows).collect()
}

/// Mean error and stated error, by the estimated value. `of` converts a target to a fraction.
fn errors(name: &str, held_out: &[LeftOut], of: impl Fn(f64) -> f64) {
    for (from, to) in [(-1.0, 9.0), (-1.0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 9.0)] {
        let (mut weights, mut bias, mut error, mut stated) = (0.0, 0.0, 0.0, 0.0);
        for LeftOut { row, prediction, error: own } in held_out {
            if (from..to).contains(&of(*prediction)) {
                let off = of(*prediction) - of(row.targets[0]);
                (weights, bias, error) = (weights + 1.0, bias + off, error + off.abs());
                stated += (of(prediction + own) - of(prediction - own)) / 2.0;
            }
        }
        println!(
            "{name}, {from} to {to} said: {weights} frames, mean error {:.3} ({:+.3}), stated {:.3}",
            error / weights,
            bias / weights,
            stated / weights
        );
    }
}

/// For named objects, by trees fitted without each of them: trials with a false report, and sliding trials with a
/// report by their third frame of sliding, by the probability threshold, in one frame or in two in a row.
fn verdicts(name: &str, rows: &[Row], likely: &[f64]) {
    let trials: Vec<Vec<(&Row, f64)>> = rows
        .iter()
        .zip(likely.iter().copied())
        .filter(|(row, _)| row.object != RANDOM_SHAPE)
        .collect::<Vec<_>>()
        .chunk_by(|(a, _), (b, _)| a.trial == b.trial)
        .map(<[_]>::to_vec)
        .collect();
    for (least, in_a_row) in
        [0.5, 0.7, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.99].into_iter().flat_map(|least| [(least, 1), (least, 2)])
    {
        let said = |trial: &[(&Row, f64)], from: usize, to: usize| {
            (from..to).any(|n| n + 1 >= in_a_row && (n + 1 - in_a_row..=n).all(|n| trial[n].1 >= least))
        };
        let (mut falsely, mut slides, mut soon) = (0, 0, 0);
        for trial in &trials {
            let began = trial.iter().position(|(row, _)| row.targets[0] == 1.0);
            falsely += u32::from(said(trial, 0, began.unwrap_or(trial.len())));
            if let Some(began) = began {
                slides += 1;
                soon += u32::from(said(trial, 0, (began + 3).min(trial.len())));
            }
        }
        println!(
            "{name}: said from {least:.3} in {in_a_row}: false in {falsely} of {} trials, within 2 frames in {soon} of {slides} ({:.1} %)",
            trials.len(),
            100.0 * f64::from(soon) / f64::from(slides)
        );
    }
}

/// The trees of all targets, new ones or those of another table.
fn table(mut new: impl FnMut(&str) -> Option<String>, old: &str) -> Result<String, String> {
    let of = |name| {
        let trees = new(name).or_else(|| kept(old, name));
        trees.ok_or_else(|| format!("--keep: expected a table with the trees of {name}"))
    };
    target_names().into_iter().map(of).collect()
}

/// A table for each object, fitted to the rows of all others; stated errors remain those of the old one.
fn without_each(rows: &[Row], only: &[&str], old: &str, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let objects: BTreeSet<&str> = rows.iter().map(|row| row.object.as_str()).collect();
    for object in objects {
        let new = |name: &str| only.contains(&name).then(|| fitted_without(rows, object, name, old)).flatten();
        std::fs::write(folder.join(format!("{object}.txt")), table(new, old)?)?;
        println!("without {object}");
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let gross = arguments.first().is_some_and(|first| first == "--gross");
    arguments.drain(..usize::from(gross));
    let option = |name: &str| arguments.iter().position(|a| a == name).and_then(|at| arguments.get(at + 1));
    let name = arguments.first().ok_or("expected a file for the rows")?;
    let trials_count = option("--trials").map_or(Ok(600), |count| count.parse())?;
    let from = option("--from").map_or(Ok(0), |from| from.parse())?;
    let path = Path::new(name);
    let text = if gross {
        let without = format!("{name}.alone");
        let rows = if path.exists() {
            [read_rows(path, SLIDE_FEATURES_COUNT)?, read_rows(Path::new(&without), SLIDE_FEATURES_COUNT)?]
        } else {
            let (with, alone): (Vec<_>, Vec<_>) =
                simulate(from, trials_count, gross_rows_of).into_iter().map(Into::into).unzip();
            let rows = [with.concat(), alone.concat()];
            write_rows(path, &rows[0])?;
            write_rows(Path::new(&without), &rows[1])?;
            rows
        };
        let (text, likely) = gross_table(&rows);
        println!("{} rows", rows[0].len());
        verdicts("with grip force", &rows[0], &likely[0]);
        verdicts("from the picture alone", &rows[1], &likely[1]);
        text
    } else {
        let rows = if path.exists() {
            read_rows(path, FEATURES_COUNT)?
        } else {
            let rows = simulate(from, trials_count, rows_of).concat();
            write_rows(path, &rows)?;
            rows
        };
        let only = option("--only").map_or(target_names().to_vec(), |names| names.split(',').collect());
        if let Some(name) = only.iter().find(|name| !target_names().contains(name)) {
            return Err(format!("--only: expected some of {}, got {name}", target_names().join(",")).into());
        }
        let old = option("--keep").map_or(Ok(String::new()), std::fs::read_to_string)?;
        if let Some(folder) = option("--without") {
            return without_each(&rows, &only, &old, Path::new(folder));
        }
        println!("{} rows; of objects left out:", rows.len());
        let mut fitted = fitted(&rows, &only);
        for (name, _, held_out) in &fitted {
            // The target is a logarithm if the grip force is known.
            errors(name, held_out, if *name == "used" { libm::exp } else { |value| value });
        }
        let of = |name: &str| {
            fitted.iter_mut().find(|(fitted, ..)| *fitted == name).map(|(_, text, _)| std::mem::take(text))
        };
        table(of, &old)?
    };
    if let Some(to) = option("--table") {
        std::fs::write(to, text)?;
    }
    Ok(())
}
