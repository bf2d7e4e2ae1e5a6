//! The common part of screwing and unscrewing: grasp, turn while the controller lets the wrist move, watch the shear.

use super::grasp::{Grasp, Grasped};
use super::shear_history::{ShearHistories, ShearHistory};
use super::shear_offset::ShearOffset;
use super::step::{ARRIVED_RAD, Ending, Missing, Observation, PAUSE, Phase, TaskStep, turn};
use crate::grip::{ArmMotion, GripController, GripDecision, Guard, arrived};
use crate::hand::{Allowed, HandReport};
use crate::monitor::SlipState;
use crate::port::Jaws;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// When turning fingers are considered to slide around a cap without a detected slip onset: steady sliding moves no
/// marker. Then the shear stays flat while they turn, under a load that friction could just carry.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct SlideSettings {
    /// Turn over which the shear stays flat, rad: 8 deg, 2 mm at the rim of a bottle cap.
    pub window_rad: f64,
    /// Growth of the shear over that turn, as a fraction of the shear, that still counts as flat.
    pub flat_fraction: f64,
    /// Least ratio of load, without what drags along the thread, to grip force; below it a flat shear means a cap that
    /// turns freely.
    pub least_mu: f64,
}

impl Default for SlideSettings {
    fn default() -> Self {
        SlideSettings { window_rad: 8f64.to_radians(), flat_fraction: 0.03, least_mu: 0.25 }
    }
}

impl SlideSettings {
    /// `table` is the settings table that this one is part of: `screw` or `unscrew`; `most_rad` the maximum turn: a window
    /// beyond it could never fill.
    pub(super) fn check(&self, table: &str, most_rad: f64) -> Result<(), SettingError> {
        within(&format!("{table}.slide.window_rad"), self.window_rad, 0.01, most_rad.min(1.0))?;
        within(&format!("{table}.slide.flat_fraction"), self.flat_fraction, 0.0, 0.5)?;
        within(&format!("{table}.slide.least_mu"), self.least_mu, 0.01, 2.0)
    }
}

/// Growth of the commanded force that makes a new grip, as a fraction: the shear under it is judged anew. A controller
/// that follows the load changes the force by less in nearly every cycle.
const NEW_GRIP_FRACTION: f64 = 0.05;

/// Share of the window that is enough to see that fingers which slid less than two windows ago slide still.
const STILL_SLIDES_SHARE: f64 = 0.25;

/// A cap being turned.
#[derive(Debug)]
pub(super) struct Turning {
    pub grip: Guard,
    rate_rad_per_s: f64,
    most_rad: f64,
    allowed: Allowed,
    slide: SlideSettings,
    stiffness_mpa_per_mm: Option<f64>,
    grasp: Grasp,
    shear_offset: ShearOffset,
    phase: Phase,
    start_rad: Option<f64>,
    shear: ShearHistories,
    /// The lowest force commanded since the shear is judged, N.
    judged_n: f64,
    /// Where the fingers were last seen to slide, rad of the turn.
    slid_rad: Option<f64>,
    longest_window_rad: f64,
    /// Where slip under the largest force was first and last detected, rad of the turn.
    slips_rad: Option<(f64, f64)>,
    last: GripDecision,
}

/// State of a turn, from which the task decides whether it ends.
pub(super) struct TurnState<'a> {
    /// Shear of the gels around the axis over the turn, in the sense of the task.
    pub shear: &'a ShearHistory,
    /// How far the wrist has turned, in the sense of the task, rad.
    pub turned_rad: f64,
    /// Slip was detected while the gripper pressed with the largest force.
    pub slip_at_most: bool,
    /// Where it was first and last detected, rad of the turn; None before.
    slips_rad: Option<(f64, f64)>,
}

impl TurnState<'_> {
    /// Whether slip under the largest force persists over this turn: it began in the first half and was detected in the
    /// second. A single alarm does not count.
    pub fn slips_over(&self, window_rad: f64) -> bool {
        let half_rad = 0.5 * window_rad;
        self.slips_rad.is_some_and(|(first_rad, last_rad)| {
            self.turned_rad - first_rad > half_rad && self.turned_rad - last_rad < half_rad
        })
    }
}

impl Turning {
    pub fn new(
        grip: Guard,
        (rate_rad_per_s, most_rad): (f64, f64),
        allowed: Allowed,
        slide: SlideSettings,
        stiffness_mpa_per_mm: Option<f64>,
        longest_window_rad: f64,
    ) -> Self {
        let last = GripDecision { force_n: grip.limits().start_n, arm: ArmMotion::Pause };
        Turning {
            grip,
            rate_rad_per_s,
            most_rad,
            allowed,
            slide,
            stiffness_mpa_per_mm,
            grasp: Grasp::default(),
            shear_offset: ShearOffset::default(),
            phase: Phase::Grasping,
            start_rad: None,
            shear: ShearHistories::new(longest_window_rad.max(slide.window_rad)),
            judged_n: last.force_n,
            slid_rad: None,
            longest_window_rad,
            slips_rad: None,
            last,
        }
    }

