//! Loads of fixed direction that grow until the object slides, with unknown friction.
//!
//! Stratified over object, force 10 to 60 N, friction 0.3 to 1.2 (evenly in its logarithm), direction, kind of load and
//! speed. Rivals restart at the last frame before the load; ours runs from the first touch without such information.

use super::coverage;
use super::digest::Digest;
use super::error::EvalError;
use super::outcome::{ScoredTrial, record};
use super::protocol::Protocol;
use super::ramp_tables;
use super::record::TrialRecord;
use super::stated_error;
use super::table::Table;
use super::trial_seed::{camera_seed, stream};
use super::watch::{Onlooker, Restarts, Watch, Watched, show, watch};
use crate::objects::OBJECTS;
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::Trial;
use slipbound::monitor::EstimateTrees;
use std::collections::BTreeMap;

/// Objects of the paper: the library without the cap.
const OBJECTS_COUNT: u64 = 10;

/// Default number of trials.
const TRIALS_COUNT: u64 = 1200;

/// Grip forces, N, and friction coefficients.
pub(super) const FORCE_N: (f64, f64) = (10.0, 60.0);
pub(super) const MU: (f64, f64) = (0.3, 1.2);

/// The drawn parameters of a ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Draw {
    pub object: usize,
    pub force_n: f64,
    pub mu: f64,
    pub direction_deg: f64,
    /// Share of the turning, see the scene `ramp`.
    pub twist_fraction: f64,
    pub ramp_s: f64,
}

/// Steps of a low-discrepancy sequence in five dimensions: powers of the root of x^6 = x + 1 (Roberts 2018).
const STEPS: [f64; 5] = {
    const ROOT: f64 = 1.134_724_138_401_519_5;
    let first = 1.0 / ROOT;
    let second = first / ROOT;
    let third = second / ROOT;
    let fourth = third / ROOT;
    [first, second, third, fourth, fourth / ROOT]
};

/// The `number`th of a sequence that covers its ranges evenly for any length; the seed shifts it. Every object has its
/// own sequence.
pub(super) fn draw(seed: u64, number: u64) -> Draw {
    let (object, k) = (number % OBJECTS_COUNT, number / OBJECTS_COUNT);
    let mut shift = stream(seed, 1 << 32 | object);
    let [force, mu, direction, kind, speed] = STEPS.map(|step| (shift.fraction() + k as f64 * step).fract());
    // Two fifths pulls, three tenths turns, three tenths both.
    let twist_fraction = match kind {
        kind if kind < 0.4 => 0.0,
        kind if kind < 0.55 => 1.0,
        kind if kind < 0.7 => -1.0,
        kind if kind < 0.85 => 0.3 + 0.4 * (kind - 0.7) / 0.15,
        kind => -0.3 - 0.4 * (kind - 0.85) / 0.15,
    };
    Draw {
        object: object as usize,
        force_n: FORCE_N.0 + (FORCE_N.1 - FORCE_N.0) * force,
        mu: MU.0 * libm::pow(MU.1 / MU.0, mu),
        direction_deg: 360.0 * direction,
        twist_fraction,
        // Every second ramp takes 1 s and is used for the lead time; the others take 0.4 to 2 s.
        ramp_s: if k % 2 == 0 { 1.0 } else { 0.4 * libm::pow(5.0, speed) },
    }
}

impl Draw {
    /// The trial; position, angle and camera are drawn from the stream of its number.
    pub fn trial(&self, seed: u64, number: u64, also: &str) -> Result<Trial, slipbound::setting::SettingError> {
        let mut random = stream(seed, number);
        let (x_mm, y_mm) = (random.between(-0.5, 0.5), random.between(-0.5, 0.5));
        let turn_deg = random.between(-8.0, 8.0);
        Trial::parse(&format!(
            "ramp?object={}&force_n={:.3}&mu={:.4}&direction_deg={:.2}&twist_fraction={:.3}&ramp_s={:.3}\
             &at_x_mm={x_mm:.3}&at_y_mm={y_mm:.3}&turn_deg={turn_deg:.3}&grid=fast&seed={}{also}",
            OBJECTS[self.object].name,
            self.force_n,
            self.mu,
            self.direction_deg,
            self.twist_fraction,
            self.ramp_s,
            camera_seed(&mut random)
        ))
    }
}

/// The records of a ramp.
pub(super) fn records(number: u64, name: &str, trial: &Trial, mu: Option<f64>, watched: &Watched) -> Vec<TrialRecord> {
    let kind = match trial.number("twist_fraction").abs() {
        0.0 => "pull",
        1.0 => "turn",
        _ => "both",
    };
    let of = |(entry, seen): &(&'static Entry, Vec<_>)| {
        let scored_trial = ScoredTrial {
            number,
            trial: name.into(),
            object: trial.object().name.into(),
            slips: true,
            // Ours is not told when the load begins: its alarms while gripping count.
            from_frame: if entry.is_ours() { 0 } else { watched.load_from_frame },
            mu,
        };
        record(&scored_trial, entry, watched, seen)
            .with("force_n", trial.number("force_n"))
            .with("mu", trial.mu())
            .with("ramp_s", trial.number("ramp_s"))
            .with("load", kind)
    };
    watched.seen.iter().map(of).collect()
}

