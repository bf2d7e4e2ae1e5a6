//! Guided slides: a hand that follows its path whatever the friction, at 0.5 to 50 mm/s, for at least 30 frames after
//! gross slip.

use super::error::EvalError;
use super::outcome::{ScoredTrial, left_out_note, never_slides, record};
use super::protocol::Protocol;
use super::ramp_tables::{coverage, gross_row};
use super::ramps::MU;
use super::record::TrialRecord;
use super::statistics::{quantile, share};
use super::table::{Cell, Table};
use super::trial_seed::{camera_seed, stream};
use super::watch::{Onlooker, Restarts, Watch, show, watch};
use crate::contact::{Drive, Leg, Path};
use crate::objects::OBJECTS;
use crate::rivals::{DETECTORS, Entry};
use crate::scenes::{LoadProfile, Pull, Trial};
use crate::world::FRAME_RATE_HZ;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Speeds, mm/s.
pub const SPEEDS_MM_PER_S: [f64; 4] = [0.5, 2.0, 10.0, 50.0];

/// Default number of trials: 40 of each speed.
const TRIALS_COUNT: u64 = 160;

/// Frames after gross slip.
const FRAMES_AFTER_GROSS: u64 = 36;

/// Largest travel of a hand before gross slip, mm: what a strong grip on a small face needs.
const MOST_MM: f64 = 8.0;

/// From this speed on a hand moves straight until the object slides, and then on a circle of this radius: straight on
/// it would leave the pad. On the circle friction lags behind the motion, so sliding must begin before it.
const ROUND_FROM_MM_PER_S: f64 = 10.0;
const ROUND_AFTER_MM: f64 = 3.0;
const ROUND_RADIUS_MM: f64 = 2.0;

/// Largest grip, N, and friction in such a slide: more would shear a small face by as much as the circle is wide, and
/// it would not slide.
const ROUND_MOST_N: f64 = 15.0;
const ROUND_MOST_MU: f64 = 0.8;

/// Distance from the start of a straight slide to the middle of the pad, mm.
const BEFORE_MM: f64 = 2.5;

/// Speed from which `gross` must be reported within two frames, and the sliding distance that applies below it.
const FAST_FROM_MM_PER_S: f64 = 5.0;
const SLOW_WITHIN_MM: f64 = 0.3;

/// Grip, N: with more, a small face shears by more than the gel is long.
const FORCE_N: (f64, f64) = (10.0, 30.0);

/// The protocol.
#[derive(Debug)]
pub struct Slides {
    seed: u64,
    trials_count: u64,
}

/// A path at constant speed, straight or round.
fn path(trial: &Trial, speed_mm_per_s: f64, direction_rad: f64) -> Result<LoadProfile, SettingError> {
    let begin_s = trial.number("press_s") + trial.number("settle_s");
    let mut legs =
        vec![Leg::press(trial.number("force_n"), trial.number("press_s")), Leg::hold(trial.number("settle_s"))];
    let way_mm = MOST_MM + speed_mm_per_s * (FRAMES_AFTER_GROSS + 4) as f64 / FRAME_RATE_HZ as f64;
    let ahead = Vec2::new(libm::cos(direction_rad), libm::sin(direction_rad));
    if speed_mm_per_s < ROUND_FROM_MM_PER_S {
        let by = ahead * way_mm;
        legs.push(Leg::shear(by.x, by.y, way_mm / speed_mm_per_s));
    } else {
        let by = ahead * ROUND_AFTER_MM;
        legs.push(Leg::shear(by.x, by.y, ROUND_AFTER_MM / speed_mm_per_s));
        let piece_s = 0.5 / FRAME_RATE_HZ as f64;
        let turn_rad = speed_mm_per_s * piece_s / ROUND_RADIUS_MM;
        for piece in 0..(way_mm / (speed_mm_per_s * piece_s)).ceil() as u32 {
            let by = ahead.rotated(turn_rad * f64::from(piece)) * (speed_mm_per_s * piece_s);
            legs.push(Leg::shear(by.x, by.y, piece_s));
        }
    }
    Ok(LoadProfile {
        path: Path::new(legs)?,
        pull: Pull::None,
        drive: Drive::Guided,
        fingers_count: 1,
        load_from_s: Some(begin_s),
        along: (ahead, 0.0),
    })
}

impl Slides {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "slides";

    /// The slides of a seed.
    pub fn new(seed: u64, trials: Option<u64>) -> Self {
        Slides { seed, trials_count: trials.unwrap_or(TRIALS_COUNT) }
    }

