//! The paper's experiment with ten objects: held, pushed or turned until they slip, or not; does the rule detect it?
//!
//! Dong, Ma, Donlon and Rodriguez 2019, section IV: ten objects, 24 trials each, 18 of them with slip. Their forces and
//! pushes were applied by hand and are not published trial by trial; ours are [`FORCES_N`] and [`pushes`]. Every
//! detector restarts at the last frame before the load, as the paper takes its reference once the object is held.

use super::error::EvalError;
use super::outcome::{GROSS_FALSE, GROSS_SAID, Outcome, ScoredTrial, left_out_note, never_slides, record};
use super::protocol::Protocol;
use super::ramp_tables::coverage;
use super::record::TrialRecord;
use super::statistics::{auc, quantile, share};
use super::table::{Cell, Table};
use super::trial_seed::camera_seed;
use super::watch::{Onlooker, Restarts, Watch, show, watch};
use crate::objects::OBJECTS;
use crate::random::Random;
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::Trial;
use std::collections::{BTreeMap, BTreeSet};

/// Grip forces per finger in N: the least force of a common gripper, a firm grip, a strong one.
pub const FORCES_N: [f64; 3] = [5.0, 15.0, 30.0];

/// A repetition in addition to the table of the paper: the force of most of its demonstrations.
pub const STRONG_FORCE_N: f64 = 50.0;

/// Largest load of a trial without slip, as a share of the load that would make the object slide.
const NEGATIVE_FRACTION: f64 = 0.19;

/// Trials of an object at one force: 24 at the three of the table, as in the paper.
const AT_FORCE: u64 = 8;

/// Objects of the paper: the library without the cap.
const OBJECTS_COUNT: u64 = 10;

/// Trials of the paper, and those at 50 N.
const PAPERS_COUNT: u64 = OBJECTS_COUNT * AT_FORCE * FORCES_N.len() as u64;
const STRONG_COUNT: u64 = OBJECTS_COUNT * AT_FORCE;

/// The paper's results: right, false positives, false negatives, in percent of 240 trials.
const PUBLISHED: [f64; 3] = [86.25, 0.83, 12.92];

/// Its two failing objects, with the percentage of right trials in the table and in the repetition at 50 N.
const FAILING: [(&str, f64, f64); 2] = [("crayons_box", 49.97, 100.0), ("scrub_sponge", 33.33, 66.67)];

/// Step through all trials that makes the first few a fair sample: a prime near 0.618 of 320.
const SPREAD: u64 = 197;

/// A trial and whether the object slips in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Push {
    /// The trial.
    pub trial: Trial,
    /// Whether the object slides as a whole in the end.
    pub slips: bool,
}

/// The eight trials of an object at a force: three pulls and three turns until it slides, and a pull and a harder grip
/// without slip. Position, friction and speed vary with the seed. `n`: index of the force.
fn pushes_at(object: usize, n: usize, force_n: f64, seed: u64) -> Vec<Push> {
    let pull = |k: usize| format!("ramp?direction_deg={}", 90 * ((3 * n + k) % 4));
    let turn = |share: f64, k: usize| format!("ramp?twist_fraction={share}&direction_deg={}", 90 * ((n + k) % 4));
    let kinds = [
        (pull(0), true),
        (pull(1), true),
        (pull(2), true),
        (turn(1.0, 0), true),
        (turn(-1.0, 0), true),
        (turn(0.5, 1), true),
        (format!("{}&peak_fraction={NEGATIVE_FRACTION}", pull(3)), false),
        (format!("quiet_grip_steps?step_n=5&most_n={}", force_n + 5.0), false),
    ];
    let push = |(k, (kind, slips)): (usize, (String, bool))| {
        let number = AT_FORCE * n as u64 + k as u64;
        let mut random = Random::of(seed, 1000 * (1 + object as u64) + number);
        let mu = OBJECTS[object].mu * random.between(0.85, 1.15);
        let (x_mm, y_mm) = (random.between(-0.5, 0.5), random.between(-0.5, 0.5));
        let (turn_deg, ramp_s) = (random.between(-8.0, 8.0), random.between(0.5, 1.5));
        let ramp = if kind.starts_with("ramp") { format!("&ramp_s={ramp_s:.3}") } else { String::new() };
        let text = format!(
            "{kind}&object={}&force_n={force_n}&mu={mu:.3}&at_x_mm={x_mm:.3}&at_y_mm={y_mm:.3}&turn_deg={turn_deg:.3}\
             &grid=fast{ramp}&seed={}",
            OBJECTS[object].name,
            camera_seed(&mut random)
        );
        Push { trial: Trial::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}")), slips }
    };
    kinds.into_iter().enumerate().map(push).collect()
}

