//! `slipbound run` and `slipbound hold`: a task with a real gripper and wrist.

mod ending;
mod hardware;
mod pace;

use self::hardware::{Hardware, Work};
use crate::outcome::{Failure, Outcome};
use anyhow::anyhow;
use slipbound::task::TaskKind;

/// The duration given to an endless hold, ns: eleven days.
const WITHOUT_END_NS: u64 = 1_000_000_000_000_000;

/// The arguments of `slipbound run`.
#[derive(Debug, clap::Args)]
pub struct Run {
    /// The task
    #[arg(value_parser = TaskKind::NAMES)]
    task: String,
    #[command(flatten)]
    hardware: Hardware,
    /// line://HOST:PORT of the arm (docs/grippers.md), or dry for none
    #[arg(long, value_name = "ADDRESS")]
    wrist: String,
}

/// The arguments of `slipbound hold`.
#[derive(Debug, clap::Args)]
pub struct Hold {
    #[command(flatten)]
    hardware: Hardware,
    /// Seconds to hold, of which those count in which a finger feels the object [default: until Ctrl-C or the end of the source]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    for_s: Option<f64>,
}

impl Run {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = self.hardware.task_settings()?;
        let task: TaskKind = self.task.parse().map_err(Failure::arguments)?;
        let work = Work { name: task.name(), task, wrist: &self.wrist, is_hold: false };
        self.hardware.run(&work, &settings)
    }
}

impl Hold {
    /// Takes hold, and holds.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut settings = self.hardware.task_settings()?;
        settings.lift.lift_mm = 0.0;
        settings.lift.hold_ns = match self.for_s {
            None => WITHOUT_END_NS,
            Some(s) if (0.0..=1e6).contains(&s) => (s * 1e9) as u64,
            Some(s) => return Err(Failure::Arguments(anyhow!("--for-s: expected 0 to 1000000 s, got {s}"))),
        };
        self.hardware.run(&Work { name: "hold", task: TaskKind::Lift, wrist: "dry", is_hold: true }, &settings)
    }
}
