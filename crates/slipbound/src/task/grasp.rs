//! Grasping: close with the starting force until the object is held and felt. Slip is answered from the first contact
//! on.
//!
//! ```text
//!   gripper reports a hold + the jaws stand still + the fingers feel it  --0.2 s, force reached--> held
//!                                                                        --1 s, any force------> held
//! ```
//!
//! A force reading alone proves nothing either way: a motor's current is 6 % or 3 N off, or fluctuates by 2 N.

use super::step::{Ending, Missing, Observation};
use crate::grip::{ArmMotion, GripDecision, Guard, arrived};
use crate::hand::HandReport;
use crate::monitor::SlipState;
use crate::port::{GripperState, Jaws};

/// Longest time for a grasp, ns, from when the jaws last came closer: from one end to the other may take twenty seconds.
const LONGEST_NS: u64 = 10_000_000_000;

/// A longer time between two steps counts as this long, ns.
const LONGEST_STEP_NS: u64 = 250_000_000;

/// Time for which the grip must be steady before work begins, ns: long enough for the monitor to take a reference.
const SETTLE_NS: u64 = 200_000_000;

/// The same where the force reading differs from the command, ns: longer than jaws ever need to build up force.
const WITHOUT_FORCE_NS: u64 = 1_000_000_000;

/// Jaw motion that counts as none, mm: more than a step of the coarsest position sensor known here (0.37 mm).
const STILL_MM: f64 = 0.5;

/// A grasp in progress.
#[derive(Debug, Clone, Default)]
pub(super) struct Grasp {
    /// The time of the last step, ns, and for how long it has waited without a fault.
    last_ns: Option<u64>,
    waited_ns: u64,
    /// Whether there was a fault since the last step.
    is_interrupted: bool,
    /// The least opening of jaws that close, mm.
    closed_to_mm: Option<f64>,
    /// Since when all conditions except the force have been met, and the opening then.
    stands: Option<(u64, Option<f64>)>,
    /// Since when the force has been reached, too.
    pressed_since_ns: Option<u64>,
    missing: Option<Missing>,
}

/// Progress of a grasp.
pub(super) enum Grasped {
    NotYet(GripDecision),
    /// With the decision of this cycle: it may answer slip.
    Yes(GripDecision),
    Never(Ending),
}

impl Grasp {
    /// `hand` is the hand report without the slip that the task allows.
    pub fn step(&mut self, observation: &Observation<'_>, hand: &HandReport, grip: &mut Guard) -> Grasped {
        let (now_ns, gripper) = (observation.now_ns, observation.gripper);
        let before_ns = self.last_ns.replace(now_ns);
        let is_first = before_ns.is_none();
        if !std::mem::take(&mut self.is_interrupted) {
            self.waited_ns += before_ns.map_or(0, |before_ns| now_ns.saturating_sub(before_ns).min(LONGEST_STEP_NS));
        }
        let feels = !matches!(hand.state, SlipState::NoContact | SlipState::Unjudged);
        let holds = gripper.jaws == Jaws::Holding;
        if let Some(held_n) = gripper.target_n.or(gripper.force_n).filter(|_| is_first && holds) {
            // It holds already, from before this task: it is not loosened to the starting force.
            grip.raise_to(held_n);
        }
        let decided = self.decide(observation, hand, grip, feels && holds);
        self.missing = match () {
            _ if hand.state == SlipState::Unjudged => Some(Missing::Sight),
            _ if !holds => Some(Missing::Hold),
            _ if !feels => Some(Missing::Contact),
            _ => None,
        };
        if self.missing.is_none() {
            if self.stands_for_ns(observation) >= self.needed_ns(now_ns, arrived(decided.force_n, gripper)) {
                return Grasped::Yes(decided);
            }
            self.missing = Some(Missing::SteadyGrip);
        } else {
            (self.stands, self.pressed_since_ns) = (None, None);
        }
        if self.come_closer(gripper) {
            self.waited_ns = 0;
        }
        let is_late = self.waited_ns > LONGEST_NS;
        // Blind fingers cannot tell whether something is held.
        let is_empty = is_late && hand.state != SlipState::Unjudged && !(holds && feels);
        if matches!(gripper.jaws, Jaws::Nothing | Jaws::Lost) || is_empty {
            return Grasped::Never(Ending::NothingHeld);
        }
        Grasped::NotYet(GripDecision { arm: ArmMotion::Pause, ..decided })
    }

    /// Whether the jaws close, and have come closer than ever since the last time.
    fn come_closer(&mut self, gripper: &GripperState) -> bool {
        let Some(now_mm) = gripper.opening_mm.filter(|_| gripper.jaws == Jaws::Closing) else { return false };
        let comes = now_mm < *self.closed_to_mm.get_or_insert(now_mm) - STILL_MM;
        if comes {
            self.closed_to_mm = Some(now_mm);
        }
        comes
    }

    /// The time up to the next step does not count.
    pub fn interrupt(&mut self) {
        self.is_interrupted = true;
    }

    /// The missing condition, if any.
    pub fn missing(&self) -> Option<Missing> {
        self.missing
    }

    /// The starting force, or the controller's response to slip; it never falls during the grasp.
    fn decide(
        &self,
        observation: &Observation<'_>,
        hand: &HandReport,
        grip: &mut Guard,
        is_felt: bool,
    ) -> GripDecision {
        let (now_ns, gripper) = (observation.now_ns, observation.gripper);
        let slips = is_felt && hand.state.is_slip();
        match slips {
            true => grip.decide_no_less(now_ns, hand, gripper),
            false => grip.hold_last(now_ns, hand, gripper),
        }
    }

    /// For how long all conditions except the force have been met, ns.
    fn stands_for_ns(&mut self, observation: &Observation<'_>) -> u64 {
        let (now_ns, now_mm) = (observation.now_ns, observation.gripper.opening_mm);
        let moved = |before_mm: Option<f64>| before_mm.zip(now_mm).is_some_and(|(a, b)| (a - b).abs() > STILL_MM);
        let (since_ns, before_mm) = *self.stands.get_or_insert((now_ns, now_mm));
        if moved(before_mm) {
            (self.stands, self.pressed_since_ns) = (Some((now_ns, now_mm)), None);
            return 0;
        }
        now_ns.saturating_sub(since_ns)
    }

    /// For how long they have to be met, ns.
    fn needed_ns(&mut self, now_ns: u64, is_pressed: bool) -> u64 {
        if !is_pressed {
            self.pressed_since_ns = None;
            return WITHOUT_FORCE_NS;
        }
        let pressed_ns = *self.pressed_since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(pressed_ns) >= SETTLE_NS { SETTLE_NS } else { WITHOUT_FORCE_NS }
    }
}