/// The 24 trials of an object of the library, by its place there.
pub fn pushes(object: usize, seed: u64) -> Vec<Push> {
    FORCES_N.into_iter().enumerate().flat_map(|(n, force_n)| pushes_at(object, n, force_n, seed)).collect()
}

/// 240 trials as in the paper, then 80 at 50 N.
#[derive(Debug)]
pub struct Table1 {
    pushes: Vec<Push>,
}

impl Table1 {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "table1";

    /// The trials of a seed; fewer `trials` are spread over objects, forces and kinds.
    pub fn new(seed: u64, trials: Option<u64>) -> Self {
        let objects = 0..OBJECTS_COUNT as usize;
        let mut pushes: Vec<Push> = objects.clone().flat_map(|object| pushes(object, seed)).collect();
        pushes.extend(objects.flat_map(|object| pushes_at(object, FORCES_N.len(), STRONG_FORCE_N, seed)));
        let all = pushes.len() as u64;
        let wanted = trials.unwrap_or(all).min(all);
        // Spread, so that a few trials cover all objects, forces and kinds.
        let mut places: Vec<u64> = (0..wanted).map(|k| k * SPREAD % all).collect();
        places.sort_unstable();
        let pushes = places.into_iter().map(|place| pushes[place as usize].clone()).collect();
        Table1 { pushes }
    }

    fn watch_of(&self, number: u64) -> (&Push, Watch) {
        let push = &self.pushes[number as usize];
        (push, Watch::new(push.trial.clone(), Restarts::All))
    }
}

impl Protocol for Table1 {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.pushes.len() as u64
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let (push, what) = self.watch_of(number);
        let watched = watch(&what, detectors, None)?;
        let scored_trial = ScoredTrial {
            number,
            trial: push.trial.to_string(),
            object: push.trial.object().name.into(),
            slips: push.slips,
            from_frame: watched.load_from_frame,
            mu: Some(push.trial.mu()),
        };
        let force_n = push.trial.number("force_n");
        let records = watched.seen.iter().map(|(entry, seen)| record(&scored_trial, entry, &watched, seen));
        Ok(records.map(|record| record.with("force_n", force_n)).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let names = || DETECTORS.iter().map(|entry| entry.name);
        let of = |name: &str| -> Vec<&TrialRecord> {
            records.iter().filter(|r| r.detector == name && !never_slides(r)).collect()
        };
        let is_paper = |r: &&TrialRecord| r.number_of("force_n") != Some(STRONG_FORCE_N);
        let trials: BTreeMap<u64, bool> = records.iter().map(|r| (r.number, is_paper(&r))).collect();
        let papers_count = trials.values().filter(|is_paper| **is_paper).count() as u64;
        let strong_count = trials.len() as u64 - papers_count;
        let judged: BTreeSet<u64> =
            records.iter().filter(|r| is_paper(r) && !never_slides(r)).map(|r| r.number).collect();
        let title = match judged.len() as u64 {
            PAPERS_COUNT => format!("All {PAPERS_COUNT}"),
            some => format!("{some} of {PAPERS_COUNT}"),
        };
        let strong_share = if strong_count == STRONG_COUNT { String::new() } else { format!("{strong_count} of ") };
        let mut all = Table::new(
            &title,
            &format!(
                "Right, false positives and false negatives as shares of all trials, as the paper prints them. Alarms while gripping are counted \
                 apart, as the paper's reference is taken after that.{}",
                left_out_note(records.iter().filter(is_paper))
            ),
            &HEAD,
        );
        let left_out = left_out_note(records.iter().filter(|r| !is_paper(r)));
        let strong_note = format!("{strong_share}{STRONG_COUNT} trials more; the paper has none.{left_out}");
        let mut strong = Table::new("The same at 50 N", &strong_note, &HEAD);
        for name in names() {
            let (paper, more): (Vec<&TrialRecord>, Vec<&TrialRecord>) = of(name).into_iter().partition(is_paper);
            all.rows.extend(row(name.into(), &paper));
            strong.rows.extend(row(name.into(), &more));
        }
        let [right, fp, fn_] = PUBLISHED.map(|percent| Cell::published(percent, PAPERS_COUNT));
        let mut published = vec!["as published, on real touch".into(), Cell::Count(PAPERS_COUNT), right, fp, fn_];
        published.resize(HEAD.len(), Cell::None);
        all.rows.push(published);
        let mut failing = Table::new(
            "The paper's two failing objects",
            "Right in percent: in the table, and repeated at 50 N.",
            &["detector", "object", "right %", "right at 50 N %"],
        );
        for (object, published, at_strong) in FAILING {
            for name in names() {
                let (paper, more): (Vec<&TrialRecord>, Vec<&TrialRecord>) =
                    of(name).into_iter().filter(|r| r.object == object).partition(is_paper);
                if !paper.is_empty() || !more.is_empty() {
                    failing.rows.push(vec![name.into(), object.into(), right_share(&paper), right_share(&more)]);
                }
            }
            let cells = [published, at_strong].map(|percent| Cell::published(percent, 24));
            failing.rows.push(["as published".into(), object.into()].into_iter().chain(cells).collect());
        }
        let mut tables = vec![all];
        for name in names().filter(|name| !of(name).is_empty()) {
            let mut table = Table::new(&format!("By object and force: {name}"), "", &HEAD);
            let paper: Vec<&TrialRecord> = of(name).into_iter().filter(is_paper).collect();
            for object in &OBJECTS[..OBJECTS_COUNT as usize] {
                let some: Vec<&TrialRecord> = paper.iter().copied().filter(|r| r.object == object.name).collect();
                table.rows.extend(row(object.name.into(), &some));
            }
            for force_n in FORCES_N {
                let some: Vec<&TrialRecord> =
                    paper.iter().copied().filter(|r| r.number_of("force_n") == Some(force_n)).collect();
                table.rows.extend(row(format!("all at {force_n} N").into(), &some));
            }
            tables.push(table);
        }
        tables.insert(1, strong);
        tables.insert(2, failing);
        tables
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![Restarts::All.setting()]
    }

    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        show(&self.watch_of(number).1, detector, onlooker)
    }
}

