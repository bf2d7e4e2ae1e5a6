//! Step 5: evidence of sliding, as continuous values, independent of the verdict of the slip field, causal and
//! dimensionless.
//!
//! ```text
//!   displacement since the reference --> relaxation, centre over rim
//!   imprint, the gel's motion undone --> change against the reference, motion over the gel
//!                                                \__ equally weighted: slide score, over 1 where the object slides
//! ```
//!
//! The reference is the frame with which the evidence begins: the rest frame of a recording that starts in contact,
//! else the frame in which a contact has settled. It is not renewed after a slip; it ends with the contact.

mod field;
mod gel;
mod image_cells;
mod pattern;
mod planes;
mod recent;
mod slide;
mod sliding;

use crate::image::Frame;
use crate::monitor::contact::Contact;
use crate::monitor::imprint::Imprint;
use crate::monitor::motion::fit_rigid;
use crate::monitor::report::{EvidenceReport, Marker};
use crate::monitor::rest::{Rest, RestKind};
use crate::monitor::schedule::Due;
use crate::plane::Vec2;
use crate::sensor::{Sensor, Skin};
use crate::setting::{SettingError, within};
use field::Field;
use gel::GelMotion;
use pattern::Pattern;
use planes::Planes;
use recent::RecentMotion;
#[cfg(test)]
pub(super) use recent::WindowMotion;
pub(super) use recent::{Recent, WINDOWS_S};
use serde::{Deserialize, Serialize};
use slide::Slide;
use sliding::{SlidingSettings, SlidingWatch};

/// Fewest markers in contact from which the motion of the gel there is fitted.
const CONTACT_MARKERS_COUNT: usize = 3;

/// Scale of one value of the evidence in the slide score: its value where an object sticks and where it slides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvidenceScale {
    /// Its median over held objects.
    pub held: f64,
    /// Its median over objects that slid.
    pub slid: f64,
}

impl EvidenceScale {
    /// 0 where objects are held, 1 where they slide, clamped: no value alone decides.
    fn share(self, value: f64) -> f64 {
        let span = self.slid - self.held;
        if span == 0.0 { 0.0 } else { ((value - self.held) / span).clamp(0.0, 1.0) }
    }
}

/// Settings of the evidence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct EvidenceSettings {
    /// Whether the evidence is computed. Off in [`Settings::paper`](super::Settings::paper).
    pub used: bool,
    /// Scale of the relaxation.
    pub relaxation: EvidenceScale,
    /// Scale of the displacement at the centre over that at the rim.
    pub centre_rim_ratio: EvidenceScale,
    /// Scale of the change of the imprint.
    pub imprint_change: EvidenceScale,
    /// A contact has settled, and the evidence begins, when its area has grown by less than this share of itself over
    /// [`EvidenceSettings::settle_frames_count`] frames.
    pub settle_fraction: f64,
    /// Number of those frames. Only frames with a new contact region count, one in 25 ms of a fast camera.
    pub settle_frames_count: u32,
    /// The object slides as a whole (`gross`) when its imprint has moved this far over the gel, in pitches (twice as
    /// far on a fabric skin, whose patch of pressed weave is located half as precisely), ...
    pub slide_pitch: f64,
    /// ... while the gel in contact moved along by at most this share of it, ...
    pub carried_fraction: f64,
    /// ... and is sheared at least this far in the direction of the slide, in pitches.
    pub sheared_pitch: f64,
    /// An imprint that changes by this much from one frame to the next while the gel stands still slides, too.
    pub jump_change_fraction: f64,
    /// Least time between two evaluations of the evidence of a settled contact, ms; in between, the last one is
    /// reported with its age. Zero: every frame.
    pub period_ms: f64,
}

impl Default for EvidenceSettings {
    fn default() -> Self {
        EvidenceSettings {
            used: true,
            // Medians over the 20 held and the 14 slipped clips of the lift recordings: bench/real/README.md.
            relaxation: EvidenceScale { held: 0.029, slid: 0.553 },
            centre_rim_ratio: EvidenceScale { held: 1.855, slid: 2.761 },
            imprint_change: EvidenceScale { held: 0.107, slid: 0.521 },
            settle_fraction: 0.05,
            settle_frames_count: 3,
            slide_pitch: 0.13,
            carried_fraction: 0.25,
            sheared_pitch: 0.12,
            jump_change_fraction: 0.5,
            period_ms: 25.0,
        }
    }
}

