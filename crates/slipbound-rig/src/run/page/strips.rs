//! Coloured bands over the time axis: what the task or the contact did, which fingers were live, what was noted.

use super::phases::{ClassAndName, Stretch, phases, stretches};
use super::text::health_name;
use super::time_axis::{TimeAxis, Width};
use crate::html_page::markup::Escaped;
use crate::run::event::{Event, TimedEvent};
use slipbound::control::Cycle;
use slipbound::hand::Health;
use std::fmt;

const ROW_PX: f64 = 20.0;
/// A band narrower than this has no room for its name.
const NAMED_PX: f64 = 56.0;

/// A row of the strips.
pub(super) enum Row {
    /// Stretches, and gaps.
    Bands(Vec<Stretch<Option<ClassAndName>>>),
    /// Times and their notes.
    Notes(Vec<(u64, String)>),
}

/// The rows of a run: phases always, a finger where it was not live throughout, notes where there are any, and the
/// stretches in which the whole contact slid.
pub(super) fn of_run(fingers: &[String], cycles: &[Cycle], events: &[TimedEvent]) -> Vec<(String, Row)> {
    let whole = phases(cycles).into_iter().map(|s| Stretch { what: Some(s.what), from_ns: s.from_ns, to_ns: s.to_ns });
    let mut rows = vec![("phase".into(), Row::Bands(whole.collect()))];
    let bands = |what: &dyn Fn(&Cycle) -> Option<ClassAndName>| {
        Row::Bands(stretches(cycles.iter().map(|cycle| (cycle.time_ns, what(cycle)))))
    };
    let gross = |c: &Cycle| c.truth.is_some_and(|truth| truth.gross);
    if cycles.iter().any(gross) {
        rows.push(("slides".into(), bands(&|c| gross(c).then_some(("gone", "whole contact slides")))));
    }
    for (i, finger) in fingers.iter().enumerate() {
        let health = |c: &Cycle| c.hand.health.get(i).copied().unwrap_or_default();
        if cycles.iter().any(|c| health(c) != Health::Live) {
            let name = |health| (if health == Health::Live { "live" } else { "gone" }, health_name(health));
            rows.push((finger.clone(), bands(&|c| Some(name(health(c))))));
        }
    }
    let notes: Vec<(u64, String)> = events
        .iter()
        .filter_map(|event| match &event.event {
            Event::Note { text } => Some((event.time_ns, text.clone())),
            _ => None,
        })
        .collect();
    if !notes.is_empty() {
        rows.push(("notes".into(), Row::Notes(notes)));
    }
    rows
}

/// Writes the rows below a title and the names of what the first of them shows.
pub(super) fn write(f: &mut fmt::Formatter<'_>, time: &TimeAxis, title: &str, rows: &[(String, Row)]) -> fmt::Result {
    writeln!(f, "<figure class=\"plot strips\">\n<figcaption><b>{title}</b>")?;
    let mut named: Vec<ClassAndName> = Vec::new();
    if let Some((_, Row::Bands(stretches))) = rows.first() {
        for &(class, name) in stretches.iter().filter_map(|stretch| stretch.what.as_ref()) {
            if !named.contains(&(class, name)) {
                named.push((class, name));
                writeln!(f, "<span class=\"line\"><i class=\"fill\" style=\"--c:var(--{class})\"></i>{name}</span>")?;
            }
        }
    }
    writeln!(f, "</figcaption>")?;
    let height_px = ROW_PX * rows.len() as f64;
    for width in Width::BOTH {
        let (time, class, width_px) = (time.drawn(width), width.class(), width.px());
        writeln!(
            f,
            "<svg class=\"{class}\" viewBox=\"0 0 {width_px} {height_px}\" role=\"img\" aria-label=\"{title}\">"
        )?;
        for (i, (name, row)) in rows.iter().enumerate() {
            let (y_px, x_px) = (ROW_PX * i as f64, width.left_px() - 6.0);
            writeln!(f, "<g transform=\"translate(0 {y_px})\">")?;
            writeln!(f, "<text class=\"row\" x=\"{x_px}\" y=\"14\">{}</text>", Escaped(name))?;
            match row {
                Row::Bands(stretches) => bands(f, &time, stretches)?,
                Row::Notes(notes) => marks(f, &time, notes)?,
            }
            writeln!(f, "</g>")?;
        }
        writeln!(f, "</svg>")?;
    }
    writeln!(f, "</figure>")
}

/// Rectangles of these classes with their names, where there is room.
fn bands(f: &mut fmt::Formatter<'_>, time: &TimeAxis, stretches: &[Stretch<Option<ClassAndName>>]) -> fmt::Result {
    for Stretch { what, from_ns, to_ns } in stretches {
        let Some((class, name)) = what else { continue };
        let (x_px, width_px) = (time.x_px(*from_ns), (time.x_px(*to_ns) - time.x_px(*from_ns)).max(1.0));
        let (from, to, height_px) = (time.words(*from_ns), time.words(*to_ns), ROW_PX - 4.0);
        write!(f, "<g><title>{name} from {from} to {to}</title>")?;
        write!(f, "<rect class=\"{class}\" x=\"{x_px:.1}\" y=\"2\" width=\"{width_px:.1}\" height=\"{height_px}\"/>")?;
        if width_px >= NAMED_PX.max(8.0 * name.len() as f64) {
            let middle_px = x_px + width_px / 2.0;
            write!(f, "<text class=\"in {class}\" x=\"{middle_px:.1}\" y=\"14\">{name}</text>")?;
        }
        writeln!(f, "</g>")?;
    }
    Ok(())
}

fn marks(f: &mut fmt::Formatter<'_>, time: &TimeAxis, notes: &[(u64, String)]) -> fmt::Result {
    for (time_ns, text) in notes {
        let (left_px, title) = (time.x_px(*time_ns) - 5.0, format!("{}: {text}", time.words(*time_ns)));
        write!(f, "<g class=\"note\"><title>{}</title>", Escaped(&title))?;
        writeln!(f, "<path d=\"M{left_px:.1} 4 h10 l-5 11 z\"/></g>")?;
    }
    Ok(())
}
