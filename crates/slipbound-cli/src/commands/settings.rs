//! `slipbound settings`: every setting with its default, as a file to copy and change.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use clap::ValueEnum;
use slipbound::monitor::Settings;
use slipbound::task::TaskSettings;
use slipbound_rig::config::{settings_to_toml, task_settings_to_toml};

/// Which settings are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Which {
    /// Of the monitor: `watch` and `tare` accept them
    Monitor,
    /// Of the monitor as in the paper
    Paper,
    /// Of grip, controllers and tasks: `hold`, `run`, `demo` and `trials` accept them
    Task,
}

/// Prints them as TOML.
pub fn run(which: Which) -> Result<Outcome, Failure> {
    let text = match which {
        Which::Monitor => settings_to_toml(&Settings::default()),
        Which::Paper => settings_to_toml(&Settings::paper()),
        Which::Task => task_settings_to_toml(&TaskSettings::default()),
    };
    let text = text.map_err(|e| Failure::work("settings", e))?;
    Terminal::plain().say(text.trim_end())?;
    Ok(Outcome::Done)
}
