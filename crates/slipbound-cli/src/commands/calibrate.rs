//! `slipbound calibrate`: the sensor file of an unknown finger from images of it; its shear stiffness from a weight.

mod args;

pub use args::Calibrate;

use super::recording;
use super::rest_window::{frames_in_words, note_other_size, note_torn};
use super::watch::StallDetector;
use crate::outcome::{Failure, Outcome};
use crate::terminal::{Terminal, quoted};
use anyhow::anyhow;
use slipbound::calibrate::{Calibration, FRAMES_MOST, calibrate};
use slipbound::image::Frame;
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::{Flip, Polarity, Sensor, Skin};
use slipbound_rig::calibration::{self, HangingMass, HangingMassError, MeasuredShear, ShearFileError};
use slipbound_rig::link::now_ns;
use slipbound_rig::printable::without_passwords;
use slipbound_rig::report_summary::{of_other_size, torn};
use slipbound_rig::sensors;
use slipbound_rig::source::{self, ReadAhead, most_common_size};
use std::fs;
use std::ops::Range;
use std::path::Path;

/// Fewest rows of an image in which the threads of a fabric skin are wide enough: three pixels on the simulated finger.
const FABRIC_ROWS: usize = 300;

/// What to tell of a fabric skin whose images have too few rows.
fn coarse_weave_note(sensor: &Sensor) -> Option<String> {
    let rows = sensor.image_px.height;
    (sensor.skin == Skin::Fabric && rows < FABRIC_ROWS).then(|| {
        format!(
            "expected images of {FABRIC_ROWS} rows or more for a fabric skin, got {rows}: the threads of the weave are too \
             narrow there, and contact and slip will be reported falsely"
        )
    })
}

/// Heaviest mass that makes sense on a fingertip, g.
const HEAVIEST_G: f64 = 20_000.0;

/// Frames that did not arrive whole.
#[derive(Default)]
struct TornFrames {
    count: usize,
    /// Which was the first, and why.
    first: Option<String>,
}

/// Least turn of the grid that is told of, deg: a grid that is printed straight is seen within it.
const TURN_DEG: f64 = 5.0;

/// What to tell of a grid that is turned in the image; x and y of the reports turn with it. In a mirrored image, which is
/// the one that the user sees, it is turned the other way.
fn turn_in_words(turn_rad: f64, flip: Flip) -> Option<String> {
    let deg = turn_rad.to_degrees();
    (deg.abs() >= TURN_DEG).then(|| {
        let sense = if deg > 0.0 { "clockwise" } else { "counter-clockwise" };
        let image = match flip.is_horizontal() != flip.is_vertical() {
            true => "the image once it is mirrored back",
            false => "the image",
        };
        format!(
            "the grid is turned by {:.0} deg {sense} in {image}: x and y of the reports follow its rows and columns",
            deg.abs()
        ) + ", as they lie nearest to those of the image (a finger that is turned by more than 45 deg has x across)"
    })
}

/// Cells this much wider than high, or with rows and columns this far from square, deg, are told of.
const CELLS_FRACTION: f64 = 0.1;
const CELLS_DEG: f64 = 5.0;

/// What to tell of cells that are not square although the grid is seen from the front.
fn cells_in_words((width_over_height, angle_rad): (f64, f64)) -> Option<String> {
    let deg = angle_rad.to_degrees();
    let stretched = width_over_height.max(1.0 / width_over_height) > 1.0 + CELLS_FRACTION;
    let question = "; they are taken for squares: are the markers on a square grid? On another one x and y have \
                    different scales";
    match (stretched, (deg - 90.0).abs() > CELLS_DEG) {
        (_, true) => Some(format!("rows and columns meet at {deg:.0} deg all over the image{question}")),
        (true, false) => {
            Some(format!("the cells are {width_over_height:.2} times as wide as high all over the image{question}"))
        }
        (false, false) => None,
    }
}

