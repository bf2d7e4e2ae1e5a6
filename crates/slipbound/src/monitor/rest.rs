//! The rest frame: several calm frames averaged, with the markers found on it.
//!
//! ```text
//!   first frames --look--> dark? moving? touched? --choose--> the calm run --add--> mean picture --build--> Rest
//! ```

mod choose;

pub use choose::{RestChoice, RestLook};

use super::contact::{CellMap, cover_radius_px, illumination, roughness_levels, texture_share};
use super::imprint::Imprint;
use super::markers::{Detector, RestMarker};
use super::{Reason, Settings};
use crate::image::{Frame, SizePx};
use crate::sensor::{Sensor, Skin};
use crate::setting::{SettingError, within};
use choose::Picture;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How the rest frame is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RestSettings {
    /// How many of the first frames are looked at to find the finger at rest.
    pub window_count: u32,
    /// How many calm frames are averaged at most. Ten bring the noise of the rest frame to a third of one frame's.
    pub average_count: u32,
    /// Two frames in a row are calm when 99 of 100 cells change by less than this.
    pub calm_levels: f64,
    /// A frame counts as dark when its brightness is off the window's median by more than this share.
    pub brightness_fraction: f64,
    /// Smooth gel whose file does not say how sharp its illumination is: what is sharper than this is an imprint.
    pub imprint_levels: f64,
    /// Fewest markers a rest frame must show.
    pub markers_min_count: u32,
}

impl Default for RestSettings {
    fn default() -> Self {
        RestSettings {
            window_count: 20,
            average_count: 10,
            calm_levels: 5.0,
            brightness_fraction: 0.1,
            imprint_levels: 6.0,
            markers_min_count: 9,
        }
    }
}

impl RestSettings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        within("rest.window_count", f64::from(self.window_count), 1.0, 10_000.0)?;
        within("rest.average_count", f64::from(self.average_count), 1.0, 10_000.0)?;
        within("rest.calm_levels", self.calm_levels, 0.1, 255.0)?;
        within("rest.brightness_fraction", self.brightness_fraction, 0.001, 1.0)?;
        within("rest.imprint_levels", self.imprint_levels, 0.1, 255.0)?;
        within("rest.markers_min_count", f64::from(self.markers_min_count), 4.0, 1000.0)
    }
}

/// An imprint is sharper than the untouched finger by this factor; noise and JPEG move it by a tenth.
const IMPRINT_RATIO: f64 = 1.35;

/// What the finger was doing in the rest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RestKind {
    /// Nothing touched it.
    Unloaded,
    /// Something touched it already: displacement counts from there, and the contact region of a smooth gel is what
    /// is sharper in the imprint than illumination can be.
    InContact,
}

/// Why there is no rest frame.
#[derive(Debug, Clone, PartialEq)]
pub enum RestError {
    /// No frame was calm and bright enough.
    NoCalmFrame {
        /// Frames looked at.
        looked_at_count: usize,
        /// Of these, frames that could not be judged (dark, or of another size).
        unusable_count: usize,
    },
    /// A frame given as rest cannot be used.
    Unusable(Reason),
    /// No frame was added.
    Empty,
    /// Too few markers were found.
    FewMarkers {
        /// Fewest that are needed.
        expected_count: u32,
        /// Markers found.
        got_count: usize,
    },
}

impl fmt::Display for RestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RestError::NoCalmFrame { looked_at_count, unusable_count } => write!(
                f,
                "no rest frame among the first {looked_at_count} frames ({unusable_count} of them dark or of another size)"
            ),
            RestError::Unusable(reason) => write!(f, "unusable as rest frame: {reason}"),
            RestError::Empty => f.write_str("no rest frame was given"),
            RestError::FewMarkers { expected_count, got_count } => write!(
                f,
                "too few markers in the rest frame: expected at least {expected_count}, got {got_count} \
                 (is it the right sensor file?)"
            ),
        }
    }
}

impl std::error::Error for RestError {}

/// The finger at rest, as the monitor needs it.
#[derive(Debug, Clone)]
pub struct Rest {
    pub(super) kind: RestKind,
    pub(super) seq: u64,
    pub(super) frames_count: u32,
    pub(super) size: SizePx,
    pub(super) flat: Vec<u8>,
    pub(super) cells: Vec<[f32; 3]>,
    pub(super) cells_covered: Vec<bool>,
    pub(super) markers: Vec<RestMarker>,
}

impl Rest {
    /// What the finger was doing.
    pub fn kind(&self) -> RestKind {
        self.kind
    }

    /// Number of the last frame averaged into it.
    pub fn seq(&self) -> u64 {
        self.seq
    }

    /// Frames averaged into it.
    pub fn frames_count(&self) -> u32 {
        self.frames_count
    }

    /// Markers found on it.
    pub fn markers_count(&self) -> usize {
        self.markers.len()
    }
}

/// Finds and averages calm frames.
#[derive(Debug, Clone)]
pub struct RestBuilder {
    sensor: Sensor,
    settings: Settings,
    imprint: Imprint,
    map: CellMap,
    detector: Detector,
    looks: Vec<Picture>,
    grey_sum: Vec<u32>,
    cells_sum: Vec<[f32; 3]>,
    frames_count: u32,
    seq: u64,
}