/// Setting of a sweep whose ramps all take this long, s.
pub const RAMP_S: &str = "ramp_s";
/// Setting of a sweep whose cameras give so many frames per second.
pub const RATE_HZ: &str = "rate_hz";

/// How the ramps of a sweep differ from the drawn ones.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RampChanges {
    /// Duration of all ramps, s; None: as drawn.
    pub ramp_s: Option<f64>,
    /// Frames per second; None: 30.
    pub rate_hz: Option<u64>,
}

/// The protocol.
#[derive(Debug)]
pub struct Ramps {
    seed: u64,
    trials_count: u64,
    changes: RampChanges,
    /// Trees by object, fitted without it.
    left_out: Option<BTreeMap<&'static str, EstimateTrees>>,
    /// Digest of their tables.
    tables: String,
}

impl Ramps {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "ramps";

    /// The ramps of a seed.
    pub fn new(seed: u64, trials: Option<u64>) -> Self {
        let trials_count = trials.unwrap_or(TRIALS_COUNT);
        Ramps { seed, trials_count, changes: RampChanges::default(), left_out: None, tables: String::new() }
    }

    /// The same ramps, changed: whether a verdict depends on the rate of the load or of the frames.
    pub fn changed(self, changes: RampChanges) -> Self {
        Ramps { changes, ..self }
    }

    /// Each object is judged by trees that were fitted without it; `table` gives for an object's name the text of the
    /// table and its trees.
    ///
    /// # Errors
    /// Those of `table`.
    pub fn left_out<E>(
        self,
        mut table: impl FnMut(&'static str) -> Result<(String, EstimateTrees), E>,
    ) -> Result<Self, E> {
        let (mut left_out, mut digest) = (BTreeMap::new(), Digest::new());
        for object in &OBJECTS[..OBJECTS_COUNT as usize] {
            let (text, trees) = table(object.name)?;
            [object.name, &text].iter().for_each(|part| digest.add(part));
            left_out.insert(object.name, trees);
        }
        Ok(Ramps { left_out: Some(left_out), tables: digest.word(), ..self })
    }

    fn watch(&self, trial: Trial) -> Watch {
        let estimate_by = self.left_out.as_ref().and_then(|trees| trees.get(trial.object().name)).cloned();
        Watch { estimate_by, ..Watch::new(trial, Restarts::Rivals) }
    }

    pub(super) fn trial(&self, number: u64) -> Result<Trial, EvalError> {
        let drawn = draw(self.seed, number);
        let drawn = Draw { ramp_s: self.changes.ramp_s.unwrap_or(drawn.ramp_s), ..drawn };
        let rate = self.changes.rate_hz.map(|rate_hz| format!("&rate_hz={rate_hz}"));
        Ok(drawn.trial(self.seed, number, &rate.unwrap_or_default())?)
    }
}

impl Protocol for Ramps {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.trials_count
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let trial = self.trial(number)?;
        let watched = watch(&self.watch(trial.clone()), detectors, None)?;
        Ok(records(number, &trial.to_string(), &trial, Some(trial.mu()), &watched))
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let mut tables = ramp_tables::tables(records, "");
        let mu =
            |low: f64, high: f64| move |r: &TrialRecord| r.number_of("mu").is_some_and(|mu| (low..high).contains(&mu));
        let force = |low: f64, high: f64| {
            move |r: &TrialRecord| r.number_of("force_n").is_some_and(|n| (low..high).contains(&n))
        };
        tables.push(ramp_tables::split(
            "By friction",
            records,
            &[
                ("mu 0.3 to 0.42", &mu(0.3, 0.42)),
                ("mu 0.42 to 0.6", &mu(0.42, 0.6)),
                ("mu 0.6 to 0.85", &mu(0.6, 0.85)),
                ("mu 0.85 to 1.2", &mu(0.85, 1.21)),
            ],
        ));
        tables.push(ramp_tables::split(
            "By force",
            records,
            &[
                ("10 to 20 N", &force(10.0, 20.0)),
                ("20 to 30 N", &force(20.0, 30.0)),
                ("30 to 45 N", &force(30.0, 45.0)),
                ("45 to 60 N", &force(45.0, 60.1)),
            ],
        ));
        let load = |word: &'static str| move |r: &TrialRecord| r.word_of("load") == Some(word);
        tables.push(ramp_tables::split(
            "By load",
            records,
            &[("pull", &load("pull")), ("turn", &load("turn")), ("both", &load("both"))],
        ));
        let of = |name: &'static str| move |r: &TrialRecord| r.object == name;
        let objects: Vec<_> = OBJECTS[..OBJECTS_COUNT as usize].iter().map(|o| (o.name, of(o.name))).collect();
        let parts: Vec<ramp_tables::Part<'_>> =
            objects.iter().map(|(name, of)| (*name, of as &dyn Fn(&TrialRecord) -> bool)).collect();
        tables.push(ramp_tables::split("By object", records, &parts));
        let ours = || DETECTORS.iter().filter(|entry| entry.is_ours()).map(|entry| entry.name);
        tables.extend(stated_error::table(records, ours()));
        tables.extend(coverage::table(records, ours()));
        tables
    }

