//! The arguments of the command.

use crate::commands::simulate::Simulate;
use crate::commands::watch::Watch;
use clap::{Parser, Subcommand};

/// Told by a camera inside a soft fingertip whether what it holds begins to slip.
///
/// Exit codes: 0 done, 1 failed (also when interrupted), 2 bad arguments, sensor or settings file, 3 finished but
/// frames were torn.
#[derive(Debug, Parser)]
#[command(name = "slipbound", version, max_term_width = 110)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What can be done.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Judge every frame of a recording or a simulated scene
    Watch(Watch),
    /// List the built-in fingers
    Sensors,
    /// Simulate a scene and write its frames with their exact truth
    Simulate(Simulate),
    /// List the scenes, their parameters and the objects in them
    Scenes,
}
