//! Phases over time, as stretches and as the thin band above each plot.

use super::time_axis::TimeAxis;
use crate::run::words::phase_name;
use slipbound::control::Cycle;
use std::fmt;

/// Height of the band above each plot.
pub(super) const PHASE_BAND_PX: f64 = 5.0;

/// A stretch of time in which something stays the same.
pub(super) struct Stretch<T> {
    pub what: T,
    pub from_ns: u64,
    pub to_ns: u64,
}

/// What a stretch shows: class of the style sheet, and name.
pub(super) type ClassAndName = (&'static str, &'static str);

/// The stretches of equal values over time.
pub(super) fn stretches<T: PartialEq + Copy>(times: impl Iterator<Item = (u64, T)>) -> Vec<Stretch<T>> {
    let mut all: Vec<Stretch<T>> = Vec::new();
    for (time_ns, now) in times {
        if let Some(last) = all.last_mut() {
            last.to_ns = time_ns;
            if last.what == now {
                continue;
            }
        }
        all.push(Stretch { what: now, from_ns: time_ns, to_ns: time_ns });
    }
    all
}

/// The phases of the task.
pub(super) fn phases(cycles: &[Cycle]) -> Vec<Stretch<ClassAndName>> {
    // The style sheet has a class of the same name.
    stretches(cycles.iter().map(|c| (c.time_ns, (phase_name(c.phase), phase_name(c.phase)))))
}

/// The stretches as a thin band of rectangles at this height.
pub(super) fn band(
    f: &mut fmt::Formatter<'_>,
    time: &TimeAxis,
    all: &[Stretch<ClassAndName>],
    y_px: f64,
) -> fmt::Result {
    for Stretch { what: (class, name), from_ns, to_ns } in all {
        let (x_px, width_px) = (time.x_px(*from_ns), time.x_px(*to_ns) - time.x_px(*from_ns));
        let height_px = PHASE_BAND_PX - 1.0;
        write!(
            f,
            "<rect class=\"{class}\" x=\"{x_px:.1}\" y=\"{y_px}\" width=\"{width_px:.1}\" height=\"{height_px}\">"
        )?;
        writeln!(f, "<title>{name} from {} to {}</title></rect>", time.words(*from_ns), time.words(*to_ns))?;
    }
    Ok(())
}
