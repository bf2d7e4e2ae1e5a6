//! What can go wrong with a source of frames.

use crate::image::ImageError;
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What kind of failure a [`SourceError`] is: what a caller can act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SourceErrorKind {
    /// It cannot be used as it was asked for: nothing is there, or a pattern or a setting cannot be.
    Settings,
    /// The operating system cannot read it.
    Unreadable,
    /// What it holds is not what it should be, and what comes after cannot be read either.
    Format,
    /// The camera is gone.
    Disconnected,
    /// A program that is needed to read it is not installed, or cannot be started.
    Unsupported,
    /// Anything else.
    Other,
}

/// A failure of a source: its kind, and a text that names the file or device, what was expected and what was got.
#[derive(Debug)]
pub struct SourceError {
    /// What a caller can act on.
    pub kind: SourceErrorKind,
    /// The file or device; None where the source has no name.
    pub file: Option<String>,
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl SourceError {
    /// An error of this kind with this text or cause.
    pub fn new(kind: SourceErrorKind, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        SourceError { kind, file: None, source: source.into() }
    }

    /// The same error with the file or device it is from. Its text stays: it should name it already.
    #[must_use]
    pub fn of_file(self, file: impl fmt::Display) -> Self {
        SourceError { file: Some(file.to_string()), ..self }
    }
}

impl From<SettingError> for SourceError {
    fn from(error: SettingError) -> Self {
        SourceError::new(SourceErrorKind::Settings, error)
    }
}

/// A frame that does not hold what its size says.
impl From<ImageError> for SourceError {
    fn from(error: ImageError) -> Self {
        SourceError::new(SourceErrorKind::Format, error)
    }
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.source.fmt(f)
    }
}

impl std::error::Error for SourceError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.source()
    }
}
