//! Errors of a sweep.

use slipbound::image::ImageError;
use slipbound::monitor::RestError;
use slipbound::port::{SourceError, SourceErrorKind};
use slipbound::setting::SettingError;
use std::io;
use std::path::PathBuf;

/// Why a trial could not be judged.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// A setting is refused.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// An image could not be generated or read.
    #[error("{0}")]
    Source(#[from] SourceError),
    /// The finger at rest could not be found.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// A frame is not whole.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A recorded clip has nothing that can be judged.
    #[error("{}: {problem}", path.display())]
    Unjudged {
        /// The clip's folder or video.
        path: PathBuf,
        /// What was expected and got.
        problem: String,
    },
}

impl EvalError {
    /// An error of another kind, with its own message.
    pub(super) fn other(problem: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        EvalError::Source(SourceError::new(SourceErrorKind::Other, problem))
    }
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file or the folder cannot be written.
    #[error("{path}: cannot write: {source}", path = .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be read.
    #[error("{path}: cannot read: {source}", path = .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It contains something that does not belong to a sweep.
    #[error("{folder}: expected a new or empty folder, or one with {expected}, got one that holds `{found}`", folder = .folder.display())]
    NotEmpty {
        /// The folder.
        folder: PathBuf,
        /// The file that identifies a folder of this kind.
        expected: String,
        /// One of the names in it.
        found: String,
    },
    /// Another program writes to it.
    #[error("{path}: expected a folder that no other `slipbound eval` writes to, got one that is in use", path = .path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// A value in a file is invalid.
    #[error("{path}: {key}: expected {expected}, got {got}", path = .path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The key or line in it.
        key: String,
        /// The expected value.
        expected: String,
        /// The value found.
        got: String,
    },
}

/// Why a sweep ended before its end.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A trial could not be judged.
    #[error("{protocol}, {trial}: {source}")]
    Trial {
        /// The protocol.
        protocol: &'static str,
        /// The trial: see [`Protocol::trial`](super::Protocol::trial).
        trial: String,
        /// Why.
        source: EvalError,
    },
    /// Its records could not be stored.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The caller stopped the sweep.
    #[error("interrupted; what was judged is kept, the same command goes on from there")]
    Interrupted,
}
