//! Part of step 7: whether the object slides as a whole, from the recent motion of imprint and gel and from the load.
//!
//! ```text
//!   used, stick, load (step 6) --\
//!   imprint over the gel ---------> boosted trees, fitted to the contact simulator --> gross, until it is unlikely again
//!   gel under it, shape ---------/
//! ```
//!
//! None alone is enough. An imprint creeps over the gel while the middle still sticks, on a soft object more than half
//! as fast as in a slide; used fraction and stick ratio have errors of a tenth; a slide of half a millimetre a second
//! moves an imprint by no more than its noise in a frame. A slender contact turns about a point within itself long
//! before it slides as a whole, so shape and share of rotation count. A load that still grows is still carried.
//!
//! The imprint of a round or soft object shows no rotation, even if the object spins away within a frame. So, where the
//! grip force is known, estimates that all friction is used are gross slip, too; they do not update the friction, unless
//! too little of the imprint is visible to tell its motion. Without estimates the evidence of step 5 decides alone. On a
//! smooth gel, the slide score also counts if the object is held from the first frame, so that the unloaded gel is
//! unknown.

mod friction_limit;
mod growth;
mod score;

use super::estimate::{Features, LOAD, NARROW, TURNING, WIDE};
use super::evidence::{Recent, WINDOWS_S};
use super::report::{Estimates, EvidenceReport};
use super::trees::{Ensemble, parse};
use friction_limit::{CONTINUE_STICK, CONTINUE_USED, FrictionLimit};
use growth::{Growth, RelativeGrowth};
use score::ScoreWatch;
use std::sync::LazyLock;

pub(super) use growth::LoadSample;

/// Number of features outside the windows, and of each window.
const OTHERS_COUNT: usize = 12;
const OF_WINDOW_COUNT: usize = 5;

/// Number of features.
pub const SLIDE_FEATURES_COUNT: usize = OTHERS_COUNT + OF_WINDOW_COUNT * WINDOWS_S.len();

/// Input of the verdict: `used` and `stick` of step 6; shear of the gel (pitches); speed of the imprint over its last
/// 0.13 pitch (pitches/s) and the share of it by which the gel moved along; the values of the evidence (0 where
/// unknown); `turning`, `narrow`, `wide` and `load` of step 6 ([`super::FEATURE_NAMES`]); then, for each of the last
/// 33, 67, 100 and 200 ms, the motion of the imprint over the gel (pitches), the share of it by which the gel moved
/// along, the motion of the gel (pitches), and the relative growth of load and grip force.
pub type SlideFeatures = [f64; SLIDE_FEATURES_COUNT];

/// Probability from which a slide updates the friction, with grip force and from images alone, and down to which it
/// continues. The lowest tried at which less than half a per cent of the trials of held-out objects have false alarms:
/// .95 with the grip force, 7 of 1,775 (in time in 1,193 of 1,403); .98 without it, 8 (983).
const ONSET_PROBABILITY: f64 = 0.95;
const ONSET_PROBABILITY_ALONE: f64 = 0.98;
const CONTINUE_PROBABILITY: f64 = 0.05;

/// Probability from which a slide is reported where the grip force is known; chosen together with the limits of
/// [`FrictionLimit`].
const REPORT_PROBABILITY: f64 = 0.97;

/// Where the grip force is known, no slide begins below this used fraction: the estimate is seldom off by half, and a
/// sudden press moves an imprint over the gel as a slide does. With other trees this limit delayed 5 of 809 slides of
/// the training split by more than two frames.
const LEAST_USED: f64 = 0.5;

/// From images alone, no slide begins where the gel has moved by less than this in the longest window, pitches, unless the
/// imprint slides over it: at standstill the trees see little but noise. A load that takes 8 s moves it by 0.02.
const STANDS_PITCH: f64 = 0.01;

/// Where too little of the imprint is visible: used fraction and stick ratio that alone indicate a slide, and in how
/// many consecutive frames.
const ALL_USED: f64 = 0.95;
const NONE_STICKS: f64 = 0.08;
const ALL_USED_FRAMES: u32 = 2;

/// The trees, with grip force and from images alone.
#[derive(Debug)]
struct Trees {
    grip: Ensemble,
    alone: Ensemble,
}

fn shipped() -> &'static Trees {
    static SHIPPED: LazyLock<Trees> = LazyLock::new(|| {
        let trees = parse(include_str!("gross/trees.txt"), ["grip", "alone"], SLIDE_FEATURES_COUNT);
        let [grip, alone] = trees.expect("the shipped table is read by tests");
        Trees { grip, alone }
    });
    &SHIPPED
}

