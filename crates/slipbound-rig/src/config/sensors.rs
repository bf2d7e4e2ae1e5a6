//! Known fingers: one sensor file each, built in from `sensors/` or written by the user.
//!
//! ```toml
//! extends = "gelslim"       # a built-in name, or a file beside this one
//! serial = "GS-007"
//! pitch_px = 15.1           # keys given here replace the extended ones, tables key by key
//! ```

use super::error::Error;
use super::layer::{Layer, file_of_key, typed};
use crate::replaced_file::ReplacedFile;
use crate::source;
use slipbound::image::SizePx;
use slipbound::sensor::Sensor;
use slipbound::setting::nearest;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Name and text of every file in `sensors/`.
const BUILT_IN: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/sensors.rs"));

/// The names of the built-in fingers.
pub fn names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// A finger by its built-in name or its `FILE.toml`; its facts are checked.
pub fn load(name_or_file: &str) -> Result<Sensor, Error> {
    checked(&layers(name_or_file, Path::new(""))?)
}

/// A finger from the text of a sensor file; messages call the text `what`. A file that it extends is searched in the
/// working directory.
pub fn parse(text: &str, what: &str) -> Result<Sensor, Error> {
    checked(&extended(Layer::parse(what.to_owned(), text)?, Vec::new(), PathBuf::new())?)
}

/// A finger from the text that is to be written to a file: as [`load`] would read it there.
pub fn parse_for(text: &str, path: &Path) -> Result<Sensor, Error> {
    let place = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    checked(&extended(Layer::parse(path.display().to_string(), text)?, vec![place], folder)?)
}

/// Writes the text of a sensor file if it is a valid one; otherwise, and on any failure, an existing file stays as it
/// is.
pub fn write(text: &str, path: &Path) -> Result<Sensor, WriteError> {
    let sensor = parse_for(text, path)?;
    let written = ReplacedFile::create(path).and_then(|mut file| {
        file.file().write_all(text.as_bytes())?;
        file.keep()
    });
    written.map_err(|source| WriteError::Write { path: path.to_owned(), source })?;
    Ok(sensor)
}

