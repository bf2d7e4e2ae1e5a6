//! Step 2: imprint -> marker positions, matched to the markers at rest; displacement.
//!
//! ```text
//!   grey --spots--> places that look like a marker --match--> markers of the rest frame --edge pull--> sub-pixel
//!                                                    |
//!                        predicted by its own motion, then by its neighbours'; lost markers move with them
//!   fabric skins: spot, or motion of the neighbours --template from rest--> the dot, not a gap of the weave
//! ```

mod anchor;
mod detect;
mod follow;
mod matching;
mod median;
mod plane_fit;
mod settings;
mod spot_index;
mod templates;
mod threshold;
mod view;

pub(super) use detect::{Detector, RestMarker};
pub use settings::{Finder, MarkerSettings};
pub(super) use threshold::THRESHOLD_REACH_PITCH;

use crate::image::{Mask, SizePx};
use crate::monitor::imprint::Imprint;
use crate::monitor::report::Marker;
use crate::monitor::rest::Rest;
use crate::pixels::dots::Spot;
use crate::pixels::template::Fit;
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};
use anchor::Anchor;
use detect::core_levels;
use matching::Matching;
use templates::{MarkerTemplates, TemplateMatch};

/// After this many untrusted frames in a row, markers are also searched for at their last trusted and rest positions.
const UNTRUSTED_FRAMES_COUNT: u32 = 5;
/// A marker that moves farther than this in a frame, pitches, does not stand still: as far as its displacement shows a
/// contact (`contact.displaced_pitch`). And the number of markers that may do so by mistake.
const STILL_PITCH: f64 = 0.03;
const MISMATCHED_COUNT: usize = 2;
/// The same at once when the misfit exceeds this share of the squared reach (1: no spot near any position).
const LOST_MISFIT: f64 = 0.6;

/// Share of the markers in view that are missing at once in a damaged image, and for how many frames they are waited for.
/// In the recordings of two real fingers at most 21 % of 33 markers are lost from one frame to the next.
const MISSING_AT_ONCE_FRACTION: f64 = 0.3;
const MISSING_FRAMES_COUNT: u32 = 2;

/// State of a marker that [`Marker`] does not show.
#[derive(Debug, Clone, Copy)]
struct Track {
    rest: RestMarker,
    /// Position in the last trusted frame, px.
    trusted: Vec2,
    /// Displacement between the last two frames, px; zero unless it was found in both.
    step: Vec2,
    /// Contrast at the last search, and the summed grey levels of its core when it was last found whole.
    response_levels: f32,
    core_levels: i32,
}

impl Track {
    fn at_rest(rest: RestMarker, grey: &[u8], size: SizePx) -> Self {
        Track {
            rest,
            trusted: rest.position,
            step: Vec2::ZERO,
            response_levels: rest.response_levels,
            core_levels: core_levels(grey, size, rest.position).unwrap_or(0),
        }
    }
}

/// Step 2, with its state and scratch buffers.
#[derive(Debug, Clone)]
pub(super) struct Markers {
    settings: MarkerSettings,
    detector: Detector,
    matching: Matching,
    /// For a fabric skin only: gaps of its weave look like dots.
    templates: Option<MarkerTemplates>,
    before: Vec<Vec2>,
    /// Positions of the followed markers.
    followed: Vec<Vec2>,
    /// The markers of the previous frame, for a repeated image.
    kept: Vec<Marker>,
    anchor: Anchor,
    /// Whether the identity of the markers is known: not after missed frames, until [`Anchor`] recovers it.
    pub(super) anchored: bool,
    tracks: Vec<Track>,
    pitch_px: f64,
    /// Untrusted frames in a row.
    untrusted_frames_count: u32,
    /// Markers in view that were not found in the last frame that was judged; frames since then with many more.
    missing_before_count: u32,
    missing_frames_count: u32,
    pub(super) all: Vec<Marker>,
    pub(super) detected_count: u32,
    pub(super) matched_count: u32,
}

impl Markers {
    pub(super) fn new(sensor: &Sensor, settings: &MarkerSettings, rest: &Rest, view: Option<&Mask>) -> Self {
        let at_rest = &rest.markers;
        let mut detector = Detector::new(sensor, settings);
        detector.learn(&rest.flat);
        let all: Vec<Marker> =
            at_rest.iter().enumerate().map(|(id, m)| Marker::at_rest(id as u32, m.position)).collect();
        // Deviation: D17 looks
        let has_templates = sensor.skin == Skin::Fabric && settings.finder == Finder::Edges && settings.ask_neighbours;
        Markers {
            settings: settings.clone(),
            detector,
            matching: Matching::new(sensor, &all, view),
            templates: has_templates.then(|| MarkerTemplates::new(sensor, &rest.grey, at_rest)),
            before: vec![Vec2::ZERO; all.len()],
            followed: vec![Vec2::ZERO; all.len()],
            kept: all.clone(),
            anchor: Anchor::new(all.len()),
            anchored: true,
            tracks: at_rest.iter().map(|&marker| Track::at_rest(marker, &rest.grey, sensor.rectified_px())).collect(),
            pitch_px: sensor.pitch_px,
            untrusted_frames_count: 0,
            missing_before_count: 0,
            missing_frames_count: 0,
            detected_count: 0,
            matched_count: all.len() as u32,
            all,
        }
    }

