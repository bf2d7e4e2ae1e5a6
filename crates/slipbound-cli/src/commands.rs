//! One file a command.

pub mod calibrate;
mod scenes;
mod sensors;
pub mod simulate;
pub mod watch;

use crate::args::{Args, Command};
use crate::outcome::{Failure, Outcome};

/// Runs the command asked for.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    match &args.command {
        Command::Watch(watch) => watch.run(),
        Command::Calibrate(calibrate) => calibrate.run(),
        Command::Sensors => sensors::run(),
        Command::Simulate(simulate) => simulate.run(),
        Command::Scenes => scenes::run(),
    }
}
