//! The finger at rest: found among the first frames, or named by the user.

use super::Watch;
use super::recording::{Ahead, Recording};
use super::summary::{called, torn};
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::image::SizePx;
use slipbound::monitor::{Rest, RestBuilder, RestKind, RestLook, Settings};
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;
use slipbound_rig::report_json::{RestOrigin, RestOriginKind};
use slipbound_rig::source;
use std::fmt::{self, Display, Formatter};
use std::ops::Range;
use std::path::PathBuf;

/// Said in the report and on standard error when the finger is never seen untouched.
const IN_CONTACT: &str = "starts in contact: displacement counts from the first calm frames, the contact region of a \
                          smooth gel is taken from the imprint itself";

/// The argument `--rest`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RestArgument {
    /// Frames of the source.
    Frames(Range<u64>),
    /// An image of its own.
    Image(PathBuf),
}

impl RestArgument {
    /// `A..B`, or the name of an image.
    pub fn parse(text: &str) -> Result<Self, String> {
        let is_range = text.contains("..") && text.chars().all(|c| c == '.' || c.is_ascii_digit());
        let range = text.split_once("..").and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
        match range {
            Some(frames) if frames.is_empty() => Err(format!("expected A below B, got {text}")),
            Some(frames) => Ok(RestArgument::Frames(frames)),
            None if is_range => Err(format!("expected two whole numbers A..B, got {text}")),
            None => Ok(RestArgument::Image(text.into())),
        }
    }
}

impl Display for RestArgument {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            RestArgument::Frames(range) => write!(f, "--rest {}..{}", range.start, range.end),
            RestArgument::Image(path) => write!(f, "--rest {}", path.display()),
        }
    }
}

/// The finger at rest, and where that knowledge is from.
pub struct Found {
    /// The rest frame.
    pub rest: Rest,
    /// The finger.
    pub sensor: Sensor,
    /// For the report's header.
    pub origin: RestOrigin,
    /// For the report's header.
    pub report_note: Option<String>,
    /// For standard error.
    pub notes: Vec<String>,
}

/// Finds the finger at rest. `sensor_for`: the finger for frames of a size, with a note where that was a choice.
pub fn find(
    args: &Watch,
    recording: &mut Recording,
    settings: &Settings,
    sensor_for: impl Fn(SizePx) -> Result<(Sensor, Option<String>), Failure>,
) -> Result<Found, Failure> {
    let given = match &args.rest {
        None => None,
        Some(RestArgument::Image(path)) => Some((image(path)?, None)),
        Some(RestArgument::Frames(range)) => Some((frames(args, range)?, Some([range.start, range.end]))),
    };
    // Also when rest is given: one frame alone could be of an odd size.
    let window: Vec<&Ahead> = recording.read_ahead(settings.rest.window_count as usize).collect();
    let whole: Vec<&FrameBuffer> = match &given {
        Some((frames, _)) => frames.iter().collect(),
        None => window.iter().filter(|a| a.torn.is_none()).map(|a| &a.frame).collect(),
    };
    let seen: Vec<&FrameBuffer> = window.iter().filter(|a| a.torn.is_none()).map(|a| &a.frame).collect();
    let Some(size) = most_common_size(&seen) else {
        let first_torn = window.first().and_then(|a| Some(torn(&a.frame, a.torn.as_deref()?)));
        return Err(match (recording.take_failure(), first_torn) {
            (Some(e), _) => Failure::Work(anyhow::Error::from_boxed(e)),
            (None, Some(first)) => {
                anyhow!("{}: expected at least one whole frame, got none; {first}", args.source).into()
            }
            (None, None) => anyhow!("{}: expected frames, got none", args.source).into(),
        });
    };
    if let (Some(argument), Some(other)) = (&args.rest, whole.iter().find(|f| f.size != size)) {
        let (got, source) = (other.size, &args.source);
        return Err(Failure::Arguments(anyhow!("{argument}: expected {size} as the frames of {source}, got {got}")));
    }
    let (sensor, note) = sensor_for(size)?;
    let wrong_sensor =
        |e| Failure::Arguments(anyhow!("{}: frames of {size}: sensor {}: {e}", args.source, sensor.name));
    let mut builder = RestBuilder::new(&sensor, settings, size).map_err(wrong_sensor)?;
    let failed = |e| Failure::work(&args.source, e);

    let looks: Vec<RestLook> = whole.iter().flat_map(|f| f.frame().ok()).map(|f| builder.look(&f)).collect();
    let (chosen, kind, origin) = match given.as_ref() {
        Some((_, frames)) => {
            let touched_count = looks.iter().filter(|l| l.touched).count();
            let kind = if 2 * touched_count > looks.len() { RestKind::InContact } else { RestKind::Unloaded };
            (0..whole.len(), kind, RestOrigin { kind: RestOriginKind::Given, frames: *frames })
        }
        None => {
            let choice = builder.choose(&looks).map_err(failed)?;
            let seqs = [whole[choice.frames.start].seq, whole[choice.frames.end - 1].seq + 1];
            (choice.frames, choice.kind, RestOrigin { kind: choice.kind.into(), frames: Some(seqs) })
        }
    };
    for buffer in &whole[chosen] {
        let frame = buffer.frame().map_err(|e| Failure::work(&args.source, e))?;
        builder.add(&frame).map_err(|e| match &args.rest {
            Some(argument) => Failure::Arguments(anyhow!("{argument}: {}: {e}", called(buffer))),
            None => failed(e),
        })?;
    }
    let rest = builder.build(kind).map_err(failed)?;
    let report_note = (kind == RestKind::InContact).then(|| IN_CONTACT.to_owned());
    let notes = note.into_iter().chain(report_note.iter().map(|n| format!("{}: {n}", args.source))).collect();
    Ok(Found { rest, sensor, origin, report_note, notes })
}

