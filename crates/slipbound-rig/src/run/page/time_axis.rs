//! The time axis that all plots share.

use super::text::seconds;
use slipbound::control::Cycle;

/// Width of a plot, in the units of its view box: each is drawn for a screen and for a phone, with one letter size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    /// For a window.
    Wide,
    /// For a window that is as narrow as a phone.
    Narrow,
}

impl Width {
    /// Both, in the order in which they are written; a style sheet shows one.
    pub const BOTH: [Width; 2] = [Width::Wide, Width::Narrow];

    /// The name of its class.
    pub fn class(self) -> &'static str {
        match self {
            Width::Wide => "wide",
            Width::Narrow => "narrow",
        }
    }

    pub fn px(self) -> f64 {
        match self {
            Width::Wide => 1000.0,
            Width::Narrow => 400.0,
        }
    }

    /// Left of the time axis, for labels.
    pub fn left_px(self) -> f64 {
        match self {
            Width::Wide => 68.0,
            Width::Narrow => 44.0,
        }
    }

    pub fn right_px(self) -> f64 {
        match self {
            Width::Wide => 14.0,
            Width::Narrow => 9.0,
        }
    }
}

/// The unit of the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeUnit {
    /// Nanoseconds, as everywhere.
    Seconds,
    /// Frames that have no time: their numbers, times 10^9.
    Frames,
}

/// Time in the plots.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimeAxis {
    pub first_ns: u64,
    pub last_ns: u64,
    pub unit: TimeUnit,
    pub width: Width,
}

impl TimeAxis {
    /// Over all cycles; None without any.
    pub fn of(cycles: &[Cycle]) -> Option<Self> {
        Some(TimeAxis::over(cycles.first()?.time_ns, cycles.last()?.time_ns, TimeUnit::Seconds))
    }

    /// From the first time to the last.
    pub fn over(first_ns: u64, last_ns: u64, unit: TimeUnit) -> Self {
        let last_ns = last_ns.max(first_ns.saturating_add(1_000_000));
        TimeAxis { first_ns, last_ns, unit, width: Width::Wide }
    }

    /// The same for plots of another width.
    pub fn drawn(self, width: Width) -> Self {
        TimeAxis { width, ..self }
    }

    /// Where a time is in a plot.
    pub fn x_px(&self, time_ns: u64) -> f64 {
        let whole_ns = (self.last_ns - self.first_ns) as f64;
        let fraction = time_ns.clamp(self.first_ns, self.last_ns).saturating_sub(self.first_ns) as f64 / whole_ns;
        self.width.left_px() + fraction * (self.width.px() - self.width.left_px() - self.width.right_px())
    }

    pub fn range_s(&self) -> (f64, f64) {
        (self.first_ns as f64 / 1e9, self.last_ns as f64 / 1e9)
    }

    /// A time in words.
    pub fn words(&self, time_ns: u64) -> String {
        match self.unit {
            TimeUnit::Seconds => seconds(time_ns),
            TimeUnit::Frames => format!("frame {}", time_ns / 1_000_000_000),
        }
    }

    /// The label below the axis.
    pub fn label(&self) -> &'static str {
        match self.unit {
            TimeUnit::Seconds => "time, s",
            TimeUnit::Frames => "number of the frame",
        }
    }
}
