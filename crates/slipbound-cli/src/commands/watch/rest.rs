//! The rest frame: found among the first frames, or named by the user.

use super::args::{RestArgument, Watch};
use crate::commands::finger::TURNED;
use crate::commands::recording;
use crate::commands::rest_window::Window;
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::finger_pipeline::{FoundRest, rest_from};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor;
use slipbound_rig::report_json::{RestOrigin, RestOriginKind};
use slipbound_rig::report_summary::frame_name;
use slipbound_rig::rest_file::{RestFileError, SavedRest, is_rest};
use slipbound_rig::source::{self, ReadAhead};
use std::fmt::Display;
use std::ops::Range;
use std::path::Path;

/// In the report and on standard error when the finger is never seen untouched.
const IN_CONTACT: &str = "starts in contact: displacement counts from the first stationary frames, the contact region of a \
                          smooth gel is taken from the imprint itself (if nothing touches it there, the frames are noisier \
                          or more compressed than the sensor file knows: calibrate anew on such frames)";

/// The same if the settings say so.
const HELD: &str = "an object is held from the first frame on: displacement counts from the first stationary frames, the contact \
                    region of a smooth gel is taken from the imprint itself";

/// The same if no first frames stand still.
const IN_MOTION: &str = "starts in motion: none of the first frames is stationary, and displacement counts from the first one, as if \
                         something touched the finger there";

/// The rest frame, and what it was made from.
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

/// Finds the rest frame. `sensor_for`: the finger for frames of a size, given the finger of a saved rest frame under a
/// name, with a note where it was a choice. `silence`: told after every look at the source whether it was silent.
pub fn find(
    args: &Watch,
    recording: &mut ReadAhead,
    settings: &Settings,
    silence: impl FnMut(bool),
    sensor_for: impl Fn(SizePx, Option<(&Sensor, &str)>) -> Result<(Sensor, Option<String>), Failure>,
) -> Result<Found, Failure> {
    let given = args.rest.as_ref().and_then(|argument| given(args, argument)).transpose()?;
    // Also when rest is given: a single frame could have an odd size.
    let window = Window::read(&args.source, recording, settings.rest.window_count, silence)?;
    let other = given.as_ref().and_then(|given| given.sizes().into_iter().find(|size| *size != window.size));
    if let (Some(argument), Some(got)) = (&args.rest, other) {
        let (size, source) = (window.size, &args.source);
        let hint = if got.is_turned_from(size) { TURNED } else { "" };
        return Err(Failure::Arguments(anyhow!(
            "{argument}: expected {size} as the frames of {source}, got {got}{hint}"
        )));
    }
    let saved = given.as_ref().and_then(RestInput::finger);
    let (sensor, note) = sensor_for(window.size, saved)?;
    let mut is_moving = false;
    let (rest, origin) = match (&args.rest, given) {
        (Some(_), Some(RestInput::Saved(saved, file))) => {
            saved.check(&sensor, settings, &file).map_err(refused)?;
            (saved.rest, RestOrigin { kind: RestOriginKind::Given, frames: None })
        }
        (Some(argument), Some(RestInput::Frames(frames))) => {
            let builder = RestBuilder::new(&sensor, settings, window.size).map_err(|e| window.refused(&sensor, e))?;
            (build_given(args, argument, &frames, builder)?, origin_given(argument))
        }
        (argument, _) => {
            let live = argument.as_ref().filter(|argument| matches!(argument, RestArgument::Live(_)));
            let found = window.rest(&sensor, settings, live.map(|live| live as &dyn Display))?;
            let FoundRest { rest, seqs, .. } = found;
            is_moving = found.is_moving;
            let origin = RestOrigin { kind: rest.kind().into(), frames: Some([seqs.start, seqs.end]) };
            (rest, origin)
        }
    };
    let held = settings.rest.held;
    let said = match () {
        _ if is_moving => IN_MOTION,
        _ if held => HELD,
        _ => IN_CONTACT,
    };
    let report_note = (rest.kind() == RestKind::InContact).then(|| said.to_owned());
    let told = report_note.iter().filter(|_| !held || is_moving).map(|n| format!("{}: {n}", args.source));
    let notes = note.into_iter().chain(told).collect();
    Ok(Found { rest, sensor, origin, report_note, notes })
}

/// What the user named for the rest frame.
enum RestInput {
    /// Frames.
    Frames(Vec<FrameBuffer>),
    /// A saved rest frame, and the name of its file.
    Saved(Box<SavedRest>, String),
}

impl RestInput {
    fn sizes(&self) -> Vec<SizePx> {
        match self {
            RestInput::Frames(frames) => frames.iter().map(|frame| frame.size).collect(),
            RestInput::Saved(saved, _) => vec![saved.rest.size()],
        }
    }

    /// The finger, if the file states it, and the file.
    fn finger(&self) -> Option<(&Sensor, &str)> {
        match self {
            RestInput::Frames(_) => None,
            RestInput::Saved(saved, file) => Some((&saved.made_of.sensor, file)),
        }
    }
}

fn refused(e: RestFileError) -> Failure {
    Failure::Arguments(anyhow!("--rest {e}"))
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
        RestArgument::File(_) | RestArgument::Live(_) | RestArgument::Held => None,
    };
    RestOrigin { kind: RestOriginKind::Given, frames }
}

/// What the user named; None for the first frames.
fn given(args: &Watch, argument: &RestArgument) -> Option<Result<RestInput, Failure>> {
    match argument {
        RestArgument::File(path) if is_rest(path) => {
            let saved = SavedRest::read(path).map_err(refused);
            Some(saved.map(|saved| RestInput::Saved(Box::new(saved), path.display().to_string())))
        }
        RestArgument::File(path) => Some(image(path).map(RestInput::Frames)),
        RestArgument::Frames(range) => Some(frames(&args.source, range).map(RestInput::Frames)),
        RestArgument::Live(_) | RestArgument::Held => None,
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

/// Refuses frames of a source that cannot be opened a second time, without opening it.
pub fn refuse_second_reading(args: &Watch) -> Result<(), Failure> {
    let Some(argument @ RestArgument::Frames(_)) = &args.rest else { return Ok(()) };
    if source::is_repeatable(&args.source) {
        return Ok(());
    }
    let got = match args.source.as_str() {
        "-" => "standard input".to_owned(),
        uri if source::is_live(uri) => format!("the camera {uri}"),
        uri => format!("{uri}, a pipe or a device"),
    };
    let expected = "expected a recording that can be read twice";
    Err(Failure::Arguments(anyhow!("{argument}: {expected}, got {got}; use --rest live:N, its first N frames")))
}

/// Frames of the source, opened a second time. Torn ones are skipped.
fn frames(source: &str, range: &Range<u64>) -> Result<Vec<FrameBuffer>, Failure> {
    let mut recording = recording::open(source)?;
    let (mut frames, mut frames_count) = (Vec::new(), 0);
    let (mut first_seq, mut is_torn) = (None, false);
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
            Next::Torn { .. } => is_torn |= range.contains(&buffer.seq),
            Next::Frame => {}
        }
        first_seq.get_or_insert(buffer.seq);
        frames_count = buffer.seq + 1;
    }
    let refused = |why: String| Err(Failure::Arguments(anyhow!("--rest {}..{}: {why}", range.start, range.end)));
    match (frames.is_empty(), is_torn) {
        (false, _) => Ok(frames),
        (true, true) => refused("every frame is torn".into()),
        (true, false) => {
            refused(format!("{source} has no frame there; its first is frame {}", first_seq.unwrap_or_default()))
        }
    }
}
