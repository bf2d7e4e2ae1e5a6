//! Step 6: displacement of all markers -> shear load, stick ratio, slip margin, friction, each with its error.
//!
//! ```text
//!   all markers --sum--> F, T          contact --robust fit--> r: motion of those that stick
//!        |                                |                       |
//!        +------------> dimensionless features of (F, T, r, s) <--+    s = measured - r
//!                                |
//!                  boosted trees, fitted to the contact simulator  -> f = load over load at gross slip, phi = stick ratio
//!                                |
//!                  friction mu = F / (f P), gathered over the frames of a contact (friction.rs)
//! ```
//!
//! On a bonded layer, the sum over all markers is the load whatever the shape of the contact: the compliance to a
//! uniform traction is h/G (docs/simulator.md). The load shows how much friction is demanded, the lag of the rim how
//! much is left; both together give the friction.

mod features;
mod field;
mod friction;
mod grip;
mod indentation;
mod last_motion;
mod load;
mod prediction;
mod reference;
mod rigid_fit;
mod window;

pub use features::{FEATURE_NAMES, FEATURES_COUNT, Features, GEOMETRIC_COUNT};
pub(super) use features::{LOAD, NARROW, TURNING, WIDE};

use crate::monitor::frame_period::frame_period_s;
use crate::monitor::report::{Estimate, Estimates, Marker};
use crate::plane::{RigidMotion, Vec2};
use crate::port::GripSample;
use crate::sensor::Sensor;
use field::{FieldFacts, FieldMeasures};
use friction::{Friction, FrictionSample};
use grip::Grip;
use indentation::{half_width_px, indentation_gain};
use last_motion::{HeldEstimate, LastMotion};
use load::{Load, Middle};
pub use prediction::EstimateTrees;
use prediction::{MAX_USED, Trees};
use reference::{Reference, Regrip};
use rigid_fit::Point;
use std::sync::Arc;
use window::{Sample, Stretches, Window};

/// Fewest markers in contact for an estimate.
const LEAST_POINTS: usize = 4;
/// Width of the surrounding gel that a sticking patch drags along: 0.64 of a layer of 3 mm, in mm, and in pitches where
/// the pitch in mm is unknown.
const DRAG_WIDTH_MM: f64 = 1.92;
const DRAG_WIDTH_PITCH: f64 = 1.28;
/// Load over grip force above which the finger counts as loaded, even if grip and area have not settled.
const LOADED_FRACTION: f64 = 0.2;
/// Load over grip force below which a lighter grip leaves squeeze but hardly any slip: a third of what a friction of
/// 0.25 holds.
const HARDLY_PULLED_FRACTION: f64 = 0.08;
/// Relative error of force and torque from the sum over all markers: on gels, objects and a camera never tuned to they
/// are off by 4.5 and 7.5 % RMS (bench/eval.md, physics never used in tuning).
const LOAD_SD_FRACTION: f64 = 0.08;
/// Error of both at no load. On simulated ramps: 0.02 N below 0.5 N and 0.3 N mm below 2 N mm, RMS.
const LEAST_SHEAR_SD_N: f64 = 0.05;
const LEAST_TORQUE_SD_NMM: f64 = 0.3;

/// Lower bound of the friction: wet or oily glass on silicone. On a more slippery object slip is reported later, at
/// 0.25 / mu of the usual load.
const LEAST_FRICTION: f64 = 0.25;

/// Step 6, with its memory of the contact.
#[derive(Debug, Clone)]
pub(super) struct Estimator {
    pitch_px: f64,
    drag_width_px: f64,
    mm_per_px: Option<f64>,
    /// Shear stiffness, N per px of displacement and px2 of area.
    stiffness_n_per_px3: Option<f64>,
    inside: (Vec2, Vec2),
    trees: Arc<Trees>,
    reference: Reference,
    window: Window,
    stretches: Stretches,
    last_motion: LastMotion,
    points: Vec<Point>,
    scratch: Vec<f64>,
    motion: Option<RigidMotion>,
    stiffest_px2: f64,
    grip: Grip,
    /// Whether the margin of the last frame was based on the grip force.
    knew_grip: bool,
    time_s: f64,
    last_ns: Option<u64>,
    load: Load,
    middle: Middle,
    friction: Friction,
    counts_from_rest: bool,
    imprint_slides: bool,
    pub(super) estimates: Estimates,
    pub(super) features: Option<Features>,
    /// Load in the plane, and torque over the mean radius of the contact, in the same unit.
    load_px3: (Vec2, f64),
    /// The torque as an equivalent force: that which moves the contact as far as the torque moves its points on
    /// average, see [`FieldMeasures::lever_px`].
    turning_px3: f64,
}

