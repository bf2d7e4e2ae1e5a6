//! Definition of a named scene.

use super::keys::{COMMON_KEYS, Key, SCENE_KEYS};
use super::load_profile::LoadProfile;
use super::parameters::Parameters;
use slipbound::setting::SettingError;

/// A named trial.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// Description in one line.
    pub what: &'static str,
    /// The parameters it uses besides [`COMMON_KEYS`], with their defaults; also the common ones whose default it
    /// changes.
    pub defaults: &'static [(&'static str, &'static str)],
    /// The load profile for its parameters.
    pub(crate) profile: fn(&Parameters) -> Result<LoadProfile, SettingError>,
}

impl PartialEq for Scene {
    fn eq(&self, other: &Scene) -> bool {
        self.name == other.name
    }
}

impl Scene {
    /// The keys it uses: the common ones, then its own.
    pub fn keys(&self) -> impl Iterator<Item = &'static Key> + '_ {
        let own = SCENE_KEYS.iter().filter(|key| self.defaults.iter().any(|(name, _)| *name == key.name));
        COMMON_KEYS.iter().chain(own)
    }

    /// The key with this name among those it uses.
    pub(super) fn key(&self, name: &str) -> Result<&'static Key, SettingError> {
        self.keys().find(|key| key.name == name).ok_or_else(|| {
            let names: Vec<&str> = std::iter::once("seed").chain(self.keys().map(|key| key.name)).collect();
            SettingError::none_of(&format!("parameter of the scene {}", self.name), name, &names)
        })
    }

    /// Every parameter at its default.
    pub(super) fn default_parameters(&self) -> Result<Parameters, SettingError> {
        let default_of = |key: &str| self.defaults.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
        let values = self.keys().map(|key| {
            let default = default_of(key.name).unwrap_or(key.default);
            key.read(default).map(|value| (key.name, value))
        });
        Ok(Parameters::new(self.name, values.collect::<Result<_, _>>()?))
    }
}
