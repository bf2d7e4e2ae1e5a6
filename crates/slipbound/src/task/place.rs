//! Laying a tool down: lower it tilted until it touches and turns in the fingers, loosen the grip so that it keeps
//! turning, lower further until the ground carries it, release.
//!
//! ```text
//!    ||          ||            ||              |  |
//!   _||_.-'     _||_.-'       _||_____        ________      Grasping -> Working (down, then laying) -> Releasing
//!  '           '=======      ==========      ==========                                           -> Ended(Placed)
//!   down        touch         laying          let go
//! ```

use super::grasp::{Grasp, Grasped};
use super::ground::Ground;
use super::step::{ARRIVED_MM, Ending, Missing, Observation, PAUSE, Phase, Task, TaskStep, lower};
use crate::grip::{ArmMotion, GripController, GripDecision, Guard, arrived};
use crate::hand::{Allowed, HandReport};
use crate::port::{GripCommand, Jaws};
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Settings of [`Place`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct PlaceSettings {
    /// Rate of lowering until it touches, mm/s.
    pub rate_mm_per_s: f64,
    /// Rate of lowering while it is laid down, mm/s.
    pub laying_mm_per_s: f64,
    /// Furthest lowering, mm.
    pub most_mm: f64,
    /// Rotation of the object in the fingers that indicates ground contact, rad; so does a slip in which it pivots.
    pub touch_rad: f64,
    /// Increase of the force of the ground on the fingers within about a second that indicates that the ground carries
    /// the object, N per finger. It grows more slowly while the object turns on its edge. Needs the stiffness of the
    /// gels.
    pub carried_n: f64,
    /// The same as a displacement of the gels against gravity, mm, where their stiffness is unknown.
    pub carried_mm: f64,
    /// Time for which the looser grip must be settled before that force is evaluated, ns.
    pub loosen_ns: u64,
    /// Force per finger while it is laid down, N; not below the minimum of the grip.
    pub laying_n: f64,
    /// Where the object may slide before it touches: nowhere. Pivoting indicates the touch.
    pub allowed: Allowed,
}

impl Default for PlaceSettings {
    fn default() -> Self {
        PlaceSettings {
            rate_mm_per_s: 3.0,
            laying_mm_per_s: 2.0,
            most_mm: 100.0,
            touch_rad: 1f64.to_radians(),
            carried_n: 0.25,
            carried_mm: 0.05,
            loosen_ns: 500_000_000,
            laying_n: 5.0,
            allowed: Allowed { pivot: true, ..Allowed::default() },
        }
    }
}

impl PlaceSettings {
    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("place.rate_mm_per_s", self.rate_mm_per_s, 0.5, 100.0)?;
        within("place.laying_mm_per_s", self.laying_mm_per_s, 0.5, 100.0)?;
        within("place.most_mm", self.most_mm, 0.1, 1000.0)?;
        within("place.touch_rad", self.touch_rad, 1e-3, 1.0)?;
        within("place.carried_n", self.carried_n, 0.01, 100.0)?;
        within("place.carried_mm", self.carried_mm, 1e-3, 10.0)?;
        within("place.loosen_ns", self.loosen_ns as f64, 0.0, 10e9)?;
        within("place.laying_n", self.laying_n, 0.1, 1000.0)
    }
}

/// Longest time to reach the looser grip since the commanded force last changed, ns.
const LATE_NS: u64 = 3_000_000_000;

/// Longest time for the gripper to open, ns.
const OPENS_NS: u64 = 10_000_000_000;

/// Number of consecutive cycles that confirm a touch. Before the hand opens, so many more cycles must report that the
/// ground carries the object than that it does not.
const SURE_CYCLES_COUNT: u32 = 3;

/// Longest gap between consecutive cycles, ns; after so long without feeling the object, the fingers feel nothing.
const APART_NS: u64 = 250_000_000;

/// Laying down.
#[derive(Debug)]
pub struct Place {
    settings: PlaceSettings,
    grip: Guard,
    grasp: Grasp,
    phase: Phase,
    /// Wrist position at the start of lowering, mm.
    start_mm: Option<f64>,
    stiffness_mpa_per_mm: Option<f64>,
    touched_ns: Option<u64>,
    /// Since when the looser grip has stood, ns.
    loose_since_ns: Option<u64>,
    ground: Ground,
    /// When the fingers last felt the object, or lowering began, ns.
    felt_ns: Option<u64>,
    /// For how many cycles it has turned in the fingers, and the ground has carried it.
    turned_cycles_count: u32,
    carried_cycles_count: u32,
    last: GripDecision,
    /// When the commanded force last changed, ns.
    changed_ns: u64,
    /// When it was first told to release, ns.
    released_ns: Option<u64>,
    /// Time of the last step, ns, and whether there was a fault since: the time from then on does not count.
    last_ns: u64,
    is_interrupted: bool,
}

