//! SOURCE of a command: a recording, a camera, or `sim:SCENE?key=value&key=value` for a simulated one.

use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::port::FrameSource;
use slipbound::sensor::Sensor;
use slipbound_lab::faults::Faulty;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::container::{Inlet, MarkedSource, Recorder, TappedSource};
use slipbound_rig::link::now_ns;
use slipbound_rig::sensors::{self, RecordingError};
use slipbound_rig::source::{self, Arrivals, Awaited, Camera, CameraTally, Encoded, Newest, ReadAhead};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A camera whose frames are read on a thread of their own, which keeps the newest.
pub struct LiveCamera {
    /// What was negotiated and locked.
    pub facts: Vec<(String, String)>,
    /// Counts of its frames before they were judged.
    pub tally: Arc<CameraTally>,
    /// Counts the frames that were not judged because a newer one came.
    pub arrivals: Arrivals,
}

impl LiveCamera {
    /// Counts and losses of its frames, in one line.
    pub fn line(&self) -> String {
        format!("{}; {} not judged because a newer one was there", self.tally.counts(), self.arrivals.replaced_count())
    }
}

/// Opens a recording, a camera, or starts a simulation.
pub fn open(source: &str) -> Result<ReadAhead, Failure> {
    open_watched(source, None).map(|(recording, _)| recording)
}

/// The same, with the facts of a camera; every frame goes to the recorder too, if there is one.
pub fn open_watched(source: &str, recorder: Option<&Recorder>) -> Result<(ReadAhead, Option<LiveCamera>), Failure> {
    let inlet = recorder.map(Recorder::inlet);
    if source::is_live(source) {
        let (newest, live) = open_live(source, inlet.as_ref(), 0, false)?;
        return Ok((ReadAhead::live(Box::new(Awaited(newest)), source, now_ns), Some(live)));
    }
    let recording = open_recording(source)?;
    Ok((
        ReadAhead::new(match inlet {
            Some(inlet) => Box::new(TappedSource::new(recording, 0, inlet, true)),
            None => recording,
        }),
        None,
    ))
}

/// A recording, or a simulation of one.
pub fn open_recording(source: &str) -> Result<Box<dyn FrameSource + Send>, Failure> {
    match scene(source) {
        Some(scene) => simulate(scene),
        None => source::open(source).map_err(refused),
    }
}

/// A source that marks its frames in the recording, if there is one, when they are taken to be judged. `waits`: whether
/// it waits for the disk instead of losing a mark.
pub fn marked(
    source: impl FrameSource + Send + 'static,
    inlet: Option<Inlet>,
    finger: usize,
    waits: bool,
) -> Box<dyn FrameSource + Send> {
    match inlet {
        Some(inlet) => Box::new(MarkedSource::new(source, finger, inlet, waits)),
        None => Box::new(source),
    }
}

/// A camera on a thread of its own; every frame that arrives goes to the recorder too, if there is one. `encoded`:
/// whether frames that come as pixels only are encoded there.
pub fn open_live(
    uri: &str,
    inlet: Option<&Inlet>,
    finger: usize,
    encoded: bool,
) -> Result<(Newest, LiveCamera), Failure> {
    let Camera { mut source, facts, tally } = source::open_camera(uri).map_err(refused)?;
    if let Some(inlet) = inlet {
        source = Box::new(TappedSource::new(source, finger, inlet.clone(), false));
    }
    if encoded {
        source = Box::new(Encoded(source));
    }
    let newest = Newest::new(source);
    let live = LiveCamera { facts, tally, arrivals: newest.arrivals() };
    Ok((newest, live))
}

/// A source that cannot be opened or that fails.
pub fn refused(e: source::Error) -> Failure {
    match e {
        source::Error::Missing { .. }
        | source::Error::Pattern { .. }
        | source::Error::NoImages { .. }
        | source::Error::OtherImages { .. }
        | source::Error::Address { .. } => Failure::arguments(e),
        other => Failure::Work(other.into()),
    }
}

/// Refuses several images of one folder: each would be a recording of one frame. A shell makes them of a pattern that is
/// not quoted.
pub fn refuse_images_of_one_folder(sources: &[String]) -> Result<(), Failure> {
    let mut counts: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for image in sources.iter().map(Path::new).filter(|path| path.is_file() && source::has_image_name(path)) {
        let folder = image.canonicalize().ok().and_then(|image| image.parent().map(Path::to_owned));
        folder.into_iter().for_each(|folder| *counts.entry(folder).or_default() += 1);
    }
    match counts.into_iter().find(|(_, count)| *count > 1) {
        None => Ok(()),
        Some((folder, count)) => Err(Failure::Arguments(anyhow!(
            "expected recordings, got {count} images of {}, each as a recording of its own: for one recording name the \
             folder, or quote the pattern",
            folder.display()
        ))),
    }
}

/// The finger of a simulated source; None for a recording.
pub fn simulated_sensor(source: &str) -> Result<Option<Sensor>, Failure> {
    let Some(scene) = scene(source) else { return Ok(None) };
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    World::new(&trial).map(|world| Some(world.sensor())).map_err(Failure::arguments)
}

/// The finger that a recording brings along, and its place.
pub fn enclosed_sensor(source: &str) -> Result<Option<(Sensor, String)>, Failure> {
    sensors::of_recording(source).map_err(|error| match error {
        RecordingError::Sensor(error) => Failure::arguments(error),
        RecordingError::Source(error) => refused(error),
    })
}

fn scene(source: &str) -> Option<&str> {
    source.strip_prefix("sim:")
}

fn simulate(scene: &str) -> Result<Box<dyn FrameSource + Send>, Failure> {
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    let world = World::new(&trial).map_err(Failure::arguments)?;
    Ok(match trial.faults() {
        Some(faults) => Box::new(Faulty::new(world, faults, trial.seed)),
        None => Box::new(world),
    })
}
