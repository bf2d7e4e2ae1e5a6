//! One TOML file, and a typed value from several of them. An error names the file, the key, what was expected and what
//! was found.

use super::error::Error;
use serde::de::DeserializeOwned;
use serde_path_to_error::Segment;
use slipbound::setting::nearest;
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use toml::{Table, Value};

/// One file, parsed.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    pub file: String,
    pub table: Table,
}

impl Layer {
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = read_text(path)?;
        Layer::parse(path.display().to_string(), &text)
    }

    pub fn parse(file: String, text: &str) -> Result<Self, Error> {
        match text.parse() {
            Ok(table) => Ok(Layer { file, table }),
            Err(e) => Err(Error::Syntax { file, message: e.to_string().trim_end().to_owned() }),
        }
    }
}

/// Longest settings file, bytes: a sensor file of 4000 markers has a tenth of that.
const MOST_BYTES: u64 = 1 << 20;

/// Reads a text file of at most 1 MiB; a device or pipe that never ends is read no further.
pub(crate) fn read_text(path: &Path) -> Result<String, Error> {
    String::from_utf8(read_bytes(path)?).map_err(|_| Error::NotText { file: path.display().to_string() })
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |source| Error::Read { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(failed)?;
    file.by_ref().take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MOST_BYTES {
        let length = file.metadata().ok().filter(Metadata::is_file).map(|facts| facts.len());
        let got = length.map_or("more".into(), |length| length.to_string());
        return Err(Error::TooLong { file: path.display().to_string(), most_bytes: MOST_BYTES, got });
    }
    Ok(bytes)
}

/// The same for other TOML files.
pub(crate) fn read_most(path: &Path) -> io::Result<String> {
    read_text(path).map_err(without_path)
}

/// The same for a file that is passed on unchanged.
pub(crate) fn read_most_bytes(path: &Path) -> io::Result<Vec<u8>> {
    read_bytes(path).map_err(without_path)
}

fn without_path(error: Error) -> io::Error {
    match error {
        Error::Read { source, .. } => source,
        Error::TooLong { most_bytes, got, .. } => {
            io::Error::other(format!("expected at most {most_bytes} bytes of TOML, got {got}"))
        }
        other => io::Error::other(other),
    }
}

/// A typed value from merged layers; an error names the first layer that holds the key.
pub(crate) fn typed<T: DeserializeOwned>(merged: Table, layers: &[Layer]) -> Result<T, Error> {
    let all = Value::Table(merged);
    serde_path_to_error::deserialize(all.clone()).map_err(|e| {
        let path = e.path().to_string();
        let message = e.inner().to_string();
        // A second line names the table.
        let problem = message.lines().next().unwrap_or_default();
        let mut quoted = problem.split('`').skip(1).step_by(2).map(str::to_owned);
        if problem.starts_with("unknown field") {
            let unknown = quoted.next().unwrap_or_default();
            let expected: Vec<String> = quoted.collect();
            let key = match path.as_str() {
                "." => unknown.clone(),
                _ if path == unknown || path.ends_with(&format!(".{unknown}")) => path,
                _ => format!("{path}.{unknown}"),
            };
            let names: Vec<&str> = expected.iter().map(String::as_str).collect();
            let nearest = nearest(&unknown, &names).map(str::to_owned);
            return Error::UnknownKey { file: file_of_key(layers, &key), key, nearest, expected };
        }
        let (key, problem) = match (problem.starts_with("missing field"), path.as_str()) {
            (true, ".") => (quoted.next().unwrap_or_default(), MISSING.to_owned()),
            (true, table) => (format!("{table}.{}", quoted.next().unwrap_or_default()), MISSING.to_owned()),
            (false, _) => (path, expected_and_got(problem, value_at(&all, e.path()))),
        };
        Error::Value { file: file_of_key(layers, &key), key, problem }
    })
}

/// What is wrong with a key that is missing.
const MISSING: &str = "expected a value, got none";

/// The value at a path.
fn value_at<'a>(all: &'a Value, path: &serde_path_to_error::Path) -> Option<&'a Value> {
    path.iter().try_fold(all, |value, segment| match segment {
        Segment::Map { key } => value.get(key),
        Segment::Seq { index } => value.get(*index),
        Segment::Enum { .. } | Segment::Unknown => None,
    })
}

/// The parser's message as `expected X, got Y`, in the terms of TOML; one that expects nothing as it is.
fn expected_and_got(problem: &str, value: Option<&Value>) -> String {
    let (said, kind) = match problem.rsplit_once("expected ") {
        // A check of ours that says it all.
        Some((_, kind)) if kind.contains(", got ") => return problem.to_owned(),
        Some(parts) => parts,
        // A table in place of a name.
        None if problem.starts_with("wanted exactly 1 element") => ("", "string only"),
        None => return problem.to_owned(),
    };
    let kind = match kind {
        "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" | "u64" | "usize" => "a whole number not below 0",
        "string only" => "a string",
        "a sequence" => "an array",
        "a map" => "a table",
        "fewer elements in array" => "a shorter array",
        _ if kind.starts_with("struct ") => "a table",
        other => other,
    };
    let got = match value {
        Some(Value::String(name)) if said.starts_with("unknown variant") => format!("`{name}`"),
        Some(Value::String(text)) => format!("{text:?}"),
        Some(Value::Table(_)) => "a table".to_owned(),
        Some(Value::Array(values)) => format!("an array of length {}", values.len()),
        Some(other) => other.to_string(),
        None => return format!("expected {kind}"),
    };
    format!("expected {kind}, got {got}")
}

/// The file whose value of a dotted key counts: the first of those that hold most of its parts. A remark after the key,
/// `key (sum)`, is no part of it.
pub(crate) fn file_of_key(layers: &[Layer], key: &str) -> String {
    let parts: Vec<&str> = key.split([' ', '[']).next().unwrap_or(key).split('.').collect();
    let held_count = |layer: &Layer| {
        let inner = |table: &mut Option<&Table>, part: &&str| {
            let value = (*table)?.get(*part)?;
            *table = value.as_table();
            Some(())
        };
        parts.iter().scan(Some(&layer.table), inner).count()
    };
    // Of equal ones, max_by_key takes the last.
    layers.iter().rev().max_by_key(|layer| held_count(layer)).map_or_else(String::new, |l| l.file.clone())
}
