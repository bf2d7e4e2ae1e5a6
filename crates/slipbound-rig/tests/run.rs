//! A run folder: what is written comes back, and the page stands on its own.

#[path = "run/screw.rs"]
mod screw;

use proptest::prelude::*;
use slipbound::port::WristMotion;
use slipbound_rig::run::{self, Cycle, Event, RunFolder, RunInfo, TimedEvent};
use std::fs;
use std::path::Path;

fn bits(cycle: &Cycle) -> String {
    // Debug prints the shortest digits that name a number: two texts are the same only for the same bits, NaN apart.
    format!("{cycle:?}")
}

fn written(folder: &Path, info: &RunInfo, cycles: &[Cycle]) -> RunFolder {
    let mut run = RunFolder::create(folder, info).expect("creates");
    for cycle in cycles {
        run.cycle(cycle).expect("writes");
    }
    run
}

fn events(folder: &Path) -> Vec<TimedEvent> {
    let text = fs::read_to_string(folder.join("events.jsonl")).expect("events");
    text.lines().map(|line| serde_json::from_str(line).expect("an event")).collect()
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        any::<u64>().prop_map(f64::from_bits),
        Just(f64::NAN),
        Just(f64::NEG_INFINITY),
        Just(-0.0),
        Just(10.0)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn what_is_read_is_what_was_written_bit_for_bit(numbers in proptest::collection::vec(any_number(), 12)) {
        let mut cycle = screw::cycles()[150].clone();
        cycle.gripper.force_n = Some(numbers[0]);
        cycle.gripper.opening_mm = Some(numbers[1]);
        cycle.grip_command.force_n = numbers[2];
        cycle.wrist.angle_rad = numbers[3];
        cycle.wrist_command.motion = WristMotion::Turn { rate_rad_per_s: numbers[4], most_rad: numbers[5] };
        cycle.margin = Some(numbers[6]);
        cycle.hand.quality = numbers[7];
        cycle.hand.pivot_rad = Some(numbers[8]);
        if let Some(shear_mm) = &mut cycle.hand.shear_mm {
            shear_mm.around = numbers[9];
        }
        if let Some(truth) = &mut cycle.truth {
            truth.slid_mm = Some(numbers[10]);
            truth.load_n = Some(numbers[11]);
        }
        let folder = tempfile::tempdir().expect("a folder");
        drop(written(folder.path(), &screw::info(), std::slice::from_ref(&cycle)));
        let (_, cycles) = run::read(folder.path()).expect("reads");
        prop_assert_eq!(cycles.len(), 1);
        prop_assert_eq!(bits(&cycles[0]), bits(&cycle));
    }
}

#[test]
fn a_run_comes_back_with_its_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    drop(written(folder.path(), &screw::info(), &screw::cycles()));
    let (table, cycles) = run::read(folder.path()).expect("reads");
    assert_eq!(cycles, screw::cycles());
    assert_eq!(table["settings"].as_table(), Some(&screw::info().settings));
    assert_eq!((table["task"].as_str(), table["seed"].as_integer()), (Some("screw"), Some(3)));
    assert_eq!(table["software_version"].as_str(), Some(env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_folder_that_holds_something_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("thesis.tex"), "").expect("writes");
    let message = RunFolder::create(folder.path(), &screw::info()).expect_err("refused").to_string();
    assert!(message.starts_with(&folder.path().display().to_string()), "{message}");
    assert!(message.contains("expected a new or empty folder, got one that holds `thesis.tex`"), "{message}");
}

#[test]
fn a_line_that_broke_off_is_no_cycle_and_a_spoilt_one_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    drop(written(folder.path(), &screw::info(), &screw::cycles()[..5]));
    let path = folder.path().join("reports.jsonl");
    let whole = fs::read_to_string(&path).expect("reads");
    fs::write(&path, &whole[..whole.len() - 40]).expect("writes");
    assert_eq!(run::read(folder.path()).expect("reads").1, screw::cycles()[..4]);
    fs::write(&path, whole.replacen("\"seq\":2", "\"seq\":two", 1)).expect("writes");
    let message = run::read(folder.path()).expect_err("refused").to_string();
    assert!(message.contains("reports.jsonl: line 3: expected"), "{message}");
}

#[test]
fn events_tell_what_happened() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = written(folder.path(), &screw::info(), &screw::cycles());
    assert_eq!(run.slips_count(), 4);
    run.note(9_990_000_000, "the gripper was switched off");
    run.finish(&screw::results(), None).expect("finishes");
    let events = events(folder.path());
    let begins: Vec<_> = events
        .iter()
        .filter_map(|e| match &e.event {
            Event::SlipBegins { slip, direction, force_n, .. } => {
                Some((e.time_ns, *slip, direction.as_str(), force_n.is_some()))
            }
            _ => None,
        })
        .collect();
    let expected: Vec<_> = screw::SLIPS
        .iter()
        .zip(1..)
        .map(|(&at, n)| (screw::cycles()[at as usize].time_ns, n, "around", true))
        .collect();
    assert_eq!(begins, expected);
    let count = |wanted: fn(&Event) -> bool| events.iter().filter(|e| wanted(&e.event)).count();
    assert_eq!(count(|e| matches!(e, Event::SlipEnds { .. })), 4);
    assert_eq!(count(|e| matches!(e, Event::Grip { .. })), 4);
    assert_eq!(count(|e| matches!(e, Event::Finger { finger, .. } if finger == "right")), 2);
    assert_eq!(count(|e| matches!(e, Event::Note { .. })), 1);
    assert_eq!(count(|e| matches!(e, Event::Ended { .. })), 1);
    assert_eq!(count(|e| matches!(e, Event::Result(_))), screw::results().len());
}
