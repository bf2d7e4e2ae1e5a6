//! Hours in which nothing slides: grip steps, presses to 60 N, rolling, drift and vibration, with pauses in between.
//!
//! ```text
//!   an episode of a minute:   rest, press | still | event | still | event | ...
//!                                            `-- the contact stands, every frame has fresh camera noise
//! ```
//!
//! An episode is a trial, so an interrupted sweep can be continued; 120 of them are two hours.

use super::error::EvalError;
use super::outcome::GROSS_FROM_FRACTION;
use super::protocol::Protocol;
use super::ramp_tables::share_of_keys;
use super::record::TrialRecord;
use super::statistics::{Estimated, rate_per_h, share, share_of_frames};
use super::table::{Cell, Table};
use super::trial_seed::{camera_seed, stream};
use super::watch::{Onlooker, Restarts, Seen, Watch, Watched, show, watch};
use crate::contact::{Drive, Leg, Path};
use crate::objects::OBJECTS;
use crate::random::Random;
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::{LoadProfile, Pull, Trial};
use crate::world::FRAME_RATE_HZ;
use slipbound::monitor::SlipState;
use slipbound::plane::Vec2;
use std::collections::BTreeMap;

/// Default number of episodes: two hours.
const TRIALS_COUNT: u64 = 120;

/// Frames of an episode: a minute.
const FRAMES_COUNT: u64 = 60 * FRAME_RATE_HZ;

/// Rest frames at the start.
const REST_FRAMES: u64 = 12;

/// Grip, N.
const FORCE_N: (f64, f64) = (5.0, 60.0);

/// Stillness after an event, frames: 2 to 6 s.
const STILL_FRAMES: (f64, f64) = (60.0, 180.0);

/// Largest distance that an object has rolled from its start, mm.
const MOST_ROLL_MM: f64 = 5.0;

/// Largest load of a drift over the load that would make the object slide: estimated for the largest faces, so less on
/// small ones. The ground truth is in the record as `most_load_fraction`.
const DRIFT_FRACTION: f64 = 0.1;

/// Load over mu P below which an alarm is false, as in the other protocols.
const LEAST_LOAD_FRACTION: f64 = 0.2;

/// Shear stiffness of the gel times the largest face, N/mm.
const FACE_N_PER_MM: f64 = 40.0;

/// Kinds of events.
const EVENTS: [&str; 5] = ["grip step", "press to 60 N", "roll", "drift", "vibration"];

/// The script of an episode.
#[derive(Debug)]
pub(crate) struct Script {
    legs: Vec<Leg>,
    /// World frames after which it stands still, and for how long.
    stills: Vec<(u64, u64)>,
    /// Number of the first frame of each event, counted with the pauses, and the event.
    events: Vec<(u64, &'static str)>,
}

fn frames_s(frames: u64) -> f64 {
    frames as f64 / FRAME_RATE_HZ as f64
}

fn script(trial: &Trial, random: &mut Random) -> Script {
    let press_frames = 9;
    let mut script = Script {
        legs: vec![Leg::press(trial.number("force_n"), frames_s(press_frames)), Leg::hold(frames_s(6))],
        stills: Vec::new(),
        events: vec![(0, "press")],
    };
    let (mut force_n, mut rolled_mm) = (trial.number("force_n"), Vec2::ZERO);
    // Frames of the world, and all frames including the pauses.
    let (mut world_frames, mut frames) = (REST_FRAMES + press_frames + 6, REST_FRAMES + press_frames + 6);
    loop {
        let still = random.between(STILL_FRAMES.0, STILL_FRAMES.1) as u64;
        let still = still.min(FRAMES_COUNT.saturating_sub(frames));
        script.stills.push((world_frames - 1, still));
        frames += still;
        if frames >= FRAMES_COUNT {
            return script;
        }
        let event = EVENTS[(random.next_u64() % EVENTS.len() as u64) as usize];
        script.events.push((frames, event));
        let direction = Vec2::new(1.0, 0.0).rotated(random.between(0.0, std::f64::consts::TAU));
        let mut took = 0;
        let mut leg = |frames: u64, of: &dyn Fn(f64) -> Leg| {
            script.legs.push(of(frames_s(frames)));
            took += frames;
        };
        match event {
            "grip step" | "press to 60 N" => {
                force_n = if event == "grip step" { random.between(FORCE_N.0, FORCE_N.1) } else { FORCE_N.1 };
                leg(random.between(3.0, 12.0) as u64, &|s| Leg::press(force_n, s));
            }
            "roll" => {
                let to_mm = direction * random.between(1.0, MOST_ROLL_MM);
                let by_mm = to_mm - rolled_mm;
                rolled_mm = to_mm;
                leg(random.between(15.0, 60.0) as u64, &|s| Leg::roll(by_mm.x, by_mm.y, s));
            }
            "drift" => {
                let by_mm = direction * (DRIFT_FRACTION * trial.mu() * force_n / FACE_N_PER_MM);
                let slow = random.between(60.0, 150.0) as u64;
                leg(slow, &|s| Leg::shear(by_mm.x, by_mm.y, s));
                leg(slow, &|s| Leg::shear(-by_mm.x, -by_mm.y, s));
            }
            _ => {
                let by_mm = direction * random.between(0.002, 0.01);
                for _ in 0..random.between(8.0, 16.0) as u32 {
                    leg(1, &|s| Leg::shear(by_mm.x, by_mm.y, s));
                    leg(2, &|s| Leg::shear(-2.0 * by_mm.x, -2.0 * by_mm.y, s));
                    leg(1, &|s| Leg::shear(by_mm.x, by_mm.y, s));
                }
            }
        }
        world_frames += took;
        frames += took;
    }
}

/// The protocol.
#[derive(Debug)]
pub struct Quiet {
    seed: u64,
    trials_count: u64,
}

impl Quiet {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "quiet";