    fn settings(&self) -> Vec<(String, String)> {
        let mut settings = vec![Restarts::Rivals.setting()];
        settings.extend(self.changes.ramp_s.map(|ramp_s| (RAMP_S.into(), ramp_s.to_string())));
        settings.extend(self.changes.rate_hz.map(|rate_hz| (RATE_HZ.into(), rate_hz.to_string())));
        if self.left_out.is_some() {
            settings.push(("estimates".into(), "each object by trees fitted without it".into()));
            settings.push(("trees".into(), self.tables.clone()));
        }
        settings
    }

    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        show(&self.watch(self.trial(number)?), detector, onlooker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_object_of_the_ramps_has_its_own_trees() {
        let table = include_str!("../../../slipbound/src/monitor/estimate/trees.txt");
        let mut names = Vec::new();
        let parsed = |name| EstimateTrees::parse(table).map(|trees| (format!("# {name}\n{table}"), trees)).ok_or(name);
        let trees = |name| {
            names.push(name);
            parsed(name)
        };
        let ramps = Ramps::new(0, None).left_out(trees).expect("whole tables");
        assert_eq!(names.len(), 10);
        for number in 0..10 {
            let trial = ramps.trial(number).expect("a trial");
            assert!(names.contains(&trial.object().name) && ramps.watch(trial).estimate_by.is_some());
        }
        let refused = |name| if name == "toy_duck" { Err(name) } else { parsed(name) };
        assert_eq!(Ramps::new(0, None).left_out(refused).err(), Some("toy_duck"));
        // The tables are a setting of the sweep, by their text.
        let changed =
            |name| parsed(name).map(|(text, trees)| (text + if name == "toy_duck" { "#" } else { "" }, trees));
        let others = Ramps::new(0, None).left_out(changed).expect("whole tables");
        let again = Ramps::new(0, None).left_out(parsed).expect("whole tables");
        assert_eq!(again.settings(), ramps.settings());
        assert_ne!(others.settings(), ramps.settings());
    }

    /// Nothing else changes with the duration or the frame rate, so that sweeps can be compared ramp by ramp.
    #[test]
    fn changed_ramps_differ_from_the_drawn_ones_in_nothing_else() {
        let drawn = Ramps::new(5, None);
        let slow = RampChanges { ramp_s: Some(8.0), ..RampChanges::default() };
        let fast = RampChanges { rate_hz: Some(90), ..RampChanges::default() };
        for (changes, key, value) in [(slow, "ramp_s", 8.0), (fast, "rate_hz", 90.0)] {
            let changed = Ramps::new(5, None).changed(changes);
            for number in 0..20 {
                let [drawn, changed] = [&drawn, &changed].map(|ramps| ramps.trial(number).expect("a trial"));
                assert_eq!(changed.number(key), value);
                let without = |trial: &Trial| {
                    let text = trial.to_string();
                    text.split('&').filter(|part| !part.starts_with(key)).collect::<Vec<_>>().join("&")
                };
                assert_eq!(without(&drawn), without(&changed));
            }
            assert_ne!(drawn.settings(), changed.settings(), "another sweep");
        }
    }

    #[test]
    fn ramps_cover_forces_frictions_and_kinds_evenly() {
        let draws: Vec<Draw> = (0..1200).map(|number| draw(0, number)).collect();
        let count = |of: &dyn Fn(&Draw) -> bool| draws.iter().filter(|draw| of(draw)).count();
        for quarter in 0..4 {
            let within = |share: f64| (share * 4.0) as usize == quarter;
            let mu = count(&|draw| within(libm::log(draw.mu / 0.3) / libm::log(4.0)));
            let force = count(&|draw| within((draw.force_n - 10.0) / 50.0));
            assert!((285..=315).contains(&mu) && (285..=315).contains(&force), "{quarter}: {mu}, {force}");
        }
        assert!((460..=500).contains(&count(&|draw| draw.twist_fraction == 0.0)));
        assert!((100..=260).contains(&count(&|draw| draw.twist_fraction == -1.0)));
        assert_eq!(count(&|draw| draw.ramp_s == 1.0), 600);
        assert!((0..10).all(|object| count(&|draw| draw.object == object) == 120));
        assert_ne!(draw(0, 7), draw(1, 7), "the seed counts");
    }

    #[test]
    fn the_ranges_are_those_of_the_scene() {
        for number in 0..200 {
            let trial = draw(3, number).trial(3, number, "").expect("a sound trial");
            assert!((10.0..=60.0).contains(&trial.number("force_n")) && (0.3..=1.2).contains(&trial.mu()));
        }
    }
}
