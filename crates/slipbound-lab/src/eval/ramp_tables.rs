//! Tables over ramps: alarms, lead time, accuracy, direction, gross slip.

use super::outcome::{FALSE_BELOW_FRACTION, GROSS_FALSE, Outcome, SCORE_BELOW, left_out_note, never_slides};
use super::record::TrialRecord;
use super::statistics::{Estimated, auc, mean, median, quantile, share, share_of, share_of_frames};
use super::table::{Cell, Table};
use super::watch::{GROSS_WITHIN_FRAMES, GROSS_WITHIN_MS};
use crate::rivals::DETECTORS;

/// A part of the records: its name and whether a record is in it.
pub(super) type Part<'a> = (&'a str, &'a dyn Fn(&TrialRecord) -> bool);

fn numbers(records: &[&TrialRecord], key: &str) -> Vec<f64> {
    records.iter().filter_map(|r| r.number_of(key)).collect()
}

fn flags(records: &[&TrialRecord], key: &str) -> Estimated {
    share_of(records.iter().filter_map(|r| r.flag_of(key)))
}

/// The detectors of some records: those of the list in its order, then others in order of appearance.
fn names(records: &[TrialRecord]) -> Vec<&str> {
    let mut names: Vec<&str> = DETECTORS.iter().map(|entry| entry.name).collect();
    for record in records {
        if !names.contains(&record.detector.as_str()) {
            names.push(&record.detector);
        }
    }
    names
}

/// Those that reach gross slip.
fn sliding<'a>(records: &'a [TrialRecord], detector: &str) -> Vec<&'a TrialRecord> {
    records.iter().filter(|r| r.detector == detector && !never_slides(r)).collect()
}

/// Alarms before gross slip, false or in time.
fn before_gross(records: &[&TrialRecord]) -> Estimated {
    share_of(records.iter().map(|r| Outcome::of(r).is_some_and(Outcome::is_before_gross)))
}

fn is_false(records: &[&TrialRecord]) -> Estimated {
    share_of(records.iter().map(|r| Outcome::of(r) == Some(Outcome::False)))
}

/// Those with an alarm before gross slip.
fn alarmed<'a>(records: &[&'a TrialRecord]) -> Vec<&'a TrialRecord> {
    records.iter().copied().filter(|r| Outcome::of(r).is_some_and(Outcome::is_before_gross)).collect()
}

/// f at the alarms before gross slip, false ones among them.
fn fractions(records: &[&TrialRecord]) -> Vec<f64> {
    numbers(&alarmed(records), "f_at_alarm")
}

/// The tables of all ramps; `prefix` starts their titles.
pub(super) fn tables(records: &[TrialRecord], prefix: &str) -> Vec<Table> {
    let mut alarms = alarm_table(prefix, &left_out_note(records));
    let mut errors = error_table(prefix);
    let mut directions = direction_table(prefix);
    let mut gross = gross_table(prefix);
    for name in names(records) {
        let all = sliding(records, name);
        if all.is_empty() {
            continue;
        }
        alarms.rows.push(alarm_row(name, &all));
        if !DETECTORS.iter().any(|entry| entry.name == name && entry.is_ours()) {
            continue;
        }
        errors.rows.push(error_row(name, &all));
        directions.rows.push(direction_row(name, &all));
        gross.rows.push(gross_row(name, &all));
    }
    vec![alarms, errors, directions, gross]
}

fn alarm_table(prefix: &str, note: &str) -> Table {
    Table::new(
        &format!("{prefix}Alarms"),
        &format!(
            "Before gross slip: the first alarm came before it. False: at f < {FALSE_BELOW_FRACTION}, for ours also while the grip rises before the \
             load. f of all alarms before gross slip, false ones among them; lead of the same on ramps of 1 s, from the exposure of the frame, \
             without processing time. AUC: the highest score before gross slip against the highest at f < {FALSE_BELOW_FRACTION}. Coverage: share of \
             the loaded frames that were decided.{note}"
        ),
        &[
            "detector",
            "ramps",
            "before gross %",
            "false %",
            "f at alarm, median",
            "95th pct",
            "lead ms, median",
            "5th pct",
            "coverage %",
            "AUC",
        ],
    )
}

