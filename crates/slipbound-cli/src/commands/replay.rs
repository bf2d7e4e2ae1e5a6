//! `slipbound replay`: runs a recorded run again, from its folder, and checks that every command is the same.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound_rig::run::{self, ReplayError};
use slipbound_rig::source;
use std::path::PathBuf;

/// The arguments of `slipbound replay`.
#[derive(Debug, clap::Args)]
pub struct Replay {
    /// The folder of a run made with --record
    folder: PathBuf,
}

impl Replay {
    /// Runs the loop over the recorded data; fails at the first command that differs.
    pub fn run(&self) -> Result<Outcome, Failure> {
        if self.folder.is_file() {
            let file = self.folder.display();
            let advice = match source::has_ending(&self.folder, "mcap") {
                true => format!("; `slipbound convert {file} -o FOLDER` makes one of a recorded run"),
                false => String::new(),
            };
            return Err(Failure::Arguments(anyhow!("{file}: expected the folder of a run, got a file{advice}")));
        }
        if matches!(self.folder.join("run.toml").try_exists(), Ok(false)) {
            let got = if self.folder.is_dir() { "a folder without run.toml" } else { "none" };
            let folder = self.folder.display();
            return Err(Failure::Arguments(anyhow!("{folder}: expected the folder of a run, got {got}")));
        }
        let failed = |error| match error {
            ReplayError::Folder(_) | ReplayError::Sensor(_) | ReplayError::Rest(_) | ReplayError::Setting(_) => {
                Failure::arguments(error)
            }
            other => Failure::Work(other.into()),
        };
        let replayed = run::Replay::open(&self.folder).and_then(|replay| replay.run(&mut ())).map_err(failed)?;
        let (folder, count) = (self.folder.display(), replayed.cycles_count);
        Terminal::plain().say(&format!("{folder}: {count} cycles, every report and command the same"))?;
        Ok(Outcome::Done)
    }
}
