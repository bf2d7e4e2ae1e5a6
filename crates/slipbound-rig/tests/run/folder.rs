//! What is read equals what was written; what cannot be written is refused by name.

use crate::{any_number, screw, written};
use proptest::prelude::*;
use slipbound::control::Cycle;
use slipbound::port::{GripCommand, WristMotion};
use slipbound_rig::run::{self, RunFolder};
use std::fs;

#[test]
fn a_password_in_the_address_of_a_camera_is_not_kept() {
    let info = run::RunInfo { source: "rtsp://me:secret@left/gel, rtsp://me:secret@right/gel".into(), ..screw::info() };
    let told = "rtsp://me@left/gel, rtsp://me@right/gel";
    assert_eq!(info.source_in_words(), told);
    let text = info.to_toml().expect("TOML");
    assert!(text.contains(told) && !text.contains("secret"), "{text}");
}

fn bits(cycle: &Cycle) -> String {
    // Debug prints the shortest digits that name a number: two texts are the same only for the same bits, NaN apart.
    format!("{cycle:?}")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn what_is_read_is_what_was_written_bit_for_bit(
        numbers in proptest::collection::vec(any_number(), 12),
        seq in any::<u64>(),
        time_ns in any::<Option<u64>>(),
    ) {
        let mut cycle = screw::cycles()[150];
        (cycle.hand.seq, cycle.hand.time_ns) = (seq, time_ns);
        cycle.gripper.force_n = Some(numbers[0]);
        cycle.gripper.opening_mm = Some(numbers[1]);
        cycle.grip_command = GripCommand::Hold { force_n: numbers[2] };
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

/// A line that lists numbers that are not finite, without the object that contains them.
#[test]
fn a_line_without_a_hand_is_refused_by_its_number() {
    for hand in ["3", "[1, null]", "null", "{\"seq\": -1}"] {
        let folder = tempfile::tempdir().expect("a folder");
        drop(written(folder.path(), &screw::info(), &screw::cycles()[..1]));
        let line = format!("{{\"hand\": {hand}, \"not_finite\": {{\"margin\": \"nan\"}}}}\n");
        fs::write(folder.path().join("reports.jsonl"), line).expect("writes");
        let message = run::read(folder.path()).expect_err("refused").to_string();
        assert!(message.contains("reports.jsonl") && message.contains("line 1: hand:"), "{hand}: {message}");
    }
}

#[test]
fn a_run_comes_back_with_its_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    drop(written(folder.path(), &screw::info(), &screw::cycles()));
    let (table, cycles) = run::read(folder.path()).expect("reads");
    assert_eq!(cycles, screw::cycles());
    assert_eq!(table["settings"]["friction"].as_float(), Some(0.6));
    assert_eq!(table["settings"]["task"]["grip"]["most_n"].as_float(), Some(60.0));
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

/// A name is used unchanged for its files: two names are two files, and none is outside the folder.
#[test]
fn every_finger_has_files_of_its_own_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut info = screw::info();
    info.fingers.truncate(1);
    info.fingers.push(info.fingers[0].clone());
    for (finger, name) in info.fingers.iter_mut().zip(["a-1", "a_1"]) {
        finger.name = name.into();
    }
    let run = folder.path().join("run");
    drop(RunFolder::create(&run, &info).expect("creates"));
    assert!(run.join("a-1.sensor.toml").is_file() && run.join("a_1.sensor.toml").is_file());
    info.fingers[1].name = "../x".into();
    let refused = folder.path().join("refused");
    let message = RunFolder::create(&refused, &info).expect_err("refused").to_string();
    assert!(message.contains("a finger's name: expected 1 to 64 of A-Z a-z 0-9 _ -, got `../x`"), "{message}");
    assert!(!refused.exists());
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
