//! Errors of a source of frames.

use crate::image::ImageError;
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The kind of a [`SourceError`], for a caller to match on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SourceErrorKind {
    /// The request is invalid: the file or device does not exist, or a pattern or a setting is invalid.
    Settings,
    /// The operating system cannot read it.
    Unreadable,
    /// The data is malformed, and what follows cannot be read either.
    Format,
    /// The camera was disconnected.
    Disconnected,
    /// A program that is needed to read it is not installed, or cannot be started.
    Unsupported,
    /// Anything else.
    Other,
}

/// An error of a source: its kind, and a text that names the file or device, what was expected and what was got.
#[derive(Debug)]
pub struct SourceError {
    /// The kind, for a caller to match on.
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

    /// The same error with its file or device. The text is not changed: it should name the file already.
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

/// A frame whose buffer does not match its stated size.
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
