//! Friction of a contact, accumulated over its frames: the friction is constant, the information per frame is not.
//!
//! ```text
//!   a frame:  log mu = log (load / (grip x gain)) - log used, from trees of its own (prediction.rs)
//!   known:    mean of the prior and the frames' log mu, each weighted by its information beyond the prior
//!   after a regrip the field restarts from zero; after a lighter grip or a fallen load it contains residual slip:
//!                               used <- the frame's and load / (grip x mu x gain), weighted by error
//! ```
//!
//! At the onset of gross slip all of the friction is used: that load is the best measure of it.
//!
//! A frame whose load is below the noise gives no information. At a small load a frame hardly distinguishes a rough
//! contact from a slippery one: the trees then return the prior, which has no weight.
//!
//! `gain`: load at gross slip over mu P. A curved object slides at more (indentation.rs); a contact that the view cuts holds
//! more torque than the part in view (load.rs).

use super::prediction::MAX_USED;
use crate::monitor::frame_period::FRAME_S;
use crate::monitor::report::Estimate;

/// Prior of the friction: mean and inverse variance of its logarithm, log-uniform from 0.2 to 1.3. The trees were
/// fitted to it.
const PRIOR_LOG_MU: f64 = -0.673;
const PRIOR_INFORMATION: f64 = 1.0 / (0.54 * 0.54);
/// The estimate of a frame is biased towards the prior. This factor limits the correction where a frame has little
/// information.
const MOST_STRETCH: f64 = 2.0;
/// Errors of consecutive frames are correlated: the frames within this time, s, count as one. A frame counts as
/// independent if the logarithm of its load differs by this much from that of the last independent frame, and that of
/// the frame before it did so in the same direction.
const CORRELATION_S: f64 = 0.4;
const INDEPENDENT_LOG_LOAD: f64 = 0.1;
/// Least information for the friction to be reported, and most from all frames together (0.2 of the friction): inverse
/// variance of its logarithm.
const MIN_INFORMATION: f64 = 2.0;
const MAX_INFORMATION: f64 = 25.0;
/// Weight of a frame after a regrip, and time in which it grows to that, s: the field then shows less slip than the
/// load has caused, and none right after the regrip.
const REGRIPPED_SHARE: f64 = 0.1;
const REGRIPPED_S: f64 = 0.2;
/// A grip whose logarithm has fallen by the first number since the field was restarted leaves squeeze and slip of the
/// larger contact in it. Each 1 beyond adds the second number, in quadrature, to the standard deviation of a frame's
/// log used fraction, up to a load of the third number times the grip force; under more load the effect decreases.
const GRIP_FALLEN_LOG: f64 = 1.0;
const GRIP_FALLEN_LOG_SD: f64 = 0.8;
const GRIP_FALLEN_PER_GRIP: f64 = 0.15;
/// When the load falls, slip of the rim under the larger load remains, and the used fraction seems larger than it is:
/// each 1 by which the logarithm of the load has fallen beyond the first number adds the second, in quadrature, to the
/// standard deviation of a frame's log used fraction.
const LOAD_FALLEN_LOG: f64 = 0.1;
const LOAD_FALLEN_LOG_SD: f64 = 1.0;
/// Standard deviation of the log friction from the load at which an object begins to slide.
const SLIDES_LOG_SD: f64 = 0.15;
/// This load is used once the slide has been detected in this many frames and for this time, s: a sudden drop of the
/// load, as when a bottle is set down, can look like a slide in two.
const SLIDES_FRAMES: u32 = 3;
const SLIDES_S: f64 = 0.05;
/// Standard deviation of the change of log mu for a change of 1 in the logarithm of the grip force: what
/// `gain` does not correct.
const DRIFT_LOG_SD: f64 = 0.2;
/// Upper bound of the friction: a grip released while the gel is still sheared could give any value.
const MOST_FRICTION: f64 = 3.0;
/// A held load is a lower bound of the friction, within the error of the load.
const LOAD_SURE: f64 = 0.95;
/// Standard deviation of load over grip force without load: a residual of squeeze and rolling.
const LOAD_NOISE_PER_GRIP: f64 = 0.01;

/// Shrinks the used fraction of a frame with less information than the prior towards the prior; returns its logarithm,
/// and itself.
fn lean(log_load: f64, log_sd: f64, used: Estimate) -> (f64, Estimate) {
    let log_used = libm::log(used.value.max(1e-3));
    let of_frame = 1.0 / (PRIOR_INFORMATION * log_sd * log_sd);
    if of_frame >= 1.0 {
        return (log_used, used);
    }
    let log_used = of_frame * log_used + (1.0 - of_frame) * (log_load - PRIOR_LOG_MU);
    (log_used, Estimate { value: libm::exp(log_used), ..used })
}