impl RestBuilder {
    /// A builder for frames of `camera_px`. Fails when a setting or a fact of the sensor cannot be.
    pub fn new(sensor: &Sensor, settings: &Settings, camera_px: SizePx) -> Result<Self, SettingError> {
        settings.check_for(sensor)?;
        sensor.check()?;
        let sensor = sensor.at_size(camera_px)?;
        sensor.check()?;
        let imprint = Imprint::new(&sensor, settings, true);
        let map = CellMap::new(&sensor, &imprint.cells);
        Ok(RestBuilder {
            detector: Detector::new(&sensor, &settings.markers),
            looks: Vec::new(),
            grey_sum: vec![0; sensor.rectified_px().area()],
            cells_sum: vec![[0.0; 3]; map.count()],
            frames_count: 0,
            seq: 0,
            map,
            imprint,
            settings: settings.clone(),
            sensor,
        })
    }

    /// Frames added so far.
    pub fn frames_count(&self) -> u32 {
        self.frames_count
    }

    /// The facts of the finger at the size of its frames.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Looks at a candidate; call it on the first frames in their order.
    pub fn look(&mut self, frame: &Frame<'_>) -> RestLook {
        let mut look =
            RestLook { mean_levels: None, change_levels: f64::INFINITY, sharpness: f64::INFINITY, touched: true };
        if self.imprint.take(frame).is_err() {
            self.looks.push(Picture::default());
            return look;
        }
        let radius_px = (0.4 * self.sensor.pitch_px).max(cover_radius_px(&self.sensor));
        let now = Picture {
            cells: (0..self.map.count()).map(|i| self.map.colour(&self.imprint.cells, i)).collect(),
            covered: self.covered(radius_px),
        };
        let before = self.looks.last().filter(|p| !p.cells.is_empty());
        look.change_levels = before.map_or(f64::INFINITY, |before| before.change_levels(&now));
        let own = self.sensor.bare_sharpness.map(|bare| IMPRINT_RATIO * bare);
        let unmeasured = match self.sensor.skin {
            Skin::Fabric => {
                look.sharpness = texture_share(&self.sensor, &self.settings.contact, &self.imprint);
                self.settings.contact.on_area_fraction
            }
            Skin::Smooth => {
                let border_cells = (self.sensor.marker_diameter_px / self.map.cell_px as f64).ceil() as usize;
                look.sharpness = roughness_levels(&now.cells, &now.covered, self.map.columns, border_cells);
                self.settings.rest.imprint_levels
            }
        };
        look.mean_levels = Some(self.imprint.mean_levels);
        look.touched = look.sharpness > own.unwrap_or(unmeasured);
        self.looks.push(now);
        look
    }

    /// Cells that a marker covers in the picture taken last, and those that the camera does not see whole.
    fn covered(&mut self, radius_px: f64) -> Vec<bool> {
        let mut covered = self.map.unseen.clone();
        for spot in self.detector.spots(&self.imprint, self.settings.markers.birth_min_levels) {
            self.map.cover(spot.position, radius_px, &mut covered);
        }
        covered
    }

    /// Averages a frame into the rest frame.
    pub fn add(&mut self, frame: &Frame<'_>) -> Result<(), RestError> {
        self.imprint.take(frame).map_err(RestError::Unusable)?;
        for (sum, &v) in self.grey_sum.iter_mut().zip(&self.imprint.grey) {
            *sum += u32::from(v);
        }
        for (i, sum) in self.cells_sum.iter_mut().enumerate() {
            let colour = self.map.colour(&self.imprint.cells, i);
            sum.iter_mut().zip(colour).for_each(|(s, c)| *s += c);
        }
        self.frames_count += 1;
        self.seq = frame.seq;
        Ok(())
    }

    /// The rest frame from the frames added.
    pub fn build(mut self, kind: RestKind) -> Result<Rest, RestError> {
        if self.frames_count == 0 {
            return Err(RestError::Empty);
        }
        let n = self.frames_count;
        // Deviation: D2 averaged rest
        self.imprint.put_grey(self.grey_sum.iter().map(|sum| ((sum + n / 2) / n) as u8));
        let markers = self.detector.markers_at_rest(&self.imprint);
        let expected_count = self.settings.rest.markers_min_count;
        if markers.len() < expected_count as usize {
            return Err(RestError::FewMarkers { expected_count, got_count: markers.len() });
        }
        let cells_covered = self.covered(cover_radius_px(&self.sensor));
        let mut cells: Vec<[f32; 3]> = self.cells_sum.iter().map(|s| s.map(|v| v / n as f32)).collect();
        if kind == RestKind::InContact && self.sensor.skin == Skin::Smooth {
            illumination(&mut cells, &cells_covered, self.map.columns);
        }
        Ok(Rest {
            kind,
            seq: self.seq,
            frames_count: n,
            size: self.sensor.image_px,
            flat: self.imprint.flat.clone(),
            cells,
            cells_covered,
            markers,
        })
    }
}
