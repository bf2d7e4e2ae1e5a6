//! Ground truth after a step.

use super::body::{Pose, Wrench};
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;

/// Share of the largest possible friction work from which an object slides as a whole.
///
/// The limit surface of a sliding contact is defined by the work of friction (Goyal, Ruina and Papadopoulos, Wear 143
/// (1991) 307): of all tractions within the bounds, those of a contact that slides everywhere do the most work on the
/// motion of the object. Gross slip begins at 99 % of it: sum(q . v) >= 0.99 sum(bound |v|), with q the friction on a
/// cell and v the motion of the object over it. The load on sticking cells is then negligible. The stick ratio is not
/// such a criterion on every grid: cells that come into contact at the leading edge stick for a step or two under
/// hardly any pressure, and the middle of a twisted contact sticks permanently.
pub const GROSS_FRICTION_FRACTION: f64 = 0.99;

/// Largest displacement gradient, as a fraction, for which the gel is considered linear.
pub const LINEAR_STRAIN: f64 = 0.3;

/// Something that happened in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// The first contact after none.
    FirstContact,
    /// The stick ratio fell below 0.8.
    StickBelow80,
    /// The stick ratio fell below 0.5.
    StickBelow50,
    /// The object began to slide as a whole: the friction used reached [`GROSS_FRICTION_FRACTION`].
    Gross,
    /// The last contact was lost.
    Parted,
}

impl Event {
    const ALL: [Event; 5] =
        [Event::FirstContact, Event::StickBelow80, Event::StickBelow50, Event::Gross, Event::Parted];
}

/// The events of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Events(u8);

impl Events {
    /// Events between two steps, from their stick ratios (None without contact) and from the share of friction used. A
    /// ratio falls below a level only if it was at or above it before.
    pub fn between(before: &Truth, now: &Truth) -> Self {
        let mut events = Events(0);
        if slides(now.friction_used_fraction) && !slides(before.friction_used_fraction) {
            events.insert(Event::Gross);
        }
        match (before.stick_ratio, now.stick_ratio) {
            (None, Some(_)) => events.insert(Event::FirstContact),
            (Some(_), None) => events.insert(Event::Parted),
            (Some(before), Some(now)) => {
                for (level, event) in [(0.8, Event::StickBelow80), (0.5, Event::StickBelow50)] {
                    if before >= level && now < level {
                        events.insert(event);
                    }
                }
            }
            (None, None) => {}
        }
        events
    }

    fn insert(&mut self, event: Event) {
        self.0 |= 1 << event as u8;
    }

    /// Whether an event is among them.
    pub fn contains(self, event: Event) -> bool {
        self.0 & (1 << event as u8) != 0
    }

    /// The events, in the order of [`Event`].
    pub fn iter(self) -> impl Iterator<Item = Event> {
        Event::ALL.into_iter().filter(move |&event| self.contains(event))
    }
}

/// Displacement of a point of the gel surface, in mm.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Displacement {
    /// In the plane of the gel.
    pub shift_mm: Vec2,
    /// Into the gel.
    pub depth_mm: f64,
}

/// The numbers of one step; the fields are on [`super::Finger`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Time since the beginning, in s.
    pub time_s: f64,
    /// Where the object is.
    pub pose: Pose,
    /// Normal force of this finger, in N.
    pub grip_force_n: f64,
    /// Depth of the object's lowest point below the flat gel, in mm; negative above it.
    pub depth_mm: f64,
    /// In-plane load of the object on this finger's gel, by friction and, where its surface is inclined, by pressure:
    /// the reading of a sensor under the gel. The torque is about the object's reference point.
    pub wrench: Wrench,
    /// The part of it that is friction.
    pub friction: Wrench,
    /// In-plane force in N of the pressure on the gel by the object's profile, which does not act on a body that rolls
    /// in place; the force by relief on the skin is in [`Truth::wrench`] alone.
    pub on_profile_n: Vec2,
    /// Number of cells under pressure.
    pub contact_cells_count: u32,
    /// Area under pressure in mm2.
    pub contact_area_mm2: f64,
    /// Area that sticks over area in contact, 0 to 1; None without contact.
    pub stick_ratio: Option<f64>,
    /// Work of friction on the motion of the object in this step over the largest possible work, -1 to 1: from
    /// [`GROSS_FRICTION_FRACTION`] on the object slides as a whole. None without contact or motion.
    pub friction_used_fraction: Option<f64>,
    /// Largest pressure in MPa.
    pub peak_pressure_mpa: f64,
    /// Largest displacement gradient (Frobenius norm) at the surface, as a fraction.
    pub largest_strain_fraction: f64,
    /// Whether that is above [`LINEAR_STRAIN`]: the numbers are those of a linear gel, a real one would differ.
    pub beyond_linear: bool,
    /// Whether the contact reaches the border of the grid or the rounded edge of the gel: the object has left the pad or
    /// is too large for it.
    pub at_border: bool,
    /// Work dissipated by slip in this step, in N mm; 0 or above.
    pub dissipated_n_mm: f64,
    /// What happened in this step.
    pub events: Events,
    /// Iterations of the normal solver.
    pub normal_iterations_count: u32,
    /// Iterations of the tangential solver.
    pub tangential_iterations_count: u32,
    /// Whether both solvers met their tolerance.
    pub converged: bool,
}

impl Truth {
    /// Whether the object slid as a whole in this step, as [`GROSS_FRICTION_FRACTION`] defines it.
    pub fn slides_as_a_whole(&self) -> bool {
        slides(self.friction_used_fraction)
    }
}

/// Whether this share of the friction means that the object slides as a whole.
fn slides(friction_used_fraction: Option<f64>) -> bool {
    friction_used_fraction.is_some_and(|used| used >= GROSS_FRICTION_FRACTION)
}

/// Loads of a run and the share of friction they use; they give the load fraction of every step once gross slip is
/// known.
///
/// Push every step of the load ramp. A load is the factor by which the wrench of the path is scaled, or, for a
/// guided object, the wrench along the motion: force times direction plus torque times rotation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadRecord {
    steps: Vec<(f64, Option<f64>)>,
}

impl LoadRecord {
    /// Appends a step: its load, 0 or above in any one unit, and its [`Truth::friction_used_fraction`].
    pub fn push(&mut self, load: f64, friction_used_fraction: Option<f64>) {
        self.steps.push((load, friction_used_fraction));
    }

    /// Number of the first step of gross slip; None while there was none.
    pub fn gross_step(&self) -> Option<usize> {
        self.steps.iter().position(|&(_, used)| slides(used))
    }

    /// Load fraction f of every step: its load over that of the gross step. None before gross slip; continue the run
    /// (or a clone of the finger) up to it.
    pub fn fractions(&self) -> Option<impl Iterator<Item = f64> + '_> {
        let gross = self.steps[self.gross_step()?].0;
        Some(self.steps.iter().map(move |&(load, _)| load / gross))
    }
}
