//! One file per command.

pub mod calibrate;
pub mod convert;
pub mod demo;
pub mod devices;
pub mod doctor;
pub mod emulate;
pub mod eval;
mod finger;
pub mod gripper;
mod hand_rest;
mod inputs;
pub mod latency;
mod marker_noise;
pub mod paper;
pub mod record;
mod recording;
pub mod replay;
mod rest_window;
pub mod run;
mod run_recording;
mod scenes;
mod sensors;
pub mod settings;
pub mod shell;
pub mod simulate;
pub mod tare;
pub mod trials;
pub mod watch;

use crate::args::{Args, Command};
use crate::help;
use crate::outcome::{Failure, Outcome};
use clap::CommandFactory;

/// Runs the requested command.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    match &args.command {
        Command::Demo(demo) => demo.run(),
        Command::Devices(devices) => devices.run(),
        Command::Doctor(doctor) => doctor.run(),
        Command::Record(record) => record.run(),
        Command::Convert(convert) => convert.run(),
        Command::Replay(replay) => replay.run(),
        Command::Trials(trials) => trials.run(),
        Command::Eval(eval) => eval.run(),
        Command::Paper(paper) => paper.run(),
        Command::Watch(watch) => watch.run(),
        Command::Calibrate(calibrate) => calibrate.run(),
        Command::Tare(tare) => tare.run(),
        Command::Sensors { name } => sensors::run(name.as_deref()),
        Command::Settings { which } => settings::run(*which),
        Command::Simulate(simulate) => simulate.run(),
        Command::Scenes { name } => scenes::run(name.as_deref()),
        Command::Run(task) => task.run(),
        Command::Hold(hold) => hold.run(),
        Command::Gripper(gripper) => gripper.run(),
        Command::Latency(latency) => latency.run(),
        Command::Emulate(emulate) => emulate.run(),
        Command::Completions(completions) => completions.run(help::with_examples(Args::command())),
        Command::Man(man) => man.run(help::with_examples(Args::command())),
    }
}
