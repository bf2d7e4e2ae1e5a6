//! Sweeps of trials, judged by every detector on the same frames, and the tables of what came out.
//!
//! ```text
//!   protocol, seed --> trials --frames--> detectors --> TrialRecord (a line of trials.jsonl) --> Table
//!                        `--truth-----------------------'
//! ```
//!
//! A table follows from the records alone, so a sweep that was cut, or spread over machines, ends in the same table.

pub mod record;
pub mod statistics;
pub mod table;

pub use record::{RecordLineError, TrialRecord};
pub use statistics::{Estimated, auc, mean, median, quantile, rate_per_h, roc, share, share_of};
pub use table::{Cell, Sweep, Table};