impl EvidenceSettings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        for (key, scale) in [
            ("evidence.relaxation", self.relaxation),
            ("evidence.centre_rim_ratio", self.centre_rim_ratio),
            ("evidence.imprint_change", self.imprint_change),
        ] {
            within(&format!("{key}.held"), scale.held, 0.0, 100.0)?;
            if !(1e-6..=100.0).contains(&(scale.slid - scale.held)) {
                let (key, got) = (format!("{key}.slid"), scale.slid.to_string());
                let expected = format!("a number above held, {}, by at most 100", scale.held);
                return Err(SettingError { key, got, expected });
            }
        }
        within("evidence.settle_fraction", self.settle_fraction, 0.0, 10.0)?;
        within("evidence.settle_frames_count", f64::from(self.settle_frames_count), 1.0, 64.0)?;
        within("evidence.slide_pitch", self.slide_pitch, 0.01, 10.0)?;
        within("evidence.carried_fraction", self.carried_fraction, 0.0, 1.0)?;
        within("evidence.sheared_pitch", self.sheared_pitch, 0.0, 10.0)?;
        within("evidence.jump_change_fraction", self.jump_change_fraction, 0.05, 2.0)?;
        within("evidence.period_ms", self.period_ms, 0.0, 1000.0)
    }

    /// The slide score of three values: twice their mean share of the way from held to slid. An unknown value counts as
    /// held.
    pub fn slide_score(&self, relaxation: f64, centre_rim_ratio: Option<f64>, imprint_change: Option<f64>) -> f64 {
        let shares = self.relaxation.share(relaxation)
            + centre_rim_ratio.map_or(0.0, |ratio| self.centre_rim_ratio.share(ratio))
            + imprint_change.map_or(0.0, |change| self.imprint_change.share(change));
        2.0 * shares / 3.0
    }
}

/// The largest values since the reference.
#[derive(Debug, Clone, Copy, Default)]
struct Greatest {
    relaxation: f64,
    centre_rim_ratio: Option<f64>,
    imprint_change: Option<f64>,
}

/// The evidence, with its memory and scratch.
#[derive(Debug, Clone)]
pub(super) struct Evidence {
    settings: EvidenceSettings,
    pitch_px: f64,
    pitch_mm: Option<f64>,
    gel: GelMotion,
    pattern: Pattern,
    /// The pattern of the previous frame.
    before: Planes,
    slide: Slide,
    sliding: SlidingWatch,
    recent_motion: RecentMotion,
    field: Field,
    reference_seq: u64,
    reference_px: Vec<Vec2>,
    reference_pattern: Planes,
    /// Whether something touches and the reference is known.
    begun: bool,
    /// Whether the reference is the rest frame itself, taken in contact: until that contact has been seen and lost.
    starts_in_contact: bool,
    /// Whether a contact has been seen.
    has_touched: bool,
    area_px2: f64,
    settled_frames_count: u32,
    greatest: Greatest,
    pub(super) report: Option<EvidenceReport>,
    /// Recent motion of imprint and gel; None without a report, and where too few markers are in contact.
    pub(super) recent: Option<Recent>,
}

impl Evidence {
    pub(super) fn new(sensor: &Sensor, settings: &EvidenceSettings, imprint: &Imprint, rest: &Rest) -> Self {
        let rest_px: Vec<Vec2> = rest.markers.iter().map(|m| m.position).collect();
        let gel = GelMotion::new(&rest_px, sensor.rectified_px(), sensor.pitch_px);
        let pattern = Pattern::new(sensor, &rest_px, imprint.seen(), &gel);
        Evidence {
            settings: *settings,
            pitch_px: sensor.pitch_px,
            pitch_mm: sensor.pitch_mm,
            sliding: SlidingWatch::new(SlidingSettings {
                least_px: settings.slide_pitch * sensor.pitch_px * if sensor.skin == Skin::Fabric { 2.0 } else { 1.0 },
                along_fraction: settings.carried_fraction,
                sheared_px: settings.sheared_pitch * sensor.pitch_px,
                jump_change: settings.jump_change_fraction,
            }),
            recent_motion: RecentMotion::new(sensor.pitch_px),
            before: pattern.now.clone(),
            gel,
            slide: Slide::new(&pattern, sensor.pitch_px),
            field: Field::new(rest_px.len()),
            reference_seq: rest.seq,
            reference_pattern: pattern.now.clone(),
            reference_px: rest_px,
            begun: false,
            starts_in_contact: rest.kind == RestKind::InContact,
            has_touched: false,
            area_px2: 0.0,
            settled_frames_count: 0,
            greatest: Greatest::default(),
            pattern,
            report: None,
            recent: None,
        }
    }

    /// Whether the object has been held since the rest frame.
    pub(super) fn starts_in_contact(&self) -> bool {
        self.starts_in_contact
    }

    /// Adds a frame whose markers are known. `due`: whether the contact region is new, and whether the evidence is
    /// evaluated.
    pub(super) fn take(
        &mut self,
        frame: &Frame<'_>,
        imprint: &Imprint,
        contact: &Contact,
        markers: &[Marker],
        due: Due,
    ) {
        let area_px2 = contact.state.area_px2 as f64;
        self.has_touched |= area_px2 > 0.0;
        self.starts_in_contact &= contact.state.touches || contact.state.held_unseen || !self.has_touched;
        let touched = area_px2 > 0.0 || self.starts_in_contact;
        if touched && !due.evidence && self.report.is_some() {
            self.go_on(markers);
            return;
        }
        (self.report, self.recent) = (None, None);
        if !self.settings.used {
            return;
        }
        if !touched {
            (self.begun, self.settled_frames_count, self.area_px2) = (false, 0, 0.0);
            self.pattern.learn_rest(imprint);
            return;
        }
        self.gel.take(markers);
        std::mem::swap(&mut self.before, &mut self.pattern.now);
        self.pattern.take(imprint, &self.gel);
        if !self.begun && self.settles(area_px2, due.contact) {
            self.restart(frame.seq, markers);
        }
        if self.begun {
            self.evaluate(frame, markers);
        }
    }

