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
pub mod shard;
pub mod slides;
mod stated_error;
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
pub use statistics::{Estimated, auc, mean, median, quantile, rate_per_h, roc, share, share_of, share_of_frames};
pub use table::{Cell, Sweep, Table};

use slipbound::setting::SettingError;

/// A protocol with simulated trials.
#[derive(Debug, Clone, Copy)]
pub struct SimulatedProtocol {
    /// Its name on the command line and in files.
    pub name: &'static str,
    /// The trials of a seed; how many, None for the protocol's own number.
    new: fn(u64, Option<u64>) -> Box<dyn Protocol>,
    /// Whether its trials of [`TUNING_SEED`] were used for tuning.
    is_tuned_on: bool,
}

/// The protocols with simulated trials, in the order in which they are listed.
pub const SIMULATED: [SimulatedProtocol; 5] = [
    SimulatedProtocol {
        name: table1::Table1::NAME,
        new: |seed, trials| Box::new(table1::Table1::new(seed, trials)),
        is_tuned_on: true,
    },
    SimulatedProtocol {
        name: ramps::Ramps::NAME,
        new: |seed, trials| Box::new(ramps::Ramps::new(seed, trials)),
        is_tuned_on: false,
    },
    SimulatedProtocol {
        name: quiet::Quiet::NAME,
        new: |seed, trials| Box::new(quiet::Quiet::new(seed, trials)),
        is_tuned_on: true,
    },
    SimulatedProtocol {
        name: unseen::Unseen::NAME,
        new: |seed, trials| Box::new(unseen::Unseen::new(seed, trials)),
        is_tuned_on: false,
    },
    SimulatedProtocol {
        name: slides::Slides::NAME,
        new: |seed, trials| Box::new(slides::Slides::new(seed, trials)),
        is_tuned_on: true,
    },
];

/// Names of the protocols that judge recorded clips, which need a folder of clips and their finger.
pub const RECORDED: [&str; 2] = [lifts::Lifts::NAME, wriggles::Wriggles::NAME];

/// The seed of the fits, `fit::TRAINING_SEED`: they take episodes of `quiet` and of `slides` with it, and thresholds of
/// rivals were set on such trials of `table1`. All other trials of the fits are drawn differently from those of `ramps`
/// and `unseen`.
const TUNING_SEED: u64 = 1_000_000;

/// A simulated protocol by name. `trials`: how many; None for the protocol's own number. Refuses a seed whose trials
/// were used for tuning.
pub fn simulated(name: &str, seed: u64, trials: Option<u64>) -> Result<Box<dyn Protocol>, SettingError> {
    let Some(protocol) = SIMULATED.iter().find(|protocol| protocol.name == name) else {
        return Err(SettingError::none_of("protocol", name, &SIMULATED.map(|protocol| protocol.name)));
    };
    if seed == TUNING_SEED && protocol.is_tuned_on {
        return Err(SettingError {
            key: "seed".into(),
            expected: format!("another than {TUNING_SEED}, whose trials of {name} were tuned on"),
            got: seed.to_string(),
        });
    }
    Ok((protocol.new)(seed, trials))
}
