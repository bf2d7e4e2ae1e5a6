//! The Python package `slipbound`: arrays in, objects out. No defaults and no logic of the method live here.

mod control;
mod cycle;
mod errors;
mod field;
mod judge;
mod lab;
mod monitor;
mod overlay;
mod picture;
mod ports;
mod report;
mod sensor;
mod watch;

use pyo3::prelude::*;

/// Runs the command line with these arguments, the first of which is the program's name; returns its exit code.
#[pyfunction]
fn run(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> PyResult<u8> {
    py.detach(|| errors::guarded(|| Ok(slipbound_cli::run(arguments))))
}

#[pymodule]
fn _slipbound(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<monitor::Monitor>()?;
    m.add_class::<report::Report>()?;
    m.add_class::<report::Contact>()?;
    m.add_class::<report::Markers>()?;
    m.add_class::<report::Motion>()?;
    m.add_class::<report::Shear>()?;
    m.add_class::<report::Slip>()?;
    m.add_class::<report::Estimate>()?;
    m.add_class::<report::Evidence>()?;
    m.add_class::<field::Field>()?;
    m.add_class::<sensor::Sensor>()?;
    m.add_class::<sensor::Settings>()?;
    m.add_class::<watch::Watch>()?;
    m.add_class::<lab::Simulation>()?;
    m.add_class::<lab::SimulatedFrame>()?;
    m.add_class::<lab::Truth>()?;
    m.add_class::<control::Loop>()?;
    m.add_class::<control::HandRun>()?;
    m.add_class::<cycle::Cycle>()?;
    m.add_class::<control::PyTaskSettings>()?;
    m.add_class::<ports::NoFrame>()?;
    m.add_class::<ports::GripperState>()?;
    m.add_class::<ports::WristState>()?;
    m.add_class::<ports::WristCommand>()?;
    m.add_function(wrap_pyfunction!(run, m)?)?;
    m.add_function(wrap_pyfunction!(report::full_line, m)?)?;
    m.add_function(wrap_pyfunction!(sensor::sensors_built_in, m)?)?;
    m.add_function(wrap_pyfunction!(sensor::calibrate, m)?)?;
    m.add_function(wrap_pyfunction!(watch::watch, m)?)?;
    m.add_function(wrap_pyfunction!(overlay::overlay, m)?)?;
    m.add_function(wrap_pyfunction!(lab::simulate, m)?)?;
    m.add_function(wrap_pyfunction!(judge::judge_ramp, m)?)?;
    m.add_function(wrap_pyfunction!(judge::ramps_tables, m)?)?;
    Ok(())
}
