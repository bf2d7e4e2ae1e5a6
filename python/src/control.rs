//! The control loop, and simulated hands around it, driven from Python cycle by cycle.

use crate::cycle::Cycle;
use crate::errors::{
    config as config_error, control as control_error, data, exclusive, guarded, internal, of_control, setting,
};
use crate::monitor::rest_given;
use crate::picture::byte_order;
use crate::ports::{
    FirstException, NoFrame, PythonController, PythonGripper, PythonObserver, PythonSource, PythonWrist, SharedObject,
};
use crate::sensor::{Sensor, sensor_of, settings_of};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use slipbound::control::{ControlLoop as CoreLoop, CycleOutcome};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::grip::Guard;
use slipbound::hand::{Mounting, Side};
use slipbound::sensor::Sensor as CoreSensor;
use slipbound::setting::SettingError as BadSetting;
use slipbound::task::{ControllerKind, Task, TaskKind, TaskSettings};
use slipbound_lab::hand::{HandScene, SimHand};
use slipbound_lab::lockstep::{LockStep, LockStepError};
use slipbound_rig::config;
use std::path::PathBuf;
use std::sync::Mutex;

/// A task with the controller of the settings (None), the one of a name, or one written in Python, which is added to
/// `held`. Every finger must provide what the task needs; the gel is that of the first.
fn task_of(
    kind: TaskKind,
    controller: &Bound<'_, PyAny>,
    mut settings: TaskSettings,
    sensors: &[&CoreSensor],
    raised: &FirstException,
    held: &mut Vec<SharedObject>,
) -> PyResult<Box<dyn Task + Send>> {
    let stiffness_mpa_per_mm = sensors.first().and_then(|sensor| sensor.shear_stiffness_mpa_per_mm());
    let name = controller.extract::<&str>().ok();
    let is_own = name.is_none() && !controller.is_none();
    if let Some(name) = name {
        settings.controller = name.parse::<ControllerKind>().map_err(setting)?;
    } else if is_own {
        settings.controller = ControllerKind::default(); // theirs plays no part, nor does the end of `paper`
    }
    sensors.iter().try_for_each(|sensor| settings.check_finger(kind, sensor)).map_err(setting)?;
    let task = if is_own {
        let object = SharedObject::new(controller.clone().unbind());
        held.push(object.clone());
        let controller = Box::new(PythonController::new(object, raised.clone()));
        settings.check().map_err(setting)?;
        settings.task_with(kind, Guard::new(controller, settings.grip), stiffness_mpa_per_mm)
    } else {
        settings.task(kind, stiffness_mpa_per_mm)
    };
    task.map_err(setting)
}

/// The settings of a task: forces, controllers, timing. Read-only; other settings are made from TOML whose keys replace the
/// defaults.
///
/// Parameters
/// ----------
/// file : str, path or None
///     A ``FILE.toml``; None is the defaults.
#[pyclass(frozen, eq, module = "slipbound.control", name = "TaskSettings")]
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PyTaskSettings(TaskSettings);

#[pymethods]
impl PyTaskSettings {
    /// The defaults, or those of a `FILE.toml`.
    #[new]
    #[pyo3(signature = (file = None))]
    fn new(file: Option<PathBuf>) -> PyResult<Self> {
        guarded(|| config::load_task_settings(file.as_deref()).map(PyTaskSettings).map_err(config_error))
    }

    /// Settings from the text of a task settings file; its keys replace the defaults.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML, as ``slipbound settings`` prints it.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        guarded(|| config::parse_task_settings(text, "settings").map(PyTaskSettings).map_err(config_error))
    }

    /// The text of a task settings file with every setting in it.
    fn to_toml(&self) -> PyResult<String> {
        config::task_settings_to_toml(&self.0).map_err(internal)
    }

    /// Pickle stores the text, so that other processes can have it.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<PyTaskSettings>().getattr("from_toml")?, (self.to_toml()?,)))
    }

    /// All settings, with the names of the file as keys.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data(py, &self.0)
    }

    fn __repr__(&self) -> &'static str {
        if self.0 == TaskSettings::default() {
            "<slipbound.control.TaskSettings default>"
        } else {
            "<slipbound.control.TaskSettings>"
        }
    }
}

