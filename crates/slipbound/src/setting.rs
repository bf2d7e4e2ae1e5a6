//! A setting that is refused: which key, what stands there, what is allowed. What every `check` and `new` of the crate
//! returns.

use std::fmt;

/// A setting, or a fact of a sensor, that is refused.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingError {
    /// The key, dotted as in its TOML file.
    pub key: String,
    /// The value found.
    pub got: String,
    /// The values allowed.
    pub expected: String,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: expected {}, got {}", self.key, self.expected, self.got)
    }
}

impl std::error::Error for SettingError {}

/// Refuses a number outside `low..=high`, or NaN.
pub(crate) fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), SettingError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: format!("a number from {low} to {high}") })
}
