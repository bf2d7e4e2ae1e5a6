//! Ports of the control loop that are written in Python. The first exception raised by any of them is kept; the driver
//! of the loop then leaves it and raises the exception again.

use crate::cycle::Cycle;
use crate::errors::{GripperError as PyGripperError, WristError as PyWristError, data};
use crate::picture::{Picture, buffer};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::grip::{ArmMotion, GripController, GripDecision};
use slipbound::hand::HandReport;
use slipbound::image::{ByteOrder, Frame};
use slipbound::port::{
    Clock, FrameBuffer, FrameSource, GripCommand, Gripper, GripperError, GripperErrorKind,
    GripperState as CoreGripperState, Next, SourceError, SourceErrorKind, Wrist, WristCommand as CoreWristCommand,
    WristError, WristErrorKind, WristMotion, WristState as CoreWristState,
};
use std::sync::{Arc, Mutex, PoisonError};

/// The first exception of a port.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
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
pub struct Held(Arc<Mutex<Option<Py<PyAny>>>>);

impl Held {
    pub fn new(object: Py<PyAny>) -> Self {
        Held(Arc::new(Mutex::new(Some(object))))
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

/// The variant of this name, or the other one.
fn kind_of<K: serde::de::DeserializeOwned>(py: Python<'_>, error: &PyErr, otherwise: K) -> K {
    let word = error.value(py).getattr("kind").and_then(|kind| kind.extract::<String>());
    word.ok().and_then(|word| serde_json::from_value(word.into()).ok()).unwrap_or(otherwise)
}

/// The state of a gripper.
///
/// Parameters
/// ----------
/// time_ns : int
///     Time of this state on the clock of the loop.
/// force_n : float or None
///     Measured normal force per finger in newtons, as it reads.
/// force_error_n : float or None
///     Error bound of that, in newtons per finger.
/// target_n : float or None
///     The force per finger it last accepted.
/// opening_mm : float or None
///     Distance between the fingertips.
/// jaws : str
///     ``unknown``, ``open``, ``closing``, ``holding``, ``nothing``, ``lost`` or ``stopped``.
#[pyclass(frozen, get_all, module = "slipbound.control")]
#[derive(Clone)]
pub struct GripperState {
    time_ns: u64,
    force_n: Option<f64>,
    force_error_n: Option<f64>,
    target_n: Option<f64>,
    opening_mm: Option<f64>,
    jaws: String,
}

#[pymethods]
impl GripperState {
    #[new]
    #[pyo3(signature = (time_ns, *, force_n = None, force_error_n = None, target_n = None, opening_mm = None, jaws = "unknown"))]
    fn new(
        time_ns: u64,
        force_n: Option<f64>,
        force_error_n: Option<f64>,
        target_n: Option<f64>,
        opening_mm: Option<f64>,
        jaws: &str,
    ) -> PyResult<Self> {
        let state = GripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws: jaws.to_owned() };
        CoreGripperState::try_from(&state)?;
        Ok(state)
    }

    fn __repr__(&self) -> String {
        let GripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws } = self;
        format!(
            "GripperState(time_ns={time_ns}, force_n={}, force_error_n={}, target_n={}, opening_mm={}, jaws={jaws:?})",
            shown(*force_n),
            shown(*force_error_n),
            shown(*target_n),
            shown(*opening_mm)
        )
    }
}

fn shown(number: Option<f64>) -> String {
    number.map_or_else(|| "None".into(), |n| n.to_string())
}

impl TryFrom<&GripperState> for CoreGripperState {
    type Error = PyErr;
    fn try_from(state: &GripperState) -> PyResult<Self> {
        let GripperState { time_ns, force_n, force_error_n, target_n, opening_mm, ref jaws } = *state;
        let jaws = serde_json::from_value(jaws.as_str().into())
            .map_err(|e| crate::errors::SettingError::new_err(format!("jaws: {e}")))?;
        for (name, value) in
            [("force_n", force_n), ("force_error_n", force_error_n), ("target_n", target_n), ("opening_mm", opening_mm)]
        {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                let text = format!("{name}: expected a finite number or None, got {value}");
                return Err(crate::errors::SettingError::new_err(text));
            }
        }
        Ok(CoreGripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws })
    }
}

