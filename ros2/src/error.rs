//! What can go wrong before the node runs.

use slipbound::setting::SettingError;

/// Why the node, a gripper or a wrist cannot be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that a person wrote.
    #[error(transparent)]
    Config(#[from] slipbound_rig::config::Error),
    /// The library refuses a setting.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A name that ROS does not take.
    #[error("{key}: expected a name that ROS takes, got `{name}`: {why}")]
    Name {
        /// Which name it is.
        key: String,
        /// The name.
        name: String,
        /// What ROS says.
        why: String,
    },
    /// The middleware refused.
    #[error("{what}: {why}")]
    Middleware {
        /// What was to be made.
        what: String,
        /// Its reason.
        why: String,
    },
}

impl Error {
    /// Whether it is something that a person wrote, not the network.
    pub fn is_argument(&self) -> bool {
        !matches!(self, Error::Middleware { .. })
    }

    /// A refusal of the middleware.
    pub(crate) fn middleware(what: impl Into<String>, why: impl std::fmt::Display) -> Self {
        Error::Middleware { what: what.into(), why: why.to_string() }
    }
}
