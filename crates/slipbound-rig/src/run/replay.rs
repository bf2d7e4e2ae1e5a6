//! Replay of a recorded run from its folder alone: the same loop over the recorded frames, comparing every report and
//! command.

use super::error::Error;
use super::folder::read;
use super::frames::{self, Waiting};
use super::words::commanded;
use crate::config;
use crate::rest_file::{RestFileError, SavedRest};
use crate::sensors;
use serde::de::DeserializeOwned;
use slipbound::control::{ControlError, ControlLoop, Cycle, CycleObserver, CycleOutcome};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::Mounting;
use slipbound::monitor::Settings;
use slipbound::port::{
    GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Wrist, WristCommand, WristError,
    WristErrorKind, WristState,
};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;
use slipbound::task::{TaskKind, TaskSettings};
use std::collections::VecDeque;
use std::fmt;
use std::path::Path;

/// Why a run could not be replayed, or where it differs.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The folder is not that of a recorded run.
    #[error(transparent)]
    Folder(#[from] Error),
    /// A finger's sensor file cannot be used.
    #[error(transparent)]
    Sensor(#[from] config::Error),
    /// A finger's rest file cannot be used.
    #[error(transparent)]
    Rest(#[from] RestFileError),
    /// The settings cannot be used.
    #[error("run.toml: {0}")]
    Setting(#[from] SettingError),
    /// The loop failed.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// There are fewer frames than cycles.
    #[error(
        "frames.jsonl: ends before cycle {cycle} of {cycles_count} in reports.jsonl; the {cycle} before it are the same"
    )]
    FramesEnd {
        /// The first cycle without frames, from 0; the cycles before it are the same.
        cycle: usize,
        /// All that were recorded.
        cycles_count: usize,
    },
    /// There are fewer cycles than frames.
    #[error(
        "reports.jsonl: ends after {cycles_count} cycles, which are the same; {missing_count} more {} commanded, by frames.jsonl",
        if *missing_count == 1 { "was" } else { "were" }
    )]
    ReportsEnd {
        /// Cycles that are there.
        cycles_count: usize,
        /// Cycles that are missing.
        missing_count: usize,
    },
    /// There is nothing to compare.
    #[error("reports.jsonl: expected cycles in which something was commanded, got none")]
    NoCycle,
    /// A command differs.
    #[error("cycle {cycle}{difference}")]
    Differs {
        /// Its number, from 0.
        cycle: usize,
        /// When, what was recorded, what came out.
        difference: Box<Difference>,
    },
}

/// A cycle as recorded and as replayed.
#[derive(Debug)]
pub struct Difference {
    /// As it was recorded.
    pub recorded: Cycle,
    /// As replayed.
    pub replayed: Cycle,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Difference { recorded: a, replayed: b } = self;
        write!(f, " at {:.3} s: recorded ", a.time_ns as f64 * 1e-9)?;
        write!(f, "{}, replayed {}", commanded(a), commanded(b))?;
        if a.hand != b.hand {
            write!(f, "; the hand's report differs")?;
        }
        if a.margin.map(f64::to_bits) != b.margin.map(f64::to_bits) {
            let words = |margin: Option<f64>| margin.map_or("none".into(), |margin| margin.to_string());
            write!(f, "; recorded a margin of {}, replayed {}", words(a.margin), words(b.margin))?;
        }
        if a.alarms_count != b.alarms_count {
            write!(f, "; recorded {} alarms, replayed {}", a.alarms_count, b.alarms_count)?;
        }
        Ok(())
    }
}

/// The result of a replay in which everything was the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Replayed {
    /// Cycles with a command.
    pub cycles_count: usize,
}

/// A run, ready to be replayed.
pub struct Replay {
    control: ControlLoop,
    cycles: Vec<Cycle>,
    waiting: VecDeque<Waiting>,
}

/// A gripper and a wrist that report their recorded states, and refuse what was refused; or the fault that they had.
struct RecordedActuators<'a>(Result<&'a Cycle, GripperErrorKind>);

impl Gripper for RecordedActuators<'_> {
    fn command(&mut self, _: GripCommand) -> Result<(), GripperError> {
        match self.0.is_ok_and(|cycle| cycle.refused_lowering) {
            true => Err(GripperError::new(GripperErrorKind::Lowering, "a lower force was refused")),
            false => Ok(()),
        }
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        self.0.map(|cycle| cycle.gripper).map_err(|kind| GripperError::new(kind, "it had a fault"))
    }
}

impl Wrist for RecordedActuators<'_> {
    fn command(&mut self, _: WristCommand) -> Result<(), WristError> {
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.0.map(|cycle| cycle.wrist).map_err(|_| WristError::new(WristErrorKind::Other, "it had a fault"))
    }
}

