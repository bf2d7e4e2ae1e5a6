//! The settings of a gripper: defaults of the driver, overridden by a TOML file, overridden by the query of its
//! address.

use super::error::Error;
use crate::config::{self, Layer};
use serde::{Deserialize, Serialize};
use slipbound::setting::SettingError;
use std::path::Path;
use toml::{Table, Value};

/// Meaning of the force values in the gripper's protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceIs {
    /// Normal force per finger, as everywhere in Slipbound.
    PerFinger,
    /// The sum of both fingers.
    Total,
}

/// Whether a lower force may be sent while something is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lowering {
    /// No: this gripper has not yet been shown to keep its grip during the change.
    Refuse,
    /// Yes.
    Allow,
}

/// How the force of a WSG-50 is changed while it holds an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceChange {
    /// The force limit is set; if the measured force does not follow, the grasp command is repeated.
    Auto,
    /// The force limit is set, nothing else.
    Limit,
    /// The force limit is set and the grasp command repeated at once.
    Regrasp,
}

/// Settings of a gripper. Forces are per finger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The gripper they are for; given by the scheme of its address.
    #[serde(skip)]
    pub kind: Kind,
    /// Meaning of the force values in the gripper's protocol.
    pub force_is: ForceIs,
    /// Least force ever sent, N per finger.
    pub least_n: f64,
    /// Largest force ever sent, N per finger.
    pub most_n: f64,
    /// Whether a lower force may be sent while something is held.
    pub lowering: Lowering,
    /// How the force is changed while an object is held (WSG-50, binary, only).
    pub force_change: ForceChange,
    /// Width of the object, mm. A WSG-50 expects it, and calls contact far from it a collision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part_width_mm: Option<f64>,
    /// Opening to release to, mm; more where the object is wider.
    pub open_mm: f64,
    /// Speed of the jaws when they do not touch the object, mm/s.
    pub speed_mm_per_s: f64,
    /// Whether a fast stop that was latched because our own link was lost is acknowledged after reconnecting.
    pub acknowledge_own_fast_stop: bool,
    /// Error bound of the force reading after subtraction of its idle reading, N per finger: this plus
    /// `force_error_fraction` of the force. Unconfirmed for every gripper here.
    pub force_error_n: f64,
    /// See `force_error_n`.
    pub force_error_fraction: f64,
    /// Longest wait for an answer, ms.
    pub reply_ms: u64,
    /// Longest wait for the end of a motion, ms.
    pub motion_ms: u64,
    /// Longest time without a valid message, ms; after that `poll` is an error.
    pub silence_ms: u64,
    /// Time between two states, ms.
    pub update_ms: u64,
    /// Time in which the measured force must follow a new limit, ms (WSG-50, binary, only).
    pub follow_ms: u64,
    /// Robotiq only: its force setting (0 to 255) against newtons of its own, rising. Unconfirmed: the two ends are
    /// those of its data sheet, a straight line between.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_table: Vec<[f64; 2]>,
    /// Robotiq only: its position (0 to 255) against the opening in mm, falling. Unconfirmed like `force_table`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub opening_table: Vec<[f64; 2]>,
}

/// The kind of gripper: determines defaults and hardware limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kind {
    /// WSG-50, binary interface.
    Wsg50,
    /// WSG-50, text interface.
    Gcl,
    /// Robotiq 2F-85.
    Robotiq,
    /// Any gripper that answers the line protocol.
    Line,
    /// No gripper.
    #[default]
    Dry,
}

/// Largest bias of a force reading, either way, N per finger: a lower reading is no measurement.
pub(super) const MOST_BIAS_N: f64 = 10.0;

/// Slowest and fastest motion of a Robotiq, mm/s, by its data sheet.
pub(super) const ROBOTIQ_SPEEDS_MM_PER_S: (f64, f64) = (20.0, 150.0);

/// Largest force of a gripper that does not tell it, N per finger, unless it is set higher.
const UNKNOWN_MOST_N: f64 = 80.0;

