//! Outputs of `watch`, and files that it uses from beside the frames; pages and scripts generated from the arguments.

mod program;

use program::{printed, signal, slipbound_in, start_in};
use std::fs;
use std::time::{Duration, Instant};

/// A folder with a short press of a finger, `clip`.
fn clip() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "press?rest_frames=3&press_s=0.1&settle_s=0.1&hold_s=0.1&grid=fast";
    let done = slipbound_in(folder.path(), &["simulate", scene, "-o", "clip"]);
    assert!(done.status.success(), "{}", printed(&done));
    folder
}

#[test]
fn a_simulated_folder_is_watched_with_its_own_finger_and_makes_a_table() {
    let folder = clip();
    let done = slipbound_in(folder.path(), &["watch", "clip", "--csv", "table.csv", "--json", "lines.jsonl"]);
    assert!(done.status.success() && printed(&done).contains("took clip/sensor.toml"), "{}", printed(&done));
    assert!(!printed(&done).contains("unjudged"), "{}", printed(&done));
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
    let done = slipbound_in(folder.path(), &["watch", "clip/frame_%06d.jpg"]);
    assert!(done.status.success() && printed(&done).contains("took clip/sensor.toml"), "{}", printed(&done));
}

#[test]
fn a_scene_is_recorded_with_its_finger_and_held_as_a_recording_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = "sim:press?rest_frames=3&press_s=0.1&settle_s=0.1&hold_s=0.1&grid=fast&rate_hz=60";
    let done = slipbound_in(folder.path(), &["record", source, "-o", "press.mcap"]);
    assert!(done.status.success(), "{}", printed(&done));
    let done = slipbound_in(folder.path(), &["watch", "press.mcap", "--csv", "recorded.csv"]);
    assert!(done.status.success() && printed(&done).contains("took finger.sensor.toml"), "{}", printed(&done));
    let done = slipbound_in(folder.path(), &["watch", source, "--csv", "scene.csv"]);
    assert!(done.status.success(), "{}", printed(&done));
    let table = |name| fs::read_to_string(folder.path().join(name)).expect("a table");
    assert_eq!(table("recorded.csv"), table("scene.csv"));
    let done = slipbound_in(folder.path(), &["record", "sim:pres", "-o", "none.mcap"]);
    assert!(done.status.code() == Some(2) && printed(&done).contains("did you mean press?"), "{}", printed(&done));

    let clip = clip();
    let sensor = clip.path().join("clip/sensor.toml").display().to_string();
    let source = "sim:press?hold_s=1&grid=fast";
    let args = ["hold", source, "--sensor", &sensor, "--gripper", "dry", "-o", "held"];
    let done = slipbound_in(folder.path(), &args);
    assert!(done.status.success() && printed(&done).contains("report: held/report.html"), "{}", printed(&done));
}

#[test]
fn a_shorter_overlay_leaves_no_picture_of_a_longer_one_and_nobody_elses_is_touched() {
    let folder = clip();
    let overlay = folder.path().join("pictures");
    let count = || fs::read_dir(&overlay).expect("there").count();
    let done = slipbound_in(folder.path(), &["watch", "clip", "--overlay", "pictures"]);
    assert!(done.status.success(), "{}", printed(&done));
    let all = count();
    fs::write(overlay.join("notes.txt"), "mine").expect("written");
    let source = "clip/frame_00000[0-4].jpg";
    let done = slipbound_in(folder.path(), &["watch", source, "--overlay", "pictures"]);
    assert!(done.status.success(), "{}", printed(&done));
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
        (&["watch", "sim:press", "--timings", "x.csv"], "--timings x.csv: expected a file of JSON lines"),
        (&["watch", "sim:press", "--timings", "-"], "--timings -: expected the name of a file"),
        (&["convert", "a.bmp", "-o", "-"], "--output -: expected the name of a file or folder"),
        (&["man", "-o", "-"], "--output -: expected the name of a folder"),
        (&["convert", "a.bmp", "-o", "x"], "a.bmp: expected FILE.mcap"),
        (&["watch", "a.bmp"], "a.bmp: expected images (.jpg, .jpeg, .png), got 1 .bmp file"),
        (&["watch", "."], ".: expected images (.jpg, .jpeg, .png), got 1 .bmp file"),
        (&["watch", "sim:rmp"], "did you mean ramp?"),
        (&["trials", "--controller", "clairvoyan"], "did you mean clairvoyant?"),
        (&["demo", "--emulated", "wsg5"], "did you mean wsg50?"),
        (&["scenes", "rol"], "did you mean roll?"),
        (&["sensors", "gelslm"], "did you mean `gelslim`?"),
    ] {
        let done = slipbound_in(folder.path(), args);
        assert_eq!(done.status.code(), Some(2), "{args:?}: {}", printed(&done));
        assert!(printed(&done).contains(said), "{args:?}: {}", printed(&done));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 1, "nothing was written");
}

