//! A detector written in Python, judged by the protocol `ramps`: the trials, definitions and tables of `slipbound eval`.

use crate::errors::{data, guarded, internal, setting, source as source_error};
use crate::field::Kept;
use crate::picture::array;
use crate::ports::FirstException;
use crate::report::Report;
use pyo3::prelude::*;
use slipbound::image::ByteOrder;
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;
use slipbound_lab::eval::custom_detector::{CustomDetector, judge, rivals};
use slipbound_lab::eval::ramps::Ramps;
use slipbound_lab::eval::{EvalError, Protocol as _, TrialRecord};
use std::sync::Arc;

/// A Python object with `begin`, `see` and `restart`. After its first exception it is not called again.
struct PythonDetector {
    detector: Py<PyAny>,
    sensor: Option<Arc<Sensor>>,
    raised: FirstException,
}

impl PythonDetector {
    fn ask<R: Default>(&self, ask: impl FnOnce(Python<'_>, &Bound<'_, PyAny>) -> PyResult<R>) -> R {
        if self.raised.is_set() {
            return R::default();
        }
        Python::attach(|py| {
            let asked = py.check_signals().and_then(|()| ask(py, self.detector.bind(py)));
            asked.unwrap_or_else(|error| {
                self.raised.keep(error);
                R::default()
            })
        })
    }
}

impl CustomDetector for PythonDetector {
    fn begin(&mut self) {
        self.sensor = None;
        self.ask(|_, detector| detector.call_method0("begin").map(drop));
    }

    fn see(&mut self, frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) -> f64 {
        let sensor = self.sensor.get_or_insert_with(|| Arc::new(monitor.sensor().clone())).clone();
        self.ask(|py, detector| {
            let kept = Arc::new(Kept::of(monitor, sensor, report));
            let seen = Report { report: *report, kept, finger: "finger".into(), frame: frame.seq, waiting: None };
            let image = array(py, frame.pixels.clone(), frame.size, frame.format, ByteOrder::Bgr)?;
            detector.call_method1("see", (seen, image))?.extract()
        })
    }

    fn restart(&mut self) {
        self.ask(|_, detector| detector.call_method0("restart").map(drop));
    }
}

/// The records of one ramp as dicts; `trial`: the seed of the sweep, and the trial's number. See the package's
/// `lab.judge_ramps`.
#[pyfunction]
pub fn judge_ramp<'py>(
    py: Python<'py>,
    detector: Py<PyAny>,
    name: &str,
    threshold: f64,
    trial: (u64, u64),
    beside: Vec<String>,
) -> PyResult<Bound<'py, PyAny>> {
    let raised = FirstException::default();
    let mut python_detector = PythonDetector { detector, sensor: None, raised: raised.clone() };
    let beside: Vec<&str> = beside.iter().map(String::as_str).collect();
    let beside = rivals(&beside).map_err(setting)?;
    let (seed, number) = trial;
    let ramps = Ramps::new(seed, None);
    let judged =
        py.detach(|| guarded(|| Ok(judge(&ramps, number, (name, threshold, &mut python_detector), &beside))))?;
    if let Some(error) = raised.take() {
        return Err(error);
    }
    let records = judged.map_err(|error| match error {
        EvalError::Setting(error) => setting(error),
        EvalError::Source(error) => source_error(py, error),
        other => internal(other),
    })?;
    data(py, &records)
}

/// The tables of `slipbound eval ramps` from records of `judge_ramp`, as Markdown.
#[pyfunction]
pub fn ramps_tables(py: Python<'_>, records: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    let lines: String = py.import("json")?.call_method1("dumps", (records,))?.extract()?;
    let records: Vec<TrialRecord> = serde_json::from_str(&lines)
        .map_err(|e| crate::errors::SettingError::new_err(format!("records: expected those of judge_ramps: {e}")))?;
    let tables = Ramps::new(0, None).tables(&records);
    Ok(tables.iter().filter(|table| !table.rows.is_empty()).map(|table| table.markdown()).collect())
}
