//! Taking hold: close with the starting force until it has arrived and the fingers feel the object.

use super::step::{Ending, Observation};
use crate::grip::{ArmMotion, GripDecision, Guard};
use crate::monitor::SlipState;
use crate::port::Jaws;

/// Longest time to take hold, ns.
const LONGEST_NS: u64 = 10_000_000_000;

/// Time the grip must stand before work begins, ns: long enough for a reference to be taken on it.
const SETTLE_NS: u64 = 200_000_000;

/// Taking hold.
#[derive(Debug, Clone, Default)]
pub(super) struct Grasp {
    since_ns: Option<u64>,
    stands_since_ns: Option<u64>,
}

/// How far it is.
pub(super) enum Grasped {
    NotYet(GripDecision),
    Yes,
    Never(Ending),
}

impl Grasp {
    pub fn step(&mut self, observation: &Observation<'_>, grip: &Guard) -> Grasped {
        let since_ns = *self.since_ns.get_or_insert(observation.now_ns);
        let force_n = grip.limits().start_n;
        let pressed =
            observation.gripper.pressed_n().is_some_and(|n| (n - force_n).abs() <= 0.5f64.max(0.05 * force_n));
        let felt = !matches!(observation.hand.state, SlipState::NoContact);
        if observation.gripper.jaws == Jaws::Holding && pressed && felt {
            let stands_ns = *self.stands_since_ns.get_or_insert(observation.now_ns);
            if observation.now_ns.saturating_sub(stands_ns) >= SETTLE_NS {
                return Grasped::Yes;
            }
        } else {
            self.stands_since_ns = None;
        }
        let nothing = matches!(observation.gripper.jaws, Jaws::Nothing | Jaws::Lost);
        if nothing || observation.now_ns.saturating_sub(since_ns) > LONGEST_NS {
            return Grasped::Never(Ending::NothingHeld);
        }
        Grasped::NotYet(GripDecision { force_n, arm: ArmMotion::Pause })
    }
}