#[test]
fn a_sensor_file_that_is_there_is_not_calibrated_over() {
    let folder = clip();
    let place = folder.path().join("own.toml");
    fs::write(&place, "# edited by hand\n").expect("written");
    let words = ["calibrate", "clip/frame_000000.jpg", "-o", "own.toml"];
    let done = slipbound_in(folder.path(), &words);
    assert_eq!(done.status.code(), Some(2), "{}", printed(&done));
    assert_eq!(fs::read_to_string(&place).expect("there"), "# edited by hand\n");
    let done = slipbound_in(folder.path(), &[&words[..], &["--force"]].concat());
    assert!(done.status.success(), "{}", printed(&done));
    assert!(fs::read_to_string(&place).expect("there").contains("pitch_px"));
}

#[test]
fn pages_scripts_scenes_and_fingers_are_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = slipbound_in(folder.path(), &["man", "-o", "man"]);
    assert!(done.status.success(), "{}", printed(&done));
    let page = fs::read_to_string(folder.path().join("man/slipbound-watch.1")).expect("a page");
    assert!(page.contains("\\-\\-overlay"), "{page}");
    let done = slipbound_in(folder.path(), &["completions", "bash"]);
    assert!(printed(&done).contains("complete -F _slipbound"), "{}", printed(&done));
    let done = slipbound_in(folder.path(), &["scenes", "ramp"]);
    for part in ["ramp: pulled and turned", "ramp_s", "force_n", "slipbound watch 'sim:ramp"] {
        assert!(printed(&done).contains(part), "no {part}: {}", printed(&done));
    }
    // The output is a sensor file.
    let done = slipbound_in(folder.path(), &["sensors", "gelslim"]);
    fs::write(folder.path().join("own.toml"), &done.stdout).expect("written");
    let done = slipbound_in(folder.path(), &["sensors", "own.toml"]);
    assert!(done.status.success() && printed(&done).contains("pitch_px"), "{}", printed(&done));
}

#[test]
fn several_recordings_are_rows_of_a_table_with_files_of_their_own() {
    let folder = clip();
    let written =
        ["--csv", "t.csv", "--slips", "s.jsonl", "--report", "p.html", "--overlay", "seen", "--json", "r.jsonl"];
    let words = [&["watch", "clip", "nowhere.avi", "clip"][..], &written].concat();
    let done = slipbound_in(folder.path(), &words);
    // A missing one does not prevent the others from being judged.
    assert_eq!(done.status.code(), Some(1), "{}", printed(&done));
    let said = printed(&done);
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
    let done = slipbound_in(folder.path(), &["watch", "clip", "http://127.0.0.1:1/x"]);
    assert_eq!(done.status.code(), Some(2), "{}", printed(&done));
}

#[test]
fn the_page_of_a_recording_tells_what_the_terminal_and_the_slips_tell() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "sim:twist?grid=fast&angle_deg=30&speed_deg_per_s=60&rest_frames=3";
    let words = ["watch", scene, "--report", "page.html", "--slips", "slips.jsonl", "--csv", "t.csv"];
    let done = slipbound_in(folder.path(), &words);
    assert!(done.status.success(), "{}", printed(&done));
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("written");
    let (page, slips, said) = (read("page.html"), read("slips.jsonl"), printed(&done));
    let begins: Vec<&str> = said.lines().filter(|line| line.contains(" begins")).collect();
    assert!(!begins.is_empty() && slips.lines().count() == begins.len(), "{said}{slips}");
    for (begins, slip) in begins.iter().zip(slips.lines()) {
        let slip: serde_json::Value = serde_json::from_str(slip).expect("JSON");
        assert!(page.contains(&format!("</span> {begins}</h3>")), "{begins}");
        assert!(begins.contains(&format!("frame {} ", slip["first_seq"])), "{begins}: {slip}");
    }
    assert!(said.contains("is still going on at the end") && slips.ends_with("\"ongoing\":true}\n"), "{said}{slips}");
    let count = read("t.csv").lines().filter(|row| row.contains(",incipient,") || row.contains(",gross,")).count();
    let frames: u64 = slips
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
        .map(|slip| slip["frames_count"].as_u64().expect("a number"))
        .sum();
    assert_eq!(frames, count as u64);
    // Our own may be overwritten, another's not.
    assert!(slipbound_in(folder.path(), &words).status.success());
    fs::write(folder.path().join("page.html"), "<html>mine</html>").expect("written");
    assert_eq!(slipbound_in(folder.path(), &words).status.code(), Some(2));
}

