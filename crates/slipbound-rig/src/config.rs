//! TOML files that a person writes: settings, fingers ([`sensors`]), hands ([`hand`]). A mistake in one is reported with
//! the file, the key, what was expected and what is there.

mod error;
pub mod hand;
mod layer;
pub mod sensors;
mod settings;

use serde::de::DeserializeOwned;
use std::path::Path;

pub use error::Error;
pub(crate) use layer::{Layer, blame, read_most, read_most_bytes, typed};
pub use settings::{load_settings, load_task_settings, parse_settings, parse_task_settings, settings_to_toml};

/// A TOML file of another program's own settings: the same reading, and the same words for a mistake.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let layer = Layer::read(path)?;
    typed(layer.table.clone(), std::slice::from_ref(&layer))
}