impl Config {
    /// The defaults of a driver.
    pub fn of(kind: Kind) -> Self {
        let wsg50 = Config {
            kind,
            force_is: ForceIs::PerFinger,
            least_n: 5.0,
            most_n: 80.0,
            lowering: Lowering::Refuse,
            force_change: ForceChange::Auto,
            part_width_mm: None,
            open_mm: 100.0,
            speed_mm_per_s: 50.0,
            acknowledge_own_fast_stop: false,
            force_error_n: 1.5,
            force_error_fraction: 0.15,
            reply_ms: 450,
            motion_ms: 10_000,
            silence_ms: 500,
            update_ms: 20,
            follow_ms: 400,
            force_table: Vec::new(),
            opening_table: Vec::new(),
        };
        match kind {
            Kind::Wsg50 => wsg50,
            Kind::Gcl => Config { update_ms: 33, ..wsg50 },
            Kind::Robotiq => Config {
                least_n: 20.0,
                most_n: 235.0,
                open_mm: 85.0,
                force_table: vec![[0.0, 20.0], [255.0, 235.0]],
                opening_table: vec![[3.0, 85.0], [230.0, 0.0]],
                ..wsg50
            },
            // The other side is responsible for what a lower force does.
            Kind::Line | Kind::Dry => Config { lowering: Lowering::Allow, ..wsg50 },
        }
    }

