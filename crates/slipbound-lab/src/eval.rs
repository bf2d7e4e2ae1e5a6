//! Sweeps of trials, judged by every detector on the same frames, and the tables of what came out.
//!
//! ```text
//!   protocol, seed --> trials --frames--> detectors --> TrialRecord (a line of trials.jsonl) --> Table
//!                        `--truth-----------------------'
//! ```
//!
//! A table follows from the records alone, so a sweep that was cut, or spread over machines, ends in the same table.
//! Definitions of every score: docs/eval.md.

pub mod clips;
pub mod coverage;
mod digest;
mod error;
pub(crate) mod facts;
pub mod folder;
pub mod guest;
pub mod lifts;
pub mod outcome;
mod protocol;
pub mod quiet;
mod ramp_tables;
pub mod ramps;
pub mod record;
mod runner;
pub mod slides;
pub mod statistics;
pub mod table;
pub mod table1;
pub mod unseen;
pub mod watch;
pub mod wriggles;

pub use error::{EvalError, FolderError, SweepError};
pub use facts::Facts;
pub use outcome::Outcome;
pub use protocol::Protocol;
pub use record::{RecordLineError, TrialRecord};
pub use runner::run;
pub use statistics::{Estimated, auc, mean, median, quantile, rate_per_h, roc, share, share_of};
pub use table::{Cell, Sweep, Table};

use slipbound::setting::SettingError;

/// Names of the protocols with simulated trials.
pub const SIMULATED: [&str; 5] = ["table1", "ramps", "quiet", "unseen", "slides"];

/// The seed of fits, `fit::TRAINING_SEED`, and the protocols whose trials of it something was tuned on: fits take episodes of `quiet` and slides
/// from there, and thresholds of rivals were set on `table1`. Other trials for fits are drawn otherwise than those of `ramps` and `unseen`.
const TUNING_SEED: u64 = 1_000_000;
const TUNED_ON: [&str; 3] = ["table1", "quiet", "slides"];

/// A simulated protocol by name. `trials`: how many, its own number where None. Refuses the seed of trials that something was tuned on.
pub fn simulated(name: &str, seed: u64, trials: Option<u64>) -> Result<Box<dyn Protocol>, SettingError> {
    if seed == TUNING_SEED && TUNED_ON.contains(&name) {
        return Err(SettingError {
            key: "seed".into(),
            expected: format!("another than {TUNING_SEED}, whose trials of {name} were tuned on"),
            got: seed.to_string(),
        });
    }
    Ok(match name {
        "table1" => Box::new(table1::Table1::new(seed, trials)),
        "ramps" => Box::new(ramps::Ramps::new(seed, trials)),
        "quiet" => Box::new(quiet::Quiet::new(seed, trials)),
        "unseen" => Box::new(unseen::Unseen::new(seed, trials)),
        "slides" => Box::new(slides::Slides::new(seed, trials)),
        _ => {
            return Err(SettingError::none_of("protocol", name, &SIMULATED));
        }
    })
}