#[test]
fn a_torn_frame_is_no_measurement_of_zero() {
    let folder = clip();
    fs::write(folder.path().join("clip/frame_000007.jpg"), "").expect("written");
    let done = slipbound_in(folder.path(), &["watch", "clip", "--report", "page.html", "--csv", "t.csv"]);
    assert_eq!(done.status.code(), Some(3), "{}", printed(&done));
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("written");
    assert!(read("t.csv").contains("\nfinger,7,7,,unjudged,torn frame,,,,"), "{}", read("t.csv"));
    let page = read("page.html");
    assert!(page.contains("<title>frame 8\nContact area: "), "the next frame has an area");
    assert_eq!(page.matches("<title>frame 7\n").count(), 0, "a plot has a value of the torn frame");
}

#[test]
fn a_picture_that_stands_upright_is_asked_about() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut jpeg = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 80);
    encoder.encode(&[128; 320 * 427], 320, 427, jpeg_encoder::ColorType::Luma).expect("encodes");
    fs::write(folder.path().join("a.jpg"), jpeg).expect("written");
    let gelslim = ["--sensor", "gelslim"];
    for (command, code) in [
        (&["watch", "a.jpg"][..], 2),
        (&[&["watch", "a.jpg"], &gelslim[..]].concat(), 2),
        (&["watch", "sim:press", "--rest", "a.jpg"], 2),
        (&[&["hold", "a.jpg", "--gripper", "dry", "-o", "run"], &gelslim[..]].concat(), 1),
        (&[&["doctor", "a.jpg"], &gelslim[..]].concat(), 1),
    ] {
        let done = slipbound_in(folder.path(), command);
        let told = printed(&done);
        assert!(done.status.code() == Some(code) && told.contains("turned by 90 degrees?"), "{command:?}: {told}");
        assert!(!told.contains("belong to this finger"), "{command:?}: {told}");
    }
}

/// A finger's name is the name of files and topics: it leads nowhere else.
#[test]
fn names_of_fingers_that_cannot_be_names_of_files_are_refused() {
    let folder = clip();
    for name in ["a/b", "", "../../evil", "zwei w\u{f6}rter", "a.b"] {
        for command in [&["record", "clip", "-o", "r.mcap"][..], &["watch", "clip", "--record", "r.mcap"]] {
            let done = slipbound_in(folder.path(), &[command, &["--finger", name]].concat());
            assert_eq!(done.status.code(), Some(2), "{command:?} `{name}`: {}", printed(&done));
            assert!(printed(&done).contains("expected 1 to 64 of A-Z a-z 0-9 _ -"), "`{name}`: {}", printed(&done));
        }
    }
    assert!(!folder.path().join("r.mcap").exists());
    let done = slipbound_in(folder.path(), &["record", "clip", "-o", "r.mcap", "--finger", "Left_1-a"]);
    assert!(done.status.success(), "{}", printed(&done));
}

