//! A reference controller that reads load and friction from the simulation. An object that it cannot hold with the same
//! gripper, or holds only while it slides, does not count against any controller.

use crate::hand::SimHand;
use slipbound::grip::{ArmMotion, GripController, GripDecision, GripLimits, MarginSettings};
use slipbound::hand::HandReport;
use slipbound::port::GripperState;

/// Force over the required force: reserve for the ripple of the load.
const OVER: f64 = 1.15;

/// Prediction horizon of the load, s: the gripper's delay, its lag and one period of the loop.
const AHEAD_S: f64 = 0.15;

/// Holds with the force that will be required when the gripper has reached it. Reduces the force at the same rate as
/// the controller `margin`, so that the two differ only in what they know.
pub struct Clairvoyant {
    hand: SimHand,
    limits: GripLimits,
    force_n: f64,
    /// Time, ns, and required force, N, of the last cycle.
    last: Option<(u64, f64)>,
}

impl Clairvoyant {
    /// Reads the simulation of this hand.
    pub fn new(hand: SimHand, limits: &GripLimits) -> Self {
        Clairvoyant { hand, limits: *limits, force_n: limits.start_n, last: None }
    }
}

impl GripController for Clairvoyant {
    fn decide(&mut self, now_ns: u64, _: &HandReport, _: &GripperState) -> GripDecision {
        let truth = self.hand.truth();
        let (then_ns, then_n) = self.last.replace((now_ns, truth.required_n)).unwrap_or((now_ns, truth.required_n));
        let elapsed_s = now_ns.saturating_sub(then_ns) as f64 * 1e-9;
        let growth_n_per_s = if elapsed_s > 0.0 { (truth.required_n - then_n) / elapsed_s } else { 0.0 };
        let wanted_n = OVER * (truth.required_n + AHEAD_S * growth_n_per_s.max(0.0));
        let release_n = MarginSettings::default().release_n(self.force_n, wanted_n, elapsed_s);
        self.force_n = wanted_n.max(self.force_n - release_n);
        self.force_n = self.force_n.clamp(self.limits.least_n, self.limits.most_n);
        let behind = truth.required_n > truth.grip_force_n && self.force_n < self.limits.most_n;
        GripDecision { force_n: self.force_n, arm: if behind { ArmMotion::Pause } else { ArmMotion::Go } }
    }

    fn alarms_count(&self) -> u32 {
        0
    }

    fn wants_more(&self) -> bool {
        self.force_n >= self.limits.most_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::HandScene;
    use crate::lockstep::LockStep;
    use slipbound::grip::Guard;
    use slipbound::monitor::Settings;
    use slipbound::task::{TaskKind, TaskSettings};

    #[test]
    fn it_holds_a_slippery_bottle_with_little_more_than_it_takes() {
        let scene = HandScene::parse("lift?seed=2&mu=0.25&fingers=1").expect("a scene");
        let hand = SimHand::new(&scene).expect("a hand");
        let settings = TaskSettings::default();
        let grip = Guard::new(Box::new(Clairvoyant::new(hand.clone(), &settings.grip)), settings.grip);
        let task = settings.task_with(TaskKind::Lift, grip, None).expect("a task");
        let mut lockstep = LockStep::around(&scene, hand, task, &Settings::default(), None).expect("a loop");
        lockstep.run(&|| false, &mut ()).expect("it runs");
        let score = lockstep.score();
        let over = score.over_squeeze_ratio().expect("more than the least was required");
        // After a pull the grip force falls by no more than 5 N/s: the mean is 1.79 times the required force.
        assert!(score.last.slid_mm < 1.0 && over < 1.9, "slid {} mm, {over}", score.last.slid_mm);
    }
}