/// Coverage: share of the loaded frames that were decided; none of rivals, which have no state.
pub(super) fn coverage(records: &[&TrialRecord]) -> Cell {
    share_of_keys(records, "decided_frames", "loaded_frames")
}

/// Share of some frames, counted by the first key, in others, counted by the second, of the trials that have any. None
/// where no record counts them.
pub(super) fn share_of_keys(records: &[&TrialRecord], key: &str, of: &str) -> Cell {
    let some: Vec<&TrialRecord> =
        records.iter().copied().filter(|r| r.number_of(of).is_some_and(|count| count > 0.0)).collect();
    if numbers(&some, key).is_empty() {
        return Cell::None;
    }
    let sum = |key: &str| numbers(&some, key).iter().sum::<f64>() as u64;
    Cell::Share(share_of_frames(sum(key), sum(of), some.len() as u64))
}

fn alarm_row(name: &str, all: &[&TrialRecord]) -> Vec<Cell> {
    let f = fractions(all);
    let mut one_s = alarmed(all);
    one_s.retain(|r| r.number_of("ramp_s") == Some(1.0));
    let leads = numbers(&one_s, "lead_ms");
    vec![
        name.into(),
        Cell::Count(all.len() as u64),
        Cell::Share(before_gross(all)),
        Cell::Share(is_false(all)),
        Cell::Number(median(&f), 3),
        Cell::Number(quantile(&f, 0.95), 3),
        Cell::Number(median(&leads), 0),
        Cell::Number(quantile(&leads, 0.05), 0),
        coverage(all),
        Cell::Number(auc(&all.iter().map(|r| r.score).collect::<Vec<f64>>(), &numbers(all, SCORE_BELOW)), 3),
    ]
}

fn error_table(prefix: &str) -> Table {
    Table::new(
        &format!("{prefix}Estimation errors"),
        "Mean over ramps of the mean absolute error of stick ratio and margin, on frames before gross slip with f >= 0.1 and the grip steady for 0.2 s; shear and torque: \
         root mean square error over the loaded frames over the value at gross slip; friction: median relative error once f > 0.3. Last: number of \
         ramps with an estimate of stick ratio, margin, shear, torque and friction.",
        &[
            "detector",
            "ramps",
            "stick ratio MAE",
            "margin MAE",
            "shear %",
            "torque %",
            "friction %, median",
            "ramps with an estimate",
        ],
    )
}

fn error_row(name: &str, all: &[&TrialRecord]) -> Vec<Cell> {
    let mean_of = |key: &str| mean(&numbers(all, key));
    let known =
        ["stick_error", "margin_error", "shear_error_fraction", "torque_error_fraction", "friction_error_fraction"]
            .map(|key| numbers(all, key).len().to_string());
    vec![
        name.into(),
        Cell::Count(all.len() as u64),
        Cell::Number(mean_of("stick_error"), 3),
        Cell::Number(mean_of("margin_error"), 3),
        Cell::Share(mean_of("shear_error_fraction")),
        Cell::Share(mean_of("torque_error_fraction")),
        Cell::Share(median(&numbers(all, "friction_error_fraction"))),
        known.join(", ").into(),
    ]
}

fn direction_table(prefix: &str) -> Table {
    Table::new(
        &format!("{prefix}Kind and direction"),
        "At the first alarm before gross slip, under the load. Kind and sense of rotation: against the motion of the object since the load \
         began; direction: against the mean slip of the contact since then.",
        &["detector", "alarms", "kind right %", "direction error deg, median", "95th pct", "sense of rotation right %"],
    )
}

fn direction_row(name: &str, all: &[&TrialRecord]) -> Vec<Cell> {
    let alarmed: Vec<&TrialRecord> = all.iter().copied().filter(|r| r.more.contains_key("kind_true")).collect();
    let kind = share_of(alarmed.iter().map(|r| r.word_of("kind_true") == r.word_of("kind_said")));
    let apart = numbers(&alarmed, "direction_error_deg");
    vec![
        name.into(),
        Cell::Count(alarmed.len() as u64),
        Cell::Share(kind),
        Cell::Number(median(&apart), 1),
        Cell::Number(quantile(&apart, 0.95), 1),
        Cell::Share(flags(&alarmed, "sense_right")),
    ]
}

