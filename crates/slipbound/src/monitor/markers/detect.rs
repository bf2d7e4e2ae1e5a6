//! Markers in one image: spots, their sub-pixel centres, and the markers of the rest frame.

use super::settings::{Finder, MarkerSettings};
use super::threshold::ThresholdFinder;
use crate::image::{Mask, SizePx};
use crate::monitor::imprint::Imprint;
use crate::pixels::centroid::EdgeKernel;
use crate::pixels::dots::{DotFinder, Spot};
use crate::pixels::template::Fit;
use crate::plane::{Vec2, nearest_px};
use crate::sensor::Sensor;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// A marker as the rest frame shows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RestMarker {
    /// Sub-pixel position.
    pub(crate) position: Vec2,
    /// Contrast against its surroundings.
    pub(crate) response_levels: f32,
    /// Whether its edge is ragged, so that the wide kernel is used.
    ragged: bool,
    /// How fast the pull of its edge grows away from the centre; 0 where even the wide kernel finds no edge.
    stiffness: f64,
    /// From the coarse spot to the position; added where its edge is not used.
    offset: Vec2,
}

impl RestMarker {
    /// Checks that its numbers are possible, except for the position.
    pub(crate) fn check(&self, key: &str) -> Result<(), SettingError> {
        within(&format!("{key}.response_levels"), f64::from(self.response_levels), -255.0, 255.0)?;
        within(&format!("{key}.stiffness"), self.stiffness, -1e12, 1e12)?;
        within(&format!("{key}.offset.x"), self.offset.x, -1e4, 1e4)?;
        within(&format!("{key}.offset.y"), self.offset.y, -1e4, 1e4)
    }
}

/// A weave at most this many times as strong as at rest is not pressed.
pub(super) const BARE_WEAVE: f64 = 1.5;

/// An edge pull that ends further than this from the template fit is not the marker's, px.
const FAR_PULL_PX: f64 = 1.0;

/// Weight of the template fit against the edge pull: zero up to a weave half again as strong as at rest, where the edge
/// is more exact; one from three times as strong, because a pressed weave shifts the edge: by 0.08 px on average under
/// a box at 60 N.
fn share(fit: &Fit) -> f64 {
    ((fit.weave - BARE_WEAVE) / 1.5).clamp(0.0, 1.0)
}

/// Eight points on a circle, relative to its centre.
pub(super) fn rim(radius_px: f64) -> [Vec2; 8] {
    std::array::from_fn(|k| {
        let angle = k as f64 * std::f64::consts::FRAC_PI_4;
        Vec2::new(libm::cos(angle), libm::sin(angle)) * radius_px
    })
}

/// Sum of the grey levels of the 3 x 3 pixels around a position; None at the border.
pub(super) fn core_levels(grey: &[u8], size: SizePx, place: Vec2) -> Option<i32> {
    let (x, y) = (nearest_px(place.x), nearest_px(place.y));
    let inside = |v: isize, end: usize| v >= 1 && v < end as isize - 1;
    if !inside(x, size.width) || !inside(y, size.height) {
        return None;
    }
    let first = (y as usize - 1) * size.width + x as usize - 1;
    let row = |k: usize| grey[first + k * size.width..][..3].iter().map(|&v| i32::from(v)).sum::<i32>();
    Some(row(0) + row(1) + row(2))
}

/// Finds markers; independent of earlier images.
#[derive(Debug, Clone)]
pub(crate) struct Detector {
    settings: MarkerSettings,
    dots: DotFinder,
    threshold: Option<Box<ThresholdFinder>>,
    sharp: EdgeKernel,
    wide: EdgeKernel,
    ragged_below_ratio: f64,
    radius_px: f64,
    /// Points just outside a marker's edge, all around it, relative to its centre.
    rim: [Vec2; 8],
    expected_count: usize,
}