#[pymethods]
impl NoFrame {
    /// Its name: a copy is the same object, and pickle stores where to find it.
    fn __reduce__(&self) -> &'static str {
        match self {
            NoFrame::Silent => "NoFrame.SILENT",
            NoFrame::Torn => "NoFrame.TORN",
        }
    }
}

/// Task settings from an argument: None, settings, the text of a file, or the file. Text contains a `=` or more than
/// one line; a path that does, too, is given as `pathlib.Path`.
fn task_settings(argument: Option<&Bound<'_, PyAny>>) -> PyResult<TaskSettings> {
    let Some(argument) = argument else { return Ok(TaskSettings::default()) };
    if let Ok(settings) = argument.cast::<PyTaskSettings>() {
        return Ok(settings.get().0);
    }
    match argument.extract::<&str>() {
        Ok(text) if text.trim().is_empty() || text.contains(['=', '\n']) => Ok(PyTaskSettings::from_toml(text)?.0),
        _ => Ok(PyTaskSettings::new(Some(argument.extract()?))?.0),
    }
}

/// A cycle that has been made, or the reason why the loop was left.
fn finished(raised: &FirstException, outcome: PyResult<CycleOutcome>, newest: Option<Cycle>) -> PyResult<Cycle> {
    if let Some(error) = raised.take() {
        return Err(error);
    }
    outcome?;
    newest.ok_or_else(|| internal("a cycle that nobody was shown"))
}

/// The exception for a simulated hand that was left.
fn of_lock_step(error: &LockStepError) -> PyErr {
    match error {
        LockStepError::Control(error) => control_error(error),
        LockStepError::World(_) => of_control("world", error),
    }
}

/// The control loop around sources, gripper and wrist written in Python. See `slipbound.control.ControlLoop`.
#[pyclass(frozen, module = "slipbound.control")]
pub struct Loop {
    raised: FirstException,
    /// Objects that the sources and the controller of `control` call.
    held: Vec<SharedObject>,
    control: Mutex<Running>,
}

/// The loop, and the time of its last cycle.
struct Running {
    control: CoreLoop,
    last_ns: u64,
}

/// A finger as `slipbound.control.ControlLoop` passes it on.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct FingerRow<'py> {
    name: String,
    side: String,
    turn_rad: f64,
    sensor: Bound<'py, PyAny>,
    source: Py<PyAny>,
    settings: Option<Bound<'py, PyAny>>,
    rest: Bound<'py, PyAny>,
    refuses_touch: bool,
}

