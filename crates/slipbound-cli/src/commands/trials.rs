//! `slipbound trials`: the tasks over friction, seeds, controllers and fingers, as a table.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::set_option;
use crate::terminal::Terminal;
use slipbound::task::{Ending, TaskKind};
use slipbound_lab::trials::{self, Controls, TrialError, TrialGrid};
use slipbound_rig::config;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// The arguments of `slipbound trials`.
#[derive(Debug, clap::Args)]
pub struct Trials {
    /// Tasks
    #[arg(long, value_delimiter = ',', default_value = "screw,unscrew")]
    task: Vec<TaskKind>,
    /// Controllers, or `clairvoyant`: one that knows load and friction from the simulation
    #[arg(long, value_delimiter = ',', default_value = "paper,on_slip,margin")]
    controller: Vec<Controls>,
    /// Friction coefficients, or `object`
    #[arg(long, value_delimiter = ',', default_value = "0.4,0.6,0.9")]
    mu: Vec<String>,
    /// Objects, or `task` for the one of the task
    #[arg(long, value_delimiter = ',', default_value = "task")]
    object: Vec<String>,
    /// Fingers with a camera
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    fingers: Vec<u8>,
    /// How many seeds, from --first-seed on
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Set another parameter of every scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Also print every run
    #[arg(long)]
    each: bool,
}

impl Trials {
    /// Runs them all on all cores.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        let Some(after) = self.first_seed.checked_add(self.seeds) else {
            let (most, got) = (u64::MAX - self.seeds, self.first_seed);
            return Err(Failure::Arguments(anyhow::anyhow!("--first-seed: expected at most {most}, got {got}")));
        };
        let own = [("seed", "--first-seed"), ("mu", "--mu"), ("object", "--object"), ("fingers", "--fingers")];
        set_option::refuse_own(&self.set, &own)?;
        let grid = TrialGrid {
            tasks: self.task.clone(),
            objects: self.object.clone(),
            mu: self.mu.clone(),
            controllers: self.controller.clone(),
            fingers: self.fingers.clone(),
            seeds: self.first_seed..after,
            parameters: self.set.clone(),
        };
        let cells = grid.cells().map_err(Failure::arguments)?;
        let runs_count: usize = cells.iter().map(trials::TrialCell::runs_count).sum();
        let stop = interruption::listen()?;
        let bar = Terminal::with_bar_of(runs_count as u64, "runs");
        let scores = trials::run(&cells, &settings, &|| stop.load(Ordering::Relaxed), &|| bar.advance());
        bar.clear_bar();
        let scores = scores.map_err(|error: TrialError| Failure::Work(error.into()))?;
        let mut terminal = Terminal::plain();
        trials::TABLE_HEAD.iter().try_for_each(|line| terminal.say(line))?;
        for (cell, runs) in cells.iter().zip(&scores) {
            terminal.say(&trials::row(cell, runs))?;
            for (scene, run) in cell.scenes().zip(runs).filter(|_| self.each) {
                terminal.say(&format!("    {scene}: {}", trials::line(run)))?;
            }
        }
        let runs = || scores.iter().flatten();
        let empty = runs().filter(|run| run.ending == Some(Ending::NothingHeld)).count();
        match (empty, runs().filter(|run| run.is_object_lost()).count()) {
            (0, 0) => Ok(Outcome::Done),
            (empty, lost) => Err(Failure::Work(anyhow::anyhow!(
                "of {runs_count} runs {empty} held nothing and {lost} lost the object"
            ))),
        }
    }
}
