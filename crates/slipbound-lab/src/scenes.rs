//! Named trials with parameters. Shared by tests, benches, the command line and Python.
//!
//! ```text
//!   "ramp?object=scissors&force_n=15&seed=3"
//!     |    `------ Trial: the scene's parameters, those not named at their defaults
//!     Scene ------ LoadProfile: grip, motion and load over time
//! ```
//!
//! ```
//! use slipbound_lab::scenes::Trial;
//! let trial = Trial::parse("ramp?object=scissors&force_n=15&seed=3").unwrap();
//! assert_eq!((trial.number("force_n"), trial.seed), (15.0, 3));
//! assert!(Trial::parse("ramp?force_n=-5").unwrap_err().to_string().starts_with("force_n: expected a number from"));
//! ```

mod keys;
mod library;
mod load_profile;
mod parameters;
mod scene;
mod trial;

pub(crate) use keys::number;
pub use keys::{COMMON_KEYS, Key, Kind, SCENE_KEYS, Value};
pub use library::SCENES;
pub(crate) use load_profile::GRAVITY_MM_PER_S2;
pub use load_profile::{LoadProfile, Pull};
pub use parameters::Parameters;
pub use scene::Scene;
pub use trial::Trial;
