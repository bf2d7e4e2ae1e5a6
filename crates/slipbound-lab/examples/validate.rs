//! Prints the validation table of docs/simulator.md. Names of cases as arguments select cases.

use slipbound_lab::validation::{CASES, TABLE_HEAD};
use std::process::ExitCode;

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    println!("{TABLE_HEAD}");
    let mut failed = 0;
    for (name, case) in CASES.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        let begun = std::time::Instant::now();
        for row in case() {
            println!("{row}");
            failed += u32::from(!row.holds());
        }
        eprintln!("{name}: {:.1} s", begun.elapsed().as_secs_f64());
    }
    ExitCode::from(u8::from(failed > 0))
}
