//! States and commands of gripper and wrist as Python sees them <-> those of the library.

use crate::errors::{SettingError, setting};
use pyo3::prelude::*;
use slipbound::port::{
    GripperState as CoreGripperState, WristCommand as CoreWristCommand, WristMotion, WristState as CoreWristState,
};

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
        let jaws = jaws.parse().map_err(setting)?;
        for (name, value) in
            [("force_n", force_n), ("force_error_n", force_error_n), ("target_n", target_n), ("opening_mm", opening_mm)]
        {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                let text = format!("{name}: expected a finite number or None, got {value}");
                return Err(SettingError::new_err(text));
            }
        }
        Ok(CoreGripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws })
    }
}

impl From<&CoreGripperState> for GripperState {
    fn from(state: &CoreGripperState) -> Self {
        let CoreGripperState { time_ns, force_n, force_error_n, target_n, opening_mm, jaws } = *state;
        let jaws = jaws.to_string();
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
            return Err(SettingError::new_err(text));
        }
        Ok(WristState { time_ns, angle_rad, lowered_mm, moving })
    }
}

impl From<&WristState> for CoreWristState {
    fn from(state: &WristState) -> Self {
        let WristState { time_ns, angle_rad, lowered_mm, moving } = *state;
        CoreWristState { time_ns, angle_rad, lowered_mm, moving }
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
