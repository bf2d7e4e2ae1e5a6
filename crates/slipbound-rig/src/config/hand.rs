//! Which fingers a hand has and how they are mounted: a TOML file.
//!
//! ```toml
//! name = "wsg50 with two GelSlims"
//!
//! [[fingers]]
//! name = "left"                 # of A-Z a-z 0-9 _ -
//! serial = "GS-007"             # that of its sensor file
//! side = "left"                 # left or right, seen from the wrist
//! sensor = "left.toml"          # a built-in name, or a file beside this one
//! mounting = { x = "+x", y = "-y" }
//! ```
//!
//! `mounting` gives the axes of the hand frame ([`slipbound::hand`]) along which the x and y of the finger's image point (right and
//! down on the screen). Without `mounting` the image is taken to be not rotated: x along +x, y along -y on the left and along
//! +y on the right. A mirrored image is corrected by the flip of its sensor file, not here.

use super::error::Error;
use super::layer::{Layer, typed};
use super::sensors;
use serde::Deserialize;
use slipbound::hand::{FINGERS_MOST, Mounting, Side, check_sides};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;
use std::fmt;
use std::path::Path;

/// A hand and its fingers, checked.
#[derive(Debug, Clone)]
pub struct HandConfig {
    /// Name of the hand.
    pub name: String,
    /// One to [`FINGERS_MOST`] fingers; names and serials differ, and if there are several, both sides have some.
    pub fingers: Vec<FingerConfig>,
}

/// One finger of a hand.
#[derive(Debug, Clone)]
pub struct FingerConfig {
    /// Its name in reports, see [`finger_name`].
    pub name: String,
    /// Its serial number, which must be that of its sensor file.
    pub serial: String,
    /// Its facts.
    pub sensor: Sensor,
    /// Its mounting in the hand.
    pub mounting: Mounting,
}

/// An axis of the hand in the plane of the gels, with its sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
enum Axis {
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
}

impl Axis {
    /// X and Y of the hand.
    fn unit(self) -> [i32; 2] {
        match self {
            Axis::PlusX => [1, 0],
            Axis::MinusX => [-1, 0],
            Axis::PlusY => [0, 1],
            Axis::MinusY => [0, -1],
        }
    }
}

/// As it is written in the file.
impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Axis::PlusX => "+x",
            Axis::MinusX => "-x",
            Axis::PlusY => "+y",
            Axis::MinusY => "-y",
        })
    }
}

/// Along which axes of the hand x and y of a finger's image point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Axes {
    x: Axis,
    y: Axis,
}

/// As it is written in the file.
impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{{ x = \"{}\", y = \"{}\" }}", self.x, self.y)
    }
}

/// What is wrong with the axes.
enum Wrong {
    NotSquare,
    Mirrored,
}

impl Axes {
    /// The same as a side and an angle.
    fn on(self, side: Side) -> Result<Mounting, Wrong> {
        // In the finger frame, whose y is -Y on the left and Y on the right.
        let sense = if side == Side::Left { -1 } else { 1 };
        let [x, y] = [self.x, self.y].map(|axis| [axis.unit()[0], sense * axis.unit()[1]]);
        match x[0] * y[1] - x[1] * y[0] {
            1 => Ok(Mounting { side, turn_rad: -f64::from(x[1]).atan2(f64::from(x[0])) }),
            -1 => Err(Wrong::Mirrored),
            _ => Err(Wrong::NotSquare),
        }
    }
}

/// Longest name of a finger, characters.
const LONGEST_NAME_COUNT: usize = 64;

/// Checks the name of a finger: it is used unchanged for files, folders and topics, on every system. The error states
/// what was expected and got.
pub fn finger_name(name: &str) -> Result<String, SettingError> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if (1..=LONGEST_NAME_COUNT).contains(&name.len()) && name.chars().all(is_plain) {
        return Ok(name.to_owned());
    }
    let expected = format!("1 to {LONGEST_NAME_COUNT} of A-Z a-z 0-9 _ -");
    Err(SettingError { key: "name".into(), expected, got: format!("`{name}`") })
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
    mounting: Option<Axes>,
}

