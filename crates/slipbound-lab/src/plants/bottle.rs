//! A bottle that is lifted off a table, filled in the air and pulled.
//!
//! ```text
//!      left | bottle | right      weight m g along X, inertia of the hand's own motion,
//!       [|| |  ~~~   | ||]        a few pulls in the plane of the pads
//!           |________|
//!   ========================= table
//! ```
//!
//! Filling and pulls are timed from the moment the bottle leaves the table.

use super::held::{ContactInput, HandState, HeldObject, Symmetry};
use super::support::{Feet, LOST_AFTER_MM, difference, sum, weight, weight_n};
use super::truth::{BottleTruth, ObjectTruth};
use crate::contact::{Drive, Inertia, Pose, Springs, Truth};
use crate::random::Random;
use serde::Serialize;
use slipbound::plane::Vec2;
use std::f64::consts::TAU;

/// Stiffness of the table under each side of the bottle, in N/mm. Estimate.
const TABLE_N_PER_MM: f64 = 50.0;

/// Distance of the table below the grip at the start, in mm. Assumed.
const ABOVE_TABLE_MM: f64 = 60.0;

/// Time constant with which the arm reaches its speed, in s: its drive starts at once, a mass does not. Estimate.
const ARM_LAG_S: f64 = 0.05;

/// Damping of a pull, in N s/mm, while it acts, as by a hand; as in the scene `ramp`. Estimate.
const PULL_DAMPING_N_S_PER_MM: f64 = 0.03;

/// Limit of a drawn pull as a share of the weight at that time: a grip that holds the weight with a small margin holds
/// the pull.
const PULL_OF_WEIGHT_FRACTION: f64 = 0.5;

/// A pull at the bottle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PullPulse {
    /// When it begins, in s since the bottle left the table.
    pub from_s: f64,
    /// How long it lasts, in s.
    pub lasts_s: f64,
    /// Its direction in the plane of the pads of the left finger, in rad; 0 is along gravity.
    pub direction_rad: f64,
    /// Its largest force, in N.
    pub peak_n: f64,
    /// Whether it rises and falls as half a sine; otherwise it is a step.
    pub swells: bool,
}

impl PullPulse {
    fn force_n(&self, since_s: f64) -> Vec2 {
        let share = (since_s - self.from_s) / self.lasts_s;
        if !(0.0..1.0).contains(&share) {
            return Vec2::ZERO;
        }
        let size_n = self.peak_n * if self.swells { libm::sin(0.5 * TAU * share) } else { 1.0 };
        let (s, c) = libm::sincos(self.direction_rad);
        Vec2::new(c, s) * size_n
    }
}

/// A bottle and the events of its run.
#[derive(Debug, Clone, PartialEq)]
pub struct BottleSettings {
    /// Mass on the table, in kg.
    pub start_kg: f64,
    /// Mass when it is full, in kg.
    pub most_kg: f64,
    /// Filling rate, in kg/s.
    pub fill_kg_per_s: f64,
    /// When filling begins, in s since the bottle left the table.
    pub fill_after_s: f64,
    /// The pulls.
    pub pulses: Vec<PullPulse>,
    /// Radius of gyration about the grip, in mm.
    pub gyration_radius_mm: f64,
    /// Radius of its bottom, in mm.
    pub radius_mm: f64,
}

impl BottleSettings {
    /// Mass at a time in s since it left the table.
    fn mass_kg(&self, since_s: f64) -> f64 {
        (self.start_kg + self.fill_kg_per_s * (since_s - self.fill_after_s).max(0.0))
            .min(self.most_kg.max(self.start_kg))
    }

    /// Draws pulls: steps or half sines of 50 to 200 ms and 2 to 10 N in any direction, each in its own part of the
    /// first 6 s. `peak_n` replaces the drawn force; without it a pull stays below half of the weight at that time.
    pub(crate) fn draw_pulses(&mut self, count: usize, peak_n: Option<f64>, random: &mut Random) {
        let part_s = 5.4 / count.max(1) as f64;
        for n in 0..count {
            let from_s = 0.6 + part_s * (n as f64 + random.between(0.1, 0.9));
            let (lasts_s, direction_rad) = (random.between(0.05, 0.2), random.between(0.0, TAU));
            let drawn_n = random.between(2.0, 10.0).min(PULL_OF_WEIGHT_FRACTION * weight_n(self.mass_kg(from_s)));
            let swells = random.fraction() < 0.5;
            self.pulses.push(PullPulse { from_s, lasts_s, direction_rad, peak_n: peak_n.unwrap_or(drawn_n), swells });
        }
    }
}

