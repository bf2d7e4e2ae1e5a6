//! The rest frame: several calm frames averaged, with the markers found on it.
//!
//! ```text
//!   first frames --look--> dark? moving? touched? --choose--> the calm run --add--> mean picture --build--> Rest
//! ```

use super::contact::{CellMap, cover_radius_px, illumination, roughness_levels, texture_share};
use super::imprint::Imprint;
use super::markers::{Detector, RestMarker};
use super::{Reason, Settings};
use crate::image::{Frame, SizePx};
use crate::sensor::{Sensor, SettingError, Skin, within};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

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
    /// Smooth gel: sharper differences between neighbouring cells than this are an imprint, not illumination.
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

/// Fewer calm frames in a row than this may be the turning point of a motion.
const CALM_FRAMES_COUNT: usize = 3;

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

/// What one candidate frame looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestLook {
    /// Mean grey level; None when the frame cannot be judged at all.
    pub mean_levels: Option<f64>,
    /// 99th percentile of the change of a cell since the frame before, in levels; infinite for the first.
    pub change_levels: f64,
    /// Whether the frame shows an imprint.
    pub touched: bool,
}

/// Which frames make the rest frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RestChoice {
    /// Places in the list of looks.
    pub frames: Range<usize>,
    /// What the finger is doing in them.
    pub kind: RestKind,
}

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
    before: Option<Vec<[f32; 3]>>,
    grey_sum: Vec<u32>,
    cells_sum: Vec<[f32; 3]>,
    frames_count: u32,
    seq: u64,
}

