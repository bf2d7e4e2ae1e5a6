//! Which fingers a hand has and how they are mounted: a TOML file.
//!
//! ```toml
//! name = "wsg50 with two GelSlims"
//!
//! [[fingers]]
//! name = "left"
//! serial = "GS-007"             # that of its sensor file
//! side = "left"                 # left or right, seen from the wrist
//! sensor = "left.toml"          # a built-in name, or a file beside this one
//! mounting = { x = "+x", y = "+y" }
//! ```
//!
//! `mounting` says along which axis of the shared hand frame the finger's own x and y point. The hand frame: x from the
//! wrist to the fingertips, y across the gripper's opening plane, z along the opening, from left to right.
//!
//! A finger's z points into its gel, so its x and y may be any two axes of the hand at a right angle.

use crate::config::{Error, Layer, typed};
use crate::sensors;
use serde::Deserialize;
use slipbound::plane::Vec2;
use slipbound::sensor::{Sensor, SettingError};
use std::path::Path;

/// A hand and its fingers, checked.
#[derive(Debug, Clone)]
pub struct Hand {
    /// What the hand is called.
    pub name: String,
    /// At least one finger; names and serials differ.
    pub fingers: Vec<Finger>,
}

/// One finger of a hand.
#[derive(Debug, Clone)]
pub struct Finger {
    /// What it is called in reports.
    pub name: String,
    /// Its serial number, which its sensor file must bear.
    pub serial: String,
    /// On which side it is.
    pub side: Side,
    /// Its facts.
    pub sensor: Sensor,
    /// From the finger frame to the hand frame.
    pub mounting: Mounting,
}

/// Where a finger is, seen from the wrist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
}

/// An axis of the hand, with its sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum Axis {
    /// To the fingertips.
    #[serde(rename = "+x")]
    PlusX,
    /// To the wrist.
    #[serde(rename = "-x")]
    MinusX,
    /// Across.
    #[serde(rename = "+y")]
    PlusY,
    /// Across, the other way.
    #[serde(rename = "-y")]
    MinusY,
    /// To the right finger.
    #[serde(rename = "+z")]
    PlusZ,
    /// To the left finger.
    #[serde(rename = "-z")]
    MinusZ,
}

impl Axis {
    /// The unit vector in the hand frame.
    pub fn unit(self) -> [f64; 3] {
        match self {
            Axis::PlusX => [1.0, 0.0, 0.0],
            Axis::MinusX => [-1.0, 0.0, 0.0],
            Axis::PlusY => [0.0, 1.0, 0.0],
            Axis::MinusY => [0.0, -1.0, 0.0],
            Axis::PlusZ => [0.0, 0.0, 1.0],
            Axis::MinusZ => [0.0, 0.0, -1.0],
        }
    }
}

/// Along which axes of the hand a finger's x and y point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// The finger's x.
    pub x: Axis,
    /// The finger's y.
    pub y: Axis,
}