/// A bottle.
#[derive(Debug, Clone)]
pub struct Bottle {
    settings: BottleSettings,
    feet: Feet,
    time_s: f64,
    lowered_mm: f64,
    /// Speed of the hand as it acts on the bottle, in mm/s.
    speed_mm_per_s: f64,
    /// Motion in the last step.
    moved: Pose,
    pose: Pose,
    truth: BottleTruth,
}

impl Bottle {
    /// A bottle on its table.
    pub fn new(settings: BottleSettings) -> Self {
        let feet_mm = [1.0, -1.0].map(|side| Vec2::new(ABOVE_TABLE_MM, side * settings.radius_mm));
        // It stands at 0 with the table compressed by its weight.
        let gives_mm = 0.5 * weight_n(settings.start_kg) / TABLE_N_PER_MM;
        let feet = Feet { feet_mm, stiffness_n_per_mm: TABLE_N_PER_MM, ground_mm: ABOVE_TABLE_MM - gives_mm };
        let truth =
            BottleTruth { mass_kg: settings.start_kg, table_n: weight_n(settings.start_kg), ..BottleTruth::default() };
        Bottle {
            feet,
            time_s: 0.0,
            lowered_mm: 0.0,
            speed_mm_per_s: 0.0,
            moved: Pose::default(),
            pose: Pose::default(),
            truth,
            settings,
        }
    }

    /// Its settings, with the drawn pulls.
    pub fn settings(&self) -> &BottleSettings {
        &self.settings
    }

    /// Time since it left the table, in s; before that a value that is never reached.
    fn since_s(&self) -> f64 {
        self.truth.lifted_at_s.map_or(f64::NEG_INFINITY, |at_s| self.time_s - at_s)
    }
}

impl HeldObject for Bottle {
    fn start_pose(&self) -> Pose {
        Pose::default()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Mirrored
    }

    fn contact_input(&mut self, contact: &Truth, hand: HandState, step_s: f64) -> ContactInput {
        self.time_s += step_s;
        let mass_kg = self.settings.mass_kg(self.since_s());
        let inertia =
            Inertia { mass_kg, gyration_radius_mm: self.settings.gyration_radius_mm, centre_of_mass_mm: Vec2::ZERO };
        let (mut springs, mut wrench) = self.feet.springs(contact, self.moved, hand.lowered_mm, step_s);
        wrench = sum(wrench, weight(&inertia, contact.pose.turn_rad));

        // In the frame of the hand the inertial force is opposite to the hand's acceleration.
        let speed_mm_per_s = (hand.lowered_mm - self.lowered_mm) / step_s;
        let gain_mm_per_s = (speed_mm_per_s - self.speed_mm_per_s) * step_s / (ARM_LAG_S + step_s);
        self.lowered_mm = hand.lowered_mm;
        self.speed_mm_per_s += gain_mm_per_s;
        let inertia_n = -mass_kg * 1e-3 * gain_mm_per_s / step_s;
        let since_s = self.since_s();
        let pull_n = self.settings.pulses.iter().fold(Vec2::ZERO, |sum, pulse| sum + pulse.force_n(since_s));
        if pull_n != Vec2::ZERO {
            let damping = PULL_DAMPING_N_S_PER_MM;
            springs = Springs { damping: [[damping, 0.0, 0.0], [0.0, damping, 0.0], [0.0; 3]], ..springs };
        }
        wrench.force_n += pull_n + Vec2::new(inertia_n, 0.0);
        self.truth.mass_kg = mass_kg;
        self.truth.pull_n = pull_n.length();
        self.truth.load_n = (pull_n + Vec2::new(weight_n(mass_kg) + inertia_n, 0.0)).length();
        ContactInput { drive: Drive::Sprung(springs, inertia), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench }
    }

    fn after_step(&mut self, contact: &Truth, hand: HandState, _step_s: f64, slid_mm: f64) {
        self.moved = difference(contact.pose, self.pose);
        self.pose = contact.pose;
        let [a, b] = self.feet.gaps_mm(contact.pose, hand.lowered_mm);
        let touches = contact.contact_cells_count > 0;
        let truth = &mut self.truth;
        truth.above_table_mm = a.min(b);
        truth.table_n = self.feet.forces_n(contact.pose, hand.lowered_mm).iter().sum();
        if truth.above_table_mm > 0.0 && touches {
            truth.lifted_at_s.get_or_insert(self.time_s);
        }
        let fell = truth.lifted_at_s.is_some() && !touches && truth.above_table_mm > 1.0;
        truth.dropped = slid_mm > LOST_AFTER_MM || fell;
    }

    fn is_gone(&self) -> bool {
        self.truth.dropped
    }

    fn truth(&self) -> ObjectTruth {
        ObjectTruth::Bottle(self.truth)
    }
}
