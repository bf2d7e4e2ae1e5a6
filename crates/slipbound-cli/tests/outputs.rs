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
        (&["watch", "sim:press", "--csv", "-"], "--csv -: expected the name of a file"),
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

#[test]
fn several_recordings_are_rows_of_a_table_with_files_of_their_own() {
    let folder = clip();
    let written =
        ["--csv", "t.csv", "--slips", "s.jsonl", "--report", "p.html", "--overlay", "seen", "--json", "r.jsonl"];
    let words = [&["watch", "clip", "nowhere.avi", "clip"][..], &written].concat();
    let done = slipbound(folder.path(), &words);
    // One that is not there keeps no other from being judged.
    assert_eq!(done.status.code(), Some(1), "{}", told(&done));
    let said = told(&done);
    let rows: Vec<&str> = said.lines().filter(|line| line.starts_with("clip")).collect();
    assert!(rows.len() == 2 && rows[1].starts_with("clip-2 "), "{said}");
    assert!(said.contains("nowhere  failed") && said.contains("1 of 3 recordings"), "{said}");
    for name in
        ["t-clip.csv", "t-clip-2.csv", "s-clip.jsonl", "p-clip.html", "r-clip-2.jsonl", "seen/clip-2/000001.png"]
    {
        assert!(folder.path().join(name).is_file(), "{name}: {said}");
    }
    let [first, second] =
        ["t-clip.csv", "t-clip-2.csv"].map(|name| fs::read(folder.path().join(name)).expect("a table"));
    assert_eq!(first, second, "each begins anew");
    let done = slipbound(folder.path(), &["watch", "clip", "http://127.0.0.1:1/x"]);
    assert_eq!(done.status.code(), Some(2), "{}", told(&done));
}

#[test]
fn the_page_of_a_recording_tells_what_the_terminal_and_the_slips_tell() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "sim:twist?grid=fast&angle_deg=30&speed_deg_per_s=60&rest_frames=3";
    let words = ["watch", scene, "--report", "page.html", "--slips", "slips.jsonl", "--csv", "t.csv"];
    let done = slipbound(folder.path(), &words);
    assert!(done.status.success(), "{}", told(&done));
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("written");
    let (page, slips, said) = (read("page.html"), read("slips.jsonl"), told(&done));
    let begins: Vec<&str> = said.lines().filter(|line| line.contains(" begins")).collect();
    assert!(!begins.is_empty() && slips.lines().count() == begins.len(), "{said}{slips}");
    for (begins, slip) in begins.iter().zip(slips.lines()) {
        let slip: serde_json::Value = serde_json::from_str(slip).expect("JSON");
        assert!(page.contains(&format!("</span> {begins}</h3>")), "{begins}");
        assert!(begins.contains(&format!("frame {} ", slip["first_seq"])), "{begins}: {slip}");
    }
    let count = read("t.csv").lines().filter(|row| row.contains(",incipient,") || row.contains(",gross,")).count();
    let frames: u64 = slips
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
        .map(|slip| slip["frames_count"].as_u64().expect("a number"))
        .sum();
    assert_eq!(frames, count as u64);
    // Ours may be written again, another's not.
    assert!(slipbound(folder.path(), &words).status.success());
    fs::write(folder.path().join("page.html"), "<html>mine</html>").expect("written");
    assert_eq!(slipbound(folder.path(), &words).status.code(), Some(2));
}

#[test]
fn a_picture_that_stands_upright_is_asked_about() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut jpeg = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 80);
    encoder.encode(&[128; 320 * 427], 320, 427, jpeg_encoder::ColorType::Luma).expect("encodes");
    fs::write(folder.path().join("a.jpg"), jpeg).expect("written");
    for args in [&["watch", "a.jpg"][..], &["watch", "a.jpg", "--sensor", "gelslim"]] {
        let done = slipbound(folder.path(), args);
        assert!(done.status.code() == Some(2) && told(&done).contains("turned by 90 degrees?"), "{}", told(&done));
    }
}