    /// Speed, mm/s, and what to watch.
    pub(crate) fn watch_of(&self, number: u64) -> Result<(f64, Watch), EvalError> {
        let speeds_count = SPEEDS_MM_PER_S.len() as u64;
        let speed_mm_per_s = SPEEDS_MM_PER_S[(number % speeds_count) as usize];
        let object = &OBJECTS[(number / speeds_count % 10) as usize];
        let mut random = stream(self.seed, 3 << 32 | number);
        let is_round = speed_mm_per_s >= ROUND_FROM_MM_PER_S;
        let force_n = random.between(FORCE_N.0, if is_round { ROUND_MOST_N } else { FORCE_N.1 });
        let most_mu = if is_round { ROUND_MOST_MU } else { MU.1 };
        let mu = MU.0 * libm::pow(most_mu / MU.0, random.fraction());
        let direction_rad = match is_round {
            // Along an edge of the pad, where the circle fits on it.
            true => std::f64::consts::FRAC_PI_2 * (random.next_u64() % 4) as f64,
            false => random.between(0.0, std::f64::consts::TAU),
        };
        let turn_deg = random.between(-2.0, 2.0);
        let ahead = Vec2::new(libm::cos(direction_rad), libm::sin(direction_rad));
        let aside_mm = if is_round { ROUND_RADIUS_MM } else { 0.0 };
        let at_mm = -ahead * BEFORE_MM - ahead.turned() * aside_mm;
        let trial = Trial::parse(&format!(
            "press?object={}&force_n={force_n:.3}&mu={mu:.4}&turn_deg={turn_deg:.3}&at_x_mm={:.3}&at_y_mm={:.3}\
             &grid=fast&seed={}",
            object.name,
            at_mm.x,
            at_mm.y,
            camera_seed(&mut random)
        ))?;
        let profile = Some(path(&trial, speed_mm_per_s, direction_rad)?);
        let what =
            Watch { profile, frames_after_gross: Some(FRAMES_AFTER_GROSS), ..Watch::new(trial, Restarts::Rivals) };
        Ok((speed_mm_per_s, what))
    }
}

