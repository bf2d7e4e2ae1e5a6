//! What screwing and unscrewing share: take hold, turn while the controller lets the wrist go, watch the shear.

use super::grasp::{Grasp, Grasped};
use super::shear_watch::ShearWatch;
use super::{Ending, Moment, PAUSE, Phase, TaskStep, turn};
use crate::grip::{GripController, Guard};
use crate::hand::Allowed;
use crate::port::{GripCommand, Jaws, Motion};

/// A cap being turned.
#[derive(Debug)]
pub(super) struct Turning {
    pub grip: Guard,
    rate_rad_per_s: f64,
    most_rad: f64,
    allowed: Allowed,
    grasp: Grasp,
    phase: Phase,
    start_rad: Option<f64>,
    shear: ShearWatch,
    last: GripCommand,
}

/// What the end of a turn is judged by.
pub(super) struct Evidence<'a> {
    /// Shear of the gels around the axis over the turn, in the sense of the task.
    pub shear: &'a ShearWatch,
    /// How far the wrist has turned, in the sense of the task, rad.
    pub turned_rad: f64,
    /// Slip was seen at the largest force.
    pub slip_at_most: bool,
}

impl Turning {
    pub fn new(grip: Guard, rate_rad_per_s: f64, most_rad: f64, allowed: Allowed) -> Self {
        let last = GripCommand { force_n: grip.limits().start_n, motion: Motion::Pause };
        Turning {
            grip,
            rate_rad_per_s,
            most_rad,
            allowed,
            grasp: Grasp::default(),
            phase: Phase::Grasping,
            start_rad: None,
            shear: ShearWatch::new(),
            last,
        }
    }

    pub fn step(&mut self, moment: &Moment<'_>, end: impl Fn(Evidence<'_>) -> Option<Ending>) -> TaskStep {
        match self.phase {
            Phase::Grasping => match self.grasp.step(moment, &self.grip) {
                Grasped::NotYet(grip) => self.last = grip,
                Grasped::Yes => self.phase = Phase::Working,
                Grasped::Never(ending) => self.phase = Phase::Ended(ending),
            },
            Phase::Ended(_) => {}
            _ => self.work(moment, end),
        }
        let wrist = if self.phase == Phase::Working { turn(self.rate_rad_per_s) } else { PAUSE };
        TaskStep { grip: self.last, wrist, phase: self.phase }
    }

    fn work(&mut self, moment: &Moment<'_>, end: impl Fn(Evidence<'_>) -> Option<Ending>) {
        let start_rad = *self.start_rad.get_or_insert(moment.wrist.angle_rad);
        let sense = self.rate_rad_per_s.signum();
        let turned_rad = sense * (moment.wrist.angle_rad - start_rad);
        let before = self.last;
        self.last = self.grip.command(moment.now_ns, &self.allowed.filter(moment.hand), moment.gripper);
        if self.last.force_n != before.force_n {
            self.shear.restart();
        }
        if let Some(shear) = moment.hand.shear_mm {
            self.shear.see(turned_rad, sense * shear.around);
        }
        let slip_at_most = self.last.force_n >= self.grip.limits().most_n && self.grip.wants_more();
        let ending = if moment.gripper.jaws == Jaws::Lost {
            Some(Ending::Lost)
        } else {
            end(Evidence { shear: &self.shear, turned_rad, slip_at_most })
                .or((turned_rad >= self.most_rad).then_some(Ending::Limit))
        };
        self.phase = match (ending, self.last.motion) {
            (Some(ending), _) => Phase::Ended(ending),
            (None, Motion::Go) => Phase::Working,
            (None, _) => Phase::Waiting,
        };
    }
}
