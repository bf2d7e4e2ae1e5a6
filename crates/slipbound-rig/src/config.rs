//! TOML files that a person writes: settings here, fingers in [`crate::sensors`]. A mistake in one is told with
//! the file, the key, what was expected and what stands there.

use serde::de::DeserializeOwned;
use slipbound::monitor::Settings;
use slipbound::setting::SettingError;
use slipbound::task::TaskSettings;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

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
    /// A key that nobody knows.
    #[error("{file}: unknown key `{key}`; {}", known(nearest.as_deref(), expected))]
    UnknownKey {
        /// The file.
        file: String,
        /// The key, dotted.
        key: String,
        /// The known key most like it, if one is.
        nearest: Option<String>,
        /// All keys that may stand there.
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
    /// It is not text at all.
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
    /// A word that is neither `paper` nor the name of a file.
    #[error("no settings are called `{name}`: expected `paper` or FILE.toml, and there is no such file")]
    UnknownSettings {
        /// The word.
        name: String,
    },
    /// A name that is neither a built-in finger nor a file.
    #[error("no built-in sensor is called `{name}`: expected FILE.toml or a built-in name; {}", known(nearest.as_deref(), names))]
    UnknownSensor {
        /// The name asked for.
        name: String,
        /// The built-in name most like it, if one is.
        nearest: Option<String>,
        /// The names there are.
        names: Vec<String>,
    },
    /// A sensor file that extends itself by way of others.
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

/// The settings for a `--settings` argument: `paper`, or a TOML file whose keys replace the defaults.
pub fn load_settings(name_or_file: &str) -> Result<Settings, Error> {
    if name_or_file == "paper" {
        return Ok(Settings::paper());
    }
    let path = Path::new(name_or_file);
    if path.extension().is_none() && !path.exists() {
        return Err(Error::UnknownSettings { name: name_or_file.into() });
    }
    let layer = Layer::read(path)?;
    let settings: Settings = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    settings.check().map_err(|source| Error::OutOfRange { file: layer.file, source })?;
    Ok(settings)
}

/// Everything a task is run with: the defaults, or those with the keys of a TOML file over them.
pub fn load_task_settings(file: Option<&Path>) -> Result<TaskSettings, Error> {
    let Some(path) = file else { return Ok(TaskSettings::default()) };
    let layer = Layer::read(path)?;
    let settings: TaskSettings = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    settings.check().map_err(|source| Error::OutOfRange { file: layer.file, source })?;
    Ok(settings)
}

/// One file, parsed.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    pub file: String,
    pub table: Table,
}

impl Layer {
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = fs::read_to_string(path).map_err(|source| match source.kind() {
            io::ErrorKind::InvalidData => Error::NotText { file: path.display().to_string() },
            _ => Error::Read { path: path.to_owned(), source },
        })?;
        Layer::parse(path.display().to_string(), &text)
    }

    pub fn parse(file: String, text: &str) -> Result<Self, Error> {
        match text.parse() {
            Ok(table) => Ok(Layer { file, table }),
            Err(e) => Err(Error::Syntax { file, message: e.to_string().trim_end().to_owned() }),
        }
    }
}

/// A typed value from merged layers; the first layer that holds the key is the one to blame.
pub(crate) fn typed<T: DeserializeOwned>(merged: Table, layers: &[Layer]) -> Result<T, Error> {
    serde_path_to_error::deserialize(Value::Table(merged)).map_err(|e| {
        let path = e.path().to_string();
        let problem = in_words(&e.inner().to_string());
        let mut quoted = problem.split('`').skip(1).step_by(2).map(str::to_owned);
        if problem.starts_with("unknown field") {
            let unknown = quoted.next().unwrap_or_default();
            let expected: Vec<String> = quoted.collect();
            let key = match path.as_str() {
                "." => unknown.clone(),
                _ if path == unknown || path.ends_with(&format!(".{unknown}")) => path,
                _ => format!("{path}.{unknown}"),
            };
            let nearest = nearest(&unknown, &expected);
            return Error::UnknownKey { file: blame(layers, &key), key, nearest, expected };
        }
        let key = match (problem.strip_prefix("missing field"), path.as_str()) {
            (Some(_), ".") => quoted.next().unwrap_or_default(),
            _ => path,
        };
        Error::Value { file: blame(layers, &key), key, problem }
    })
}