    /// Defaults, overridden by the keys of a file, overridden by those of the address (`key=value`, joined by `&`).
    pub fn load(kind: Kind, file: Option<&Path>, address: &str, query: &str) -> Result<Self, Error> {
        let mut layers = Vec::new();
        let mut from_query = Table::new();
        for pair in query.split('&').filter(|pair| !pair.is_empty()) {
            let Some((key, value)) = pair.split_once('=') else {
                let why = format!("expected key=value after `?`, got `{pair}`");
                return Err(Error::Address { address: address.into(), why });
            };
            if let Some(before) = from_query.insert(key.into(), in_toml(value)) {
                let problem = format!("expected one value, got {before} and {}", in_toml(value));
                return Err(config::Error::Value { file: address.into(), key: key.into(), problem }.into());
            }
        }
        layers.push(Layer { file: address.into(), table: from_query });
        if let Some(path) = file {
            layers.push(Layer::read(path)?);
        }
        let mut merged = Table::try_from(Config::of(kind)).expect("settings are numbers, names and arrays of numbers");
        for layer in layers.iter().rev() {
            merged.extend(layer.table.clone());
        }
        let mut config = Config { kind, ..config::typed(merged, &layers)? };
        // What nobody has set follows what the gripper can do.
        let is_set = |key| layers.iter().any(|layer| layer.table.contains_key(key));
        let (least_n, most_n) = config.possible_n();
        if !is_set("least_n") {
            config.least_n = config.least_n.max(least_n).min(most_n);
        }
        if !is_set("most_n") {
            config.most_n = config.most_n.max(least_n).min(most_n);
        }
        if !is_set("open_mm") {
            config.open_mm = config.open_mm.min(config.stroke_mm());
        }
        let out_of_range = |source: SettingError| {
            let file = config::file_of_key(&layers, &source.key);
            config::Error::OutOfRange { file, source }
        };
        config.check().map_err(out_of_range)?;
        if let Some(width_mm) = config.part_width_mm.filter(|mm| is_set("open_mm") && config.open_mm <= *mm) {
            let expected = format!("more than part_width_mm, which is {width_mm}");
            let source = SettingError { key: "open_mm".into(), got: config.open_mm.to_string(), expected };
            return Err(out_of_range(source).into());
        }
        Ok(config)
    }

    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        if self.kind == Kind::Robotiq {
            table("force_table", &self.force_table, "two or more pairs [0 to 255, newtons], both rising", 1.0)?;
            table("opening_table", &self.opening_table, "two or more pairs [0 to 255, mm], the mm falling", -1.0)?;
        }
        let (least_n, most_n) = self.possible_n();
        within("least_n", self.least_n, least_n, most_n)?;
        within("most_n", self.most_n, self.least_n, most_n)?;
        within("open_mm", self.open_mm, 0.0, self.stroke_mm())?;
        let (slowest, fastest) = match self.kind {
            Kind::Robotiq => ROBOTIQ_SPEEDS_MM_PER_S,
            _ => (5.0, 420.0),
        };
        within("speed_mm_per_s", self.speed_mm_per_s, slowest, fastest)?;
        if let Some(width_mm) = self.part_width_mm {
            within("part_width_mm", width_mm, 0.0, self.stroke_mm())?;
        }
        within("force_error_n", self.force_error_n, 0.0, 100.0)?;
        within("force_error_fraction", self.force_error_fraction, 0.0, 1.0)?;
        for (key, ms) in [
            ("reply_ms", self.reply_ms),
            ("motion_ms", self.motion_ms),
            ("silence_ms", self.silence_ms),
            ("update_ms", self.update_ms),
            ("follow_ms", self.follow_ms),
        ] {
            within(key, ms as f64, 1.0, 60_000.0)?;
        }
        // These say nothing unless they are asked.
        if matches!(self.kind, Kind::Gcl | Kind::Robotiq) && self.update_ms >= self.silence_ms {
            let expected = format!("less than silence_ms, which is {}", self.silence_ms);
            return Err(SettingError { key: "update_ms".into(), got: self.update_ms.to_string(), expected });
        }
        Ok(())
    }

    /// Forces that the gripper can press with, N per finger.
    fn possible_n(&self) -> (f64, f64) {
        let (least_n, most_n) = match self.kind {
            Kind::Wsg50 | Kind::Gcl => (5.0, 80.0),
            Kind::Robotiq => (read_table(&self.force_table, 0, 0.0), read_table(&self.force_table, 0, 255.0)),
            Kind::Line | Kind::Dry => (0.0, 1000.0),
        };
        (least_n / self.own_per_finger(), most_n / self.own_per_finger())
    }

    /// The widest opening, mm.
    pub(super) fn stroke_mm(&self) -> f64 {
        match self.kind {
            Kind::Wsg50 | Kind::Gcl => 110.0,
            Kind::Robotiq => read_table(&self.opening_table, 0, 0.0),
            Kind::Line | Kind::Dry => 1000.0,
        }
    }

    /// The gripper's own newtons per newton per finger.
    fn own_per_finger(&self) -> f64 {
        match self.force_is {
            ForceIs::PerFinger => 1.0,
            ForceIs::Total => 2.0,
        }
    }

    /// Newtons per finger -> the gripper's own force values.
    pub fn to_own_n(&self, force_n: f64) -> f64 {
        force_n * self.own_per_finger()
    }

    /// The gripper's own force values -> newtons per finger; may be below 0 where its sensor has a bias. None when it
    /// is no measurement: not a number, below the largest bias, or more than twice what the gripper can press with.
    pub fn from_own_n(&self, own_n: f64) -> Option<f64> {
        let force_n = own_n / self.own_per_finger();
        let most_n = match self.kind {
            Kind::Line | Kind::Dry => self.most_n.max(UNKNOWN_MOST_N), // what it can press with is not known
            Kind::Wsg50 | Kind::Gcl | Kind::Robotiq => self.possible_n().1,
        };
        (-MOST_BIAS_N..=2.0 * most_n).contains(&force_n).then_some(force_n)
    }

    /// Whether a force reading is this force, N per finger, within the error of a reading.
    pub(super) fn is_reading_of(&self, reading_n: f64, force_n: f64) -> bool {
        (reading_n - force_n).abs() <= self.force_error_n + self.force_error_fraction * force_n
    }

    /// The force that a gripper has which is told this one, N per finger: a Robotiq takes it as a whole number.
    pub(crate) fn settable_n(&self, force_n: f64) -> f64 {
        match self.force_table.is_empty() {
            true => force_n,
            false => self.force_of_count(self.force_count(force_n)).unwrap_or(force_n),
        }
    }

    /// The force clamped to its range; None when it is not a number.
    pub fn admitted_n(&self, force_n: f64) -> Option<f64> {
        force_n.is_finite().then(|| force_n.clamp(self.least_n, self.most_n))
    }
}

/// A value of an address as TOML would read it: a number or truth value where it looks like one, else text.
fn in_toml(value: &str) -> Value {
    let parsed = format!("value = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
    match parsed {
        Some(value) if !value.is_table() && !value.is_datetime() => value,
        _ => Value::String(value.into()),
    }
}

fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), SettingError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: format!("a number from {low} to {high}") })
}

