//! The slip monitor: the steps of the method in their order, one frame at a time. Steps 1 to 4 are those of the paper.

mod cell_map;
mod contact;
mod estimate;
mod evidence;
mod frame_period;
mod gap;
mod gross;
mod imprint;
mod markers;
mod motion;
mod reason_text;
mod report;
mod rest;
mod rest_builder;
mod schedule;
mod settings;
mod slip;
mod trees;
mod verdict;

pub use contact::ContactSettings;
pub use estimate::{EstimateTrees, FEATURE_NAMES, FEATURES_COUNT, Features, GEOMETRIC_COUNT};
pub use evidence::{EvidenceScale, EvidenceSettings};
pub use gross::{SLIDE_FEATURES_COUNT, SlideFeatures};
pub use imprint::{Illumination, ImprintSettings};
pub use markers::{Finder, MarkerSettings};
pub use motion::{Fit, MotionSettings, fit_most, fit_rigid, fit_similarity};
pub use report::*;
pub use rest::{Rest, RestError, RestKind, RestSettings};
pub use rest_builder::{RestBuilder, RestChoice, RestLook};
pub use settings::Settings;
pub use slip::{RigidField, SlipRule, SlipSettings};

use crate::image::{Frame, Gray, Mask};
use crate::pixels::morphology::{Element, Morphology};
use crate::port::GripSample;
use crate::sensor::{Sensor, Skin};
use crate::setting::SettingError;
use serde::Serialize;

/// The steps of the method in the order in which they run, for a [`Probe`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Step 0: grey, rectified, flattened.
    Imprint,
    /// Step 1: contact region.
    Contact,
    /// Step 2: marker displacement.
    Markers,
    /// Step 3: rigid motion of the inner region.
    Motion,
    /// Step 4: slip field.
    Slip,
    /// Step 5: evidence of sliding.
    Evidence,
    /// Steps 6 and 7: estimates, and from them and the evidence alarm, gross slip and report.
    Verdict,
}

impl Step {
    /// Its name, as in a record.
    pub const fn name(self) -> &'static str {
        match self {
            Step::Imprint => "imprint",
            Step::Contact => "contact",
            Step::Markers => "markers",
            Step::Motion => "motion",
            Step::Slip => "slip",
            Step::Evidence => "evidence",
            Step::Verdict => "verdict",
        }
    }
}

/// Observes each step of a frame: for timing, debug images and tests.
pub trait Probe {
    /// A frame begins.
    fn begin(&mut self) {}

    /// `step` is complete; the monitor's accessors return its result. A frame that cannot be judged ends with
    /// [`Step::Verdict`] after the last step that it reached.
    fn after(&mut self, step: Step, monitor: &SlipMonitor);
}

impl Probe for () {
    fn after(&mut self, _: Step, _: &SlipMonitor) {}
}

/// Longest time after which an equal image is a duplicate, ns: below the period of the slowest cameras at which the steps
/// run in every frame.
const DUPLICATE_NS: u64 = 25_000_000;

/// Judges the frames of one finger. All memory is allocated by [`SlipMonitor::new`].
#[derive(Debug, Clone)]
pub struct SlipMonitor {
    sensor: Sensor,
    settings: Settings,
    imprint: imprint::Imprint,
    contact: contact::Contact,
    markers: markers::Markers,
    motion: motion::Motion,
    slip: slip::Slip,
    estimator: estimate::Estimator,
    evidence: evidence::Evidence,
    rest_seq: u64,
    refusal: Option<Reason>,
    gap: gap::Gap,
    schedule: schedule::StepSchedule,
    reference_seq: u64,
    rebase_from: Option<u64>,
    /// Time of the last image that is no duplicate, ns.
    new_ns: Option<u64>,
    in_contact_count: u32,
    verdict: verdict::Verdict,
}

