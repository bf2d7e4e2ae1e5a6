//! A controller of the grip force written in Python: hand report in, force and arm motion out.

use super::{FirstException, GripperState, SharedObject, pair};
use crate::errors::data;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use slipbound::grip::{ArmMotion, GripController, GripDecision};
use slipbound::hand::HandReport;
use slipbound::port::GripperState as CoreGripperState;

const EXPECTED: &str = "Controller.decide: expected force_n or (force_n, whether the arm goes)";

/// A controller whose `decide` is a method of a Python object. When it raises, the force stays and the arm waits.
pub struct PythonController {
    pub object: SharedObject,
    pub raised: FirstException,
    alarms_count: u32,
    wants_more: bool,
}

impl PythonController {
    pub fn new(object: SharedObject, raised: FirstException) -> Self {
        PythonController { object, raised, alarms_count: 0, wants_more: false }
    }

    fn ask(&mut self, now_ns: u64, hand: &HandReport, gripper: &CoreGripperState) -> PyResult<GripDecision> {
        Python::attach(|py| {
            let object = self.object.bind(py)?;
            let got = object.call_method1("decide", (now_ns, data(py, hand)?, GripperState::from(gripper)))?;
            let (force_n, goes) = match got.cast::<PyTuple>() {
                Ok(tuple) => {
                    let (force_n, goes) = pair(tuple, EXPECTED)?;
                    (force_n.extract()?, goes.extract()?)
                }
                Err(_) => (got.extract()?, true),
            };
            self.alarms_count = object.getattr("alarms_count")?.extract()?;
            self.wants_more = object.getattr("wants_more")?.extract()?;
            Ok(GripDecision { force_n, arm: if goes { ArmMotion::Go } else { ArmMotion::Pause } })
        })
    }
}

impl GripController for PythonController {
    fn decide(&mut self, now_ns: u64, hand: &HandReport, gripper: &CoreGripperState) -> GripDecision {
        self.ask(now_ns, hand, gripper).unwrap_or_else(|error| {
            self.raised.keep(error);
            // The guard around every controller keeps the force when it receives no number.
            GripDecision { force_n: f64::NAN, arm: ArmMotion::Pause }
        })
    }

    fn alarms_count(&self) -> u32 {
        self.alarms_count
    }

    fn wants_more(&self) -> bool {
        self.wants_more
    }
}