    /// Frames were missed: any marker may be where another was.
    pub(super) fn lose_anchor(&mut self) {
        // The paper's matching has no such recovery.
        self.anchored &= !self.settings.ask_neighbours;
    }

    /// Finds every marker in a frame. `touched`: whether anything presses on the finger; `search`: whether to search
    /// the whole image for spots.
    pub(super) fn track(&mut self, imprint: &Imprint, touched: bool, search: bool) {
        let weakest = self.tracks.iter().map(|t| t.rest.response_levels).fold(f32::MAX, f32::min);
        let keep = self.settings.keep_contrast_fraction as f32;
        if !search && self.follow(imprint, touched) {
            return;
        }
        let spots = self.detector.spots(imprint, f64::from(keep * weakest));
        let m = &mut self.matching;
        m.take_spots(spots);
        m.least_response(self.tracks.iter().map(|t| keep * t.rest.response_levels));

        // Deviation: D6 prediction and neighbours
        if self.anchored {
            self.predict();
        } else {
            self.find_anchor(touched);
        }
        let m = &mut self.matching;
        m.assign(self.settings.match_within_pitch);
        if self.settings.ask_neighbours {
            m.settle_with_neighbours(&self.all);
            m.repair_field(&self.all, self.tracks.iter().map(|t| t.trusted));
            self.untrusted_frames_count = if m.trustworthy() { 0 } else { self.untrusted_frames_count + 1 };
        }
        self.place(imprint, touched);
    }

    /// Predicts where to look for each marker after missed frames.
    fn find_anchor(&mut self, touched: bool) {
        let m = &mut self.matching;
        if !touched {
            // An untouched finger is at rest.
            m.predict(self.all.iter().map(|m| m.rest));
            self.anchored = true;
            return;
        }
        let before = self.tracks.iter().map(|t| t.trusted);
        let motion = self.anchor.find(m, &self.all, before.clone(), self.pitch_px);
        self.anchored = motion.is_some();
        m.predict(before.map(|place| place + motion.unwrap_or(Vec2::ZERO)));
    }

    /// Predicts where to look for each marker.
    fn predict(&mut self) {
        let m = &mut self.matching;
        // All markers continue their motion, or all stand still: whichever explains the spots better.
        let still = self.all.iter().map(|m| m.now);
        let moving = self.all.iter().zip(&self.tracks).map(|(m, t)| m.now + t.step);
        let (reach, reach_px) = (self.settings.match_within_pitch, self.settings.match_within_pitch * self.pitch_px);
        let (still_misfit, moving_misfit) = (m.misfit(still.clone(), reach), m.misfit(moving.clone(), reach));
        let mut misfit = still_misfit;
        if self.settings.predict && moving_misfit <= still_misfit {
            misfit = moving_misfit;
            m.predict(moving);
        } else {
            m.predict(still);
        }
        // After many untrusted frames, or when hardly any marker is found, they may also be at their last trusted
        // positions or at rest. Not sooner: on a regular grid, a motion of one pitch looks like none.
        let lost = self.untrusted_frames_count >= UNTRUSTED_FRAMES_COUNT || misfit > LOST_MISFIT * reach_px * reach_px;
        if self.settings.ask_neighbours && lost {
            let before = self.tracks.iter().map(|t| t.trusted);
            let rest = self.all.iter().map(|m| m.rest);
            let (before_misfit, rest_misfit) = (m.misfit(before.clone(), reach), m.misfit(rest.clone(), reach));
            if before_misfit < misfit && before_misfit <= rest_misfit {
                m.predict(before);
            } else if rest_misfit < misfit {
                m.predict(rest);
            }
        }
    }

    /// Tracks in a repeated image: markers that were found keep their positions, whatever the state of the search (so
    /// [`Hand`](crate::hand::Hand) detects a frozen image); lost markers are searched for.
    pub(super) fn track_again(&mut self, imprint: &Imprint, touched: bool) {
        let known = self.anchored && self.untrusted_frames_count == 0;
        self.kept.clone_from_slice(&self.all);
        self.track(imprint, touched, true);
        for (marker, kept) in self.all.iter_mut().zip(&self.kept).filter(|(_, kept)| known && kept.matched) {
            self.matched_count += u32::from(!marker.matched);
            (marker.now, marker.matched, marker.whole) = (kept.now, kept.matched, kept.whole);
        }
    }