impl SlipMonitor {
    /// A monitor for a finger whose rest frame is known. Fails when a setting or a fact of the sensor is invalid, or
    /// when the rest frame is of another finger.
    pub fn new(sensor: &Sensor, settings: &Settings, rest: Rest) -> Result<Self, SettingError> {
        let sensor = sensor.at_size(rest.size)?;
        settings.check_for(&sensor)?;
        sensor.check()?;
        let extra = imprint::Extra { flat: settings.markers.finder_needs_flat(), cells: false };
        let imprint = imprint::Imprint::new(&sensor, &settings.imprint, extra);
        rest.check(&sensor, extra.flat)?;
        let markers = markers::Markers::new(&sensor, &settings.markers, &rest, imprint.view());
        Ok(SlipMonitor {
            contact: contact::Contact::new(&sensor, &settings.contact, &imprint, &rest),
            estimator: estimate::Estimator::new(&sensor, &markers.all, rest.kind == RestKind::InContact),
            markers,
            motion: motion::Motion::new(&sensor, &settings.motion),
            slip: slip::Slip::new(&sensor, &settings.slip, rest.markers.len()),
            evidence: evidence::Evidence::new(&sensor, &settings.evidence, &imprint, &rest),
            rest_seq: rest.seq,
            refusal: rest.refusal,
            gap: gap::Gap::default(),
            schedule: schedule::StepSchedule::new(
                settings.contact.period_ms,
                settings.markers.search_period_ms,
                settings.evidence.period_ms,
            ),
            reference_seq: rest.seq,
            rebase_from: None,
            new_ns: None,
            in_contact_count: 0,
            verdict: verdict::Verdict::new(settings),
            imprint,
            settings: settings.clone(),
            sensor,
        })
    }

    /// From the next frame on, estimates used fraction and stick ratio with `trees` instead of the shipped ones: for
    /// example trees fitted without a held-out object, or to another finger.
    pub fn estimate_by(&mut self, trees: &EstimateTrees) {
        self.estimator.set_trees(trees);
    }

    /// Judges one frame. Never fails: if a frame cannot be judged, the report gives the reason.
    pub fn step(&mut self, frame: &Frame<'_>, grip: Option<GripSample>) -> SlipReport {
        self.step_probed(frame, grip, &mut ())
    }

