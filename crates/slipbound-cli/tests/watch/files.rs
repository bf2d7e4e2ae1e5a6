//! Which files are written, and which are never overwritten or lost.

use super::trial::{SENSOR, Trial, jpeg, states, write_avi};
use crate::program::Ended;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn the_report_alone_goes_to_standard_output() {
    let trial = Trial::new(3);
    let ended = trial.watch("run", &["--json", "-"]);
    ended.expect(0, &["3 frames, 0 slips"]);
    assert_eq!(ended.out.lines().filter(|line| serde_json::from_str::<Value>(line).is_ok()).count(), 4);
    assert_eq!(ended.out.lines().count(), 4);
}

#[test]
fn outputs_never_fall_on_what_is_read_or_on_each_other() {
    let trial = Trial::new(3);
    write_avi(&trial.path("run.avi"), 3);
    trial.write("rest.jpg", &jpeg(0));
    let files = ["run.avi", "rest.jpg", "run/000.jpg"];
    let before = files.map(|name| fs::read(trial.path(name)).expect("reads"));
    for (source, more, said) in [
        ("run.avi", &["--json", "run.avi"][..], "--json run.avi: expected a place of its own, got that of SOURCE"),
        ("run.avi", &["--overlay", "run/../run.avi"], "that of SOURCE"),
        ("run", &["--overlay", "run"], "--overlay run: expected a place of its own, got that of SOURCE"),
        ("run/*.jpg", &["--overlay", "./run"], "that of SOURCE"),
        ("run/000.jpg", &["--overlay", "run"], "that of SOURCE"),
        ("rest.jpg", &["--overlay", "."], "that of SOURCE"),
        ("run", &["--rest", "rest.jpg", "--timings", "rest.jpg"], "that of --rest"),
        (
            "run",
            &["--json", "new", "--timings", "./new"],
            "--timings ./new: expected a place of its own, got that of --json",
        ),
    ] {
        trial.watch(source, more).expect(2, &[said]);
    }
    assert!(before == files.map(|name| fs::read(trial.path(name)).expect("reads")), "a file was changed");
    assert_eq!(fs::read_dir(trial.path("run")).expect("a folder").count(), 3);
    // Beside the inputs, in a folder named like the finger, and nowhere at all.
    trial.watch("run.avi", &["--overlay", "."]).expect(0, &[]);
    trial.watch("run", &["--overlay", SENSOR[1]]).expect(0, &[]);
    #[cfg(unix)]
    trial.watch("run", &["--json", "/dev/null", "--timings", "/dev/null"]).expect(0, &[]);
}

#[test]
fn no_output_of_a_batch_falls_on_another_recording_or_on_a_sensor_file_that_is_read() {
    let trial = Trial::new(3);
    trial.write("run/sensor.toml", b"extends = \"gelsight_mini_wide\"\n");
    fs::create_dir_all(trial.path("q/run")).expect("makes");
    trial.write("q/run/000.jpg", &jpeg(0));
    for name in ["x.avi", "o-x.avi"] {
        write_avi(&trial.path(name), 3);
    }
    let files = ["run/sensor.toml", "q/run/000.jpg", "x.avi", "o-x.avi"];
    let before = files.map(|name| fs::read(trial.path(name)).expect("reads"));
    for (words, said) in [
        ("watch run q/run --overlay q --json new.jsonl --sensor gelsight_mini_wide", "--overlay q/run: "),
        ("watch x.avi o-x.avi --overlay o.avi --force --sensor gelsight_mini_wide", "--overlay o-x.avi: "),
        ("watch run --json run/sensor.toml --force", "that of SOURCE/sensor.toml"),
        ("tare run --frames 1 -o run/sensor.toml --force", "--output run/sensor.toml: "),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let ended = Ended::of(trial.command(&words).output().expect("runs"));
        ended.expect(2, &[said, "expected a place of its own"]);
    }
    assert!(before == files.map(|name| fs::read(trial.path(name)).expect("reads")), "a file was changed");
    assert_eq!(fs::read_dir(trial.path("q/run")).expect("a folder").count(), 1);
    assert!(!trial.path("new-run.jsonl").exists(), "refused before the first recording is judged");
}

