//! First frames -> rest frame: stationary frames are chosen and averaged, and markers are found in the mean image.
//!
//! ```text
//!   first frames --look--> dark? moving? touched? --choose--> stationary run --add--> mean image --build--> Rest
//! ```

mod choose;
mod lattice;
mod sharpness;

pub use choose::{RestChoice, RestLook};

use crate::image::{Frame, SizePx};
use crate::monitor::cell_map::{CellMap, cover_radius_px};
use crate::monitor::contact::{IMPRINT_RATIO, illumination, texture_share};
use crate::monitor::estimate;
use crate::monitor::gross;
use crate::monitor::imprint::{Extra, Imprint};
use crate::monitor::markers::{Detector, RestMarker};
use crate::monitor::report::Reason;
use crate::monitor::rest::{Rest, RestError, RestKind};
use crate::monitor::settings::Settings;
use crate::plane::Vec2;
use crate::sensor::{Flip, Sensor, Skin};
use crate::setting::SettingError;
use choose::{CellImage, STATIONARY_FRAMES_COUNT};
use sharpness::{Sharpness, covered, wide_radius_px};

/// Painted gels with markers close together are up to 5.4 levels sharp untouched, weaves taken for a gel 38.
const RIMS_RATIO: f64 = 1.5;

/// Finds and averages stationary frames.
#[derive(Debug, Clone)]
pub struct RestBuilder {
    sensor: Sensor,
    settings: Settings,
    imprint: Imprint,
    map: CellMap,
    /// For a smooth skin.
    sharpness: Option<Sharpness>,
    detector: Detector,
    looks: Vec<CellImage>,
    grey_sum: Vec<u32>,
    cells_sum: Vec<[f32; 3]>,
    frames_count: u32,
    seq: u64,
}