    /// The same, with a probe.
    pub fn step_probed(&mut self, frame: &Frame<'_>, grip: Option<GripSample>, probe: &mut dyn Probe) -> SlipReport {
        probe.begin();
        if let Some(seq) = self.rebase_from.take() {
            self.rebase(seq);
        }
        let schedule = self.schedule.clone();
        let due = self.schedule.see(frame.time_ns, self.contact.state.touches, self.markers.complete());
        if let Err(reason) = self.imprint.take(frame, due.contact || self.settings.markers.finder_needs_flat()) {
            self.schedule = schedule; // what was due is due in the next frame
            probe.after(Step::Imprint, self);
            let report = self.unjudged(frame.seq, frame.time_ns, grip, reason);
            probe.after(Step::Verdict, self);
            return report;
        }
        if self.gap.see(frame.seq, frame.time_ns) {
            self.markers.lose_anchor();
        }
        probe.after(Step::Imprint, self);

        let duplicate = self.is_duplicate(frame.time_ns);
        if due.contact {
            self.contact.find(&self.imprint, &self.markers.all, frame.time_ns, duplicate);
        }
        probe.after(Step::Contact, self);

        match self.imprint.repeats() {
            false => self.markers.track(&self.imprint, self.contact.state.touches, due.search),
            true => self.markers.track_again(&self.imprint, self.contact.state.touches),
        }
        if self.markers.too_few() && self.refusal.is_none() {
            // Too little of the finger is seen: what was known of the contact stays.
            self.contact.forget_frame(due.contact);
            self.schedule = schedule;
            probe.after(Step::Markers, self);
            let lost = self.unjudged(frame.seq, frame.time_ns, grip, Reason::MarkersLost);
            let report = SlipReport { markers: MarkerCounts { inner: 0, ..self.counts() }, ..lost };
            probe.after(Step::Verdict, self);
            return report;
        }
        self.contact.confirm_frame(due.contact);
        self.in_contact_count = slip::mark_contact(&self.contact.region, &mut self.markers.all);
        probe.after(Step::Markers, self);
        if !self.markers.anchored && self.refusal.is_none() {
            let since_ns = self.gap.since_ns(frame.time_ns);
            let report = self.unjudged(frame.seq, frame.time_ns, grip, Reason::Gap { since_ns });
            probe.after(Step::Verdict, self);
            return report;
        }

        if self.contact.state.touches {
            self.motion.fit(&self.contact.region, &mut self.markers.all);
        } else {
            self.motion.clear();
        }
        probe.after(Step::Motion, self);

        let area_px2 = self.contact.state.area_px2 as f64;
        self.slip.judge(self.motion.motion.as_ref(), &mut self.markers.all);
        probe.after(Step::Slip, self);

        self.evidence.take(frame, &self.imprint, &self.contact, &self.markers.all, due);
        probe.after(Step::Evidence, self);

        self.estimate(frame, grip, area_px2, duplicate);

        let report = self.report(frame, grip);
        let by_markers = self.settings.slip.rule == SlipRule::Markers;
        match report.state {
            // After slip, this frame becomes the reference of the next one.
            SlipState::Incipient if by_markers => self.rebase_from = Some(frame.seq),
            SlipState::NoContact => {
                // Not while an object begins to press, or the gel springs back.
                if self.contact.is_free_for_the_first_time() && self.markers.stand_still() {
                    self.markers.all.iter_mut().filter(|m| m.matched).for_each(|m| m.rest = m.now);
                }
                self.return_to_rest();
            }
            _ => {}
        }
        probe.after(Step::Verdict, self);
        report
    }

    /// Whether an image is the one before once more, because the frames come faster than the camera takes them: it tells
    /// nothing new of the gel. Not so an image that still repeats after [`DUPLICATE_NS`]: without noise, a contact that
    /// stands looks like that.
    fn is_duplicate(&mut self, time_ns: Option<u64>) -> bool {
        let since_ns = self.new_ns.zip(time_ns).and_then(|(then_ns, now_ns)| now_ns.checked_sub(then_ns));
        let duplicate = self.imprint.repeats() && since_ns.is_some_and(|ns| ns < DUPLICATE_NS);
        if !duplicate {
            self.new_ns = time_ns;
        }
        duplicate
    }

    /// Estimates of load and friction, and from them and the evidence whether there is an alarm or gross slip.
    fn estimate(&mut self, frame: &Frame<'_>, grip: Option<GripSample>, area_px2: f64, duplicate: bool) {
        // The scale of the score is that of a smooth gel: a weave shows little of an imprint.
        let held_from_start = self.evidence.starts_in_contact() && self.sensor.skin == Skin::Smooth;
        if !self.contact.state.touches {
            // Until the object has left, or has slid to its end.
            let may_be_held = held_from_start && (self.contact.state.held_unseen || self.verdict.slides);
            self.verdict.see_no_region(frame.time_ns, may_be_held, &mut self.estimator, &self.evidence);
            return;
        }
        let had_reference = self.estimator.has_reference();
        let by_displacement = self.contact.state.by_displacement;
        if by_displacement && !had_reference {
            self.estimator.count_from_rest();
        }
        self.estimator.set_imprint_slides(self.evidence.report.as_ref().is_some_and(|evidence| evidence.slides));
        // The grip may be new.
        if !duplicate || grip.is_some() {
            self.estimator.see(frame.time_ns, grip, area_px2, self.contact.state.middle_px, &self.markers.all);
        }
        self.verdict.see(&mut self.estimator, &self.evidence, held_from_start, self.imprint.repeats());
        let by_margin = self.settings.slip.rule == SlipRule::Margin;
        if by_margin && self.estimator.has_reference() && !had_reference && !by_displacement {
            // The slip field, too, is relative to the squeezed finger.
            self.rebase_from = Some(frame.seq);
        }
        // Deviation: D16 alarm from the estimated margin
        if self.verdict.alarmed || (self.verdict.slides && self.slip.summary.kind.is_none()) {
            let (pull, turn) = self.estimator.pull_and_turn_px3();
            self.slip.set_kind_from_load(pull, turn);
        }
    }

