//! What an observer receives after a cycle of the control loop.

use crate::errors::{data, of_control, word};
use crate::field::Kept;
use crate::picture::{array, byte_order};
use crate::report::Report;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use slipbound::control::{Cycle as CoreCycle, CycleOutcome, CycleView, FaultKind};
use slipbound::monitor::SlipReport;
use slipbound::port::{FrameBuffer, Next};
use std::sync::Arc;

/// A finger in a cycle.
struct Seen {
    name: String,
    /// None where it was torn.
    frame: Option<FrameBuffer>,
    report: Option<(SlipReport, Arc<Kept>)>,
}

struct Inner {
    now_ns: u64,
    outcome: &'static str,
    has_ended: bool,
    /// Whether the run is over, or the text of the fault that has ended it.
    is_over: Result<bool, String>,
    record: Option<CoreCycle>,
    fingers: Vec<Seen>,
    fault: Option<(FaultKind, String)>,
}

/// A cycle of the control loop: what was measured and commanded.
#[pyclass(frozen, module = "slipbound.control")]
#[derive(Clone)]
pub struct Cycle(Arc<Inner>);

impl Cycle {
    pub fn of(view: &CycleView<'_>) -> Self {
        let outcome = match view.outcome {
            None => "left",
            Some(CycleOutcome::FindingRest) => "at_rest",
            Some(CycleOutcome::Waiting) => "waiting",
            Some(CycleOutcome::Commanded(_)) => "commanded",
            Some(CycleOutcome::SourceEnded) => "source_ended",
        };
        let fingers = view.fingers.iter().map(|finger| {
            let report = finger.report.zip(finger.monitor).map(|(report, monitor)| {
                (*report, Arc::new(Kept::of(monitor, Arc::new(monitor.sensor().clone()), report)))
            });
            let is_torn = matches!(finger.next, Next::Torn { .. });
            Seen { name: finger.name.to_owned(), frame: (!is_torn).then(|| finger.frame.clone()), report }
        });
        Cycle(Arc::new(Inner {
            now_ns: view.now_ns,
            outcome,
            has_ended: view.outcome.is_some_and(CycleOutcome::has_ended),
            is_over: view.outcome.map_or(Ok(true), |outcome| outcome.is_over(view.fault)).map_err(|e| e.to_string()),
            record: view.cycle(),
            fingers: fingers.collect(),
            fault: view.fault.map(|fault| (fault.kind, fault.text.to_string())),
        }))
    }
}

#[pymethods]
impl Cycle {
    /// Time of the loop in ns.
    #[getter]
    fn now_ns(&self) -> u64 {
        self.0.now_ns
    }

    /// `at_rest` while the rest frames of the fingers are determined, `waiting` for gripper or wrist, `commanded`,
    /// `source_ended`, or `left` after an error.
    #[getter]
    fn outcome(&self) -> &str {
        self.0.outcome
    }

    /// Whether the task has ended.
    #[getter]
    fn has_ended(&self) -> bool {
        self.0.has_ended
    }

    /// Whether the run is over: the task or a source of frames has ended, or the loop was left.
    ///
    /// Returns
    /// -------
    /// bool
    ///     Whether no further cycle is needed.
    ///
    /// Raises
    /// ------
    /// slipbound.ControlError
    ///     When only a time was over, or a source, while gripper or wrist had a fault: the fault has ended the work.
    fn is_over(&self) -> PyResult<bool> {
        self.0.is_over.as_ref().copied().map_err(|text| of_control("fault", text))
    }

    /// The force per finger that was commanded, N; None for a release, and where nothing was commanded.
    #[getter]
    fn force_n(&self) -> Option<f64> {
        self.0.record.as_ref().and_then(|record| record.grip_command.force_n())
    }

    /// Slips of the hand that have begun so far.
    #[getter]
    fn slips_count(&self) -> u32 {
        self.0.record.as_ref().map_or(0, |record| record.slips_count)
    }

    /// The report of the hand; None where nothing was commanded.
    #[getter]
    fn state(&self) -> PyResult<Option<String>> {
        self.0.record.as_ref().map(|record| word(&record.hand.state)).transpose()
    }

    /// The present fault of gripper or wrist.
    #[getter]
    fn fault(&self) -> Option<&str> {
        self.0.fault.as_ref().map(|(_, text)| text.as_str())
    }

    /// Its kind: `gripper_` or `wrist_` and the kind of the error, as in `gripper_link`; `gripper_stopped`,
    /// `jaws_unknown`, `force_shortfall`, `hold_ended`, `wrist_stands` or `other`.
    #[getter]
    fn fault_kind(&self) -> PyResult<Option<String>> {
        let Some((kind, _)) = &self.0.fault else { return Ok(None) };
        Ok(Some(match kind {
            FaultKind::Gripper(kind) => format!("gripper_{}", word(kind)?),
            FaultKind::Wrist(kind) => format!("wrist_{}", word(kind)?),
            FaultKind::GripperStopped => "gripper_stopped".into(),
            FaultKind::JawsUnknown => "jaws_unknown".into(),
            FaultKind::ForceShortfall => "force_shortfall".into(),
            FaultKind::HoldEnded => "hold_ended".into(),
            FaultKind::WristStands => "wrist_stands".into(),
            _ => "other".into(),
        }))
    }

    /// The report of every finger; None where no frame was judged.
    #[getter]
    fn reports(&self) -> Vec<Option<Report>> {
        let report = |finger: &Seen| {
            let (report, kept) = finger.report.as_ref()?;
            let (report, kept, frame) = (*report, kept.clone(), report.seq);
            Some(Report { report, kept, finger: finger.name.clone(), frame, waiting: None })
        };
        self.0.fingers.iter().map(report).collect()
    }

    /// The newest frame of a finger as an array; None before the first, and where it was torn.
    ///
    /// Parameters
    /// ----------
    /// finger : int
    ///     Its place among the fingers, from 0.
    /// order : {"BGR", "RGB"}
    ///     Order of the channels.
    #[pyo3(signature = (finger = 0, *, order = "BGR"))]
    fn image<'py>(&self, py: Python<'py>, finger: usize, order: &str) -> PyResult<Option<Bound<'py, PyArrayDyn<u8>>>> {
        let order = byte_order(order)?;
        let Some(seen) = self.0.fingers.get(finger) else {
            let count = self.0.fingers.len();
            return Err(pyo3::exceptions::PyIndexError::new_err(format!("finger {finger} of {count}")));
        };
        let Some(FrameBuffer { pixels, size, format, .. }) = &seen.frame else { return Ok(None) };
        (size.area() > 0).then(|| array(py, pixels.clone(), *size, *format, order)).transpose()
    }

    /// The record of the cycle, as a line of `reports.jsonl`; None where nothing was commanded.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.0.record.as_ref().map(|record| data(py, record)).transpose()
    }

    fn __repr__(&self) -> String {
        let (s, outcome) = (self.0.now_ns as f64 * 1e-9, self.0.outcome);
        format!("<slipbound.control.Cycle at {s:.3} s: {outcome}>")
    }
}
