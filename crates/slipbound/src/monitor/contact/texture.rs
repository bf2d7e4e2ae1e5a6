//! The contact region of a fabric skin: the paper's edges and morphology.
//!
//! ```text
//!   flat image --Canny, thresholds follow the light--> edges, without those of the rest frame
//!                                                        --close, erode--> pieces, weak ones dropped --dilate--> region
//! ```
//!
//! After a start in contact the rest frame shows pressed weave: its edges are those of the object. The share of the
//! image that looks like pressed weave tells when the finger is free, and that image then takes the place of the rest
//! frame.

use super::settings::ContactSettings;
use crate::image::Mask;
use crate::monitor::imprint::Imprint;
use crate::monitor::rest::{Rest, RestKind};
use crate::pixels::canny::Canny;
use crate::pixels::components::Components;
use crate::pixels::mean::mean_levels;
use crate::pixels::morphology::{Element, Morphology};
use crate::sensor::{EdgeBand, Sensor};

/// An unpressed weave that is near the camera or well lit also shows edges in places. After closing and erosion, pieces
/// made of them are small, or have an edge density below this share of that of the largest piece.
const LEAST_PIECE_PITCH: f64 = 0.5;
const WEAK_PIECE_FRACTION: f64 = 0.6;
/// Steps in which the thresholds follow the brightness: the noise of an image does not change them.
const LIGHT_STEP: f64 = 0.05;
/// An imprint is sharper than the untouched finger by this factor. Noise and JPEG as at calibration change sharpness by
/// a tenth; a stronger compression (quality 80 for 95: a factor of 1.5) or light needs a calibration of its own.
pub(in crate::monitor) const IMPRINT_RATIO: f64 = 1.35;
/// Dilation, in pitches, with which `bare_sharpness` of sensor files is measured, whatever the settings.
const SHARPNESS_DILATE_PITCH: f64 = 18.0 / 15.2;

/// Finds it; owns all scratch.
#[derive(Debug, Clone)]
pub(super) struct TextureContact {
    bands: Vec<EdgeBand>,
    canny: Canny,
    edges: Mask,
    join: Join,
    dilate: Element,
    removes_weak: bool,
    hidden: Option<Mask>,
    /// Mean level of the rest frame; None where the thresholds do not follow the light.
    rest_levels: Option<f64>,
    /// After a start in contact.
    weave: Option<PressedWeave>,
}

/// How much of the image looks like pressed weave: less once a finger that started in contact is free.
#[derive(Debug, Clone)]
struct PressedWeave {
    bare_fraction: f64,
    dilate: Element,
    region: Mask,
}

impl TextureContact {
    fn new(sensor: &Sensor, settings: &ContactSettings) -> Self {
        let size = sensor.rectified_px();
        TextureContact {
            bands: sensor.edge_bands.clone(),
            canny: Canny::new(size),
            edges: Mask::new(size),
            join: Join::new(sensor, settings),
            dilate: ellipse(sensor, settings.dilate_pitch),
            removes_weak: settings.drop_weak_pieces,
            hidden: None,
            rest_levels: None,
            weave: None,
        }
    }

    /// For the frames after this rest frame.
    pub fn from_rest(sensor: &Sensor, settings: &ContactSettings, imprint: &Imprint, rest: &Rest) -> Self {
        let mut texture = TextureContact::new(sensor, settings);
        texture.find_edges(&rest.flat, imprint.seen(), 1.0);
        let mut region = Mask::new(texture.edges.size());
        // Deviation: D3 rest edges hidden
        match rest.kind {
            _ if !settings.hide_rest_edges => {}
            RestKind::Unloaded => texture.hide(region),
            RestKind::InContact => {
                let dilate = ellipse(sensor, SHARPNESS_DILATE_PITCH);
                let fraction = texture.weave_fraction(&dilate, &mut region);
                // An object that presses too lightly to be told from a free finger is never told to have left.
                let bare = sensor.bare_sharpness.map(|bare| IMPRINT_RATIO * bare).filter(|bare| fraction > *bare);
                texture.weave = bare.map(|bare_fraction| PressedWeave { bare_fraction, dilate, region });
            }
        }
        texture.rest_levels = settings.follow_light.then(|| mean_levels(&rest.grey, sensor.rectified_px().width));
        texture
    }

    /// Writes the region; returns the share of edge pixels in it.
    pub fn find(&mut self, imprint: &Imprint, region: &mut Mask) -> f64 {
        self.find_edges(&imprint.flat, imprint.seen(), self.light(imprint));
        self.join.run(&self.edges, &self.dilate, self.removes_weak, region);
        if self.looks_free() {
            region.clear();
        }
        let inside: u32 = self.edges.words().iter().zip(region.words()).map(|(e, r)| (e & r).count_ones()).sum();
        f64::from(inside) / region.area_px2().max(1) as f64
    }