    /// Makes the last frame the new reference, as after a slip or a grip step. `seq`: the number of that frame.
    /// Displacement from rest is not changed.
    pub fn rebase(&mut self, seq: u64) {
        self.rebase_from = None;
        self.reference_seq = seq;
        for m in &mut self.markers.all {
            m.reference = m.now;
            m.in_reference = m.whole;
        }
    }

    /// Forgets the markers of the rest frame, so that nothing of it shows in a report. No frame may be judged after it.
    pub(crate) fn forget_rest(&mut self) {
        self.markers.all.clear();
    }

    /// Why a frame cannot be judged whatever the rest frame: it has another size, or is dark.
    pub(crate) fn check_frame(&mut self, frame: &Frame<'_>) -> Result<(), Reason> {
        self.imprint.take(frame, false)
    }

    /// Reports a frame that did not arrive whole.
    pub fn torn(&self, seq: u64, time_ns: Option<u64>) -> SlipReport {
        self.unjudged(seq, time_ns, None, Reason::Torn)
    }

    /// Every marker of the rest frame after the last frame, in order of `id`.
    pub fn markers(&self) -> &[Marker] {
        &self.markers.all
    }

    /// The contact region of the last frame, rectified; empty without contact.
    pub fn contact_region(&self) -> &Mask {
        &self.contact.region
    }

    /// The element that eroded the contact region of the last frame to the inner one; None without contact. The steps
    /// evaluate the inner region only at the markers; [`SlipMonitor::inner_region`] returns it as a mask.
    pub fn inner_erosion(&self) -> Option<&Element> {
        self.motion.inner_erosion()
    }

    /// The inner region of the last frame; empty without contact. Allocates at each call.
    pub fn inner_region(&self) -> Mask {
        let mut inner = Mask::new(self.contact.region.size());
        if let Some(element) = self.inner_erosion() {
            Morphology::new(inner.size()).erode(&self.contact.region, element, &mut inner);
        }
        inner
    }

