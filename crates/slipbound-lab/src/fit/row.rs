//! A row of training data from a frame.

use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;

/// A frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the trial in the split.
    pub trial: u64,
    /// The held object.
    pub object: String,
    /// Weight.
    pub weight: f64,
    /// Friction coefficient.
    pub mu: f64,
    /// Targets: used fraction f and stick ratio phi; or 1 if it slides as a whole, else 0, and f.
    pub targets: [f64; 2],
    /// The features: [`slipbound::monitor::Features`] or [`slipbound::monitor::SlideFeatures`].
    pub features: Vec<f64>,
}

/// Why rows cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RowError {
    /// The file.
    #[error("{path}: {source}")]
    File {
        /// Its path.
        path: String,
        /// Why.
        source: io::Error,
    },
    /// A line of it.
    #[error("{path}, line {line}: expected a row of {expected} features, got {problem}")]
    Line {
        /// Its path.
        path: String,
        /// From 1.
        line: usize,
        /// How many features it should have.
        expected: usize,
        /// What is wrong.
        problem: String,
    },
}

impl Row {
    /// A row, rounded so that a file stores it exactly.
    pub fn new(trial: u64, object: &str, weight: f64, mu: f64, targets: [f64; 2], features: &[f64]) -> Self {
        let round = |value: f64| (value * 1e5).round() / 1e5 + 0.0;
        let features = features.iter().copied().map(round).collect();
        Row { trial, object: object.into(), weight, mu: round(mu), targets: targets.map(round), features }
    }
}

/// Reads rows with this number of features, a JSON object a line.
pub fn read_rows(path: &Path, features_count: usize) -> Result<Vec<Row>, RowError> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|source| RowError::File { path: name.clone(), source })?;
    let row = |(n, line): (usize, &str)| {
        let bad =
            |problem: String| RowError::Line { path: name.clone(), line: n + 1, expected: features_count, problem };
        let row: Row = serde_json::from_str(line).map_err(|error| bad(error.to_string()))?;
        if row.features.len() == features_count { Ok(row) } else { Err(bad(format!("{}", row.features.len()))) }
    };
    text.lines().enumerate().map(row).collect()
}

/// Writes rows, a JSON object a line.
pub fn write_rows(path: &Path, rows: &[Row]) -> Result<(), RowError> {
    let failed = |source| RowError::File { path: path.display().to_string(), source };
    let mut text = String::new();
    for row in rows {
        text += &serde_json::to_string(row).map_err(|error| failed(io::Error::other(error)))?;
        text.push('\n');
    }
    fs::write(path, text).map_err(failed)
}
