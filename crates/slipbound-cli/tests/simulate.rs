//! The simulator from outside: scenes listed, recorded, replayed and watched live.

mod program;

use program::{Ended, PROGRAM, slipbound_in};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn run(folder: &Path, arguments: &[&str]) -> Ended {
    Ended::of(slipbound_in(folder, arguments))
}

/// The frames of a report, without their times and what needs them, speeds: images in a folder have none.
fn timeless(path: PathBuf) -> Vec<Value> {
    let text = fs::read_to_string(path).expect("a report");
    let lines = text.lines().skip(1).map(|line| {
        let mut line: Value = serde_json::from_str(line).expect("JSON");
        let time_ns = line.as_object_mut().expect("an object").remove("time_ns").expect("a time, or null");
        if let Some(evidence) = line["evidence"].as_object_mut() {
            for key in ["slide_pitch_per_s", "slide_mm_per_s"] {
                let speed = evidence.remove(key).expect("a speed, or null");
                assert!(speed.is_null() || !time_ns.is_null(), "a speed without a time: {speed}");
            }
        }
        line
    });
    lines.collect()
}

const SCENE: &str = "ramp?grid=fast&object=tape_roll&force_n=15&ramp_s=0.4&seed=4";

#[test]
fn a_recorded_scene_is_judged_as_the_live_one() {
    let dir = tempfile::tempdir().expect("a folder");
    let live = run(dir.path(), &["watch", &format!("sim:{SCENE}"), "--json", "live.json", "--markers"]);
    assert_eq!((live.code, live.err.as_str()), (Some(0), ""), "{live:?}");
    let made = run(dir.path(), &["simulate", SCENE, "-o", "run"]);
    assert_eq!(made.code, Some(0), "{made:?}");
    assert!(made.out.contains("gross slip at"), "{made:?}");
    let sensor = ["--sensor", "run/sensor.toml", "--json", "replayed.json", "--markers"];
    let replayed = run(dir.path(), &[&["watch", "run"], &sensor[..]].concat());
    assert_eq!((replayed.code, replayed.err.as_str()), (Some(0), ""), "{replayed:?}");
    let (live_lines, lines) = (timeless(dir.path().join("live.json")), timeless(dir.path().join("replayed.json")));
    assert!(lines.len() > 30, "{} frames", lines.len());
    assert!(live_lines == lines, "verdicts differ");
    assert!(lines[2]["state"] == "no_contact", "nothing touches at first: {}", lines[2]);
    // Times come from the world: those of the live frames are known, a thirtieth of a second apart.
    let text = fs::read_to_string(dir.path().join("live.json")).expect("a report");
    assert!(text.lines().nth(4).is_some_and(|line| line.contains(r#""time_ns":100000000"#)), "{text}");
    assert!(text.lines().next().is_some_and(|line| line.contains(r#""clock":"device""#)));
    let rest = run(dir.path(), &[&["watch", "run", "--rest", "run/rest/rest.jpg"], &sensor[..2]].concat());
    assert_eq!(rest.code, Some(0), "{rest:?}");
}

/// Under no load gross slip is not looked for: what a scene says of it must not be taken for its absence.
#[test]
fn a_scene_without_load_does_not_claim_that_nothing_slid() {
    let dir = tempfile::tempdir().expect("a folder");
    let short = "grid=fast&rest_frames=1&press_s=0.1&settle_s=0.05";
    for (scene, expected) in [
        ("vibration?hold_s=0.2&distance_mm=2", "no load, so gross slip is not looked for"),
        ("shear?distance_mm=0.2", "no gross slip, so no load fraction"),
    ] {
        let folder = &scene[..5];
        let made = run(dir.path(), &["simulate", &format!("{scene}&{short}"), "-o", folder]);
        assert!(made.code == Some(0) && made.out.contains(expected), "{scene}: {made:?}");
    }
}

#[test]
fn contact_is_seen_in_a_scene() {
    let dir = tempfile::tempdir().expect("a folder");
    let ended = run(dir.path(), &["watch", &format!("sim:{SCENE}"), "--json", "live.json"]);
    let lines = timeless(dir.path().join("live.json"));
    assert!(lines.iter().any(|line| line["state"] != "no_contact"), "nothing is seen: {}", ended.out);
}

#[test]
fn a_recording_is_made_again_from_its_scene_file() {
    let dir = tempfile::tempdir().expect("a folder");
    let settings = ["--set", "grid=fast", "--set", "hold_s=0.1", "--seed", "12"];
    assert_eq!(run(dir.path(), &[&["simulate", "press", "-o", "a"], &settings[..]].concat()).code, Some(0));
    assert_eq!(run(dir.path(), &["simulate", "a/scene.toml", "-o", "b"]).code, Some(0));
    for name in ["frame_000020.jpg", "truth.jsonl", "scene.toml", "sensor.toml", "rest/rest.jpg"] {
        let bytes = |folder: &str| fs::read(dir.path().join(folder).join(name)).expect("a file");
        assert!(bytes("a") == bytes("b"), "{name} differs");
    }
}

#[test]
fn torn_frames_of_a_scene_are_told() {
    let dir = tempfile::tempdir().expect("a folder");
    let scene = "sim:press?grid=fast&hold_s=0.3&seed=2&fault=torn=0.3,late=0.2";
    let ended = run(dir.path(), &["watch", scene]);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.err.contains("is torn: JPEG cut off"), "{ended:?}");
}

#[test]
fn scenes_and_objects_are_listed() {
    let listed = run(Path::new("."), &["scenes"]);
    assert_eq!(listed.code, Some(0));
    for word in ["ramp", "quiet_grip_steps", "crayons_box", "bottle_cap", "CUT DOWN", "force_n", "estimates"] {
        assert!(listed.out.contains(word), "no {word} in {}", listed.out);
    }
}

#[test]
fn an_invalid_scene_exits_with_2_and_creates_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    for (arguments, said) in [
        (
            &["simulate", "ramp", "--set", "force_n=-2", "-o", "x"][..],
            "force_n: expected a number from 0.1 to 120, got -2",
        ),
        (&["simulate", "ramp", "--set", "mu=0", "-o", "x"], "mu: expected a number from 0.05 to 2, or `object`, got 0"),
        (&["simulate", "ramp", "--seed", "3", "--set", "seed=5", "-o", "x"], "--set seed=5: expected --seed"),
        (&["simulate", "rampe", "-o", "x"], "scene: expected one of press, "),
        (&["simulate", "missing.toml", "-o", "x"], "missing.toml: expected a scene file"),
        (&["simulate", "press?object=crayons_box&turn_deg=90", "-o", "x"], "the pad less a cell all round"),
        (&["watch", "sim:press?colour=red"], "parameter of the scene press: expected one of seed, object, "),
    ] {
        let ended = run(dir.path(), arguments);
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(ended.err.contains(said), "no `{said}` in {ended:?}");
    }
    assert!(!dir.path().join("x").exists(), "nothing was written");
}

/// Foreign files that are long, or never end, are not read to their end: 400 MB of memory is enough.
#[cfg(target_os = "linux")]
#[test]
fn a_long_file_of_another_kind_is_refused_without_being_read() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("scene.toml"), "a = 1\n".repeat(1 << 20)).expect("written");
    let limited = "ulimit -v 400000; exec \"$0\" \"$@\"";
    let hold = ["hold", "x.avi", "--gripper", "dry", "--sensor", "gelslim", "--rest", "/dev/zero"];
    for (arguments, said) in [
        (&["simulate", "scene.toml", "-o", "run"][..], "expected at most 1048576 bytes, got more"),
        (&hold, "expected a finger at rest as `slipbound tare` writes it, got something else"),
    ] {
        let mut command = Command::new("sh");
        command.current_dir(folder.path()).args(["-c", limited, PROGRAM]).args(arguments);
        let output = command.output().expect("runs");
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && err.contains(said), "{arguments:?}: {:?} {err}", output.status);
    }
}

#[test]
fn a_key_that_a_scene_file_does_not_have_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let scene = "scene = \"press\"\nseeds = 3\n\n[set]\ngrid = \"fast\"\n";
    fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    let refused = run(dir.path(), &["simulate", "scene.toml", "-o", "run"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.err.contains("scene.toml: expected a scene file: unknown key `seeds`; did you mean `seed`?"),
        "{refused:?}"
    );
}
