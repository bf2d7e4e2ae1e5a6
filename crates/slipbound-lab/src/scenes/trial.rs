//! A scene with all its parameters: everything needed to generate the same frames again.

use super::keys::Value;
use super::load_profile::LoadProfile;
use super::parameters::Parameters;
use super::scene::Scene;
use crate::faults::Faults;
use crate::objects::Object;
use serde::{Deserialize, Serialize};
use slipbound::setting::SettingError;
use std::collections::BTreeMap;
use std::fmt;

/// Largest integer up to which JSON readers are exact.
const LARGEST_SEED: u64 = 1 << 53;

/// A scene, a seed and a value for every key of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Trial {
    scene: &'static Scene,
    /// Seed of the camera's noise and of the faults.
    pub seed: u64,
    parameters: Parameters,
}

/// A trial in the format of a file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    scene: String,
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    set: BTreeMap<String, Value>,
}

impl TryFrom<Written> for Trial {
    type Error = SettingError;
    fn try_from(written: Written) -> Result<Self, SettingError> {
        let trial = Trial::new(&written.scene)?.with("seed", &written.seed.to_string())?;
        written.set.iter().try_fold(trial, |trial, (key, value)| trial.with(key, &value.to_string()))
    }
}

impl From<Trial> for Written {
    fn from(trial: Trial) -> Self {
        let set = trial.values().map(|(key, value)| (key.to_owned(), value.clone())).collect();
        Written { scene: trial.scene.name.into(), seed: trial.seed, set }
    }
}

impl Trial {
    /// A scene with every parameter at its default and seed 0.
    pub fn new(scene: &str) -> Result<Self, SettingError> {
        let scene = Scene::named(scene)?;
        Ok(Trial { scene, seed: 0, parameters: scene.default_parameters()? })
    }

    /// `SCENE` or `SCENE?key=value&key=value`. `seed` is a key too.
    pub fn parse(text: &str) -> Result<Self, SettingError> {
        let (scene, settings) = text.split_once('?').unwrap_or((text, ""));
        settings.split('&').filter(|setting| !setting.is_empty()).try_fold(Trial::new(scene)?, Trial::with_setting)
    }

    /// The trial with `key=value`.
    pub fn with_setting(self, setting: &str) -> Result<Self, SettingError> {
        let (key, value) = setting.split_once('=').ok_or_else(|| SettingError {
            key: setting.into(),
            got: "no value".into(),
            expected: "key=value".into(),
        })?;
        self.with(key, value)
    }

    /// The trial with another value of a key. Refuses unknown keys and values out of range.
    pub fn with(mut self, key: &str, value: &str) -> Result<Self, SettingError> {
        if key == "seed" {
            self.seed = value.parse().ok().filter(|seed| *seed <= LARGEST_SEED).ok_or_else(|| SettingError {
                key: key.into(),
                got: value.into(),
                expected: format!("a whole number from 0 to {LARGEST_SEED}"),
            })?;
            return Ok(self);
        }
        self.parameters.set(self.scene.key(key)?, value)?;
        Ok(self)
    }

    /// The scene.
    pub fn scene(&self) -> &'static Scene {
        self.scene
    }

    /// All keys and values, in the order of the keys' names.
    pub fn values(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.parameters.values()
    }

    /// The number of a key, see [`Parameters::number`].
    pub fn number(&self, key: &str) -> f64 {
        self.parameters.number(key)
    }

    /// The word of a key, see [`Parameters::word`].
    pub fn word(&self, key: &str) -> &str {
        self.parameters.word(key)
    }

    /// The held object.
    pub fn object(&self) -> &'static Object {
        self.parameters.object()
    }

    /// The friction coefficient: the value set, or the object's.
    pub fn mu(&self) -> f64 {
        self.parameters.mu()
    }

    /// The faults; None without faults.
    pub fn faults(&self) -> Option<Faults> {
        self.parameters.faults()
    }

    /// Grip, motion and load over time. Refuses contradictory parameters.
    pub fn load_profile(&self) -> Result<LoadProfile, SettingError> {
        (self.scene.profile)(&self.parameters)
    }
}

/// In the format of [`Trial::parse`], with all parameters.
impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}?seed={}", self.scene.name, self.seed)?;
        self.values().try_for_each(|(key, value)| write!(f, "&{key}={value}"))
    }
}
