//! The tasks through the driver of a WSG-50 and its emulator: the same endings as without, in lock-step and over
//! sockets; what goes wrong with the gripper; what `run` and `hold` refuse.

mod program;

use program::{command, printed, slipbound, start_in};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Output, Stdio};

/// With images of the size that the released frames have: a third of the time goes.
fn demo(folder: &Path, args: &[&str]) -> Output {
    let small = ["demo", "--fingers", "1", "--set", "height_px=320"];
    slipbound(&[&small, &["-o", folder.to_str().expect("UTF-8")][..], args].concat())
}

/// The value of a row of the results.
fn row(told: &str, name: &str) -> String {
    let line = told.lines().find_map(|line| line.trim().strip_prefix(name));
    line.unwrap_or_else(|| panic!("no row {name}: {told}")).split_whitespace().next().expect("a value").into()
}

/// A task through the driver ends as without: these rows are the same, and the number in the row `near` is within 5 %.
fn ends_through_a_driver_as_without(task: &str, mu: &str, same: [&str; 2], near: Option<&str>) {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = |name: &str, emulated: &[&str]| {
        let folder = scratch.path().join(name);
        let output = demo(&folder, &[&["--task", task, "--set", mu], emulated].concat());
        assert!(output.status.success(), "{task} {name}: {}", printed(&output));
        (folder, printed(&output))
    };
    let (_, without) = run("without", &[]);
    let (folder, with) = run("wsg50", &["--emulated", "wsg50"]);
    for name in same {
        assert_eq!(row(&without, name), row(&with, name), "{task}: {name}\n{without}\n{with}");
    }
    if let Some(name) = near {
        let value = |told: &str| row(told, name).parse::<f64>().expect("a number");
        let (a, b) = (value(&without), value(&with));
        assert!((a - b).abs() <= 0.05 * a, "{task}: {name}: {a} and {b}");
    }
    let events = fs::read_to_string(folder.join("events.jsonl")).expect("events");
    assert!(events.contains("force is changed by setting the force limit alone"), "{task}: {events}");
}

/// At mu 0.9 it would strain the gel beyond the linear range of the simulator, and its markers with it.
#[test]
fn screwing_through_a_driver_ends_as_it_does_without() {
    let torque = Some("largest torque on the cap");
    ends_through_a_driver_as_without("screw", "mu=0.6", ["ended", "largest force commanded"], torque);
}

#[test]
fn unscrewing_through_a_driver_ends_as_it_does_without() {
    ends_through_a_driver_as_without("unscrew", "mu=0.9", ["ended", "largest force commanded"], None);
}

#[test]
fn lifting_through_a_driver_ends_as_it_does_without() {
    ends_through_a_driver_as_without("lift", "mu=0.9", ["ended", "dropped"], Some("mass at the end"));
}

#[test]
fn a_link_cut_in_the_middle_is_waited_for_and_the_recording_replays() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run");
    let emulated = "wsg50?acknowledge_own_fast_stop=true";
    let args =
        ["--task", "unscrew", "--set", "mu=0.9", "--emulated", emulated, "--gripper-fault", "close@2500", "--record"];
    let output = demo(&run, &args);
    assert!(output.status.success(), "{}", printed(&output));
    assert_eq!(row(&printed(&output), "ended"), "Opened");
    for said in ["the link is lost", "the wrist pauses, the grip stays", "fast stop acknowledged", "going on"] {
        assert!(printed(&output).contains(said), "no `{said}`: {}", printed(&output));
    }
    let frames = fs::read_to_string(run.join("frames.jsonl")).expect("frames");
    assert!(frames.lines().filter(|line| line.contains("\"waiting\":true")).count() > 5);
    let again = slipbound(&["replay", run.to_str().expect("UTF-8")]);
    assert!(again.status.success() && printed(&again).contains("the same"), "{}", printed(&again));
}

