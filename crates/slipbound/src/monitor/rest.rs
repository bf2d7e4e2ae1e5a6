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
    /// How sharp the picture is between the markers: an imprint is, illumination is not. Smooth gel: grey levels
    /// (compare [`RestSettings::imprint_levels`]); fabric: the share of the image that looks like pressed weave.
    pub sharpness: f64,
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
    looks: Vec<Picture>,
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
        let sharpest_at_rest = match self.sensor.skin {
            Skin::Fabric => {
                look.sharpness = texture_share(&self.sensor, &self.settings.contact, &self.imprint);
                self.settings.contact.on_area_fraction
            }
            Skin::Smooth => {
                let border_cells = (self.sensor.marker_diameter_px / self.map.cell_px as f64).ceil() as usize;
                look.sharpness = roughness_levels(&now.cells, &now.covered, self.map.columns, border_cells);
                let own = self.sensor.bare_sharpness_levels.map(|bare| IMPRINT_RATIO * bare);
                own.unwrap_or(self.settings.rest.imprint_levels)
            }
        };
        look.mean_levels = Some(self.imprint.mean_levels);
        look.touched = look.sharpness > sharpest_at_rest;
        self.looks.push(now);
        look
    }

    /// Cells that a marker covers in the picture taken last.
    fn covered(&mut self, radius_px: f64) -> Vec<bool> {
        let mut covered = vec![false; self.map.count()];
        for spot in self.detector.spots(&self.imprint, self.settings.markers.birth_min_levels) {
            self.map.cover(spot.position, radius_px, &mut covered);
        }
        covered
    }

    /// The calm run to average. Frames of another brightness than most (dark, stale, a camera still settling) are
    /// passed over; a run of several frames goes before a moment, untouched goes before touched. Of untouched runs
    /// that show the same, the longest. Where they differ, one of them is touched too lightly to tell by itself: then
    /// the first run, which was touched if it is the sharper.
    ///
    /// `looks` are the answers of [`RestBuilder::look`] in their order.
    pub fn choose(&self, looks: &[RestLook]) -> Result<RestChoice, RestError> {
        let mut choice = self.best_run(looks)?;
        choice.frames.end = choice.frames.end.min(choice.frames.start + self.settings.rest.average_count as usize);
        Ok(choice)
    }

    fn best_run(&self, looks: &[RestLook]) -> Result<RestChoice, RestError> {
        let runs = self.runs(looks)?;
        let long = |r: &&RestChoice| r.frames.len() >= CALM_FRAMES_COUNT;
        let untouched = |r: &&RestChoice| r.kind == RestKind::Unloaded;
        let candidates: Vec<&RestChoice> = match runs.iter().filter(long).count() {
            0 => runs.iter().collect(),
            _ => runs.iter().filter(long).collect(),
        };
        let Some(&first) = candidates.iter().find(|r| untouched(r)) else {
            return Ok(candidates[0].clone());
        };
        let sharpness =
            |r: &RestChoice| looks[r.frames.clone()].iter().map(|l| l.sharpness).sum::<f64>() / r.frames.len() as f64;
        let others = || candidates.iter().filter(|r| untouched(r) && r.frames != first.frames);
        let mut choice = first.clone();
        if others().any(|other| self.differ(first, other)) {
            let sharper = others().any(|other| self.differ(first, other) && sharpness(first) > sharpness(other));
            choice.kind = if sharper { RestKind::InContact } else { RestKind::Unloaded };
        } else {
            for other in others() {
                if other.frames.len() > choice.frames.len() {
                    choice = (*other).clone();
                }
            }
        }
        Ok(choice)
    }

    /// Calm runs of frames of the usual brightness, in their order; at least one.
    fn runs(&self, looks: &[RestLook]) -> Result<Vec<RestChoice>, RestError> {
        let settings = &self.settings.rest;
        let mut brightness: Vec<f64> = looks.iter().filter_map(|l| l.mean_levels).collect();
        let unusable_count = looks.len() - brightness.len();
        brightness.sort_unstable_by(f64::total_cmp);
        let Some(&median) = brightness.get(brightness.len() / 2) else {
            return Err(RestError::NoCalmFrame { looked_at_count: looks.len(), unusable_count });
        };
        let bright =
            |l: &RestLook| l.mean_levels.is_some_and(|m| (m - median).abs() <= settings.brightness_fraction * median);
        let mut runs: Vec<RestChoice> = Vec::new();
        for (i, look) in looks.iter().enumerate().filter(|(_, l)| bright(l)) {
            let kind = if look.touched { RestKind::InContact } else { RestKind::Unloaded };
            match runs.last_mut() {
                Some(run) if run.frames.end == i && run.kind == kind && look.change_levels < settings.calm_levels => {
                    run.frames.end = i + 1;
                }
                _ => runs.push(RestChoice { frames: i..i + 1, kind }),
            }
        }
        Ok(runs)
    }

    /// Whether something was there in one run and not in the other: a share of the cells as large as a contact has
    /// changed as much as a contact changes them.
    fn differ(&self, a: &RestChoice, b: &RestChoice) -> bool {
        // The middle frame stands for a calm run.
        let middle = |r: &RestChoice| self.looks.get((r.frames.start + r.frames.end) / 2);
        let (Some(a), Some(b)) = (middle(a), middle(b)) else { return false };
        let contact = &self.settings.contact;
        a.changed_share(b, contact.change_levels as f32) > contact.on_area_fraction
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

/// The cells of a frame that was looked at; empty when it could not be judged.
#[derive(Debug, Clone, Default)]
struct Picture {
    cells: Vec<[f32; 3]>,
    covered: Vec<bool>,
}

impl Picture {
    /// Change of the most changed channel of every cell.
    fn changes<'a>(&'a self, other: &'a Picture) -> impl Iterator<Item = f32> + 'a {
        let most = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
        self.cells.iter().zip(&other.cells).map(move |(a, b)| most(a, b))
    }

    /// 99th percentile of the change.
    fn change_levels(&self, other: &Picture) -> f64 {
        let mut changes: Vec<f32> = self.changes(other).collect();
        let at = (changes.len() * 99 / 100).min(changes.len() - 1);
        f64::from(*changes.select_nth_unstable_by(at, f32::total_cmp).1)
    }

    /// Share of the cells free of markers in both that changed by more than a level.
    fn changed_share(&self, other: &Picture, level: f32) -> f64 {
        let free = |i: usize| !self.covered[i] && !other.covered[i];
        let (mut changed, mut count) = (0u32, 0u32);
        for (_, change) in self.changes(other).enumerate().filter(|(i, _)| free(*i)) {
            changed += u32::from(change > level);
            count += 1;
        }
        f64::from(changed) / f64::from(count.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(mean_levels: f64, change_levels: f64, touched: bool) -> RestLook {
        RestLook { mean_levels: Some(mean_levels), change_levels, sharpness: if touched { 9.0 } else { 3.0 }, touched }
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

    /// A light touch is too weak to be told by itself. When it goes, the picture changes and gets smoother: it was one.
    /// When it comes, the picture changes and gets sharper: before, there was none.
    #[test]
    fn a_light_touch_is_told_by_what_changes() {
        let sensor = crate::sensor::tests::smooth();
        let mut builder = RestBuilder::new(&sensor, &Settings::default(), sensor.image_px).expect("valid");
        let map_count = builder.map.count();
        let picture = |touched: bool| Picture {
            cells: (0..map_count).map(|i| [if touched && i < map_count / 5 { 100.0 } else { 90.0 }; 3]).collect(),
            covered: vec![false; map_count],
        };
        for (first_touched, kind) in [(true, RestKind::InContact), (false, RestKind::Unloaded)] {
            let shows = |i: usize| (i < 5) == first_touched;
            builder.looks = (0..15).map(|i| picture(shows(i))).collect();
            let looks: Vec<RestLook> = (0..15)
                .map(|i| {
                    let sharpness = if shows(i) { 5.0 } else { 3.5 };
                    RestLook { sharpness, ..look(90.0, if i == 5 { 12.0 } else { 0.5 }, false) }
                })
                .collect();
            assert_eq!(builder.choose(&looks), Ok(RestChoice { frames: 0..5, kind }));
        }
    }

    #[test]
    fn black_frames_only_are_refused() {
        let black = RestLook { mean_levels: None, ..look(0.0, f64::INFINITY, true) };
        let error = RestError::NoCalmFrame { looked_at_count: 2, unusable_count: 2 };
        assert_eq!(choose(&[black, black]), Err(error));
    }
}
