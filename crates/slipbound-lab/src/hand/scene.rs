//! Tasks of the hand by name, with parameters, as a line of text.

use crate::contact::shape::Shape;
use crate::contact::{FingerSettings, Friction, Grid};
use crate::faults::Faults;
use crate::objects::{Form, Object, ObjectSurface};
use crate::plants::{Bottle, BottleSettings, Cap, HeldObject, Thread, Tool, ToolSettings};
use crate::random::Random;
use crate::render::{CameraSettings, SURROUNDINGS};
use crate::scenes::{Key, Kind, Value, number};
use crate::world::{FRAME_RATE_HZ, SUBSTEPS_COUNT};
use slipbound::setting::SettingError;
use slipbound::task::TaskKind;
use std::f64::consts::FRAC_PI_2;
use std::fmt;

/// Largest integer up to which JSON readers are exact.
const LARGEST_SEED: u64 = 1 << 53;

/// Thickness of flat objects, in mm, of which only the face is described. Assumed; it only determines where the jaws
/// touch.
const FLAT_THICKNESS_MM: f64 = 12.0;

/// Opening torque of a cap as a share of the torque with which it was closed at 60 N. Tables of closures list 0.4 to
/// 0.6.
const BREAK_FRACTION: f64 = 0.5;

/// The force at which a cap was closed, in N.
const CLOSED_AT_N: f64 = 60.0;

/// A parameter of a task.
#[derive(Debug, Clone, Copy)]
pub struct HandKey {
    /// Name, meaning, range, default.
    pub key: Key,
    /// A word that is allowed instead of a number.
    pub or_word: Option<&'static str>,
    /// The tasks that use it; an empty list means all.
    pub tasks: &'static [TaskKind],
}

const fn of(tasks: &'static [TaskKind], key: Key) -> HandKey {
    HandKey { key, or_word: None, tasks }
}

const fn key(name: &'static str, kind: Kind, default: &'static str, what: &'static str) -> HandKey {
    HandKey { key: Key { name, what, kind, default }, or_word: None, tasks: &[] }
}

/// The word for a number that is drawn from the seed.
const SEED: &str = "seed";

const fn drawn(key: Key) -> HandKey {
    HandKey { key, or_word: Some(SEED), tasks: LIFT }
}

/// The word for a property of the right pad that equals that of the left one.
const SAME: &str = "same";

const fn same(key: Key) -> HandKey {
    HandKey { key, or_word: Some(SAME), tasks: &[] }
}

/// How the right pad differs from the left one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RightPad {
    /// Friction coefficient.
    pub mu: f64,
    /// Modulus of its gel over that of the left one.
    pub stiffness_fraction: f64,
    /// Its rotation about the closing direction, in rad, in its own frame, positive from x to y.
    pub turn_rad: f64,
}

impl RightPad {
    /// The settings of the right finger, from those of the left one.
    pub fn of(&self, mut settings: FingerSettings) -> FingerSettings {
        settings.friction = Friction::constant(self.mu);
        settings.gel.modulus_mpa *= self.stiffness_fraction;
        settings.gel.membrane_n_per_mm *= self.stiffness_fraction;
        settings
    }
}

const PLACE: &[TaskKind] = &[TaskKind::Place];
const LIFT: &[TaskKind] = &[TaskKind::Lift];
const CAPS: &[TaskKind] = &[TaskKind::Screw, TaskKind::Unscrew];

/// The tasks, their descriptions, and their default objects.
pub const HAND_TASKS: [(TaskKind, &str, &str); 4] = [
    (TaskKind::Screw, "a cap turned until it stands on its end stop", "bottle_cap"),
    (TaskKind::Unscrew, "a cap broken loose and turned open", "bottle_cap"),
    (TaskKind::Place, "a tilted tool put down on the ground", "screwdriver"),
    (TaskKind::Lift, "a bottle lifted, filled in the air and pulled at", "water_bottle"),
];

