//! The parameters of scenes: names with units, meanings, ranges.

use crate::faults::Faults;
use crate::objects::Object;
use crate::render::SURROUNDINGS;
use serde::{Deserialize, Serialize};
use slipbound::setting::SettingError;
use std::fmt;

/// A parameter.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Its name, with the unit of a number.
    pub name: &'static str,
    /// What it means.
    pub what: &'static str,
    /// Its allowed values.
    pub kind: Kind,
    /// Its default; empty if every scene that uses it sets its own.
    pub default: &'static str,
}

/// Allowed values of a parameter.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A number from the first to the second.
    Number(f64, f64),
    /// A whole number from the first to the second.
    Count(u32, u32),
    /// One of these words.
    Word(&'static [&'static str]),
    /// A number from the first to the second, or `object`: the object's own value.
    OfObject(f64, f64),
    /// The name of an object.
    Object,
    /// Faults as [`Faults::parse`] reads them, or `none`.
    Faults,
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// A number, in the unit its key names.
    Number(f64),
    /// A word.
    Word(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Number(number) => write!(f, "{number}"),
            Value::Word(word) => f.write_str(word),
        }
    }
}

pub(crate) const fn number(name: &'static str, low: f64, high: f64, default: &'static str, what: &'static str) -> Key {
    Key { name, what, kind: Kind::Number(low, high), default }
}

/// Keys that every scene takes.
pub const COMMON_KEYS: &[Key] = &[
    Key { name: "object", what: "what is held", kind: Kind::Object, default: "bottle_cap" },
    number("force_n", 0.1, 120.0, "20", "normal force per finger"),
    Key { name: "mu", what: "friction coefficient", kind: Kind::OfObject(0.05, 2.0), default: "object" },
    number("turn_deg", -180.0, 180.0, "0", "how the object is turned on the pad"),
    number("at_x_mm", -15.0, 15.0, "0", "where the object touches, along the finger"),
    number("at_y_mm", -12.0, 12.0, "0", "where the object touches, across the finger"),
    Key { name: "rest_frames", what: "frames before it touches", kind: Kind::Count(1, 3000), default: "12" },
    Key { name: "rate_hz", what: "frames per second", kind: Kind::Count(10, 120), default: "30" },
    number("press_s", 0.05, 30.0, "0.3", "time in which it is pressed"),
    number("settle_s", 0.05, 30.0, "0.2", "time between pressing and what follows"),
    Key { name: "camera", what: "camera model", kind: Kind::Word(&["gelslim", "gelsight_mini"]), default: "gelslim" },
    Key {
        name: "surroundings",
        what: "around the gel and on the lens; camera: as the camera has them",
        kind: Kind::Word(&SURROUNDINGS),
        default: "camera",
    },
    Key { name: "jpeg_quality", what: "of the frames", kind: Kind::Count(30, 100), default: "85" },
    Key {
        name: "grid",
        what: "cells of the gel: 96x72 or 64x48",
        kind: Kind::Word(&["standard", "fast"]),
        default: "standard",
    },
    Key { name: "fault", what: "faults, as drop=0.02,torn=0.01", kind: Kind::Faults, default: "none" },
];

/// Fastest rotation of a scene, in deg/s.
pub(super) const MOST_DEG_PER_S: f64 = 720.0;

/// Keys that some scenes take.
pub const SCENE_KEYS: &[Key] = &[
    number("hold_s", 0.05, 36_000.0, "", "how long it is held"),
    number("distance_mm", 0.0, 30.0, "", "how far it is moved"),
    number("direction_deg", -360.0, 360.0, "", "to where: 0 along the finger, 90 across it"),
    number("speed_mm_per_s", 0.05, 200.0, "", "how fast"),
    number("angle_deg", -180.0, 180.0, "", "how far it is turned, positive from x to y"),
    number("speed_deg_per_s", 0.5, MOST_DEG_PER_S, "", "how fast it is turned"),
    number("twist_fraction", -1.0, 1.0, "", "0 pulls only, 1 turns only, -1 turns back"),
    number("ramp_s", 0.05, 120.0, "", "time until the load would make it slide"),
    number("peak_fraction", 0.01, 8.0, "", "load at which the ramp ends, as a share of that"),
    number("step_n", 0.5, 60.0, "", "by which the grip grows at a time"),
    number("most_n", 1.0, 120.0, "", "to which the grip grows"),
    number("regrip_fraction", 0.3, 5.0, "", "grip in the end, as a share of force_n"),
    number("regrip_at_fraction", 0.0, 2.0, "", "used fraction at which the grip is kept while it changes"),
    Key { name: "regrips", what: "steps in which it gets there", kind: Kind::Count(1, 20), default: "" },
    number("frequency_hz", 0.1, 15.0, "", "of the vibration"),
    number("fill_kg_per_s", 0.01, 2.0, "", "by which the mass grows"),
    number("most_kg", 0.02, 10.0, "", "to which the mass grows"),
    number("lift_s", 0.05, 30.0, "", "time in which the weight is taken up"),
    number("arm_n_per_mm", 0.5, 200.0, "", "stiffness of the arm that pushes"),
];

impl Key {
    /// Reads a value; refuses what is out of range.
    pub(crate) fn read(&self, text: &str) -> Result<Value, SettingError> {
        let refuse = |expected: String| SettingError { key: self.name.into(), got: text.into(), expected };
        let number = |low: f64, high: f64| {
            let value = text.parse().ok().filter(|value| (low..=high).contains(value));
            value.map(Value::Number).ok_or_else(|| refuse(format!("a number from {low} to {high}")))
        };
        match self.kind {
            Kind::Number(low, high) => number(low, high),
            Kind::OfObject(_, _) if text == "object" => Ok(Value::Word(text.into())),
            Kind::OfObject(low, high) => {
                number(low, high).map_err(|error| SettingError { expected: error.expected + ", or `object`", ..error })
            }
            Kind::Count(low, high) => {
                let value = text.parse::<u32>().ok().filter(|value| (low..=high).contains(value));
                let value = value.ok_or_else(|| refuse(format!("a whole number from {low} to {high}")))?;
                Ok(Value::Number(f64::from(value)))
            }
            Kind::Word(words) if words.contains(&text) => Ok(Value::Word(text.into())),
            Kind::Word(words) => Err(SettingError::none_of(self.name, text, words)),
            Kind::Object => Object::named(text).map(|object| Value::Word(object.name.into())),
            Kind::Faults if text == "none" => Ok(Value::Word(text.into())),
            Kind::Faults => Faults::parse(text).map(|_| Value::Word(text.into())),
        }
    }
}