#[pymethods]
impl Loop {
    #[new]
    #[pyo3(signature = (fingers, task, controller, settings, order))]
    fn new(
        py: Python<'_>,
        fingers: Vec<FingerRow<'_>>,
        task: &str,
        controller: &Bound<'_, PyAny>,
        settings: Option<&Bound<'_, PyAny>>,
        order: &str,
    ) -> PyResult<Self> {
        let (raised, mut held) = (FirstException::default(), Vec::new());
        let order = byte_order(order)?;
        let mut pipelines: Vec<FingerPipeline> = Vec::new();
        for finger in fingers {
            let FingerRow { name, turn_rad, source: object, rest, refuses_touch, .. } = finger;
            if name.is_empty() || pipelines.iter().any(|other| other.name() == name) {
                let (key, expected) = ("name".into(), "a name for each finger, no two alike".into());
                return Err(setting(BadSetting { key, expected, got: format!("`{name}`") }));
            }
            let side: Side = finger.side.parse().map_err(setting)?;
            let sensor = sensor_of(&finger.sensor)?;
            let monitor = settings_of(finger.settings.as_ref())?;
            let rest = rest_given(py, &rest, order, &sensor, &monitor)?;
            let object = SharedObject::new(object);
            held.push(object.clone());
            let source = Box::new(PythonSource { object, order, raised: raised.clone(), frames_count: 0 });
            let (sensor, monitor) = ((*sensor).clone(), (*monitor).clone());
            let finger = FingerPipeline::new(&name, Mounting { side, turn_rad }, sensor, monitor, source);
            let finger = if refuses_touch { finger.refusing_touch() } else { finger };
            pipelines.push(match rest {
                Some(rest) => finger.with_rest(rest),
                None => finger,
            });
        }
        if pipelines.is_empty() {
            return Err(setting(BadSetting {
                key: "fingers".into(),
                got: "none".into(),
                expected: "one to four".into(),
            }));
        }
        let (kind, settings) = (task.parse().map_err(setting)?, task_settings(settings)?);
        let sensors: Vec<&CoreSensor> = pipelines.iter().map(FingerPipeline::sensor).collect();
        let task = task_of(kind, controller, settings, &sensors, &raised, &mut held)?;
        let control = CoreLoop::new(pipelines, task).map_err(setting)?;
        Ok(Loop { raised, held, control: Mutex::new(Running { control, last_ns: 0 }) })
    }

    /// One cycle.
    #[pyo3(signature = (now_ns, gripper, wrist, observer = None))]
    fn cycle(
        &self,
        py: Python<'_>,
        now_ns: u64,
        gripper: Py<PyAny>,
        wrist: Py<PyAny>,
        observer: Option<Py<PyAny>>,
    ) -> PyResult<Cycle> {
        py.check_signals()?;
        let mut running = exclusive(&self.control, "control loop")?;
        let Running { control, last_ns } = &mut *running;
        let raised = &self.raised;
        let mut gripper = PythonGripper { object: gripper, raised: raised.clone() };
        let mut wrist = PythonWrist { object: wrist, raised: raised.clone() };
        py.detach(|| {
            guarded(|| {
                if now_ns < *last_ns {
                    control.leave(&mut gripper, &mut wrist);
                    let (expected, got) =
                        (format!("at least {last_ns}, the time of the last cycle"), now_ns.to_string());
                    return Err(setting(BadSetting { key: "now_ns".into(), expected, got }));
                }
                *last_ns = now_ns;
                let mut observer = PythonObserver { call: observer.as_ref(), raised, newest: None };
                let outcome = control.cycle(now_ns, &mut gripper, &mut wrist, &mut observer);
                let newest = observer.newest.take();
                if raised.is_set() && outcome.is_ok() {
                    control.leave(&mut gripper, &mut wrist);
                }
                finished(raised, outcome.map_err(|error| control_error(&error)), newest)
            })
        })
    }

    /// Leaves the hand as it is: the wrist pauses, the force stays.
    fn leave(&self, py: Python<'_>, gripper: Py<PyAny>, wrist: Py<PyAny>) -> PyResult<()> {
        let mut running = exclusive(&self.control, "control loop")?;
        let control = &mut running.control;
        let raised = FirstException::default();
        let mut gripper = PythonGripper { object: gripper, raised: raised.clone() };
        let mut wrist = PythonWrist { object: wrist, raised: raised.clone() };
        py.detach(|| {
            guarded(|| {
                control.leave(&mut gripper, &mut wrist);
                Ok(())
            })
        })?;
        raised.take().map_or(Ok(()), Err)
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.held.iter().try_for_each(|object| object.traverse(&visit))
    }

    fn __clear__(&self) {
        self.held.iter().for_each(SharedObject::clear);
    }
}

/// A simulated hand at its task, cycle by cycle. See `slipbound.lab.hand`.
#[pyclass(frozen, module = "slipbound.lab")]
pub struct HandRun {
    scene: HandScene,
    task: TaskKind,
    raised: FirstException,
    /// The object that the controller of `run` calls.
    held: Vec<SharedObject>,
    run: Mutex<LockStep>,
}