/// All parameters except `seed`.
pub const HAND_KEYS: &[HandKey] = &[
    key("object", Kind::Object, "", "what is held"),
    key("mu", Kind::OfObject(0.05, 2.0), "object", "friction coefficient"),
    key("fingers", Kind::Count(1, 2), "2", "fingers with a camera; there are always two"),
    key("grid", Kind::Word(&["standard", "fast"]), "fast", "cells of the gel: 96x72 or 64x48"),
    key("camera", Kind::Word(&["gelslim", "gelsight_mini"]), "gelslim", "camera model"),
    key("height_px", Kind::Count(240, 960), "480", "rows of an image, its width 4/3 of them"),
    key("surroundings", Kind::Word(&SURROUNDINGS), "camera", "around the gels; camera: as the camera has them"),
    key("jpeg_quality", Kind::Count(30, 100), "85", "of the frames"),
    key("fault", Kind::Faults, "none", "faults of the cameras, as drop=0.02,torn=0.01"),
    same(number("mu_right", 0.05, 2.0, SAME, "friction coefficient of the right pad; same: mu")),
    same(number("stiffness_right_fraction", 0.1, 10.0, SAME, "modulus of the right gel over that of the left one")),
    same(number("turn_right_deg", -15.0, 15.0, SAME, "how the right pad is turned about the closing direction")),
    of(&[], number("start_mm", 0.0, 40.0, "4", "opening at the start, beyond the object")),
    of(&[], number("longest_s", 0.1, 3600.0, "60", "after which the cameras end")),
    of(CAPS, number("thread_mm_per_turn", 0.0, 10.0, "3", "how far the cap comes down in a turn")),
    of(CAPS, number("run_n_mm", 0.0, 1e6, "40", "torque while the cap runs")),
    of(&[TaskKind::Screw], number("seal_deg", 0.0, 1440.0, "60", "where the seal begins")),
    of(&[TaskKind::Screw], number("stop_deg", 0.0, 1440.0, "75", "where the end stop begins")),
    HandKey {
        key: number("break_n_mm", 0.0, 1e6, "closed", "torque that breaks the cap loose; half of closing at 60 N"),
        or_word: Some("closed"),
        tasks: &[TaskKind::Unscrew],
    },
    of(PLACE, number("tilt_deg", -45.0, 45.0, "20", "how the tool is tilted, positive from X to Y")),
    of(PLACE, number("off_mm", -40.0, 40.0, "5", "where its centre of mass is from the grip")),
    of(PLACE, number("height_mm", 0.1, 50.0, "4", "gap under its lower foot")),
    of(LIFT, number("start_kg", 0.01, 5.0, "0.05", "mass on the table")),
    of(LIFT, number("most_kg", 0.01, 5.0, "1.5", "mass when it is full")),
    drawn(number("fill_kg_per_s", 0.0, 2.0, SEED, "by which it is filled; the seed draws 0.1 to 0.5")),
    drawn(number("fill_after_s", 0.0, 60.0, SEED, "from leaving the table to filling; the seed draws 0.3 to 1.5")),
    drawn(Key {
        name: "pulls",
        what: "how often it is pulled at; the seed draws 2 or 3",
        kind: Kind::Count(0, 20),
        default: SEED,
    }),
    drawn(number(
        "pull_n",
        0.0,
        100.0,
        SEED,
        "largest force of a pull; the seed draws 2 to 10, at most half the weight",
    )),
];

impl HandKey {
    fn is_of(&self, task: TaskKind) -> bool {
        self.tasks.is_empty() || self.tasks.contains(&task)
    }

    fn read(&self, text: &str) -> Result<Value, SettingError> {
        match self.or_word {
            Some(word) if word == text => Ok(Value::Word(text.into())),
            Some(word) => self
                .key
                .read(text)
                .map_err(|error| SettingError { expected: format!("{}, or `{word}`", error.expected), ..error }),
            None => self.key.read(text),
        }
    }
}

