//! When the object begins to slide as a whole.

use crate::contact::{Finger, Pose};
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;

/// The first substep of gross slip, as [`GROSS_FRICTION_FRACTION`](crate::contact::GROSS_FRICTION_FRACTION) defines it.
/// On a curved path, where friction lags behind the motion and never does its largest possible work, the first of two
/// frames in which hardly any cell sticks. At the latest the substep in which a pulled object runs off. Only substeps
/// after the start of the load count: while pressing, the first cells may slip although nothing slides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gross {
    /// When, on the clock of the frames, in s.
    pub time_s: f64,
    /// The load at that time; f of a frame is its load over this one, scaled to the grip of the frame.
    pub load: f64,
    /// Normal force of the finger at that time, in N.
    pub grip_force_n: f64,
    /// Pose of the object.
    pub pose: Pose,
}

/// Frame times are whole nanoseconds, those of gross slip sums of substeps: one that begins in a frame's own substep may
/// differ from its time by the rounding of both, s.
const SAME_TIME_S: f64 = 1e-6;

impl Gross {
    /// Whether the frame of this time shows gross slip, or comes after it.
    pub fn is_shown_at(&self, time_s: f64) -> bool {
        time_s >= self.time_s - SAME_TIME_S
    }
}

/// Stick ratio up to which hardly any cell sticks, and the duration of that which is gross slip, s: two frames at 30 Hz,
/// in which the load of a ramp of 2 s grows by more than is missing to the largest work.
pub(crate) const FULL_SLIP_STICK_RATIO: f64 = 0.05;
const FULL_SLIP_S: f64 = 2.0 / 30.0;

/// A pulled object runs off when its rim moves this far in this time, mm: gel that is sheared within 0.4 s moves by less.
const RUNAWAY_MM: f64 = 1.5;
const RUNAWAY_S: f64 = 1.0 / 30.0;
const RIM_MM: f64 = 5.0;

/// Detects gross slip.
#[derive(Debug, Clone)]
pub(super) struct GrossWatch {
    load_from_s: Option<f64>,
    pulled: bool,
    may_bend: bool,
    /// Poses in the substeps of the last [`RUNAWAY_S`], the oldest first.
    poses: Vec<Pose>,
    /// Number of substeps in [`FULL_SLIP_S`].
    full_slip_count: u32,
    /// Start of the interval in which hardly any cell sticks, and its number of substeps.
    full_slip: Option<(Gross, u32)>,
    found: Option<Gross>,
    friction_used: Option<f64>,
}

impl GrossWatch {
    /// `pulled`: whether the load moves the object. `may_bend`: whether on a curved path.
    pub fn new(load_from_s: Option<f64>, pulled: bool, may_bend: bool, substep_s: f64) -> Self {
        let substeps = |seconds_s: f64| (seconds_s / substep_s).round();
        GrossWatch {
            load_from_s,
            pulled,
            may_bend,
            poses: vec![Pose::default(); substeps(RUNAWAY_S) as usize],
            full_slip_count: substeps(FULL_SLIP_S) as u32,
            full_slip: None,
            found: None,
            friction_used: None,
        }
    }

    pub fn found(&self) -> Option<Gross> {
        self.found
    }

    /// Share of the friction that was used in the last substep; None without contact, motion or load.
    pub fn friction_used_fraction(&self) -> Option<f64> {
        self.friction_used
    }

