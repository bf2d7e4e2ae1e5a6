//! The command `demo` as a user runs it: its outputs, its replay, and that no fault releases the object.

mod program;

use program::{command, printed, slipbound};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

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
    assert!(output.status.success(), "{}", printed(&output));
    assert!(printed(&output).contains("Opened"), "{}", printed(&output));
    for file in ["run.toml", "events.jsonl", "reports.jsonl", "report.html", "frames.jsonl", "slip_001_left.png"] {
        assert!(run.join(file).exists(), "{file}");
    }
    let page = fs::read_to_string(run.join("report.html")).expect("a page");
    let card = page.split("<article id=\"slip-1\">").nth(1).and_then(|card| card.split("</article>").next());
    assert!(card.is_some_and(|card| card.contains(" N measured<") && card.contains("commanded from now on: ")));
    let path = run.to_str().expect("UTF-8");
    let again = slipbound(&["replay", path]);
    assert!(again.status.success(), "{}", printed(&again));
    assert!(printed(&again).contains("every report and command the same"));

    // A command that differs in its last bit is found, and so is what led to it.
    let reports = run.join("reports.jsonl");
    let text = fs::read_to_string(&reports).expect("reports");
    for (from, to, said) in [
        (
            "\"jaws\":\"hold\",\"force_n\":20.0}",
            "\"jaws\":\"hold\",\"force_n\":20.000000000000004}",
            "recorded hold with 20.000000000000004 N",
        ),
        (
            "\"margin\":null,\"alarms_count\":0",
            "\"margin\":0.25,\"alarms_count\":0",
            "recorded a margin of 0.25, replayed none",
        ),
        ("\"margin\":null,\"alarms_count\":0", "\"margin\":null,\"alarms_count\":3", "recorded 3 alarms, replayed 0"),
    ] {
        let changed = text.replacen(from, to, 1);
        assert_ne!(text, changed);
        fs::write(&reports, changed).expect("written");
        let differs = slipbound(&["replay", path]);
        assert_eq!(differs.status.code(), Some(1), "{from}: {}", printed(&differs));
        assert!(printed(&differs).contains(said), "{}", printed(&differs));
    }
}

#[test]
fn a_reader_that_leaves_does_not_take_the_page_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let mut words = command(&["demo", "--task", "lift", "--fingers", "1", "--set", "longest_s=2", "-o"]);
    words.arg(&run);
    let mut child = words.stdout(std::process::Stdio::piped()).spawn().expect("runs");
    let mut first = [0];
    let mut stdout = child.stdout.take().expect("piped");
    std::io::Read::read_exact(&mut stdout, &mut first).expect("begins");
    drop(stdout);
    child.wait().expect("ends");
    assert!(run.join("report.html").exists());
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = |name: &str, seed: &str| {
        let run = folder.path().join(name);
        let output = demo(&run, &["--task", "lift", "--seed", seed, "--set", "longest_s=2"]);
        assert!(output.status.success(), "{}", printed(&output));
        fs::read(run.join("reports.jsonl")).expect("reports")
    };
    let first = report("a", "1");
    assert_eq!(first, report("b", "1"));
    assert_ne!(first, report("c", "2"));
}

