//! Checks whether a position shows the marker: its template from rest distinguishes the dot from a gap of the weave.
//!
//! ```text
//!   spot of the marker -----------.
//!   last position + median step of >-- each fitted with the marker's own dot and weave --> the better fit, or neither
//!   the neighbours since then ----'
//! ```
//! Where the weave is not pressed, and spot and neighbours agree, the spot is taken as the dot.

use super::detect::{BARE_WEAVE, RestMarker};
use crate::image::SizePx;
use crate::monitor::imprint::Imprint;
use crate::pixels::template::{Fit, Start, Template, Window, darkness};
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Radius of the template of a marker: most of the way to the next dot.
const REACH_PITCH: f64 = 0.35;
/// Two starts this near, in pitches, converge to the same position.
const SAME_PITCH: f64 = 0.12;
/// Largest distance of a fit from its start.
const SEARCH_PITCH: f64 = 0.16;
/// A fit explains at least this share of the variance of its window.
const LEAST_EXPLAINED: f64 = 0.35;
/// And its dot has at least this share of its strength at rest.
const LEAST_DOT: f64 = 0.4;

/// The templates of all markers at rest, and the last fitted strength of their weave.
#[derive(Debug, Clone)]
pub(super) struct MarkerTemplates {
    window: Window,
    templates: Vec<Option<Template>>,
    weave: Vec<f64>,
    /// From the position of each marker to its last fit, px: a fit started there converges at once.
    fit_offsets: Vec<Vec2>,
    pitch_px: f64,
}

/// What was found at the position of a marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TemplateMatch {
    /// The marker, here.
    Found(Fit),
    /// Not the marker.
    Rejected,
    /// Not checked: it has no template, or it is at the border.
    NotChecked,
}

impl MarkerTemplates {
    pub(super) fn new(sensor: &Sensor, grey: &[u8], markers: &[RestMarker]) -> Self {
        let (size, pitch_px) = (sensor.rectified_px(), sensor.pitch_px);
        let window = Window::new(REACH_PITCH * pitch_px, profile(grey, size, markers, sensor.marker_diameter_px));
        let templates = markers.iter().map(|m| window.learn(grey, size, m.position)).collect();
        MarkerTemplates {
            window,
            templates,
            weave: vec![1.0; markers.len()],
            fit_offsets: vec![Vec2::ZERO; markers.len()],
            pitch_px,
        }
    }

    /// Whether the spot of marker `i` is accepted without a template fit: its weave was not pressed at the last fit,
    /// and its neighbours moved the same way. For markers away from the contact.
    pub(super) fn is_plain(&self, i: usize, spot: Option<Vec2>, inferred: Option<Vec2>) -> bool {
        self.weave[i] <= BARE_WEAVE && self.agree(spot, inferred)
    }

    /// Whether two starts converge to the same fit.
    fn agree(&self, spot: Option<Vec2>, inferred: Option<Vec2>) -> bool {
        spot.zip(inferred).is_some_and(|(a, b)| (a - b).length() < SAME_PITCH * self.pitch_px)
    }

    /// From the position of marker `i` to its last fit, px.
    pub(super) fn fit_offset(&self, i: usize) -> Vec2 {
        self.fit_offsets[i]
    }

    /// Stores that marker `i` with this fit was placed at `place`.
    pub(super) fn store_fit_offset(&mut self, i: usize, fit: &Fit, place: Vec2) {
        self.fit_offsets[i] = fit.place - place;
    }

    /// Fits the template of marker `i` at its spot and where its neighbours moved.
    pub(super) fn find(
        &mut self,
        imprint: &Imprint,
        i: usize,
        spot: Option<Vec2>,
        inferred: Option<Vec2>,
        stretch: [Vec2; 2],
    ) -> TemplateMatch {
        let Some(template) = &self.templates[i] else { return TemplateMatch::NotChecked };
        let (weave, size) = (self.weave[i], imprint.size());
        let agree = self.agree(spot, inferred);
        let inferred = inferred.map(|place| place + self.fit_offsets[i]);
        let mut held = false;
        let mut fit = |start: Option<Vec2>| -> Option<Fit> {
            let start = Start { place: start?, weave, stretch };
            held |= self.window.holds_dot(template, size, start.place);
            self.window.find(template, &imprint.grey, size, start, SEARCH_PITCH * self.pitch_px)
        };
        let by_neighbours = fit(inferred.or(spot));
        let by_spot = if agree && by_neighbours.is_some() { None } else { fit(spot) };
        let best = match (by_neighbours, by_spot) {
            (Some(n), Some(s)) => Some(if s.explained > n.explained + 0.1 { s } else { n }),
            (n, s) => n.or(s),
        };
        match best.filter(|f| f.explained >= LEAST_EXPLAINED && f.dot >= LEAST_DOT) {
            Some(fit) => {
                self.weave[i] = fit.weave.clamp(0.0, 12.0);
                TemplateMatch::Found(fit)
            }
            None if held => {
                // Reset: a wrong weave strength must not prevent the marker from being found again.
                (self.weave[i], self.fit_offsets[i]) = (1.0, Vec2::ZERO);
                TemplateMatch::Rejected
            }
            None => TemplateMatch::NotChecked,
        }
    }
}

/// Darkness of the dots of this finger against the distance from their centre, px.
fn profile(grey: &[u8], size: SizePx, markers: &[RestMarker], diameter_px: f64) -> impl Fn(f64) -> f64 {
    let step_px = 0.5;
    let dark = darkness(grey, size, markers.iter().map(|m| m.position), step_px, 0.9 * diameter_px);
    move |away_px: f64| {
        let steps = away_px / step_px;
        let ring = steps as usize;
        let share = steps - ring as f64;
        let at = |ring: usize| dark.get(ring).copied().unwrap_or(0.0);
        at(ring) * (1.0 - share) + at(ring + 1) * share
    }
}
