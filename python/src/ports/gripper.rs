//! A gripper written in Python: force commands in, states out.

use super::{FirstException, GripperState, failure};
use crate::errors::GripperError as PyGripperError;
use pyo3::prelude::*;
use slipbound::port::{GripCommand, Gripper, GripperError, GripperErrorKind, GripperState as CoreGripperState};

/// A gripper whose calls are methods of a Python object.
pub struct PythonGripper {
    pub object: Py<PyAny>,
    pub raised: FirstException,
}

impl PythonGripper {
    fn failure(&self, error: PyErr) -> GripperError {
        let (kind, text) = failure::<PyGripperError, _>(error, &self.raised, GripperErrorKind::Other);
        GripperError::new(kind, text)
    }
}

impl Gripper for PythonGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let force_n = command.force_n();
        let done = Python::attach(|py| self.object.call_method1(py, "command", (force_n,)).map(drop));
        done.map_err(|e| self.failure(e))
    }

    fn poll(&mut self) -> Result<CoreGripperState, GripperError> {
        let state = Python::attach(|py| {
            let got = self.object.bind(py).call_method0("poll")?;
            CoreGripperState::try_from(got.cast::<GripperState>()?.get())
        });
        state.map_err(|e| self.failure(e))
    }
}