impl From<&CoreGripperState> for GripperState {
    fn from(state: &CoreGripperState) -> Self {
        let CoreGripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws } = *state;
        let jaws = crate::errors::word(&jaws).unwrap_or_default();
        GripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws }
    }
}

/// The state of a wrist.
///
/// Parameters
/// ----------
/// time_ns : int
///     Time of this state on the clock of the loop.
/// angle_rad : float
///     Angle about the axis along the fingers since the start.
/// lowered_mm : float
///     Distance lowered since the start.
/// moving : bool
///     Whether it moves.
#[pyclass(frozen, get_all, module = "slipbound.control")]
#[derive(Clone)]
pub struct WristState {
    time_ns: u64,
    angle_rad: f64,
    lowered_mm: f64,
    moving: bool,
}

#[pymethods]
impl WristState {
    #[new]
    #[pyo3(signature = (time_ns, *, angle_rad = 0.0, lowered_mm = 0.0, moving = false))]
    fn new(time_ns: u64, angle_rad: f64, lowered_mm: f64, moving: bool) -> PyResult<Self> {
        if !(angle_rad.is_finite() && lowered_mm.is_finite()) {
            let text = format!("expected finite angle_rad and lowered_mm, got {angle_rad} and {lowered_mm}");
            return Err(crate::errors::SettingError::new_err(text));
        }
        Ok(WristState { time_ns, angle_rad, lowered_mm, moving })
    }
}

/// A command to a wrist: a motion, its bounds, and how long it may go on without being renewed.
#[pyclass(frozen, get_all, module = "slipbound.control")]
#[derive(Clone)]
pub struct WristCommand {
    /// `turn`, `lower` or `pause`.
    motion: String,
    /// Rate in rad/s while it turns, positive from Y to Z; else 0.
    rate_rad_per_s: f64,
    /// Angle after which it stops by itself.
    most_rad: f64,
    /// Rate in mm/s while it lowers, positive downwards; else 0.
    rate_mm_per_s: f64,
    /// Distance after which it stops by itself.
    most_mm: f64,
    /// Time after which it pauses unless a new command has come.
    time_to_live_ns: u64,
}

impl From<CoreWristCommand> for WristCommand {
    fn from(command: CoreWristCommand) -> Self {
        let (motion, [rate_rad_per_s, most_rad, rate_mm_per_s, most_mm]) = match command.motion {
            WristMotion::Turn { rate_rad_per_s, most_rad } => ("turn", [rate_rad_per_s, most_rad, 0.0, 0.0]),
            WristMotion::Lower { rate_mm_per_s, most_mm } => ("lower", [0.0, 0.0, rate_mm_per_s, most_mm]),
            WristMotion::Pause => ("pause", [0.0; 4]),
        };
        let time_to_live_ns = command.time_to_live_ns;
        WristCommand { motion: motion.into(), rate_rad_per_s, most_rad, rate_mm_per_s, most_mm, time_to_live_ns }
    }
}

#[pymethods]
impl WristCommand {
    fn __repr__(&self) -> String {
        match self.motion.as_str() {
            "turn" => format!("<WristCommand turn {} rad/s>", self.rate_rad_per_s),
            "lower" => format!("<WristCommand lower {} mm/s>", self.rate_mm_per_s),
            _ => "<WristCommand pause>".into(),
        }
    }
}

/// What a source returns instead of a frame when the camera is there but gave none. The end of the recording is None.
#[pyclass(eq, frozen, hash, module = "slipbound.control")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub enum NoFrame {
    /// No frame within the duration of a frame; more may come.
    #[pyo3(name = "SILENT")]
    Silent,
    /// A frame came but cannot be decoded completely.
    #[pyo3(name = "TORN")]
    Torn,
}

/// A source whose `next` is a method of a Python object.
pub struct PythonSource {
    pub object: Held,
    pub order: ByteOrder,
    pub raised: Raised,
    pub frames_count: u64,
}

