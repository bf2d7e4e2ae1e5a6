//! Friction of a contact, accumulated over its frames: the friction stays the same, the information in a frame does
//! not.
//!
//! ```text
//!   a frame:  log mu = log (load / (grip x sunk)) - log used, by trees of its own (said.rs)
//!   known:    mean of the frames' log mu, each by what it tells beyond what is known of any contact; and that, once
//!   after a regrip the field counts anew, and after letting go or under a load that has fallen it shows what that has left:
//!                                          used <- the frame's, and load / (grip x mu x sunk), each by its error
//! ```
//!
//! Where an object begins to slide all of the friction is used: that tells it best.
//!
//! Where less than the noise of the load pulls, a frame tells nothing. While little is pulled a frame hardly tells a rough contact from a slippery one: what trees say of it then is what is known of any
//! contact, and counts for nothing.
//!
//! `sunk`: a curved object that lies in the gel bears against its far side, and slides at more than mu P.

use crate::monitor::report::Estimate;
use crate::plane::Vec2;

/// What is known of the friction of any contact: mean and one over the variance of its logarithm, of a choice from 0.2 to 1.3 that is
/// even by the logarithm. The trees were fitted to that.
const ANY_LOG_MU: f64 = -0.673;
const ANY: f64 = 1.0 / (0.54 * 0.54);
/// What a frame tells leans towards that; undone by this factor at most, where it tells little.
const MOST_STRETCH: f64 = 2.0;
/// Frames in a row are wrong alike, so many tell as much as one; but one whose load has changed by so much in its logarithm since the last
/// such frame, as that of the frame before it had, tells something of its own.
const FRAMES_ALIKE: f64 = 12.0;
const OWN_LOG_LOAD: f64 = 0.1;
/// From how much on the friction is said to be known, and most that all frames tell together (0.2 of the friction): in units of one
/// over the variance of its logarithm.
const LEAST_TOLD: f64 = 2.0;
const MOST_TOLD: f64 = 25.0;
/// Share of that after a regrip, and the time in which it grows to that, s: the field then shows less slip than the load has made, and right
/// after it none.
const REGRIPPED_SHARE: f64 = 0.1;
const REGRIPPED_S: f64 = 0.2;
/// A grip that has been let go by so much in its logarithm since the field began to count leaves in it what squeeze and slip of the larger
/// contact have made; for every 1 beyond, a frame's logarithm of the used fraction may be off by so much more, up to a load of so much of the
/// grip force; under more load it matters less.
const LET_GO_LOG: f64 = 1.0;
const LET_GO_LOG_SD: f64 = 0.8;
const LET_GO_PER_GRIP: f64 = 0.15;
/// What has slipped at the rim under a larger load stays behind when the load falls, and looks like more of the friction than is used: for every 1
/// by which the logarithm of the load has fallen beyond the first number, a frame's logarithm of the used fraction may be off by the second.
const EASED_LOG: f64 = 0.1;
const EASED_LOG_SD: f64 = 1.0;
/// How well the load at which an object begins to slide tells the friction: standard deviation of its logarithm.
const SLIDES_LOG_SD: f64 = 0.15;
/// It is believed once the slide has been told in so many frames and for so long, s: a load that drops at once, as of a bottle that is set
/// down, can look like a slide in two.
const SLIDES_FRAMES: u32 = 3;
const SLIDES_S: f64 = 0.05;
/// Standard deviation by which log mu may differ at another grip force, for a difference of 1 in the logarithm of the force: what
/// `sunk` leaves.
const DRIFT_LOG_SD: f64 = 0.2;
/// What holds a load has the friction for it, within the error of the load.
const LOAD_SURE: f64 = 0.95;
/// Growth of the load that slides with the shear of the gel, in half widths of the contact, at a traction as large as the pressure:
/// 0.5 to 1.1 for simulated spheres, cylinders and the cap between 6 and 50 N, whatever their friction.
const SUNK_GROWTH: f64 = 0.8;
/// Standard deviation of the load over the grip force where nothing pulls: squeeze and rolling leave so much.
const LOAD_NOISE_PER_GRIP: f64 = 0.01;
/// More than that was not simulated.
const MOST_SUNK: f64 = 1.5;