/// Reads the shipped trees, once per process: later monitors do not wait for them.
pub(super) fn read_trees() {
    shipped();
}

/// Input of a frame besides the estimates.
#[derive(Debug, Clone, Copy)]
pub(super) struct GrossInput<'a> {
    /// Values of the evidence.
    pub evidence: Option<&'a EvidenceReport>,
    /// Recent motion.
    pub recent: Option<&'a Recent>,
    /// Features of the estimates, and the load; None without estimates.
    pub loaded: Option<(&'a Features, LoadSample)>,
    /// Time, s, on any clock.
    pub at_s: f64,
    /// Whether the object has been held since the rest frame, on a smooth gel.
    pub held_from_start: bool,
    /// Whether the image is that of the frame before.
    pub repeats: bool,
}

/// The features of a frame; None where the estimates or the motion of the imprint are unknown.
fn features(
    estimates: &Estimates,
    input: &GrossInput<'_>,
    grown: Option<[RelativeGrowth; WINDOWS_S.len()]>,
) -> Option<SlideFeatures> {
    let (margin, stick, evidence, recent) = (estimates.margin?, estimates.stick_ratio?, input.evidence?, input.recent?);
    let (field, _) = input.loaded?;
    let mut features = [0.0; SLIDE_FEATURES_COUNT];
    let (head, windows) = features.split_at_mut(OTHERS_COUNT);
    head.copy_from_slice(&[
        1.0 - margin.value,
        stick.value,
        recent.sheared_pitch,
        recent.pace_pitch_per_s,
        recent.pace_carried_fraction,
        evidence.imprint_change.unwrap_or(0.0),
        evidence.relaxation,
        evidence.centre_rim_ratio.unwrap_or(0.0),
        field[TURNING],
        field[NARROW],
        field[WIDE],
        field[LOAD],
    ]);
    for ((into, moved), grown) in windows.chunks_exact_mut(OF_WINDOW_COUNT).zip(&recent.windows).zip(grown?) {
        let RelativeGrowth { load_fraction, grip_fraction } = grown;
        into.copy_from_slice(&[
            moved.over_pitch,
            moved.carried_fraction,
            moved.gel_pitch,
            load_fraction,
            grip_fraction,
        ]);
    }
    Some(features)
}

/// State of gross slip detection.
#[derive(Debug, Clone)]
pub(super) struct GrossWatch {
    trees: &'static Trees,
    /// Slides by its motion, with enough confidence to update the friction.
    moves: bool,
    /// The same, with enough confidence to report it.
    is_reported: bool,
    all_used_frames_count: u32,
    friction_limit: FrictionLimit,
    score: ScoreWatch,
    /// Slides by the slide score, where the object was held from the start.
    slides_by_score: bool,
    growth: Growth,
    pub features: Option<SlideFeatures>,
    /// Probability by the trees in this frame; None where they were not evaluated.
    pub probability: Option<f64>,
}

impl GrossWatch {
    /// Also reads the table, so that no frame waits for it.
    pub fn new() -> Self {
        GrossWatch {
            trees: shipped(),
            moves: false,
            is_reported: false,
            all_used_frames_count: 0,
            friction_limit: FrictionLimit::new(),
            score: ScoreWatch::new(),
            slides_by_score: false,
            growth: Growth::new(),
            features: None,
            probability: None,
        }
    }

    /// Resets after contact is lost.
    pub fn clear(&mut self) {
        *self = GrossWatch::new();
    }

    /// Whether gross slip is reported: by motion, because all of the friction is used, or by the slide score.
    pub fn slides(&self) -> bool {
        self.is_reported || self.friction_limit.is_reached || self.slides_by_score
    }

