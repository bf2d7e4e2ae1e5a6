//! The command `demo` as a user runs it: what it leaves, that it replays, and that nothing that goes wrong lets go.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn slipbound(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_slipbound")).args(args).output().expect("runs")
}

fn told(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn demo(folder: &Path, args: &[&str]) -> Output {
    let folder = folder.to_str().expect("UTF-8");
    slipbound(&[&["demo", "--fingers", "1", "-o", folder], args].concat())
}

fn cycles(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("reports.jsonl")).expect("reports");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn force_n(cycle: &Value) -> f64 {
    cycle["grip_command"]["force_n"].as_f64().expect("a number")
}

#[test]
fn a_cap_is_opened_and_the_recording_gives_the_same_commands_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let output = demo(&run, &["--task", "unscrew", "--set", "mu=0.4", "--record"]);
    assert!(output.status.success(), "{}", told(&output));
    assert!(told(&output).contains("Opened"), "{}", told(&output));
    for file in ["run.toml", "events.jsonl", "reports.jsonl", "report.html", "frames.jsonl", "slip_001_left.png"] {
        assert!(run.join(file).exists(), "{file}");
    }
    let path = run.to_str().expect("UTF-8");
    let again = slipbound(&["replay", path]);
    assert!(again.status.success(), "{}", told(&again));
    assert!(told(&again).contains("every report and command the same"));

    // A command that differs in its last bit is found.
    let reports = run.join("reports.jsonl");
    let text = fs::read_to_string(&reports).expect("reports");
    let changed =
        text.replacen("\"jaws\":\"hold\",\"force_n\":20.0}", "\"jaws\":\"hold\",\"force_n\":20.000000000000004}", 1);
    assert_ne!(text, changed);
    fs::write(&reports, changed).expect("written");
    let differs = slipbound(&["replay", path]);
    assert_eq!(differs.status.code(), Some(1));
    assert!(told(&differs).contains("recorded Hold { force_n: 20.000000000000004"), "{}", told(&differs));
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = |name: &str, seed: &str| {
        let run = folder.path().join(name);
        let output = demo(&run, &["--task", "lift", "--seed", seed, "--set", "longest_s=2"]);
        assert!(output.status.success(), "{}", told(&output));
        fs::read(run.join("reports.jsonl")).expect("reports")
    };
    let first = report("a", "1");
    assert_eq!(first, report("b", "1"));
    assert_ne!(first, report("c", "2"));
}

/// Whatever happens to the eyes, the grip does not fall, the wrist stands, and the cap is not let go.
#[test]
fn a_hand_that_goes_blind_holds_on_and_stands_still() {
    for fault in ["lost@1.5", "frozen@1.5", "torn@1.5", "dark@1.5"] {
        let folder = tempfile::tempdir().expect("a folder");
        let run = folder.path().join("run");
        let output = demo(&run, &["--set", "mu=0.6", "--set", "longest_s=3", "--fault", fault]);
        assert!(output.status.success(), "{fault}: {}", told(&output));
        let cycles = cycles(&run);
        let after = |c: &&Value| c["time_ns"].as_u64().expect("a time") > 1_800_000_000;
        let held: Vec<f64> = cycles.iter().filter(|c| c["phase"]["phase"] != "grasping").map(force_n).collect();
        assert!(held.windows(2).all(|pair| pair[1] >= pair[0]), "{fault}: the grip fell");
        assert!(
            cycles.iter().any(|c| c["wrist_command"]["motion"]["motion"] == "turn"),
            "{fault}: it had been turning"
        );
        assert!(cycles.iter().filter(after).count() > 20, "{fault}");
        for cycle in cycles.iter().filter(after) {
            assert_eq!(cycle["wrist_command"]["motion"]["motion"], "pause", "{fault}: {cycle}");
            assert!(cycle["gripper"]["force_n"].as_f64().expect("a force") > 9.0, "{fault}");
        }
        let events = fs::read_to_string(run.join("events.jsonl")).expect("events");
        let said = if fault.starts_with("frozen") { "frozen" } else { "blind" };
        assert!(events.contains(said), "{fault}: {events}");
    }
}

#[test]
fn what_cannot_be_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("settings.toml");
    let run = folder.path().join("run");
    for (text, named) in [
        ("[grip]\nmost_n = nan\n", "grip.most_n"),
        ("[grip]\nstart_n = 200.0\n", "grip.start_n"),
        ("[screw]\nrate_rad_per_s = -inf\n", "screw.rate_rad_per_s"),
        ("[grip]\nmost = 5\n", "most_n"),
    ] {
        fs::write(&file, text).expect("written");
        let output = demo(&run, &["--settings", file.to_str().expect("UTF-8")]);
        assert_eq!(output.status.code(), Some(2), "{text}: {}", told(&output));
        assert!(told(&output).contains(named), "{text}: {}", told(&output));
    }
    for args in [&["--set", "mu=-1"][..], &["--fault", "fire@2"], &["--set", "force=3"], &["--controller", "hope"]] {
        assert_eq!(demo(&run, args).status.code(), Some(2), "{args:?}");
    }
    fs::create_dir(&run).expect("made");
    fs::write(run.join("mine.txt"), "mine").expect("written");
    let output = demo(&run, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    assert!(told(&output).contains("run"), "{}", told(&output));
}
