//! Makes `crates/slipbound/src/monitor/estimate/trees.txt`, the table behind stick ratio and margin, from the training split.
//!
//! `cargo run --release -p slipbound-lab --example fit_estimates -- ROWS.jsonl [--trials N] [--table FILE]`: simulates the
//! first N trials (default 600) unless the file of rows is there already, fits, writes the table, and prints how well the
//! trees do on objects they were not fitted to. All cores; the result does not depend on their number.

use slipbound_lab::fit::{Row, read_rows, rows_of, table, write_rows};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

fn simulate(trials_count: u64) -> Vec<Row> {
    let (next, found) = (AtomicU64::new(0), Mutex::new(Vec::new()));
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= trials_count {
                        break;
                    }
                    match rows_of(number) {
                        Ok(rows) => found.lock().expect("no panic").extend(rows),
                        Err(error) => eprintln!("trial {number}: {error}"),
                    }
                    eprint!("\r{} of {trials_count}", number + 1);
                }
            });
        }
    });
    let mut rows = found.into_inner().expect("no panic");
    // Within a trial the order is that of time.
    rows.sort_by_key(|row: &Row| row.trial);
    rows
}

fn errors(name: &str, rows: &[Row], estimates: &[[f64; 2]]) {
    let mean = |of: &dyn Fn(&Row, &[f64; 2]) -> f64| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (row, said) in rows.iter().zip(estimates).filter(|(row, _)| row.weight == 1.0 && row.targets[0] < 1.0) {
            (sum, count) = (sum + of(row, said), count + 1.0);
        }
        sum / count
    };
    println!(
        "{name}: ramps before gross slip, objects left out: mean error of f {:.3} ({:+.3}), of phi {:.3} ({:+.3})",
        mean(&|row, said| (said[0] - row.targets[0]).abs()),
        mean(&|row, said| said[0] - row.targets[0]),
        mean(&|row, said| (said[1] - row.targets[1]).abs()),
        mean(&|row, said| said[1] - row.targets[1]),
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| arguments.iter().position(|a| a == name).and_then(|at| arguments.get(at + 1));
    let path = arguments.first().ok_or("expected a file for the rows")?;
    let path = Path::new(path);
    let rows = if path.exists() {
        read_rows(path)?
    } else {
        let rows = simulate(option("--trials").map_or(Ok(600), |count| count.parse())?);
        write_rows(path, &rows)?;
        rows
    };
    let (text, with_grip, alone) = table(&rows);
    println!("{} rows", rows.len());
    errors("with grip force and stiffness", &rows, &with_grip);
    errors("from the picture alone", &rows, &alone);
    if let Some(to) = option("--table") {
        std::fs::write(to, text)?;
    }
    Ok(())
}