/// The bottle is filled on while the wrist is not heard: the grip still responds.
#[test]
fn an_unresponsive_wrist_does_not_keep_the_grip_from_answering_slip() {
    let scratch = tempfile::tempdir().expect("a folder");
    let fault = ["--task", "lift", "--emulated", "wsg50", "--wrist-fault", "stall=5000@3000"];
    let output = demo(&scratch.path().join("run"), &fault);
    assert!(output.status.success(), "{}", printed(&output));
    assert!(printed(&output).contains("wrist: line://"), "{}", printed(&output));
    for (name, value) in [("ended", "Held"), ("dropped", "no"), ("slid in the fingers", "0.00")] {
        assert_eq!(row(&printed(&output), name), value, "{name}: {}", printed(&output));
    }
}

/// The two unconfirmed points of a real WSG-50 at their worst: a new limit has no effect while it holds, and a second
/// grasp is refused. That must not be taken for a tight cap.
#[test]
fn a_gripper_that_does_not_press_harder_ends_the_task_and_no_cap_is_called_tight() {
    let scratch = tempfile::tempdir().expect("a folder");
    for (fault, said) in [("fixed-limit", "measured 10.0 N for too long"), ("refuse-force@2500", "out of range")] {
        let run = scratch.path().join(fault);
        let output = demo(&run, &["--set", "mu=0.9", "--emulated", "wsg50", "--gripper-fault", fault]);
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains(said) && printed(&output).contains("waited 10 s"), "{}", printed(&output));
        assert_eq!(row(&printed(&output), "ended"), "gripper:", "{}", printed(&output));
        assert_eq!(row(&printed(&output), "slid in the fingers"), "0.00", "{}", printed(&output));
    }
}

/// As in real time: in the table and the events as in the exit code.
#[test]
fn what_is_held_to_the_end_of_its_time_with_a_fault_has_failed() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (settings, run) = (scratch.path().join("hold.toml"), scratch.path().join("run"));
    fs::write(&settings, "[lift]\nlift_mm = 0.0\nhold_ns = 4000000000\n").expect("written");
    let settings = ["--settings", settings.to_str().expect("UTF-8"), "--controller", "constant"];
    let weak = ["--task", "lift", "--emulated", "wsg50", "--gripper-fault", "gain=0.6"];
    let output = demo(&run, &[&weak[..], &settings].concat());
    let told = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    let ended = told.lines().find(|line| line.starts_with("  ended ")).expect("a row");
    assert!(ended.ends_with("gripper: expected 10.0 N per finger, measured 6.0 N for too long: missed"), "{told}");
    let events = fs::read_to_string(run.join("events.jsonl")).expect("events");
    for text in [&told, &events] {
        assert!(!text.contains("held to the end") && !text.contains("waited"), "{text}");
    }
}

#[test]
fn a_lower_force_that_is_not_permitted_is_told_once_and_the_task_goes_on() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run");
    let output = demo(&run, &["--task", "lift", "--controller", "margin", "--emulated", "wsg50"]);
    assert!(output.status.success(), "{}", printed(&output));
    assert_eq!(row(&printed(&output), "ended"), "Held");
    let refused = printed(&output).lines().filter(|line| line.contains("a lower force was asked for")).count();
    assert_eq!(refused, 1, "{}", printed(&output));
    assert!(!printed(&output).contains("the wrist pauses"), "that is no trouble: {}", printed(&output));
}

/// A Robotiq presses with 20 N and more and does not say how hard; the line protocol says everything.
#[test]
fn a_cap_is_unscrewed_through_the_drivers_of_robotiq_and_line_too() {
    let scratch = tempfile::tempdir().expect("a folder");
    for (name, said) in [("robotiq-rtu", "presses with 20 to 235 N per finger"), ("line", "Opened")] {
        let run = scratch.path().join(name);
        let output = demo(&run, &["--task", "unscrew", "--set", "mu=0.6", "--emulated", name]);
        assert!(output.status.success(), "{name}: {}", printed(&output));
        assert_eq!(row(&printed(&output), "ended"), "Opened", "{name}");
        assert!(printed(&output).contains(said), "{name}: {}", printed(&output));
    }
}

#[test]
fn over_sockets_and_in_real_time_a_cap_is_opened_too_and_that_replays() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run");
    let args = ["--task", "unscrew", "--set", "mu=0.9", "--emulated", "wsg50", "--sockets", "--record"];
    let output = demo(&run, &args);
    assert!(output.status.success(), "{}", printed(&output));
    assert_eq!(row(&printed(&output), "ended"), "Opened");
    check_replay(&run);
}

