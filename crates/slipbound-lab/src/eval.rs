//! Sweeps of trials: every detector judges the same frames; tables of the results.
//!
//! ```text
//!   protocol, seed --> trials --frames--> detectors --> TrialRecord (a line of trials.jsonl) --> Table
//!                        `--truth-----------------------'
//! ```
//!
//! A table depends on the records alone: an interrupted sweep, or one spread over several machines, gives the same
//! table.
//! Definitions of every score: docs/eval.md.

mod clip_record;
pub mod clip_verdict;
pub mod clip_watch;
pub mod clips;
pub mod coverage;
pub mod custom_detector;
mod digest;
mod error;
pub mod folder;
pub(crate) mod ground_truth;
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
mod sweep;
pub mod table;
pub mod table1;
mod trial_seed;
pub mod unseen;
pub mod watch;
pub mod wriggles;

pub use error::{EvalError, FolderError, SweepError};
pub use ground_truth::GroundTruth;
pub use outcome::Outcome;
pub use protocol::Protocol;
pub use record::{RecordLineError, TrialRecord};
pub use runner::run;
pub use statistics::{Estimated, auc, mean, median, quantile, rate_per_h, roc, share, share_of};
pub use table::{Cell, Sweep, Table};

use slipbound::setting::SettingError;

/// Names of the protocols with simulated trials.
pub const SIMULATED: [&str; 5] = ["table1", "ramps", "quiet", "unseen", "slides"];

/// The seed of the fits, `fit::TRAINING_SEED`, and the protocols of which trials with this seed were used for tuning:
/// the fits take episodes of `quiet` and of `slides`, and thresholds of rivals were set on `table1`. All other trials
/// of the fits are drawn differently from those of `ramps` and `unseen`.
const TUNING_SEED: u64 = 1_000_000;
const TUNED_ON: [&str; 3] = ["table1", "quiet", "slides"];

/// A simulated protocol by name. `trials`: how many; None for the protocol's own number. Refuses a seed whose trials
/// were used for tuning.
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
