//! Errors of files that a person writes.

use slipbound::setting::SettingError;
use std::io;
use std::path::PathBuf;

/// A settings or sensor file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// It is not TOML; the message shows the place.
    #[error("{file}: {message}")]
    Syntax {
        /// The file.
        file: String,
        /// Line, column and what is wrong.
        message: String,
    },
    /// An unknown key.
    #[error("{file}: unknown key `{key}`; {}", known(nearest.as_deref(), expected))]
    UnknownKey {
        /// The file.
        file: String,
        /// The key, dotted.
        key: String,
        /// The most similar known key, if there is one.
        nearest: Option<String>,
        /// All keys that are allowed there.
        expected: Vec<String>,
    },
    /// A value of the wrong type, or a key that is missing.
    #[error("{file}: {key}: {problem}")]
    Value {
        /// The file.
        file: String,
        /// The key, dotted.
        key: String,
        /// What was expected and got.
        problem: String,
    },
    /// A value out of range.
    #[error("{file}: {source}")]
    OutOfRange {
        /// The file.
        file: String,
        /// Key, expected, got.
        source: SettingError,
    },
    /// It is too long.
    #[error("{file}: expected at most {most_bytes} bytes of TOML, got {got}")]
    TooLong {
        /// The file.
        file: String,
        /// The most, bytes.
        most_bytes: u64,
        /// Its length, bytes; `more` for a device or pipe that does not say.
        got: String,
    },
    /// It is not text.
    #[error("{file}: expected TOML, got bytes that are no text")]
    NotText {
        /// The file.
        file: String,
    },
    /// The sensor that a file extends cannot be used.
    #[error("{file}: extends: {source}")]
    Extends {
        /// The file that extends it.
        file: String,
        /// What is wrong with it.
        source: Box<Error>,
    },
    /// The sensor of a finger of a hand cannot be used.
    #[error("{file}: {key}: {source}")]
    FingerSensor {
        /// The hand file.
        file: String,
        /// The key that names the sensor, dotted.
        key: String,
        /// What is wrong with it.
        source: Box<Error>,
    },
    /// A name that is neither `paper` nor a file.
    #[error("no settings are called `{name}`: expected `paper` or FILE.toml, and there is no such file")]
    UnknownSettings {
        /// The name.
        name: String,
    },
    /// A name that is neither a built-in finger nor a file.
    #[error("no built-in sensor is called `{name}`: expected FILE.toml or a built-in name; {}", known(nearest.as_deref(), names))]
    UnknownSensor {
        /// The requested name.
        name: String,
        /// The most similar built-in name, if there is one.
        nearest: Option<String>,
        /// The known names.
        names: Vec<String>,
    },
    /// A sensor file that extends itself through others.
    #[error("{file}: extends: expected a sensor that does not lead back here, got `{extends}`")]
    Circle {
        /// The file.
        file: String,
        /// What it extends.
        extends: String,
    },
}

fn known(nearest: Option<&str>, all: &[String]) -> String {
    match nearest {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("expected one of {}", all.join(", ")),
    }
}
