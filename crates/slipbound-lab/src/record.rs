//! A trial as a folder that can be replayed, scored and generated again.
//!
//! ```text
//!   FOLDER/frame_000000.jpg ...   frames, named by their numbers
//!          truth.jsonl            a header, then what is true of each frame, a JSON object a line
//!          sensor.toml            the finger, for `slipbound watch FOLDER --sensor FOLDER/sensor.toml`
//!          rest/rest.jpg          the finger at rest, in a folder of its own so that it is not taken for a frame
//!          scene.toml             scene, seed, every parameter and the version: all it takes to make it again
//! ```

use crate::faults::Faulty;
use crate::scenes::Trial;
use crate::world::{FrameTruth, Gross, TRUTH_FORMAT_VERSION, TruthHeader, World, complete};
use serde::{Deserialize, Serialize};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::setting::{SettingError, nearest};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Why a trial was not recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The trial is invalid.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The folder is not empty.
    #[error("{path}: expected an empty or a new folder, got one with files in it", path = .path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A file cannot be written.
    #[error("{path}: cannot write: {source}", path = .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A scene file cannot be read.
    #[error("{path}: expected a scene file: {problem}", path = .path.display())]
    SceneFile {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: String,
    },
    /// The image of a frame cannot be generated.
    #[error("frame {frame}: {source}")]
    Frame {
        /// Its number.
        frame: u64,
        /// Why.
        source: SourceError,
    },
    /// The caller stopped it.
    #[error("interrupted after {frames_count} frames; what was written is kept, but there is no truth.jsonl")]
    Interrupted {
        /// Frames written.
        frames_count: u64,
    },
}

/// What was recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// Frames written, torn ones too.
    pub frames_count: u64,
    /// Torn ones among them.
    pub torn_count: u64,
    /// Frames in which gel or object strain beyond the linear range.
    pub beyond_linear_count: u64,
    /// Frames in which the contact reaches the border of the pad.
    pub at_border_count: u64,
    /// Frames in which a solver did not meet its tolerance.
    pub unconverged_count: u64,
    /// Whether the scene loads the object; gross slip is looked for only under load.
    pub is_loaded: bool,
    /// When the object began to slide as a whole.
    pub gross: Option<Gross>,
}

/// A scene file.
#[derive(Debug, Serialize, Deserialize)]
struct SceneFile {
    /// The version that wrote the file; another version may generate other frames.
    #[serde(default)]
    software_version: String,
    #[serde(flatten)]
    trial: Trial,
}

/// Its keys.
const SCENE_KEYS: [&str; 4] = ["software_version", "scene", "seed", "set"];

/// Longest scene file, bytes: the limit for a file that is not a scene file, or a device that never ends.
const MOST_BYTES: u64 = 1 << 20;

/// Reads the trial of a scene file.
pub fn read_scene(path: &Path) -> Result<Trial, RecordError> {
    let bad = |problem: String| RecordError::SceneFile { path: path.to_owned(), problem };
    let mut text = String::new();
    let file = File::open(path).map_err(|error| bad(error.to_string()))?;
    file.take(MOST_BYTES + 1).read_to_string(&mut text).map_err(|error| bad(error.to_string()))?;
    if text.len() as u64 > MOST_BYTES {
        return Err(bad(format!("expected at most {MOST_BYTES} bytes, got more")));
    }
    let table: toml::Table = toml::from_str(&text).map_err(|error| bad(error.message().to_owned()))?;
    // The flattened trial accepts every key and ignores unknown ones.
    if let Some(unknown) = table.keys().find(|key| !SCENE_KEYS.contains(&key.as_str())) {
        let meant = nearest(unknown, &SCENE_KEYS).map_or_else(String::new, |key| format!("; did you mean `{key}`?"));
        return Err(bad(format!("unknown key `{unknown}`{meant}")));
    }
    if let Some(problem) = wrong_kind(&table) {
        return Err(bad(problem));
    }
    let file: SceneFile = toml::from_str(&text).map_err(|error| bad(error.message().to_owned()))?;
    Ok(file.trial)
}

/// A value of another kind than its key takes: the messages of the flattened trial do not name the key.
fn wrong_kind(table: &toml::Table) -> Option<String> {
    let unless = |is_right: bool, key: &str, expected: &str, got: &toml::Value| {
        (!is_right).then(|| format!("{key}: expected {expected}, got {got}"))
    };
    table.iter().find_map(|(key, value)| match (key.as_str(), value) {
        ("seed", got) => unless(got.as_integer().is_some_and(|seed| seed >= 0), key, "a whole number, 0 or above", got),
        ("set", toml::Value::Table(set)) => set.iter().find_map(|(key, got)| {
            unless(got.is_str() || got.is_integer() || got.is_float(), &format!("set.{key}"), "a number or a text", got)
        }),
        ("set", got) => unless(false, key, "a table of parameters", got),
        (_, got) => unless(got.is_str(), key, "a text", got),
    })
}