/// Whatever happens to the cameras, the grip does not fall, the wrist stands, and the cap is not released.
#[test]
fn a_hand_that_goes_blind_holds_on_and_stands_still() {
    for fault in ["lost@1.5", "frozen@1.5", "torn@1.5", "dark@1.5"] {
        let folder = tempfile::tempdir().expect("a folder");
        let run = folder.path().join("run");
        let output = demo(&run, &["--set", "mu=0.6", "--set", "longest_s=3", "--fault", fault]);
        assert!(output.status.success(), "{fault}: {}", printed(&output));
        assert!(printed(&output).contains("time until it broke off"), "{fault}: {}", printed(&output));
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
fn invalid_options_exit_with_2_and_create_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("settings.toml");
    let run = folder.path().join("run");
    for (text, named) in [
        ("[grip]\nmost_n = nan\n", "grip.most_n"),
        ("[grip]\nstart_n = 200.0\n", "grip.start_n"),
        ("[screw]\nrate_rad_per_s = -inf\n", "screw.rate_rad_per_s"),
        ("[grip]\nmost = 5\n", "most_n"),
        ("[on_slip]\nstep_n = -10.0\n", "on_slip.step_n: expected a number above 0, got -10"),
    ] {
        fs::write(&file, text).expect("written");
        let output = demo(&run, &["--settings", file.to_str().expect("UTF-8")]);
        assert_eq!(output.status.code(), Some(2), "{text}: {}", printed(&output));
        assert!(printed(&output).contains(named), "{text}: {}", printed(&output));
    }
    for args in [
        &["--set", "mu=-1"][..],
        &["--fault", "fire@2"],
        &["--set", "force=3"],
        &["--controller", "hope"],
        &["--fault", "lost@2:right"],
        &["--seed", "3", "--set", "seed=5"],
        &["--set", "fingers=2"],
    ] {
        assert_eq!(demo(&run, args).status.code(), Some(2), "{args:?}");
    }
    let output = slipbound(&["trials", "--mu", "0.3", "--set", "mu=0.5"]);
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
    assert!(printed(&output).contains("--set mu=0.5: expected --mu for mu"), "{}", printed(&output));
    fs::create_dir(&run).expect("made");
    fs::write(run.join("mine.txt"), "mine").expect("written");
    let output = demo(&run, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
    assert!(printed(&output).contains("run"), "{}", printed(&output));
}

/// The jaws of the simulated hand press with at most 80 N.
#[test]
fn a_run_that_a_fault_ends_is_a_row_of_the_table_of_trials() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("settings.toml");
    let text = "[grip]\nstart_n = 110.0\nmost_n = 120.0\n[lift]\nlift_mm = 0.0\nhold_ns = 2500000000\n";
    fs::write(&file, text).expect("written");
    let settings = file.to_str().expect("UTF-8");
    let what = ["trials", "--task", "lift", "--controller", "constant", "--mu", "0.9", "--fingers", "1"];
    let output = slipbound(&[&what[..], &["--seeds", "2", "--settings", settings]].concat());
    let told = printed(&output);
    assert!(told.contains("| lift | task | 0.9 | constant | 1 | 0 of 2 |"), "{told}");
}

/// The wrist is silent for good; the gripper still accepts a force.
#[test]
fn the_blind_force_with_which_a_demo_is_left_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, run) = (folder.path().join("settings.toml"), folder.path().join("run"));
    fs::write(&file, "[grip]\nblind_force_n = 55.0\n").expect("written");
    let settings = ["--settings", file.to_str().expect("UTF-8")];
    let fault = ["--task", "lift", "--emulated", "wsg50", "--wrist-fault", "stall=60000@2500"];
    let output = demo(&run, &[&fault[..], &settings].concat());
    let told = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    let left = "the loop was left: the grip rises to the blind force of 55.0 N";
    let events = fs::read_to_string(run.join("events.jsonl")).expect("events");
    assert!(told.contains(left) && events.contains(left), "{told}");
    let largest = told.lines().find(|line| line.contains("largest force commanded")).expect("a row");
    assert!(largest.contains("55.0 N"), "{told}");
}

/// Every file of a folder and its bytes, by its name.
fn files(folder: &Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let name = entry.file_name().into_string().expect("UTF-8");
        if entry.path().is_dir() {
            found.extend(files(&entry.path()).into_iter().map(|(file, bytes)| (format!("{name}/{file}"), bytes)));
        } else {
            found.insert(name, fs::read(entry.path()).expect("reads"));
        }
    }
    found
}

