//! Coloured bands over the time axis: what the task did, which fingers were live, what the loop noted.

use super::phases::{Stretch, class, stretches};
use super::text::{health_name, phase_name, seconds};
use super::time_axis::{LEFT_PX, TimeAxis, WIDTH_PX};
use crate::run::event::{Event, TimedEvent};
use crate::sheet::markup::Escaped;
use slipbound::control::Cycle;
use slipbound::hand::Health;
use std::fmt;

const ROW_PX: f64 = 20.0;
/// A band narrower than this has no room for its name.
const NAMED_PX: f64 = 56.0;

/// Writes the strips: phases always, a finger where it was not live throughout, notes where there are any, and the
/// stretches in which the whole contact slid.
pub(super) fn write(
    f: &mut fmt::Formatter<'_>,
    time: &TimeAxis,
    fingers: &[String],
    cycles: &[Cycle],
    events: &[TimedEvent],
) -> fmt::Result {
    let mut rows: Vec<(String, String)> = vec![("phase".into(), phases(time, cycles))];
    let gross = |c: &Cycle| c.truth.is_some_and(|truth| truth.gross);
    if cycles.iter().any(gross) {
        let name = |slides: bool| if slides { Some(("gone", "whole contact slides")) } else { None };
        rows.push(("slides".into(), bands(time, &stretches(cycles, |c| name(gross(c))))));
    }
    for (i, finger) in fingers.iter().enumerate() {
        let health = |c: &Cycle| c.hand.health.get(i).copied().unwrap_or_default();
        if cycles.iter().any(|c| health(c) != Health::Live) {
            let name = |health| Some((if health == Health::Live { "live" } else { "gone" }, health_name(health)));
            rows.push((finger.clone(), bands(time, &stretches(cycles, |c| name(health(c))))));
        }
    }
    let notes = notes(time, events);
    if !notes.is_empty() {
        rows.push(("notes".into(), notes));
    }
    let height_px = ROW_PX * rows.len() as f64;
    writeln!(f, "<figure class=\"plot strips\">\n<figcaption><b>Phases</b>")?;
    let mut named: Vec<&str> = Vec::new();
    for Stretch { what, .. } in stretches(cycles, |c| c.phase) {
        let name = phase_name(what);
        if !named.contains(&name) {
            named.push(name);
            writeln!(
                f,
                "<span class=\"line\"><i class=\"fill\" style=\"--c:var(--{})\"></i>{name}</span>",
                class(what)
            )?;
        }
    }
    writeln!(f, "</figcaption>")?;
    writeln!(f, "<svg viewBox=\"0 0 {WIDTH_PX} {height_px}\" role=\"img\" aria-label=\"phases\">")?;
    for (i, (name, drawn)) in rows.iter().enumerate() {
        let y_px = ROW_PX * i as f64;
        writeln!(f, "<g transform=\"translate(0 {y_px})\">")?;
        writeln!(f, "<text class=\"row\" x=\"{}\" y=\"14\">{}</text>\n{drawn}</g>", LEFT_PX - 8.0, Escaped(name))?;
    }
    writeln!(f, "</svg>\n</figure>")
}

fn phases(time: &TimeAxis, cycles: &[Cycle]) -> String {
    bands(time, &stretches(cycles, |c| Some((class(c.phase), phase_name(c.phase)))))
}

/// Rectangles of these classes with their names, where there is room.
fn bands(time: &TimeAxis, stretches: &[Stretch<Option<(&str, &str)>>]) -> String {
    let mut svg = String::new();
    for Stretch { what, from_ns, to_ns } in stretches {
        let Some((class, name)) = what else { continue };
        let (x_px, width_px) = (time.x_px(*from_ns), (time.x_px(*to_ns) - time.x_px(*from_ns)).max(1.0));
        svg += &format!(
            "<g><title>{name} from {} to {}</title><rect class=\"{class}\" x=\"{x_px:.1}\" y=\"2\" width=\"{width_px:.1}\" \
             height=\"{}\"/>",
            seconds(*from_ns),
            seconds(*to_ns),
            ROW_PX - 4.0
        );
        if width_px >= NAMED_PX {
            svg += &format!("<text class=\"in {class}\" x=\"{:.1}\" y=\"14\">{name}</text>", x_px + width_px / 2.0);
        }
        svg += "</g>\n";
    }
    svg
}

fn notes(time: &TimeAxis, events: &[TimedEvent]) -> String {
    let mut svg = String::new();
    for event in events {
        if let Event::Note { text } = &event.event {
            let x_px = time.x_px(event.time_ns);
            let title = format!("{}: {text}", seconds(event.time_ns));
            svg += &format!(
                "<g class=\"note\"><title>{}</title><path d=\"M{:.1} 4 h10 l-5 11 z\"/></g>\n",
                Escaped(&title),
                x_px - 5.0
            );
        }
    }
    svg
}
