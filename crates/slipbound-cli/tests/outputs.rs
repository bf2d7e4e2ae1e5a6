//! What `watch` writes and what it takes from beside the frames; the pages and scripts that are made from the arguments.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn slipbound(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_slipbound")).current_dir(folder).args(args).output().expect("runs")
}

fn told(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// A folder with a short press of a finger, `clip`.
fn clip() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "press?rest_frames=3&press_s=0.1&settle_s=0.1&hold_s=0.1&grid=fast";
    let done = slipbound(folder.path(), &["simulate", scene, "-o", "clip"]);
    assert!(done.status.success(), "{}", told(&done));
    folder
}

#[test]
fn a_simulated_folder_is_watched_with_its_own_finger_and_makes_a_table() {
    let folder = clip();
    let done = slipbound(folder.path(), &["watch", "clip", "--csv", "table.csv", "--json", "lines.jsonl"]);
    assert!(done.status.success() && told(&done).contains("took clip/sensor.toml"), "{}", told(&done));
    assert!(!told(&done).contains("unjudged"), "{}", told(&done));
    let lines = fs::read_to_string(folder.path().join("lines.jsonl")).expect("a report");
    let table = fs::read_to_string(folder.path().join("table.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), lines.lines().count(), "a header and a row a frame");
    let column = |name: &str| rows[0].iter().position(|n| *n == name).unwrap_or_else(|| panic!("no {name}"));
    for (row, line) in rows.iter().zip(lines.lines()).skip(1) {
        let line: serde_json::Value = serde_json::from_str(line).expect("JSON");
        assert_eq!(row.len(), rows[0].len());
        assert_eq!(row[column("state")], line["state"]);
        let area = &line["contact"]["area_px2"];
        assert_eq!(row[column("contact_area_px2")].parse::<f64>().ok(), area.as_f64(), "{line}");
        let moved = line["motion"]["translation_px"].as_array().map(|parts| parts[1].as_f64().expect("a number"));
        assert_eq!(row[column("motion_translation_px_y")].parse::<f64>().ok(), moved, "{line}");
    }
    // The same by a pattern, as C numbers files.
    let done = slipbound(folder.path(), &["watch", "clip/frame_%06d.jpg"]);
    assert!(done.status.success() && told(&done).contains("took clip/sensor.toml"), "{}", told(&done));
}

#[test]
fn a_shorter_overlay_leaves_no_picture_of_a_longer_one_and_nobody_elses_is_touched() {
    let folder = clip();
    let overlay = folder.path().join("pictures");
    let count = || fs::read_dir(&overlay).expect("there").count();
    let done = slipbound(folder.path(), &["watch", "clip", "--overlay", "pictures"]);
    assert!(done.status.success(), "{}", told(&done));
    let all = count();
    fs::write(overlay.join("notes.txt"), "mine").expect("written");
    let source = "clip/frame_00000[0-4].jpg";
    let done = slipbound(folder.path(), &["watch", source, "--overlay", "pictures"]);
    assert!(done.status.success(), "{}", told(&done));
    assert!(all > 5 && count() == 6, "{all}, then {}", count());
}

#[test]
fn a_name_that_promises_another_format_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.bmp"), "BM").expect("written");
    for (args, said) in [
        (&["watch", "sim:press", "--json", "x.csv"][..], "--json x.csv: expected a file of JSON lines"),
        (&["watch", "sim:press", "--csv", "x.jsonl"], "--csv x.jsonl: expected a file of comma-separated values"),
        (&["watch", "sim:press", "--overlay", "x.MP4"], "--overlay x.MP4: expected a folder for pictures, or FILE.avi"),
        (&["watch", "sim:press", "--record", "x.bag"], "--record x.bag: expected a FILE.mcap"),
        (&["watch", "a.bmp"], "a.bmp: expected images (.jpg, .jpeg, .png), got 1 .bmp file"),
        (&["watch", "."], ".: expected images (.jpg, .jpeg, .png), got 1 .bmp file"),
        (&["watch", "sim:rmp"], "did you mean ramp?"),
        (&["scenes", "rol"], "did you mean roll?"),
        (&["sensors", "gelslm"], "did you mean `gelslim`?"),
    ] {
        let done = slipbound(folder.path(), args);
        assert_eq!(done.status.code(), Some(2), "{args:?}: {}", told(&done));
        assert!(told(&done).contains(said), "{args:?}: {}", told(&done));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 1, "nothing was written");
}

#[test]
fn a_sensor_file_that_is_there_is_not_calibrated_over() {
    let folder = clip();
    let place = folder.path().join("own.toml");
    fs::write(&place, "# edited by hand\n").expect("written");
    let words = ["calibrate", "clip/frame_000000.jpg", "-o", "own.toml"];
    let done = slipbound(folder.path(), &words);
    assert_eq!(done.status.code(), Some(2), "{}", told(&done));
    assert_eq!(fs::read_to_string(&place).expect("there"), "# edited by hand\n");
    let done = slipbound(folder.path(), &[&words[..], &["--force"]].concat());
    assert!(done.status.success(), "{}", told(&done));
    assert!(fs::read_to_string(&place).expect("there").contains("pitch_px"));
}

#[test]
fn pages_scripts_scenes_and_fingers_are_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = slipbound(folder.path(), &["man", "-o", "man"]);
    assert!(done.status.success(), "{}", told(&done));
    let page = fs::read_to_string(folder.path().join("man/slipbound-watch.1")).expect("a page");
    assert!(page.contains("\\-\\-overlay"), "{page}");
    let done = slipbound(folder.path(), &["completions", "bash"]);
    assert!(told(&done).contains("complete -F _slipbound"), "{}", told(&done));
    let done = slipbound(folder.path(), &["scenes", "ramp"]);
    for part in ["ramp: pulled and turned", "ramp_s", "force_n", "slipbound watch 'sim:ramp"] {
        assert!(told(&done).contains(part), "no {part}: {}", told(&done));
    }
    // What is shown is a sensor file.
    let done = slipbound(folder.path(), &["sensors", "gelslim"]);
    fs::write(folder.path().join("own.toml"), &done.stdout).expect("written");
    let done = slipbound(folder.path(), &["sensors", "own.toml"]);
    assert!(done.status.success() && told(&done).contains("pitch_px"), "{}", told(&done));
}
