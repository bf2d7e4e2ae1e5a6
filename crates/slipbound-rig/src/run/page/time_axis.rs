//! The time axis that all plots share.

use slipbound::control::Cycle;

/// Width of every plot, in the units of its view box.
pub(super) const WIDTH_PX: f64 = 1000.0;
/// Left of the time axis, for labels.
pub(super) const LEFT_PX: f64 = 68.0;
pub(super) const RIGHT_PX: f64 = 14.0;

/// Time in the plots.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimeAxis {
    pub first_ns: u64,
    pub last_ns: u64,
}

impl TimeAxis {
    /// Over all cycles; None without any.
    pub fn of(cycles: &[Cycle]) -> Option<Self> {
        let (first_ns, last_ns) = (cycles.first()?.time_ns, cycles.last()?.time_ns);
        Some(TimeAxis { first_ns, last_ns: last_ns.max(first_ns.saturating_add(1_000_000)) })
    }

    /// Where a time is in a plot.
    pub fn x_px(&self, time_ns: u64) -> f64 {
        let whole_ns = (self.last_ns - self.first_ns) as f64;
        let fraction = time_ns.clamp(self.first_ns, self.last_ns).saturating_sub(self.first_ns) as f64 / whole_ns;
        LEFT_PX + fraction * (WIDTH_PX - LEFT_PX - RIGHT_PX)
    }

    pub fn range_s(&self) -> (f64, f64) {
        (self.first_ns as f64 / 1e9, self.last_ns as f64 / 1e9)
    }
}
