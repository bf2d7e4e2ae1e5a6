//! Failures of the crates as Python exceptions; no panic reaches Python.

use pyo3::prelude::*;
use slipbound::calibrate::CalibrationError as CannotCalibrate;
use slipbound::control::ControlError as CoreControlError;
use slipbound::monitor::RestError as NoRest;
use slipbound::port::SourceError as SourceFailure;
use slipbound::setting::SettingError as BadSetting;
use slipbound_rig::config;
use std::any::Any;
use std::error::Error;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, TryLockError};

pyo3::import_exception!(slipbound._errors, SettingError);
pyo3::import_exception!(slipbound._errors, FrameError);
pyo3::import_exception!(slipbound._errors, RestError);
pyo3::import_exception!(slipbound._errors, CalibrationError);
pyo3::import_exception!(slipbound._errors, SourceError);
pyo3::import_exception!(slipbound._errors, ClosedError);
pyo3::import_exception!(slipbound._errors, BusyError);
pyo3::import_exception!(slipbound._errors, InternalError);
pyo3::import_exception!(slipbound._errors, ControlError);
pyo3::import_exception!(slipbound._errors, GripperError);
pyo3::import_exception!(slipbound._errors, WristError);

/// Runs work that could panic; a panic becomes an exception of its own.
pub fn guarded<R>(work: impl FnOnce() -> PyResult<R>) -> PyResult<R> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(internal(text_of(&*panic))))
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

/// A fault inside slipbound.
pub fn internal(what: impl Display) -> PyErr {
    InternalError::new_err(format!("a fault inside slipbound, please report it: {what}"))
}

/// Locks what one thread uses at a time.
pub fn exclusive<'a, T>(mutex: &'a Mutex<T>, what: &str) -> PyResult<MutexGuard<'a, T>> {
    match mutex.try_lock() {
        Ok(guard) => Ok(guard),
        Err(TryLockError::WouldBlock) => Err(BusyError::new_err(format!(
            "one {what} is used twice at the same time: give each thread its own, or a lock around it; what it calls (a \
             controller, an observer) cannot use it"
        ))),
        Err(TryLockError::Poisoned(_)) => Err(internal(format!("this {what} met a fault before"))),
    }
}

pub fn setting(error: BadSetting) -> PyErr {
    SettingError::new_err(error.to_string())
}

/// The exception for a file that cannot be read, with `errno` and `filename` like an `OSError`.
pub fn config(error: config::Error) -> PyErr {
    let exception = SettingError::new_err(error.to_string());
    if let config::Error::Read { path, source } = &error {
        Python::attach(|py| of_file(py, &exception, source.raw_os_error(), &path.display().to_string()));
    }
    exception
}

/// Sets `errno` and `filename`. An exception that takes no attribute keeps its text all the same.
fn of_file(py: Python<'_>, exception: &PyErr, errno: Option<i32>, file: &str) {
    let _ = exception.value(py).setattr("errno", errno);
    let _ = exception.value(py).setattr("filename", file);
}

pub fn rest(error: NoRest) -> PyErr {
    RestError::new_err(error.to_string())
}

pub fn calibration(error: CannotCalibrate) -> PyErr {
    CalibrationError::new_err(error.to_string())
}

/// The number of the operating system's failure behind an error.
fn errno_of(error: &(dyn Error + 'static)) -> Option<i32> {
    let mut cause = Some(error);
    while let Some(error) = cause {
        if let Some(io) = error.downcast_ref::<std::io::Error>() {
            return io.raw_os_error();
        }
        cause = error.source();
    }
    None
}

/// The exception with its kind as an attribute, and `errno` and `filename` where a file failed.
pub fn source(py: Python<'_>, error: SourceFailure) -> PyErr {
    let exception = SourceError::new_err(error.to_string());
    if let Ok(kind) = word(&error.kind) {
        // An exception that takes no attribute keeps its text all the same.
        let _ = exception.value(py).setattr("kind", kind);
    }
    if let Some(file) = &error.file {
        // A file that is checked before it is opened has no error of the operating system.
        let missing = || std::fs::metadata(file).err().and_then(|e| e.raw_os_error());
        of_file(py, &exception, errno_of(&error).or_else(missing), file);
    }
    exception
}

/// The exception for a loop that was left, with its kind as an attribute.
pub fn control(error: &CoreControlError) -> PyErr {
    let kind = match error {
        CoreControlError::Source { .. } => "source",
        CoreControlError::Frame { .. } => "frame",
        CoreControlError::Setting { .. } => "setting",
        CoreControlError::Rest { .. } => "rest",
        CoreControlError::Touched { .. } => "touched",
        CoreControlError::Monitor { .. } => "monitor",
        CoreControlError::HeldForceUnknown => "held_force_unknown",
        CoreControlError::Fault { .. } => "fault",
        CoreControlError::Interrupted => "interrupted",
        _ => "other",
    };
    of_control(kind, error)
}

/// The exception of this kind and text.
pub fn of_control(kind: &str, text: impl Display) -> PyErr {
    let exception = ControlError::new_err(text.to_string());
    // An exception that takes no attribute keeps its text all the same.
    let _ = Python::attach(|py| exception.value(py).setattr("kind", kind));
    exception
}

/// A variant as written in JSON, such as `no_contact`.
pub fn word(value: &impl serde::Serialize) -> PyResult<String> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => Ok(word),
        Ok(other) => Err(internal(format!("{other} is no word"))),
        Err(e) => Err(internal(e)),
    }
}

/// Plain data as the dict of its JSON.
pub fn data<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(internal)?;
    py.import("json")?.call_method1("loads", (text,))
}
