//! An observer of the loop written in Python: cycles in.

use super::FirstException;
use crate::cycle::Cycle;
use pyo3::prelude::*;
use slipbound::control::{CycleObserver, CycleView};

/// An observer that is called with every cycle; it keeps the newest one.
pub struct PythonObserver<'a> {
    pub call: Option<&'a Py<PyAny>>,
    pub raised: &'a FirstException,
    pub newest: Option<Cycle>,
}

impl CycleObserver for PythonObserver<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let cycle = Cycle::of(view);
        if let Some(call) = self.call
            && let Err(error) = Python::attach(|py| call.call1(py, (cycle.clone(),)))
        {
            self.raised.keep(error);
        }
        self.newest = Some(cycle);
    }
}
