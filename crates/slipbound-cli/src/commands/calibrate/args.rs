//! The arguments of `slipbound calibrate`, and what follows from them alone.

use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::calibrate::KnownFacts;
use slipbound::sensor::{Flip, Polarity, Sensor, Skin};
use slipbound_rig::printable::without_passwords;
use slipbound_rig::sensors;
use slipbound_rig::source::image_files;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The arguments of `slipbound calibrate`.
#[derive(Debug, clap::Args)]
pub struct Calibrate {
    /// The untouched finger: an image, an image folder, a quoted pattern, a video file, or a scene ('sim:SCENE').
    /// With --weight-g: a recording that begins untouched, then holds the mass while it stands, and ends with the mass
    /// hanging still
    pub(super) source: String,
    /// The sensor file to write; a picture with the grid drawn in goes beside it, or, if the frames of SOURCE are there, into
    /// a folder `calibration` beside it
    #[arg(short, long, value_name = "FILE.toml", value_parser = toml_name)]
    pub(super) output: PathBuf,
    /// Overwrite a sensor file or a picture that is there
    #[arg(long)]
    pub(super) force: bool,
    /// Distance between neighbouring markers on the gel, measured by you; without it no millimetre is reported
    #[arg(long, value_name = "MM")]
    pub(super) pitch_mm: Option<f64>,
    /// Serial number of this finger
    #[arg(long)]
    pub(super) serial: Option<String>,
    /// What this kind of finger is called [default: the name of the file]
    #[arg(long)]
    pub(super) name: Option<String>,
    /// The mirror image that the camera delivers; a grid cannot tell [default: none, and the output says so]
    #[arg(long, value_enum)]
    pub(super) flip: Option<FlipArgument>,
    /// What covers the gel; an untouched finger cannot tell
    #[arg(long, value_enum, default_value = "smooth")]
    pub(super) skin: SkinArgument,
    /// Whether markers are dark or bright [default: found]
    #[arg(long, value_enum)]
    pub(super) polarity: Option<PolarityArgument>,
    /// Average frames at rest among A (inclusive) to B (exclusive), ten at most [default: among the first 20]
    #[arg(long, value_name = "A..B", value_parser = range)]
    pub(super) frames: Option<Range<u64>>,
    /// Measure the shear stiffness: the mass in grams that hangs on the finger at the end of SOURCE
    #[arg(long, value_name = "G", requires = "sensor", conflicts_with_all = ["pitch_mm", "serial", "name", "flip", "skin", "polarity", "frames"])]
    pub(super) weight_g: Option<f64>,
    /// With --weight-g: the finger, calibrated before; its file is taken over
    #[arg(long, value_name = "NAME|FILE.toml", requires = "weight_g")]
    pub(super) sensor: Option<String>,
    /// With --weight-g: how many fingers share the mass
    #[arg(long, value_name = "COUNT", default_value_t = 1, requires = "weight_g")]
    pub(super) fingers: u32,
    /// With --weight-g: the mass is held and still stands in frames A (inclusive) to B (exclusive) [default: the longest part in which nothing moves]
    #[arg(long, value_name = "A..B", value_parser = range, requires = "weight_g")]
    pub(super) held: Option<Range<u64>>,
    /// With --weight-g: the mass hangs in frames A (inclusive) to B (exclusive) [default: those at the end in which nothing moves]
    #[arg(long, value_name = "A..B", value_parser = range, requires = "weight_g")]
    pub(super) hanging: Option<Range<u64>>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum FlipArgument {
    None,
    Vertical,
    Horizontal,
    Both,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum SkinArgument {
    Smooth,
    Fabric,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum PolarityArgument {
    Dark,
    Bright,
}

/// `A..B`, A below B.
fn range(text: &str) -> Result<Range<u64>, String> {
    let parsed = text.split_once("..").and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    match parsed {
        Some(range) if range.start < range.end => Ok(range),
        Some(_) => Err(format!("expected A below B, got {text}")),
        None => Err(format!("expected two whole numbers A..B, got {text}")),
    }
}

/// A file that is recognised as one when it is given back as `--sensor`.
fn toml_name(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().is_some_and(|e| e == "toml") && path.file_stem().is_some() {
        true => Ok(path),
        false => Err(format!("expected a name that ends in .toml, got {text}")),
    }
}

impl Calibrate {
    /// What the user says about the finger.
    pub(super) fn known(&self) -> KnownFacts {
        let stem = self.output.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let shown = without_passwords(&self.source);
        let source = Path::new(&*shown).file_name().map(|s| s.to_string_lossy().into_owned());
        KnownFacts {
            name: self.name.clone().unwrap_or(stem),
            description: format!("Calibrated from {}.", source.unwrap_or_else(|| shown.into_owned())),
            serial: self.serial.clone(),
            pitch_mm: self.pitch_mm,
            flip: match self.flip {
                None | Some(FlipArgument::None) => Flip::None,
                Some(FlipArgument::Vertical) => Flip::Vertical,
                Some(FlipArgument::Horizontal) => Flip::Horizontal,
                Some(FlipArgument::Both) => Flip::Both,
            },
            skin: match self.skin {
                SkinArgument::Smooth => Skin::Smooth,
                SkinArgument::Fabric => Skin::Fabric,
            },
            polarity: self.polarity.map(|p| match p {
                PolarityArgument::Dark => Polarity::Dark,
                PolarityArgument::Bright => Polarity::Bright,
            }),
        }
    }

    /// The picture with the grid drawn in: beside the sensor file, or in a folder there named `calibration` where it
    /// would be read as a frame of the source.
    pub(super) fn picture(&self) -> PathBuf {
        let beside = self.output.with_extension("png");
        let folder = |path: &Path| {
            let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
            fs::canonicalize(parent).ok()
        };
        let is_among = |frame: &PathBuf| folder(frame).is_some_and(|of_frame| folder(&beside) == Some(of_frame));
        // A photo among others is a frame of them.
        let others = |parent: PathBuf| image_files(&parent.display().to_string()).len() > 1;
        let is_lone = Path::new(&self.source).is_file() && !folder(Path::new(&self.source)).is_some_and(others);
        match !is_lone && image_files(&self.source).iter().any(is_among) {
            true => self.output.with_file_name("calibration").join(beside.file_name().unwrap_or_default()),
            false => beside,
        }
    }

    /// Neither the file nor the picture may fall on the source; either stays where it is there, for somebody may have edited
    /// the file, and the picture may be another. A weight leaves no picture. Adding the stiffness to the file of `--sensor` itself changes nothing else in it.
    pub(super) fn refuse_overwriting(&self) -> Result<(), Failure> {
        let is = |path: &Path, other: &str| {
            fs::canonicalize(path).is_ok_and(|path| fs::canonicalize(other).is_ok_and(|other| other == path))
        };
        let expected = "expected a place of its own";
        if is(&self.output, &self.source) {
            let path = self.output.display();
            return Err(Failure::Arguments(anyhow!("--output: {expected}, got {path}, the source")));
        }
        if is(&self.picture(), &self.source) {
            let (output, picture) = (self.output.display(), self.picture().display().to_string());
            return Err(Failure::Arguments(anyhow!(
                "--output {output}: {expected} for the picture of the grid beside it, got {picture}, the source: choose \
                 another name"
            )));
        }
        let is_amended = self.weight_g.is_some() && self.sensor.as_deref().is_some_and(|s| is(&self.output, s));
        let file = Some(self.output.clone()).filter(|_| !is_amended);
        let picture = Some(self.picture()).filter(|_| self.weight_g.is_none());
        match file.into_iter().chain(picture).find(|path| path.is_file()) {
            Some(path) if !self.force => {
                let expected = "expected a new file, or --force to overwrite it";
                let path = path.display();
                Err(Failure::Arguments(anyhow!("--output: {expected}, got {path}, which is there")))
            }
            _ => Ok(()),
        }
    }

    /// Writes the sensor file, if the text is a valid one; an older file stays otherwise.
    pub(super) fn write_output(&self, text: &str) -> Result<Sensor, Failure> {
        sensors::write(text, &self.output).map_err(|e| Failure::Work(e.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_frames_and_a_toml_name() {
        assert_eq!(range("3..9"), Ok(3..9));
        assert_eq!(range("9..3"), Err("expected A below B, got 9..3".into()));
        assert_eq!(range("3.."), Err("expected two whole numbers A..B, got 3..".into()));
        assert!(toml_name("a/b.toml").is_ok());
        assert_eq!(toml_name("b.json"), Err("expected a name that ends in .toml, got b.json".into()));
    }
}