    pub fn step(&mut self, observation: &Observation<'_>, end: impl Fn(TurnState<'_>) -> Option<Ending>) -> TaskStep {
        match self.phase {
            Phase::Grasping => {
                match self.grasp.step(observation, &self.allowed.filter(observation.hand), &mut self.grip) {
                    Grasped::NotYet(grip) => self.last = grip,
                    Grasped::Yes(grip) => {
                        self.shear_offset.take(observation.hand, observation.gripper.pressed_n());
                        self.last = grip;
                        self.phase = Phase::at_work(grip.arm);
                    }
                    Grasped::Never(ending) => self.phase = Phase::Ended(ending),
                }
            }
            Phase::Ended(_) => {}
            _ => self.work(observation, end),
        }
        let wrist = match self.phase {
            Phase::Working => turn(self.rate_rad_per_s, self.most_rad - self.turned_rad(observation)),
            _ => PAUSE,
        };
        TaskStep { grip: self.last.command(), wrist, phase: self.phase }
    }

    fn work(&mut self, observation: &Observation<'_>, end: impl Fn(TurnState<'_>) -> Option<Ending>) {
        let sense = self.rate_rad_per_s.signum();
        let turned_rad = self.turned_rad(observation);
        let pressed_n = observation.gripper.pressed_n();
        let mut seen = self.shear_offset.correct(&self.allowed.filter(observation.hand), pressed_n);
        if seen.shear_mm.is_some() {
            self.shear.turn_to(observation.now_ns, observation.hand);
        }
        if self.slides(&seen, pressed_n, turned_rad) {
            seen.state = SlipState::Gross;
            self.slid_rad = Some(turned_rad);
        }
        self.last = self.grip.decide(observation.now_ns, &seen, observation.gripper);
        if self.last.force_n > (1.0 + NEW_GRIP_FRACTION) * self.judged_n {
            self.shear.restart();
            self.judged_n = self.last.force_n;
        }
        self.judged_n = self.judged_n.min(self.last.force_n);
        if let Some(shear) = seen.shear_mm {
            self.shear.see(turned_rad, sense * shear.around);
        }
        // A gripper that was commanded the largest force but does not exert it proves nothing.
        let at_most = self.last.force_n >= self.grip.limits().most_n && arrived(self.last.force_n, observation.gripper);
        let slip_at_most = at_most && self.grip.wants_more();
        if slip_at_most && seen.state.is_slip() {
            let goes_on = |(_, last_rad): &(f64, f64)| turned_rad - last_rad <= self.longest_window_rad;
            let (first_rad, _) = self.slips_rad.filter(goes_on).unwrap_or((turned_rad, turned_rad));
            self.slips_rad = Some((first_rad, turned_rad));
        }
        let ending = if observation.is_lost() {
            Some(Ending::Lost)
        } else {
            // Evidence from before the fingers went blind does not cover the turn since, and without a hold there is none.
            let sees = seen.state != SlipState::Unjudged && observation.gripper.jaws == Jaws::Holding;
            let seen_ending = sees
                .then(|| {
                    end(TurnState { shear: self.shear.newest(), turned_rad, slip_at_most, slips_rad: self.slips_rad })
                })
                .flatten();
            seen_ending.or((turned_rad >= self.most_rad - ARRIVED_RAD).then_some(Ending::Limit))
        };
        self.phase = ending.map_or(Phase::at_work(self.last.arm), Phase::Ended);
    }

    /// How far the wrist has turned since it first was to turn, in the sense of the task, rad.
    fn turned_rad(&mut self, observation: &Observation<'_>) -> f64 {
        let angle_rad = observation.wrist.angle_rad;
        self.rate_rad_per_s.signum() * (angle_rad - *self.start_rad.get_or_insert(angle_rad))
    }

    /// See [`Task::interrupt`](super::step::Task::interrupt).
    pub fn interrupt(&mut self) {
        self.grasp.interrupt();
    }

    /// What it waits for before it can turn.
    pub fn missing(&self) -> Option<Missing> {
        self.grasp.missing().filter(|_| self.phase == Phase::Grasping)
    }

    /// Whether the fingers slide around the cap. Always false where the stiffness of the gel is unknown: a cap that
    /// turns freely looks the same then. The load that counts is in directions that are not allowed: a thread drags the
    /// fingers along, too, while its cap follows them.
    fn slides(&self, hand: &HandReport, pressed_n: Option<f64>, turned_rad: f64) -> bool {
        let shear_mm = hand.shear_mm.map(|shear| self.allowed.outside(shear));
        let held = HandReport { shear_mm, ..*hand };
        let load_n = self.stiffness_mpa_per_mm.and_then(|stiffness| held.load_n(stiffness));
        let (Some(load_n), Some(pressed_n)) = (load_n, pressed_n) else { return false };
        let SlideSettings { window_rad, flat_fraction, least_mu } = self.slide;
        let slid_lately = self.slid_rad.is_some_and(|at_rad| turned_rad - at_rad <= 2.0 * window_rad);
        let window_rad = if slid_lately { STILL_SLIDES_SHARE * window_rad } else { window_rad };
        load_n >= least_mu * pressed_n && self.shear.newest().is_flat(window_rad, flat_fraction)
    }
}
