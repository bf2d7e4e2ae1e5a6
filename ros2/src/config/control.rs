//! The table `[control]`: gripper, wrist, controller. Only `slipbound-ros2 hold` and `run` command with it.

use super::wrong;
use crate::gripper_action::ActionGripperConfig;
use ros2_client::Name;
use serde::Deserialize;
use slipbound::setting::SettingError;
use slipbound::task::{ControllerKind, TaskSettings};
use slipbound_rig::config;
use slipbound_rig::run::CameraLimits;
use std::path::{Path, PathBuf};

const TOPICS: &str = "ros2://";
const ACTION: &str = "ros2+action://";

/// What a control loop commands, checked.
#[derive(Debug, Clone)]
pub struct Control {
    /// The gripper.
    pub gripper: GripperAddress,
    /// Base name of the wrist's topics; None: no wrist.
    pub wrist: Option<String>,
    /// Settings of grip, controllers and tasks.
    pub settings: TaskSettings,
    /// Limits beyond which cameras are reported.
    pub limits: CameraLimits,
}

/// How a gripper is reached.
#[derive(Debug, Clone)]
pub enum GripperAddress {
    /// By the topics below this base name.
    Topics(String),
    /// By an action.
    Action(ActionGripperConfig),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControlFile {
    gripper: String,
    action: Option<ActionGripperConfig>,
    wrist: Option<String>,
    controller: Option<ControllerKind>,
    settings: Option<PathBuf>,
    max_silence_ms: Option<u64>,
    max_skew_ms: Option<u64>,
}

/// Longest `max_skew_ms`.
const SKEW_MOST_MS: u64 = 1000;

impl ControlFile {
    /// The table of the file `file`, whose `settings` is in the same folder.
    pub(super) fn check(&self, file: &Path) -> Result<Control, config::Error> {
        let refuse = |source| config::Error::OutOfRange { file: file.display().to_string(), source };
        let folder = file.parent().unwrap_or(Path::new(""));
        let settings = self.settings.as_ref().map(|name| folder.join(name));
        let mut settings = config::load_task_settings(settings.as_deref())?;
        settings.controller = self.controller.unwrap_or(settings.controller);
        Ok(Control {
            gripper: self.gripper().map_err(refuse)?,
            wrist: self.wrist().map_err(refuse)?,
            settings,
            limits: self.limits().map_err(refuse)?,
        })
    }

    fn gripper(&self) -> Result<GripperAddress, SettingError> {
        let (key, text) = ("control.gripper", self.gripper.as_str());
        let refused = || wrong(key, "ros2:///BASE of its topics or ros2+action:///NAME", format!("`{text}`"));
        match (text.strip_prefix(ACTION), text.strip_prefix(TOPICS), &self.action) {
            (Some(name), _, Some(action)) => {
                let name = absolute(name).ok_or_else(refused)?;
                let action = ActionGripperConfig { action: name, ..action.clone() };
                action.check().map_err(|e| SettingError { key: format!("control.action.{}", e.key), ..e })?;
                absolute(&action.joint_states).ok_or_else(|| {
                    wrong("control.action.joint_states", "the name of a topic", format!("`{}`", action.joint_states))
                })?;
                Ok(GripperAddress::Action(action))
            }
            (Some(_), _, None) => Err(wrong("control.action", "the joint of the action's gripper", "no such table")),
            (None, Some(_), Some(_)) => {
                Err(wrong("control.action", "no such table with a gripper of topics", format!("one, and `{text}`")))
            }
            (None, Some(base), None) => Ok(GripperAddress::Topics(absolute(base).ok_or_else(refused)?)),
            (None, None, _) => Err(refused()),
        }
    }

    fn wrist(&self) -> Result<Option<String>, SettingError> {
        let Some(text) = &self.wrist else { return Ok(None) };
        let base = text.strip_prefix(TOPICS).and_then(absolute);
        let refused = || wrong("control.wrist", "ros2:///BASE of its topics", format!("`{text}`"));
        base.map(Some).ok_or_else(refused)
    }

    fn limits(&self) -> Result<CameraLimits, SettingError> {
        let CameraLimits { max_silence_ns, max_skew_ns } = CameraLimits::default();
        if let Some(ms) = self.max_skew_ms.filter(|ms| *ms > SKEW_MOST_MS) {
            return Err(wrong("control.max_skew_ms", format!("at most {SKEW_MOST_MS}"), ms.to_string()));
        }
        let ns = |ms: Option<u64>, default_ns| ms.map_or(default_ns, |ms| ms.saturating_mul(1_000_000));
        Ok(CameraLimits {
            max_silence_ns: ns(self.max_silence_ms, max_silence_ns),
            max_skew_ns: ns(self.max_skew_ms, max_skew_ns),
        })
    }
}

/// A full name that ROS takes, and names below it.
fn absolute(name: &str) -> Option<String> {
    (name.starts_with('/') && Name::parse(&format!("{name}/state")).is_ok()).then(|| name.to_owned())
}