/// Data of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrictionSample {
    /// Time, s.
    pub at_s: f64,
    /// Load over grip force.
    pub per_grip: f64,
    /// Grip force, N.
    pub grip_n: f64,
    /// Load at gross slip over mu P.
    pub gain: f64,
    /// Whether the imprint slides over the gel: a load that falls meanwhile does not count as fallen.
    pub imprint_slides: bool,
    /// Standard deviation of the logarithm of the used fraction.
    pub log_used_sd: f64,
}

/// Onset of a slide, and its duration.
#[derive(Debug, Clone, Copy)]
struct SlideStart {
    log_load: f64,
    log_grip: f64,
    since_s: f64,
    frames_count: u32,
    is_taken: bool,
}

/// Friction accumulated over a contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Friction {
    log_mu: f64,
    /// Its inverse variance from frames alone; 0 while no frame has given information.
    information: f64,
    /// Logarithm of the grip force at which it was estimated.
    log_grip: f64,
    /// Logarithm of load over grip force of the last independent frame, and the difference of the last frame from it.
    independent_log_load: Option<f64>,
    last_change: f64,
    /// Logarithms of the largest grip force and of the largest load, N, since the field was restarted.
    most_log_grip: Option<f64>,
    most_log_load_n: Option<f64>,
    /// Logarithms of load over grip force (divided by `gain`) and of grip force in the last frame.
    last_log_load_grip: Option<(f64, f64)>,
    /// Time of the last regrip under load, s, from which slip is counted again, and time of the last frame.
    regripped_s: Option<f64>,
    now_s: f64,
    /// Time of the last frame, once there is one.
    seen_s: Option<f64>,
    /// The current slide.
    slide: Option<SlideStart>,
}

impl Friction {
    /// The grip has grown under load: the field restarts from here.
    pub fn regripped(&mut self) {
        self.regripped_s = Some(self.now_s).filter(|_| self.information > 0.0);
        self.most_log_grip = None;
        self.slip_counts_anew();
    }

    /// The field restarts from here under a lighter grip: the squeeze of the firmer one remains in the motion of the
    /// contact.
    pub fn slip_counts_anew(&mut self) {
        self.most_log_load_n = None;
    }

