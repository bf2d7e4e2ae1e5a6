//! What a run is, said once, and the table of results.

use crate::rest_file::SavedRest;
use serde::{Deserialize, Serialize};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::Mounting;
use slipbound::monitor::Settings;
use slipbound::sensor::Sensor;
use slipbound::task::{TaskKind, TaskSettings};
use std::sync::Arc;

/// Grows when a reader of the old files could misread the new ones; new keys alone do not count.
pub const FORMAT_VERSION: u32 = 2;

/// What a run is, said once, in `run.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// What the run is called: the name of the task, or `hold`.
    pub name: String,
    /// The task.
    pub task: TaskKind,
    /// The scene, or the hardware, as the user named it.
    pub source: String,
    /// What a simulation's chances were drawn from.
    pub seed: u64,
    /// Settings of controller and task.
    pub task_settings: TaskSettings,
    /// Settings of the monitors.
    pub monitor_settings: Settings,
    /// What else decides how it goes: the gripper's address, a fault put in.
    pub notes: toml::Table,
    /// The fingers, in the order of [`HandReport::health`](slipbound::hand::HandReport::health).
    pub fingers: Vec<FingerInfo>,
}

/// A finger of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerInfo {
    /// What it is called.
    pub name: String,
    /// How it sits in the hand.
    pub mounting: Mounting,
    /// Its facts.
    pub sensor: Sensor,
    /// It at rest, where that was saved before; None where it is found among the first frames.
    pub rest: Option<Arc<SavedRest>>,
}

impl FingerInfo {
    /// That of a finger of a loop.
    pub fn of(finger: &FingerPipeline) -> Self {
        let (name, mounting, sensor) = (finger.name().into(), finger.mounting(), finger.sensor().clone());
        FingerInfo { name, mounting, sensor, rest: None }
    }

    /// The name of its sensor file in the folder.
    pub fn sensor_file(&self) -> String {
        format!("{}.sensor.toml", file_stem(&self.name))
    }

    /// The name of the file with it at rest, and its bytes; None where that is found among the first frames. Fails for a number that JSON
    /// does not have.
    pub fn rest_file(&self) -> serde_json::Result<Option<(String, Vec<u8>)>> {
        let bytes = self.rest.as_ref().map(|rest| rest.to_bytes()).transpose()?;
        Ok(bytes.map(|bytes| (self.rest_name(), bytes)))
    }

    fn rest_name(&self) -> String {
        format!("{}.rest", file_stem(&self.name))
    }
}

/// A name as part of a file's name.
pub(super) fn file_stem(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

impl RunInfo {
    /// Names of the fingers.
    pub fn finger_names(&self) -> Vec<String> {
        self.fingers.iter().map(|finger| finger.name.clone()).collect()
    }

    /// The text of `run.toml`. Fails for a number that TOML does not have.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        self.table().and_then(|table| toml::to_string(&table))
    }

    /// As `run.toml` has it. Fails for a number that TOML does not have.
    pub(super) fn table(&self) -> Result<toml::Table, toml::ser::Error> {
        // TOML's whole numbers have a sign: a seed beyond them is written as text.
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
        table.insert("source".into(), self.source.clone().into());
        table.insert("seed".into(), seed);
        table.insert("fingers".into(), fingers.into());
        table.insert("settings".into(), settings.into());
        Ok(table)
    }
}

/// One line of the table of results.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// Its value with its unit.
    pub value: String,
    /// What it should be; empty where nothing was set.
    pub target: String,
    /// Whether it is what it should be; None where nothing was set.
    pub ok: Option<bool>,
}
