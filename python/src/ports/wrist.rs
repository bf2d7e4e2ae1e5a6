//! A wrist written in Python: motions in, states out.

use super::{FirstException, WristCommand, WristState, failure};
use crate::errors::WristError as PyWristError;
use pyo3::prelude::*;
use slipbound::port::{
    Wrist, WristCommand as CoreWristCommand, WristError, WristErrorKind, WristState as CoreWristState,
};

/// A wrist whose calls are methods of a Python object.
pub struct PythonWrist {
    pub object: Py<PyAny>,
    pub raised: FirstException,
}

impl PythonWrist {
    fn failure(&self, error: PyErr) -> WristError {
        let (kind, text) = failure::<PyWristError, _>(error, &self.raised, WristErrorKind::Other);
        WristError::new(kind, text)
    }
}

impl Wrist for PythonWrist {
    fn command(&mut self, command: CoreWristCommand) -> Result<(), WristError> {
        let command = WristCommand::from(command);
        let done = Python::attach(|py| self.object.call_method1(py, "command", (command,)).map(drop));
        done.map_err(|e| self.failure(e))
    }

    fn poll(&mut self) -> Result<CoreWristState, WristError> {
        let state = Python::attach(|py| {
            let got = self.object.bind(py).call_method0("poll")?;
            Ok(CoreWristState::from(got.cast::<WristState>()?.get()))
        });
        state.map_err(|e| self.failure(e))
    }
}