    /// Sets whether the object slides in the last frame. In the first frame of a slide all of the friction is used.
    pub fn set_slides(&mut self, slides: bool) {
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

    /// Inverse variance of log mu from frames, as far as it holds at a grip force.
    fn information_at(&self, log_grip: f64) -> f64 {
        let drift = DRIFT_LOG_SD * (log_grip - self.log_grip);
        self.information / (1.0 + self.information * drift * drift)
    }

    /// Whether a frame is independent; a single one that differs may be a wrong reading.
    fn is_independent(&mut self, log_load: f64) -> bool {
        let change = log_load - *self.independent_log_load.get_or_insert(log_load);
        let before = std::mem::replace(&mut self.last_change, change);
        let independent =
            change.abs() >= INDEPENDENT_LOG_LOAD && before.abs() >= INDEPENDENT_LOG_LOAD && change * before > 0.0;
        if independent {
            self.independent_log_load = Some(log_load);
        }
        independent
    }

    /// Adds the log mu of a frame; `log_sd` is its standard deviation with the prior included.
    fn take(&mut self, log_mu: f64, log_sd: f64, share: f64, log_grip: f64) {
        let of_frame = 1.0 / (log_sd * log_sd);
        let beyond = of_frame - PRIOR_INFORMATION;
        if beyond <= 0.0 || share <= 0.0 {
            return;
        }
        let own_log_mu = PRIOR_LOG_MU + (log_mu - PRIOR_LOG_MU) * (of_frame / beyond).min(MOST_STRETCH);
        let information = share * beyond;
        let newest = information / (self.information_at(log_grip) + information);
        self.log_mu += newest * (own_log_mu - self.log_mu);
        self.log_grip += newest * (log_grip - self.log_grip);
        self.information = (self.information + information).min(MAX_INFORMATION);
    }

    /// Takes grip force and load of a frame into the largest ones. Returns how far the logarithms of both have fallen
    /// since, beyond what counts.
    fn update_maxima(&mut self, sample: &FrictionSample, log_grip: f64) -> (f64, f64) {
        let most_log_grip = self.most_log_grip.map_or(log_grip, |most| most.max(log_grip));
        self.most_log_grip = Some(most_log_grip);
        let log_load_n = libm::log((sample.per_grip * sample.grip_n).max(1e-6));
        let most_log_load_n = self.most_log_load_n.map_or(log_load_n, |most| most.max(log_load_n));
        self.most_log_load_n = Some(most_log_load_n);
        let load_fallen =
            if sample.imprint_slides { 0.0 } else { (most_log_load_n - log_load_n - LOAD_FALLEN_LOG).max(0.0) };
        ((most_log_grip - log_grip - GRIP_FALLEN_LOG).max(0.0), load_fallen)
    }

    /// Weight of a frame, `elapsed_s` after the last, in the friction. `seen`: share of the slip that its field shows,
    /// where it does not show all of it.
    fn frame_weight(&mut self, log_load: f64, elapsed_s: f64, seen: Option<f64>) -> f64 {
        let own = if self.is_independent(log_load) { 1.0 } else { (elapsed_s / CORRELATION_S).min(1.0) };
        own * seen.map_or(1.0, |seen| REGRIPPED_SHARE * seen)
    }

    /// Adds a frame. Returns the friction, once there is enough information, and `used` combined with what was known
    /// before.
    pub fn see(&mut self, sample: &FrictionSample, used: Estimate) -> (Option<Estimate>, Estimate) {
        let load = (sample.per_grip / sample.gain).max(1e-6);
        let (log_load, log_grip) = (libm::log(load), libm::log(sample.grip_n.max(0.1)));
        self.last_log_load_grip = Some((log_load, log_grip));
        let (grip_fallen, load_fallen) = self.update_maxima(sample, log_grip);
        let left_log_sd = GRIP_FALLEN_LOG_SD * grip_fallen * (GRIP_FALLEN_PER_GRIP / load).min(1.0);
        let log_used_sd = libm::hypot(sample.log_used_sd, libm::hypot(left_log_sd, LOAD_FALLEN_LOG_SD * load_fallen));
        let (log_used, used) = lean(log_load, log_used_sd, used);
        let elapsed_s = self.seen_s.map(|seen_s| sample.at_s - seen_s).filter(|s| *s > 0.0).unwrap_or(FRAME_S);
        (self.now_s, self.seen_s) = (sample.at_s, Some(sample.at_s));
        let seen = self.regripped_s.map(|regripped_s| ((self.now_s - regripped_s) / REGRIPPED_S).clamp(0.0, 1.0));
        let seen = seen.or(Some(1.0).filter(|_| (grip_fallen > 0.0 || load_fallen > 0.0) && self.information > 0.0));
        // A frame without new motion gives no new information.
        if used.age_frames == 0 {
            let weight = self.frame_weight(log_load, elapsed_s, seen);
            let log_sd = libm::hypot(log_used_sd, LOAD_NOISE_PER_GRIP / sample.per_grip.max(1e-6));
            self.take(log_load - log_used, log_sd, weight, log_grip);
        }
        let information = self.information_at(log_grip);
        let log_mu = (information * self.log_mu + PRIOR_INFORMATION * PRIOR_LOG_MU) / (information + PRIOR_INFORMATION);
        // For this frame alone: a single grip reading that is too low must not raise the friction for good.
        let value = libm::exp(log_mu).max(LOAD_SURE * load).min(MOST_FRICTION);
        let known = Estimate { value, sd: value * (information + PRIOR_INFORMATION).recip().sqrt(), age_frames: 0 };
        let friction = Some(known).filter(|_| information >= MIN_INFORMATION);
        let Some(seen) = seen else { return (friction, used) };
        let (value, sd) = combine((log_used, log_used_sd), (log_load - libm::log(value), information), seen);
        (friction, Estimate { value, sd, ..used })
    }
}

/// The used fraction and its standard deviation, from that of a frame (logarithm and its standard deviation) and that by
/// memory (logarithm and information). `seen`: share of the slip that the field of the frame shows.
fn combine(frame: (f64, f64), memory: (f64, f64), seen: f64) -> (f64, f64) {
    let ((log_used, log_used_sd), (remembered_log_used, information)) = (frame, memory);
    let of_frame = seen / (log_used_sd * log_used_sd);
    let of_memory = information + (1.0 - seen) * PRIOR_INFORMATION;
    let all = of_frame + of_memory;
    let value = libm::exp((of_frame * log_used + of_memory * remembered_log_used) / all).min(MAX_USED);
    (value, value * all.recip().sqrt())
}

#[cfg(test)]
mod tests;
