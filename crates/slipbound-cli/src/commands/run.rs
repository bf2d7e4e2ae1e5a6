//! `slipbound run` and `slipbound hold`: a task with a real gripper and wrist.

mod ending;
mod hardware;
mod pace;

use self::hardware::{Hardware, Work};
use crate::outcome::{Failure, Outcome};
use slipbound::setting::SettingError;
use slipbound::task::TaskKind;

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
        let settings = self.hardware.task_settings()?.holding(self.for_s);
        let settings = settings.map_err(|e| Failure::arguments(SettingError { key: "--for-s".into(), ..e }))?;
        self.hardware.run(&Work { name: "hold", task: TaskKind::Lift, wrist: "dry", is_hold: true }, &settings)
    }
}
