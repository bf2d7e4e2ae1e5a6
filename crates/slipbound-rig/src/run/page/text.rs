//! Text for the page: events in words.

use crate::report_summary::state_name;
use crate::run::event::{Event, FingerVerdict, TimedEvent};
use crate::run::words::phase_name;
use slipbound::hand::Health;
use slipbound::monitor::SlipState;

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
        Event::SlipBegins { slip, direction, fingers_count, fingers, gross, force_n, force_measured } => {
            let what = if *gross { "whole contact slides" } else { "incipient slip" };
            let way = ways(direction);
            let fingers = match fingers_count {
                _ if !fingers.is_empty() => String::new(), // see `evidence`
                0 => String::new(),
                1 => ", seen by one finger".to_owned(),
                count => format!(", seen by {count} fingers"),
            };
            let (at, force) = (seconds(event.time_ns), newtons(force_n));
            let kind = match force_measured {
                Some(true) => " measured",
                Some(false) => " commanded",
                None => "",
            };
            format!("Slip {slip} at {at}: {what} {way}at {force}{kind}{fingers}")
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

/// `left: incipient slip, margin 0.41; right: stick, margin 0.62`: why a slip is reported; None where it is not known.
pub(super) fn evidence(event: &Event) -> Option<String> {
    let fingers = match event {
        Event::SlipBegins { fingers, .. } if !fingers.is_empty() => fingers,
        _ => return None,
    };
    let of_finger = |verdict: &FingerVerdict| {
        let FingerVerdict { finger, state, margin, markers_over, markers_needed } = verdict;
        let value = match margin {
            Some(margin) => format!(", margin {margin:.2}"),
            None if *markers_needed == 0 || *state == SlipState::Gross => String::new(),
            None => format!(", {markers_over} markers over the threshold, {markers_needed} needed"),
        };
        format!("{finger}: {}{value}", state_name(*state))
    };
    let each = fingers.iter().map(of_finger).collect::<Vec<_>>().join("; ");
    let slips = fingers.iter().any(|verdict| verdict.state.is_slip());
    Some(if slips { each } else { each + "; half of those needed on each of two fingers mean slip" })
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
