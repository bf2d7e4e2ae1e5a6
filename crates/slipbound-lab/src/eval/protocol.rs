//! Definition of a protocol: trials by number, records of each, tables of all.

use super::error::EvalError;
use super::record::TrialRecord;
use super::table::Table;
use super::watch::Onlooker;
use crate::rivals::Entry;

/// A series of trials that can be judged in any order, each independently.
pub trait Protocol: Sync {
    /// Its name on the command line and in files.
    fn name(&self) -> &'static str;

    /// How many trials there are.
    fn trials_count(&self) -> u64;

    /// How an error names a trial: by its number, and by the clip where there is one.
    fn trial(&self, number: u64) -> String {
        format!("trial {number}")
    }

    /// The records of a trial, one per detector, in the order of `detectors`. They depend only on the number.
    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError>;

    /// The tables, from the records of any part of the trials, in their order.
    fn tables(&self, records: &[TrialRecord]) -> Vec<Table>;

    /// Everything except seed and number of trials that changes a record, for the tables.
    fn settings(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Runs a trial again to show what a detector saw; does nothing if that is not possible.
    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        let _ = (number, detector, onlooker);
        Ok(())
    }
}