/// Load and contact in a frame.
struct FrameLoad {
    force_px3: Vec2,
    /// The reported torque.
    torque_px4: f64,
    /// Force and moment combined, see [`FieldMeasures::load_px3`].
    load_px3: f64,
    /// Middle of the contact, px.
    middle: Vec2,
    /// See [`Load::lever_gain`].
    lever_gain: f64,
    /// Area of the contact, including the part out of view.
    area_px2: f64,
}

/// Reads the shipped trees, once per process: later monitors do not wait for them.
pub(super) fn read_trees() {
    prediction::shipped();
}

impl Estimator {
    pub fn new(sensor: &Sensor, markers: &[Marker], starts_in_contact: bool) -> Self {
        let (mut low, mut high) = (Vec2::new(f64::MAX, f64::MAX), Vec2::new(f64::MIN, f64::MIN));
        for m in markers {
            (low.x, low.y) = (low.x.min(m.rest.x), low.y.min(m.rest.y));
            (high.x, high.y) = (high.x.max(m.rest.x), high.y.max(m.rest.y));
        }
        let p = Vec2::new(sensor.pitch_px, sensor.pitch_px);
        let inside = (low + p * 0.6, high - p * 0.6);
        let drag_width_px = sensor.mm_per_px().map_or(DRAG_WIDTH_PITCH * sensor.pitch_px, |mm| DRAG_WIDTH_MM / mm);
        Estimator {
            pitch_px: sensor.pitch_px,
            drag_width_px,
            mm_per_px: sensor.mm_per_px(),
            stiffness_n_per_px3: sensor.shear_stiffness_n_per_px3(),
            inside,
            trees: prediction::shipped(),
            reference: Reference::new(markers),
            window: Window::new(),
            stretches: Stretches::default(),
            last_motion: LastMotion::default(),
            points: Vec::with_capacity(markers.len()),
            scratch: vec![0.0; markers.len()],
            motion: None,
            stiffest_px2: 0.0,
            grip: Grip::default(),
            knew_grip: false,
            time_s: 0.0,
            last_ns: None,
            load: Load::new(sensor, markers, drag_width_px, inside),
            middle: Middle::default(),
            friction: Friction::default(),
            counts_from_rest: starts_in_contact,
            imprint_slides: false,
            estimates: Estimates::default(),
            features: None,
            load_px3: (Vec2::ZERO, 0.0),
            turning_px3: 0.0,
        }
    }

    /// Whether the reference of displacement under load is taken: the finger has been squeezed.
    pub fn has_reference(&self) -> bool {
        self.reference.is_taken()
    }

    /// Whether the margin is based on grip force and stiffness, not on images alone.
    pub fn knows_grip(&self) -> bool {
        self.stiffness_n_per_px3.is_some() && self.grip.mean_n().is_some_and(|n| n > 0.0)
    }

    /// Load of the last frame as two forces: in the plane, and the torque as an equivalent force.
    pub fn pull_and_turn_px3(&self) -> (Vec2, f64) {
        (self.load_px3.0, self.turning_px3)
    }

    /// Of the last frame: its time, s since the contact began; load and torque combined; the mean grip force where
    /// known, N.
    pub fn load_now(&self) -> (f64, f64, Option<f64>) {
        let (force, torque) = self.load_px3;
        (self.time_s, libm::hypot(force.length(), torque), self.grip.mean_n())
    }

    /// Resets after contact is lost.
    pub fn clear(&mut self) {
        self.reference.clear();
        self.window.clear();
        self.stretches.clear();
        self.last_motion.clear();
        self.motion = None;
        self.stiffest_px2 = 0.0;
        self.grip.clear();
        self.knew_grip = false;
        (self.time_s, self.last_ns) = (0.0, None);
        self.load.clear();
        self.middle = Middle::default();
        self.friction = Friction::default();
        self.counts_from_rest = false;
        (self.estimates, self.features) = (Estimates::default(), None);
        (self.load_px3, self.turning_px3) = ((Vec2::ZERO, 0.0), 0.0);
    }

