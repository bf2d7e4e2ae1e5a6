//! Holds with a constant force: the baseline for the other controllers.

use super::controller::{ArmMotion, GripController, GripDecision, GripLimits};
use crate::hand::HandReport;
use crate::port::GripperState;

/// Always commands the starting force.
#[derive(Debug, Clone)]
pub struct Constant {
    force_n: f64,
    alarms_count: u32,
    slipping: bool,
}

impl Constant {
    /// Holds with the starting force of the limits.
    pub fn new(limits: &GripLimits) -> Self {
        Constant { force_n: limits.start_n, alarms_count: 0, slipping: false }
    }
}

impl GripController for Constant {
    fn decide(&mut self, _now_ns: u64, hand: &HandReport, _gripper: &GripperState) -> GripDecision {
        let slips = hand.state.is_slip();
        self.alarms_count += u32::from(slips && !self.slipping);
        self.slipping = slips;
        GripDecision { force_n: self.force_n, arm: ArmMotion::Go }
    }

    fn alarms_count(&self) -> u32 {
        self.alarms_count
    }

    fn wants_more(&self) -> bool {
        self.alarms_count > 0
    }
}