    /// Evaluates the displacement of the markers; returns the slide score, with the largest change of the imprint.
    fn evaluate_field(&mut self, markers: &[Marker], imprint_change: Option<f64>) -> f64 {
        self.field.take(&self.reference_px, markers, self.pitch_px);
        let most = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::max);
        self.greatest = Greatest {
            relaxation: self.greatest.relaxation.max(self.field.relaxation),
            centre_rim_ratio: most(self.greatest.centre_rim_ratio, self.field.centre_rim_ratio),
            imprint_change: most(self.greatest.imprint_change, imprint_change),
        };
        let Greatest { relaxation, centre_rim_ratio, imprint_change } = self.greatest;
        self.settings.slide_score(relaxation, centre_rim_ratio, imprint_change)
    }

    /// A frame whose imprint is not evaluated: the last values of the imprint are reported, one frame older.
    fn go_on(&mut self, markers: &[Marker]) {
        let slide_score = self.evaluate_field(markers, None);
        let Some(report) = &mut self.report else { return };
        (report.relaxation, report.centre_rim_ratio) = (self.field.relaxation, self.field.centre_rim_ratio);
        (report.slide_score, report.imprint_age_frames) = (slide_score, report.imprint_age_frames + 1);
    }

    /// The evidence of a frame that has a reference.
    fn evaluate(&mut self, frame: &Frame<'_>, markers: &[Marker]) {
        let imprint_change = self.pattern.now.change(&self.reference_pattern);
        let slide_score = self.evaluate_field(markers, imprint_change);
        self.slide.take(&self.pattern);
        let sliding = self.gel_in_contact(markers).and_then(|(shift_px, turn_rad)| {
            let slide = &self.slide;
            let three = |shift: Vec2, turn_rad: f64| [shift.x, shift.y, turn_rad * slide.arm_px];
            let change = self.pattern.now.change(&self.before).unwrap_or(0.0);
            let over_gel = three(slide.shift_px, slide.turn_rad);
            let of_gel = three(shift_px, turn_rad);
            self.recent = Some(self.recent_motion.take(over_gel, of_gel, frame.time_ns));
            self.sliding.take(over_gel, of_gel, change, frame.time_ns)
        });
        let slide_pitch_per_s = sliding.and_then(|s| s.speed_px_per_s).map(|px| px / self.pitch_px);
        self.report = Some(EvidenceReport {
            reference_seq: self.reference_seq,
            relaxation: self.field.relaxation,
            centre_rim_ratio: self.field.centre_rim_ratio,
            imprint_change,
            imprint_age_frames: 0,
            slide_score,
            slide_px: self.slide.shift_px,
            slide_rad: self.slide.turn_rad,
            slides: sliding.is_some(),
            gross_probability: None, // known after step 7
            slide_pitch_per_s,
            slide_mm_per_s: slide_pitch_per_s.zip(self.pitch_mm).map(|(pitch, mm)| pitch * mm),
        });
    }

    /// Shift in px and turn of the gel in contact since the reference; None with too few markers there.
    fn gel_in_contact(&self, markers: &[Marker]) -> Option<(Vec2, f64)> {
        let seen = markers.iter().zip(&self.reference_px).filter(|(m, _)| m.in_contact && m.whole && m.matched);
        if seen.clone().count() < CONTACT_MARKERS_COUNT {
            return None;
        }
        let motion = fit_rigid(seen.map(|(m, &reference)| (reference, m.now)))?;
        Some((motion.translation, motion.rotation_rad))
    }

    /// Whether the contact has settled. A region kept from an earlier frame gives no information. How the contact of a
    /// recording that starts in contact began is unknown: its first frame counts.
    fn settles(&mut self, area_px2: f64, is_new: bool) -> bool {
        if !is_new {
            return self.starts_in_contact;
        }
        let grown = area_px2 > (1.0 + self.settings.settle_fraction) * self.area_px2;
        self.settled_frames_count = if grown { 0 } else { self.settled_frames_count + 1 };
        if grown {
            self.area_px2 = area_px2;
        }
        self.starts_in_contact || self.settled_frames_count >= self.settings.settle_frames_count
    }

    /// Makes this frame the reference.
    fn restart(&mut self, seq: u64, markers: &[Marker]) {
        self.begun = true;
        self.reference_seq = seq;
        self.reference_px.iter_mut().zip(markers).for_each(|(reference, m)| *reference = m.now);
        self.reference_pattern.copy_from(&self.pattern.now);
        self.field.restart();
        self.slide.restart(&self.pattern);
        self.sliding.restart();
        self.recent_motion.restart();
        self.before.copy_from(&self.pattern.now);
        self.greatest = Greatest::default();
    }
}