    /// The contact since the rest frame has ended with the last image: the finger is free in it.
    pub fn end_start(&mut self) {
        if let Some(weave) = self.weave.take() {
            self.hide(weave.region);
        }
    }

    // Deviation: D22 thresholds follow the light
    /// Brightness of the image relative to the rest frame; 1 where the thresholds do not follow it.
    fn light(&self, imprint: &Imprint) -> f64 {
        let now_levels = || mean_levels(&imprint.grey, imprint.size().width);
        let steps = |rest_levels: f64| (now_levels() / rest_levels.max(1.0) / LIGHT_STEP).round().max(1.0);
        self.rest_levels.map_or(1.0, |rest_levels| steps(rest_levels) * LIGHT_STEP)
    }

    /// The edges of an image; `light`: factor of the thresholds.
    fn find_edges(&mut self, flat: &[u8], seen: Option<&Mask>, light: f64) {
        let mut from = 0;
        for band in &self.bands {
            let to = (band.rows_to_fraction * self.edges.size().height as f64).round() as usize;
            let [low, high] = [band.low_levels, band.high_levels].map(|l| (f64::from(l) * light).round() as u16);
            self.canny.run(flat, from..to, low, high, &mut self.edges);
            from = to;
        }
        let edges = self.edges.words_mut();
        if let Some(seen) = seen {
            edges.iter_mut().zip(seen.words()).for_each(|(e, s)| *e &= s);
        }
        if let Some(hidden) = &self.hidden {
            edges.iter_mut().zip(hidden.words()).for_each(|(e, h)| *e &= !h);
        }
    }

    /// Hides, in all later frames, what looks like contact in the last image, of a free finger. `region`: memory.
    fn hide(&mut self, mut region: Mask) {
        self.join.run(&self.edges, &self.dilate, false, &mut region);
        self.hidden = (region.area_px2() > 0).then_some(region);
    }

    /// Share of the last image that looks like pressed weave, as `bare_sharpness` of sensor files is measured: all
    /// pieces count.
    fn weave_fraction(&mut self, dilate: &Element, region: &mut Mask) -> f64 {
        self.join.run(&self.edges, dilate, false, region);
        region.area_px2() as f64 / region.size().area() as f64
    }

    /// Whether a finger that started in contact looks free in the last image.
    fn looks_free(&mut self) -> bool {
        let Some(PressedWeave { bare_fraction, dilate, region }) = &mut self.weave else { return false };
        self.join.run(&self.edges, dilate, false, region);
        region.area_px2() as f64 <= *bare_fraction * region.size().area() as f64
    }
}

/// Joins edges to a region.
#[derive(Debug, Clone)]
struct Join {
    morphology: Morphology,
    components: Components,
    close: Element,
    erode: Element,
    least_piece_px2: usize,
    work: Mask,
}

impl Join {
    fn new(sensor: &Sensor, settings: &ContactSettings) -> Self {
        let size = sensor.rectified_px();
        let square = |pitch: f64| Element::rect(side_px(sensor, pitch), side_px(sensor, pitch));
        let least_piece_px = LEAST_PIECE_PITCH * sensor.pitch_px;
        Join {
            morphology: Morphology::new(size),
            components: Components::new(size),
            close: square(settings.close_pitch),
            erode: square(settings.erode_pitch),
            least_piece_px2: (least_piece_px * least_piece_px).round() as usize,
            work: Mask::new(size),
        }
    }

    /// Writes the region; `remove_weak`: whether weak pieces are dropped.
    fn run(&mut self, edges: &Mask, dilate: &Element, remove_weak: bool, region: &mut Mask) {
        self.morphology.close(edges, &self.close, &mut self.work);
        self.morphology.erode(&self.work, &self.erode, region);
        if remove_weak {
            self.components.remove_weak(region, edges, self.least_piece_px2, WEAK_PIECE_FRACTION);
        }
        self.morphology.dilate(region, dilate, &mut self.work);
        region.copy_from(&self.work);
    }
}

fn side_px(sensor: &Sensor, pitch: f64) -> usize {
    (pitch * sensor.pitch_px).round().max(1.0) as usize
}

fn ellipse(sensor: &Sensor, pitch: f64) -> Element {
    Element::ellipse(side_px(sensor, pitch), side_px(sensor, pitch))
}

/// Share of the image that looks like pressed weave, without a rest frame.
pub(in crate::monitor) fn texture_share(sensor: &Sensor, settings: &ContactSettings, imprint: &Imprint) -> f64 {
    let mut texture = TextureContact::new(sensor, settings);
    texture.find_edges(&imprint.flat, imprint.seen(), 1.0);
    texture.weave_fraction(&ellipse(sensor, SHARPNESS_DILATE_PITCH), &mut Mask::new(imprint.size()))
}
