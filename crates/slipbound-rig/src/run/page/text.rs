//! Text for the page: escaped, in words, as base 64.

use crate::run::event::{Event, TimedEvent};
use slipbound::hand::Health;
use slipbound::task::Phase;
use std::fmt::{self, Write};

/// Text that cannot be mistaken for markup, in elements and in attributes.
pub(super) struct Escaped<'a>(pub &'a str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for sign in self.0.chars() {
            match sign {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\n' | '\t' => f.write_char(sign)?,
                // Not allowed in a page, not even escaped.
                _ if sign.is_control() || matches!(sign, '\u{FFFE}' | '\u{FFFF}') => f.write_char('\u{FFFD}')?,
                _ => f.write_char(sign)?,
            }
        }
        Ok(())
    }
}

/// `4.20 s`
pub(super) fn seconds(time_ns: u64) -> String {
    format!("{:.2} s", time_ns as f64 / 1e9)
}

/// What a phase is called.
pub(super) fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Grasping => "grasping",
        Phase::Working => "working",
        Phase::Waiting => "waiting",
        Phase::Releasing => "releasing",
        Phase::Ended(_) => "ended",
    }
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
        Event::SlipEnds { slip, lasted_ns } => format!("Slip {slip} is over: seen for {} ms", lasted_ns / 1_000_000),
        Event::Grip { from_n, to_n } => format!("Grip from {} to {}", newtons(from_n), newtons(to_n)),
        Event::Finger { finger, health } => format!("Finger {finger}: {}", health_name(*health)),
        Event::Picture { finger, file, .. } => format!("Picture of {finger}: {file}"),
        Event::Note { text } => text.clone(),
        Event::Ended { evidence, .. } => format!("Ended: {evidence}"),
        Event::Result(row) => format!("{}: {}", row.name, row.value),
    }
}

/// `around and pivot` as directions a reader can point in, with a space behind.
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

/// Bytes in the alphabet of RFC 4648, section 4.
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let sign = ALPHABET[(word >> (18 - 6 * i)) as usize & 63];
            text.push(if i > chunk.len() { '=' } else { char::from(sign) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base_64_is_that_of_the_rfc() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xFB, 0xFF]), "+/8=");
    }

    #[test]
    fn markup_and_control_signs_are_escaped() {
        assert_eq!(Escaped("<b a=\"1\">&\u{7}\n").to_string(), "&lt;b a=&quot;1&quot;&gt;&amp;\u{FFFD}\n");
    }
}
