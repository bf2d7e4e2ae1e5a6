//! Errors before the node runs, and errors that end it.

use slipbound::setting::SettingError;
use slipbound_rig::run;

/// Why the node, a gripper or a wrist cannot be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file written by a user.
    #[error(transparent)]
    Config(#[from] slipbound_rig::config::Error),
    /// The library refuses a setting.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A name that ROS does not accept.
    #[error("{key}: expected a name that ROS takes, got `{name}`: {why}")]
    Name {
        /// Which name it is.
        key: String,
        /// The name.
        name: String,
        /// The reason given by ROS.
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
    /// The folder of a run that cannot be used or written.
    #[error(transparent)]
    Run(#[from] run::Error),
    /// A run that finished without some of its data.
    #[error("finished, but {0}")]
    DataLost(String),
    /// No finger thread is left to judge images.
    #[error("expected at least one finger that judges images, got none: all finger threads have panicked")]
    FingersBroken,
}

impl Error {
    /// Whether the cause is user input, not the network, a disk or a thread.
    pub fn is_argument(&self) -> bool {
        match self {
            Error::Config(_) | Error::Setting(_) | Error::Name { .. } => true,
            Error::Run(error) => !matches!(error, run::Error::Write { .. } | run::Error::Encode { .. }),
            Error::Middleware { .. } | Error::DataLost(_) | Error::FingersBroken => false,
        }
    }

    /// A refusal of the middleware.
    pub(crate) fn middleware(what: impl Into<String>, why: impl std::fmt::Display) -> Self {
        Error::Middleware { what: what.into(), why: why.to_string() }
    }
}
