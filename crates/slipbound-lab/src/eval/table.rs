//! Tables of a sweep, as Markdown and as JSON.

use super::shard::Shard;
use super::statistics::Estimated;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fmt::Write;

/// The definition of a sweep: enough to run it again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// The protocol.
    pub protocol: String,
    /// The seed of its trials.
    pub seed: u64,
    /// Number of its trials, over all shards.
    pub trials_count: u64,
    /// The software that ran it; another version may generate other frames.
    pub software_version: String,
    /// Everything else that changes a record: detectors, data, options.
    #[serde(default)]
    pub settings: std::collections::BTreeMap<String, String>,
}

/// An entry of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A word.
    Word(String),
    /// A whole number.
    Count(u64),
    /// A share of a whole, shown in percent.
    Share(Estimated),
    /// A number, shown with the given number of decimals.
    Number(Estimated, usize),
    /// Unknown.
    None,
}

impl From<&str> for Cell {
    fn from(word: &str) -> Self {
        Cell::Word(word.into())
    }
}

impl From<String> for Cell {
    fn from(word: String) -> Self {
        Cell::Word(word)
    }
}

impl Cell {
    /// A number without interval.
    pub fn plain(value: f64, n: u64, decimals: usize) -> Cell {
        Cell::Number(Estimated { value: Some(value), low: None, high: None, n }, decimals)
    }

    /// A published share, in percent as printed: without interval.
    pub fn published(percent: f64, n: u64) -> Cell {
        Cell::Share(Estimated { value: Some(percent / 100.0), low: None, high: None, n })
    }

    /// The number with its interval.
    fn text(&self) -> String {
        let shown = |estimated: &Estimated, scale: f64, decimals: usize| {
            let number = |value: f64| format!("{:.decimals$}", scale * value);
            match (estimated.value, estimated.low, estimated.high) {
                (Some(value), Some(low), Some(high)) => {
                    format!("{} [{}, {}]", number(value), number(low), number(high))
                }
                (Some(value), _, _) => number(value),
                (None, _, _) => "-".into(),
            }
        };
        match self {
            Cell::Word(word) => word.clone(),
            Cell::Count(count) => count.to_string(),
            // A published one keeps its two decimals.
            Cell::Share(share) => shown(share, 100.0, if share.low.is_some() { 1 } else { 2 }),
            Cell::Number(number, decimals) => shown(number, 1.0, *decimals),
            Cell::None => "-".into(),
        }
    }

    fn json(&self) -> Value {
        match self {
            Cell::Word(word) => json!(word),
            Cell::Count(count) => json!(count),
            Cell::Share(estimated) | Cell::Number(estimated, _) => json!(estimated),
            Cell::None => Value::Null,
        }
    }
}

/// Rows and columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// How to read it.
    pub note: String,
    /// Names of the columns, with units; shares in percent.
    pub columns: Vec<String>,
    /// Rows, each with as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(title: &str, note: &str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|&column| column.into()).collect();
        Table { title: title.into(), note: note.into(), columns, rows: Vec::new() }
    }

    /// The rows as text: numbers with their intervals in brackets.
    pub fn shown(&self) -> Vec<Vec<String>> {
        self.rows.iter().map(|row| row.iter().map(Cell::text).collect()).collect()
    }

    /// As Markdown: heading, note, table.
    pub fn markdown(&self) -> String {
        let mut text = format!("## {}\n\n", self.title);
        if !self.note.is_empty() {
            let _ = write!(text, "{}\n\n", self.note);
        }
        let _ = writeln!(text, "| {} |", self.columns.join(" | "));
        let _ = writeln!(text, "|{}", "---|".repeat(self.columns.len()));
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(|cell| cell.text().replace('|', "\\|")).collect();
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        text
    }

    /// As JSON: title, note, columns, rows; an estimated number is an object with value, low, high and n, and a share
    /// stays a fraction.
    pub fn json(&self) -> Value {
        let rows: Vec<Vec<Value>> = self.rows.iter().map(|row| row.iter().map(Cell::json).collect()).collect();
        json!({ "title": self.title, "note": self.note, "columns": self.columns, "rows": rows })
    }
}

/// All tables of a sweep, or of a shard of it, as a Markdown file.
pub fn markdown(sweep: &Sweep, shard: Shard, tables: &[Table]) -> String {
    let part = if shard == Shard::WHOLE { String::new() } else { format!("shard {shard} of ") };
    let mut text = format!(
        "# {}\n\nProtocol {}, seed {}, {part}{} trials, version {}",
        sweep.protocol, sweep.protocol, sweep.seed, sweep.trials_count, sweep.software_version
    );
    for (key, value) in &sweep.settings {
        let _ = write!(text, ", {key} {value}");
    }
    text.push_str(". In brackets 95 % intervals: of shares Wilson's, of areas under the curve Newcombe's, of quantiles by order statistics.\n");
    for table in tables {
        text.push('\n');
        text.push_str(&table.markdown());
    }
    text
}

/// All tables of a sweep, or of a shard of it, as a JSON file.
pub fn json(sweep: &Sweep, shard: Shard, tables: &[Table]) -> Value {
    json!({ "sweep": sweep, "shard": shard, "tables": tables.iter().map(Table::json).collect::<Vec<Value>>() })
}

#[cfg(test)]
mod tests {
    use super::super::statistics::{mean, share};
    use super::*;

    #[test]
    fn a_table_says_numbers_with_intervals_in_both_forms() {
        let mut table = Table::new("Detectors", "As they fell.", &["detector", "right %", "lead ms", "alarms", "mu"]);
        table.rows.push(vec![
            "ours|now".into(),
            Cell::Share(share(15, 148)),
            Cell::Number(mean(&[500.0]), 0),
            Cell::Count(3),
            Cell::None,
        ]);
        let text = table.markdown();
        assert!(text.contains("| detector | right % | lead ms | alarms | mu |\n|---|---|---|---|---|\n"), "{text}");
        assert!(text.contains("| ours\\|now | 10.1 [6.2, 16.0] | 500 | 3 | - |"), "{text}");
        let json = table.json();
        assert_eq!(json["rows"][0][1]["n"], 148);
        assert_eq!((json["rows"][0][2]["low"].clone(), json["rows"][0][4].clone()), (Value::Null, Value::Null));
    }
}
