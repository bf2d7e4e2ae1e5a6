//! The clock of everything that runs in real time.

use std::sync::OnceLock;
use std::time::Instant;

/// Nanoseconds since the first call in this program: the clock of every driver and of the loop around them.
pub fn now_ns() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    u64::try_from(START.get_or_init(Instant::now).elapsed().as_nanos()).unwrap_or(u64::MAX)
}