/// The size that most frames have; of equally many the first.
fn most_common_size(frames: &[&FrameBuffer]) -> Option<SizePx> {
    let count = |size: SizePx| frames.iter().filter(|f| f.size == size).count();
    frames.iter().map(|f| f.size).rev().max_by_key(|&size| count(size))
}

/// The frame of an image file.
fn image(path: &std::path::Path) -> Result<Vec<FrameBuffer>, Failure> {
    let shown = path.display().to_string();
    let refused = |why: &dyn Display| Failure::Arguments(anyhow!("--rest {shown}: {why}"));
    let mut recording = Recording::new(source::open(&shown).map_err(|e| refused(&e))?);
    let mut all = recording.read_ahead(2).map(|a| (a.frame.clone(), a.torn.clone()));
    match (all.next(), all.next()) {
        (Some((frame, None)), None) => Ok(vec![frame]),
        (Some((_, Some(reason))), None) => Err(refused(&reason)),
        (Some(_), Some(_)) => Err(refused(&"expected one image or A..B, got a recording of several frames")),
        (None, _) => Err(refused(&"expected an image, got no frame")),
    }
}

/// Frames of the source, read on their own. Torn ones are passed over.
fn frames(args: &Watch, range: &Range<u64>) -> Result<Vec<FrameBuffer>, Failure> {
    let mut recording = args.open()?;
    let mut frames = Vec::new();
    let mut frames_count = 0;
    loop {
        let arrived = recording.next()?;
        let frame = recording.frame();
        match arrived {
            super::Arrived::Over => {
                let (from, to, last) = (range.start, range.end, range.end - 1);
                let source = &args.source;
                return Err(Failure::Arguments(anyhow!(
                    "--rest {from}..{to}: {source} ends before frame {last}: it has {frames_count} frames"
                )));
            }
            super::Arrived::Whole if range.contains(&frame.seq) => frames.push(frame.clone()),
            _ => {}
        }
        frames_count = frame.seq + 1;
        if frames_count >= range.end {
            break;
        }
    }
    if frames.is_empty() {
        return Err(Failure::Arguments(anyhow!("--rest {}..{}: every frame is torn", range.start, range.end)));
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_or_an_image() {
        assert_eq!(RestArgument::parse("3..9"), Ok(RestArgument::Frames(3..9)));
        assert_eq!(RestArgument::parse("../a.png"), Ok(RestArgument::Image("../a.png".into())));
        assert_eq!(RestArgument::parse("../..jpg"), Ok(RestArgument::Image("../..jpg".into())));
        for half in ["3..", "..3", "..", "3...5", "1..99999999999999999999"] {
            assert_eq!(RestArgument::parse(half), Err(format!("expected two whole numbers A..B, got {half}")));
        }
        assert_eq!(RestArgument::parse("9..9"), Err("expected A below B, got 9..9".into()));
    }

    #[test]
    fn the_most_common_size_wins_then_the_first() {
        let of = |w| FrameBuffer { size: SizePx::new(w, 1), ..FrameBuffer::default() };
        let (a, b) = (of(1), of(2));
        assert_eq!(most_common_size(&[&a, &b, &b]), Some(b.size));
        assert_eq!(most_common_size(&[&a, &b]), Some(a.size));
        assert_eq!(most_common_size(&[]), None);
    }
}
