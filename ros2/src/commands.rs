//! The commands.

pub mod emulate;
pub mod measure;
pub mod node;
pub mod run;
pub mod simulate;

use slipbound_ros2::config::domain_of_environment;
use slipbound_ros2::error::Error;

/// Result of a command.
pub type Done = Result<(), Box<dyn std::error::Error>>;

/// The domain from `ROS_DOMAIN_ID`, else 0.
pub fn domain_id() -> Result<u16, Error> {
    domain_of_environment(std::env::var("ROS_DOMAIN_ID").ok().as_deref())
}