impl RestBuilder {
    /// A builder for frames of `camera_px`. Fails when a setting or a fact of the sensor is invalid.
    pub fn new(sensor: &Sensor, settings: &Settings, camera_px: SizePx) -> Result<Self, SettingError> {
        sensor.check()?;
        let sensor = sensor.at_size(camera_px)?;
        settings.check_for(&sensor)?;
        sensor.check()?;
        // Now, and not when the frames are there.
        estimate::read_trees();
        gross::read_trees();
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
            sharpness: (sensor.skin == Skin::Smooth).then(|| Sharpness::new(&sensor)),
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

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Examines a candidate; call it on the first frames in order.
    pub fn look(&mut self, frame: &Frame<'_>) -> RestLook {
        let mut look =
            RestLook { mean_levels: None, change_levels: f64::INFINITY, sharpness: f64::INFINITY, touched: true };
        if self.imprint.take(frame, true).is_err() {
            self.looks.push(CellImage::default());
            return look;
        }
        let spots = self.spots();
        let now = CellImage {
            cells: (0..self.map.count()).map(|i| self.map.colour(&self.imprint.cells, i)).collect(),
            covered: covered(&self.map, &spots, wide_radius_px(&self.sensor)),
        };
        let before = self.looks.last().filter(|p| !p.cells.is_empty());
        look.change_levels = before.map_or(f64::INFINITY, |before| before.change_levels(&now));
        look.sharpness = match &mut self.sharpness {
            Some(sharpness) => sharpness.levels(&frame.pixels, &spots),
            None => texture_share(&self.sensor, &self.settings.contact, &self.imprint),
        };
        look.mean_levels = Some(self.imprint.mean_levels);
        look.touched = look.sharpness > self.bare_sharpness();
        self.looks.push(now);
        look
    }

    /// Highest sharpness of an untouched finger: see [`RestLook::sharpness`]. Of a smooth gel whose file does not state it,
    /// it is higher where markers are so near to each other that their rims count.
    pub fn bare_sharpness(&self) -> f64 {
        let own = self.sensor.bare_sharpness.map(|bare| IMPRINT_RATIO * bare);
        own.unwrap_or(match &self.sharpness {
            None => self.settings.contact.on_area_fraction,
            Some(sharpness) if sharpness.is_wide() => self.settings.rest.imprint_levels,
            Some(_) => RIMS_RATIO * self.settings.rest.imprint_levels,
        })
    }

    /// Whether an imprint can be told: not on a smooth gel whose markers leave nothing between them.
    pub fn tells_touch(&self) -> bool {
        self.sharpness.as_ref().is_none_or(Sharpness::tells)
    }

    /// The stationary run to average. Frames of unusual brightness (dark, stale, a camera still settling) are skipped.
    /// Frames are stationary when they change by less than [`calm_levels`](crate::monitor::RestSettings::calm_levels) or,
    /// if no run of several frames does, by no more than noise. If none is stationary and one shows an imprint, the
    /// first one is chosen, as touched. A run of several frames is preferred to a shorter one, and an untouched run to a
    /// touched one. Of untouched runs that show the same, the first is chosen, or the longest if the first has less than
    /// half of the frames to average. If they differ, one of them is touched too lightly to be detected by itself: then
    /// the first is chosen, and it counts as touched if it is the sharper one. If the settings say that an object is
    /// [`held`](crate::monitor::RestSettings::held), the first run is chosen, as touched.
    ///
    /// `looks` are the results of [`RestBuilder::look`] in order.
    pub fn choose(&self, looks: &[RestLook]) -> Result<RestChoice, RestError> {
        choose::choose(looks, &self.looks, &self.settings.rest, &self.settings.contact)
    }

    /// Whether a choice among several frames is not a stationary run, because there is none.
    pub(crate) fn is_moving(&self, choice: &RestChoice) -> bool {
        let least_count = STATIONARY_FRAMES_COUNT.min(self.settings.rest.average_count as usize);
        choice.frames.len() < least_count && self.looks.len() >= STATIONARY_FRAMES_COUNT
    }

    /// The spots of the last image, px.
    fn spots(&mut self) -> Vec<Vec2> {
        let spots = self.detector.spots(&self.imprint, self.settings.markers.birth_min_levels);
        spots.iter().map(|spot| spot.position).collect()
    }

    /// Averages a frame into the rest frame.
    pub fn add(&mut self, frame: &Frame<'_>) -> Result<(), RestError> {
        self.imprint.take(frame, true).map_err(RestError::Unusable)?;
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
        let mut markers = self.detector.markers_at_rest(&self.imprint);
        let spacing_px = lattice::spacing_px(&places(&markers));
        let on_lattice = self.on_lattice(&markers);
        let regular = on_lattice.is_some();
        let mut keep = on_lattice.into_iter().flatten();
        markers.retain(|_| keep.next().unwrap_or(true));
        let expected_count = self.settings.rest.markers_min_count;
        if markers.len() < expected_count as usize {
            return Err(RestError::FewMarkers { expected_count, got_count: markers.len() });
        }
        let spots = self.spots();
        let cells_covered = covered(&self.map, &spots, cover_radius_px(&self.sensor));
        let mut cells: Vec<[f32; 3]> = self.cells_sum.iter().map(|s| s.map(|v| v / n as f32)).collect();
        if kind == RestKind::InContact && self.sensor.skin == Skin::Smooth {
            illumination(&mut cells, &cells_covered, self.map.columns);
        }
        let mut rest = Rest {
            kind,
            seq: self.seq,
            frames_count: n,
            size: self.sensor.image_px,
            grey: self.imprint.grey.clone(),
            flat: self.imprint.flat.clone(),
            cells,
            cells_covered,
            markers,
            refusal: None,
        };
        rest.refusal = spacing_px.and_then(|px| self.spacing_refusal(px, regular));
        Ok(rest)
    }

    /// Which of the markers found lie on the finger's lattice; the others are glare or dirt. A finger has a lattice if
    /// its file has a rectification (then markers are a pitch apart along both axes of the rectified image) and most of
    /// its dots lie on one. None for any other finger: all its dots are markers.
    fn on_lattice(&self, markers: &[RestMarker]) -> Option<Vec<bool>> {
        self.sensor.rectification.as_ref()?;
        lattice::on_lattice(&places(markers), self.sensor.pitch_px)
    }

    /// Why markers with this spacing are not this finger's, and with which flip they would be; None when they are. The
    /// spacing alone does not always reveal a wrong flip: markers that lie on a lattice only with another flip are not
    /// this finger's, either. Call it last: it mirrors the last image.
    fn spacing_refusal(&mut self, got_px: f64, regular: bool) -> Option<Reason> {
        let expected_px = self.sensor.pitch_px;
        let fits = lattice::fits(got_px, expected_px);
        let rectified = self.sensor.rectification.is_some();
        if !self.settings.rest.check_spacing || (fits && (regular || !rectified)) {
            return None;
        }
        let fitting = if rectified { self.fitting_flip() } else { None };
        (!fits || fitting.is_some()).then_some(Reason::MarkerSpacing { expected_px, got_px, fitting })
    }

    /// The other flip with which most markers lie on the lattice, and their spacing then, px.
    fn fitting_flip(&mut self) -> Option<(Flip, f64)> {
        let mut now = self.sensor.flip;
        let mut best: Option<(usize, Flip, f64)> = None;
        for flip in Flip::ALL.into_iter().filter(|flip| *flip != self.sensor.flip) {
            self.imprint.mirror(now, flip);
            now = flip;
            let markers = self.detector.markers_at_rest(&self.imprint);
            let Some(on) = self.on_lattice(&markers) else { continue };
            let count = on.iter().filter(|on| **on).count();
            let spacing_px = lattice::spacing_px(&places(&markers));
            if let Some(px) = spacing_px.filter(|px| lattice::fits(*px, self.sensor.pitch_px))
                && best.is_none_or(|(most, ..)| count > most)
            {
                best = Some((count, flip, px));
            }
        }
        best.map(|(_, flip, px)| (flip, px))
    }
}

fn places(markers: &[RestMarker]) -> Vec<Vec2> {
    markers.iter().map(|m| m.position).collect()
}