impl RestBuilder {
    /// A builder for frames of `camera_px`. Fails when a setting or a fact of the sensor cannot be.
    pub fn new(sensor: &Sensor, settings: &Settings, camera_px: SizePx) -> Result<Self, SettingError> {
        settings.check()?;
        sensor.check()?;
        let sensor = sensor.at_size(camera_px)?;
        sensor.check()?;
        let imprint = Imprint::new(&sensor, settings, true);
        let map = CellMap::new(&sensor, &imprint.cells);
        Ok(RestBuilder {
            detector: Detector::new(&sensor, &settings.markers),
            before: None,
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

    /// The facts of the finger at the size of its frames.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Looks at a candidate; call it on the first frames in their order.
    pub fn look(&mut self, frame: &Frame<'_>) -> RestLook {
        let unusable = RestLook { mean_levels: None, change_levels: f64::INFINITY, touched: true };
        if self.imprint.take(frame).is_err() {
            self.before = None;
            return unusable;
        }
        let now: Vec<[f32; 3]> = (0..self.map.count()).map(|i| self.map.colour(&self.imprint.cells, i)).collect();
        let change_levels = self.before.as_ref().map_or(f64::INFINITY, |before| change_levels(before, &now));
        let touched = match self.sensor.skin {
            Skin::Fabric => {
                let share = texture_share(&self.sensor, &self.settings.contact, &self.imprint);
                share > self.settings.contact.on_area_fraction
            }
            Skin::Smooth => {
                let covered = self.covered();
                let border_cells = (self.sensor.marker_diameter_px / self.map.cell_px as f64).ceil() as usize;
                let roughness = roughness_levels(&now, &covered, self.map.columns, border_cells);
                roughness > self.settings.rest.imprint_levels
            }
        };
        self.before = Some(now);
        RestLook { mean_levels: Some(self.imprint.mean_levels), change_levels, touched }
    }

    /// Cells that a marker covers in the picture taken last.
    fn covered(&mut self) -> Vec<bool> {
        let mut covered = vec![false; self.map.count()];
        let radius_px = cover_radius_px(&self.sensor);
        for spot in self.detector.spots(&self.imprint, self.settings.markers.birth_min_levels) {
            self.map.cover(spot.position, radius_px, &mut covered);
        }
        covered
    }

    /// The calm run to average: untouched before touched, then the longest, then the first. Dark frames and frames
    /// of another brightness than most (a camera still settling, a stale buffer) are passed over.
    pub fn choose(&self, looks: &[RestLook]) -> Result<RestChoice, RestError> {
        let settings = &self.settings.rest;
        let mut brightness: Vec<f64> = looks.iter().filter_map(|l| l.mean_levels).collect();
        let unusable_count = looks.len() - brightness.len();
        brightness.sort_unstable_by(f64::total_cmp);
        let Some(&median) = brightness.get(brightness.len() / 2) else {
            return Err(RestError::NoCalmFrame { looked_at_count: looks.len(), unusable_count });
        };
        let bright =
            |l: &RestLook| l.mean_levels.is_some_and(|m| (m - median).abs() <= settings.brightness_fraction * median);
        let mut best: Option<RestChoice> = None;
        let mut from = 0;
        while from < looks.len() {
            if !bright(&looks[from]) {
                from += 1;
                continue;
            }
            let touched = looks[from].touched;
            let calm = |l: &RestLook| bright(l) && l.touched == touched && l.change_levels < settings.calm_levels;
            let end = from + 1 + looks[from + 1..].iter().take_while(|l| calm(l)).count();
            let most = from + settings.average_count as usize;
            let kind = if touched { RestKind::InContact } else { RestKind::Unloaded };
            let run = RestChoice { frames: from..end.min(most), kind };
            // More than a moment before a moment; untouched before touched; of untouched runs the longest, of touched
            // ones the first: a recording that starts in contact is judged from its start.
            let rank = |r: &RestChoice| {
                let untouched = r.kind == RestKind::Unloaded;
                (r.frames.len() >= CALM_FRAMES_COUNT, untouched, if untouched { r.frames.len() } else { 0 })
            };
            let better = best.as_ref().is_none_or(|b| rank(&run) > rank(b));
            if better {
                best = Some(run);
            }
            from = end;
        }
        best.ok_or(RestError::NoCalmFrame { looked_at_count: looks.len(), unusable_count })
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
        self.imprint.put_grey(self.grey_sum.iter().map(|sum| ((sum + n / 2) / n) as u8));
        let markers = self.detector.markers_at_rest(&self.imprint);
        let expected_count = self.settings.rest.markers_min_count;
        if markers.len() < expected_count as usize {
            return Err(RestError::FewMarkers { expected_count, got_count: markers.len() });
        }
        let cells_covered = self.covered();
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

/// 99th percentile over the cells of the change of their most changed channel.
fn change_levels(before: &[[f32; 3]], now: &[[f32; 3]]) -> f64 {
    let mut changes: Vec<f32> =
        before.iter().zip(now).map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max)).collect();
    let at = (changes.len() * 99 / 100).min(changes.len() - 1);
    f64::from(*changes.select_nth_unstable_by(at, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(mean_levels: f64, change_levels: f64, touched: bool) -> RestLook {
        RestLook { mean_levels: Some(mean_levels), change_levels, touched }
    }

    fn choose(looks: &[RestLook]) -> Result<RestChoice, RestError> {
        let sensor = crate::sensor::tests::smooth();
        let builder = RestBuilder::new(&sensor, &Settings::default(), sensor.image_px).expect("valid");
        builder.choose(looks)
    }

    #[test]
    fn dark_stale_and_touched_frames_are_passed_over() {
        let mut looks = vec![look(64.0, f64::INFINITY, false)]; // dark
        looks.push(look(90.0, 30.0, true)); // stale: an old touch
        looks.extend((0..6).map(|i| look(90.0, if i == 0 { 30.0 } else { 0.5 }, false)));
        looks.extend((0..9).map(|_| look(91.0, 8.0, true)));
        assert_eq!(choose(&looks), Ok(RestChoice { frames: 2..8, kind: RestKind::Unloaded }));
    }

    #[test]
    fn touched_from_the_start_takes_the_first_calm_run() {
        let looks: Vec<_> = (0..21).map(|i| look(90.0, if i < 6 { 0.5 } else { 9.0 }, true)).collect();
        assert_eq!(choose(&looks), Ok(RestChoice { frames: 0..6, kind: RestKind::InContact }));
    }

    #[test]
    fn black_frames_only_are_refused() {
        let black = RestLook { mean_levels: None, change_levels: f64::INFINITY, touched: true };
        let error = RestError::NoCalmFrame { looked_at_count: 2, unusable_count: 2 };
        assert_eq!(choose(&[black, black]), Err(error));
    }
}