    /// Adds a frame. Returns whether the object slides by its motion, with enough confidence to update the friction.
    /// Without estimates the imprint alone decides.
    pub fn see(&mut self, estimates: &Estimates, knows_grip: bool, input: &GrossInput<'_>) -> bool {
        self.probability = None;
        let score = input.evidence.filter(|_| input.held_from_start).map(|evidence| evidence.slide_score);
        self.slides_by_score = score.is_some_and(|score| self.score.see(input.at_s, score, input.recent));
        let grown = input.loaded.map(|(_, loaded)| self.growth.see(loaded));
        let (Some(margin), Some(stick)) = (estimates.margin, estimates.stick_ratio) else {
            (self.features, self.all_used_frames_count) = (None, 0);
            self.friction_limit.pause();
            self.moves = input.evidence.is_some_and(|evidence| evidence.slides);
            self.is_reported = self.moves;
            return self.moves;
        };
        let used = 1.0 - margin.value;
        match input.loaded.filter(|_| knows_grip) {
            Some((_, loaded)) => self.friction_limit.see(loaded.at_s, used, stick),
            None => self.friction_limit.pause(),
        }
        let stick = stick.value;
        self.features = features(estimates, input, grown);
        let (begins, says, goes_on) = match &self.features {
            Some(features) => {
                self.all_used_frames_count = 0;
                let (trees, least, sure) = match knows_grip {
                    true => (&self.trees.grip, ONSET_PROBABILITY, REPORT_PROBABILITY),
                    false => (&self.trees.alone, ONSET_PROBABILITY_ALONE, ONSET_PROBABILITY_ALONE),
                };
                let can_begin = match knows_grip {
                    true => used >= LEAST_USED,
                    false => {
                        let moved_pitch =
                            input.recent.map_or(0.0, |recent| recent.windows[WINDOWS_S.len() - 1].gel_pitch);
                        moved_pitch >= STANDS_PITCH || input.evidence.is_some_and(|evidence| evidence.slides)
                    }
                };
                // Where a slide can neither begin nor continue, the trees are not evaluated.
                self.probability = (can_begin || self.moves).then(|| 1.0 / (1.0 + libm::exp(-trees.at(features))));
                let probability = self.probability.unwrap_or(0.0);
                (
                    can_begin && probability >= least,
                    can_begin && probability >= sure,
                    probability >= CONTINUE_PROBABILITY,
                )
            }
            None => {
                let all_used = used >= ALL_USED && stick <= NONE_STICKS;
                self.all_used_frames_count =
                    if all_used { self.all_used_frames_count + u32::from(!input.repeats) } else { 0 };
                let begins = self.all_used_frames_count >= ALL_USED_FRAMES;
                (begins, begins, used >= CONTINUE_USED && stick <= CONTINUE_STICK)
            }
        };
        self.moves = begins || self.moves && goes_on;
        self.is_reported = says || self.is_reported && goes_on;
        self.moves
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::FEATURES_COUNT;
    use super::super::evidence::WindowMotion;
    use super::super::report::Estimate;
    use super::*;
    use crate::plane::Vec2;

    fn estimates(used: f64, stick: f64) -> Estimates {
        let of = |value: f64| Some(Estimate { value, sd: 0.1, age_frames: 0 });
        Estimates { margin: of(1.0 - used), stick_ratio: of(stick), ..Estimates::default() }
    }

    fn evidence(slides: bool) -> EvidenceReport {
        EvidenceReport {
            reference_seq: 0,
            relaxation: 0.0,
            centre_rim_ratio: Some(1.3),
            imprint_change: Some(0.2),
            imprint_age_frames: 0,
            slide_score: 0.0,
            slide_px: Vec2::ZERO,
            slide_rad: 0.0,
            slides,
            gross_probability: None,
            slide_pitch_per_s: None,
            slide_mm_per_s: None,
        }
    }

    /// Input of a frame of a contact under constant load, whose `field` has the usual shape and a load relative to 0.6
    /// of the grip force.
    fn seen<'a>(evidence: &'a EvidenceReport, recent: Option<&'a Recent>, field: &'a Features) -> GrossInput<'a> {
        let loaded = LoadSample { at_s: 0.0, load: 1.0, grip_n: 20.0 };
        GrossInput {
            evidence: Some(evidence),
            recent,
            loaded: Some((field, loaded)),
            at_s: 0.0,
            held_from_start: false,
            repeats: false,
        }
    }

    fn field(load: f64) -> Features {
        let mut field = [0.0; FEATURES_COUNT];
        (field[NARROW], field[WIDE], field[LOAD]) = (1.9, 5.2, load);
        field
    }

    /// An imprint that moves at `pitch_per_s` over a gel that moves along by this share of it.
    fn moving(pitch_per_s: f64, carried_fraction: f64) -> Recent {
        let moved = |window_s: f64| WindowMotion {
            over_pitch: pitch_per_s * window_s,
            carried_fraction,
            gel_pitch: pitch_per_s * window_s * carried_fraction,
        };
        Recent {
            windows: WINDOWS_S.map(moved),
            sheared_pitch: 0.3,
            pace_pitch_per_s: if 0.8 * pitch_per_s >= 0.13 { pitch_per_s } else { 0.0 },
            pace_carried_fraction: if 0.8 * pitch_per_s >= 0.13 { carried_fraction } else { 1.0 },
        }
    }

    #[test]
    fn the_tables_are_whole() {
        let trees = shipped();
        assert!(trees.grip.trees_count() >= 50 && trees.alone.trees_count() >= 50);
    }

    #[test]
    fn a_slide_is_said_at_once_and_until_the_imprint_stands_on_a_gel_that_carries_it() {
        for knows_grip in [true, false] {
            let (mut watch, mut at_s, mut load) = (GrossWatch::new(), 0.0, 1.0);
            let mut see = |used, stick, recent: Recent, growth_per_s: f64| {
                (at_s, load) = (at_s + 1.0 / 30.0, load * libm::exp(growth_per_s / 30.0));
                let field = field(if knows_grip { 0.85 * used } else { 0.0 });
                let loaded = Some((&field, LoadSample { at_s, load, grip_n: 20.0 }));
                let evidence = evidence(true);
                let seen = GrossInput { loaded, ..seen(&evidence, Some(&recent), &field) };
                watch.see(&estimates(used, stick), knows_grip, &seen);
                watch.slides()
            };
            for _ in 0..5 {
                assert!(!see(0.5, 0.7, moving(1.0, 1.5), 0.0), "it sticks, and is carried along");
                // From images alone, this motion under a constant load counts as a slide.
                let growth_per_s = if knows_grip { 0.0 } else { 1.0 };
                assert!(!see(0.75, 0.4, moving(2.0, 0.5), growth_per_s), "its rim creeps");
            }
            assert!(see(1.0, 0.02, moving(12.0, 0.0), 0.0));
            assert!(see(0.9, 0.1, moving(8.0, 0.0), 0.0), "it goes on");
            assert!(see(0.8, 0.25, moving(2.0, 0.5), 0.0), "more slowly");
            assert!(!see(0.3, 0.9, moving(0.0, 0.0), 0.0), "gripped again");
            let begins = see(0.8, 0.25, moving(2.0, 0.5), 0.0);
            assert!(!knows_grip || !begins, "what it goes on with does not begin it where the grip is known");
        }
    }

    #[test]
    fn a_slide_begins_at_its_probability_and_the_picture_alone_has_to_be_surer() {
        let (evidence, mut between) = (evidence(true), [0, 0]);
        for (case, knows_grip) in [true, false].into_iter().enumerate() {
            let least = if knows_grip { 0.95 } else { 0.98 };
            for step in 0..6000 {
                let (used, stick) = (0.7 + 0.02 * f64::from(step % 20), 0.02 * f64::from(step / 20 % 10));
                let (recent, field) =
                    (moving(0.4 * f64::from(step / 200), 0.3), field(if knows_grip { 0.6 } else { 0.0 }));
                let mut watch = GrossWatch::new();
                let says = watch.see(&estimates(used, stick), knows_grip, &seen(&evidence, Some(&recent), &field));
                let trees = if knows_grip { &watch.trees.grip } else { &watch.trees.alone };
                let logit = trees.at(&watch.features.expect("all is known"));
                let probability = 1.0 / (1.0 + libm::exp(-logit));
                assert_eq!(says, probability >= least, "{knows_grip}, {used}, {stick}: {probability}");
                between[case] += u32::from((0.9..least).contains(&probability));
            }
        }
        assert!(between[0] > 0 && between[1] > 0, "cases just below: {between:?}");
    }

    #[test]
    fn a_load_that_still_grows_is_still_carried() {
        let [stands, grows] = [0.0, 1.0].map(|growth_per_s: f64| {
            let (mut watch, recent, evidence, field) =
                (GrossWatch::new(), moving(2.0, 0.5), evidence(true), field(0.0));
            let mut says = false;
            for frame in 0..10 {
                let at_s = f64::from(frame) / 30.0;
                let loaded = LoadSample { at_s, load: libm::exp(growth_per_s * at_s), grip_n: 0.0 };
                let seen = GrossInput { loaded: Some((&field, loaded)), ..seen(&evidence, Some(&recent), &field) };
                says = watch.see(&estimates(0.9, 0.1), false, &seen);
                (watch.moves, watch.is_reported) = (false, false);
            }
            says
        });
        assert!(stands && !grows);
    }

    #[test]
    fn what_uses_less_than_half_of_the_friction_begins_no_slide_whatever_the_imprint_does() {
        let see = |used, knows_grip| {
            let recent = moving(12.0, 0.0);
            let field = field(if knows_grip { 0.85 } else { 0.0 });
            GrossWatch::new().see(&estimates(used, 0.02), knows_grip, &seen(&evidence(true), Some(&recent), &field))
        };
        assert!(!see(0.45, true) && see(0.55, true), "where the grip force is known");
        assert!(see(0.45, false), "without it the used fraction is not known so well");
    }

    #[test]
    fn without_an_imprint_the_load_tells_and_without_a_load_the_imprint() {
        let mut watch = GrossWatch::new();
        let field = field(0.8);
        let mut see = |estimates: Estimates, slides| {
            let moves = watch.see(&estimates, true, &seen(&evidence(slides), None, &field));
            assert_eq!(watch.slides(), moves, "learned from and said");
            moves
        };
        let said = [(1.0, 0.0), (0.9, 0.0), (1.0, 0.0), (1.0, 0.05), (0.85, 0.2), (0.7, 0.4), (0.9, 0.1)];
        let said = said.map(|(used, stick)| see(estimates(used, stick), true));
        assert_eq!(said, [false, false, false, true, true, false, false]);
        assert_eq!([false, true, false].map(|slides| see(Estimates::default(), slides)), [false, true, false]);
    }

    #[test]
    fn spent_friction_is_gross_slip_where_the_grip_is_known_and_teaches_nothing() {
        let (evidence, recent, field) = (evidence(false), moving(0.0, 1.0), field(0.8));
        for knows_grip in [true, false] {
            let mut watch = GrossWatch::new();
            let said = [Some(1.0); 10].into_iter().chain([None, Some(1.0)]).enumerate().map(|(frame, used)| {
                let loaded = LoadSample { at_s: frame as f64 / 30.0, load: 1.0, grip_n: 20.0 };
                let seen = GrossInput { loaded: Some((&field, loaded)), ..seen(&evidence, Some(&recent), &field) };
                let estimates = used.map_or(Estimates::default(), |used| estimates(used, 0.05));
                assert!(!watch.see(&estimates, knows_grip, &seen), "by its motion it stands");
                watch.slides()
            });
            let said: Vec<bool> = said.collect();
            assert_eq!(said[9..], [knows_grip, false, knows_grip], "markers are lost in one frame");
        }
    }

    /// The thresholds for updating the friction and for reporting differ.
    #[test]
    fn a_slide_is_said_when_it_is_surer_than_what_friction_is_learned_from() {
        let (evidence, mut cases) = (evidence(true), [0; 3]);
        for step in 0..6000 {
            let (used, stick) = (0.7 + 0.02 * f64::from(step % 20), 0.02 * f64::from(step / 20 % 10));
            let (recent, field) = (moving(0.4 * f64::from(step / 200), 0.3), field(0.6));
            let mut watch = GrossWatch::new();
            let moves = watch.see(&estimates(used, stick), true, &seen(&evidence, Some(&recent), &field));
            let probability = 1.0 / (1.0 + libm::exp(-watch.trees.grip.at(&watch.features.expect("all is known"))));
            assert_eq!((moves, watch.slides()), (probability >= 0.95, probability >= 0.97), "{probability}");
            cases[usize::from(moves) + usize::from(watch.slides())] += 1;
        }
        assert!(cases.iter().all(|count| *count > 0), "{cases:?}");
    }

    #[test]
    fn what_is_not_known_gives_no_features() {
        let (known, recent, evidence) = (estimates(0.5, 0.5), moving(1.0, 0.0), evidence(false));
        let field = field(0.4);
        let (whole, grown) =
            (seen(&evidence, Some(&recent), &field), Some([RelativeGrowth::default(); WINDOWS_S.len()]));
        assert!(features(&known, &whole, grown).is_some_and(|features| features.iter().all(|v| v.is_finite())));
        assert_eq!(features(&Estimates::default(), &whole, grown), None);
        assert_eq!(features(&known, &GrossInput { evidence: None, ..whole }, grown), None);
        assert_eq!(features(&known, &GrossInput { recent: None, ..whole }, grown), None);
        assert_eq!(features(&known, &GrossInput { loaded: None, ..whole }, None), None);
    }
}