impl Calibrate {
    /// Calibrates and writes the file.
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.refuse_overwriting()?;
        match self.weight_g {
            Some(weight_g) => self.hanging_mass(weight_g),
            None => self.finger(),
        }
    }

    fn finger(&self) -> Result<Outcome, Failure> {
        let known = self.known();
        if let Some(pitch_mm) = known.pitch_mm.filter(|pitch_mm| !(0.1..=20.0).contains(pitch_mm)) {
            let expected = "--pitch-mm: expected a number from 0.1 to 20";
            return Err(Failure::Arguments(anyhow!("{expected}, got {pitch_mm}")));
        }
        let mut terminal = Terminal::plain();
        let mut recording = recording::open(&self.source)?;
        if source::is_live(&self.source) {
            let mut stalls = StallDetector::new(StallDetector::LONGEST_MS);
            let silence = |is_silent| stalls.note(&self.source, now_ns(), is_silent, &terminal);
            let count = self.frames.as_ref().map_or(FRAMES_MOST, |frames| frames.end as usize);
            recording.read_ahead_seen(count, silence).for_each(drop);
        }
        let (buffers, torn) = self.frames(&mut recording)?;
        let size = most_common_size(&buffers);
        let (same, other): (Vec<&FrameBuffer>, Vec<&FrameBuffer>) = buffers.iter().partition(|b| Some(b.size) == size);
        note_torn(&terminal, &self.source, torn.count, torn.first.as_deref());
        let first_other = size.zip(other.first()).map(|(size, first)| of_other_size(first, size));
        note_other_size(&terminal, &self.source, other.len(), first_other.as_deref());
        let frames: Result<Vec<Frame<'_>>, _> = same.iter().map(|b| b.frame()).collect();
        let frames = frames.map_err(|e| Failure::work(&self.source, e))?;
        let mut found = calibrate(&frames, &known).map_err(|e| Failure::Arguments(anyhow!("{}: {e}", self.source)))?;
        if let Some([low_levels, high_levels]) = calibration::raise_edges(&frames, &mut found) {
            terminal.note(&format!(
                "{}: the weave shows edges at rest: their thresholds are raised to {low_levels} and {high_levels} (edge_bands); \
                 if something touches the finger there, say which frames: --frames A..B",
                self.source
            ));
        }
        if let Some(note) = coarse_weave_note(&found.sensor) {
            terminal.note(&format!("{}: {note}", self.source));
        }
        let [from, to] = found.averaged.map(|i| same[i].seq);
        if !found.untouched {
            let frames = if from == to { format!("frame {from} looks") } else { format!("frames {from} to {to} look") };
            terminal.note(&format!(
                "{}: {frames} touched; better take the finger at rest, or say which frames: --frames A..B{}",
                self.source,
                if found.sensor.skin == Skin::Smooth { "; a weave looks so, too: --skin fabric" } else { "" }
            ));
        }
        let written = self.write_output(&calibration::sensor_file(&found))?;
        debug_assert_eq!(written.image_px, found.sensor.image_px);
        let picture = self.picture();
        if let Some(folder) = picture.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(|e| Failure::work(format!("{}: cannot write", folder.display()), e))?;
        }
        calibration::write_grid_picture(&picture, &found).map_err(|e| Failure::Work(e.into()))?;
        self.print(&mut terminal, &found, [from, to])?;
        Ok(if torn.count + other.len() > 0 { Outcome::DataLost } else { Outcome::Done })
    }

    fn print(&self, terminal: &mut Terminal, found: &Calibration, [from, to]: [u64; 2]) -> Result<(), Failure> {
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
        if !found.off_grid.is_empty() {
            terminal.say(&match found.off_grid.len() {
                1 => "1 dot lies off the grid and is not used: red in the picture".to_owned(),
                count => format!("{count} dots lie off the grid and are not used: red in the picture"),
            })?;
        }
        if found.diameter_is_limited() {
            terminal.say("the diameter is limited to two thirds of the pitch: the dots may be wider")?;
        }
        if let Some(line) = turn_in_words(found.turn_rad(), sensor.flip) {
            terminal.say(&line)?;
        }
        if let Some(line) = found.cells_from_front().and_then(cells_in_words) {
            terminal.say(&line)?;
        }
        let flip = sensor.flip;
        terminal.say(&match self.flip {
            Some(_) => format!("flip = \"{flip}\", as stated: the camera's image is mirrored back"),
            None => format!(
                "flip = \"{flip}\" assumed: the picture is taken as delivered; a mirrored grid looks the same, so say --flip \
                 if it is mirrored"
            ),
        })?;
        terminal.say(&format!("written: {} and {}", self.output.display(), self.picture().display()))?;
        terminal.say(&format!(
            "next: look at the picture, then slipbound watch RECORDING --sensor {}",
            quoted(&self.output.display().to_string())
        ))
    }

    /// Puts the shear stiffness, from the mass that hangs on the finger, into its sensor file.
    fn hanging_mass(&self, mass_g: f64) -> Result<Outcome, Failure> {
        if !(mass_g > 0.0 && mass_g <= HEAVIEST_G) {
            return Err(Failure::Arguments(anyhow!(
                "--weight-g: expected grams above 0, at most {HEAVIEST_G}, got {mass_g}"
            )));
        }
        if !(1..=16).contains(&self.fingers) {
            return Err(Failure::Arguments(anyhow!("--fingers: expected 1 to 16, got {}", self.fingers)));
        }
        if source::is_live(&self.source) {
            let expected = "--weight-g: expected a recording, which ends";
            return Err(Failure::Arguments(anyhow!("{expected}, got the camera {}: record it first", self.source)));
        }
        let name = self.sensor.as_deref().unwrap_or_default();
        let sensor = sensors::load(name).map_err(Failure::arguments)?;
        let shown = without_passwords(&self.source);
        let file_name = Path::new(&*shown).file_name().map(|n| n.to_string_lossy().into_owned());
        let mass = HangingMass {
            mass_g,
            fingers_count: self.fingers,
            held: self.held.clone(),
            hanging: self.hanging.clone(),
            recording: file_name.unwrap_or_else(|| shown.into_owned()),
        };
        let measured = mass.measure(&mut recording::open(&self.source)?, &sensor).map_err(|e| match e {
            HangingMassError::Source(e) => e.into(),
            HangingMassError::Frame(e) => Failure::work(&self.source, e),
            other => Failure::Arguments(anyhow!("{}: {other}", self.source)),
        });
        let MeasuredShear { shear, torn_count, first_torn, other_size_count, first_of_other_size } = measured?;
        let text = calibration::sensor_file_with_shear(name, &self.output, &shear).map_err(|e| match e {
            ShearFileError::Folder { .. } => Failure::Arguments(anyhow!("--output: {e}")),
            ShearFileError::Read { .. } => Failure::Work(e.into()),
        });
        self.write_output(&text?)?;
        let mut terminal = Terminal::plain();
        note_torn(&terminal, &self.source, torn_count, first_torn.as_deref());
        note_other_size(&terminal, &self.source, other_size_count, first_of_other_size.as_deref());
        terminal.say(&format!("{}: {}", self.source, shear.provenance))?;
        terminal.say(&format!("stiffness {:.4} N per marker and pitch", shear.stiffness_n_per_pitch))?;
        terminal.say(&format!("written: {}", self.output.display()))?;
        Ok(if torn_count + other_size_count > 0 { Outcome::DataLost } else { Outcome::Done })
    }

    /// The whole frames to calibrate from, and the torn ones.
    fn frames(&self, recording: &mut ReadAhead) -> Result<(Vec<FrameBuffer>, TornFrames), Failure> {
        let (mut whole, mut all_torn, mut frames_count) = (Vec::new(), TornFrames::default(), 0);
        let mut buffer = FrameBuffer::default();
        let is_wanted = |seq: u64| self.frames.as_ref().is_none_or(|frames| frames.contains(&seq));
        let until = self.frames.as_ref().map(|f| f.end);
        while until.map_or(whole.len() < FRAMES_MOST, |until| frames_count < until) {
            match recording.next(&mut buffer)? {
                Next::End => break,
                Next::Silent => continue,
                Next::Torn { reason } => {
                    if is_wanted(buffer.seq) {
                        all_torn.count += 1;
                        all_torn.first.get_or_insert_with(|| torn(&buffer, &reason));
                    }
                }
                Next::Frame if is_wanted(buffer.seq) => whole.push(buffer.clone()),
                Next::Frame => {}
            }
            frames_count = buffer.seq + 1;
        }
        let of_torn = all_torn.first.as_deref().map_or_else(String::new, |first| format!("; {first}"));
        match &self.frames {
            Some(Range { start, end }) if frames_count < *end => Err(Failure::Arguments(anyhow!(
                "--frames {start}..{end}: {} ends before frame {}: it has {}",
                self.source,
                end - 1,
                frames_in_words(frames_count as usize)
            ))),
            _ if !whole.is_empty() => Ok((whole, all_torn)),
            Some(Range { start, end }) => Err(Failure::Arguments(anyhow!(
                "--frames {start}..{end}: {} has no whole frame there{of_torn}",
                self.source
            ))),
            None => Err(Failure::Arguments(anyhow!(
                "{}: expected images of a finger, got no whole frame{of_torn}",
                self.source
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    #[test]
    fn a_weave_of_too_few_rows_is_told_of() {
        let of = |rows: usize, skin: Skin| {
            let sensor = sensors::load("gelslim").expect("built in");
            coarse_weave_note(&Sensor { skin, image_px: SizePx::new(4 * rows / 3, rows), ..sensor })
        };
        assert!(of(240, Skin::Fabric).is_some_and(|note| note.contains("300 rows or more for a fabric skin, got 240")));
        assert_eq!((of(300, Skin::Fabric), of(240, Skin::Smooth)), (None, None));
    }

    #[test]
    fn a_turned_grid_is_told_of_with_its_sense() {
        let told = |deg: f64| turn_in_words(deg.to_radians(), Flip::None);
        assert!(told(20.3).is_some_and(|line| line.contains("turned by 20 deg clockwise in the image")));
        assert!(told(-12.0).is_some_and(|line| line.contains("turned by 12 deg counter-clockwise in the image")));
        assert_eq!((told(4.9), told(-4.9)), (None, None));
        // The picture with the grid shows the camera's image, in which a grid mirrored once is turned the other way.
        for (flip, image) in [
            (Flip::Vertical, "clockwise in the image once it is mirrored back"),
            (Flip::Horizontal, "clockwise in the image once it is mirrored back"),
            (Flip::Both, "clockwise in the image:"),
        ] {
            assert!(turn_in_words(0.3, flip).is_some_and(|line| line.contains(image)), "{flip:?}");
        }
    }
}