/// A lowering that the gripper refused, and a fault, are in the recording, because the controller goes on from there.
#[test]
fn a_run_with_refused_forces_and_a_lost_link_replays() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run");
    let emulated = ["--emulated", "wsg50?acknowledge_own_fast_stop=true", "--gripper-fault", "close@3000"];
    let args = ["--task", "unscrew", "--set", "mu=0.9", "--controller", "margin", "--record"];
    let output = demo(&run, &[&args[..], &emulated].concat());
    assert!(output.status.success(), "{}", printed(&output));
    let lines = fs::read_to_string(run.join("reports.jsonl")).expect("reports");
    for key in ["\"refused_lowering\":true", "\"on_fault\":true"] {
        assert!(lines.lines().filter(|line| line.contains(key)).count() > 5, "{key}: {}", printed(&output));
    }
    check_replay(&run);
}

fn check_replay(run: &Path) {
    let again = slipbound(&["replay", run.to_str().expect("UTF-8")]);
    assert!(again.status.success(), "{}", printed(&again));
    assert!(printed(&again).contains("every report and command the same"), "{}", printed(&again));
}

/// `hold` against an emulator in a process of its own: its output replays without either.
#[test]
fn a_hold_on_emulated_hardware_replays_from_its_folder_alone() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (seen, held) = (scratch.path().join("seen"), scratch.path().join("held"));
    let made = demo(&seen, &["--task", "lift", "--set", "longest_s=4", "--record"]);
    assert!(seen.join("left").exists(), "{}", printed(&made));
    let mut emulator = command(&["emulate", "wsg50", "--width", "66", "--weight", "8", "--mu", "0.6"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("starts");
    let mut line = String::new();
    BufReader::new(emulator.stdout.as_mut().expect("piped")).read_line(&mut line).expect("its address");
    let gripper = format!("{}?part_width_mm=66&lowering=allow", line.trim());
    let output = command(&["hold"])
        .arg(seen.join("left"))
        .arg("--sensor")
        .arg(seen.join("left.sensor.toml"))
        .args(["--gripper", &gripper, "--for-s", "1", "--record", "-o"])
        .arg(&held)
        .output()
        .expect("runs");
    emulator.kill().and_then(|()| emulator.wait()).expect("ends");
    assert!(output.status.success(), "{}", printed(&output));
    fs::remove_dir_all(&seen).expect("removed");
    check_replay(&held);
}

#[test]
fn what_run_and_hold_cannot_do_is_said_before_anything_moves() {
    let scratch = tempfile::tempdir().expect("a folder");
    let folder = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    let empty = folder("empty");
    fs::create_dir(&empty).expect("made");
    let missing = folder("missing");
    for (args, code, said) in [
        (vec!["hold", &missing, "--gripper", "dry"], 2, "--sensor"),
        (vec!["hold", &missing, "--gripper", "dry", "--sensor", "gelslim"], 2, "missing"),
        (vec!["hold", &empty, "--gripper", "dry", "--sensor", "gelslim"], 2, "empty"),
        (vec!["hold", &empty, "--gripper", "dry", "--sensor", "gelslim", "--for-s", "nan"], 2, "--for-s"),
        (vec!["run", "lift", &empty, "--gripper", "dry", "--sensor", "gelslim"], 2, "--wrist"),
        (vec!["run", "juggle", &empty, "--gripper", "dry", "--sensor", "gelslim"], 2, "juggle"),
        (
            vec!["run", "place", &empty, "--gripper", "wsg50://h:1", "--wrist", "dry", "--sensor", "gelslim"],
            2,
            "lowering",
        ),
        (vec!["demo", "--task", "place", "--emulated", "wsg50"], 2, "lowering"),
        (vec!["demo", "--emulated", "hand"], 2, "wsg50"),
        (vec!["demo", "--gripper-fault", "close@3"], 2, "--emulated"),
    ] {
        let output = slipbound(&args);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", printed(&output));
        assert!(printed(&output).contains(said), "{args:?}: {}", printed(&output));
    }
}

/// A run that did not begin, or ended empty, is not a success: exit code 1 and what was missing.
#[test]
fn work_that_never_began_and_hands_that_end_empty_are_failures() {
    let scratch = tempfile::tempdir().expect("a folder");
    for (name, args, said) in [
        ("blind", &["--set", "longest_s=4", "--fault", "lost@0.8"][..], "the work never began: the fingers are blind"),
        ("empty", &["--emulated", "wsg50", "--gripper-fault", "lose-part@0"], "nothing was found between the fingers"),
        (
            "idle",
            &["--emulated", "wsg50", "--gripper-fault", "idle=10.5"],
            "nothing was found between the fingers; wsg50://emulator:1: a lower force was asked for while holding (80 N to 10 N",
        ),
        (
            "lost",
            &["--emulated", "wsg50", "--gripper-fault", "lose-part@2500"],
            "the gripper reports that the object is lost",
        ),
    ] {
        let output = demo(&scratch.path().join(name), &[&["--task", "lift"], args].concat());
        assert_eq!(output.status.code(), Some(1), "{name}: {}", printed(&output));
        assert!(printed(&output).contains(said), "{name}: {}", printed(&output));
        let told = printed(&output);
        let ended = told.lines().find(|line| line.trim().starts_with("ended "));
        assert!(ended.is_some_and(|row| row.ends_with(": missed")), "{name}: {told}");
        assert!(scratch.path().join(name).join("report.html").exists(), "{name}");
    }
    // Nobody reads the results.
    let args = ["demo", "--task", "lift", "--emulated", "wsg50", "--gripper-fault", "lose-part@2500", "-o", "unread"];
    let mut child = start_in(scratch.path(), &args);
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("ends");
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(printed(&output).contains("the gripper reports that the object is lost"), "{}", printed(&output));
    // A recording in which the hand stays open: `dry` holds at once, the fingers feel nothing.
    let open = scratch.path().join("open");
    let made = demo(&open, &["--task", "lift", "--set", "longest_s=0.6", "--record"]);
    assert!(open.join("left").exists(), "{}", printed(&made));
    // The same frames twice: enough for the rest frame, and some more.
    for i in 0..18 {
        let frame = |i: usize| open.join("left").join(format!("{i:06}.jpg"));
        fs::copy(frame(i), frame(18 + i)).expect("eighteen frames before the hand closes");
    }
    let sensor = open.join("left.sensor.toml");
    let hold = |rate_hz: &str| {
        let from = std::time::Instant::now();
        let (run, left) = (scratch.path().join(rate_hz), open.join("left"));
        let args = [
            "--sensor",
            sensor.to_str().expect("UTF-8"),
            "--gripper",
            "dry",
            "--rate-hz",
            rate_hz,
            "-o",
            run.to_str().expect("UTF-8"),
        ];
        let output = slipbound(&[&["hold", left.to_str().expect("UTF-8")], &args[..]].concat());
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains("the work never began: "), "{}", printed(&output));
        from.elapsed().as_secs_f64()
    };
    // Thirty-six frames: it plays at the requested rate, below 10 Hz too.
    let (fast_s, slow_s) = (hold("30"), hold("5"));
    assert!(slow_s > 6.5, "{fast_s} s and {slow_s} s");
}

