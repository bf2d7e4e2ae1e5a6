//! The finger at rest: found among the first frames, or named by the user.

use super::args::{RestArgument, Watch};
use crate::commands::recording;
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::finger_pipeline::{FoundRest, RestFinder, rest_from};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor;
use slipbound_rig::report_json::{RestOrigin, RestOriginKind};
use slipbound_rig::report_summary::{frame_name, torn};
use slipbound_rig::source::{self, AheadFrame, ReadAhead, most_common_size};
use std::fmt::Display;
use std::ops::Range;
use std::path::Path;

/// In the report and on standard error when the finger is never seen untouched.
const IN_CONTACT: &str = "starts in contact: displacement counts from the first stationary frames, the contact region of a \
                          smooth gel is taken from the imprint itself";

/// Behind what is said of frames that stand upright where the finger's lie.
pub const TURNED: &str = "; are the pictures turned by 90 degrees?";

/// The finger at rest, and what it was made from.
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
    recording: &mut ReadAhead,
    settings: &Settings,
    sensor_for: impl Fn(SizePx) -> Result<(Sensor, Option<String>), Failure>,
) -> Result<Found, Failure> {
    let given = args.rest.as_ref().and_then(|argument| given_frames(args, argument)).transpose()?;
    // Also when rest is given: one frame alone could be of an odd size.
    let window: Vec<&AheadFrame> = recording.read_ahead(settings.rest.window_count as usize).collect();
    let seen: Vec<&FrameBuffer> = window.iter().filter(|a| a.torn.is_none()).map(|a| &a.buffer).collect();
    let Some(size) = most_common_size(seen.iter().copied()) else {
        let first_torn = window.first().and_then(|a| Some(torn(&a.buffer, a.torn.as_deref()?)));
        return Err(match (recording.take_failure(), first_torn) {
            (Some(error), _) => error.into(),
            (None, Some(first)) => {
                anyhow!("{}: expected at least one whole frame, got none; {first}", args.source).into()
            }
            (None, None) => anyhow!("{}: expected frames, got none", args.source).into(),
        });
    };
    let other = given.iter().flatten().find(|frame| frame.size != size);
    if let (Some(argument), Some(other)) = (&args.rest, other) {
        let (got, source) = (other.size, &args.source);
        return Err(Failure::Arguments(anyhow!("{argument}: expected {size} as the frames of {source}, got {got}")));
    }
    let (sensor, note) = sensor_for(size)?;
    let is_turned = size.height > size.width && sensor.image_px.width > sensor.image_px.height;
    let hint = if is_turned { TURNED } else { "" };
    let wrong_sensor =
        |e| Failure::Arguments(anyhow!("{}: frames of {size}: sensor {}: {e}{hint}", args.source, sensor.name));
    let (rest, origin) = match (&args.rest, &given) {
        (Some(argument), Some(frames)) => {
            let builder = RestBuilder::new(&sensor, settings, size).map_err(wrong_sensor)?;
            (build_given(args, argument, frames, builder)?, origin_given(argument))
        }
        _ => {
            let mut finder = RestFinder::new(&sensor, settings, size).map_err(wrong_sensor)?;
            for frame in &seen {
                finder.see(frame).map_err(|e| Failure::work(&args.source, e))?;
            }
            let FoundRest { rest, seqs } = finder.find().map_err(|e| Failure::work(&args.source, e))?;
            if let (Some(argument @ RestArgument::Live(_)), RestKind::InContact) = (&args.rest, rest.kind()) {
                let source = &args.source;
                let expected = "expected a finger that nothing touches, got one in contact: free it and start again";
                return Err(anyhow!("{argument}: {source}: {expected}").into());
            }
            let origin = RestOrigin { kind: rest.kind().into(), frames: Some([seqs.start, seqs.end]) };
            (rest, origin)
        }
    };
    let report_note = (rest.kind() == RestKind::InContact).then(|| IN_CONTACT.to_owned());
    let notes = note.into_iter().chain(report_note.iter().map(|n| format!("{}: {n}", args.source))).collect();
    Ok(Found { rest, sensor, origin, report_note, notes })
}

/// The rest frame from the frames that the user named: all of them, in contact when most look touched.
fn build_given(
    args: &Watch,
    argument: &RestArgument,
    frames: &[FrameBuffer],
    builder: RestBuilder,
) -> Result<Rest, Failure> {
    let all: Result<Vec<Frame<'_>>, _> = frames.iter().map(FrameBuffer::frame).collect();
    let all = all.map_err(|e| Failure::work(&args.source, e))?;
    rest_from(builder, &all).map_err(|(place, e)| match place.and_then(|i| frames.get(i)) {
        Some(frame) => Failure::Arguments(anyhow!("{argument}: {}: {e}", frame_name(frame))),
        None => Failure::work(&args.source, e),
    })
}

fn origin_given(argument: &RestArgument) -> RestOrigin {
    let frames = match argument {
        RestArgument::Frames(range) => Some([range.start, range.end]),
        RestArgument::Image(_) | RestArgument::Live(_) => None,
    };
    RestOrigin { kind: RestOriginKind::Given, frames }
}

/// The frames that the user named; None where they are those that come first.
fn given_frames(args: &Watch, argument: &RestArgument) -> Option<Result<Vec<FrameBuffer>, Failure>> {
    match argument {
        RestArgument::Image(path) => Some(image(path)),
        RestArgument::Frames(range) => Some(frames(&args.source, range)),
        RestArgument::Live(_) => None,
    }
}

/// The frame of an image file.
fn image(path: &Path) -> Result<Vec<FrameBuffer>, Failure> {
    let shown = path.display().to_string();
    let refused = |why: &dyn Display| Failure::Arguments(anyhow!("--rest {shown}: {why}"));
    let mut recording = ReadAhead::new(source::open(&shown).map_err(|e| refused(&e))?);
    let mut all = recording.read_ahead(2).map(|a| (a.buffer.clone(), a.torn.clone()));
    match (all.next(), all.next()) {
        (Some((frame, None)), None) => Ok(vec![frame]),
        (Some((_, Some(reason))), None) => Err(refused(&reason)),
        (Some(_), Some(_)) => Err(refused(&"expected one image or A..B, got a recording of several frames")),
        (None, _) => Err(refused(&"expected an image, got no frame")),
    }
}

/// Frames of the source, opened a second time. Torn ones are passed over.
fn frames(source: &str, range: &Range<u64>) -> Result<Vec<FrameBuffer>, Failure> {
    let mut recording = recording::open(source)?;
    let (mut frames, mut frames_count) = (Vec::new(), 0);
    let mut buffer = FrameBuffer::default();
    while frames_count < range.end {
        match recording.next(&mut buffer)? {
            Next::End => {
                let (from, to, last) = (range.start, range.end, range.end - 1);
                return Err(Failure::Arguments(anyhow!(
                    "--rest {from}..{to}: {source} ends before frame {last}: it has {frames_count} frames"
                )));
            }
            Next::Silent => continue,
            Next::Frame if range.contains(&buffer.seq) => frames.push(buffer.clone()),
            Next::Frame | Next::Torn { .. } => {}
        }
        frames_count = buffer.seq + 1;
    }
    match frames.is_empty() {
        true => Err(Failure::Arguments(anyhow!("--rest {}..{}: every frame is torn", range.start, range.end))),
        false => Ok(frames),
    }
}