/// Why a sensor file is not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The text is no valid sensor file.
    #[error(transparent)]
    Invalid(#[from] Error),
    /// The file cannot be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

/// The text of a sensor file with all facts in it, such that [`parse`] gives the same finger.
pub fn to_toml(sensor: &Sensor) -> Result<String, toml::ser::Error> {
    toml::to_string(sensor)
}

/// The built-in fingers whose frames have exactly this size.
pub fn of_frames(size: SizePx) -> Result<Vec<Sensor>, Error> {
    let all: Result<Vec<Sensor>, Error> = names().map(load).collect();
    Ok(all?.into_iter().filter(|sensor| sensor.image_px == size).collect())
}

/// The sensor file beside the images of a recording, as `slipbound simulate` writes it.
pub fn beside(uri: &str) -> Option<PathBuf> {
    let first = source::image_files(uri).into_iter().next()?;
    Some(first.with_file_name("sensor.toml")).filter(|file| file.is_file())
}

/// The finger that a recording brings along, and its place: the one [`beside`] its images, or the one in an MCAP
/// recording of ours. None where there is neither.
pub fn of_recording(uri: &str) -> Result<Option<(Sensor, String)>, RecordingError> {
    if let Some(file) = beside(uri) {
        let place = file.display().to_string();
        return Ok(Some((load(&place)?, place)));
    }
    within(uri)
}

#[cfg(feature = "mcap")]
fn within(uri: &str) -> Result<Option<(Sensor, String)>, RecordingError> {
    let Some((file, topic)) = source::mcap_file(uri).filter(|(file, _)| source::has_ending(Path::new(file), "mcap"))
    else {
        return Ok(None);
    };
    let attached = crate::container::attached_sensor(Path::new(file), topic)?;
    let Some((name, text)) = attached else { return Ok(None) };
    let place = format!("{name} of {file}");
    Ok(Some((parse(&text, &place)?, place)))
}

#[cfg(not(feature = "mcap"))]
fn within(_uri: &str) -> Result<Option<(Sensor, String)>, RecordingError> {
    Ok(None)
}

/// Why the finger of a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// Its sensor file is not valid.
    #[error(transparent)]
    Sensor(#[from] Error),
    /// The recording cannot be read.
    #[error(transparent)]
    Source(#[from] source::Error),
}

fn checked(layers: &[Layer]) -> Result<Sensor, Error> {
    let mut merged = Table::new();
    for layer in layers.iter().rev() {
        merge(&mut merged, layer.table.clone());
    }
    merged.remove("extends");
    let sensor: Sensor = typed(merged, layers)?;
    sensor.check().map_err(|source| Error::OutOfRange { file: file_of_key(layers, &source.key), source })?;
    Ok(sensor)
}

/// The requested file, then the one that it extends, and so on.
fn layers(name_or_file: &str, folder: &Path) -> Result<Vec<Layer>, Error> {
    let (layer, at, folder) = layer(name_or_file, folder)?;
    extended(layer, vec![at], folder)
}

/// A layer with all that it extends. `seen`: the files read so far; `folder`: where others are searched.
fn extended(first: Layer, mut seen: Vec<PathBuf>, mut folder: PathBuf) -> Result<Vec<Layer>, Error> {
    let mut layers = vec![first];
    loop {
        // There is always a last one.
        let Some(last) = layers.last() else { return Ok(layers) };
        let wanted = match last.table.get("extends") {
            None => return Ok(layers),
            Some(Value::String(name)) => name.clone(),
            Some(other) => {
                let problem = format!("expected the name of a sensor or of its file, got {other}");
                return Err(Error::Value { file: last.file.clone(), key: "extends".into(), problem });
            }
        };
        if seen.contains(&place(&wanted, &folder).1) {
            return Err(Error::Circle { file: last.file.clone(), extends: wanted });
        }
        let found = layer(&wanted, &folder);
        let (next, at, next_folder) =
            found.map_err(|e| Error::Extends { file: last.file.clone(), source: Box::new(e) })?;
        layers.push(next);
        seen.push(at);
        folder = next_folder;
    }
}

/// Whether a finger is named by its file, not by a built-in name.
pub(crate) fn is_file(wanted: &str) -> bool {
    wanted.ends_with(".toml") || wanted.contains(['/', '\\'])
}

/// The path of a file, and its identity; None and the name itself for a built-in name.
fn place(wanted: &str, folder: &Path) -> (Option<PathBuf>, PathBuf) {
    let path = folder.join(wanted);
    match is_file(wanted) {
        true => (Some(path.clone()), path.canonicalize().unwrap_or(path)),
        false => (None, PathBuf::from(wanted)),
    }
}

/// A file or a built-in finger, its identity, and the folder in which the files that it extends are searched.
fn layer(wanted: &str, folder: &Path) -> Result<(Layer, PathBuf, PathBuf), Error> {
    match place(wanted, folder) {
        (Some(path), at) => {
            let beside = path.parent().map_or_else(|| folder.to_owned(), Path::to_owned);
            Ok((Layer::read(&path)?, at, beside))
        }
        (None, at) => Ok((built_in(wanted)?, at, folder.to_owned())),
    }
}

fn built_in(name: &str) -> Result<Layer, Error> {
    match BUILT_IN.iter().find(|(known, _)| *known == name) {
        Some((name, text)) => Layer::parse(format!("sensors/{name}.toml"), text),
        None => {
            let all: Vec<&str> = names().collect();
            let nearest = nearest(name, &all).map(str::to_owned);
            Err(Error::UnknownSensor { name: name.into(), nearest, names: names().map(str::to_owned).collect() })
        }
    }
}

/// Merges one table over another: tables key by key, everything else as a whole.
fn merge(under: &mut Table, over: Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(Value::Table(under)), Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::plane::Vec2;
    use slipbound::sensor::{Flip, Polarity, Skin};
    use std::fs;

    #[test]
    fn every_built_in_finger_loads_under_the_name_of_its_file() {
        let names: Vec<_> = names().collect();
        assert_eq!(names, ["gelsight", "gelsight_mini_near", "gelsight_mini_wide", "gelslim", "gelslim3"]);
        for name in names {
            let sensor = load(name).expect("valid");
            assert_eq!(sensor.name, name);
            assert_eq!(sensor.polarity, Polarity::Dark);
            assert!(!sensor.description.is_empty());
        }
    }

    #[test]
    fn gelslim_is_the_papers() {
        let sensor = load("gelslim").expect("valid");
        assert_eq!((sensor.image_px, sensor.rectified_px()), (SizePx::new(427, 320), SizePx::new(327, 320)));
        assert_eq!((sensor.pitch_px, sensor.pitch_mm), (15.2, Some(1.5)));
        assert_eq!((sensor.flip, sensor.skin, sensor.edge_bands.len()), (Flip::Vertical, Skin::Fabric, 2));
        // The middle of the gel is seen near the middle of the image.
        let middle = sensor.camera_from_rectified(Vec2::new(163.0, 160.0));
        assert!((middle - Vec2::new(213.0, 160.0)).length() < 60.0, "{middle:?}");
    }

    fn load_file(text: &str) -> Result<Sensor, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("mine.toml");
        fs::write(dir.path().join("base.toml"), "extends = \"gelslim\"\npitch_mm = 1.4\n").expect("writes");
        fs::write(dir.path().join("circle.toml"), "extends = \"mine.toml\"\n").expect("writes");
        for (name, text) in [
            ("heavy.toml", "grey_weights_rgb = [1, 1, 1]\n"),
            ("flat.toml", "[rectification]\nhomography = [[1, 0, 0], [1, 0, 0], [0, 0, 1]]\n"),
            ("old.toml", "[rectification]\ncrop = 1\n"),
        ] {
            fs::write(dir.path().join(name), format!("extends = \"gelslim\"\n{text}")).expect("writes");
        }
        fs::write(&path, text).expect("writes");
        load(path.to_str().expect("UTF-8"))
    }

    #[test]
    fn a_file_extends_another_key_by_key() {
        let sensor =
            load_file("extends = \"base.toml\"\nserial = \"7\"\n[rectification]\ncrop_px = [60, 0, 360, 320]\n")
                .expect("valid");
        let base = load("gelslim").expect("valid");
        assert_eq!((sensor.serial.as_deref(), sensor.pitch_mm), (Some("7"), Some(1.4)));
        let (mine, theirs) = (sensor.rectification.expect("there"), base.rectification.expect("there"));
        assert_eq!((mine.crop_px, mine.homography), ([60, 0, 360, 320], theirs.homography));
        assert_eq!(sensor.name, "gelslim");
    }

    #[test]
    fn a_finger_survives_being_written() {
        for name in names() {
            let sensor = load(name).expect("valid");
            let text = to_toml(&sensor).expect("writes");
            assert_eq!(parse(&text, "a text").expect("valid"), sensor, "{text}");
        }
        assert_eq!(of_frames(SizePx::new(427, 320)).expect("valid").len(), 2);
        let message = parse("extends = \"gelslim\"\npich_px = 15\n", "a text").expect_err("refused").to_string();
        assert!(message.starts_with("a text: unknown key `pich_px`"), "{message}");
    }

    #[test]
    fn only_a_valid_text_replaces_a_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mine.toml");
        fs::write(folder.path().join("base.toml"), "extends = \"gelslim\"\npitch_mm = 1.4\n").expect("writes");
        let text = "extends = \"base.toml\"\nserial = \"7\"\n";
        let sensor = write(text, &path).expect("valid");
        assert_eq!((sensor.serial.as_deref(), sensor.pitch_mm), (Some("7"), Some(1.4)), "beside the file");
        for (bad, said) in [
            ("extends = \"base.toml\"\npich_px = 15\n", "mine.toml: unknown key `pich_px`"),
            ("[shear]\n[shear]\n", "mine.toml"),
            ("extends = \"mine.toml\"\n", "lead back"),
        ] {
            let message = write(bad, &path).expect_err("refused").to_string();
            assert!(message.contains(said), "{message}");
            assert_eq!(fs::read_to_string(&path).expect("there"), text);
        }
        let nowhere = folder.path().join("no/mine.toml");
        let message = write("extends = \"gelslim\"\n", &nowhere).expect_err("no folder").to_string();
        assert!(message.contains("no/mine.toml: cannot write: "), "{message}");
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (text, parts) in [
            ("extends = \"gelslim\"\npich_px = 15\n", ["mine.toml", "`pich_px`", "did you mean `pitch_px`?"]),
            ("extends = \"gelslim\"\npitch_px = -3\n", ["mine.toml: pitch_px", "a number from", "got -3"]),
            (
                "extends = \"gelslim\"\npitch_px = \"15\"\n",
                ["mine.toml: pitch_px: expected a number, got \"15\"", "", ""],
            ),
            (
                "extends = \"gelslim\"\nskin = \"silk\"\n",
                ["mine.toml: skin: expected `fabric` or `smooth`, got `silk`", "", ""],
            ),
            ("extends = \"gelslim\"\n[rectification]\ncrop = 1\n", ["mine.toml", "`rectification.crop`", "crop_px"]),
            ("extends = \"gelslim\"\nskin = 3\n", ["mine.toml: skin: expected a string, got 3", "", ""]),
            ("extends = \"gelslim\"\nshear = 3\n", ["mine.toml: shear: expected a table, got 3", "", ""]),
            (
                "extends = \"gelslim\"\nedge_bands = { low_levels = 3 }\n",
                ["mine.toml: edge_bands: expected an array, got a table", "", ""],
            ),
            (
                "extends = \"gelslim\"\nedge_bands = [{ low_levels = 70000, high_levels = 9, rows_to_fraction = 1 }]\n",
                ["mine.toml: edge_bands[0].low_levels: expected a whole number from 0 to 65535, got 70000", "", ""],
            ),
            (
                "extends = \"gelslim\"\nedge_bands = [{ low_levels = 7, rows_to_fraction = 1 }]\n",
                ["mine.toml: edge_bands[0].high_levels: expected a value, got none", "", ""],
            ),
            (
                "extends = \"gelslim\"\nimage_px = [320]\n",
                ["mine.toml: image_px: expected an array of length 2, got an array of length 1", "", ""],
            ),
            (
                "extends = \"gelslim\"\nimage_px = [320, 240, 3]\n",
                ["mine.toml: image_px: expected a shorter array, got an array of length 3", "", ""],
            ),
            ("extends = \"gelslim\"\nskin = {}\n", ["mine.toml: skin: expected a string, got a table", "", ""]),
            ("extends = \"heavy.toml\"\n", ["heavy.toml: grey_weights_rgb (sum)", "a number from", "got 3"]),
            (
                "extends = \"flat.toml\"\n[rectification]\ncrop_px = [60, 0, 360, 320]\n",
                ["flat.toml: rectification.homography", "", ""],
            ),
            (
                "extends = \"old.toml\"\n[rectification]\ncrop_px = [60, 0, 360, 320]\n",
                ["old.toml", "`rectification.crop`", "crop_px"],
            ),
            (
                "extends = \"gelslin\"\n",
                ["mine.toml: extends: no built-in sensor", "`gelslin`", "did you mean `gelslim`?"],
            ),
            ("extends = \"other.toml\"\n", ["mine.toml: extends: ", "other.toml", "cannot read"]),
            ("extends = \"circle.toml\"\n", ["circle.toml", "lead back", "mine.toml"]),
            ("extends = 3\n", ["mine.toml: extends", "expected the name", "got 3"]),
            ("name = \"x\"\n", ["mine.toml: image_px: expected a value, got none", "", ""]),
            ("name = x\n", ["mine.toml", "line 1", ""]),
        ] {
            let message = load_file(text).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
        let message = load("nonesuch").expect_err("refused").to_string();
        assert!(message.contains("gelsight_mini_wide") && message.contains("FILE.toml"), "{message}");
        let short = "[rectification.distortion]\ncentre_px = [2, 2]\nspan_px = [9, 9]\nx_px = [1]\ny_px = []\n";
        let message = load_file(&format!("extends = \"gelslim\"\n{short}")).expect_err("refused").to_string();
        assert!(message.ends_with("21 in each (degree 5), got 1 and 0"), "{message}");
    }
}