    /// Uses other trees from here on.
    pub fn set_trees(&mut self, trees: &EstimateTrees) {
        self.trees = trees.0.clone();
    }

    /// Sets whether the imprint of the next frame slides over the gel.
    pub fn set_imprint_slides(&mut self, slides: bool) {
        self.imprint_slides = slides;
    }

    /// Sets whether the object slides as a whole in the last frame.
    pub fn set_slides(&mut self, slides: bool) {
        self.friction.set_slides(slides);
    }

    /// All displacement from rest counts as load until contact is lost: for a contact that the image does not show.
    pub fn count_from_rest(&mut self) {
        self.counts_from_rest = true;
    }

    /// Passes over a frame in which too little of the contact is visible.
    pub fn skip(&mut self, time_ns: Option<u64>) {
        (self.estimates, self.features) = (Estimates::default(), None);
        self.pass_time(time_ns);
    }

    /// Evaluates a frame in contact.
    pub fn see(
        &mut self,
        time_ns: Option<u64>,
        grip: Option<GripSample>,
        area_px2: f64,
        middle_px: Option<Vec2>,
        markers: &[Marker],
    ) {
        (self.estimates, self.features) = (Estimates::default(), None);
        let elapsed_s = self.pass_time(time_ns);
        self.grip.take(grip, elapsed_s, self.reference.is_taken());
        self.load.sum(elapsed_s, markers);
        self.estimates.cut_fraction = self.load.cut_fraction();
        self.window.push(Sample {
            at_s: self.time_s,
            grip_n: self.grip.reading_n(),
            area_px2,
            rigid_px: self.window.newest().map_or(0.0, |s| s.rigid_px),
        });
        let stiffness_over_grip =
            self.stiffness_n_per_px3.zip(self.grip.mean_n().filter(|n| *n > 0.0)).map(|(k, grip_n)| k / grip_n);
        self.take_reference(elapsed_s, stiffness_over_grip, markers);
        if !self.reference.is_taken() {
            return;
        }
        let growth = self.reference.growth(self.grip.last_mean_n());
        if let Some(middle_px) = middle_px {
            let (sum, count) = touched(markers).fold((Vec2::ZERO, 0u32), |(s, n), m| (s + m.now_from_rest(), n + 1));
            let moved = sum / f64::from(count.max(1));
            self.reference.roll(elapsed_s, middle_px - moved, self.pitch_px, markers);
        }
        self.gather_points(growth, markers);
        if self.points.len() < LEAST_POINTS {
            return;
        }
        let Some(motion) = self.fit_motion(elapsed_s, growth, markers) else { return };
        let middle = motion.reference;
        let force_px3 = self.load.force_px3(self.grip.last_mean_n());
        let hidden_px2 = self.load.hidden_px2();
        let whole_px2 = area_px2 + hidden_px2;
        let reference = &self.reference;
        let moment_px4 = self.load.moment_px4(markers, middle, |m| reference.under_load(m, growth));
        let facts = FieldFacts {
            pitch_px: self.pitch_px,
            area_px2: whole_px2,
            hidden_fraction: hidden_px2 / whole_px2.max(1.0),
            drag_width_px: self.drag_width_px,
            force_px3,
            moment_px4,
            stiffness_over_grip_per_px3: stiffness_over_grip,
            inside: self.inside,
            before: self.window.oldest().copied(),
            stiffest_px2: self.stiffest_px2,
        };
        let measures = field::features(&mut self.points, &motion, &facts, &mut self.stretches, &mut self.scratch);
        self.stiffest_px2 = self.stiffest_px2.max(measures.secant_px2.unwrap_or(0.0));
        if let Some(sample) = self.window.newest_mut() {
            sample.rigid_px = measures.rigid_px;
        }
        self.apply_regrip(&measures, stiffness_over_grip);
        self.features = Some(measures.features);
        self.load_px3 = (force_px3, measures.arm_px.recip() * moment_px4);
        self.turning_px3 = moment_px4 / measures.lever_px;
        let torque_px4 = self.torque_px4(elapsed_s, middle_px, markers, growth);
        let lever_gain = if hidden_px2 > 0.0 { self.load.lever_gain(markers, middle) } else { 1.0 };
        let load_px3 = measures.load_px3;
        self.estimate(
            &measures,
            &FrameLoad { force_px3, torque_px4, load_px3, middle, lever_gain, area_px2: whole_px2 },
        );
    }

