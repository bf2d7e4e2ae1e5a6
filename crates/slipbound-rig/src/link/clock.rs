//! The clock of everything that runs in real time, and the time of day for records.

use std::sync::OnceLock;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Nanoseconds since the first call in this program: the clock of every driver and of the loop around them.
pub fn now_ns() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    u64::try_from(START.get_or_init(Instant::now).elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// Time of day, ns: that of the first call, plus the time since then on a clock that is never set back.
pub fn time_of_day_ns() -> u64 {
    static OFFSET: OnceLock<u64> = OnceLock::new();
    let offset_ns = *OFFSET.get_or_init(|| {
        let day = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        u64::try_from(day.as_nanos()).unwrap_or(0).saturating_sub(now_ns())
    });
    offset_ns + now_ns()
}
