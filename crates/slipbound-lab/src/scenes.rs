//! Named trials: what happens to the finger, with parameters. Shared by tests, benches, the command and Python.
//!
//! ```text
//!   "ramp?object=scissors&force_n=15&seed=3"
//!     |    `------ Trial: the scene's parameters, those not named at their defaults
//!     Scene ------ Course: grip, motion and load over time
//! ```
//!
//! ```
//! use slipbound_lab::scenes::Trial;
//! let trial = Trial::parse("ramp?object=scissors&force_n=15&seed=3").unwrap();
//! assert_eq!((trial.number("force_n"), trial.seed), (15.0, 3));
//! assert!(Trial::parse("ramp?force_n=-5").unwrap_err().to_string().starts_with("force_n: expected a number from"));
//! ```

mod course;
mod keys;
mod library;
mod trial;

pub(crate) use course::GRAVITY_MM_PER_S2;
pub use course::{Course, Pull};
pub(crate) use keys::number;
pub use keys::{COMMON_KEYS, Key, Kind, SCENE_KEYS};
pub use library::SCENES;
pub use trial::{Trial, Value};

use slipbound::setting::SettingError;

/// A named trial.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// What happens, in a line.
    pub what: &'static str,
    /// The parameters it takes beside [`COMMON_KEYS`], with their defaults; also the common ones whose default it
    /// changes.
    pub defaults: &'static [(&'static str, &'static str)],
    /// What its parameters mean.
    pub(crate) course: fn(&Trial) -> Result<Course, SettingError>,
}

impl Scene {
    /// The scene of a name; the error lists the names.
    pub fn named(name: &str) -> Result<&'static Scene, SettingError> {
        SCENES.iter().find(|scene| scene.name == name).ok_or_else(|| SettingError {
            key: "scene".into(),
            got: name.into(),
            expected: format!("one of {}", SCENES.map(|scene| scene.name).join(", ")),
        })
    }

    /// The keys it takes: the common ones, then its own.
    pub fn keys(&self) -> impl Iterator<Item = &'static Key> + '_ {
        let own = SCENE_KEYS.iter().filter(|key| self.defaults.iter().any(|(name, _)| *name == key.name));
        COMMON_KEYS.iter().chain(own)
    }

    /// The default of a key, as it would be written; None for a common key that stays as it is.
    pub(crate) fn default_of(&self, key: &str) -> Option<&'static str> {
        self.defaults.iter().find(|(name, _)| *name == key).map(|(_, value)| *value)
    }
}
