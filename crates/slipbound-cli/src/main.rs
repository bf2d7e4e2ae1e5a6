//! The command `slipbound`.

mod args;
mod chronicle;
mod closed_loop;
mod commands;
mod fitting;
mod frames;
mod interruption;
mod live;
mod loopback;
mod measures;
mod outcome;
mod simulated;
mod spoiled;
mod terminal;
mod through;

use clap::Parser;
use outcome::{Failure, Outcome};
use std::process::ExitCode;

/// Does what the arguments ask and says in one number how it went. Nothing else in the house makes an exit code.
fn main() -> ExitCode {
    match commands::run(&args::Args::parse()) {
        Ok(Outcome::Done) | Err(Failure::ReaderLeft) => ExitCode::SUCCESS,
        Ok(Outcome::DataLost) => ExitCode::from(3),
        Err(Failure::Work(e)) => terminal::complain(&e, ExitCode::from(1)),
        Err(Failure::Arguments(e)) => terminal::complain(&e, ExitCode::from(2)),
    }
}
