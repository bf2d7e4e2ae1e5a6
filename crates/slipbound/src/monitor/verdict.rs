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

/// The margin from images alone is less reliable: two frames must agree, and all within this time, s. By a number of
/// frames alone, slow loads and fast cameras would give errors of single frames more chances.
const ALONE_AGREE_S: f64 = 0.1;

/// Step 7, with its memory of the contact.
#[derive(Debug, Clone)]
pub(super) struct Verdict {
    /// Under the rule `margin`: where the alarm begins and ends.
    alarm_and_clear_margin: Option<(f64, f64)>,
    uses_evidence: bool,
    /// Frames in a row with a small margin, and the time of the first, s.
    small_margin_frames_count: u32,
    small_margin_since_s: f64,
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
            small_margin_since_s: 0.0,
            gross: GrossWatch::new(),
            alarmed: false,
            slides: false,
        }
    }

    /// Input of the verdict on gross slip; None where too little is known.
    pub fn slide_features(&self) -> Option<&SlideFeatures> {
        self.gross.features.as_ref()
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
        let small = margin.value <= if self.alarmed { clear } else { alarm };
        let (at_s, ..) = estimator.load_now();
        if self.small_margin_frames_count == 0 {
            self.small_margin_since_s = at_s;
        }
        self.small_margin_frames_count = if small { self.small_margin_frames_count + u32::from(!repeats) } else { 0 };
        let agree = self.small_margin_frames_count >= 2 && at_s - self.small_margin_since_s >= ALONE_AGREE_S - 1e-9;
        let sure = estimator.knows_grip() && self.small_margin_frames_count >= 1 || agree;
        self.alarmed = small && (self.alarmed || sure);
    }
}
