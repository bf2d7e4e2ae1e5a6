//! The description of a run, and the table of its results.

use crate::printable::without_passwords;
use crate::rest_file::SavedRest;
use serde::{Deserialize, Serialize};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::Mounting;
use slipbound::monitor::Settings;
use slipbound::sensor::Sensor;
use slipbound::task::{TaskKind, TaskSettings};
use std::sync::Arc;

/// Incremented when a reader of old files could misread new ones; not for new keys alone.
pub const FORMAT_VERSION: u32 = 2;

/// The description of a run, as in `run.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Name of the run: the name of the task, or `hold`.
    pub name: String,
    /// The task.
    pub task: TaskKind,
    /// The scene, or the hardware, as the user named it.
    pub source: String,
    /// Seed of the simulation.
    pub seed: u64,
    /// Settings of controller and task.
    pub task_settings: TaskSettings,
    /// Settings of the monitors.
    pub monitor_settings: Settings,
    /// Further conditions: the gripper's address, injected faults.
    pub notes: toml::Table,
    /// The fingers, in the order of [`HandReport::health`](slipbound::hand::HandReport::health).
    pub fingers: Vec<FingerInfo>,
}

/// A finger of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerInfo {
    /// Its name, see [`finger_name`](crate::config::hand::finger_name): the names of its files begin with it.
    pub name: String,
    /// Its mounting in the hand.
    pub mounting: Mounting,
    /// Its facts.
    pub sensor: Sensor,
    /// Its saved rest frame; None where it is found among the first frames.
    pub rest: Option<Arc<SavedRest>>,
}

impl FingerInfo {
    /// The description of a loop's finger.
    pub fn of(finger: &FingerPipeline) -> Self {
        let (name, mounting, sensor) = (finger.name().into(), finger.mounting(), finger.sensor().clone());
        FingerInfo { name, mounting, sensor, rest: None }
    }

    /// The name of its sensor file in the folder.
    pub fn sensor_file(&self) -> String {
        format!("{}.sensor.toml", self.name)
    }

    /// Name and bytes of its rest file; None where the rest frame is found among the first frames. Fails for a number
    /// that JSON cannot represent.
    pub fn rest_file(&self) -> serde_json::Result<Option<(String, Vec<u8>)>> {
        let bytes = self.rest.as_ref().map(|rest| rest.to_bytes()).transpose()?;
        Ok(bytes.map(|bytes| (self.rest_name(), bytes)))
    }

    fn rest_name(&self) -> String {
        format!("{}.rest", self.name)
    }
}

impl RunInfo {
    /// Names of the fingers.
    pub fn finger_names(&self) -> Vec<String> {
        self.fingers.iter().map(|finger| finger.name.clone()).collect()
    }

    /// The text of `run.toml`. Fails for a number that TOML cannot represent.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        self.table().and_then(|table| toml::to_string(&table))
    }

    /// The table of `run.toml`. Fails for a number that TOML cannot represent.
    pub(super) fn table(&self) -> Result<toml::Table, toml::ser::Error> {
        // TOML's integers are signed: a larger seed is written as text.
        let seed = i64::try_from(self.seed).map_or_else(|_| self.seed.to_string().into(), toml::Value::Integer);
        let mut settings = self.notes.clone();
        settings.insert("task".into(), toml::Table::try_from(self.task_settings)?.into());
        settings.insert("monitor".into(), toml::Table::try_from(&self.monitor_settings)?.into());
        let mut fingers = Vec::new();
        for finger in &self.fingers {
            let mut table = toml::Table::try_from(finger.mounting)?;
            table.insert("name".into(), finger.name.clone().into());
            table.insert("sensor".into(), finger.sensor_file().into());
            if finger.rest.is_some() {
                table.insert("rest".into(), finger.rest_name().into());
            }
            fingers.push(toml::Value::Table(table));
        }
        let mut table = toml::Table::new();
        table.insert("format".into(), "slipbound-run".into());
        table.insert("format_version".into(), i64::from(FORMAT_VERSION).into());
        table.insert("software_version".into(), env!("CARGO_PKG_VERSION").into());
        table.insert("name".into(), self.name.clone().into());
        table.insert("task".into(), self.task.name().into());
        table.insert("controller".into(), self.task_settings.controller.name().into());
        table.insert("source".into(), without_passwords(&self.source).into_owned().into());
        table.insert("seed".into(), seed);
        table.insert("fingers".into(), fingers.into());
        table.insert("settings".into(), settings.into());
        Ok(table)
    }
}

/// One line of the table of results.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Row {
    /// Name of the measured quantity.
    pub name: String,
    /// Its value with its unit.
    pub value: String,
    /// Target; empty where there is none.
    pub target: String,
    /// Whether the target was met; None where there is none.
    pub ok: Option<bool>,
}