    /// The grey rectified image of the last frame.
    pub fn imprint(&self) -> Gray<'_> {
        Gray::new(&self.imprint.grey, self.imprint.size()).expect("the picture has its own size")
    }

    /// Why no frame can be judged; None when frames can be judged. See [`RestSettings::check_spacing`].
    pub fn refusal(&self) -> Option<Reason> {
        self.refusal
    }

    /// Input of the verdict on gross slip in the last frame; None where too little is known.
    pub fn slide_features(&self) -> Option<&SlideFeatures> {
        self.verdict.slide_features()
    }

    /// Features behind the estimates of the last frame, see [`FEATURE_NAMES`]; None without estimates.
    pub fn features(&self) -> Option<&Features> {
        self.estimator.features.as_ref()
    }

    /// The facts of the finger at the size of its frames.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// No contact: displacement is relative to rest again.
    fn return_to_rest(&mut self) {
        self.reference_seq = self.rest_seq;
        for m in &mut self.markers.all {
            m.reference = m.rest;
            m.in_reference = true;
        }
    }

    fn counts(&self) -> MarkerCounts {
        let matched = self.markers.matched_count;
        MarkerCounts {
            detected: self.markers.detected_count,
            matched,
            lost: self.markers.all.len() as u32 - matched,
            inner: self.motion.inner_count,
        }
    }

    fn report(&self, frame: &Frame<'_>, grip: Option<GripSample>) -> SlipReport {
        let mm = self.sensor.mm_per_px();
        let quality = self.contact.quality(self.in_contact_count);
        let unsure = self.contact.unsure(quality) || self.motion.motion.is_none();
        let slips = match self.settings.slip.rule {
            SlipRule::Margin => self.verdict.alarmed,
            SlipRule::Markers => self.slip.slips,
        };
        // Load over grip needs no contact region: slip is reported even if the patch is too small or weak for other
        // steps.
        let sure = slips && self.estimator.knows_grip() && self.settings.slip.rule == SlipRule::Margin;
        let (state, reason) = match () {
            _ if self.refusal.is_some() => (SlipState::Unjudged, self.refusal),
            // Gross slip is reported whatever the contact quality.
            _ if self.verdict.slides => (SlipState::Gross, None),
            _ if !self.contact.state.touches && !self.contact.state.held_unseen => (SlipState::NoContact, None),
            // Deviation: D11 unsure
            _ if unsure && !sure => (SlipState::Unsure, Some(Reason::ContactQuality)),
            _ if slips => (SlipState::Incipient, None),
            _ => (SlipState::Stick, None),
        };
        // A smooth gel shows that an object without a region has left; a weave does not.
        let ends = state == SlipState::NoContact && self.sensor.skin == Skin::Smooth;
        let area_px2 = self.contact.state.area_px2 as f64;
        SlipReport {
            seq: frame.seq,
            time_ns: frame.time_ns,
            state,
            reason,
            contact: ContactReport { area_px2, area_mm2: mm.map(|mm| area_px2 * mm * mm), quality },
            markers: self.counts(),
            reference_seq: self.reference_seq,
            grip_n: grip.map(|g| g.force_n).filter(|n| n.is_finite()),
            motion: self.motion.motion.map(|m| MotionReport {
                reference_px: m.reference,
                translation_px: m.translation,
                translation_mm: mm.map(|mm| m.translation * mm),
                rotation_rad: m.rotation_rad,
                icr_px: m.centre_of_rotation(self.settings.motion.icr_min_rotation_rad),
            }),
            shear: self.shear(),
            slip: self.slip.summary,
            estimates: self.estimator.estimates,
            evidence: self.evidence.report.filter(|_| !ends).map(|evidence| {
                let gross_probability = self.verdict.gross_probability();
                EvidenceReport { gross_probability, ..evidence }
            }),
        }
    }

    /// Shear of the gel since rest.
    fn shear(&self) -> Option<ShearReport> {
        let seen = self.markers.all.iter().filter(|m| m.in_contact && m.whole && m.matched);
        let motion = fit_rigid(seen.map(|m| (m.rest, m.now))).filter(|_| self.contact.state.touches)?;
        Some(ShearReport {
            translation_px: motion.translation,
            translation_mm: self.sensor.mm_per_px().map(|mm| motion.translation * mm),
            rotation_rad: motion.rotation_rad,
        })
    }

    pub(crate) fn unjudged(
        &self,
        seq: u64,
        time_ns: Option<u64>,
        grip: Option<GripSample>,
        reason: Reason,
    ) -> SlipReport {
        let none = self.sensor.mm_per_px().map(|_| 0.0);
        SlipReport {
            seq,
            time_ns,
            state: SlipState::Unjudged,
            reason: Some(reason),
            contact: ContactReport { area_mm2: none, ..ContactReport::default() },
            markers: MarkerCounts { lost: self.markers.all.len() as u32, ..MarkerCounts::default() },
            reference_seq: self.reference_seq,
            grip_n: grip.map(|g| g.force_n).filter(|n| n.is_finite()),
            motion: None,
            shear: None,
            slip: SlipSummary { max_mm: none, ..SlipSummary::default() },
            estimates: Estimates::default(),
            evidence: None,
        }
    }
}