/// A task, a seed and a value for every key of the task: everything that determines a run.
#[derive(Debug, Clone, PartialEq)]
pub struct HandScene {
    task: TaskKind,
    seed: u64,
    /// In the order of [`HAND_KEYS`].
    values: Vec<(&'static str, Value)>,
}

impl HandScene {
    /// `TASK` or `TASK?key=value&key=value`; `seed` is a key too. Fails for unknown names, values out of range, and
    /// contradictory values.
    pub fn parse(text: &str) -> Result<HandScene, SettingError> {
        let (task, settings) = text.split_once('?').unwrap_or((text, ""));
        let task: TaskKind = task.parse()?;
        let object = HAND_TASKS.iter().find(|(known, _, _)| *known == task).map_or("", |(_, _, object)| object);
        let keys = HAND_KEYS.iter().filter(|key| key.is_of(task));
        let values = keys.map(|key| {
            let default = if key.key.name == "object" { object } else { key.key.default };
            key.read(default).map(|value| (key.key.name, value))
        });
        let mut scene = HandScene { task, seed: 0, values: values.collect::<Result<_, _>>()? };
        for setting in settings.split('&').filter(|setting| !setting.is_empty()) {
            scene.set(setting)?;
        }
        scene.contact()?;
        scene.held()?;
        Ok(scene)
    }

    fn set(&mut self, setting: &str) -> Result<(), SettingError> {
        let refuse =
            |key: &str, got: &str, expected: String| SettingError { key: key.into(), got: got.into(), expected };
        let Some((name, text)) = setting.split_once('=') else {
            return Err(refuse(setting, "no value", "key=value".into()));
        };
        if name == "seed" {
            self.seed = text
                .parse()
                .ok()
                .filter(|seed| *seed <= LARGEST_SEED)
                .ok_or_else(|| refuse(name, text, format!("a whole number from 0 to {LARGEST_SEED}")))?;
            return Ok(());
        }
        let taken = |key: &&HandKey| key.is_of(self.task);
        let Some(key) = HAND_KEYS.iter().filter(taken).find(|key| key.key.name == name) else {
            let own = HAND_KEYS.iter().filter(taken).map(|key| key.key.name);
            let names: Vec<&str> = std::iter::once("seed").chain(own).collect();
            return Err(SettingError::none_of(&format!("parameter of the task {}", self.task), name, &names));
        };
        let value = key.read(text)?;
        self.values.iter_mut().filter(|(known, _)| *known == name).for_each(|slot| slot.1 = value.clone());
        Ok(())
    }

    /// The task.
    pub fn task(&self) -> TaskKind {
        self.task
    }

    /// Seed of all random values.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The same with another seed, one that [`HandScene::parse`] takes.
    pub(crate) fn with_seed(&self, seed: u64) -> Self {
        HandScene { seed, ..self.clone() }
    }

    /// The friction coefficient: the value set, or the object's. That of the left pad if the pads differ.
    pub fn mu(&self) -> f64 {
        self.number("mu").unwrap_or_else(|| self.object().mu)
    }

    /// The right pad; None if it equals the left one.
    pub(super) fn right_pad(&self) -> Option<RightPad> {
        let keys = ["mu_right", "stiffness_right_fraction", "turn_right_deg"];
        let [mu, stiffness_fraction, turn_deg] = keys.map(|key| self.number(key));
        mu.or(stiffness_fraction).or(turn_deg)?;
        Some(RightPad {
            mu: mu.unwrap_or_else(|| self.mu()),
            stiffness_fraction: stiffness_fraction.unwrap_or(1.0),
            turn_rad: turn_deg.unwrap_or(0.0).to_radians(),
        })
    }

    /// Mean friction coefficient of both pads.
    pub fn mean_mu(&self) -> f64 {
        self.right_pad().map_or(self.mu(), |right| 0.5 * (self.mu() + right.mu))
    }

    /// How many of the two fingers have a camera: 1 is the left one only.
    pub fn fingers_count(&self) -> usize {
        self.number("fingers").map_or(2, |count| count as usize)
    }