impl Place {
    /// Starts with a tool between the open jaws. Fails for invalid settings. `stiffness_mpa_per_mm` is that of the gels
    /// against shear, None where it is unknown.
    pub fn new(settings: PlaceSettings, grip: Guard, stiffness_mpa_per_mm: Option<f64>) -> Result<Self, SettingError> {
        settings.check()?;
        let last = GripDecision { force_n: grip.limits().start_n, arm: ArmMotion::Pause };
        Ok(Place {
            settings,
            grip,
            grasp: Grasp::default(),
            phase: Phase::Grasping,
            start_mm: None,
            stiffness_mpa_per_mm,
            touched_ns: None,
            loose_since_ns: None,
            ground: Ground::default(),
            felt_ns: None,
            turned_cycles_count: 0,
            carried_cycles_count: 0,
            last,
            changed_ns: 0,
            released_ns: None,
            last_ns: 0,
            is_interrupted: false,
        })
    }

    fn work(&mut self, observation: &Observation<'_>) {
        let allowed = self.settings.allowed.filter(observation.hand);
        let grip = match self.touched_ns {
            None => self.grip.decide(observation.now_ns, &allowed, observation.gripper),
            Some(_) => self.grip.hold(observation.now_ns, &allowed, observation.gripper, self.settings.laying_n),
        };
        self.command(grip, observation.now_ns);
        if observation.is_lost() {
            self.phase = Phase::Ended(Ending::Lost);
            return;
        }
        if self.left_mm(observation) <= ARRIVED_MM {
            self.phase = Phase::Ended(Ending::Limit);
            return;
        }
        self.phase = Phase::at_work(self.last.arm);
        let touched_ns = self.feel_touch(observation, &allowed);
        self.loose_since_ns = self.loose_since_ns.filter(|_| self.has_arrived(observation));
        let Some(touched_ns) = touched_ns else { return };
        if !self.waits_for_loose_grip(observation, touched_ns) && self.last.arm == ArmMotion::Go {
            self.confirm_carried(observation);
        }
    }

    /// How far it may still be lowered, mm.
    fn left_mm(&mut self, observation: &Observation<'_>) -> f64 {
        let lowered_mm = observation.wrist.lowered_mm;
        self.settings.most_mm - (lowered_mm - *self.start_mm.get_or_insert(lowered_mm))
    }

    /// When the object touched the ground, ns: from then on the grip is loose. None before, and while the fingers do not
    /// feel the object.
    fn feel_touch(&mut self, observation: &Observation<'_>, allowed: &HandReport) -> Option<u64> {
        let hand = observation.hand;
        let felt_ns = *self.felt_ns.get_or_insert(observation.now_ns);
        let is_long_ago = observation.now_ns.saturating_sub(felt_ns) > APART_NS;
        let Some(turned_rad) = self.ground.turned_rad(observation.now_ns, hand) else {
            // Without shear the ground force is unknown: do not lower. Before the touch a few frames may be missing.
            if self.touched_ns.is_some() || is_long_ago {
                self.phase = Phase::Waiting;
            }
            return None;
        };
        self.felt_ns = Some(observation.now_ns);
        if is_long_ago {
            (self.turned_cycles_count, self.carried_cycles_count) = (0, 0);
        }
        let turns = turned_rad.abs() >= self.settings.touch_rad || hand.slip.is_some_and(|slip| slip.pivots);
        self.turned_cycles_count = if turns { self.turned_cycles_count + 1 } else { 0 };
        if self.touched_ns.is_none() && self.turned_cycles_count >= SURE_CYCLES_COUNT {
            // It rests on one end and turns; a loose grip keeps the force of the ground small.
            self.touched_ns = Some(observation.now_ns);
            let grip = self.grip.hold(observation.now_ns, allowed, observation.gripper, self.settings.laying_n);
            self.command(grip, observation.now_ns);
        }
        self.touched_ns
    }

    /// Whether the gripper holds with the force that is wanted.
    fn has_arrived(&self, observation: &Observation<'_>) -> bool {
        !self.grip.is_raised() && arrived(self.last.force_n, observation.gripper)
    }