#[test]
fn a_source_that_is_refused_costs_no_recording() {
    let folder = clip();
    let record = |sources: &[&str]| slipbound_in(folder.path(), &[&["record"], sources, &["-o", "r.mcap"]].concat());
    let watch = |source: &str| slipbound_in(folder.path(), &["watch", source, "--record", "r.mcap", "--force"]);
    for done in [record(&["clip", "nowhere.avi"]), watch("nowhere.avi")] {
        assert!(done.status.code() == Some(2) && printed(&done).contains("no such file"), "{}", printed(&done));
        assert!(!folder.path().join("r.mcap").exists(), "nothing was recorded");
    }
    assert!(record(&["clip"]).status.success());
    let bytes = || fs::read(folder.path().join("r.mcap")).expect("there");
    let before = bytes();
    for done in [record(&["clip", "nowhere.avi"]), watch("nowhere.avi")] {
        assert_eq!(done.status.code(), Some(2), "{}", printed(&done));
        assert!(bytes() == before, "what was there is lost: {}", printed(&done));
    }
    // The frames in it may exist nowhere else.
    let done = slipbound_in(folder.path(), &["watch", "clip", "--record", "r.mcap"]);
    let told = printed(&done);
    assert!(done.status.code() == Some(2) && bytes() == before, "{told}");
    assert!(told.contains("--record: expected a new file, got ") && told.contains("a recording (--force"), "{told}");
    assert!(watch("clip").status.success() && bytes() != before, "and it is replaced by what is recorded");
}

#[test]
fn torn_frames_alone_replace_no_recording() {
    let folder = clip();
    fs::create_dir(folder.path().join("torn")).expect("writable");
    (0..3).for_each(|i| fs::write(folder.path().join(format!("torn/{i}.jpg")), b"\xFF\xD8 cut").expect("writable"));
    let record = |source: &str| slipbound_in(folder.path(), &["record", source, "-o", "r.mcap"]);
    assert!(record("clip").status.success());
    let bytes = || fs::read(folder.path().join("r.mcap")).expect("there");
    let before = bytes();
    let done = record("torn");
    assert!(done.status.code() == Some(1) && bytes() == before, "{}", printed(&done));
    let told = "no whole frame came (finger: the first torn frame: JPEG";
    assert!(printed(&done).contains(told) && printed(&done).contains("r.mcap is as it was"), "{}", printed(&done));
}

#[test]
fn a_hold_that_is_refused_costs_no_recording() {
    let folder = clip();
    let path = folder.path().join("r.mcap");
    assert!(slipbound_in(folder.path(), &["record", "clip", "-o", "r.mcap"]).status.success());
    let before = fs::read(&path).expect("there");
    let hold = |sources: &[&str], gripper: &str| {
        let more = ["--sensor", "clip/sensor.toml", "--gripper", gripper, "--record=r.mcap"];
        slipbound_in(folder.path(), &[&["hold"], sources, &more].concat())
    };
    for done in [hold(&["clip"], "wsg50://127.0.0.1:1"), hold(&["clip", "nowhere.avi"], "dry")] {
        assert!(matches!(done.status.code(), Some(1 | 2)), "{}", printed(&done));
        assert!(fs::read(&path).expect("there") == before, "what was there is lost: {}", printed(&done));
    }
    // A run that begins records the frames read before, too.
    let done = hold(&["clip"], "dry");
    let after = slipbound_in(folder.path(), &["watch", "r.mcap", "--csv", "t.csv"]);
    let is_frame = |name: &std::ffi::OsStr| name.to_string_lossy().ends_with(".jpg");
    let names = fs::read_dir(folder.path().join("clip")).expect("there");
    let frames_count = names.filter(|entry| is_frame(&entry.as_ref().expect("read").file_name())).count();
    let rows_count = fs::read_to_string(folder.path().join("t.csv")).map_or(0, |table| table.lines().count());
    assert_eq!(rows_count, frames_count + 1, "{}{}", printed(&done), printed(&after));
}

#[test]
fn a_source_that_fails_leaves_no_recording_that_passes_as_whole() {
    let folder = clip();
    let path = folder.path().join("r.mcap");
    let record = |source: &str| slipbound_in(folder.path(), &["record", source, "-o", "r.mcap"]);
    let watch = |source: &str| slipbound_in(folder.path(), &["watch", source, "--record", "r.mcap", "--force"]);
    assert!(record("clip").status.success());
    let before = fs::read(&path).expect("there");
    fs::write(folder.path().join("notes.mp4"), "bring the gel\n").expect("written");
    for done in [record("notes.mp4"), watch("notes.mp4")] {
        assert!(matches!(done.status.code(), Some(1 | 2)), "{}", printed(&done));
        assert!(fs::read(&path).expect("there") == before, "what was there is lost: {}", printed(&done));
    }
    // The frames before it are kept, and the recording says that it is cut off.
    let both = slipbound_in(folder.path(), &["record", "clip", "notes.mp4", "-o", "r.mcap"]);
    assert!(!both.status.success(), "{}", printed(&both));
    let read = slipbound_in(folder.path(), &["watch", "r.mcap#left", "--sensor", "clip/sensor.toml"]);
    assert!(printed(&read).contains("the recording is cut off"), "{}", printed(&read));
}