    /// Processes a substep; whether gross slip was found in it. On a bend it began [`FULL_SLIP_S`] before.
    pub fn see(&mut self, finger: &Finger, path_s: f64, time_s: f64, load: f64) -> bool {
        let truth = finger.truth();
        let loaded = self.load_from_s.is_some_and(|from_s| path_s > from_s + 1e-9) && load > 0.0;
        self.friction_used = if loaded { truth.friction_used_fraction } else { None };
        let began = std::mem::replace(&mut self.poses[0], truth.pose);
        self.poses.rotate_left(1);
        if !loaded || self.found.is_some() {
            return false;
        }
        let shift_mm = (truth.pose.position_mm - began.position_mm).length();
        let rim_mm = shift_mm + RIM_MM * (truth.pose.turn_rad - began.turn_rad).abs();
        let is_runaway = self.pulled && rim_mm >= RUNAWAY_MM;
        let now = Gross { time_s, load, grip_force_n: truth.grip_force_n, pose: truth.pose };
        let is_full_slip =
            self.may_bend && truth.stick_ratio.is_some_and(|stick_ratio| stick_ratio <= FULL_SLIP_STICK_RATIO);
        self.full_slip = is_full_slip.then(|| self.full_slip.map_or((now, 1), |(since, count)| (since, count + 1)));
        let since = self.full_slip.filter(|(_, count)| *count >= self.full_slip_count).map(|(since, _)| since);
        self.found = if truth.slides_as_a_whole() || is_runaway { Some(now) } else { since };
        self.found.is_some()
    }
}

/// Motion of an object over one finger since a pose, weighted by the friction bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sliding {
    /// Largest friction, in N: the sum of the bounds.
    pub most_n: f64,
    /// Distance moved, in mm: the mean over the contact, each cell weighted by its friction bound.
    pub way_mm: f64,
    /// Middle of the contact, with the same weights, in mm on the gel.
    pub middle_mm: Vec2,
    /// Mean distance from there, with the same weights, in mm: the lever of friction against rotation.
    pub arm_mm: f64,
}

impl Sliding {
    /// None without contact. Rotation counts at the lever of every cell.
    pub fn since(finger: &Finger, before: Pose) -> Option<Self> {
        let grid = finger.settings().grid;
        let now = finger.truth().pose;
        let (shift_mm, turn_rad) = (now.position_mm - before.position_mm, now.turn_rad - before.turn_rad);
        let skin_mm = |cell: usize| grid.centre_mm(cell) + finger.displacement(cell).shift_mm;
        let (mut most, mut whole, mut moment) = (0.0, 0.0, Vec2::ZERO);
        for (cell, bound_mpa) in loaded(finger) {
            let lever_mm = skin_mm(cell) - before.position_mm;
            let way_mm = shift_mm + Vec2::new(-lever_mm.y, lever_mm.x) * turn_rad;
            most += bound_mpa * way_mm.length();
            whole += bound_mpa;
            moment += skin_mm(cell) * bound_mpa;
        }
        if whole <= 0.0 {
            return None;
        }
        let middle_mm = moment / whole;
        let arm: f64 = loaded(finger).map(|(cell, bound_mpa)| bound_mpa * (skin_mm(cell) - middle_mm).length()).sum();
        Some(Sliding { most_n: whole * grid.cell_area_mm2(), way_mm: most / whole, middle_mm, arm_mm: arm / whole })
    }
}

impl Sliding {
    /// For two fingers, the second rotated relative to the first: friction and distance as the mean per finger, the
    /// middle of both, in the axes of the first. None without contact.
    pub fn of_both(each: [Option<Self>; 2], turn_rad: f64) -> Option<Self> {
        let [Some(a), Some(b)] = each else { return each[0].or(each[1]) };
        let (s, c) = libm::sincos(turn_rad);
        let middle_mm = Vec2::new(c * b.middle_mm.x - s * b.middle_mm.y, s * b.middle_mm.x + c * b.middle_mm.y);
        let share = a.most_n / (a.most_n + b.most_n);
        Some(Sliding {
            most_n: 0.5 * (a.most_n + b.most_n),
            way_mm: share * a.way_mm + (1.0 - share) * b.way_mm,
            middle_mm: a.middle_mm * share + middle_mm * (1.0 - share),
            arm_mm: share * a.arm_mm + (1.0 - share) * b.arm_mm,
        })
    }
}

/// The cells that can carry friction, and their bounds.
fn loaded(finger: &Finger) -> impl Iterator<Item = (usize, f64)> + '_ {
    finger.bound_mpa().iter().copied().enumerate().filter(|(_, bound_mpa)| *bound_mpa > 0.0)
}
