//! `slipbound calibrate`: the sensor file of an unknown finger from pictures of it; its shear stiffness from a weight.

mod args;
mod weight;

pub use args::Calibrate;

use super::watch::recording::{Arrived, Recording};
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::calibrate::{Calibration, FRAMES_MOST, calibrate};
use slipbound::image::{Frame, SizePx};
use slipbound::port::FrameBuffer;
use slipbound::sensor::Polarity;
use slipbound_rig::{calibration, sensors};

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
        let known = self.known();
        let found = calibrate(&frames, &known).map_err(|e| Failure::Arguments(anyhow!("{}: {e}", self.source)))?;
        let [from, to] = found.averaged.map(|i| same[i].seq);
        if !found.untouched {
            terminal.note(&format!(
                "{}: frames {from} to {to} look touched; better take the finger at rest, or say which frames: --frames A..B",
                self.source
            ));
        }
        self.write_output(&calibration::sensor_file(&found))?;
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
        if !found.off_grid.is_empty() {
            let count = found.off_grid.len();
            terminal.say(&format!("{count} dots lie off the grid and are not used: red in the picture"))?;
        }
        let flip = sensor.flip;
        terminal.say(&match self.flip {
            Some(_) => format!("flip = \"{flip}\", as stated: the camera's picture is mirrored back"),
            None => format!(
                "flip = \"{flip}\" assumed: the picture is taken as delivered; a mirrored grid looks the same, so say --flip \
                 if it is mirrored"
            ),
        })?;
        terminal.say(&format!("written: {} and {}", self.output.display(), self.picture().display()))?;
        terminal.say(&format!(
            "next: look at the picture, then slipbound watch RECORDING --sensor {}",
            self.output.display()
        ))
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
}

/// The size that most frames have; of equally many the first.
fn most_common_size(frames: &[FrameBuffer]) -> Option<SizePx> {
    let count = |size: SizePx| frames.iter().filter(|f| f.size == size).count();
    frames.iter().map(|f| f.size).rev().max_by_key(|&size| count(size))
}
