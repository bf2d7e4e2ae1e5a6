//! First frames -> rest frame: stationary ones are chosen and averaged, and the markers found on the mean.
//!
//! ```text
//!   first frames --look--> dark? moving? touched? --choose--> stationary run --add--> mean picture --build--> Rest
//! ```

mod choose;

pub use choose::{RestChoice, RestLook};

use crate::image::{Frame, SizePx};
use crate::monitor::cell_map::{CellMap, cover_radius_px};
use crate::monitor::contact::{illumination, roughness_levels, texture_share};
use crate::monitor::imprint::{Extra, Imprint};
use crate::monitor::markers::Detector;
use crate::monitor::rest::{Rest, RestError, RestKind};
use crate::monitor::settings::Settings;
use crate::sensor::{Sensor, Skin};
use crate::setting::SettingError;
use choose::Picture;

/// An imprint is sharper than the untouched finger by this factor; noise and JPEG move it by a tenth.
const IMPRINT_RATIO: f64 = 1.35;

/// Finds and averages stationary frames.
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
    /// A builder for frames of `camera_px`. Fails when a setting or a fact of the sensor is invalid.
    pub fn new(sensor: &Sensor, settings: &Settings, camera_px: SizePx) -> Result<Self, SettingError> {
        settings.check_for(sensor)?;
        sensor.check()?;
        let sensor = sensor.at_size(camera_px)?;
        sensor.check()?;
        let extra = Extra { flat: settings.markers.finder_needs_flat(), cells: true };
        let imprint = Imprint::new(&sensor, &settings.imprint, extra);
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

    /// The stationary run to average. Frames of another brightness than most (dark, stale, a camera still settling) are
    /// passed over; a run of several frames goes before a moment, untouched goes before touched. Of untouched runs
    /// that show the same, the longest. Where they differ, one of them is touched too lightly to be detected by itself: then
    /// the first run, which was touched if it is the sharper.
    ///
    /// `looks` are the answers of [`RestBuilder::look`] in their order.
    pub fn choose(&self, looks: &[RestLook]) -> Result<RestChoice, RestError> {
        choose::choose(looks, &self.looks, &self.settings.rest, &self.settings.contact)
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