const HEAD: [&str; 11] = [
    "detector",
    "trials",
    "right %",
    "FP %",
    "FN %",
    "late + missed",
    "f at alarm, median",
    "coverage %",
    "while gripping",
    "AUC",
    "gross without slip",
];

/// Share of right verdicts.
fn right_share(records: &[&TrialRecord]) -> Cell {
    let right = records.iter().filter(|r| Outcome::of(r).is_some_and(Outcome::is_right)).count() as u64;
    Cell::Share(share(right, records.len() as u64))
}

/// A row over some records; None without records.
fn row(name: Cell, records: &[&TrialRecord]) -> Option<Vec<Cell>> {
    let all = records.len() as u64;
    if all == 0 {
        return None;
    }
    let count = |outcome: Outcome| records.iter().filter(|r| Outcome::of(r) == Some(outcome)).count() as u64;
    let [in_time, wrong, late, missed, quiet] = Outcome::ALL.map(count);
    let f: Vec<f64> = records
        .iter()
        .filter(|r| Outcome::of(r) == Some(Outcome::InTime))
        .filter_map(|r| r.number_of("f_at_alarm"))
        .collect();
    let scores =
        |truth: bool| -> Vec<f64> { records.iter().filter(|r| r.truth == Some(truth)).map(|r| r.score).collect() };
    // Rivals do not report it, and older records do not say.
    let is_ours = DETECTORS.iter().any(|entry| entry.is_ours() && entry.name == records[0].detector);
    let negatives = records.iter().filter(|r| r.truth == Some(false));
    let says_gross = |r: &&TrialRecord| r.more.get(GROSS_SAID).map(|_| u64::from(r.flag_of(GROSS_FALSE) == Some(true)));
    let gross: Option<u64> = negatives.map(says_gross).sum();
    let gripping = records.iter().filter(|r| r.flag_of("alarm_while_gripping") == Some(true)).count() as u64;
    Some(vec![
        name,
        Cell::Count(all),
        Cell::Share(share(in_time + quiet, all)),
        Cell::Share(share(wrong, all)),
        Cell::Share(share(late + missed, all)),
        format!("{late} + {missed}").into(),
        Cell::Number(quantile(&f, 0.5), 2),
        coverage(records),
        Cell::Count(gripping),
        Cell::Number(auc(&scores(true), &scores(false)), 3),
        gross.filter(|_| is_ours).map_or(Cell::None, Cell::Count),
    ])
}

#[cfg(test)]
mod tests {
    use super::super::outcome::FALSE_BELOW_FRACTION;
    use super::*;
    use crate::world::World;

    #[test]
    fn every_object_gets_the_papers_24_trials() {
        for (place, object) in OBJECTS[..10].iter().enumerate() {
            let pushes = pushes(place, 0);
            assert_eq!((pushes.len() as u64, pushes.iter().filter(|push| push.slips).count()), (24, 18));
            assert!(pushes.iter().all(|push| push.trial.object().name == object.name));
            for (n, push) in pushes.iter().enumerate() {
                assert!(!pushes[..n].contains(push), "{} comes twice", push.trial);
            }
        }
        assert_eq!(Table1::new(0, None).trials_count(), 320);
    }

