//! `slipbound simulate`: writes a scene as a recording with its ground truth.

use super::inputs;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::set_option;
use crate::terminal::Terminal;
use slipbound_lab::record::{RecordError, Recorded, read_scene, record};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// The arguments of `slipbound simulate`.
#[derive(Debug, clap::Args)]
pub struct Simulate {
    /// A scene (see `slipbound scenes`), also as `SCENE?key=value&key=value`, or the scene.toml of a recording
    scene: String,
    /// Seed of noise and faults
    #[arg(long)]
    seed: Option<u64>,
    /// Set a parameter of the scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The folder to write to: new or empty
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

impl Simulate {
    /// Runs the scene from its first frame to its last.
    pub fn run(&self) -> Result<Outcome, Failure> {
        inputs::refuse_stdout_folder(&self.output)?;
        let mut trial = match self.scene.ends_with(".toml") {
            true => read_scene(Path::new(&self.scene)).map_err(Failure::arguments)?,
            false => Trial::parse(&self.scene).map_err(Failure::arguments)?,
        };
        if self.seed.is_some() {
            set_option::refuse_own(&self.set, &[("seed", "--seed")])?;
        }
        for setting in &self.set {
            trial = trial.with_setting(setting).map_err(Failure::arguments)?;
        }
        if let Some(seed) = self.seed {
            trial = trial.with("seed", &seed.to_string()).map_err(Failure::arguments)?;
        }
        let most_count = World::new(&trial).map_err(Failure::arguments)?.most_frames_count();
        let interrupted = interruption::listen()?;
        let mut terminal = Terminal::with_bar(Some(most_count), false);
        let recorded = record(&trial, &self.output, |_| {
            terminal.advance();
            !interrupted.load(Ordering::Relaxed)
        });
        terminal.clear_bar();
        let recorded = recorded.map_err(|error| match error {
            RecordError::Setting(_) | RecordError::NotEmpty { .. } => Failure::arguments(error),
            other => Failure::Work(other.into()),
        })?;
        terminal.say(&format!("{}: {trial}", self.output.display()))?;
        terminal.say(&self.outcome(&recorded))?;
        Ok(Outcome::Done)
    }

    fn outcome(&self, recorded: &Recorded) -> String {
        let mut parts = vec![format!("{} frames", recorded.frames_count)];
        parts.push(match recorded.gross {
            Some(gross) => format!("gross slip at {:.3} s", gross.time_s),
            None if recorded.is_loaded => "no gross slip, so no load fraction".into(),
            None => "no load, so gross slip is not looked for".into(),
        });
        for (count, what) in [
            (recorded.torn_count, "torn"),
            (recorded.beyond_linear_count, "strained beyond the linear range"),
            (recorded.at_border_count, "with the contact at the border of the pad"),
            (recorded.unconverged_count, "in which a solver did not converge"),
        ] {
            if count > 0 {
                parts.push(format!("{count} {what}"));
            }
        }
        parts.join(", ")
    }
}
