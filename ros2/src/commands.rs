//! The commands.

pub mod emulate;
pub mod measure;
pub mod node;
pub mod run;
pub mod simulate;

use slipbound::setting::SettingError;
use slipbound_ros2::error::Error;

/// Result of a command.
pub type Done = Result<(), Box<dyn std::error::Error>>;

/// The domain from `ROS_DOMAIN_ID`, else 0.
pub fn domain_id() -> Result<u16, Error> {
    let Some(text) = std::env::var("ROS_DOMAIN_ID").ok() else { return Ok(0) };
    text.trim().parse().ok().filter(|id| *id <= 232).ok_or_else(|| {
        let (key, expected) = ("ROS_DOMAIN_ID".into(), "a whole number from 0 to 232".into());
        Error::Setting(SettingError { key, expected, got: format!("`{text}`") })
    })
}