fn gross_table(prefix: &str) -> Table {
    Table::new(
        &format!("{prefix}Gross"),
        "Reported: share of the ramps with a report of gross slip; they go on for 67 ms after it, and until the object has slid by 3 mm. Delay \
         from the first frame after gross slip. False: reported below f 0.8.",
        &[
            "detector",
            "ramps",
            "reported %",
            "delay frames, median",
            "within 2 frames %",
            "within 67 ms %",
            "kept %",
            "false %",
        ],
    )
}

/// A row about `gross`: reported, delay, kept, false.
pub(super) fn gross_row(name: &str, all: &[&TrialRecord]) -> Vec<Cell> {
    let delays = numbers(all, "gross_delay_frames");
    // A ramp in which it was never reported is not within two frames.
    let within = delays.iter().filter(|&&delay| delay <= GROSS_WITHIN_FRAMES as f64).count() as u64;
    let delays_ms = numbers(all, "gross_delay_ms");
    let soon = delays_ms.iter().filter(|&&delay_ms| delay_ms <= GROSS_WITHIN_MS).count() as u64;
    // Older records do not tell the time.
    let is_told = delays.is_empty() || !delays_ms.is_empty();
    let wrong = all.iter().filter(|r| r.flag_of(GROSS_FALSE) == Some(true)).count() as u64;
    vec![
        name.into(),
        Cell::Count(all.len() as u64),
        Cell::Share(share(delays.len() as u64, all.len() as u64)),
        Cell::Number(median(&delays), 1),
        Cell::Share(share(within, all.len() as u64)),
        if is_told { Cell::Share(share(soon, all.len() as u64)) } else { Cell::None },
        share_of_keys(all, "gross_kept_frames", "gross_later_frames"),
        Cell::Share(share(wrong, all.len() as u64)),
    ]
}

/// One line for each detector and part.
pub(super) fn split(title: &str, records: &[TrialRecord], parts: &[Part<'_>]) -> Table {
    let mut table = Table::new(
        title,
        "",
        &[
            "detector",
            "part",
            "ramps",
            "before gross %",
            "false %",
            "f at alarm, median",
            "95th pct",
            "stick ratio MAE",
            "margin MAE",
            "friction %, median",
        ],
    );
    for name in names(records) {
        let all = sliding(records, name);
        for (part, is_in) in parts {
            let some: Vec<&TrialRecord> = all.iter().copied().filter(|r| is_in(r)).collect();
            if some.is_empty() {
                continue;
            }
            let f = fractions(&some);
            table.rows.push(vec![
                name.into(),
                (*part).into(),
                Cell::Count(some.len() as u64),
                Cell::Share(before_gross(&some)),
                Cell::Share(is_false(&some)),
                Cell::Number(median(&f), 3),
                Cell::Number(quantile(&f, 0.95), 3),
                Cell::Number(mean(&numbers(&some, "stick_error")), 3),
                Cell::Number(mean(&numbers(&some, "margin_error")), 3),
                Cell::Share(median(&numbers(&some, "friction_error_fraction"))),
            ]);
        }
    }
    table
}

/// Force, torque and friction of ours, one line for each detector and part.
pub(super) fn loads(title: &str, records: &[TrialRecord], parts: &[Part<'_>]) -> Table {
    let mut table = Table::new(
        title,
        "",
        &["detector", "part", "ramps", "shear %", "torque %", "friction %, median", "margin MAE"],
    );
    for entry in DETECTORS.iter().filter(|entry| entry.is_ours()) {
        let all = sliding(records, entry.name);
        for (name, is_in) in parts {
            let some: Vec<&TrialRecord> = all.iter().copied().filter(|r| is_in(r)).collect();
            if some.is_empty() {
                continue;
            }
            table.rows.push(vec![
                entry.name.into(),
                (*name).into(),
                Cell::Count(some.len() as u64),
                Cell::Share(mean(&numbers(&some, "shear_error_fraction"))),
                Cell::Share(mean(&numbers(&some, "torque_error_fraction"))),
                Cell::Share(median(&numbers(&some, "friction_error_fraction"))),
                Cell::Number(mean(&numbers(&some, "margin_error")), 3),
            ]);
        }
    }
    table
}