#[test]
fn a_recording_is_judged_with_the_sensor_file_that_goes_with_it() {
    let folder = clip();
    let sensor = ["--sensor", "clip/sensor.toml"];
    let record = ["record", "clip", "-o", "rec.mcap", "--finger", "thumb"];
    assert!(slipbound_in(folder.path(), &[&record[..], &sensor].concat()).status.success());
    let lines = |name: &str| {
        let text = fs::read_to_string(folder.path().join(name)).expect("a report");
        text.split_once('\n').map(|(_, lines)| lines.to_owned()).expect("a header and lines")
    };
    for (more, name) in [(&[][..], "own.jsonl"), (&sensor, "given.jsonl")] {
        let done = slipbound_in(folder.path(), &[&["watch", "rec.mcap", "--json", name], more].concat());
        assert!(done.status.success(), "{}", printed(&done));
        let took = printed(&done).contains("no --sensor given: took thumb.sensor.toml of rec.mcap");
        assert_eq!(took, more.is_empty(), "{}", printed(&done));
    }
    assert_eq!(lines("own.jsonl"), lines("given.jsonl"));
    // A recording of the recording brings it along, whatever its name ends in.
    let again = slipbound_in(folder.path(), &["record", "rec.mcap", "-o", "again.mcap", "--finger", "index"]);
    assert!(again.status.success(), "{}", printed(&again));
    fs::rename(folder.path().join("again.mcap"), folder.path().join("AGAIN.MCAP")).expect("renamed");
    let done = slipbound_in(folder.path(), &["watch", "AGAIN.MCAP", "--json", "again.jsonl"]);
    assert!(printed(&done).contains("took index.sensor.toml of AGAIN.MCAP"), "{}", printed(&done));
    assert_eq!(lines("again.jsonl"), lines("own.jsonl"));
    // One that cannot be read costs no recording.
    fs::write(folder.path().join("clip/sensor.toml"), "pitch_px = [").expect("written");
    let torn = slipbound_in(folder.path(), &["record", "clip", "-o", "torn.mcap"]);
    assert!(
        torn.status.success() && printed(&torn).contains("recorded without the sensor file of clip"),
        "{}",
        printed(&torn)
    );
}

#[test]
fn convert_writes_over_nothing_that_is_not_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let words = ["demo", "--fingers", "1", "--task", "lift", "--set", "longest_s=0.3", "--record", "-o", "run"];
    slipbound_in(folder.path(), &words);
    let mine = folder.path().join("mine.mcap");
    fs::write(&mine, "my thesis").expect("written");
    let convert = |to: &str| slipbound_in(folder.path(), &["convert", "run", "-o", to]);
    for (to, said) in [
        ("mine.mcap", "--output: expected a new file or a recording, got mine.mcap"),
        ("run/all.mcap", "--output run/all.mcap: expected a place outside of run"),
    ] {
        let done = convert(to);
        assert_eq!(done.status.code(), Some(2), "{to}: {}", printed(&done));
        assert!(printed(&done).contains(said), "{to}: {}", printed(&done));
    }
    assert_eq!(fs::read_to_string(&mine).expect("there"), "my thesis");
    for _ in 0..2 {
        let done = convert("all.mcap");
        assert!(done.status.success(), "{}", printed(&done));
    }
}