impl Protocol for Slides {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.trials_count
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let (speed_mm_per_s, what) = self.watch_of(number)?;
        let watched = watch(&what, detectors, None)?;
        let of = |(entry, seen): &(&'static Entry, Vec<_>)| {
            let scored_trial = ScoredTrial {
                number,
                trial: format!("slide at {speed_mm_per_s} mm/s: {}", what.trial),
                object: what.trial.object().name.into(),
                slips: true,
                from_frame: if entry.is_ours() { 0 } else { watched.load_from_frame },
                mu: Some(what.trial.mu()),
            };
            let record = record(&scored_trial, entry, &watched, seen);
            let frames = record.number_of("gross_delay_frames").map(|frames| frames.max(0.0));
            let slid_mm = frames.map(|frames| frames / FRAME_RATE_HZ as f64 * speed_mm_per_s);
            let last = watched.truth.last().map_or(0, |truth| truth.frame);
            let after = record.number_of("gross_frame").map_or(0, |gross| last.saturating_sub(gross as u64));
            record
                .with("gross_delay_mm", slid_mm)
                .with("speed_mm_per_s", speed_mm_per_s)
                .with("frames_after_gross", after)
        };
        Ok(watched.seen.iter().map(of).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let mut table = Table::new(
            "Gross on guided slides",
            &format!(
                "Delay from the first frame after gross slip; soon enough: within 2 frames from {FAST_FROM_MM_PER_S} mm/s on, within {SLOW_WITHIN_MM} mm of \
                 sliding below. Kept: share of the later frames in which it slides and is said to. False: said below f 0.8.{}",
                left_out_note(records)
            ),
            &[
                "detector",
                "speed mm/s",
                "slides",
                "said %",
                "delay frames, median",
                "within 2 frames %",
                "within 67 ms %",
                "kept %",
                "false %",
                "delay frames, 95th pct",
                "soon enough %",
            ],
        );
        for entry in DETECTORS.iter().filter(|entry| entry.is_ours()) {
            for speed_mm_per_s in SPEEDS_MM_PER_S {
                let some: Vec<&TrialRecord> = records
                    .iter()
                    .filter(|r| r.detector == entry.name && r.number_of("speed_mm_per_s") == Some(speed_mm_per_s))
                    .filter(|r| !never_slides(r))
                    .collect();
                if some.is_empty() {
                    continue;
                }
                let delays: Vec<f64> = some.iter().filter_map(|r| r.number_of("gross_delay_frames")).collect();
                let is_soon = |r: &&&TrialRecord| match speed_mm_per_s >= FAST_FROM_MM_PER_S {
                    true => r.number_of("gross_delay_frames").is_some_and(|frames| frames <= 2.0),
                    false => r.number_of("gross_delay_mm").is_some_and(|mm| mm <= SLOW_WITHIN_MM),
                };
                let soon = some.iter().filter(is_soon).count() as u64;
                let mut row = gross_row(entry.name, &some);
                row.insert(1, Cell::plain(speed_mm_per_s, some.len() as u64, 1));
                row.push(Cell::Number(quantile(&delays, 0.95), 1));
                row.push(Cell::Share(share(soon, some.len() as u64)));
                table.rows.push(row);
            }
        }
        let mut alarms = Table::new(
            "Any alarm before gross slip",
            &format!("Coverage: share of the loaded frames that were decided.{}", left_out_note(records)),
            &["detector", "slides", "before gross %", "after it or never %", "coverage %"],
        );
        for entry in &DETECTORS {
            let some: Vec<&TrialRecord> =
                records.iter().filter(|r| r.detector == entry.name && !never_slides(r)).collect();
            if some.is_empty() {
                continue;
            }
            let all = some.len() as u64;
            let before = some.iter().filter(|r| r.verdict).count() as u64;
            let cells = [Cell::Share(share(before, all)), Cell::Share(share(all - before, all)), coverage(&some)];
            alarms.rows.push([entry.name.into(), Cell::Count(all)].into_iter().chain(cells).collect());
        }
        vec![table, alarms]
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![Restarts::Rivals.setting()]
    }

    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        show(&self.watch_of(number)?.1, detector, onlooker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::share_of_frames;
    use crate::world::{Physics, World};

    #[test]
    fn a_hand_that_never_makes_it_slide_is_in_neither_table() {
        let record = |number: u64, reaches_gross: bool, detector: &str| {
            TrialRecord {
                number,
                trial: format!("t{number}"),
                object: "scissors".into(),
                detector: detector.into(),
                truth: reaches_gross.then_some(true),
                verdict: true,
                score: 1.0,
                first_alarm_frame: Some(1),
                more: Default::default(),
            }
            .with("speed_mm_per_s", 2.0)
            .with("reaches_gross", reaches_gross)
            .with("loaded_frames", 40)
            .with("decided_frames", 30)
        };
        let both = ["ours", "paper"];
        let records: Vec<TrialRecord> =
            both.iter().flat_map(|&name| [record(0, true, name), record(1, false, name)]).collect();
        let tables = Slides::new(0, Some(2)).tables(&records);
        assert!(tables.iter().all(|table| table.note.ends_with("never sliding: 1.")), "{tables:?}");
        assert_eq!(tables[0].rows.iter().map(|row| row[2].clone()).collect::<Vec<_>>(), [Cell::Count(1)]);
        assert_eq!(
            tables[1].rows.iter().map(|row| row[1].clone()).collect::<Vec<_>>(),
            [Cell::Count(1), Cell::Count(1)]
        );
        let is_whole = |table: &Table| table.rows.iter().all(|row| row.len() == table.columns.len());
        assert!(tables.iter().all(is_whole), "as many cells as columns: {tables:?}");
        assert_eq!(tables[1].rows[0].last(), Some(&Cell::Share(share_of_frames(30, 40, 1))), "coverage");
    }

    #[test]
    fn a_slide_goes_on_for_30_frames_after_gross_slip_and_stays_on_the_pad() {
        let slides = Slides::new(0, None);
        for number in [4, 5, 6] {
            let (speed_mm_per_s, what) = slides.watch_of(number).expect("a sound trial");
            let profile = what.profile.clone().expect("a path");
            let mut world = World::with(&what.trial, profile, &Physics::default()).expect("a sound world");
            let (mut after, mut at_border) = (0, 0);
            while let Some(truth) = world.advance().expect("a sound world") {
                let is_at_border = truth.at_border;
                if world.gross().is_some() {
                    after += 1;
                    at_border += u32::from(is_at_border);
                }
                if after == FRAMES_AFTER_GROSS {
                    break;
                }
            }
            assert_eq!((after, at_border), (FRAMES_AFTER_GROSS, 0), "at {speed_mm_per_s} mm/s: {}", what.trial);
        }
    }
}