/// What the parser says, without its second line (the key, which we name ourselves) and without Rust's names of types.
fn in_words(problem: &str) -> String {
    let first = problem.lines().next().unwrap_or_default();
    let Some((said, kind)) = first.rsplit_once("expected ") else {
        return first.to_owned();
    };
    match kind {
        "f64" => format!("{said}expected a number"),
        "u8" | "u32" | "u64" | "usize" => format!("{said}expected a whole number, not below 0"),
        _ => first.to_owned(),
    }
}

/// The file that holds a key; the first when none does.
pub(crate) fn blame(layers: &[Layer], key: &str) -> String {
    let first = key.split(['.', '[']).next().unwrap_or(key);
    let holds = |layer: &&Layer| layer.table.contains_key(first);
    layers.iter().find(holds).or(layers.first()).map_or_else(String::new, |l| l.file.clone())
}

/// The candidate that is fewest edits away, if those are at most half of the word.
pub(crate) fn nearest(word: &str, candidates: &[String]) -> Option<String> {
    let best = candidates.iter().min_by_key(|c| edits(word, c))?;
    (2 * edits(word, best) <= word.chars().count()).then(|| best.clone())
}

/// Insertions, deletions and replacements that turn one word into the other.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, sign) in a.chars().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for j in 0..b.len() {
            let replaced = before + usize::from(b[j] != sign);
            before = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(before + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Result<Settings, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("mine.toml");
        fs::write(&path, text).expect("writes");
        load_settings(path.to_str().expect("UTF-8"))
    }

    #[test]
    fn keys_given_replace_the_defaults() {
        let got = settings("[rest]\nwindow_count = 7\n").expect("valid");
        assert_eq!(got.rest.window_count, 7);
        assert_eq!(got.slip, Settings::default().slip);
        assert_eq!(load_settings("paper").expect("built in"), Settings::paper());
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (text, parts) in [
            ("[rest]\nwindow_cuont = 7\n", ["mine.toml", "`rest.window_cuont`", "did you mean `window_count`?"]),
            ("[rset]\n", ["mine.toml", "`rset`", "did you mean `rest`?"]),
            ("[banana]\n", ["mine.toml", "`banana`", "expected one of rest, imprint"]),
            (
                "[rest]\nwindow_count = \"many\"\n",
                ["mine.toml: rest.window_count", "\"many\"", "expected a whole number"],
            ),
            ("[rest]\nwindow_count = -7\n", ["mine.toml: rest.window_count", "-7", "expected a whole number"]),
            ("[rest]\nwindow_count = 0\n", ["mine.toml: rest.window_count", "a number from 1", "got 0"]),
            ("[rest\n", ["mine.toml", "line 1", "]"]),
        ] {
            let message = settings(text).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
    }

    #[test]
    fn what_is_no_settings_file_is_told_apart() {
        let message = load_settings("papr").expect_err("refused").to_string();
        assert!(message.contains("`papr`") && message.contains("expected `paper` or FILE.toml"), "{message}");
        let message = load_settings("papr.toml").expect_err("refused").to_string();
        assert!(message.starts_with("papr.toml: cannot read"), "{message}");
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("picture.toml");
        fs::write(&path, b"\xFF\xD8").expect("writes");
        let message = load_settings(path.to_str().expect("UTF-8")).expect_err("refused").to_string();
        assert!(message.ends_with("picture.toml: expected TOML, got bytes that are no text"), "{message}");
        let message = settings("[rest]\nwindow_count = 2.5\n").expect_err("refused").to_string();
        assert!(message.contains("2.5") && message.lines().count() == 1, "{message}");
    }

    #[test]
    fn edits_are_counted() {
        assert_eq!((edits("", "abc"), edits("pitch", "pich"), edits("abc", "abc"), edits("ab", "ba")), (3, 1, 0, 2));
        assert_eq!(nearest("zzz", &["pitch_px".into()]), None);
    }
}
