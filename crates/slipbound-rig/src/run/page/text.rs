//! Text for the page: events in words.

use crate::run::event::{Event, TimedEvent};
use crate::run::words::phase_name;
use slipbound::hand::Health;

/// `4.20 s`
pub(super) fn seconds(time_ns: u64) -> String {
    format!("{:.2} s", time_ns as f64 / 1e9)
}

/// What a finger's health is called.
pub(super) fn health_name(health: Health) -> &'static str {
    match health {
        Health::Absent => "absent",
        Health::Live => "live",
        Health::Blind => "blind",
        Health::Frozen => "frozen",
    }
}

/// An event as a line to read.
pub(super) fn in_words(event: &TimedEvent) -> String {
    let newtons = |force_n: &Option<f64>| force_n.map_or_else(|| "an unknown force".into(), |n| format!("{n:.1} N"));
    match &event.event {
        Event::Phase { now } => format!("Phase: {}", phase_name(*now)),
        Event::SlipBegins { slip, direction, fingers_count, gross, force_n } => {
            let what = if *gross { "whole contact slides" } else { "incipient slip" };
            let way = ways(direction);
            let fingers = match fingers_count {
                0 => String::new(),
                1 => ", seen by one finger".to_owned(),
                count => format!(", seen by {count} fingers"),
            };
            format!("Slip {slip} at {}: {what} {way}at {}{fingers}", seconds(event.time_ns), newtons(force_n))
        }
        Event::SlipEnds { slip, lasted_ns: 0 } => format!("Slip {slip} is over: seen in one cycle"),
        Event::SlipEnds { slip, lasted_ns } => format!("Slip {slip} is over: seen for {}", seconds(*lasted_ns)),
        Event::Grip { from_n, to_n } => format!("Grip from {} to {}", newtons(from_n), newtons(to_n)),
        Event::Finger { finger, health } => format!("Finger {finger}: {}", health_name(*health)),
        Event::Picture { finger, file, .. } => format!("Picture of {finger}: {file}"),
        Event::Note { text } => text.clone(),
        Event::Ended { evidence, .. } => format!("Ended: {evidence}"),
        Event::Result(row) => format!("{}: {}", row.name, row.value),
    }
}

/// `around and pivot` as full phrases for the reader, with a comma and a space behind.
fn ways(direction: &str) -> String {
    let words = direction.split(" and ").filter_map(|word| match word {
        "along" => Some("along the fingers"),
        "across" => Some("across the fingers"),
        "around" => Some("around the axis along the fingers"),
        "pivot" => Some("pivoting about the axis through both"),
        _ => None,
    });
    let words = words.collect::<Vec<_>>().join(" and ");
    if words.is_empty() { words } else { words + ", " }
}
