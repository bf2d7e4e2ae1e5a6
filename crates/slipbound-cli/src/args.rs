//! The arguments of the command.

use crate::commands::calibrate::Calibrate;
use crate::commands::convert::Convert;
use crate::commands::demo::Demo;
use crate::commands::devices::Devices;
use crate::commands::doctor::Doctor;
use crate::commands::emulate::Emulate;
use crate::commands::eval::Eval;
use crate::commands::gripper::Gripper;
use crate::commands::latency::Latency;
use crate::commands::paper::Paper;
use crate::commands::record::Record;
use crate::commands::replay::Replay;
use crate::commands::run::{Hold, Run};
use crate::commands::settings::Which;
use crate::commands::shell::{Completions, Man};
use crate::commands::simulate::Simulate;
use crate::commands::tare::Tare;
use crate::commands::trials::Trials;
use crate::commands::watch::Watch;
use clap::{Parser, Subcommand};

/// Detects from the images of a camera inside a soft fingertip that a grasp begins to slip.
#[derive(Debug, Parser)]
#[command(name = "slipbound", version = env!("SLIPBOUND_VERSION"))]
pub struct Args {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Let a simulated hand screw a cap onto a bottle, or do another task of the paper
    Demo(Box<Demo>),
    /// Judge every frame of a recording or a simulated scene
    Watch(Watch),
    /// List the cameras and serial lines of this computer, and the grippers that are known
    Devices(Devices),
    /// Check a camera, its finger and a gripper, with advice on every problem
    Doctor(Doctor),
    /// Record cameras
    Record(Record),
    /// Turn the folder of a run into one MCAP file, or such a file into a folder
    Convert(Convert),
    /// Replay a recorded run from its frames and compare every command
    Replay(Replay),
    /// Run tasks in simulation over friction, seeds and controllers, and print the table
    Trials(Trials),
    /// Judge many simulated trials with ours and with rival detectors, and write records, tables and a page
    Eval(Eval),
    /// Make every figure and table of the paper from simulated frames, on one page
    Paper(Paper),
    /// Make the sensor file of an unknown finger from an image of it at rest
    Calibrate(Calibrate),
    /// Save the finger at rest in a file, for `--rest FILE` of later commands
    Tare(Tare),
    /// List the built-in fingers, or show the file of one
    Sensors {
        /// The finger whose file is shown
        name: Option<String>,
    },
    /// Show every setting with its default, as a file for `--settings`
    Settings {
        /// Which settings are shown
        #[arg(value_enum, default_value = "monitor")]
        which: Which,
    },
    /// Simulate a scene and write its frames with their exact truth
    Simulate(Simulate),
    /// List the scenes, their parameters and the objects in them, or show one scene
    Scenes {
        /// The scene that is shown
        name: Option<String>,
    },
    /// Hold an object with a real gripper, harder whenever it begins to slip
    Hold(Hold),
    /// Do a task of the paper with a real gripper and wrist
    #[command(
        override_usage = "slipbound run [OPTIONS] --gripper <ADDRESS> --wrist <ADDRESS>\n                     <TASK> <SOURCE>..."
    )]
    Run(Run),
    /// Operate a gripper manually
    Gripper(Gripper),
    /// Emulate a gripper, to test a driver without hardware
    Emulate(Box<Emulate>),
    /// Measure the time from a frame to the bytes of a grip command
    Latency(Latency),
    /// Print a script with which a shell completes the arguments
    Completions(Completions),
    /// Write the manual pages
    Man(Man),
}