    /// The faults of the cameras; None without faults.
    pub fn faults(&self) -> Option<Faults> {
        match self.value("fault") {
            Some(Value::Word(text)) if text != "none" => Faults::parse(text).ok(),
            _ => None,
        }
    }

    /// The held object.
    pub fn object(&self) -> &'static Object {
        Object::named(self.word("object")).expect("the name was looked up when it was set")
    }

    /// Time at which the cameras end, in s.
    pub fn longest_s(&self) -> f64 {
        self.number("longest_s").unwrap_or(60.0)
    }

    /// All keys and values except the seed.
    pub fn values(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.values.iter().map(|(key, value)| (*key, value))
    }

    fn value(&self, key: &str) -> Option<&Value> {
        self.values.iter().find(|(known, _)| *known == key).map(|(_, value)| value)
    }

    /// The number of a key; None if it is a word or the task does not use the key.
    pub(crate) fn number(&self, key: &str) -> Option<f64> {
        match self.value(key) {
            Some(Value::Number(number)) => Some(*number),
            _ => None,
        }
    }

    pub(super) fn word(&self, key: &str) -> &str {
        match self.value(key) {
            Some(Value::Word(word)) => word,
            _ => "",
        }
    }

    /// A number whose default is a number, of a key that the task uses.
    fn set_number(&self, key: &str) -> Result<f64, SettingError> {
        self.number(key).ok_or_else(|| SettingError {
            key: key.into(),
            got: format!("{:?}", self.value(key)),
            expected: format!("a number, for the task {}", self.task),
        })
    }

    /// Distance of the two faces between the pads, in mm.
    pub fn width_mm(&self) -> f64 {
        match self.object().form {
            Form::Ball { radius_mm } | Form::Cylinder { radius_mm, .. } => 2.0 * radius_mm,
            Form::Flat { .. } => FLAT_THICKNESS_MM,
        }
    }

    /// The cameras, at the image size of the model.
    pub(super) fn camera(&self) -> CameraSettings {
        CameraSettings::of_words(self.word("camera"), self.word("surroundings"))
    }

    /// The contact of one finger.
    pub(super) fn contact(&self) -> Result<(FingerSettings, ObjectSurface), SettingError> {
        let object = self.object();
        let grid = if self.word("grid") == "fast" { Grid::fast() } else { Grid::standard() };
        let mut settings = FingerSettings {
            grid,
            edge: self.camera().gel_edge(&grid),
            soft_object: object.softness,
            friction: Friction::constant(self.mu()),
            substep_s: 1.0 / (FRAME_RATE_HZ * SUBSTEPS_COUNT) as f64,
            ..FingerSettings::standard()
        };
        let mut surface = object.surface();
        if self.task == TaskKind::Place {
            // Long objects then lie along Y, where the pad is narrower.
            settings.shape_in_object.turn_rad = FRAC_PI_2;
            let room_mm = settings.grid.half_size_mm().y - settings.grid.cell_mm;
            surface.form = cut_to(surface.form, room_mm, self.set_number("tilt_deg")?.to_radians());
        }
        surface.check()?;
        Ok((settings, surface))
    }

    /// The held object at rest.
    pub(super) fn held(&self) -> Result<Box<dyn HeldObject>, SettingError> {
        Ok(match self.task {
            TaskKind::Place => Box::new(Tool::new(self.tool()?)),
            TaskKind::Lift => Box::new(Bottle::new(self.bottle()?)),
            TaskKind::Screw | TaskKind::Unscrew => Box::new(self.cap()?),
        })
    }

