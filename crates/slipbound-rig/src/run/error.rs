//! Errors of a run folder.

use slipbound::setting::SettingError;
use std::io;
use std::path::PathBuf;

/// A run that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The folder or file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// The operating system refused.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// A run is never written over another.
    #[error("{}: expected a new or empty folder, got one that holds `{found}`", folder.display())]
    NotEmpty {
        /// The folder.
        folder: PathBuf,
        /// One of the names in it.
        found: String,
    },
    /// A finger whose name cannot name files.
    #[error("{}: a finger's {source}", folder.display())]
    FingerName {
        /// The folder.
        folder: PathBuf,
        /// What was expected and got.
        source: SettingError,
    },
    /// A value that the format of the file cannot hold.
    #[error("{}: cannot encode: {why}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The encoder's reason.
        why: String,
    },
    /// A file that is not what a run leaves.
    #[error("{}: {problem}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where, what was expected, what was got.
        problem: String,
    },
}
