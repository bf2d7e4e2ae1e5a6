//! What goes wrong with a finger in the middle of a task, to show that the object stays held.

use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::fmt;
use std::str::FromStr;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// Frames stop coming.
    Lost,
    /// The same picture comes again and again.
    Frozen,
    /// Every frame is torn.
    Torn,
    /// The light goes out.
    Dark,
    /// The fingers are taken one for the other, from the start.
    Swapped,
}

const NAMES: [(What, &str); 5] = [
    (What::Lost, "lost"),
    (What::Frozen, "frozen"),
    (What::Torn, "torn"),
    (What::Dark, "dark"),
    (What::Swapped, "swapped"),
];

/// What goes wrong, when, and with which fingers: `frozen@3`, `lost@2.5:left`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spoiler {
    what: What,
    from_ns: u64,
    finger: Option<usize>,
}

impl Spoiler {
    /// Whether the fingers are taken one for the other.
    pub fn swaps(&self) -> bool {
        self.what == What::Swapped
    }

    /// Whether it goes wrong with this finger.
    pub fn hits(&self, finger: usize) -> bool {
        self.finger.is_none_or(|hit| hit == finger)
    }
}

impl FromStr for Spoiler {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            format!(
                "expected lost, frozen, torn, dark or swapped with @SECONDS and :left or :right as wanted, got `{text}`"
            )
        };
        let (rest, finger) = match text.split_once(':') {
            Some((rest, "left")) => (rest, Some(0)),
            Some((rest, "right")) => (rest, Some(1)),
            Some(_) => return Err(expected()),
            None => (text, None),
        };
        let (name, seconds) = rest.split_once('@').unwrap_or((rest, "0"));
        let (what, _) = NAMES.iter().find(|(_, known)| *known == name).ok_or_else(expected)?;
        let seconds: f64 = seconds.parse().ok().filter(|s| (0.0..=3600.0).contains(s)).ok_or_else(expected)?;
        Ok(Spoiler { what: *what, from_ns: (seconds * 1e9) as u64, finger })
    }
}

impl fmt::Display for Spoiler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(what, _)| *what == self.what).map_or("", |(_, name)| name);
        write!(f, "{name}@{}", self.from_ns as f64 * 1e-9)?;
        match self.finger {
            Some(0) => f.write_str(":left"),
            Some(_) => f.write_str(":right"),
            None => Ok(()),
        }
    }
}

/// A source that goes wrong.
pub struct Spoiled<S> {
    source: S,
    spoiler: Option<Spoiler>,
    last_pixels: Vec<u8>,
}

impl<S: FrameSource> Spoiled<S> {
    /// As good as the source without a spoiler.
    pub fn new(source: S, spoiler: Option<Spoiler>) -> Self {
        Spoiled { source, spoiler, last_pixels: Vec::new() }
    }
}

impl<S: FrameSource> FrameSource for Spoiled<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let Some(spoiler) = self.spoiler else { return Ok(next) };
        if next != Next::Frame || into.time_ns.unwrap_or(0) < spoiler.from_ns {
            self.last_pixels.clone_from(&into.pixels);
            return Ok(next);
        }
        match spoiler.what {
            What::Lost => return Ok(Next::Silent),
            What::Torn => return Ok(Next::Torn { reason: "cut off".into() }),
            What::Frozen => into.pixels.clone_from(&self.last_pixels),
            What::Dark => into.pixels.fill(2),
            What::Swapped => {}
        }
        Ok(next)
    }
}