/// A lift of four seconds, kept frame by frame: the hand is open at first, then it holds. Its folder and sensor file.
fn seen(scratch: &Path) -> (String, String) {
    let seen = scratch.join("seen");
    let made = demo(&seen, &["--task", "lift", "--set", "longest_s=4", "--record"]);
    assert!(seen.join("left").exists(), "{}", printed(&made));
    let text = |name: &str| seen.join(name).to_str().expect("UTF-8").to_owned();
    (text("left"), text("left.sensor.toml"))
}

/// Terminal and page have one duration, and no event is older than the one before.
fn check_times(output: &Output, run: &Path) {
    let page = fs::read_to_string(run.join("report.html")).expect("a page");
    let fact = page.split("<ul class=\"facts\">\n<li><b>").nth(1).and_then(|rest| rest.split_once("</li>"));
    let (lasted, until) = fact.and_then(|(fact, _)| fact.split_once("</b> ")).expect("a duration");
    let row = format!("  {:<28}{lasted}", format!("time {until}"));
    assert!(printed(output).contains(&row), "expected `{row}` in {}", printed(output));
    let events = fs::read_to_string(run.join("events.jsonl")).expect("events");
    let time_ns = |line: &str| serde_json::from_str::<serde_json::Value>(line).expect("JSON")["time_ns"].as_u64();
    assert!(events.lines().map(time_ns).is_sorted(), "{events}");
}