impl Detector {
    pub(crate) fn new(sensor: &Sensor, settings: &MarkerSettings) -> Self {
        let (size, diameter_px, pitch_px) = (sensor.rectified_px(), sensor.marker_diameter_px, sensor.pitch_px);
        let sharp = EdgeKernel::new(diameter_px, pitch_px, 0.25);
        let wide = EdgeKernel::new(diameter_px, pitch_px, 0.6);
        // Ratio of the pull of the sharp kernel on a round dot to that of the wide one.
        let round_ratio = sharp.stiffness_of_a_disc(1.0) / wide.stiffness_of_a_disc(1.0);
        Detector {
            settings: settings.clone(),
            dots: DotFinder::new(size, diameter_px, pitch_px, sensor.polarity),
            threshold: (settings.finder == Finder::Threshold).then(|| Box::new(ThresholdFinder::new(size, pitch_px))),
            ragged_below_ratio: 0.8 * round_ratio,
            sharp,
            wide,
            radius_px: diameter_px / 2.0,
            rim: rim(diameter_px / 2.0 + 1.0),
            expected_count: (size.area() as f64 / (pitch_px * pitch_px)).round() as usize,
        }
    }

    /// Spots of at least this contrast, strongest first.
    pub(crate) fn spots(&mut self, imprint: &Imprint, min_levels: f64) -> &[Spot] {
        // Deviation: D5 edge pull
        match &mut self.threshold {
            None => self.dots.run(&imprint.grey, min_levels as f32),
            Some(threshold) => threshold.run(&imprint.flat),
        }
    }

    /// Learns from the rest image what a finder needs: the paper's local thresholds.
    pub(crate) fn learn(&mut self, flat_at_rest: &[u8]) {
        if let Some(threshold) = &mut self.threshold {
            threshold.learn(flat_at_rest);
        }
    }

    /// The sub-pixel position of a marker whose spot was found; None where it is cut by the border of the image or of
    /// the camera's view: the rest of its rim would pull it inwards.
    pub(crate) fn refine(&self, imprint: &Imprint, spot: &Spot, rest: &RestMarker) -> Option<Vec2> {
        let coarse = spot.position + rest.offset;
        if self.threshold.is_some() {
            return Some(coarse);
        }
        if !self.sharp.holds(imprint.size(), coarse) || !self.in_view(imprint, coarse) {
            return None;
        }
        if rest.stiffness == 0.0 {
            return Some(coarse);
        }
        let contrast = f64::from(spot.response_levels / rest.response_levels).clamp(0.4, 2.5);
        Some(self.pulled(self.kernel(rest), imprint, spot.position, rest.stiffness * contrast).unwrap_or(coarse))
    }

    /// The position of a marker near its expected one, by its edge alone; None at the border and without an edge.
    pub(super) fn follow(&self, imprint: &Imprint, start: Vec2, contrast: f64, rest: &RestMarker) -> Option<Vec2> {
        if rest.stiffness == 0.0 || !self.sharp.holds(imprint.size(), start) || !self.in_view(imprint, start) {
            return None;
        }
        self.pulled(self.kernel(rest), imprint, start, rest.stiffness * contrast.clamp(0.4, 2.5))
    }

    fn kernel(&self, rest: &RestMarker) -> &EdgeKernel {
        if rest.ragged { &self.wide } else { &self.sharp }
    }

    /// The position of a marker whose template was found: a weighted mean of the fit and the edge pull, which starts at
    /// the spot or, without one, at `start`. Where the weave is pressed, it is the fit alone.
    pub(super) fn blend(
        &self,
        imprint: &Imprint,
        fit: &Fit,
        spot: Option<&Spot>,
        start: Vec2,
        rest: &RestMarker,
    ) -> Vec2 {
        let share = share(fit);
        if rest.stiffness == 0.0 || share == 1.0 {
            return fit.place;
        }
        let near = |place: Vec2| (place - fit.place).length() < FAR_PULL_PX;
        let of_spot = spot.and_then(|spot| self.refine(imprint, spot, rest)).filter(|place| near(*place));
        let of_start = || self.pulled(self.kernel(rest), imprint, start, rest.stiffness * fit.dot.clamp(0.4, 2.5));
        let pulled = of_spot.or_else(of_start).filter(|place| near(*place));
        pulled.map_or(fit.place, |place| place + (fit.place - place) * share)
    }

