//! `slipbound calibrate`: the sensor file of an unknown finger from pictures of it; its shear stiffness from a weight.

mod weight;

use super::watch::recording::{Arrived, Recording};
use super::watch::simulation;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::calibrate::{Calibration, FRAMES_MOST, Given, calibrate};
use slipbound::image::{Frame, SizePx};
use slipbound::port::FrameBuffer;
use slipbound::sensor::{Flip, Polarity, Skin};
use slipbound_rig::{calibration, sensors, source};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The arguments of `slipbound calibrate`.
#[derive(Debug, clap::Args)]
pub struct Calibrate {
    /// The untouched finger: an image, an image folder, a quoted pattern, a video file, or a scene ('sim:SCENE').
    /// With --weight-g: a recording that begins untouched, then holds the mass while it stands, and ends with the mass
    /// hanging still
    source: String,
    /// The sensor file to write; a picture with the grid drawn in goes beside it
    #[arg(short, long, value_name = "FILE.toml", value_parser = toml_name)]
    output: PathBuf,
    /// Distance between neighbouring markers on the gel, measured by you; without it no millimetre is reported
    #[arg(long, value_name = "MM")]
    pitch_mm: Option<f64>,
    /// Serial number of this finger
    #[arg(long)]
    serial: Option<String>,
    /// What this kind of finger is called [default: the name of the file]
    #[arg(long)]
    name: Option<String>,
    /// The mirror image that the camera delivers; a grid cannot tell
    #[arg(long, value_enum, default_value = "none")]
    flip: FlipArgument,
    /// What covers the gel; an untouched finger cannot tell
    #[arg(long, value_enum, default_value = "smooth")]
    skin: SkinArgument,
    /// Whether markers are dark or bright [default: found]
    #[arg(long, value_enum)]
    polarity: Option<PolarityArgument>,
    /// Use frames A up to but not B, all of them untouched [default: the calm ones among the first 20]
    #[arg(long, value_name = "A..B", value_parser = range)]
    frames: Option<Range<u64>>,
    /// Measure the shear stiffness: the mass in grams that hangs on the finger at the end of SOURCE
    #[arg(long, value_name = "G", requires = "sensor", conflicts_with_all = ["pitch_mm", "serial", "name", "flip", "skin", "polarity", "frames"])]
    weight_g: Option<f64>,
    /// With --weight-g: the finger, calibrated before; its file is taken over
    #[arg(long, value_name = "NAME|FILE.toml", requires = "weight_g")]
    sensor: Option<String>,
    /// With --weight-g: how many fingers share the mass
    #[arg(long, value_name = "COUNT", default_value_t = 1, requires = "weight_g")]
    fingers: u32,
    /// With --weight-g: the mass is held and still stands in frames A up to but not B [default: the longest calm part]
    #[arg(long, value_name = "A..B", value_parser = range, requires = "weight_g")]
    held: Option<Range<u64>>,
    /// With --weight-g: the mass hangs in frames A up to but not B [default: the calm ones at the end]
    #[arg(long, value_name = "A..B", value_parser = range, requires = "weight_g")]
    hanging: Option<Range<u64>>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum FlipArgument {
    None,
    Vertical,
    Horizontal,
    Both,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum SkinArgument {
    Smooth,
    Fabric,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum PolarityArgument {
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
    /// Calibrates and writes the file.
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.refuse_overwriting()?;
        match self.weight_g {
            Some(weight_g) => weight::run(self, weight_g),
            None => self.finger(),
        }
    }

    fn finger(&self) -> Result<Outcome, Failure> {
        let mut terminal = Terminal::plain();
        let mut recording = self.open()?;
        let (buffers, torn_count) = self.frames(&mut recording)?;
        let size = most_common_size(&buffers);
        let same: Vec<&FrameBuffer> = buffers.iter().filter(|b| Some(b.size) == size).collect();
        if same.len() < buffers.len() {
            let other = buffers.len() - same.len();
            terminal.note(&format!("{}: {other} frames of another size passed over", self.source));
        }
        let frames: Result<Vec<Frame<'_>>, _> = same.iter().map(|b| b.frame()).collect();
        let frames = frames.map_err(|e| Failure::work(&self.source, e))?;
        let given = self.given();
        let found = calibrate(&frames, &given).map_err(|e| Failure::Arguments(anyhow!("{}: {e}", self.source)))?;
        let [from, to] = found.averaged.map(|i| same[i].seq);
        if !found.untouched {
            terminal.note(&format!(
                "{}: frames {from} to {to} look touched; better take the finger at rest, or say which frames: --frames A..B",
                self.source
            ));
        }
        write(&self.output, &calibration::sensor_file(&found))?;
        let written = sensors::load(&self.output.display().to_string()).map_err(|e| Failure::Work(e.into()))?;
        debug_assert_eq!(written.image_px, found.sensor.image_px);
        let picture = self.picture();
        calibration::write_grid_picture(&picture, &found).map_err(|e| Failure::Work(e.into()))?;
        self.tell(&mut terminal, &found, [from, to])?;
        Ok(if torn_count > 0 { Outcome::DataLost } else { Outcome::Done })
    }

    fn tell(&self, terminal: &mut Terminal, found: &Calibration, [from, to]: [u64; 2]) -> Result<(), Failure> {
        let sensor = &found.sensor;
        let lines = |axis: usize| {
            let all = || found.markers.iter().map(|m| m.node[axis]);
            all().max().unwrap_or(0) - all().min().unwrap_or(0) + 1
        };
        let frames = if from == to { format!("frame {from}") } else { format!("frames {from} to {to} averaged") };
        terminal.say(&format!(
            "{}: {} {} markers on {} columns and {} rows, {frames}",
            self.source,
            found.markers.len(),
            if sensor.polarity == Polarity::Dark { "dark" } else { "bright" },
            lines(0),
            lines(1),
        ))?;
        let map = match sensor.rectification.and_then(|r| r.distortion) {
            None => "homography".to_owned(),
            Some(d) => format!(
                "homography and polynomial of degree {} (homography alone {:.3})",
                d.degree(),
                found.residual_without_distortion_pitch
            ),
        };
        terminal.say(&format!(
            "pitch {:.1} px, diameter {:.1} px, residual {:.3} pitch RMS by {map}",
            sensor.pitch_px, sensor.marker_diameter_px, found.residual_pitch
        ))?;
        if found.off_grid_count > 0 {
            let count = found.off_grid_count;
            terminal.say(&format!("{count} markers lie off the grid: red in the picture, harmless if few"))?;
        }
        terminal.say(&format!("written: {} and {}", self.output.display(), self.picture().display()))?;
        terminal.say(&format!(
            "next: look at the picture, then slipbound watch RECORDING --sensor {}",
            self.output.display()
        ))
    }

    fn given(&self) -> Given {
        let stem = self.output.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let source = Path::new(&self.source).file_name().map(|s| s.to_string_lossy().into_owned());
        Given {
            name: self.name.clone().unwrap_or(stem),
            description: format!("Calibrated from {}.", source.unwrap_or_else(|| self.source.clone())),
            serial: self.serial.clone(),
            pitch_mm: self.pitch_mm,
            flip: match self.flip {
                FlipArgument::None => Flip::None,
                FlipArgument::Vertical => Flip::Vertical,
                FlipArgument::Horizontal => Flip::Horizontal,
                FlipArgument::Both => Flip::Both,
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

    /// The whole frames to calibrate from, and how many were torn.
    fn frames(&self, recording: &mut Recording) -> Result<(Vec<FrameBuffer>, usize), Failure> {
        let (mut whole, mut torn_count, mut last) = (Vec::new(), 0, None);
        let mut first_torn = String::new();
        let until = self.frames.as_ref().map(|f| f.end);
        while until.map_or(whole.len() < FRAMES_MOST, |until| last.is_none_or(|seq| seq + 1 < until)) {
            match recording.next()? {
                Arrived::Over => break,
                Arrived::Torn(reason) => {
                    if torn_count == 0 {
                        first_torn = format!(": {reason}");
                    }
                    torn_count += 1;
                }
                Arrived::Whole if self.frames.as_ref().is_none_or(|f| f.contains(&recording.frame().seq)) => {
                    whole.push(recording.frame().clone());
                }
                Arrived::Whole => {}
            }
            last = Some(recording.frame().seq);
        }
        match (&self.frames, whole.is_empty()) {
            (_, false) => Ok((whole, torn_count)),
            (Some(f), true) => Err(Failure::Arguments(anyhow!(
                "--frames {}..{}: {} has no whole frame there",
                f.start,
                f.end,
                self.source
            ))),
            (None, true) => Err(Failure::Arguments(anyhow!(
                "{}: expected pictures of a finger, got no whole frame ({torn_count} torn{first_torn})",
                self.source
            ))),
        }
    }

    /// Opens the source.
    fn open(&self) -> Result<Recording, Failure> {
        if let Some(scene) = simulation::scene(&self.source) {
            return simulation::open(scene).map(Recording::new);
        }
        source::open(&self.source).map(Recording::new).map_err(|e| match e {
            source::Error::Missing { .. } | source::Error::Pattern { .. } | source::Error::NoImages { .. } => {
                Failure::arguments(e)
            }
            other => Failure::Work(other.into()),
        })
    }

    fn picture(&self) -> PathBuf {
        self.output.with_extension("png")
    }

    /// Neither the file nor the picture may fall on the source.
    fn refuse_overwriting(&self) -> Result<(), Failure> {
        let Ok(source) = fs::canonicalize(&self.source) else { return Ok(()) };
        for path in [self.output.clone(), self.picture()] {
            if fs::canonicalize(&path).is_ok_and(|p| p == source) {
                let path = path.display();
                return Err(Failure::Arguments(anyhow!(
                    "--output: expected a place of its own, got {path}, the source"
                )));
            }
        }
        Ok(())
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text).map_err(|e| Failure::work(format!("{}: cannot write", path.display()), e))
}

/// The size that most frames have; of equally many the first.
fn most_common_size(frames: &[FrameBuffer]) -> Option<SizePx> {
    let count = |size: SizePx| frames.iter().filter(|f| f.size == size).count();
    frames.iter().map(|f| f.size).rev().max_by_key(|&size| count(size))
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