#[test]
#[cfg(unix)]
fn a_file_that_cannot_be_read_is_torn_and_the_others_are_judged() {
    let trial = Trial::new(4);
    std::os::unix::fs::symlink("nowhere", trial.path("run/002_.jpg")).expect("links");
    let ended = trial.watch("run", &["--json", "report.json", "--overlay", "drawn.avi"]);
    ended.expect(3, &["(002_.jpg) is torn: cannot read", "No such file"]);
    assert_eq!(ended.err.matches("No such file").count(), 1, "said once: {ended:?}");
    assert!(ended.out.contains("5 frames"), "{ended:?}");
    let states_seen = ["no_contact", "no_contact", "no_contact", "unjudged", "no_contact"];
    assert_eq!(states(&trial.report("report.json")), states_seen);
    let ended = trial.watch("drawn.avi", &[]);
    assert!(!ended.err.contains("torn"), "the video was closed: {ended:?}");
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let trial = Trial::new(200);
    let mut command =
        trial.command(&["watch", "run", SENSOR[0], SENSOR[1], "--json", "-", "--markers", "--report", "page.html"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let mut line = String::new();
    BufReader::with_capacity(64, child.stdout.take().expect("a pipe")).read_line(&mut line).expect("reads");
    assert!(line.contains("slipbound-report"));
    let ended = Ended::of(child.wait_with_output().expect("ends"));
    ended.expect(0, &[]);
    assert_eq!(ended.err, "");
    assert!(fs::read_to_string(trial.path("page.html")).expect("the page").contains("</html>"));
}

#[test]
#[cfg(unix)]
fn an_interrupted_run_keeps_whole_lines_and_says_so() {
    let trial = Trial::new(300);
    let mut command =
        trial.command(&["watch", "run", SENSOR[0], SENSOR[1], "--json", "report.json", "--overlay", "drawn.avi"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let deadline = Instant::now() + Duration::from_secs(60);
    while fs::read_to_string(trial.path("report.json")).map_or(0, |text| text.lines().count()) < 4 {
        assert!(Instant::now() < deadline, "no line is written");
        std::thread::sleep(Duration::from_millis(5));
    }
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("runs");
    assert!(told.success());
    let ended = Ended::of(child.wait_with_output().expect("ends"));
    ended.expect(1, &["interrupted after"]);
    let lines = trial.report("report.json").len();
    assert!((4..300).contains(&lines), "{lines} lines");
    assert!(ended.out.contains(&format!("{} frames", lines - 1)), "{ended:?}");
}

#[test]
fn no_input_frame_is_overwritten_and_other_files_only_if_they_are_ours_or_by_force() {
    let trial = Trial::new(3);
    let frame = fs::read(trial.path("run/001.jpg")).expect("reads");
    trial.watch("run", &["--json", "run/001.jpg"]).expect(2, &["--json run/001.jpg", "that of the frame"]);
    trial.watch("run", &["--json", "run/001.jpg", "--force"]).expect(2, &["that of the frame"]);
    trial.watch("run/0*.jpg", &["--timings", "run/002.jpg"]).expect(2, &["that of the frame"]);
    // A second name of the same file.
    fs::hard_link(trial.path("run/001.jpg"), trial.path("linked.json")).expect("linked");
    trial.watch("run", &["--json", "linked.json", "--force"]).expect(2, &["that of the frame"]);
    assert_eq!(fs::read(trial.path("run/001.jpg")).expect("reads"), frame);
    // Beside the frames, under a name of its own, is fine.
    trial.watch("run", &["--json", "run/report.json"]).expect(0, &[]);
    trial.watch("run", &["--json", "run/report.json"]).expect(0, &[]);

    trial.write("notes.txt", b"mine");
    fs::create_dir(trial.path("drawn")).expect("made");
    trial.write("drawn/000001.png", b"mine");
    for (args, file) in [
        (["--json", "notes.txt"], "notes.txt"),
        (["--timings", "notes.txt"], "notes.txt"),
        (["--overlay", "drawn"], "drawn/000001.png"),
    ] {
        trial.watch("run", &args).expect(2, &["one that slipbound wrote", "--force overwrites it"]);
        assert_eq!(fs::read(trial.path(file)).expect("reads"), b"mine");
    }
    trial.watch("run", &["--json", "notes.txt", "--overlay", "drawn", "--force"]).expect(0, &[]);
    // All of that is ours now.
    trial.watch("run", &["--json", "notes.txt", "--overlay", "drawn", "--timings", "t.json"]).expect(0, &[]);
    trial.watch("run", &["--overlay", "film.avi", "--timings", "t.json"]).expect(0, &[]);
    trial.watch("run", &["--overlay", "film.avi", "--timings", "t.json"]).expect(0, &[]);
}