/// Invalid requests are refused with exit code 2, before anything is written or moves.
#[test]
fn numbers_and_options_that_mean_nothing_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (line, said) in [
        ("trials --seeds 0", "--seeds"),
        ("trials --first-seed 18446744073709551615 --seeds 2", "--first-seed"),
        ("eval ramps --trials 1 -o -", "--output -: expected the name of a folder"),
        ("simulate shear -o -", "--output -: expected the name of a folder"),
        ("demo -o -", "--output -: expected the name of a folder"),
        ("paper -o -", "--output -: expected the name of a folder"),
        ("hold sim --gripper dry -o -", "--output -: expected the name of a folder"),
        ("emulate hand -o -", "--output -: expected the name of a folder"),
        ("emulate hand --set fault=torn=0.1 -o hand", "--set fault: expected with `demo` and `trials` only"),
        ("eval ramps --trials 0 -o ev", "--trials"),
        ("eval ramps --trials 18446744073709551615 -o ev", "--trials"),
        ("eval table1 --trials 400 -o ev", "--trials: expected at most the 320 of table1, got 400"),
        (
            "eval wriggles --seed 7 -o ev",
            "--seed: expected with `table1`, `ramps`, `quiet`, `unseen` and `slides` only",
        ),
        (
            "eval lifts --trials 3 -o ev",
            "--trials: expected with `table1`, `ramps`, `quiet`, `unseen` and `slides` only",
        ),
        ("eval merge a b --jobs 2 -o ev", "--jobs: expected with `table1`, "),
        ("eval ramps --trials 1 --refit -o ev", "--refit: expected with `lifts` only, got ramps"),
        ("eval slides --trials 1 --data . -o ev", "--data: expected with `lifts` and `wriggles` only, got slides"),
        ("record sim -o r.mcap --for-s nan", "--for-s: expected seconds above 0, at most 1000000000, got NaN"),
        ("record sim -o r.mcap --for-s 0", "--for-s: expected seconds above 0, at most 1000000000, got 0"),
        ("record sim -o r.mcap --for-s -1", "--for-s: expected seconds above 0, at most 1000000000, got -1"),
        ("hold sim --gripper dry --for-s -1", "--for-s: expected 0 to 1000000 s, got -1"),
        ("hold sim --gripper dry --rate-hz -1", "--rate-hz: expected 0.1 to 1000 Hz, got -1"),
        ("emulate wsg50 --width -5", "--width: expected 0 to 1000 mm, got -5"),
        ("emulate wsg50 --weight -5 --mu -1", "--weight from 0 to 1000 N and --mu from 0.01 to 10, got -5 and -1"),
        ("gripper dry check-hold --low -5 --high -1", "the lower one above 0 and below the higher one, got -5 and -1"),
        ("emulate robotiq-rtu --port 5000", "--port: expected none for robotiq-rtu"),
        ("gripper dry grasp 0", "expected a force from 5 N to 80 N per finger, got 0"),
        ("gripper dry grasp -3", "expected a force from 5 N to 80 N per finger, got -3"),
        ("gripper dry grasp nan", "expected a force from 5 N to 80 N per finger, got NaN"),
        ("gripper wsg50://127.0.0.1:1?most_n=40 grasp 41", "expected a force from 5 N to 40 N per finger, got 41"),
        ("gripper wsg50://127.0.0.1:1 check-hold --low 20 --high 90", "from 5 N to 80 N per finger, got 90"),
    ] {
        let done = slipbound_in(folder.path(), &line.split(' ').collect::<Vec<_>>());
        assert_eq!(done.status.code(), Some(2), "{line}: {}", printed(&done));
        assert!(printed(&done).contains(said), "{line}: {}", printed(&done));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 0, "nothing was written");
    let done = slipbound_in(folder.path(), &["gripper", "dry", "grasp", "20"]);
    assert!(done.status.success(), "{}", printed(&done));
}

/// The noise is that of the frames at rest; a later touch is reported, with its place.
#[test]
fn a_finger_that_is_touched_later_is_not_called_untouched() {
    let folder = clip();
    let sensor = ["--sensor", "clip/sensor.toml"];
    let done = slipbound_in(folder.path(), &[&["doctor", "clip"], &sensor[..]].concat());
    assert_eq!(done.status.code(), Some(1), "{}", printed(&done));
    let said = printed(&done);
    assert!(said.contains("BAD   untouched: something touches the finger, from frame "), "{said}");
    let noise_px = |said: &str| -> f64 {
        let words = said.split("noise").nth(1).and_then(|rest| rest.trim_start_matches(':').split_whitespace().next());
        words.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("no noise: {said}"))
    };
    // A settings file for recordings that begin with an object in the hand does not make a finger a touched one.
    fs::write(folder.path().join("held.toml"), "[rest]\nheld = true\n").expect("written");
    let tare = |frames: &str| {
        let words = ["tare", "clip", "--settings", "held.toml", "--frames", frames];
        slipbound_in(folder.path(), &[&words, &sensor[..]].concat())
    };
    let done = tare("12");
    assert_eq!(done.status.code(), Some(1), "{}", printed(&done));
    assert!(
        printed(&done).contains("expected a finger that nothing touches in its first 12 frames"),
        "{}",
        printed(&done)
    );
    assert!(!folder.path().join("finger.rest").exists());
    let done = tare("3");
    assert!(done.status.success(), "{}", printed(&done));
    let next = "next: slipbound watch clip --rest finger.rest --sensor clip/sensor.toml --settings held.toml\n";
    assert!(printed(&done).contains(next), "{}", printed(&done));
    // The first frames of the press do not count as a touch yet, but most of what they move is left out.
    assert!(noise_px(&printed(&done)) < 0.1, "{}", printed(&done));
}