/// By how much more than mu P an object slides that has sunk into the gel. `shear_px`: displacement of the gel at a traction as
/// large as the mean pressure; `half_width_px`: of the contact along the load; `pulled_fraction`: share of the force in the load, the
/// rest of which turns.
pub(super) fn sunk(shear_px: f64, half_width_px: f64, pulled_fraction: f64) -> f64 {
    (1.0 + SUNK_GROWTH * pulled_fraction * shear_px / half_width_px.max(1e-6)).min(MOST_SUNK)
}

/// Half the width of a contact along a direction, from the places of its markers: twice their standard deviation, as on a disc.
pub(super) fn half_width_px(places: impl ExactSizeIterator<Item = Vec2>, middle: Vec2, along: Vec2) -> f64 {
    let n = places.len().max(1) as f64;
    let squares: f64 = places.map(|place| (place - middle).dot(along)).map(|x| x * x).sum();
    2.0 * (squares / n).sqrt()
}

/// A frame that knows less than what is known of any contact leans towards that: the logarithm of what is used, and that.
fn lean(log_load: f64, log_sd: f64, used: Estimate) -> (f64, Estimate) {
    let log_used = libm::log(used.value.max(1e-3));
    let of_frame = 1.0 / (ANY * log_sd * log_sd);
    if of_frame >= 1.0 {
        return (log_used, used);
    }
    let log_used = of_frame * log_used + (1.0 - of_frame) * (log_load - ANY_LOG_MU);
    (log_used, Estimate { value: libm::exp(log_used), ..used })
}

/// What a frame shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    /// Time, s.
    pub at_s: f64,
    /// Load over grip force.
    pub per_grip: f64,
    /// Grip force, N.
    pub grip_n: f64,
    /// See [`sunk`].
    pub sunk: f64,
    /// Whether the imprint moves over the gel as that of an object that slides: a load that falls meanwhile is no smaller one.
    pub imprint_slides: bool,
    /// Standard deviation of the logarithm of the used fraction.
    pub log_used_sd: f64,
}

/// The frame in which an object began to slide, and what followed.
#[derive(Debug, Clone, Copy)]
struct SlideStart {
    log_load: f64,
    log_grip: f64,
    since_s: f64,
    frames_count: u32,
    is_taken: bool,
}

/// What is known of the friction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Friction {
    log_mu: f64,
    /// One over the variance of it, by frames alone; 0 while no frame has said anything.
    told: f64,
    /// Logarithm of the grip force at which it was seen.
    log_grip: f64,
    /// Logarithm of the load over the grip force of the last frame that told something of its own, and by how much that of the last frame
    /// differed.
    own_log_load: Option<f64>,
    last_change: f64,
    /// Logarithms of the largest grip force and of the largest load, N, since the field began to count.
    most_log_grip: Option<f64>,
    most_log_load_n: Option<f64>,
    /// Logarithms of load over grip force, without what lies deep, and of the grip force in the last frame.
    last_log_load_grip: Option<(f64, f64)>,
    /// When the grip last grew under load, s, and when the last frame was: slip counts anew from there.
    regripped_s: Option<f64>,
    now_s: f64,
    /// While the object slides.
    slide: Option<SlideStart>,
}

impl Friction {
    /// The grip has grown under load.
    pub fn regripped(&mut self) {
        self.regripped_s = Some(self.now_s).filter(|_| self.told > 0.0);
        self.field_counts_anew();
    }

    /// What the field shows counts from here.
    pub fn field_counts_anew(&mut self) {
        (self.most_log_grip, self.most_log_load_n) = (None, None);
    }

    /// Whether the object slides in the last frame: in the first in which it did all of the friction was used.
    pub fn slides(&mut self, slides: bool) {
        if !slides {
            self.slide = None;
            return;
        }
        let Some((log_load, log_grip)) = self.last_log_load_grip else { return };
        let new = SlideStart { log_load, log_grip, since_s: self.now_s, frames_count: 0, is_taken: false };
        let slide = self.slide.get_or_insert(new);
        slide.frames_count += 1;
        let lasts = slide.frames_count >= SLIDES_FRAMES && self.now_s - slide.since_s >= SLIDES_S;
        if lasts && !std::mem::replace(&mut slide.is_taken, true) {
            let SlideStart { log_load, log_grip, .. } = *slide;
            self.take(log_load, SLIDES_LOG_SD, 1.0, log_grip);
        }
    }