/// Checks pairs: the first number rises within a byte, the second goes one way (`sign`).
fn table(key: &str, pairs: &[[f64; 2]], expected: &str, sign: f64) -> Result<(), SettingError> {
    let steps = pairs.windows(2).all(|w| w[1][0] > w[0][0] && sign * (w[1][1] - w[0][1]) > 0.0);
    let bytes = pairs.iter().all(|pair| (0.0..=255.0).contains(&pair[0]) && pair[1].is_finite() && pair[1] >= 0.0);
    if pairs.len() >= 2 && steps && bytes {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: format!("{pairs:?}"), expected: expected.into() })
}

/// Interpolates a table along one of its columns: `from` 0 or 1; beyond its ends the end value counts.
pub(crate) fn read_table(pairs: &[[f64; 2]], from: usize, value: f64) -> f64 {
    let to = 1 - from;
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return 0.0 };
    let rises = last[from] > first[from];
    let before = |a: f64, b: f64| if rises { a <= b } else { a >= b };
    if before(value, first[from]) {
        return first[to];
    }
    for pair in pairs.windows(2) {
        let ([low, high], [low_to, high_to]) = ([pair[0][from], pair[1][from]], [pair[0][to], pair[1][to]]);
        if before(value, high) {
            return low_to + (high_to - low_to) * (value - low) / (high - low);
        }
    }
    last[to]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(kind: Kind, text: &str, query: &str) -> Result<Config, String> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("gripper.toml");
        std::fs::write(&path, text).expect("writes");
        Config::load(kind, Some(&path), "wsg50://x:1000", query).map_err(|e| e.to_string())
    }

    #[test]
    fn the_address_goes_before_the_file_and_the_file_before_the_defaults() {
        let got = load(Kind::Wsg50, "most_n = 40\nleast_n = 6.0\n", "most_n=30&part_width_mm=28&lowering=allow");
        let got = got.expect("valid");
        assert_eq!((got.least_n, got.most_n, got.part_width_mm), (6.0, 30.0, Some(28.0)));
        assert_eq!((got.lowering, got.force_is), (Lowering::Allow, ForceIs::PerFinger));
        for kind in [Kind::Wsg50, Kind::Gcl, Kind::Robotiq, Kind::Line, Kind::Dry] {
            assert_eq!(load(kind, "", "").expect("the defaults are valid"), Config::of(kind));
        }
    }

    #[test]
    fn what_nobody_has_set_follows_the_other_settings() {
        for (kind, text, forces_n) in [
            (Kind::Wsg50, "force_is = \"total\"\n", (5.0, 40.0)),
            (Kind::Gcl, "force_is = \"total\"\n", (5.0, 40.0)),
            (Kind::Robotiq, "force_is = \"total\"\n", (20.0, 117.5)),
            (Kind::Robotiq, "force_table = [[0, 30], [255, 125]]\n", (30.0, 125.0)),
        ] {
            let got = load(kind, text, "").expect("valid");
            assert_eq!((got.least_n, got.most_n), forces_n, "{kind:?}: {text}");
        }
        let got = load(Kind::Robotiq, "opening_table = [[3, 80], [230, 0]]\n", "part_width_mm=80").expect("valid");
        assert_eq!(got.open_mm, 80.0);
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (kind, text, query, parts) in [
            (Kind::Wsg50, "most = 3\n", "", ["gripper.toml", "`most`", "did you mean `most_n`?"]),
            (Kind::Wsg50, "most_n = 90\n", "", ["gripper.toml: most_n", "from 5 to 80", "got 90"]),
            (Kind::Wsg50, "force_is = \"total\"\n", "most_n=60", ["wsg50://x:1000: most_n", "from 5 to 40", "got 60"]),
            (Kind::Wsg50, "least_n = nan\n", "", ["gripper.toml: least_n", "from 5 to 80", "got NaN"]),
            (Kind::Wsg50, "", "lowering=maybe", ["wsg50://x:1000: lowering", "maybe", "`allow`"]),
            (
                Kind::Wsg50,
                "",
                "lowering=refuse&lowering=allow",
                ["x:1000: lowering", "one value", "\"refuse\" and \"allow\""],
            ),
            (Kind::Wsg50, "", "most_n", ["wsg50://x:1000", "key=value", "`most_n`"]),
            (Kind::Robotiq, "force_table = [[0, 9], [255, 9]]\n", "", ["gripper.toml: force_table", "rising", "9.0"]),
            (Kind::Wsg50, "", "open_mm=200", ["wsg50://x:1000: open_mm", "from 0 to 110", "got 200"]),
            (
                Kind::Robotiq,
                "speed_mm_per_s = 300\n",
                "",
                ["gripper.toml: speed_mm_per_s", "from 20 to 150", "got 300"],
            ),
            (Kind::Robotiq, "open_mm = 90\n", "", ["gripper.toml: open_mm", "from 0 to 85", "got 90"]),
            (
                Kind::Gcl,
                "part_width_mm = 60\n",
                "open_mm=60",
                ["x:1000: open_mm", "part_width_mm, which is 60", "got 60"],
            ),
            (Kind::Robotiq, "", "least_n=10", ["wsg50://x:1000: least_n", "from 20 to 235", "got 10"]),
            (Kind::Robotiq, "", "most_n=300", ["wsg50://x:1000: most_n", "from 20 to 235", "got 300"]),
            (
                Kind::Gcl,
                "",
                "update_ms=600",
                ["wsg50://x:1000: update_ms", "less than silence_ms, which is 500", "got 600"],
            ),
            (Kind::Robotiq, "silence_ms = 20\n", "", ["update_ms", "less than silence_ms, which is 20", "got 20"]),
            (Kind::Robotiq, "", "force_is=total&most_n=150", ["most_n", "from 20 to 117.5", "got 150"]),
        ] {
            let message = load(kind, text, query).expect_err("refused");
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
    }

    #[test]
    fn a_value_of_an_address_is_a_number_or_a_truth_value_where_it_looks_like_one_and_else_text() {
        assert_eq!(in_toml("28.5"), Value::Float(28.5));
        assert_eq!(in_toml("true"), Value::Boolean(true));
        for text in ["allow", "2026-01-02", "12:30:00", "{ a = 1 }", "a b", ""] {
            assert_eq!(in_toml(text), Value::String(text.into()), "{text}");
        }
    }

    #[test]
    fn newtons_are_converted_and_brought_inside() {
        let mut config = Config::of(Kind::Wsg50);
        assert_eq!((config.to_own_n(20.0), config.from_own_n(20.0)), (20.0, Some(20.0)));
        config.force_is = ForceIs::Total;
        assert_eq!((config.to_own_n(20.0), config.from_own_n(20.0)), (40.0, Some(10.0)));
        assert_eq!(
            (config.from_own_n(f64::NAN), config.from_own_n(1e9), config.from_own_n(-0.2)),
            (None, None, Some(-0.1))
        );
        for kind in [Kind::Wsg50, Kind::Gcl, Kind::Robotiq, Kind::Line] {
            let low = Config { most_n: 30.0, ..Config::of(kind) };
            assert_eq!((low.from_own_n(70.0), low.from_own_n(471.0)), (Some(70.0), None), "{kind:?}");
        }
        for (asked_n, given_n) in [(1e9, 80.0), (-1e9, 5.0), (-3.0, 5.0), (6.5, 6.5)] {
            assert_eq!(config.admitted_n(asked_n), Some(given_n));
        }
        for no_number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(config.admitted_n(no_number), None);
        }
    }

    #[test]
    fn tables_are_read_both_ways() {
        let force = [[0.0, 20.0], [100.0, 60.0], [255.0, 235.0]];
        let opening = [[3.0, 85.0], [230.0, 0.0]];
        for (pairs, from, value, expected) in [
            (&force[..], 0, 50.0, 40.0),
            (&force, 1, 40.0, 50.0),
            (&force, 1, 500.0, 255.0),
            (&force, 1, 3.0, 0.0),
            (&opening, 0, 255.0, 0.0),
            (&opening, 0, 0.0, 85.0),
            (&opening, 1, 42.5, 116.5),
            (&opening, 1, 99.0, 3.0),
        ] {
            assert_eq!(read_table(pairs, from, value), expected, "{value}");
        }
    }
}