    /// The episodes of a seed.
    pub fn new(seed: u64, trials: Option<u64>) -> Self {
        Quiet { seed, trials_count: trials.unwrap_or(TRIALS_COUNT) }
    }

    /// The script of an episode, and what to watch.
    pub(crate) fn watch_of(&self, number: u64) -> Result<(Script, Watch), EvalError> {
        let mut random = stream(self.seed, 4 << 32 | number);
        let object = &OBJECTS[(number % 10) as usize];
        let (force_n, mu) = (random.between(5.0, 30.0), object.mu * random.between(0.85, 1.15));
        let (x_mm, y_mm) = (random.between(-0.5, 0.5), random.between(-0.5, 0.5));
        let turn_deg = random.between(-8.0, 8.0);
        let trial = Trial::parse(&format!(
            "press?object={}&force_n={force_n:.3}&mu={mu:.4}&at_x_mm={x_mm:.3}&at_y_mm={y_mm:.3}&turn_deg={turn_deg:.3}\
             &rest_frames={REST_FRAMES}&grid=fast&seed={}",
            object.name,
            camera_seed(&mut random)
        ))?;
        let script = script(&trial, &mut random);
        let profile = LoadProfile {
            path: Path::new(script.legs.clone())?,
            pull: Pull::None,
            drive: Drive::Guided,
            fingers_count: 1,
            load_from_s: None,
            along: (Vec2::ZERO, 0.0),
        };
        let what =
            Watch { profile: Some(profile), stills: script.stills.clone(), ..Watch::new(trial, Restarts::Rivals) };
        Ok((script, what))
    }
}

/// The record of a detector on an episode.
fn record(number: u64, trial: &Trial, script: &Script, watched: &Watched, entry: &Entry, seen: &[Seen]) -> TrialRecord {
    // Ours is not told when the object is held; rivals start there.
    let from_frame = if entry.is_ours() { 0 } else { watched.load_from_frame };
    let counts = |n: usize| watched.truth[n].frame >= from_frame;
    let begins = |n: usize| seen[n].alarms && counts(n) && (n == 0 || !seen[n - 1].alarms || !counts(n - 1));
    let load = |n: usize| {
        let truth = &watched.truth[n];
        truth.wrench.force_n.length() / (trial.mu() * truth.grip_n).max(f64::MIN_POSITIVE)
    };
    // Releasing a grip while it holds some shear is a load like any other: an alarm above a fifth of the load that
    // slides is not a false alarm.
    let (alarms, under_load): (Vec<usize>, Vec<usize>) =
        (0..seen.len()).filter(|&n| begins(n)).partition(|&n| load(n) < LEAST_LOAD_FRACTION);
    let first = alarms.first().map(|&n| watched.truth[n].frame);
    let event_at = |frame: u64| script.events.iter().rev().find(|(from, _)| *from <= frame).map(|(_, event)| *event);
    let mut by_event: BTreeMap<&str, u64> = BTreeMap::new();
    for &n in &alarms {
        *by_event.entry(event_at(watched.truth[n].frame).unwrap_or("press")).or_default() += 1;
    }
    let is_gross = |n: usize| seen[n].state == SlipState::Gross && counts(n);
    let gross_begins = |n: usize| is_gross(n) && (n == 0 || !is_gross(n - 1));
    // As in the other protocols.
    let is_false = |n: usize| load(n) < GROSS_FROM_FRACTION && !watched.truth[n].slides;
    let false_gross = (0..seen.len()).filter(|&n| gross_begins(n) && is_false(n)).count();
    let held = (0..seen.len()).filter(|&n| watched.truth[n].frame >= watched.load_from_frame);
    let touching = || (0..seen.len()).filter(|&n| counts(n) && watched.truth[n].stick_ratio.is_some());
    TrialRecord {
        number,
        trial: format!("quiet: {trial}"),
        object: trial.object().name.into(),
        detector: entry.name.into(),
        truth: Some(false),
        verdict: first.is_some(),
        score: (0..seen.len()).filter(|&n| counts(n)).map(|n| seen[n].score).fold(0.0, f64::max),
        first_alarm_frame: first,
        more: BTreeMap::new(),
    }
    .with("alarms", alarms.len())
    .with("alarms_under_load", under_load.len())
    .with("false_gross", entry.is_ours().then_some(false_gross))
    .with("alarms_by_event", serde_json::json!(by_event))
    .with("frames", (0..seen.len()).filter(|&n| counts(n)).count())
    .with("alarm_frames", (0..seen.len()).filter(|&n| counts(n) && seen[n].alarms).count())
    .with("contact_frames", touching().count())
    .with("decided_frames", entry.is_ours().then(|| touching().filter(|&n| seen[n].is_decided()).count()))
    .with("most_load_fraction", held.map(load).fold(0.0, f64::max))
}

impl Protocol for Quiet {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.trials_count
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let (script, what) = self.watch_of(number)?;
        let watched = watch(&what, detectors, None)?;
        let of =
            |(entry, seen): &(&'static Entry, Vec<Seen>)| record(number, &what.trial, &script, &watched, entry, seen);
        Ok(watched.seen.iter().map(of).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let mut table = Table::new(
            "Alarms where nothing slides",
            "An alarm is counted when it begins, and as false at a load below 0.2 mu P; a grip that is let go while it holds some shear \
             loads the contact more. The bound on the rate holds at 95 %, one-sided (Garwood); it takes alarms as independent. \
             False gross: reports of gross slip that begin below 0.8 mu P where the object does not slide. Coverage: share of the \
             frames with contact that were decided.",
            &[
                "detector",
                "frames",
                "hours",
                "false alarms",
                "above 0.2 mu P",
                "false gross",
                "per hour, bound above",
                "episodes with one %",
                "frames in alarm %",
                "coverage %",
            ],
        );
        let mut events = Table::new(
            "By what happened last",
            "Number of false alarms.",
            &["detector", "press", EVENTS[0], EVENTS[1], EVENTS[2], EVENTS[3], EVENTS[4]],
        );
        for entry in &DETECTORS {
            let some: Vec<&TrialRecord> = records.iter().filter(|r| r.detector == entry.name).collect();
            if some.is_empty() {
                continue;
            }
            let sum = |key: &str| some.iter().filter_map(|r| r.number_of(key)).sum::<f64>() as u64;
            let (frames, alarms, episodes) = (sum("frames"), sum("alarms"), some.len() as u64);
            let false_gross: Option<f64> = some.iter().map(|r| r.number_of("false_gross")).sum();
            let hours_h = frames as f64 / FRAME_RATE_HZ as f64 / 3600.0;
            table.rows.push(vec![
                entry.name.into(),
                Cell::Count(frames),
                Cell::Number(Estimated { value: Some(hours_h), low: None, high: None, n: frames }, 2),
                Cell::Count(alarms),
                Cell::Count(sum("alarms_under_load")),
                // Rivals do not report it, and older records do not say.
                false_gross.map_or(Cell::None, |count| Cell::Count(count as u64)),
                Cell::Number(rate_per_h(alarms, hours_h), 2),
                Cell::Share(share(some.iter().filter(|r| r.verdict).count() as u64, episodes)),
                Cell::Share(share_of_frames(sum("alarm_frames"), frames, episodes)),
                // Rivals have no state, and older records do not say.
                share_of_keys(&some, "decided_frames", "contact_frames"),
            ]);
            let of_event = |event: &str| {
                let count = |r: &&TrialRecord| r.more.get("alarms_by_event")?.get(event)?.as_u64();
                Cell::Count(some.iter().filter_map(count).sum())
            };
            let cells = std::iter::once("press").chain(EVENTS).map(of_event);
            events.rows.push(std::iter::once(entry.name.into()).chain(cells).collect());
        }
        let loads: Vec<f64> = records.iter().filter_map(|r| r.number_of("most_load_fraction")).collect();
        let most = loads.iter().copied().fold(0.0, f64::max);
        events.note = format!("Number of false alarms. Largest tangential force over mu P in any episode: {most:.2}.");
        vec![table, events]
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![Restarts::Rivals.setting(), ("episode_frames".into(), FRAMES_COUNT.to_string())]
    }

    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        show(&self.watch_of(number)?.1, detector, onlooker)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ground_truth::GroundTruth;
    use super::*;
    use crate::contact::Wrench;
    use crate::rivals::named;
    use crate::world::{Physics, World};

    #[test]
    fn an_episode_lasts_a_minute_and_never_loads_the_object_to_a_fifth() {
        for number in [3] {
            let (script, what) = Quiet::new(0, None).watch_of(number).expect("a sound trial");
            let stills: u64 = what.stills.iter().map(|(_, count)| count).sum();
            let profile = what.profile.clone().expect("a path");
            let mut world = World::with(&what.trial, profile, &Physics::default()).expect("a sound world");
            let (mut frames, mut most) = (0, 0.0f64);
            while let Some(truth) = world.advance().expect("a sound world") {
                frames += 1;
                if truth.frame > REST_FRAMES + 15 {
                    most = most.max(truth.wrench.force_n.length() / (what.trial.mu() * truth.grip_force_n));
                }
            }
            assert!((FRAMES_COUNT..FRAMES_COUNT + 400).contains(&(frames + stills)), "{frames} + {stills}");
            assert!(script.events.len() > 5, "{:?}", script.events);
            assert!(most < 0.2, "{number}: {most}");
            assert!(what.stills.iter().all(|(at, _)| *at < frames));
        }
    }

    /// Frames of 0.1 of the load, the states as letters: `g` gross, `i` incipient slip, `?` unsure.
    fn judged(detector: &str, states: &str, slides_at: Option<usize>) -> TrialRecord {
        let (script, what) = Quiet::new(0, None).watch_of(3).expect("a sound trial");
        let grip_n = 10.0;
        let truth = |n: usize| GroundTruth {
            frame: n as u64,
            time_s: n as f64 / 30.0,
            load: None,
            stick_ratio: (n > 0).then_some(1.0),
            grip_n,
            wrench: Wrench { force_n: Vec2::new(0.1 * what.trial.mu() * grip_n, 0.0), torque_n_mm: 0.0 },
            pose: Default::default(),
            slip_mm: Vec2::ZERO,
            arm_mm: 5.0,
            slides: slides_at == Some(n),
        };
        let seen = |state: char| Seen {
            score: 0.0,
            alarms: "gi".contains(state),
            state: match state {
                'g' => SlipState::Gross,
                'i' => SlipState::Incipient,
                '?' => SlipState::Unsure,
                _ => SlipState::Stick,
            },
            estimates: Default::default(),
        };
        let watched = Watched { truth: (0..states.len()).map(truth).collect(), ..Default::default() };
        let seen: Vec<Seen> = states.chars().map(seen).collect();
        record(3, &what.trial, &script, &watched, named(detector).expect("a detector"), &seen)
    }

    #[test]
    fn false_reports_of_gross_slip_are_counted_apart() {
        let column = |records: &[TrialRecord]| {
            let table = &Quiet::new(0, Some(1)).tables(records)[0];
            let place = table.columns.iter().position(|column| column == "false gross").expect("a column");
            table.shown()[0][place].clone()
        };
        let ours = judged("ours", "..ii.iggi.g..", None);
        assert_eq!(column(std::slice::from_ref(&ours)), "2");
        assert_eq!(column(&[judged("ours", "..ii.iggi.g..", Some(10))]), "1", "the other is true");
        assert_eq!(column(&[judged("ours", "..ii.....", None)]), "0");
        assert_eq!(column(&[judged("paper", "..ggg....", None)]), "-", "not its own report");
        let mut older = ours.clone();
        older.more.remove("false_gross");
        assert_eq!(column(&[ours, older]), "-", "the older one does not say");
    }

    #[test]
    fn who_is_unsure_raises_no_alarm_and_covers_less() {
        let records = [judged("ours", ".??i.......", None), judged("paper", ".??i.......", None)];
        let table = &Quiet::new(0, Some(1)).tables(&records)[0];
        let coverage = |row: usize| {
            let row = table.rows[row].iter().zip(&table.columns);
            row.filter(|(_, column)| *column == "coverage %").map(|(cell, _)| cell.clone()).next()
        };
        assert_eq!(coverage(1), Some(Cell::None), "the state is ours");
        assert_eq!(coverage(0), Some(Cell::Share(share_of_frames(8, 10, 1))), "of the frames with contact");
    }
}