/// Reads a hand file and the sensor files it names. The error names file, key, expected and got.
pub fn load(path: &Path) -> Result<HandConfig, Error> {
    let layer = Layer::read(path)?;
    let file: HandFile = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    let refuse = |key: String, expected: &str, got: String| {
        let source = SettingError { key, expected: expected.into(), got };
        Err(Error::OutOfRange { file: layer.file.clone(), source })
    };
    if !(1..=FINGERS_MOST).contains(&file.fingers.len()) {
        return refuse("fingers".into(), &format!("1 to {FINGERS_MOST} fingers"), file.fingers.len().to_string());
    }
    let mut fingers: Vec<FingerConfig> = Vec::new();
    for (i, f) in file.fingers.into_iter().enumerate() {
        let key = |name: &str| format!("fingers[{i}].{name}");
        if let Err(SettingError { expected, got, .. }) = finger_name(&f.name) {
            return refuse(key("name"), &expected, got);
        }
        // Some systems do not distinguish `Left` from `left`.
        if fingers.iter().any(|other| other.name.eq_ignore_ascii_case(&f.name)) {
            return refuse(key("name"), "a name of its own", format!("`{}`", f.name));
        }
        if f.serial.trim().is_empty() || fingers.iter().any(|other| other.serial == f.serial) {
            return refuse(key("serial"), "a serial number of its own", format!("`{}`", f.serial));
        }
        let mounting = match f.mounting.map(|axes| (axes, axes.on(f.side))) {
            None => Mounting::on(f.side),
            Some((_, Ok(mounting))) => mounting,
            Some((axes, Err(wrong))) => {
                let expected = match wrong {
                    Wrong::NotSquare => "x and y along different axes of the hand",
                    Wrong::Mirrored => "an image that is not mirrored (z, from x to y, into the gel)",
                };
                return refuse(key("mounting"), expected, format!("`{axes}`"));
            }
        };
        let beside = path.parent().unwrap_or(Path::new("")).join(&f.sensor).display().to_string();
        let sensor = sensors::load(if sensors::is_file(&f.sensor) { &beside } else { &f.sensor });
        let sensor = sensor.map_err(|e| {
            let (file, key) = (layer.file.clone(), key("sensor"));
            Error::FingerSensor { file, key, source: Box::new(e) }
        })?;
        match &sensor.serial {
            Some(serial) if *serial != f.serial => {
                return refuse(key("serial"), &format!("`{serial}` as in {}", f.sensor), format!("`{}`", f.serial));
            }
            _ => {}
        }
        fingers.push(FingerConfig { name: f.name, serial: f.serial, sensor, mounting });
    }
    let mountings: Vec<Mounting> = fingers.iter().map(|finger| finger.mounting).collect();
    check_sides(&mountings).map_err(|source| Error::OutOfRange { file: layer.file.clone(), source })?;
    Ok(HandConfig { name: file.name, fingers })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    const HAND: &str = "name = \"two\"\n\
        [[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"a.toml\"\nmounting = { x = \"+x\", y = \"-y\" }\n\
        [[fingers]]\nname = \"right\"\nserial = \"B\"\nside = \"right\"\nsensor = \"gelslim\"\nmounting = { x = \"+y\", y = \"-x\" }\n";

    fn read(text: &str) -> Result<HandConfig, Error> {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("a.toml"), "extends = \"gelslim\"\nserial = \"A\"\n").expect("writes");
        let path = folder.path().join("hand.toml");
        std::fs::write(&path, text).expect("writes");
        load(&path)
    }

    /// An image whose x points along Y and whose y points to the wrist is rotated by a quarter turn: a motion along the
    /// fingers' X is then a motion along -y of the image, and the core converts it so.
    #[test]
    fn axes_are_the_same_as_a_side_and_an_angle() {
        let hand = read(HAND).expect("valid");
        let [left, right] = &hand.fingers[..] else { panic!("two fingers") };
        assert_eq!((left.mounting, left.sensor.serial.as_deref()), (Mounting::on(Side::Left), Some("A")));
        assert_eq!(right.mounting, Mounting { side: Side::Right, turn_rad: -FRAC_PI_2 });
        let turned = read(&HAND.replacen("\"+x\", y = \"-y\"", "\"-x\", y = \"+y\"", 1)).expect("valid");
        assert!((turned.fingers[0].mounting.turn_rad.abs() - 2.0 * FRAC_PI_2).abs() < 1e-12);
        let plain = read(&HAND.replace("mounting = { x = \"+y\", y = \"-x\" }", "")).expect("valid");
        assert_eq!(plain.fingers[1].mounting, Mounting::on(Side::Right));
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (from, to, parts) in [
            ("serial = \"A\"", "serial = \"C\"", ["hand.toml: fingers[0].serial", "`A` as in a.toml", "`C`"]),
            ("serial = \"B\"", "serial = \"A\"", ["fingers[1].serial", "a serial number of its own", "`A`"]),
            ("name = \"right\"", "name = \"left\"", ["fingers[1].name", "a name of its own", "`left`"]),
            ("y = \"-x\"", "y = \"-y\"", ["fingers[1].mounting", "different axes", "got `{ x = \"+y\", y = \"-y\" }`"]),
            ("y = \"-y\"", "y = \"+y\"", ["fingers[0].mounting", "not mirrored", "got `{ x = \"+x\", y = \"+y\" }`"]),
            ("y = \"-x\"", "y = \"up\"", ["hand.toml: fingers[1].mounting.y", "`+x`", "got `up`"]),
            ("name = \"right\"", "name = \"Left\"", ["fingers[1].name", "a name of its own", "`Left`"]),
            ("name = \"left\"", "name = \"../x\"", ["fingers[0].name", "1 to 64 of A-Z a-z 0-9 _ -", "`../x`"]),
            ("name = \"left\"", "name = \"\"", ["fingers[0].name", "1 to 64 of A-Z a-z 0-9 _ -", "``"]),
            (
                "side = \"right\"\nsensor = \"gelslim\"\nmounting = { x = \"+y\", y = \"-x\" }",
                "side = \"left\"\nsensor = \"gelslim\"",
                ["fingers[1].side", "fingers on both sides", "`left` for all 2"],
            ),
            ("side = \"right\"", "side = \"top\"", ["fingers[1].side: expected `left` or `right`, got `top`", "", ""]),
            ("side = \"right\"", "sides = \"right\"", ["hand.toml", "`fingers[1].sides`", "did you mean `side`?"]),
            ("\"a.toml\"", "\"b.toml\"", ["hand.toml: fingers[0].sensor: ", "b.toml: cannot read", ""]),
            ("\"gelslim\"", "\"gelslin\"", ["hand.toml: fingers[1].sensor", "`gelslin`", "did you mean `gelslim`?"]),
            ("\"a.toml\"", "\"fingers/a\"", ["fingers[0].sensor: /", "/fingers/a: cannot read", ""]),
        ] {
            let message = read(&HAND.replacen(from, to, 1)).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
        let none = read("name = \"none\"\nfingers = []\n").expect_err("refused").to_string();
        assert!(none.contains("hand.toml: fingers: expected 1 to 4 fingers, got 0"), "{none}");
    }
}
