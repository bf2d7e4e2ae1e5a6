//! What the task did over time, as stretches and as the thin band above each plot.

use super::text::{phase_name, seconds};
use super::time_axis::TimeAxis;
use slipbound::control::Cycle;
use slipbound::task::Phase;
use std::fmt;

/// Height of the phases above each plot.
pub(super) const PHASE_BAND_PX: f64 = 5.0;

/// A stretch of time in which something stays the same.
pub(super) struct Stretch<T> {
    pub what: T,
    pub from_ns: u64,
    pub to_ns: u64,
}

pub(super) fn stretches<T: PartialEq + Copy>(cycles: &[Cycle], what: impl Fn(&Cycle) -> T) -> Vec<Stretch<T>> {
    let mut all: Vec<Stretch<T>> = Vec::new();
    for cycle in cycles {
        let now = what(cycle);
        if let Some(last) = all.last_mut() {
            last.to_ns = cycle.time_ns;
            if last.what == now {
                continue;
            }
        }
        all.push(Stretch { what: now, from_ns: cycle.time_ns, to_ns: cycle.time_ns });
    }
    all
}

pub(super) fn class(phase: Phase) -> &'static str {
    match phase {
        Phase::Grasping => "grasping",
        Phase::Working => "working",
        Phase::Waiting => "waiting",
        Phase::Releasing => "releasing",
        Phase::Ended(_) => "ended",
    }
}

/// The phases as a thin band of rectangles at this height.
pub(super) fn phase_band(f: &mut fmt::Formatter<'_>, time: &TimeAxis, cycles: &[Cycle], y_px: f64) -> fmt::Result {
    for Stretch { what, from_ns, to_ns } in stretches(cycles, |c| c.phase) {
        let (x_px, width_px) = (time.x_px(from_ns), time.x_px(to_ns) - time.x_px(from_ns));
        let (class, height_px) = (class(what), PHASE_BAND_PX - 1.0);
        write!(
            f,
            "<rect class=\"{class}\" x=\"{x_px:.1}\" y=\"{y_px}\" width=\"{width_px:.1}\" height=\"{height_px}\">"
        )?;
        writeln!(f, "<title>{} from {} to {}</title></rect>", phase_name(what), seconds(from_ns), seconds(to_ns))?;
    }
    Ok(())
}
