//! A cycle as a line of JSON and back, exact to the last bit.
//!
//! JSON cannot represent infinity or NaN: `serde_json` writes null. A line with such numbers gets one more key,
//! `not_finite`, with their places, so that a replay sees what the loop saw.

use serde::{Deserialize, Serialize};
use slipbound::control::Cycle;
use std::collections::BTreeMap;
use toml::Value;

/// Dotted key to `nan`, `inf` or `-inf`.
type NotFinite = BTreeMap<String, String>;

#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    cycle: &'a Cycle,
    #[serde(skip_serializing_if = "NotFinite::is_empty")]
    not_finite: NotFinite,
}

pub(crate) fn write(cycle: &Cycle) -> Result<String, String> {
    // TOML values can be any floating-point number, so this tree is searched; their integers end at half the range of a
    // frame's.
    let tree = Value::try_from(small(*cycle)).map_err(|e| e.to_string())?;
    let mut not_finite = NotFinite::new();
    find(&tree, &mut String::new(), &mut not_finite);
    serde_json::to_string(&Line { cycle, not_finite }).map_err(|e| e.to_string())
}

pub(super) fn read(line: &str) -> Result<Cycle, String> {
    let mut json: serde_json::Value = serde_json::from_str(line).map_err(|e| e.to_string())?;
    let Some(not_finite) = json.as_object_mut().and_then(|keys| keys.remove("not_finite")) else {
        return serde_json::from_str(line).map_err(|e| e.to_string());
    };
    let not_finite: NotFinite = serde_json::from_value(not_finite).map_err(|e| format!("not_finite: {e}"))?;
    let hand = json.get_mut("hand").and_then(serde_json::Value::as_object_mut).ok_or("hand: expected an object")?;
    let whole: WholeNumbers = serde_json::from_value(hand.clone().into()).map_err(|e| format!("hand: {e}"))?;
    hand.insert("seq".into(), 0.into());
    hand.remove("time_ns");
    let mut tree = finite_part(json).ok_or("expected an object, got null")?;
    for (path, number) in not_finite {
        let number = number.parse().map_err(|_| format!("not_finite.{path}: expected a number, got `{number}`"))?;
        put(&mut tree, &path, number).ok_or_else(|| format!("not_finite: expected keys of this line, got `{path}`"))?;
    }
    let mut cycle: Cycle = tree.try_into().map_err(|e| e.to_string())?;
    (cycle.hand.seq, cycle.hand.time_ns) = (whole.seq, whole.time_ns);
    Ok(cycle)
}

/// Number and time of a frame, which a camera may choose freely.
#[derive(Deserialize)]
struct WholeNumbers {
    seq: u64,
    time_ns: Option<u64>,
}

/// The same without them.
fn small(mut cycle: Cycle) -> Cycle {
    (cycle.hand.seq, cycle.hand.time_ns) = (0, None);
    cycle
}

fn find(value: &Value, path: &mut String, into: &mut NotFinite) {
    match value {
        Value::Float(number) if !number.is_finite() => {
            into.insert(path.clone(), number.to_string());
        }
        Value::Table(table) => {
            for (key, value) in table {
                let length = path.len();
                if length > 0 {
                    path.push('.');
                }
                path.push_str(key);
                find(value, path, into);
                path.truncate(length);
            }
        }
        _ => {}
    }
}

/// The same tree without nulls, which TOML lacks.
fn finite_part(json: serde_json::Value) -> Option<Value> {
    Some(match json {
        serde_json::Value::Null => return None,
        serde_json::Value::Bool(is) => Value::Boolean(is),
        serde_json::Value::Number(number) => match number.as_i64() {
            Some(whole) => Value::Integer(whole),
            None => Value::Float(number.as_f64()?),
        },
        serde_json::Value::String(text) => Value::String(text),
        serde_json::Value::Array(values) => Value::Array(values.into_iter().filter_map(finite_part).collect()),
        serde_json::Value::Object(keys) => {
            Value::Table(keys.into_iter().filter_map(|(key, value)| Some((key, finite_part(value)?))).collect())
        }
    })
}

fn put(tree: &mut Value, path: &str, number: f64) -> Option<()> {
    let (parents, last) = path.rsplit_once('.').map_or((None, path), |(parents, last)| (Some(parents), last));
    let parent = match parents {
        Some(parents) => parents.split('.').try_fold(tree, |value, key| value.get_mut(key))?,
        None => tree,
    };
    parent.as_table_mut()?.insert(last.to_owned(), Value::Float(number));
    Some(())
}