    /// Position to which the edge pulls from `start`; None at the border or when it is outside the dot.
    fn pulled(&self, kernel: &EdgeKernel, imprint: &Imprint, start: Vec2, stiffness: f64) -> Option<Vec2> {
        let longest_px = 0.3 * self.radius_px;
        let centre = kernel.centre(&imprint.grey, imprint.size(), start, stiffness, longest_px, 5)?;
        ((centre - start).length() < 0.6 * self.radius_px.max(2.0)).then_some(centre)
    }

    /// The markers of a rest frame, in reading order: row by row of the image, not of the grid.
    pub(crate) fn markers_at_rest(&mut self, imprint: &Imprint) -> Vec<RestMarker> {
        self.learn(&imprint.flat);
        let spots = self.spots(imprint, self.settings.birth_min_levels).to_vec();
        // Spots are strongest first: the first half of the markers that fit into the image are certainly markers.
        let typical = spots.get((self.expected_count / 2).min(spots.len().saturating_sub(1)));
        let least = typical.map_or(0.0, |s| s.response_levels * self.settings.birth_contrast_fraction as f32);
        let mut markers: Vec<RestMarker> = spots
            .iter()
            .filter(|s| s.response_levels >= least)
            .filter(|s| self.whole(imprint, s.position))
            .map(|s| self.at_rest(imprint, s))
            // A weak spot without an edge is a ridge of light, not a dot.
            .filter(|m| self.threshold.is_some() || m.stiffness != 0.0 || m.response_levels >= 2.5 * least)
            .collect();
        markers
            .sort_unstable_by(|a, b| a.position.y.total_cmp(&b.position.y).then(a.position.x.total_cmp(&b.position.x)));
        markers
    }

    fn at_rest(&self, imprint: &Imprint, spot: &Spot) -> RestMarker {
        let start = spot.position;
        let bare = RestMarker {
            position: start,
            response_levels: spot.response_levels,
            ragged: false,
            stiffness: 0.0,
            offset: Vec2::ZERO,
        };
        if self.threshold.is_some() {
            return bare;
        }
        let settled = |ragged: bool| self.settle(imprint, start, ragged).map(|(p, s)| (ragged, p, s));
        let sharp = settled(false);
        let wide = settled(true);
        let is_round = |sharp: f64, wide: f64| sharp / wide >= self.ragged_below_ratio;
        let chosen = match (sharp, wide) {
            (Some(s), Some(w)) => Some(if is_round(s.2, w.2) { s } else { w }),
            (s, w) => w.or(s),
        };
        chosen.map_or(bare, |(ragged, position, stiffness)| RestMarker {
            position,
            ragged,
            stiffness,
            offset: position - start,
            ..bare
        })
    }

    /// The centre to which a kernel pulls from a spot, and the stiffness there.
    fn settle(&self, imprint: &Imprint, start: Vec2, ragged: bool) -> Option<(Vec2, f64)> {
        let kernel = if ragged { &self.wide } else { &self.sharp };
        let stiffness = |at: Vec2| kernel.stiffness(&imprint.grey, imprint.size(), at).filter(|s| *s != 0.0);
        let rough = stiffness(start)?;
        let centre = self.pulled(kernel, imprint, start, rough)?;
        // Repeated at the centre itself, where the pull is linear.
        let fine = stiffness(centre).filter(|s| s * rough > 0.0)?;
        Some((self.pulled(kernel, imprint, centre, fine).unwrap_or(centre), fine))
    }

    /// Whether a marker at `centre` is entirely in the camera's view, on undamaged skin.
    fn whole(&self, imprint: &Imprint, centre: Vec2) -> bool {
        self.sharp.holds(imprint.size(), centre) && imprint.seen().is_none_or(|seen| self.is_within(seen, centre))
    }

    /// Whether the camera sees all of a marker at `centre`.
    pub(super) fn in_view(&self, imprint: &Imprint, centre: Vec2) -> bool {
        imprint.view().is_none_or(|view| {
            imprint.is_in_inner_rectangle(centre, self.radius_px + 2.0) || self.is_within(view, centre)
        })
    }

    fn is_within(&self, mask: &Mask, centre: Vec2) -> bool {
        self.rim.iter().all(|&by| mask.get(nearest_px(centre.x + by.x), nearest_px(centre.y + by.y)))
    }
}