/// Runs a trial and writes it to a folder. `go_on` is called after every frame; false stops the run.
pub fn record(
    trial: &Trial,
    folder: &Path,
    mut go_on: impl FnMut(&FrameTruth) -> bool,
) -> Result<Recorded, RecordError> {
    let mut world = World::new(trial)?;
    make_empty(&folder.join("rest"), folder)?;
    let mut rest = Vec::new();
    world.render_rest(&mut rest).map_err(|source| RecordError::Frame { frame: 0, source })?;
    write(&folder.join("rest/rest.jpg"), &rest)?;
    write_toml(&folder.join("sensor.toml"), &world.sensor())?;
    let file = SceneFile { software_version: env!("CARGO_PKG_VERSION").into(), trial: trial.clone() };
    write_toml(&folder.join("scene.toml"), &file)?;

    let (mut truths, mut torn_count, mut events_count) = (Vec::new(), 0, 0);
    let mut source = Faulty::new(world, trial.faults().unwrap_or_default(), trial.seed);
    let mut frame = FrameBuffer::default();
    loop {
        let next = source.next(&mut frame).map_err(|source| RecordError::Frame { frame: frame.seq, source })?;
        match next {
            Next::End => break,
            Next::Silent => continue,
            Next::Torn { .. } => torn_count += 1,
            Next::Frame => {}
        }
        write(&folder.join(format!("frame_{:06}.jpg", frame.seq)), &frame.encoded)?;
        let world = source.source();
        // Those of dropped frames too.
        let events = world.events()[events_count..].to_vec();
        events_count = world.events().len();
        truths.push(FrameTruth { events, ..world.truth().clone() });
        if !go_on(world.truth()) {
            return Err(RecordError::Interrupted { frames_count: truths.len() as u64 });
        }
    }
    let world = source.source();
    complete(&mut truths, world.gross());
    write_truth(&folder.join("truth.jsonl"), world, &truths)?;
    let counted = |of: fn(&FrameTruth) -> bool| truths.iter().filter(|truth| of(truth)).count() as u64;
    Ok(Recorded {
        frames_count: truths.len() as u64,
        torn_count,
        beyond_linear_count: counted(|truth| truth.beyond_linear),
        at_border_count: counted(|truth| truth.at_border),
        unconverged_count: counted(|truth| !truth.converged),
        is_loaded: truths.iter().any(|truth| truth.load.is_some()),
        gross: world.gross(),
    })
}

fn write_truth(path: &Path, world: &World, truths: &[FrameTruth]) -> Result<(), RecordError> {
    let failed = |source: io::Error| RecordError::Write { path: path.to_owned(), source };
    let header = TruthHeader {
        format: "slipbound-truth".into(),
        format_version: TRUTH_FORMAT_VERSION,
        software_version: env!("CARGO_PKG_VERSION").into(),
        trial: world.trial().clone(),
        grid: world.grid(),
        markers_at_rest_mm: world.markers_at_rest_mm().to_vec(),
        gross: world.gross(),
    };
    let mut to = BufWriter::new(File::create(path).map_err(failed)?);
    let mut line = |json: serde_json::Result<Vec<u8>>| -> io::Result<()> {
        to.write_all(&json?)?;
        to.write_all(b"\n")
    };
    line(serde_json::to_vec(&header)).map_err(failed)?;
    for truth in truths {
        line(serde_json::to_vec(truth)).map_err(failed)?;
    }
    to.flush().map_err(failed)
}

/// Makes a folder within `whole`, which must be empty.
fn make_empty(folder: &Path, whole: &Path) -> Result<(), RecordError> {
    let failed = |source| RecordError::Write { path: whole.to_owned(), source };
    match fs::read_dir(whole).map(|mut entries| entries.next().is_some()) {
        Ok(true) => return Err(RecordError::NotEmpty { path: whole.to_owned() }),
        Ok(false) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(failed(error)),
    }
    fs::create_dir_all(folder).map_err(failed)
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), RecordError> {
    fs::write(path, bytes).map_err(|source| RecordError::Write { path: path.to_owned(), source })
}

fn write_toml(path: &Path, value: &impl Serialize) -> Result<(), RecordError> {
    let text = toml::to_string(value)
        .map_err(|error| RecordError::Write { path: path.to_owned(), source: io::Error::other(error) })?;
    write(path, text.as_bytes())
}