    fn tool(&self) -> Result<ToolSettings, SettingError> {
        let object = self.object();
        let underside_mm = match object.form {
            Form::Ball { radius_mm } | Form::Cylinder { radius_mm, .. } => radius_mm,
            Form::Flat { width_mm, .. } => 0.5 * width_mm,
        };
        Ok(ToolSettings {
            mass_kg: object.mass_kg,
            gyration_radius_mm: object.gyration_radius_mm,
            // For a rod with that radius of gyration.
            half_length_mm: (3f64.sqrt() * object.gyration_radius_mm).max(25.0),
            underside_mm,
            off_mm: self.set_number("off_mm")?,
            tilt_rad: self.set_number("tilt_deg")?.to_radians(),
            height_mm: self.set_number("height_mm")?,
        })
    }

    fn bottle(&self) -> Result<BottleSettings, SettingError> {
        let object = self.object();
        let mut random = Random::of(self.seed, 0xB0771E);
        let mut or_drawn = |key: &str, low: f64, high: f64| {
            let drawn = random.between(low, high); // always, so that setting one key does not change the others
            self.number(key).unwrap_or(drawn)
        };
        let fill_kg_per_s = or_drawn("fill_kg_per_s", 0.1, 0.5);
        let fill_after_s = or_drawn("fill_after_s", 0.3, 1.5);
        let pulls_count = or_drawn("pulls", 2.0, 4.0) as usize;
        let radius_mm = 0.5 * self.width_mm();
        let mut bottle = BottleSettings {
            start_kg: self.set_number("start_kg")?,
            most_kg: self.set_number("most_kg")?,
            fill_kg_per_s,
            fill_after_s,
            pulses: Vec::new(),
            gyration_radius_mm: object.gyration_radius_mm,
            radius_mm,
        };
        bottle.draw_pulses(pulls_count, self.number("pull_n"), &mut random);
        Ok(bottle)
    }

    fn cap(&self) -> Result<Cap, SettingError> {
        let Form::Cylinder { radius_mm, .. } = self.object().form else {
            return Err(SettingError {
                key: "object".into(),
                got: self.object().name.into(),
                expected: format!("something round, for the task {}", self.task),
            });
        };
        let run_n_mm = self.set_number("run_n_mm")?;
        let thread = if self.task == TaskKind::Screw {
            let (seal_rad, stop_rad) =
                (self.set_number("seal_deg")?.to_radians(), self.set_number("stop_deg")?.to_radians());
            Thread::Screw { run_n_mm, seal_rad, stop_rad }
        } else {
            let closed_n_mm = 2.0 * self.mean_mu() * CLOSED_AT_N * radius_mm;
            Thread::Unscrew { run_n_mm, break_n_mm: self.number("break_n_mm").unwrap_or(BREAK_FRACTION * closed_n_mm) }
        };
        Ok(Cap::new(radius_mm, self.mean_mu(), thread, self.set_number("thread_mm_per_turn")?))
    }
}

/// A form that lies along Y of the pad, shortened to fit between its borders for every angle from flat to a tilt.
fn cut_to(form: Form, room_mm: f64, tilt_rad: f64) -> Form {
    let (s, c) = (libm::sin(tilt_rad).abs(), libm::cos(tilt_rad));
    match form {
        Form::Ball { .. } => form,
        Form::Cylinder { radius_mm, length_mm, edge_radius_mm } => {
            Form::Cylinder { radius_mm, length_mm: length_mm.min(2.0 * room_mm), edge_radius_mm }
        }
        Form::Flat { length_mm, width_mm, edge_radius_mm } => {
            let tilted_mm = (2.0 * room_mm - s * width_mm) / c;
            Form::Flat { length_mm: length_mm.min(2.0 * room_mm).min(tilted_mm), width_mm, edge_radius_mm }
        }
    }
}

/// In the format of [`HandScene::parse`], with all parameters; those of the right pad if it differs.
impl fmt::Display for HandScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}?seed={}", self.task, self.seed)?;
        let differs = |value: &Value| !matches!(value, Value::Word(word) if word == SAME);
        let values = self.values.iter().filter(|(_, value)| differs(value));
        values.into_iter().try_for_each(|(key, value)| write!(f, "&{key}={value}"))
    }
}
