//! When the object begins to slide as a whole.

use crate::contact::{Finger, GROSS_STICK_RATIO, Pose};
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;

/// Share of the friction there is, above which nothing is left to hold the object.
pub const GROSS_FRICTION_FRACTION: f64 = 0.99;

/// Which of the two signs of gross slip came first.
///
/// The stick ratio phi counts cells. Where an object slides, new cells come into contact at its leading edge and
/// stick for a step or two under next to no pressure; at high mu p some 2 % of the cells are always in that state
/// and phi does not fall below 0.01 though the load is mu P and the object slides away. So the friction itself is
/// looked at too, as the limit surface of sliding contacts is defined (Goyal, Ruina and Papadopoulos, Wear 143
/// (1991) 307): of all tractions within the bounds, those of a contact that slides everywhere do the most work on
/// the motion of the object. Where they do 99 % of it, sticking cells carry nothing that matters; in a pure pull
/// at constant mu this is a load of 0.99 mu P.
///
/// Only substeps after the load has begun count: the first cells of a press may slip without anything sliding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GrossRule {
    /// phi < [`GROSS_STICK_RATIO`]: sticking cells over cells in contact.
    StickRatio,
    /// sum(q . v) >= [`GROSS_FRICTION_FRACTION`] sum(bound |v|) with v the motion of the object over each cell.
    FrictionUsed,
}

/// The first substep of gross slip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gross {
    /// When, on the clock of the frames, in s.
    pub time_s: f64,
    /// The load then; f of a frame is its load over this one.
    pub load: f64,
    /// Where the object was.
    pub pose: Pose,
    /// What showed it.
    pub rule: GrossRule,
}

/// Looks out for it.
#[derive(Debug, Clone)]
pub(super) struct GrossWatch {
    load_from_s: Option<f64>,
    found: Option<Gross>,
    pose_before: Pose,
    friction_used: Option<f64>,
}

impl GrossWatch {
    pub fn new(load_from_s: Option<f64>) -> Self {
        GrossWatch { load_from_s, found: None, pose_before: Pose::default(), friction_used: None }
    }

    pub fn found(&self) -> Option<Gross> {
        self.found
    }

    /// Share of the friction that was used in the last substep; None without contact, motion or load.
    pub fn friction_used_fraction(&self) -> Option<f64> {
        self.friction_used
    }

    /// Looks at the finger after a substep; whether this is the first of gross slip.
    pub fn see(&mut self, finger: &Finger, path_s: f64, time_s: f64, load: f64) -> bool {
        let truth = finger.truth();
        let before = std::mem::replace(&mut self.pose_before, truth.pose);
        let loaded = self.load_from_s.is_some_and(|from_s| path_s > from_s + 1e-9) && load > 0.0;
        self.friction_used =
            if loaded { Sliding::since(finger, before).and_then(|s| s.friction_used_fraction) } else { None };
        let (Some(stick_ratio), true, None) = (truth.stick_ratio, loaded, self.found) else { return false };
        let rule = match () {
            _ if stick_ratio < GROSS_STICK_RATIO => GrossRule::StickRatio,
            _ if self.friction_used.is_some_and(|used| used >= GROSS_FRICTION_FRACTION) => GrossRule::FrictionUsed,
            _ => return false,
        };
        self.found = Some(Gross { time_s, load, pose: truth.pose, rule });
        true
    }
}

/// How an object moved over one finger since a pose, seen from the friction there is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sliding {
    /// Work of the tractions on that motion over the most they could do, -1 to 1; None when it did not move.
    pub friction_used_fraction: Option<f64>,
    /// How far it moved, in mm: the mean over the contact, a cell counting by the friction it can carry.
    pub way_mm: f64,
    /// Middle of the contact, counted alike, in mm on the gel.
    pub middle_mm: Vec2,
    /// Mean distance from there, counted alike, in mm: the lever of friction against turning.
    pub arm_mm: f64,
}

impl Sliding {
    /// None without contact. Rotation counts at the lever of every cell.
    pub fn since(finger: &Finger, before: Pose) -> Option<Self> {
        let grid = finger.settings().grid;
        let now = finger.truth().pose;
        let (shift_mm, turn_rad) = (now.position_mm - before.position_mm, now.turn_rad - before.turn_rad);
        let skin_mm = |cell: usize| grid.centre_mm(cell) + finger.displacement(cell).shift_mm;
        let (mut done, mut most, mut whole, mut moment) = (0.0, 0.0, 0.0, Vec2::ZERO);
        for (cell, bound_mpa) in loaded(finger) {
            let lever_mm = skin_mm(cell) - before.position_mm;
            let way_mm = shift_mm + Vec2::new(-lever_mm.y, lever_mm.x) * turn_rad;
            done += finger.traction_mpa(cell).dot(way_mm);
            most += bound_mpa * way_mm.length();
            whole += bound_mpa;
            moment += skin_mm(cell) * bound_mpa;
        }
        if whole <= 0.0 {
            return None;
        }
        let middle_mm = moment / whole;
        let arm: f64 = loaded(finger).map(|(cell, bound_mpa)| bound_mpa * (skin_mm(cell) - middle_mm).length()).sum();
        Some(Sliding {
            friction_used_fraction: (most > 0.0).then(|| done / most),
            way_mm: most / whole,
            middle_mm,
            arm_mm: arm / whole,
        })
    }
}

/// The cells that carry friction, and how much each can.
fn loaded(finger: &Finger) -> impl Iterator<Item = (usize, f64)> + '_ {
    finger.bound_mpa().iter().copied().enumerate().filter(|(_, bound_mpa)| *bound_mpa > 0.0)
}