/// A torn frame is among them.
#[test]
fn a_run_folder_and_a_recording_hold_the_same_and_each_becomes_the_other() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    let task = ["--task", "lift", "--set", "longest_s=1.2", "--fault", "torn@1.1"];
    let kept = demo(Path::new(&path("run")), &[&task[..], &["--record"]].concat());
    let record = format!("--record={}", path("direct.mcap"));
    let direct = demo(Path::new(&path("beside")), &[&task[..], &[&record]].concat());
    // Every frame from 1.1 s on is torn, so the work does not begin any more.
    assert_eq!(
        (kept.status.code(), direct.status.code()),
        (Some(1), Some(1)),
        "{}{}",
        printed(&kept),
        printed(&direct)
    );
    let convert = |from: &str, to: &str| {
        let ended = slipbound(&["convert", &path(from), "-o", &path(to)]);
        assert_eq!(ended.status.code(), Some(0), "{}", printed(&ended));
    };
    convert("run", "run.mcap");
    convert("run.mcap", "back");
    convert("direct.mcap", "unpacked");
    convert("unpacked", "again.mcap");
    convert("again.mcap", "unpacked again");
    let [run, back, unpacked, unpacked_again] =
        ["run", "back", "unpacked", "unpacked again"].map(|name| files(Path::new(&path(name))));
    for (name, bytes) in &run {
        assert!(back.get(name) == Some(bytes), "{name} did not come back");
    }
    let more: Vec<&String> = back.keys().filter(|name| !run.contains_key(*name)).collect();
    assert_eq!(more, ["left.frames.jsonl"]);
    // The recording in one file equals the folder, except for what comes at the end.
    let frames_count = run.keys().filter(|name| name.starts_with("left/")).count();
    assert!(frames_count > 25, "{frames_count}");
    for (name, bytes) in run.iter().filter(|(name, _)| !name.ends_with(".html") && !name.ends_with(".png")) {
        let theirs = unpacked.get(name).unwrap_or_else(|| panic!("no {name}"));
        assert!(if name == "events.jsonl" { bytes.starts_with(theirs) } else { theirs == bytes }, "{name} differs");
    }
    assert!(unpacked.contains_key("left.report.jsonl") && unpacked.contains_key("left.frames.jsonl"));
    assert!(unpacked == unpacked_again, "there and back from a recording");
    assert!(String::from_utf8_lossy(&unpacked["left.frames.jsonl"]).contains("\"torn\":\""));
    for folder in ["back", "unpacked"] {
        let again = slipbound(&["replay", &path(folder)]);
        assert!(again.status.success(), "{folder}: {}", printed(&again));
    }
    // Why a run broke off is in both.
    let broken = ["--task", "lift", "--emulated", "wsg50", "--gripper-fault", "fast-stop@2500"];
    let record = format!("--record={}", path("broken.mcap"));
    let ended = demo(Path::new(&path("broken")), &[&broken[..], &[&record]].concat());
    assert_eq!(ended.status.code(), Some(1), "{}", printed(&ended));
    convert("broken.mcap", "broken unpacked");
    let events = |folder: &str| files(Path::new(&path(folder))).remove("events.jsonl").expect("events");
    let (kept, recorded) = (events("broken"), events("broken unpacked"));
    assert!(kept.starts_with(&recorded) && String::from_utf8_lossy(&recorded).contains("waited 10 s"));
    // Neither is overwritten, and no name leads out of the folder.
    let refused = slipbound(&["convert", &path("run.mcap"), "-o", &path("run")]);
    assert_eq!(refused.status.code(), Some(2), "{}", printed(&refused));
    let bytes = fs::read(path("direct.mcap")).expect("reads");
    let at = bytes.windows(13).position(|name| name == b"settings.toml").expect("an attachment");
    let mut outside = bytes;
    outside[at..at + 13].copy_from_slice(b"../outside.js");
    // After the name: media type, data, checksum; 0 stands for none.
    let number =
        |at: usize, bytes: usize| outside[at..at + bytes].iter().rev().fold(0, |n, &byte| n << 8 | usize::from(byte));
    let data = at + 13 + 4 + number(at + 13, 4);
    let checksum = data + 8 + number(data, 8);
    outside[checksum..checksum + 4].fill(0);
    fs::write(path("outside.mcap"), &outside).expect("writes");
    let refused = slipbound(&["convert", &path("outside.mcap"), "-o", &path("inside")]);
    assert_eq!(refused.status.code(), Some(1), "{}", printed(&refused));
    assert!(
        printed(&refused).contains("expected names of files in one folder, got `../outside.js`"),
        "{}",
        printed(&refused)
    );
    assert!(!Path::new(&path("outside.js")).exists());
}