    /// Takes the reference of displacement under load, if it is not taken yet and the finger is squeezed.
    fn take_reference(&mut self, elapsed_s: f64, stiffness_over_grip: Option<f64>, markers: &[Marker]) {
        if self.reference.is_taken() {
            return;
        }
        if self.counts_from_rest {
            self.reference.take_rest(self.grip.mean_n(), markers);
            return;
        }
        let loaded = stiffness_over_grip.is_some_and(|k| k * self.load.sum_px3.length() > LOADED_FRACTION);
        self.reference.follow(elapsed_s, &self.window, loaded, markers);
        if self.reference.is_taken() {
            let (reference, grip_n) = (&self.reference, self.reference.taken_grip_n());
            let per_grip = self.stiffness_n_per_px3.zip(grip_n).map(|(k, grip_n)| k / grip_n);
            self.load.subtract_squeeze(|m| reference.squeeze(m), markers, grip_n, per_grip);
        }
    }

    /// The markers in contact, each with its displacement under load.
    fn gather_points(&mut self, growth: f64, markers: &[Marker]) {
        self.points.clear();
        for m in touched(markers) {
            let displacement = self.reference.under_load(m, growth);
            let joined = self.reference.joined(m);
            self.points.push(Point { id: m.id, rest: m.rest, displacement, joined, ..Point::default() });
        }
    }

    /// The motion of the markers that stick, about the middle of the contact, and from it the rigid displacement of
    /// each point; None where it cannot be fitted.
    fn fit_motion(&mut self, elapsed_s: f64, growth: f64, markers: &[Marker]) -> Option<RigidMotion> {
        let fitted = rigid_fit::fit(&self.points, self.motion.as_ref(), self.pitch_px)?;
        let middle = self.points.iter().fold(Vec2::ZERO, |sum, q| sum + q.rest) / self.points.len() as f64;
        let motion = RigidMotion { reference: middle, translation: fitted.displacement(middle), ..fitted };
        let tabulated = motion.tabulated();
        for m in markers.iter().filter(|m| m.whole && m.matched) {
            let under_load = self.reference.under_load(m, growth);
            self.reference.keep(elapsed_s, m, || under_load - tabulated.displacement(m.rest));
        }
        for point in &mut self.points {
            point.rigid = tabulated.displacement(point.rest);
            point.radius = (point.rest - middle).length();
        }
        self.motion = Some(motion);
        Some(motion)
    }

    /// After a change of the grip, what was learned of slip and stiffness counts from here on.
    fn apply_regrip(&mut self, measures: &FieldMeasures, stiffness_over_grip: Option<f64>) {
        let hardly_pulled = stiffness_over_grip.is_some_and(|k| k * measures.load_px3 < HARDLY_PULLED_FRACTION);
        let Some(way) = self.reference.regripped(self.grip.mean_n(), hardly_pulled) else { return };
        match way {
            Regrip::Harder => self.friction.regripped(),
            Regrip::Lighter => self.friction.slip_counts_anew(),
        }
        self.stretches.restart(measures.load_px3, measures.rigid_px);
        self.last_motion.regripped();
        for point in &self.points {
            self.reference.count_anew(point.id, point.residual());
        }
    }

    /// The reported torque, about the middle of the contact.
    fn torque_px4(&mut self, elapsed_s: f64, middle_px: Option<Vec2>, markers: &[Marker], growth: f64) -> f64 {
        let mean = |of: &dyn Fn(&Point) -> Vec2| {
            self.points.iter().fold(Vec2::ZERO, |sum, q| sum + of(q)) / self.points.len() as f64
        };
        let moved = mean(&|q| q.displacement);
        let of_markers = mean(&|q| markers[q.id as usize].now) - moved;
        let about = self.middle.see(elapsed_s, of_markers, middle_px.map(|middle_px| middle_px - moved));
        self.load.torque_px4(markers, about, |m| self.reference.under_load(m, growth))
    }

