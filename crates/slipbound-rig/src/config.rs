//! TOML files that a person writes: settings, fingers ([`sensors`]), hands ([`hand`]). An error names the file, the
//! key, what was expected and what was found.

mod error;
pub mod hand;
mod layer;
pub mod sensors;
mod settings;

use serde::de::DeserializeOwned;
use std::path::Path;

pub use error::Error;
pub(crate) use layer::{Layer, file_of_key, read_most, read_most_bytes, typed};
pub use settings::{
    load_settings, load_task_settings, parse_settings, parse_task_settings, settings_to_toml, task_settings_to_toml,
};

/// Loads another program's own TOML settings, with the same error messages.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let layer = Layer::read(path)?;
    typed(layer.table.clone(), std::slice::from_ref(&layer))
}