#[pymethods]
impl HandRun {
    #[new]
    #[pyo3(signature = (scene, parameters, controller, settings, monitor))]
    fn new(
        py: Python<'_>,
        scene: &str,
        parameters: Vec<(String, String)>,
        controller: &Bound<'_, PyAny>,
        settings: Option<&Bound<'_, PyAny>>,
        monitor: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let joined: Vec<String> = parameters.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let separator = if scene.contains('?') { "&" } else { "?" };
        let scene = HandScene::parse(&format!("{scene}{separator}{}", joined.join("&"))).map_err(setting)?;
        let task = scene.task();
        let (settings, monitor) = (task_settings(settings)?, settings_of(monitor)?);
        let (raised, mut held) = (FirstException::default(), Vec::new());
        let hand = py.detach(|| guarded(|| SimHand::new(&scene).map_err(setting)))?;
        let at_work = task_of(task, controller, settings, &[&hand.sensor(0)], &raised, &mut held)?;
        let run = LockStep::around(&scene, hand, at_work, &monitor, None).map_err(setting)?;
        Ok(HandRun { scene, task, raised, held, run: Mutex::new(run) })
    }

    /// One cycle of the loop, then 1/30 s of the world.
    #[pyo3(signature = (observer = None))]
    fn cycle(&self, py: Python<'_>, observer: Option<Py<PyAny>>) -> PyResult<Cycle> {
        py.check_signals()?;
        let mut run = exclusive(&self.run, "hand")?;
        let run = &mut *run;
        let raised = &self.raised;
        py.detach(|| {
            guarded(|| {
                let mut observer = PythonObserver { call: observer.as_ref(), raised, newest: None };
                let outcome = run.cycle(&mut observer);
                let newest = observer.newest.take();
                if raised.is_set() && outcome.is_ok() {
                    run.leave();
                }
                finished(raised, outcome.map_err(|error| of_lock_step(&error)), newest)
            })
        })
    }

    /// Leaves the hand before its task has ended: the wrist pauses, the grip stays, and two seconds pass.
    fn leave(&self, py: Python<'_>) -> PyResult<()> {
        let mut run = exclusive(&self.run, "hand")?;
        let run = &mut *run;
        py.detach(|| {
            guarded(|| {
                run.leave();
                Ok(())
            })
        })
    }

    /// The present ground truth, as a dict; units are in the names.
    #[getter]
    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data(py, &exclusive(&self.run, "hand")?.hand().truth())
    }

    /// The score over the cycles so far.
    #[getter]
    fn score<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let run = exclusive(&self.run, "hand")?;
        let score = run.score();
        data(
            py,
            &serde_json::json!({
                "ending": score.ending,
                "succeeded": score.succeeded(self.task),
                "time_s": score.time_s,
                "alarms_count": score.alarms_count,
                "most_n": score.most_n,
                "least_held_n": score.least_held_n,
                "slid_mm": score.last.slid_mm,
                "over_squeeze_ratio": score.over_squeeze_ratio(),
            }),
        )
    }

    /// The facts of a finger, with the stiffness of its gel.
    #[pyo3(signature = (finger = 0))]
    fn sensor(&self, finger: usize) -> PyResult<Sensor> {
        if finger >= self.scene.fingers_count() {
            let count = self.scene.fingers_count();
            return Err(pyo3::exceptions::PyIndexError::new_err(format!("finger {finger} of {count}")));
        }
        Ok(Sensor(exclusive(&self.run, "hand")?.hand().sensor(finger).into()))
    }

    /// The scene with all its parameters.
    #[getter]
    fn scene(&self) -> String {
        self.scene.to_string()
    }

    /// The task.
    #[getter]
    fn task(&self) -> String {
        self.task.to_string()
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.held.iter().try_for_each(|object| object.traverse(&visit))
    }

    fn __clear__(&self) {
        self.held.iter().for_each(SharedObject::clear);
    }
}