#[test]
fn frames_of_two_sizes_are_no_good_camera() {
    let folder = clip();
    let encode = |width: u16, height: u16| {
        let mut jpeg = Vec::new();
        let grey = vec![128; usize::from(width) * usize::from(height)];
        jpeg_encoder::Encoder::new(&mut jpeg, 80)
            .encode(&grey, width, height, jpeg_encoder::ColorType::Luma)
            .expect("encodes");
        jpeg
    };
    fs::create_dir(folder.path().join("two")).expect("made");
    for number in 0..10 {
        let picture = if number < 6 { encode(320, 240) } else { encode(64, 48) };
        fs::write(folder.path().join(format!("two/{number}.jpg")), picture).expect("written");
    }
    let done = slipbound_in(folder.path(), &["doctor", "two"]);
    assert_eq!(done.status.code(), Some(1), "{}", printed(&done));
    let said = "BAD   one size: 4 of 10 frames are not of 320x240";
    assert!(printed(&done).contains(said), "{}", printed(&done));
}

/// However fast it is read.
#[test]
fn of_a_recording_so_many_seconds_are_recorded_as_its_frames_say() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/twist.avi");
    for (for_s, expected_count) in [("0.5", 16), ("1", 31)] {
        let done = slipbound_in(folder.path(), &["record", recording, "-o", "part.mcap", "--for-s", for_s]);
        assert!(done.status.success(), "{}", printed(&done));
        let expected = format!("part.mcap: {expected_count} frames");
        assert!(printed(&done).contains(&expected), "expected `{expected}`, got `{}`", printed(&done));
    }
}

/// A folder of images has no times, so its seconds cannot be counted.
#[test]
fn seconds_of_a_recording_without_times_are_refused() {
    let folder = clip();
    let recorded = slipbound_in(folder.path(), &["record", "clip", "-o", "part.mcap"]);
    assert!(recorded.status.success(), "{}", printed(&recorded));
    let before = fs::read(folder.path().join("part.mcap")).expect("there");
    let done = slipbound_in(folder.path(), &["record", "clip", "-o", "part.mcap", "--for-s", "1"]);
    let said = printed(&done);
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(
        said.contains("--for-s: clip: expected frames with times, got frame 0 (frame_000000.jpg) without"),
        "{said}"
    );
    assert!(fs::read(folder.path().join("part.mcap")).expect("there") == before, "the old recording is lost");
}

/// The copy of a recording has a beginning only: that is a failure, and its readers are told that it is cut off.
#[test]
#[cfg(unix)]
fn an_interrupted_copy_of_a_recording_is_no_whole_one() {
    let folder = clip();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("long")).expect("made");
    for number in 0..20_000 {
        std::os::unix::fs::symlink("../clip/frame_000000.jpg", path(&format!("long/{number}.jpg"))).expect("linked");
    }
    let child = start_in(folder.path(), &["record", "long", "-o", "part.mcap"]);
    let deadline = Instant::now() + Duration::from_secs(60);
    while fs::metadata(path("part.mcap")).map_or(0, |file| file.len()) < 10_000 {
        assert!(Instant::now() < deadline, "nothing is recorded");
        std::thread::sleep(Duration::from_millis(5));
    }
    signal(&child, "-INT");
    let ended = child.wait_with_output().expect("ends");
    let said = printed(&ended);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("interrupted after ") && said.contains("what was recorded is kept"), "{said}");
    let watched = slipbound_in(folder.path(), &["record", "part.mcap", "-o", "again.mcap"]);
    assert_eq!(watched.status.code(), Some(3), "cut off: {}", printed(&watched));
}