    /// Whether too few markers are found to judge the frame: less than half of those in view, or less than a quarter of
    /// all; for two frames in a row also when many are missing at once, as where a part of the image did not arrive.
    /// Markers that the gel carried out of view are not missing.
    pub(super) fn too_few(&mut self) -> bool {
        let missing_count = self.all.iter().filter(|m| !m.matched && self.matching.in_view(m.now)).count() as u32;
        if self.matched_count < missing_count || 4 * self.matched_count < self.all.len() as u32 {
            return true;
        }
        let newly_count = missing_count.saturating_sub(self.missing_before_count);
        let in_view_count = self.matched_count + missing_count;
        let at_once = f64::from(newly_count) > MISSING_AT_ONCE_FRACTION * f64::from(in_view_count);
        // The paper's matching does not look back.
        if at_once && self.settings.ask_neighbours && self.missing_frames_count < MISSING_FRAMES_COUNT {
            self.missing_frames_count += 1;
            return true;
        }
        (self.missing_before_count, self.missing_frames_count) = (missing_count, 0);
        false
    }

    /// Whether every marker in view was found whole.
    pub(super) fn complete(&self) -> bool {
        self.all.iter().all(|m| m.whole || !self.matching.in_view(m.now))
    }

    /// Whether the gel stands still: at most a few markers, perhaps mismatched ones, moved in the last frame.
    pub(super) fn stand_still(&self) -> bool {
        let moved = self.tracks.iter().filter(|track| track.step.length() > STILL_PITCH * self.pitch_px);
        moved.count() <= MISMATCHED_COUNT
    }

    /// Stores the position where each marker was found or is expected.
    fn place(&mut self, imprint: &Imprint, touched: bool) {
        (self.matched_count, self.detected_count) = (0, 0);
        self.before.iter_mut().zip(&self.all).for_each(|(b, m)| *b = m.now);
        for i in 0..self.all.len() {
            let (before, known_before) = (self.all[i].now, self.all[i].matched);
            let spot = self.matching.spot_of(i).copied();
            self.detected_count += u32::from(spot.is_some());
            // A marker whose match was undone and whose neighbours are lost has no expected position: it stays.
            let expected = Some(self.matching.expected(i)).filter(|p| p.is_finite()).unwrap_or(before);
            // A lost marker may have drifted: its position follows from its neighbours' displacement, not from their
            // last step.
            let inferred = || match known_before {
                true => self.matching.step_of_neighbours(&self.before, i).map(|step| before + step),
                false => Some(expected),
            };
            let (template_match, inferred) = match &mut self.templates {
                None => (TemplateMatch::NotChecked, None),
                Some(templates) => {
                    let inferred = inferred();
                    let at = spot.map(|s| s.position);
                    if touched && templates.is_plain(i, at, inferred) && is_away(&self.matching, &self.all, i) {
                        (TemplateMatch::NotChecked, inferred)
                    } else {
                        let stretch = self.matching.stretch(&self.all, &self.before, i);
                        (templates.find(imprint, i, at, inferred, stretch), inferred)
                    }
                }
            };
            let whole = match template_match {
                TemplateMatch::Found(fit) if self.detector.in_view(imprint, fit.place) => {
                    Some(self.settle(imprint, i, &fit, spot.as_ref()))
                }
                TemplateMatch::Found(_) | TemplateMatch::Rejected => None,
                TemplateMatch::NotChecked => {
                    spot.and_then(|spot| self.detector.refine(imprint, &spot, &self.tracks[i].rest))
                }
            };
            let cut = || if template_match == TemplateMatch::Rejected { None } else { self.matching.cut(&self.all, i) };
            let found = whole.or_else(cut);
            let expected = inferred.filter(|_| template_match == TemplateMatch::Rejected).unwrap_or(expected);
            let marker = &mut self.all[i];
            marker.matched = found.is_some();
            marker.whole = whole.is_some();
            marker.now = found.unwrap_or(expected);
            self.matched_count += u32::from(marker.matched);
            let track = &mut self.tracks[i];
            if self.untrusted_frames_count == 0 && self.anchored {
                track.trusted = marker.now;
            }
            if marker.whole {
                track.response_levels = spot.map_or(track.response_levels, |spot| spot.response_levels);
                track.core_levels = core_levels(&imprint.grey, imprint.size(), marker.now).unwrap_or(track.core_levels);
            }
            track.step = if marker.matched && known_before { marker.now - before } else { Vec2::ZERO };
        }
    }

    /// Position of marker `i` from its template fit and its spot, if there is one. Fit and position are taken to be as
    /// far apart as last time.
    fn settle(&mut self, imprint: &Imprint, i: usize, fit: &Fit, spot: Option<&Spot>) -> Vec2 {
        let Some(templates) = &mut self.templates else { return fit.place };
        let place = self.detector.blend(imprint, fit, spot, fit.place - templates.fit_offset(i), &self.tracks[i].rest);
        templates.store_fit_offset(i, fit, place);
        place
    }
}

/// Whether a marker and its neighbours were out of contact in the previous frame.
fn is_away(matching: &Matching, markers: &[Marker], i: usize) -> bool {
    !matching.with_neighbours(i).any(|n| markers[n].in_contact)
}
