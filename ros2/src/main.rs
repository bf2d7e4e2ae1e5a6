//! The command `slipbound-ros2`: the node, and tools to try and measure it without hardware.

mod commands;

use clap::{Parser, Subcommand};
use slipbound_rig::printable::printable;
use slipbound_ros2::error::Error;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Slip of tactile fingers in ROS 2, without a ROS installation.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Judges the pictures of a hand's fingers: slip reports out, one a picture
    Node(commands::node::Node),
    /// Holds an object with a gripper that is a node, and raises the force when it begins to slip
    Hold(commands::run::Hold),
    /// A task with a gripper and a wrist that are nodes
    Run(commands::run::Run),
    /// Publishes the pictures of a simulated finger
    Simulate(commands::simulate::Simulate),
    /// A gripper and a wrist that are nodes, holding nothing but a block of steel
    Emulate(commands::emulate::Emulate),
    /// Rate, losses and latency of the node in a process of its own, and what becomes of it when either end goes away
    Measure(commands::measure::Measure),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let stop = Arc::new(AtomicBool::new(false));
    let stops = stop.clone();
    if let Err(e) = ctrlc::set_handler(move || stops.store(true, Ordering::Relaxed)) {
        eprintln!("slipbound-ros2: {e}");
        return ExitCode::FAILURE;
    }
    let done = match arguments.command {
        Command::Node(node) => node.run(&stop),
        Command::Hold(hold) => hold.run(&stop),
        Command::Run(run) => run.run(&stop),
        Command::Simulate(simulate) => simulate.run(&stop),
        Command::Emulate(emulate) => emulate.run(&stop),
        Command::Measure(measure) => measure.run(&stop),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("slipbound-ros2: {}", printable(&e.to_string()));
            ExitCode::from(match e.downcast_ref::<Error>() {
                Some(Error::DataLost(_)) => 3,
                Some(e) if e.is_argument() => 2,
                _ => 1,
            })
        }
    }
}