impl PythonSource {
    fn read(&self, py: Python<'_>, into: &mut FrameBuffer) -> PyResult<Next> {
        let got = self.object.bind(py)?.call_method0("next")?;
        if got.is_none() {
            return Ok(Next::End);
        }
        if let Ok(kind) = got.cast::<NoFrame>() {
            return Ok(match kind.get() {
                NoFrame::Silent => Next::Silent,
                NoFrame::Torn => {
                    (into.seq, into.time_ns) = (self.frames_count, None);
                    Next::Torn { reason: "the source said so".into() }
                }
            });
        }
        let (array, time_ns) = match got.cast::<PyTuple>() {
            Ok(pair) => (pair.get_item(0)?, crate::monitor::time(pair.get_item(1)?.extract()?)?),
            Err(_) => (got, None),
        };
        let picture = Picture::new(&array, self.order)?;
        let mut scratch = Vec::new();
        let pixels = picture.pixels(&mut scratch)?;
        *into = buffer(&Frame { pixels, seq: self.frames_count, time_ns });
        into.clock = if time_ns.is_some() { Clock::Device } else { Clock::Unknown };
        Ok(Next::Frame)
    }
}

impl FrameSource for PythonSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = Python::attach(|py| self.read(py, into));
        // A frame that never came has no number.
        self.frames_count += u64::from(!matches!(next, Ok(Next::Silent)));
        next.map_err(|e| SourceError::new(SourceErrorKind::Other, self.raised.keep(e)))
    }
}

/// A gripper whose calls are methods of a Python object.
pub struct PythonGripper {
    pub object: Py<PyAny>,
    pub raised: Raised,
}

impl PythonGripper {
    fn failure(&self, error: PyErr) -> GripperError {
        let kind = Python::attach(|py| {
            error.is_instance_of::<PyGripperError>(py).then(|| kind_of(py, &error, GripperErrorKind::Other))
        });
        match kind {
            Some(kind) => GripperError::new(kind, error.to_string()),
            None => GripperError::new(GripperErrorKind::Other, self.raised.keep(error)),
        }
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

/// A wrist whose calls are methods of a Python object.
pub struct PythonWrist {
    pub object: Py<PyAny>,
    pub raised: Raised,
}

impl PythonWrist {
    fn failure(&self, error: PyErr) -> WristError {
        let kind = Python::attach(|py| {
            error.is_instance_of::<PyWristError>(py).then(|| kind_of(py, &error, WristErrorKind::Other))
        });
        match kind {
            Some(kind) => WristError::new(kind, error.to_string()),
            None => WristError::new(WristErrorKind::Other, self.raised.keep(error)),
        }
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
            let WristState { time_ns, angle_rad, lowered_mm, moving } = *got.cast::<WristState>()?.get();
            Ok(CoreWristState { time_ns, angle_rad, lowered_mm, moving })
        });
        state.map_err(|e| self.failure(e))
    }
}

/// A controller whose `decide` is a method of a Python object. When it raises, the force stays and the arm waits.
pub struct PythonController {
    pub object: Held,
    pub raised: Raised,
    alarms_count: u32,
    wants_more: bool,
}

impl PythonController {
    pub fn new(object: Held, raised: Raised) -> Self {
        PythonController { object, raised, alarms_count: 0, wants_more: false }
    }

    fn ask(&mut self, now_ns: u64, hand: &HandReport, gripper: &CoreGripperState) -> PyResult<GripDecision> {
        Python::attach(|py| {
            let object = self.object.bind(py)?;
            let got = object.call_method1("decide", (now_ns, data(py, hand)?, GripperState::from(gripper)))?;
            let (force_n, goes) = match got.cast::<PyTuple>() {
                Ok(pair) => (pair.get_item(0)?.extract()?, pair.get_item(1)?.extract()?),
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

/// An observer that is called with every cycle; it keeps the newest one.
pub struct PythonObserver<'a> {
    pub call: Option<&'a Py<PyAny>>,
    pub raised: &'a Raised,
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