    /// What frames told of log mu, as far as it holds at a grip force.
    fn told_at(&self, log_grip: f64) -> f64 {
        let drift = DRIFT_LOG_SD * (log_grip - self.log_grip);
        self.told / (1.0 + self.told * drift * drift)
    }

    /// Whether a frame tells something of its own; a single one that differs may be a wrong reading.
    fn is_own(&mut self, log_load: f64) -> bool {
        let change = log_load - *self.own_log_load.get_or_insert(log_load);
        let before = std::mem::replace(&mut self.last_change, change);
        let own = change.abs() >= OWN_LOG_LOAD && before.abs() >= OWN_LOG_LOAD && change * before > 0.0;
        if own {
            self.own_log_load = Some(log_load);
        }
        own
    }

    /// Takes what a frame tells: log mu, which is right within `log_sd` if any contact is as likely as another.
    fn take(&mut self, log_mu: f64, log_sd: f64, share: f64, log_grip: f64) {
        let of_frame = 1.0 / (log_sd * log_sd);
        let beyond = of_frame - ANY;
        if beyond <= 0.0 || share <= 0.0 {
            return;
        }
        let own_log_mu = ANY_LOG_MU + (log_mu - ANY_LOG_MU) * (of_frame / beyond).min(MOST_STRETCH);
        let told = share * beyond;
        let newest = told / (self.told_at(log_grip) + told);
        self.log_mu += newest * (own_log_mu - self.log_mu);
        self.log_grip += newest * (log_grip - self.log_grip);
        self.told = (self.told + told).min(MOST_TOLD);
    }

