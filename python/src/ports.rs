//! Ports of the control loop that are written in Python. The first exception raised by any of them is kept; the driver
//! of the loop then leaves it and raises the exception again.

mod controller;
mod gripper;
mod observer;
mod source;
mod states;
mod wrist;

pub use controller::PythonController;
pub use gripper::PythonGripper;
pub use observer::PythonObserver;
pub use source::{NoFrame, PythonSource};
pub use states::{GripperState, WristCommand, WristState};
pub use wrist::PythonWrist;

use pyo3::exceptions::PyTypeError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::PyTuple;
use serde::de::DeserializeOwned;
use std::sync::{Arc, Mutex, PoisonError};

/// The first exception of a port.
#[derive(Clone, Default)]
pub struct FirstException(Arc<Mutex<Option<PyErr>>>);

impl FirstException {
    /// Keeps an exception, unless there is one already; returns its text.
    pub fn keep(&self, error: PyErr) -> String {
        let text = error.to_string();
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        text
    }

    pub fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    pub fn is_set(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }
}

/// A Python object that a port calls. The owner of the port keeps a clone and shows it to the garbage collector: an
/// object that owns its own loop is a reference cycle.
#[derive(Clone)]
pub struct SharedObject(Arc<Mutex<Option<Py<PyAny>>>>);

impl SharedObject {
    pub fn new(object: Py<PyAny>) -> Self {
        SharedObject(Arc::new(Mutex::new(Some(object))))
    }

    /// The object; none after the garbage collector has broken the cycle.
    fn bind<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let object = held.as_ref().map(|object| object.bind(py).clone());
        object.ok_or_else(|| crate::errors::ClosedError::new_err("expected a loop in use, got one that was collected"))
    }

    /// For `__traverse__`, which must not wait.
    pub fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        match self.0.try_lock() {
            Ok(held) => visit.call(held.as_ref()),
            Err(_) => Ok(()), // in use: it is not garbage
        }
    }

    /// For `__clear__`.
    pub fn clear(&self) {
        let object = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        drop(object); // its finalizer finds the lock open
    }
}

/// The two values of a tuple that a port has returned; `expected` names the port and what it may return.
fn pair<'py>(got: &Bound<'py, PyTuple>, expected: &str) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    match got.len() {
        2 => Ok((got.get_item(0)?, got.get_item(1)?)),
        count => Err(PyTypeError::new_err(format!("{expected}, got a tuple of {count}"))),
    }
}

/// The variant of this name, or the other one.
fn kind_of<K: DeserializeOwned>(py: Python<'_>, error: &PyErr, otherwise: K) -> K {
    let word = error.value(py).getattr("kind").and_then(|kind| kind.extract::<String>());
    word.ok().and_then(|word| serde_json::from_value(word.into()).ok()).unwrap_or(otherwise)
}

/// An exception of a gripper or wrist as the kind and text of its error. Any other exception than the error `E` that the
/// port may raise is of the kind `other`, and is kept.
fn failure<E: PyTypeInfo, K: DeserializeOwned>(error: PyErr, raised: &FirstException, other: K) -> (K, String) {
    match Python::attach(|py| error.is_instance_of::<E>(py)) {
        true => (Python::attach(|py| kind_of(py, &error, other)), error.to_string()),
        false => (other, raised.keep(error)),
    }
}
