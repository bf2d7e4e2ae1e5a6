//! Parses a reason from its text, so that a report can be read back.

use super::report::Reason;
use crate::image::SizePx;
use crate::sensor::Flip;
use serde::{Deserialize, Deserializer, de};
use std::str::FromStr;

impl FromStr for Reason {
    type Err = String;

    /// The inverse of `Display`; numbers have the precision of the text.
    fn from_str(text: &str) -> Result<Self, String> {
        parse(text).ok_or_else(|| format!("expected a reason as reports have them, got `{text}`"))
    }
}

impl<'de> Deserialize<'de> for Reason {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

fn parse(text: &str) -> Option<Reason> {
    const GAP: &str = "frames were missed, and which marker is which is not clear yet";
    match text {
        "torn frame" => return Some(Reason::Torn),
        "too many markers are lost" => return Some(Reason::MarkersLost),
        "contact too small or too weak to judge" => return Some(Reason::ContactQuality),
        GAP => return Some(Reason::Gap { since_ns: None }),
        _ => {}
    }
    if let Some(sizes) = text.strip_prefix("frame size: expected ") {
        let (expected, got) = sizes.split_once(", got ")?;
        return Some(Reason::FrameSize { expected: size(expected)?, got: size(got)? });
    }
    if let Some(levels) = text.strip_prefix("dark frame: mean grey level ") {
        return Some(Reason::Dark { mean_levels: levels.parse().ok()? });
    }
    if let Some(since) = text.strip_prefix(GAP) {
        // Digit by digit: 0.29 s is not a whole number of ns in binary floating point.
        let (seconds, hundredths) = since.strip_prefix(", for ")?.strip_suffix(" s")?.split_once('.')?;
        let (seconds, hundredths): (u64, u64) = (seconds.parse().ok()?, hundredths.parse().ok()?);
        let hundredths = seconds.checked_mul(100)?.checked_add(hundredths)?;
        return Some(Reason::Gap { since_ns: Some(hundredths.checked_mul(10_000_000)?) });
    }
    let spacing = text.strip_prefix("markers expected on a grid of ")?;
    let (expected, rest) = spacing.split_once(" px (pitch_px of the sensor), got ")?;
    let (got, fitting) = rest.split_once(" px apart: ")?;
    let fitting = match fitting.strip_prefix("with flip = \"") {
        None => None,
        Some(fitting) => {
            let (name, px) = fitting.split_once("\" they stand ")?;
            let flip = Flip::ALL.into_iter().find(|flip| flip.to_string() == name)?;
            Some((flip, px.strip_suffix(" px apart")?.parse().ok()?))
        }
    };
    Some(Reason::MarkerSpacing { expected_px: expected.parse().ok()?, got_px: got.parse().ok()?, fitting })
}

fn size(text: &str) -> Option<SizePx> {
    let (width, height) = text.split_once('x')?;
    Some(SizePx::new(width.parse().ok()?, height.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_is_found_again_by_its_words() {
        let size = |width, height| SizePx::new(width, height);
        for reason in [
            Reason::FrameSize { expected: size(640, 480), got: size(0, 7) },
            Reason::Dark { mean_levels: 3.5 },
            Reason::Torn,
            Reason::Gap { since_ns: None },
            Reason::Gap { since_ns: Some(290_000_000) },
            Reason::MarkersLost,
            Reason::MarkerSpacing { expected_px: 18.5, got_px: 9.0, fitting: None },
            Reason::MarkerSpacing { expected_px: 18.5, got_px: 9.0, fitting: Some((Flip::Both, 18.1)) },
            Reason::ContactQuality,
        ] {
            assert_eq!(reason.to_string().parse(), Ok(reason));
        }
        for none in ["", "torn", "dark frame: mean grey level x", "frame size: expected 3, got 4x4"] {
            assert!(none.parse::<Reason>().is_err(), "{none}");
        }
    }
}