    /// Takes what a frame says. The friction, once enough is known of it; `used` with what was known before.
    pub fn see(&mut self, shown: &Shown, used: Estimate) -> (Option<Estimate>, Estimate) {
        let load = (shown.per_grip / shown.sunk).max(1e-6);
        let (log_load, log_grip) = (libm::log(load), libm::log(shown.grip_n.max(0.1)));
        self.last_log_load_grip = Some((log_load, log_grip));
        let most_log_grip = self.most_log_grip.map_or(log_grip, |most| most.max(log_grip));
        self.most_log_grip = Some(most_log_grip);
        let let_go = (most_log_grip - log_grip - LET_GO_LOG).max(0.0);
        let left_log_sd = LET_GO_LOG_SD * let_go * (LET_GO_PER_GRIP / load).min(1.0);
        let log_load_n = libm::log((shown.per_grip * shown.grip_n).max(1e-6));
        let most_log_load_n = self.most_log_load_n.map_or(log_load_n, |most| most.max(log_load_n));
        self.most_log_load_n = Some(most_log_load_n);
        let eased = if shown.imprint_slides { 0.0 } else { (most_log_load_n - log_load_n - EASED_LOG).max(0.0) };
        let log_used_sd = libm::hypot(shown.log_used_sd, libm::hypot(left_log_sd, EASED_LOG_SD * eased));
        let (log_used, used) = lean(log_load, log_used_sd, used);
        self.now_s = shown.at_s;
        let seen = self.regripped_s.map(|regripped_s| ((self.now_s - regripped_s) / REGRIPPED_S).clamp(0.0, 1.0));
        let seen = seen.or(Some(1.0).filter(|_| (let_go > 0.0 || eased > 0.0) && self.told > 0.0));
        // One that only stands there tells what it told before.
        if used.age_frames == 0 {
            let own = if self.is_own(log_load) { 1.0 } else { FRAMES_ALIKE.recip() };
            let share = own * seen.map_or(1.0, |seen| REGRIPPED_SHARE * seen);
            let log_sd = libm::hypot(log_used_sd, LOAD_NOISE_PER_GRIP / shown.per_grip.max(1e-6));
            self.take(log_load - log_used, log_sd, share, log_grip);
        }
        let told = self.told_at(log_grip);
        let log_mu = (told * self.log_mu + ANY * ANY_LOG_MU) / (told + ANY);
        // For this frame alone: one reading of the grip that is too low must not make the contact less slippery for good.
        let value = libm::exp(log_mu).max(LOAD_SURE * load);
        let known = Estimate { value, sd: value * (told + ANY).recip().sqrt(), age_frames: 0 };
        let friction = Some(known).filter(|_| told >= LEAST_TOLD);
        let Some(seen) = seen else { return (friction, used) };
        let of_frame = seen / (log_used_sd * log_used_sd);
        let of_memory = told + (1.0 - seen) * ANY;
        let all = of_frame + of_memory;
        let log_used = (of_frame * log_used + of_memory * (log_load - libm::log(value))) / all;
        let value = libm::exp(log_used).min(1.2);
        (friction, Estimate { value, sd: value * all.recip().sqrt(), ..used })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(value: f64) -> Estimate {
        Estimate { value, sd: 0.1, age_frames: 0 }
    }

    /// A frame of this load, and how sure it is of the logarithm of the used fraction.
    fn shown(per_grip: f64, grip_n: f64, log_used_sd: f64) -> Shown {
        Shown { at_s: 0.0, per_grip, grip_n, sunk: 1.0, imprint_slides: false, log_used_sd }
    }

    /// Loaded up to a used fraction of 0.8 at 10 N.
    fn loaded(mu: f64) -> Friction {
        let mut friction = Friction::default();
        for step in 1..=24 {
            let f = f64::from(step) / 30.0;
            friction.see(&shown(mu * f, 10.0, (0.55 - 0.55 * f).max(0.1)), used(f));
        }
        friction
    }

    /// What is told after a frame of that load that says that so much is used.
    fn told(friction: &mut Friction, shown: &Shown, fraction: f64) -> f64 {
        friction.see(shown, used(fraction)).0.expect("told").value
    }

    #[test]
    fn it_is_load_over_grip_over_what_is_used_of_it_and_who_knows_it_better_counts_for_more() {
        let after = |frames: &[(f64, f64, f64)]| {
            let mut friction = Friction::default();
            let see = |&(per_grip, f, sd): &(f64, f64, f64)| friction.see(&shown(per_grip, 10.0, sd), used(f)).0;
            frames.iter().map(see).last().flatten()
        };
        assert_eq!(
            after(&[(0.0, 0.02, 0.6), (0.1, 0.2, 0.54)]),
            None,
            "nothing pulls, or all of it is what any contact has"
        );
        assert_eq!(after(&[(0.4, 0.5, 0.2)]), None, "one frame is not enough");
        let first = after(&[(0.4, 0.5, 0.1)]).expect("told");
        assert!((0.65..0.8).contains(&first.value) && first.sd < 0.4 * first.value, "between any and 0.8: {first:?}");
        let long = after(&[(0.4, 0.5, 0.1); 60]).expect("told");
        assert!((long.value - 0.76).abs() < 0.03 && long.sd < 0.2 * 0.8, "{long:?}");
        let [worse, better] = [0.3, 0.04].map(|sd| after(&[(0.4, 0.5, 0.1), (0.4, 0.8, sd)]).expect("told"));
        assert!(worse.value > 0.6 && better.value < 0.55 && better.sd < worse.sd, "{worse:?} {better:?}");
        let quick = after(&[(0.1, 0.2, 0.3), (0.2, 0.4, 0.3), (0.3, 0.6, 0.3)]).expect("told");
        let slow = after(&[(0.29, 0.58, 0.3), (0.29, 0.58, 0.3), (0.3, 0.6, 0.3)]);
        assert!(
            quick.sd < 0.3 && slow.is_none(),
            "as the load grows every frame tells something of its own: {quick:?} {slow:?}"
        );
        let by_and_by: Vec<_> =
            (0..12).map(|step| 0.2 * 1.04f64.powi(step)).map(|load| (load, 2.0 * load, 0.3)).collect();
        let by_and_by = after(&by_and_by).expect("told");
        assert!(
            by_and_by.sd < 0.22 * by_and_by.value,
            "so does every third of a load that grows slowly: {by_and_by:?}"
        );
        let mut sunk = Friction::default();
        let deep = Shown { sunk: 1.25, ..shown(0.5, 10.0, 0.1) };
        let deep = (0..60).filter_map(|_| sunk.see(&deep, used(0.5)).0).last().expect("frames");
        assert!((deep.value - 0.76).abs() < 0.03, "{deep:?}");
    }

    #[test]
    fn what_hardly_pulls_tells_nothing_however_long_it_stands() {
        let mut friction = Friction::default();
        for frame in 0..600 {
            let noise = 0.001 + 0.0005 * f64::from(frame % 3);
            // Trees that never saw so little say the least that they know, and are as sure of it as of that.
            assert_eq!(friction.see(&shown(noise, 20.0, 0.5), used(0.04)).0, None, "frame {frame}");
        }
        let told = (0..60).map(|_| friction.see(&shown(0.4, 20.0, 0.1), used(0.5)).0).last().flatten();
        assert!(told.is_some_and(|told| (told.value - 0.77).abs() < 0.05), "{told:?}");
    }

    #[test]
    fn a_frame_that_knows_less_than_is_known_of_any_contact_is_not_believed() {
        let said = |sd: f64| Friction::default().see(&shown(0.1, 10.0, sd), used(0.8)).1.value;
        assert!((said(0.3) - 0.8).abs() < 1e-9 && (said(0.53) - 0.8).abs() < 1e-9, "it knows something");
        // Of any contact a load of 0.1 uses 0.196.
        assert!(said(0.8) < 0.4 && said(0.8) > said(1.6) && said(1.6) > 0.196, "{} {}", said(0.8), said(1.6));
        let memory = loaded(0.8).told;
        let mut friction = loaded(0.8);
        friction.see(&shown(0.1, 10.0, 0.8), used(0.8));
        assert!(friction.told <= memory, "nor does it tell anything");
    }

    #[test]
    fn what_leans_towards_any_contact_is_not_taken_for_a_slippery_one() {
        // A rough one, pulled at a tenth of what it holds: a frame says a sixth, which any contact would use, and little surer.
        let mut friction = Friction::default();
        for _ in 0..60 {
            friction.see(&shown(0.09, 10.0, 0.5), used(0.16));
        }
        let (told, _) = friction.see(&shown(0.9, 10.0, 0.1), used(0.9));
        assert!(told.is_some_and(|told| told.value > 0.7), "one frame that knows outweighs them: {told:?}");
        // Many that lean half way know it all the same.
        let mut friction = Friction::default();
        let leans = |mu: f64| (ANY_LOG_MU + mu.ln()) / 2.0;
        let mut rough = 0.0;
        for _ in 0..200 {
            let lean = (0.5f64).ln() - leans(1.0);
            rough = friction.see(&shown(0.5, 10.0, 0.38), used(lean.exp())).0.map_or(0.0, |told| told.value);
        }
        assert!((rough - 1.0).abs() < 0.1, "{rough}");
    }

    #[test]
    fn what_frames_near_the_slide_told_is_not_forgotten_over_many_that_tell_little() {
        let mut friction = loaded(0.8);
        // Let off to a quarter; a frame then takes any contact for one of middling friction.
        let kept = (0..90).map(|_| told(&mut friction, &shown(0.2, 10.0, 0.5), 0.45)).last().expect("frames");
        assert!((0.68..=0.82).contains(&kept), "{kept}");
    }

    #[test]
    fn a_frame_that_only_stands_there_tells_nothing_anew() {
        let [moving, standing] = [0, 3].map(|age_frames| {
            let mut friction = loaded(0.5);
            let stands = Estimate { age_frames, ..used(0.5) };
            (0..90).map(|_| friction.see(&shown(0.4, 10.0, 0.2), stands).0.expect("told").value).last()
        });
        assert!(moving > Some(0.65) && standing < Some(0.53), "{moving:?} {standing:?}");
    }

    #[test]
    fn what_holds_a_load_has_the_friction_for_it() {
        let mut friction = loaded(0.4);
        let held = told(&mut friction, &shown(0.9, 10.0, 0.2), 0.6);
        assert!(held >= 0.85, "{held}");
        let after = told(&mut friction, &shown(0.2, 10.0, 0.2), 0.5);
        assert!((after - 0.4).abs() < 0.07, "a reading that was half of the grip is forgotten: {after}");
        let sunk = told(&mut loaded(0.4), &Shown { sunk: 1.5, ..shown(0.9, 10.0, 0.2) }, 0.6);
        assert!((0.56..0.65).contains(&sunk), "the far side bears a third of it: {sunk}");
    }

    #[test]
    fn right_after_a_regrip_a_frame_says_nothing_and_soon_it_counts_beside_what_was_known() {
        let mut friction = loaded(0.5);
        friction.see(&shown(0.3, 12.0, 0.2), used(0.6));
        friction.regripped();
        let (told, now) = friction.see(&shown(0.3, 12.0, 0.3), used(0.2));
        assert!((now.value - 0.6).abs() < 0.05, "its field is empty: {now:?}");
        let told = told.expect("told");
        assert!((told.value - 0.5).abs() < 0.04, "{told:?}");
        assert!((now.sd / now.value - told.sd / told.value).abs() < 1e-9, "as sure as the friction: {now:?} {told:?}");
        let later = Shown { at_s: 0.3, ..shown(0.3, 12.0, 0.3) };
        let now = friction.see(&later, used(0.3)).1;
        assert!((0.35..0.58).contains(&now.value) && now.sd < 0.1, "between both, and surer than each: {now:?}");
        let sure = friction.see(&Shown { at_s: 0.3, ..shown(0.3, 12.0, 0.01) }, used(0.9)).1;
        assert!((sure.value - 0.9).abs() < 0.02, "what a frame is sure of counts: {sure:?}");
    }

    #[test]
    fn what_letting_go_leaves_in_the_field_is_not_taken_for_slip() {
        // Pressed, pulled a little, and let go to a tenth: the field of the large contact is still there, and looks like half of the friction.
        let mut friction = Friction::default();
        for _ in 0..60 {
            friction.see(&shown(0.06, 60.0, 0.2), used(0.1));
        }
        let (_, carried) = { friction }.see(&Shown { at_s: 1.0, ..shown(0.55, 6.0, 0.2) }, used(0.5));
        assert!(carried.value > 0.55, "a load that is still carried leaves what was known counted, too: {carried:?}");
        let let_go = |friction: &mut Friction, per_grip, grip_n, fraction| {
            let shown = Shown { at_s: 1.0, ..shown(per_grip, grip_n, 0.2) };
            let frames = (0..90).map(|_| friction.see(&shown, used(fraction)));
            frames.last().map(|(told, used)| (told.expect("told").value, used.value)).expect("frames")
        };
        let (mu, now) = let_go(&mut friction, 0.1, 6.0, 0.5);
        assert!((mu - 0.58).abs() < 0.06 && now < 0.3, "what was known counts: {mu} {now}");
        let (_, loaded_now) = let_go(&mut friction, 0.55, 6.0, 0.95);
        assert!(loaded_now > 0.85, "under a load it matters less: {loaded_now}");
        let (_, before) = let_go(&mut friction, 0.1, 6.0, 0.5);
        (friction.now_s, friction.regripped_s) = (0.0, None);
        friction.regripped();
        let (_, anew) = let_go(&mut friction, 0.1, 6.0, 0.5);
        assert!(anew > before + 0.05, "the field has begun anew: {anew} {before}");
        let mut friction = loaded(0.2);
        let (mu, now) = let_go(&mut friction, 0.2, 8.0, 0.5);
        assert!(mu > 0.25 && (now - 0.5).abs() < 1e-9, "a little less grip leaves nothing: {mu} {now}");
    }

    #[test]
    fn what_a_larger_load_has_left_at_the_rim_is_not_taken_for_slip_of_a_smaller_one() {
        // A bottle that is pushed up: its load halves within two frames, and the rim still lags as under all of it.
        let mut friction = loaded(0.8);
        let ((before, _), mut now) = (friction.see(&shown(0.64, 10.0, 0.1), used(0.8)), used(0.0));
        for load in [0.45, 0.32, 0.31, 0.32] {
            now = friction.see(&shown(load, 10.0, 0.2), used(0.75)).1;
        }
        let (after, later) = friction.see(&shown(0.6, 10.0, 0.15), used(0.75));
        let [before, after] = [before, after].map(|told| told.expect("told").value);
        assert!((before - after).abs() < 0.02, "it tells nothing of the friction: {before} {after}");
        assert!((0.32 / 0.8 - 0.05..0.5).contains(&now.value), "what was known counts: {now:?}");
        assert!((later.value - 0.75).abs() < 1e-9, "nearly as much as before is as good as any: {later:?}");
        let mut sliding = loaded(0.8);
        sliding.see(&shown(0.64, 10.0, 0.1), used(0.8));
        let falls = Shown { imprint_slides: true, ..shown(0.32, 10.0, 0.2) };
        assert!(
            (sliding.see(&falls, used(0.95)).1.value - 0.95).abs() < 1e-9,
            "it slides, and its load falls with that"
        );
        // A regrip begins anew: nothing is left of it then.
        friction.regripped();
        let anew = Shown { at_s: 1.0, ..shown(0.32, 12.0, 0.02) };
        assert!((friction.see(&anew, used(0.75)).1.value - 0.75).abs() < 0.02);
        // Of a contact of which nothing is known, what any contact has.
        let mut friction = Friction::default();
        let _ = friction.see(&shown(0.4, 10.0, 0.5), used(0.7));
        let now = friction.see(&shown(0.1, 10.0, 0.2), used(0.7)).1;
        assert!((0.15..0.4).contains(&now.value), "{now:?}");
    }

    #[test]
    fn the_load_that_slides_tells_the_friction_whatever_frames_said() {
        let mut friction = Friction::default();
        friction.slides(true);
        assert_eq!(friction.see(&shown(0.3, 10.0, 0.4), used(0.45)).0, None, "no frame, no slide");
        // Told as rough: more than the half of it is out of sight. The load falls as it slides.
        let slid = |frames: u32, period_s: f64| {
            let mut friction = Friction::default();
            for _ in 0..60 {
                friction.see(&shown(0.3, 5.0, 0.2), used(0.5));
                friction.slides(false);
            }
            for frame in 0..frames {
                let (per_grip, f) = if frame == 0 { (0.3, 0.5) } else { (0.2, 0.6) };
                let at_s = period_s * f64::from(frame);
                friction.see(&Shown { at_s, imprint_slides: true, ..shown(per_grip, 5.0, 0.4) }, used(f));
                friction.slides(true);
            }
            friction
        };
        let told = |mut friction: Friction| {
            friction.regripped();
            let (told, now) = friction.see(&shown(0.15, 10.0, 0.2), used(0.22));
            (told.expect("told").value, now.value)
        };
        let (mu, now) = told(slid(3, 1.0 / 30.0));
        assert!((0.28..0.42).contains(&mu) && (0.36..0.55).contains(&now), "{mu} {now}");
        let longer = told(slid(12, 1.0 / 30.0)).0;
        assert!((0.34..0.42).contains(&longer), "taken once, of its first frame: {longer}");
        for (frames, period_s) in [(2, 0.06), (5, 0.01)] {
            let mu = told(slid(frames, period_s)).0;
            assert!(mu > 0.45, "a slide of {frames} frames of {period_s} s may be none: {mu}");
        }
        let mut twice = slid(2, 1.0 / 30.0);
        twice.slides(false);
        twice.see(&Shown { at_s: 0.1, ..shown(0.2, 5.0, 0.2) }, used(0.5));
        twice.slides(true);
        assert!(told(twice).0 > 0.45, "each counts from its own beginning");
    }

    #[test]
    fn at_another_grip_less_is_known_of_it() {
        let sd = |grip_n: f64| {
            let mut friction = loaded(0.5);
            friction.see(&shown(0.3, 10.0, 0.2), used(0.6));
            friction.regripped();
            friction.see(&shown(0.3, grip_n, 0.5), used(0.6)).1.sd
        };
        assert!(sd(60.0) > 1.2 * sd(10.0), "{} {}", sd(60.0), sd(10.0));
    }

    #[test]
    fn what_lies_deep_slides_at_more_and_a_wide_face_does_not() {
        let places = |x_mm: f64, y_mm: f64| {
            (0..900).map(move |i| {
                Vec2::new(x_mm * (f64::from(i % 30) / 14.5 - 1.0), y_mm * (f64::from(i / 30) / 14.5 - 1.0))
            })
        };
        let width = |x_mm, y_mm, along: Vec2| {
            let places: Vec<Vec2> = places(x_mm, y_mm).collect();
            half_width_px(places.into_iter(), Vec2::ZERO, along)
        };
        // A uniform width of 2 a has the standard deviation a / sqrt 3.
        assert!((width(6.0, 2.0, Vec2::new(1.0, 0.0)) - 6.0 * 2.0 / 3f64.sqrt()).abs() < 0.3);
        assert!((width(6.0, 2.0, Vec2::new(0.0, 1.0)) - 2.0 * 2.0 / 3f64.sqrt()).abs() < 0.1);
        // The cap at 6 and at 50 N, and a box (simulated: 1.09, 1.48, 1.05), pulled; the cap turned about the pad's normal.
        assert!((sunk(1.1, 7.2, 1.0) - 1.12).abs() < 0.01 && (sunk(3.8, 8.8, 1.0) - 1.35).abs() < 0.01);
        assert!(sunk(1.3, 13.0, 1.0) < 1.09 && sunk(3.8, 8.8, 0.0) == 1.0 && sunk(90.0, 1.0, 1.0) == MOST_SUNK);
    }
}
