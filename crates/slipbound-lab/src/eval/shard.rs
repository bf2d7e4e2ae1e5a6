//! Parts of a sweep, for several machines.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A part of a sweep: every `of`th trial, starting from the `number`th, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// Which part, from 1 to `of`.
    pub number: u64,
    /// How many parts.
    pub of: u64,
}

impl Shard {
    /// The whole sweep.
    pub const WHOLE: Shard = Shard { number: 1, of: 1 };

    /// The numbers of its trials among `trials_count`.
    pub fn numbers(self, trials_count: u64) -> impl Iterator<Item = u64> {
        (self.number - 1..trials_count).step_by(self.of as usize)
    }
}

/// As on the command line, `2/8`.
impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}