impl Replay {
    /// Reads a run that was recorded with its frames.
    pub fn open(folder: &Path) -> Result<Self, ReplayError> {
        let (table, cycles) = read(folder)?;
        let path = folder.join("run.toml");
        let missing = |key: &str| Error::Syntax { path: path.clone(), problem: format!("{key}: missing") };
        let settings = table.get("settings").ok_or_else(|| missing("settings"))?;
        let part = |key: &str| settings.get(key).ok_or_else(|| missing(&format!("settings.{key}")));
        let task_settings: TaskSettings = typed(&path, "settings.task", part("task")?)?;
        let monitor: Settings = typed(&path, "settings.monitor", part("monitor")?)?;
        let task: TaskKind = table.get("task").and_then(toml::Value::as_str).ok_or_else(|| missing("task"))?.parse()?;
        let fingers = table.get("fingers").and_then(toml::Value::as_array).ok_or_else(|| missing("fingers"))?;
        let (sources, waiting) = frames::read(folder, fingers.len())?;
        let mut pipelines = Vec::new();
        let mut first_sensor: Option<Sensor> = None;
        for (finger, source) in fingers.iter().zip(sources) {
            let text = |key: &str| {
                finger.get(key).and_then(toml::Value::as_str).ok_or_else(|| missing(&format!("fingers.{key}")))
            };
            let sensor = sensors::load(&folder.join(text("sensor")?).display().to_string())?;
            let mut mounting = finger.as_table().cloned().unwrap_or_default();
            mounting.retain(|key, _| !matches!(key, "name" | "sensor" | "rest"));
            let mounting: Mounting = typed(&path, "fingers", &mounting.into())?;
            let source = Box::new(source);
            let pipeline = FingerPipeline::new(text("name")?, mounting, sensor.clone(), monitor.clone(), source);
            pipelines.push(match finger.get("rest") {
                None => pipeline,
                Some(_) => pipeline.with_rest(SavedRest::read(&folder.join(text("rest")?))?.rest),
            });
            first_sensor.get_or_insert(sensor);
        }
        let stiffness_mpa_per_mm = first_sensor.and_then(|sensor| sensor.shear_stiffness_mpa_per_mm());
        let control = ControlLoop::new(pipelines, task_settings.task(task, stiffness_mpa_per_mm)?)?;
        // Gripper states were not recorded while the hand was open.
        let control = control.with_idle_force(cycles.first().map_or(0.0, |cycle| cycle.idle_force_n));
        Ok(Replay { control, cycles, waiting })
    }

    /// Runs the loop over the recorded frames; fails at the first command or report that differs.
    pub fn run(mut self, observer: &mut dyn CycleObserver) -> Result<Replayed, ReplayError> {
        let mut next = 0;
        if self.cycles.is_empty() {
            return Err(ReplayError::NoCycle);
        }
        while let Some(cycle) = self.cycles.get(next) {
            let known = self.waiting.pop_front().flatten().map_or(Ok(cycle), Err);
            let (gripper, wrist) = (&mut RecordedActuators(known), &mut RecordedActuators(known));
            self.control.assume_fault(cycle.time_ns, cycle.on_fault);
            match self.control.cycle(cycle.time_ns, gripper, wrist, observer)? {
                CycleOutcome::FindingRest | CycleOutcome::Waiting => {}
                CycleOutcome::SourceEnded => {
                    return Err(ReplayError::FramesEnd { cycle: next, cycles_count: self.cycles.len() });
                }
                CycleOutcome::Commanded(replayed) => {
                    if !is_same(cycle, &replayed) {
                        let difference = Box::new(Difference { recorded: *cycle, replayed });
                        return Err(ReplayError::Differs { cycle: next, difference });
                    }
                    next += 1;
                }
            }
        }
        // The cycles after the last command waited for a gripper or wrist.
        match self.waiting.iter().filter(|why| why.is_none()).count() {
            0 => Ok(Replayed { cycles_count: next }),
            missing_count => Err(ReplayError::ReportsEnd { cycles_count: next, missing_count }),
        }
    }
}

/// The same commands bit for bit, and the same report.
fn is_same(recorded: &Cycle, replayed: &Cycle) -> bool {
    let bits = |cycle: &Cycle| [cycle.grip_command.force_n(), cycle.margin].map(|value| value.map(f64::to_bits));
    bits(recorded) == bits(replayed)
        && recorded.alarms_count == replayed.alarms_count
        && recorded.grip_command == replayed.grip_command
        && recorded.wrist_command == replayed.wrist_command
        && recorded.phase == replayed.phase
        && recorded.slips_count == replayed.slips_count
        && recorded.hand == replayed.hand
}

fn typed<T: DeserializeOwned>(path: &Path, key: &str, value: &toml::Value) -> Result<T, Error> {
    let wrong =
        |e: toml::de::Error| Error::Syntax { path: path.to_owned(), problem: format!("{key}: {}", e.message()) };
    value.clone().try_into().map_err(wrong)
}