#[test]
fn a_task_that_outlives_its_source_has_failed_and_a_hold_has_not() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (left, sensor) = seen(scratch.path());
    let folder = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    let common = [&left, "--sensor", &sensor, "--gripper", "dry", "--rate-hz", "30"];
    let (lift, hold) = (folder("lift"), folder("hold"));
    let output = slipbound(&[&["run", "lift"], &common[..], &["--wrist", "dry", "-o", &lift]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(printed(&output).contains("the source ended before the task did: lift was still "), "{}", printed(&output));
    let output = slipbound(&[&["hold"], &common[..], &["-o", &hold]].concat());
    assert!(output.status.success(), "{}", printed(&output));
    check_times(&output, Path::new(&hold));
    let frames_count = fs::read_dir(&left).expect("a folder").count();
    assert!(printed(&output).contains(&format!("left: {frames_count} frames, 0 torn\n")), "{}", printed(&output));

    // What is lost on the way is told by count and by the exit code.
    let damaged = scratch.path().join("damaged");
    fs::create_dir(&damaged).expect("made");
    for entry in fs::read_dir(&left).expect("a folder").flatten() {
        fs::copy(entry.path(), damaged.join(entry.file_name())).expect("copied");
    }
    for i in [70, 80, 81] {
        fs::write(damaged.join(format!("{i:06}.jpg")), b"torn").expect("written");
    }
    let mut small = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut small, 80);
    encoder.encode(&[128; 64 * 48], 64, 48, jpeg_encoder::ColorType::Luma).expect("encodes");
    fs::write(damaged.join("000090.jpg"), small).expect("written");
    let damaged = damaged.to_str().expect("UTF-8");
    let output = slipbound(&[&["hold", damaged], &common[1..], &["-o", &folder("held")]].concat());
    assert_eq!(output.status.code(), Some(3), "{}", printed(&output));
    let said = format!("left: {} frames, 3 torn, 1 of another size than the first\n", frames_count - 3);
    assert!(printed(&output).contains(&said), "no `{said}` in {}", printed(&output));

    // A gripper that is not there leaves no files behind: the same command again is not refused for its folder.
    let gone = folder("gone");
    for _ in 0..2 {
        let nobody = [&left, "--sensor", &sensor, "--gripper", "wsg50://127.0.0.1:1", "-o", &gone];
        let output = slipbound(&[&["hold"], &nobody[..]].concat());
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains("cannot connect"), "{}", printed(&output));
        assert!(!Path::new(&gone).exists());
    }
    // A folder in use is reported before the gripper is searched.
    let nobody = [&left, "--sensor", &sensor, "--gripper", "wsg50://127.0.0.1:1", "-o", &hold];
    let output = slipbound(&[&["hold"], &nobody[..]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));

    // Too few frames for the rest frame: how many, of how many.
    let few = scratch.path().join("few");
    fs::create_dir(&few).expect("made");
    for i in 0..14 {
        let name = format!("{i:06}.jpg");
        fs::copy(Path::new(&left).join(&name), few.join(&name)).expect("copied");
    }
    let few = few.to_str().expect("UTF-8");
    let output = slipbound(&[&["hold", few], &common[1..], &["-o", &folder("none")]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    let said = "expected 20 bright frames of the open hand to begin with, got 14 frames of ";
    assert!(printed(&output).contains(said), "{}", printed(&output));
}

/// Names that lead out of the folder, or of which two make one file, are refused before anything is written.
#[test]
fn a_finger_is_not_named_out_of_its_folder() {
    let scratch = tempfile::tempdir().expect("a folder");
    let empty = scratch.path().join("empty");
    fs::create_dir(&empty).expect("made");
    let (empty, hand, run) =
        (empty.to_str().expect("UTF-8"), scratch.path().join("hand.toml"), scratch.path().join("run"));
    for name in ["../x", "a/b", "d\u{e4}umen"] {
        let finger = format!("[[fingers]]\nname = \"{name}\"\nserial = \"A\"\nside = \"left\"\nsensor = \"gelslim\"\n");
        fs::write(&hand, format!("name = \"one\"\n{finger}")).expect("written");
        let (hand, run) = (hand.to_str().expect("UTF-8"), run.to_str().expect("UTF-8"));
        let output = slipbound(&["hold", empty, "--hand", hand, "--gripper", "dry", "--record", "-o", run]);
        assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
        assert!(
            printed(&output).contains("hand.toml: fingers[0].name: expected 1 to 64 of A-Z a-z 0-9 _ -"),
            "{}",
            printed(&output)
        );
    }
    assert!(!run.exists());
}

/// A replay with fewer lines than were recorded is not the same, and reports how far it got.
#[test]
fn a_run_whose_lines_are_cut_is_not_called_the_same() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run");
    demo(&run, &["--task", "lift", "--set", "longest_s=2", "--record"]);
    let read = |name: &str| fs::read_to_string(run.join(name)).expect("lines");
    let (reports, frames) = (read("reports.jsonl"), read("frames.jsonl"));
    let count = reports.lines().count();
    let first = |text: &str, lines: usize| text.split_inclusive('\n').take(lines).collect::<String>();
    let replay = |reports: &str, frames: &str| {
        fs::write(run.join("reports.jsonl"), reports).expect("written");
        fs::write(run.join("frames.jsonl"), frames).expect("written");
        let output = slipbound(&["replay", run.to_str().expect("UTF-8")]);
        (output.status.code(), printed(&output))
    };
    let (code, said) = replay(&reports, &frames);
    assert_eq!(code, Some(0), "{said}");
    let less = count - 5;
    for (reports, frames, expected) in [
        (
            first(&reports, less),
            frames.clone(),
            format!("reports.jsonl: ends after {less} cycles, which are the same; 5 more"),
        ),
        (
            reports[..reports.len() - 9].to_owned(),
            frames.clone(),
            format!("reports.jsonl: ends after {} cycles, which are the same; 1 more", count - 1),
        ),
        (
            reports.clone(),
            first(&frames, frames.lines().count() - 5),
            format!(
                "frames.jsonl: ends before cycle {less} of {count} in reports.jsonl; the {less} before it are the same"
            ),
        ),
    ] {
        let (code, said) = replay(&reports, &frames);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(&expected), "no `{expected}` in {said}");
    }
}

