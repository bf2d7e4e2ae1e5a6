//! Step 7: estimates and evidence of a frame -> whether the rule `margin` is in alarm, and whether the object slides as
//! a whole.
//!
//! ```text
//!   margin --below alarm_margin_fraction--> alarm, until it is above clear_margin_fraction
//!   evidence, estimates, load --gross.rs--> slides
//! ```

use super::estimate::Estimator;
use super::evidence::Evidence;
use super::gross::{GrossInput, GrossWatch, LoadSample, SlideFeatures};
use super::settings::Settings;
use super::slip::SlipRule;
use crate::smoothing;

/// The margin from images alone is less reliable: its mean with this time constant, s, must be small, and two frames in a
/// row. By frames alone, slow loads and fast cameras would give the errors of single frames more chances.
const ALONE_MEAN_S: f64 = 0.08;
const ALONE_FRAMES_COUNT: u32 = 2;
/// Largest time step of that mean, s, for a frame after a gap.
const ALONE_STEP_S: f64 = 0.1;

/// Step 7, with its memory of the contact.
#[derive(Debug, Clone)]
pub(super) struct Verdict {
    /// Under the rule `margin`: where the alarm begins and ends.
    alarm_and_clear_margin: Option<(f64, f64)>,
    uses_evidence: bool,
    small_margin_frames_count: u32,
    /// Mean of the margin, and the time of its last value, s.
    mean_margin: f64,
    mean_at_s: Option<f64>,
    gross: GrossWatch,
    /// Whether the rule `margin` is in alarm.
    pub alarmed: bool,
    /// Whether the object slides as a whole.
    pub slides: bool,
}

impl Verdict {
    pub fn new(settings: &Settings) -> Self {
        let slip = &settings.slip;
        let margins = (slip.alarm_margin_fraction, slip.clear_margin_fraction);
        Verdict {
            alarm_and_clear_margin: (slip.rule == SlipRule::Margin).then_some(margins),
            uses_evidence: settings.evidence.used,
            small_margin_frames_count: 0,
            mean_margin: 1.0,
            mean_at_s: None,
            gross: GrossWatch::new(),
            alarmed: false,
            slides: false,
        }
    }

    /// Input of the verdict on gross slip; None where too little is known.
    pub fn slide_features(&self) -> Option<&SlideFeatures> {
        self.gross.features.as_ref()
    }

    /// Probability of gross slip in the last frame; None where it was not computed.
    pub fn gross_probability(&self) -> Option<f64> {
        self.gross.probability
    }

    /// A frame in contact, after the estimator has seen it. `repeats`: its image is that of the frame before, which is no
    /// second frame that agrees.
    pub fn see(&mut self, estimator: &mut Estimator, evidence: &Evidence, held_from_start: bool, repeats: bool) {
        let (at_s, load, grip_n) = estimator.load_now();
        let loaded = LoadSample { at_s, load, grip_n: grip_n.unwrap_or(0.0) };
        let input = GrossInput {
            evidence: evidence.report.as_ref(),
            recent: evidence.recent.as_ref(),
            loaded: estimator.features.as_ref().map(|features| (features, loaded)),
            at_s,
            held_from_start,
            repeats,
        };
        let moves = self.uses_evidence && self.gross.see(&estimator.estimates, estimator.knows_grip(), &input);
        estimator.set_slides(moves);
        self.slides = self.uses_evidence && self.gross.slides();
        self.watch_margin(estimator, repeats);
    }

    /// A frame without a contact region. `may_be_held`: whether an object that makes none has been held since the rest
    /// frame; it may slide.
    pub fn see_no_region(
        &mut self,
        time_ns: Option<u64>,
        may_be_held: bool,
        estimator: &mut Estimator,
        evidence: &Evidence,
    ) {
        (self.alarmed, self.small_margin_frames_count) = (false, 0);
        (self.mean_margin, self.mean_at_s) = (1.0, None);
        if !may_be_held {
            estimator.clear();
            self.gross.clear();
            self.slides = false;
            return;
        }
        estimator.skip(time_ns);
        let (at_s, ..) = estimator.load_now();
        let (evidence, recent) = (evidence.report.as_ref(), evidence.recent.as_ref());
        let input = GrossInput { evidence, recent, loaded: None, at_s, held_from_start: true, repeats: false };
        self.gross.see(&estimator.estimates, false, &input);
        self.slides = self.uses_evidence && self.gross.slides();
    }

    /// An unknown margin does not end an alarm.
    fn watch_margin(&mut self, estimator: &Estimator, repeats: bool) {
        let Some(((alarm, clear), margin)) = self.alarm_and_clear_margin.zip(estimator.estimates.margin) else {
            return;
        };
        if !repeats {
            let (at_s, ..) = estimator.load_now();
            let elapsed_s = self.mean_at_s.replace(at_s).map_or(ALONE_STEP_S, |before_s| at_s - before_s);
            let share = smoothing::weight(elapsed_s.min(ALONE_STEP_S), ALONE_MEAN_S);
            self.mean_margin += share * (margin.value - self.mean_margin);
        }
        let most = if self.alarmed { clear } else { alarm };
        let small = margin.value <= most;
        self.small_margin_frames_count = if small { self.small_margin_frames_count + u32::from(!repeats) } else { 0 };
        self.alarmed = match estimator.knows_grip() {
            true => small && (self.alarmed || self.small_margin_frames_count >= 1),
            false if self.alarmed => self.mean_margin <= most,
            false => !repeats && self.mean_margin <= most && self.small_margin_frames_count >= ALONE_FRAMES_COUNT,
        };
    }
}
