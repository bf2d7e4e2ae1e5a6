//! Camera faults that begin at a given time during a task: to show that the object stays held.

use super::image::{copy_image, encode_again};
use slipbound::hand::Side;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::fmt;
use std::str::FromStr;

/// The kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFaultKind {
    /// Frames stop coming.
    Lost,
    /// The same image is repeated.
    Frozen,
    /// Every frame is torn.
    Torn,
    /// The light goes out.
    Dark,
    /// Left and right are exchanged, from the start.
    Swapped,
}

const NAMES: [(CameraFaultKind, &str); 5] = [
    (CameraFaultKind::Lost, "lost"),
    (CameraFaultKind::Frozen, "frozen"),
    (CameraFaultKind::Torn, "torn"),
    (CameraFaultKind::Dark, "dark"),
    (CameraFaultKind::Swapped, "swapped"),
];

/// Latest time at which a fault may begin, in s.
const LATEST_S: f64 = 3600.0;

/// Grey level of every pixel when the light is out.
const DARK_LEVEL: u8 = 2;

/// A fault of the cameras: kind, start time, affected finger: `frozen@3`, `lost@2.5:left`. Without a time it begins at
/// the start, without a side it affects both fingers. Fingers are swapped from the start, and both of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFault {
    kind: CameraFaultKind,
    from_ns: u64,
    finger: Option<usize>,
}

impl CameraFault {
    /// The kind of fault.
    pub fn kind(&self) -> CameraFaultKind {
        self.kind
    }

    /// Whether left and right are exchanged. The images are then unchanged; the caller exchanges the mountings.
    pub fn swaps_fingers(&self) -> bool {
        self.kind == CameraFaultKind::Swapped
    }

    /// Whether it affects this finger: 0 left, 1 right.
    pub fn applies_to(&self, finger: usize) -> bool {
        self.finger.is_none_or(|hit| hit == finger)
    }
}

/// A text that does not describe a camera fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected lost, frozen, torn or dark with @SECONDS and :left or :right as wanted, or swapped (from the start on), got `{got}`"
)]
pub struct CameraFaultError {
    /// The text given.
    pub got: String,
}

impl FromStr for CameraFault {
    type Err = CameraFaultError;

    fn from_str(text: &str) -> Result<Self, CameraFaultError> {
        let refused = || CameraFaultError { got: text.into() };
        let (rest, finger) = match text.split_once(':') {
            Some((rest, side)) => {
                let finger = Side::NAMES.iter().position(|known| *known == side).ok_or_else(refused)?;
                (rest, Some(finger))
            }
            None => (text, None),
        };
        let (name, seconds) = rest.split_once('@').unwrap_or((rest, "0"));
        let (kind, _) = NAMES.iter().find(|(_, known)| *known == name).ok_or_else(refused)?;
        let seconds_s: f64 = seconds.parse().ok().filter(|s| (0.0..=LATEST_S).contains(s)).ok_or_else(refused)?;
        let fault = CameraFault { kind: *kind, from_ns: (seconds_s * 1e9) as u64, finger };
        // A time or a side would be without effect.
        if fault.swaps_fingers() && (fault.from_ns, fault.finger) != (0, None) {
            return Err(refused());
        }
        Ok(fault)
    }
}

impl fmt::Display for CameraFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(kind, _)| *kind == self.kind).map_or("", |(_, name)| name);
        write!(f, "{name}@{}", self.from_ns as f64 * 1e-9)?;
        self.finger.and_then(|finger| Side::NAMES.get(finger)).map_or(Ok(()), |side| write!(f, ":{side}"))
    }
}

/// A camera that fails at a given time and does not recover.
#[derive(Debug)]
pub struct CameraFaults<S> {
    source: S,
    fault: Option<CameraFault>,
    /// The image that a frozen camera repeats; None before the first image.
    last: Option<FrameBuffer>,
}

impl<S: FrameSource> CameraFaults<S> {
    /// The source with a fault; unchanged without a fault.
    pub fn new(source: S, fault: Option<CameraFault>) -> Self {
        CameraFaults { source, fault, last: None }
    }
}

impl<S: FrameSource> FrameSource for CameraFaults<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.source.next(into)?;
        let Some(fault) = self.fault.filter(|_| next == Next::Frame) else { return Ok(next) };
        let has_begun = into.time_ns.unwrap_or(0) >= fault.from_ns;
        match fault.kind {
            // Stored before the fault begins; a camera that is frozen from the start repeats its first image.
            CameraFaultKind::Frozen => match &mut self.last {
                Some(last) if has_begun => copy_image(last, into),
                Some(last) => copy_image(into, last),
                None => self.last = Some(into.clone()),
            },
            _ if !has_begun => {}
            CameraFaultKind::Lost => return Ok(Next::Silent),
            CameraFaultKind::Torn => return Ok(Next::Torn { reason: "cut off".into() }),
            CameraFaultKind::Dark => {
                into.pixels.fill(DARK_LEVEL);
                encode_again(into)?;
            }
            CameraFaultKind::Swapped => {}
        }
        Ok(next)
    }
}