    /// Whether the gripper has not held loosely for long enough yet; ends the task when it does not for too long.
    fn waits_for_loose_grip(&mut self, observation: &Observation<'_>, touched_ns: u64) -> bool {
        let now_ns = observation.now_ns;
        if !self.has_arrived(observation) {
            // With a firm grip the gels do not measure the ground force: nothing is released because of it.
            let since_ns = self.changed_ns.max(touched_ns + self.settings.loosen_ns);
            let late = now_ns.saturating_sub(since_ns) > LATE_NS;
            self.phase = if late { Phase::Ended(Ending::GripStays) } else { Phase::Waiting };
            return true;
        }
        let waits = now_ns.saturating_sub(*self.loose_since_ns.get_or_insert(now_ns)) < self.settings.loosen_ns;
        if waits {
            self.phase = Phase::Waiting;
        }
        waits
    }

    /// Counts the cycles in which the ground carries the object, and releases it after enough of them.
    fn confirm_carried(&mut self, observation: &Observation<'_>) {
        let carried_count = self.carried_cycles_count;
        let push_mm = self.ground.push_mm(observation.now_ns, carried_count > 0);
        // A cycle that does not feel it subtracts one: on rigid ground one more step down adds half a newton or more.
        self.carried_cycles_count =
            if self.carried(observation.hand, push_mm) { carried_count + 1 } else { carried_count.saturating_sub(1) };
        self.phase = match self.carried_cycles_count {
            0 => Phase::Working,
            // Further lowering would press it onto the ground.
            1..SURE_CYCLES_COUNT => Phase::Waiting,
            _ => Phase::Releasing,
        };
    }

    fn command(&mut self, grip: GripDecision, now_ns: u64) {
        if grip.force_n != self.last.force_n {
            self.changed_ns = now_ns;
        }
        self.last = grip;
    }

    /// Whether the ground pushes the object against the fingers.
    fn carried(&self, hand: &HandReport, push_mm: f64) -> bool {
        match (self.stiffness_mpa_per_mm, hand.contact_area_mm2) {
            (Some(stiffness), Some(area_mm2)) => stiffness * area_mm2 * push_mm >= self.settings.carried_n,
            _ => push_mm >= self.settings.carried_mm,
        }
    }
}

impl Task for Place {
    fn step(&mut self, observation: &Observation<'_>) -> TaskStep {
        let since_ns = observation.now_ns.saturating_sub(std::mem::replace(&mut self.last_ns, observation.now_ns));
        if std::mem::take(&mut self.is_interrupted) {
            // Commands may not have been sent meanwhile.
            self.changed_ns += since_ns;
            self.loose_since_ns = self.loose_since_ns.map(|ns| ns + since_ns);
            self.released_ns = self.released_ns.map(|ns| ns + since_ns);
        }
        match self.phase {
            Phase::Grasping => {
                match self.grasp.step(observation, &self.settings.allowed.filter(observation.hand), &mut self.grip) {
                    Grasped::NotYet(grip) => self.last = grip,
                    Grasped::Yes(grip) => (self.last, self.phase) = (grip, Phase::at_work(grip.arm)),
                    Grasped::Never(ending) => self.phase = Phase::Ended(ending),
                }
            }
            Phase::Ended(_) => {}
            Phase::Releasing => {
                let since_ns = *self.released_ns.get_or_insert(observation.now_ns);
                if observation.gripper.jaws == Jaws::Open {
                    self.phase = Phase::Ended(Ending::Placed);
                } else if observation.now_ns.saturating_sub(since_ns) > OPENS_NS {
                    self.phase = Phase::Ended(Ending::NotReleased);
                }
            }
            _ => self.work(observation),
        }
        let rate_mm_per_s =
            if self.touched_ns.is_some() { self.settings.laying_mm_per_s } else { self.settings.rate_mm_per_s };
        let wrist = match self.phase {
            Phase::Working => lower(rate_mm_per_s, self.left_mm(observation)),
            _ => PAUSE,
        };
        let grip = match self.phase {
            Phase::Releasing | Phase::Ended(Ending::Placed | Ending::NotReleased) => GripCommand::Release,
            _ => self.last.command(),
        };
        TaskStep { grip, wrist, phase: self.phase }
    }

    fn grip(&self) -> &Guard {
        &self.grip
    }

    fn grip_mut(&mut self) -> &mut Guard {
        &mut self.grip
    }

    fn interrupt(&mut self) {
        self.grasp.interrupt();
        self.is_interrupted = true;
    }

    fn missing(&self) -> Option<Missing> {
        self.grasp.missing().filter(|_| self.phase == Phase::Grasping)
    }
}