impl Mounting {
    /// A vector of the finger frame (a displacement, a force, a slip direction) in the hand frame, in its own unit.
    pub fn hand_from_finger(&self, v: Vec2) -> [f64; 3] {
        let (x, y) = (self.x.unit(), self.y.unit());
        std::array::from_fn(|k| v.x * x[k] + v.y * y[k])
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HandFile {
    name: String,
    fingers: Vec<FingerFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FingerFile {
    name: String,
    serial: String,
    side: Side,
    sensor: String,
    mounting: Mounting,
}

/// Reads a hand file and the sensor files it names. The error names file, key, expected and got.
pub fn load(path: &Path) -> Result<Hand, Error> {
    let layer = Layer::read(path)?;
    let file: HandFile = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    let refuse = |key: String, expected: &str, got: String| {
        let source = SettingError { key, expected: expected.into(), got };
        Err(Error::OutOfRange { file: layer.file.clone(), source })
    };
    if file.fingers.is_empty() {
        return refuse("fingers".into(), "at least one finger", "none".into());
    }
    let mut fingers: Vec<Finger> = Vec::new();
    for (i, f) in file.fingers.into_iter().enumerate() {
        let key = |name: &str| format!("fingers[{i}].{name}");
        if f.name.trim().is_empty() || fingers.iter().any(|other| other.name == f.name) {
            return refuse(key("name"), "a name of its own", format!("`{}`", f.name));
        }
        if f.serial.trim().is_empty() || fingers.iter().any(|other| other.serial == f.serial) {
            return refuse(key("serial"), "a serial number of its own", format!("`{}`", f.serial));
        }
        let (x, y) = (f.mounting.x.unit(), f.mounting.y.unit());
        if x.iter().zip(y).any(|(a, b)| a * b != 0.0) {
            let got = format!("{:?} and {:?}", f.mounting.x, f.mounting.y);
            return refuse(key("mounting"), "x and y along different axes of the hand", got);
        }
        let is_file = f.sensor.ends_with(".toml");
        let beside = path.parent().unwrap_or(Path::new("")).join(&f.sensor).display().to_string();
        let sensor = sensors::load(if is_file { &beside } else { &f.sensor })?;
        match &sensor.serial {
            Some(serial) if *serial != f.serial => {
                return refuse(key("serial"), &format!("`{serial}` as in {}", f.sensor), format!("`{}`", f.serial));
            }
            _ => {}
        }
        fingers.push(Finger { name: f.name, serial: f.serial, side: f.side, sensor, mounting: f.mounting });
    }
    Ok(Hand { name: file.name, fingers })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HAND: &str = "name = \"two\"\n\
        [[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"a.toml\"\nmounting = { x = \"+x\", y = \"+y\" }\n\
        [[fingers]]\nname = \"right\"\nserial = \"B\"\nside = \"right\"\nsensor = \"gelslim\"\nmounting = { x = \"+x\", y = \"-y\" }\n";

    fn read(text: &str) -> Result<Hand, Error> {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("a.toml"), "extends = \"gelslim\"\nserial = \"A\"\n").expect("writes");
        let path = folder.path().join("hand.toml");
        std::fs::write(&path, text).expect("writes");
        load(&path)
    }

    /// The same slip seen by two fingers facing each other is one vector of the hand.
    #[test]
    fn fingers_that_face_each_other_agree_in_the_hand_frame() {
        let hand = read(HAND).expect("valid");
        let [left, right] = &hand.fingers[..] else { panic!("two fingers") };
        assert_eq!((left.side, right.side, left.sensor.serial.as_deref()), (Side::Left, Side::Right, Some("A")));
        let seen_left = left.mounting.hand_from_finger(Vec2::new(0.5, 2.0));
        assert_eq!(seen_left, right.mounting.hand_from_finger(Vec2::new(0.5, -2.0)));
        assert_eq!(seen_left, [0.5, 2.0, 0.0]);
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (from, to, parts) in [
            ("serial = \"A\"", "serial = \"C\"", ["hand.toml: fingers[0].serial", "`A` as in a.toml", "`C`"]),
            ("serial = \"B\"", "serial = \"A\"", ["fingers[1].serial", "a serial number of its own", "`A`"]),
            ("name = \"right\"", "name = \"left\"", ["fingers[1].name", "a name of its own", "`left`"]),
            ("y = \"-y\"", "y = \"-x\"", ["fingers[1].mounting", "different axes", "MinusX"]),
            ("y = \"-y\"", "y = \"up\"", ["hand.toml: fingers[1].mounting.y", "up", "`+x`"]),
            ("side = \"right\"", "side = \"top\"", ["fingers[1].side", "top", "`left`"]),
            ("side = \"right\"", "sides = \"right\"", ["hand.toml", "`fingers[1].sides`", "did you mean `side`?"]),
            ("\"a.toml\"", "\"b.toml\"", ["b.toml", "cannot read", ""]),
        ] {
            let message = read(&HAND.replacen(from, to, 1)).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
        let none = read("name = \"none\"\nfingers = []\n").expect_err("refused").to_string();
        assert!(none.contains("hand.toml: fingers: expected at least one finger, got none"), "{none}");
    }
}
