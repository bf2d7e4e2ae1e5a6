//! The sweep of a protocol, as this program judges it.

use super::digest::Digest;
use super::error::EvalError;
use super::protocol::Protocol;
use super::table::Sweep;
use super::watch::{Restarts, Watch, watch};
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::Trial;

impl Sweep {
    /// The sweep of a protocol with this seed, judged by this program: `method` among the settings is a digest of how it
    /// simulates and judges a short trial, which is run for it.
    pub fn new(protocol: &dyn Protocol, seed: u64) -> Result<Self, EvalError> {
        let method = ("method".to_owned(), method()?);
        Ok(Sweep {
            protocol: protocol.name().into(),
            seed,
            trials_count: protocol.trials_count(),
            software_version: env!("CARGO_PKG_VERSION").into(),
            settings: protocol.settings().into_iter().chain([method]).collect(),
        })
    }
}

/// A short trial with contact, incipient and gross slip.
const TRIAL: &str = "ramp?object=crayons_box&force_n=20&mu=0.5&ramp_s=0.2&grid=fast&seed=1";

/// The digest of a simulated trial and of what every detector says of it: builds that simulate or judge differently give
/// different ones, and their records do not belong into one table.
fn method() -> Result<String, EvalError> {
    let entries: Vec<&'static Entry> = DETECTORS.iter().collect();
    let watched = watch(&Watch::new(Trial::parse(TRIAL)?, Restarts::Rivals), &entries, None)?;
    let mut digest = Digest::new();
    digest.add(&format!("{:?} {:?}", watched.truth, watched.gross));
    watched.seen.iter().for_each(|(entry, seen)| digest.add(&format!("{} {seen:?}", entry.name)));
    Ok(digest.word())
}