    /// Time since the last frame.
    fn pass_time(&mut self, time_ns: Option<u64>) -> f64 {
        let elapsed_s = frame_period_s(self.last_ns, time_ns).min(1.0);
        self.last_ns = time_ns;
        self.time_s += elapsed_s;
        elapsed_s
    }

    /// Ratio of the load at gross slip to mu P: that of an object that has sunk in ([`indentation_gain`]), times that of a
    /// contact that extends out of view ([`Load::lever_gain`]).
    fn gain(&self, stiffness_n_per_px3: f64, grip_n: f64, seen: &FrameLoad) -> f64 {
        let force_px3 = seen.force_px3.length();
        let along = seen.force_px3 / force_px3.max(1e-9);
        let half_width_px = half_width_px(self.points.iter().map(|q| q.rest), seen.middle, along);
        let shear_px = grip_n / (stiffness_n_per_px3 * seen.area_px2.max(1.0));
        let load_px3 = seen.load_px3.max(1e-9);
        // With the longer lever, the torque counts as a smaller force.
        let turning2 = (load_px3 * load_px3 - force_px3 * force_px3).max(0.0);
        let less2 = turning2 * (1.0 - 1.0 / (seen.lever_gain * seen.lever_gain));
        let whole_px3 = (load_px3 * load_px3 - less2).max(1e-18).sqrt();
        indentation_gain(shear_px, half_width_px, force_px3 / load_px3) * (load_px3 / whole_px3)
    }

    fn estimate(&mut self, measures: &FieldMeasures, seen: &FrameLoad) {
        let features = &measures.features;
        let load_px3 = seen.load_px3;
        let knows_grip = self.knows_grip();
        let prediction = if knows_grip { self.trees.with_grip(features) } else { self.trees.alone(features) };
        let load = if knows_grip { load_px3 / self.grip.mean_n().unwrap_or(1.0) } else { load_px3 };
        if knows_grip != std::mem::replace(&mut self.knew_grip, knows_grip) {
            self.last_motion.load_is(load);
        }
        let floor_px = field::FLOOR_PITCH * self.pitch_px;
        let HeldEstimate { prediction, age_frames } =
            self.last_motion.see(prediction, load, measures.rigid_px, floor_px);
        let mut used = Estimate { value: prediction.used.clamp(0.0, MAX_USED), sd: prediction.used_sd, age_frames };
        let stick = Estimate { value: prediction.stick.clamp(0.0, 1.0), sd: prediction.stick_sd, age_frames };
        if let (Some(k), Some(grip_n)) = (self.stiffness_n_per_px3, self.grip.mean_n().filter(|n| *n > 0.0)) {
            let per_grip = k * load_px3 / grip_n;
            // Rolling and settling make the rim lag, too, but at a small load nothing slides.
            used.value = used.value.min(per_grip / LEAST_FRICTION);
            let log_used_sd = prediction.log_used_sd.unwrap_or(used.sd / used.value.max(1e-3));
            let sample = FrictionSample {
                at_s: self.time_s,
                per_grip,
                grip_n,
                gain: self.gain(k, grip_n, seen),
                imprint_slides: self.imprint_slides,
                log_used_sd,
            };
            (self.estimates.friction, used) = self.friction.see(&sample, used);
        }
        if let Some((k, mm)) = self.stiffness_n_per_px3.zip(self.mm_per_px) {
            let force_n = k * seen.force_px3.length();
            let torque_nmm = k * seen.torque_px4 * mm;
            self.estimates.shear_n =
                Some(Estimate { value: force_n, sd: LOAD_SD_FRACTION * force_n + LEAST_SHEAR_SD_N, age_frames: 0 });
            self.estimates.torque_nmm = Some(Estimate {
                value: torque_nmm,
                sd: LOAD_SD_FRACTION * torque_nmm.abs() + LEAST_TORQUE_SD_NMM,
                age_frames: 0,
            });
        }
        self.estimates.stick_ratio = Some(stick);
        self.estimates.margin = Some(Estimate { value: 1.0 - used.value, sd: used.sd, age_frames });
    }
}

/// Markers in contact that were found whole.
fn touched(markers: &[Marker]) -> impl Iterator<Item = &Marker> {
    markers.iter().filter(|m| m.in_contact && m.whole && m.matched)
}

#[cfg(test)]
mod tests;