/// A source that gives pixels only, like a camera without compression: they are kept without loss.
#[test]
fn frames_that_come_as_pixels_are_kept_and_replay() {
    use slipbound::port::{FrameBuffer, FrameSource as _, Next};
    use slipbound_rig::container::{Recorder, TappedSource};
    struct Pixels(Box<dyn slipbound::port::FrameSource + Send>);
    impl slipbound::port::FrameSource for Pixels {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, slipbound::port::SourceError> {
            let next = self.0.next(into)?;
            into.encoded.clear();
            Ok(next)
        }
    }
    let scratch = tempfile::tempdir().expect("a folder");
    let (left, sensor) = seen(scratch.path());
    let path = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    let (raw, held) = (path("raw.mcap"), path("held"));
    let recorder = Recorder::create(Path::new(&raw), &["left".into()], false).expect("creates");
    let pixels = Pixels(slipbound_rig::source::open(&left).expect("opens"));
    let mut tapped = TappedSource::new(pixels, 0, recorder.inlet(), true);
    let mut frame = FrameBuffer::default();
    while tapped.next(&mut frame).expect("goes on") != Next::End {}
    assert_eq!(recorder.finish().expect("closes").lost_count, 0);
    let more = ["--sensor", &sensor, "--gripper", "dry", "--rate-hz", "30", "--record", "-o", &held];
    let output = slipbound(&[&["hold", &raw], &more[..]].concat());
    assert!(output.status.success(), "{}", printed(&output));
    check_replay(Path::new(&held));
}