    #[test]
    fn a_few_trials_still_cover_objects_and_forces() {
        let few = Table1::new(0, Some(37));
        let has = |of: &dyn Fn(&Push) -> bool| few.pushes.iter().filter(|push| of(push)).count();
        assert_eq!(few.trials_count(), 37);
        assert!(OBJECTS[..10].iter().all(|object| has(&|push| push.trial.object() == object) >= 2));
        assert!(has(&|push| push.trial.number("force_n") == STRONG_FORCE_N) > 0 && has(&|push| !push.slips) > 0);
    }

    #[test]
    fn trials_that_should_slip_do_and_the_others_stay_below_a_fifth() {
        for push in pushes(2, 0) {
            let mut world = World::new(&push.trial).expect("a sound trial");
            let mut most = 0.0f64;
            while let Some(truth) = world.advance().expect("a sound trial") {
                most = most.max(truth.load.unwrap_or(0.0));
            }
            assert_eq!(world.gross().is_some(), push.slips, "{}", push.trial);
            assert!(push.slips || most < FALSE_BELOW_FRACTION, "{}: {most}", push.trial);
        }
    }

    #[test]
    fn shares_are_of_all_trials_and_the_published_row_stands_below() {
        let record = |number: u64, outcome: Outcome, score: f64| {
            TrialRecord {
                number,
                trial: format!("t{number}"),
                object: "scissors".into(),
                detector: "ours".into(),
                truth: Some(outcome != Outcome::Quiet),
                verdict: false,
                score,
                first_alarm_frame: None,
                more: Default::default(),
            }
            .with("outcome", outcome.word())
            .with("force_n", 5.0)
        };
        let records = [
            record(0, Outcome::InTime, 2.0),
            record(1, Outcome::Quiet, 0.5),
            record(2, Outcome::Missed, 0.6),
            record(3, Outcome::Late, 0.4),
        ];
        let tables = Table1::new(0, Some(4)).tables(&records);
        assert_eq!((&*tables[0].title, &tables[1].note[..27]), ("4 of 240", "0 of 80 trials more; the pa"));
        let row = &tables[0].rows[0];
        assert_eq!(
            (&row[2], &row[4], &row[5]),
            (&Cell::Share(share(2, 4)), &Cell::Share(share(2, 4)), &Cell::Word("1 + 1".into()))
        );
        assert_eq!(tables[0].rows.last().map(|row| row[2].clone()), Some(Cell::published(86.25, 240)));
        assert!(matches!(&row[9], Cell::Number(area, _) if area.value == Some(2.0 / 3.0)), "{:?}", row[9]);
        let gross_of = |records: &[TrialRecord]| Table1::new(0, Some(4)).tables(records)[0].rows[0][10].clone();
        assert_eq!(gross_of(&records), Cell::None, "records from before it was counted");
        let mut told = records.clone().map(|r| r.with("gross_said_frame", 7).with("gross_false", true));
        assert_eq!(gross_of(&told), Cell::Count(1), "of the one trial without slip");
        told.iter_mut().for_each(|r| r.detector = "paper".into());
        assert_eq!(gross_of(&told), Cell::None, "a rival reports none");
        assert!(tables[0].markdown().contains("| as published, on real touch | 240 | 86.25 | 0.83 | 12.92 |"));
        for (table, row) in tables.iter().flat_map(|table| table.rows.iter().map(move |row| (table, row))) {
            for (column, cell) in table.columns.iter().zip(row).filter(|(column, _)| column.ends_with('%')) {
                assert!(!matches!(cell, Cell::Number(..)), "{}: {column}: a share is a fraction in JSON", table.title);
            }
        }
        // A fifth with an unknown truth.
        let never = TrialRecord { truth: None, ..record(4, Outcome::InTime, 2.0) };
        let never = never.with("outcome", None::<&str>).with("reaches_gross", false);
        let with_fifth = Table1::new(0, Some(5)).tables(&[&records[..], &[never]].concat());
        assert_eq!((&with_fifth[0].rows, &with_fifth[3].rows), (&tables[0].rows, &tables[3].rows));
        assert_eq!(with_fifth[0].title, "4 of 240", "the fifth is not judged");
        assert!(
            with_fifth[0].note.ends_with("(number 4), as meant to slide and never sliding: 1.")
                && !with_fifth[1].note.contains("sliding")
        );
    }
}
