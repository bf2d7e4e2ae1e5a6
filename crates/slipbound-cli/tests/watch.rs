//! The command from outside: what it prints, writes and returns, on whole and on damaged recordings.

use serde_json::Value;
use slipbound::image::SizePx;
use slipbound_rig::avi_writer::AviWriter;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const SIZE: SizePx = SizePx::new(320, 240);
const SENSOR: [&str; 2] = ["--sensor", "gelsight_mini_wide"];

/// Dots of 11 px on a grid of 30.8 px, a little further to the right from frame to frame.
fn jpeg(frame: usize) -> Vec<u8> {
    let pixels: Vec<u8> = (0..SIZE.area())
        .map(|i| {
            let (x, y) = ((i % SIZE.width) as f64 - 20.0 - 0.01 * frame as f64, (i / SIZE.width) as f64 - 27.0);
            let off = |v: f64| v - 30.8 * (v / 30.8).round();
            let distance = (off(x) * off(x) + off(y) * off(y)).sqrt();
            let cover = (6.0 - distance).clamp(0.0, 1.0);
            (140.0 - 110.0 * cover) as u8
        })
        .collect();
    encode(&pixels, SIZE)
}

fn encode(grey: &[u8], size: SizePx) -> Vec<u8> {
    let mut out = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut out, 90);
    encoder.encode(grey, size.width as u16, size.height as u16, jpeg_encoder::ColorType::Luma).expect("encodes");
    out
}

/// A folder with a recording of some frames in it.
struct Trial {
    dir: tempfile::TempDir,
}

impl Trial {
    fn new(frames_count: usize) -> Self {
        let trial = Trial { dir: tempfile::tempdir().expect("a folder") };
        fs::create_dir(trial.path("run")).expect("makes a folder");
        for i in 0..frames_count {
            trial.write(&format!("run/{i:03}.jpg"), &jpeg(i));
        }
        trial
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("writes");
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slipbound"));
        command.current_dir(self.dir.path()).args(arguments);
        command
    }

    /// Runs `slipbound watch SOURCE` with the finger and further arguments.
    fn watch(&self, source: &str, more: &[&str]) -> Ended {
        let arguments = [&["watch", source], &SENSOR[..], more].concat();
        Ended::of(self.command(&arguments).output().expect("runs"))
    }

    fn report(&self, name: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(name)).expect("a report");
        assert!(text.ends_with('\n'), "the last line is whole");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

/// How the command ended.
#[derive(Debug)]
struct Ended {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Ended {
    fn of(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Asserts the exit code, and that these words stand on standard error.
    #[track_caller]
    fn expect(&self, code: i32, said: &[&str]) -> &Self {
        assert_eq!(self.code, Some(code), "{self:?}");
        for words in said {
            assert!(self.err.contains(words), "no `{words}` in {self:?}");
        }
        assert!(!self.err.contains("panicked"), "{self:?}");
        self
    }
}

fn states(report: &[Value]) -> Vec<&str> {
    report[1..].iter().map(|line| line["state"].as_str().expect("a state")).collect()
}

#[test]
fn a_whole_recording_is_judged_from_its_first_frame_to_its_last() {
    let trial = Trial::new(6);
    let ended =
        trial.watch("run", &["--json", "report.json", "--markers", "--timings", "times.json", "--finger", "left"]);
    ended.expect(0, &[]);
    assert_eq!(ended.out, "6 frames, 0 slips: 6 no contact\n");
    assert_eq!(ended.err, "", "nothing to complain of");
    let report = trial.report("report.json");
    assert_eq!(states(&report), ["no_contact"; 6]);
    assert_eq!(report[0]["rest"].to_string(), r#"{"frames":[0,6],"kind":"unloaded"}"#);
    assert_eq!((&report[0]["clock"], &report[0]["source"]), (&"unknown".into(), &"run".into()));
    assert_eq!(report[0]["sensor"]["name"], "gelsight_mini_wide");
    assert!(report[0].get("note").is_none());
    for (i, line) in report[1..].iter().enumerate() {
        assert_eq!((&line["frame"], &line["seq"], &line["finger"]), (&i.into(), &i.into(), &"left".into()));
        let matched = line["markers"]["matched"].as_u64().expect("a count");
        assert!(matched >= 60, "{matched} markers");
        assert_eq!(
            line["field"].as_array().expect("a field").len() as u64,
            matched + line["markers"]["lost"].as_u64().expect("a count")
        );
    }
    let times = trial.report("times.json");
    assert_eq!(times.len(), 6);
    for key in ["imprint_us", "contact_us", "markers_us", "motion_us", "slip_us", "all_us"] {
        assert!(times[3][key].as_f64().expect("a number") >= 0.0, "{key}");
    }
}

#[test]
fn the_report_fits_the_published_schema_and_has_nothing_of_our_clock() {
    let trial = Trial::new(4);
    trial.write("run/002.jpg", b"");
    let reports = ["one.json", "two.json"].map(|name| {
        trial.watch("run", &["--json", name, "--markers"]).expect(3, &[]);
        fs::read(trial.path(name)).expect("a report")
    });
    assert!(reports[0] == reports[1], "two runs differ");
    let schema = serde_json::from_str(include_str!("../../../docs/report.schema.json")).expect("JSON");
    let schema = jsonschema::validator_for(&schema).expect("a schema");
    for line in trial.report("one.json") {
        let faults: Vec<String> = schema.iter_errors(&line).map(|e| e.to_string()).collect();
        assert!(faults.is_empty(), "{line}: {faults:?}");
    }
}

#[test]
fn the_report_alone_goes_to_standard_output() {
    let trial = Trial::new(3);
    let ended = trial.watch("run", &["--json", "-"]);
    ended.expect(0, &["3 frames, 0 slips"]);
    assert_eq!(ended.out.lines().filter(|line| serde_json::from_str::<Value>(line).is_ok()).count(), 4);
    assert_eq!(ended.out.lines().count(), 4);
}

#[test]
fn a_zero_byte_picture_is_torn_and_the_rest_is_judged() {
    let trial = Trial::new(6);
    trial.write("run/003.jpg", b"");
    let ended = trial.watch("run", &["--json", "report.json", "--overlay", "drawn"]);
    ended.expect(3, &["run: frame 3 (003.jpg) is torn: empty: zero bytes"]);
    assert!(
        ended.out.contains("6 frames") && ended.out.contains("1 frame torn; the first is frame 3 (003.jpg)"),
        "{ended:?}"
    );
    assert_eq!(ended.err.matches("torn").count(), 1, "said once: {ended:?}");
    let report = trial.report("report.json");
    assert_eq!(states(&report), ["no_contact", "no_contact", "no_contact", "unjudged", "no_contact", "no_contact"]);
    assert_eq!(report[4]["reason"], "torn frame");
    assert_eq!(fs::read_dir(trial.path("drawn")).expect("a folder").count(), 6);
}

#[test]
fn other_sizes_and_black_frames_are_unjudged_with_the_reason() {
    let trial = Trial::new(6);
    trial.write("run/000.jpg", &encode(&[128; 64 * 48], SizePx::new(64, 48)));
    trial.write("run/004.jpg", &encode(&vec![0; SIZE.area()], SIZE));
    let ended = trial.watch("run", &["--json", "report.json"]);
    ended.expect(0, &[]);
    assert!(
        ended.out.contains(
            "1 frame of another size; the first is frame 0 (000.jpg): frame size: expected 320x240, got 64x48"
        ),
        "{ended:?}"
    );
    assert!(ended.out.contains("1 frame dark; the first is frame 4 (004.jpg)"), "{ended:?}");
    let report = trial.report("report.json");
    assert_eq!(states(&report), ["unjudged", "no_contact", "no_contact", "no_contact", "unjudged", "no_contact"]);
    assert!(report[1]["reason"].as_str().expect("a reason").contains("got 64x48"));
    assert!(report[5]["reason"].as_str().expect("a reason").contains("dark"));
}

#[test]
fn without_a_whole_frame_it_says_what_tore_the_first() {
    let trial = Trial::new(0);
    trial.write("run/0.jpg", b"");
    trial.write("run/1.jpg", b"day one");
    trial
        .watch("run", &[])
        .expect(1, &["run: expected at least one whole frame, got none; frame 0 (0.jpg) is torn: empty"]);
}

#[test]
fn the_summary_tells_why_the_first_frame_is_torn() {
    let trial = Trial::new(3);
    trial.write("run/001.jpg", b"day one");
    let ended = trial.watch("run", &[]);
    assert!(ended.out.contains("1 frame torn; the first is frame 1 (001.jpg): neither JPEG nor PNG"), "{ended:?}");
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
    // Beside what is read, in a folder named as the finger is, and nowhere at all.
    trial.watch("run.avi", &["--overlay", "."]).expect(0, &[]);
    trial.watch("run", &["--overlay", SENSOR[1]]).expect(0, &[]);
    #[cfg(unix)]
    trial.watch("run", &["--json", "/dev/null", "--timings", "/dev/null"]).expect(0, &[]);
}

#[test]
fn markers_that_do_not_stand_a_pitch_apart_raise_a_doubt() {
    let trial = Trial::new(3);
    let arguments = ["watch", "run", "--sensor", "gelsight_mini_near", "--json", "report.json"];
    let ended = Ended::of(trial.command(&arguments).output().expect("runs"));
    ended.expect(
        0,
        &[
            "run: markers expected on a grid of 44.0 px (pitch_px of the sensor), got 30.8 px apart",
            "no frame is judged until",
        ],
    );
    let note = trial.report("report.json")[0]["note"].to_string();
    assert!(note.contains("right sensor file?"), "{note}");
    assert!(states(&trial.report("report.json")).iter().all(|state| *state == "unjudged"));
}

#[test]
fn every_help_explains_the_exit_codes() {
    let trial = Trial::new(0);
    for arguments in [&["--help"][..], &["-h"], &["watch", "--help"], &["watch", "-h"]] {
        let ended = Ended::of(trial.command(arguments).output().expect("runs"));
        ended.expect(0, &[]);
        for code in ["0  done", "1  failed", "2  what was asked for cannot be", "3  finished, but frames were torn"] {
            assert!(ended.out.contains(code), "no `{code}` in {arguments:?}: {ended:?}");
        }
    }
}

#[test]
fn only_black_frames_are_refused() {
    let trial = Trial::new(0);
    trial.write("run/0.jpg", &encode(&vec![0; SIZE.area()], SIZE));
    trial.watch("run", &[]).expect(1, &["run: no rest frame among the first 1 frames"]);
}

fn write_avi(path: &Path, frames_count: usize) {
    let mut avi = AviWriter::create(path, SIZE, 25).expect("creates");
    for i in 0..frames_count {
        avi.push(&jpeg(i)).expect("writes");
    }
    avi.finish().expect("finishes");
}

#[test]
fn a_truncated_avi_is_judged_as_far_as_it_goes() {
    let trial = Trial::new(0);
    write_avi(&trial.path("run.avi"), 6);
    trial.watch("run.avi", &["--json", "report.json"]).expect(0, &[]);
    assert_eq!(trial.report("report.json")[2]["time_ns"], 40_000_000);
    assert_eq!(trial.report("report.json")[0]["clock"], "assumed");

    let whole = fs::read(trial.path("run.avi")).expect("reads");
    trial.write("run.avi", &whole[..whole.len() * 7 / 10]);
    let ended = trial.watch("run.avi", &["--json", "report.json"]);
    ended.expect(3, &["run.avi: frame 4 is torn: frame cut off: the file ends at byte"]);
    assert_eq!(
        states(&trial.report("report.json")),
        ["no_contact", "no_contact", "no_contact", "no_contact", "unjudged"]
    );

    trial.write("run.avi", &whole[..100]);
    trial.watch("run.avi", &[]).expect(1, &["run.avi", "expected a list of frames", "the end of the file at byte 100"]);
    trial.write("run.avi", b"");
    trial.watch("run.avi", &[]).expect(1, &["run.avi", "0 bytes in all"]);
}

#[test]
fn arguments_that_cannot_be_exit_with_2() {
    let trial = Trial::new(3);
    trial.write("odd.jpg", &encode(&[128; 320 * 200], SizePx::new(320, 200)));
    trial.write("dot.jpg", &encode(&[128], SizePx::new(1, 1)));
    trial.write("dark.jpg", &encode(&vec![0; SIZE.area()], SIZE));
    trial.write("typo.toml", b"extends = \"gelsight_mini_wide\"\npich_px = 30\n");
    trial.write("negative.toml", b"[slip]\nthreshold_pitch = -1.0\n");
    trial.write("unknown.toml", b"[slip]\nthreshold_pich = 0.2\n");
    for (arguments, said) in [
        (&["nowhere.avi", "--sensor", "gelslim"][..], &["nowhere.avi", "there is no such file"][..]),
        (&["*.png", "--sensor", "gelslim"], &["*.png", "expected images"]),
        (&["run"], &["run: more than one", "320x240", "--sensor with one of gelsight_mini_near, gelsight_mini_wide"]),
        (&["odd.jpg"], &["odd.jpg: no built-in finger has frames of 320x200", "`slipbound sensors`"]),
        (&["dot.jpg", "--sensor", "gelslim"], &["dot.jpg: frames of 1x1: sensor gelslim: image_px"]),
        (&["odd.jpg/run.avi", "--sensor", "gelslim"], &["odd.jpg/run.avi: expected a folder", "there is no such file"]),
        (&[&"long".repeat(90), "--sensor", "gelslim"], &["there is no such file"]),
        (&["run", "--sensor", "gelslin"], &["`gelslin`", "did you mean `gelslim`?"]),
        (&["run", "--sensor", "typo.toml"], &["typo.toml: unknown key `pich_px`; did you mean `pitch_px`?"]),
        (&["run", "--sensor", "none.toml"], &["none.toml: cannot read"]),
        (&["odd.jpg", "--sensor", "gelslim"], &["sensor gelslim: image_px: expected 427x320", "got frames of 320x200"]),
        (
            &["run", "--settings", "negative.toml"],
            &["negative.toml: slip.threshold_pitch", "expected a number from", "got -1"],
        ),
        (
            &["run", "--settings", "unknown.toml"],
            &["unknown.toml: unknown key `slip.threshold_pich`", "`threshold_pitch`"],
        ),
        (&["run", "--rest", "5..3"], &["expected A below B, got 5..3"]),
        (&["run", "--rest", "5.."], &["expected two whole numbers A..B, got 5.."]),
        (
            &["run", "--rest", "1..9", "--sensor", "gelsight_mini_wide"],
            &["--rest 1..9: run ends before frame 8: it has 3 frames"],
        ),
        (&["run", "--rest", "no.png", "--sensor", "gelsight_mini_wide"], &["--rest no.png", "there is no such file"]),
        (
            &["run", "--rest", "dark.jpg", "--sensor", "gelsight_mini_wide"],
            &["--rest dark.jpg: frame 0 (dark.jpg): unusable as rest frame: dark"],
        ),
        (
            &["run", "--rest", "odd.jpg", "--sensor", "gelsight_mini_wide"],
            &["--rest odd.jpg: expected 320x240 as the frames of run, got 320x200"],
        ),
        (&["run", "--rest", "run", "--sensor", "gelsight_mini_wide"], &["--rest run: expected one image", "several"]),
        (&["run", "--markers"], &["--json"]),
        (&["run", "--color", "red"], &["--color"]),
    ] {
        let ended = Ended::of(trial.command(&[&["watch"], arguments].concat()).output().expect("runs"));
        ended.expect(2, said);
    }
    Ended::of(trial.command(&[]).output().expect("runs")).expect(2, &["Usage"]);
}

#[test]
fn rest_may_be_named() {
    let trial = Trial::new(6);
    trial.write("untouched.jpg", &jpeg(0));
    for (rest, frames) in [("2..5", "[2,5]"), ("untouched.jpg", "null")] {
        trial.watch("run", &["--rest", rest, "--json", "report.json"]).expect(0, &[]);
        let report = trial.report("report.json");
        assert_eq!(report[0]["rest"].to_string(), format!(r#"{{"frames":{frames},"kind":"given"}}"#));
        assert_eq!(report.len(), 7, "all frames are judged, those of rest too");
    }
    trial.write("run/000.jpg", &encode(&[128; 64 * 48], SizePx::new(64, 48)));
    let ended = trial.watch("run", &["--rest", "untouched.jpg", "--json", "report.json"]);
    ended.expect(0, &[]);
    assert!(ended.out.contains("1 frame of another size; the first is frame 0"), "{ended:?}");
}

#[test]
fn the_finger_is_taken_by_frame_size_only_when_there_is_no_doubt() {
    let trial = Trial::new(0);
    let watch = |width: usize, height: usize| {
        trial.write("run/0.jpg", &encode(&vec![128; width * height], SizePx::new(width, height)));
        Ended::of(trial.command(&["watch", "run"]).output().expect("runs"))
    };
    watch(640, 480).expect(1, &["run: too few markers"]);
    watch(427, 320).expect(2, &["more than one built-in finger has frames of 427x320", "gelslim, gelslim3"]);
}

#[test]
#[cfg(unix)]
fn what_was_judged_is_kept_when_a_later_file_cannot_be_read() {
    let trial = Trial::new(4);
    std::os::unix::fs::symlink("nowhere", trial.path("run/002_.jpg")).expect("links");
    let ended = trial.watch("run", &["--json", "report.json", "--overlay", "drawn.avi"]);
    ended.expect(1, &["002_.jpg: cannot read", "No such file"]);
    assert_eq!(ended.err.matches("No such file").count(), 1, "said once: {ended:?}");
    assert!(ended.out.contains("3 frames"), "{ended:?}");
    assert_eq!(states(&trial.report("report.json")), ["no_contact"; 3]);
    let ended = trial.watch("drawn.avi", &[]);
    assert!(!ended.err.contains("torn"), "the video was closed: {ended:?}");
}

#[test]
fn without_ffmpeg_it_says_what_to_install() {
    let trial = Trial::new(0);
    write_avi(&trial.path("run.avi"), 3);
    let mut bytes = fs::read(trial.path("run.avi")).expect("reads");
    while let Some(at) = bytes.windows(4).position(|w| w == b"MJPG") {
        bytes[at..at + 4].copy_from_slice(b"FMP4");
    }
    trial.write("run.avi", &bytes);
    let mut command = trial.command(&["watch", "run.avi", SENSOR[0], SENSOR[1]]);
    let ended = Ended::of(command.env("PATH", trial.dir.path()).output().expect("runs"));
    ended.expect(1, &["run.avi: decoding the codec FMP4 needs the program `ffmpeg`", "apt install ffmpeg"]);
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let trial = Trial::new(200);
    let mut command = trial.command(&["watch", "run", SENSOR[0], SENSOR[1], "--json", "-", "--markers"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let mut line = String::new();
    BufReader::with_capacity(64, child.stdout.take().expect("a pipe")).read_line(&mut line).expect("reads");
    assert!(line.contains("slipbound-report"));
    let ended = Ended::of(child.wait_with_output().expect("ends"));
    ended.expect(0, &[]);
    assert_eq!(ended.err, "");
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
fn the_built_in_fingers_are_listed() {
    let trial = Trial::new(0);
    let ended = Ended::of(trial.command(&["sensors"]).output().expect("runs"));
    ended.expect(0, &[]);
    let names: Vec<&str> = ended.out.lines().map(|line| line.split(' ').next().expect("a word")).collect();
    assert_eq!(names, ["NAME", "gelsight", "gelsight_mini_near", "gelsight_mini_wide", "gelslim", "gelslim3"]);
    assert!(ended.out.contains("427x320") && ended.out.contains("unknown"));
}

#[test]
fn no_input_frame_is_overwritten_and_other_files_only_if_they_are_ours_or_by_force() {
    let trial = Trial::new(3);
    let frame = fs::read(trial.path("run/001.jpg")).expect("reads");
    trial.watch("run", &["--json", "run/001.jpg"]).expect(2, &["--json run/001.jpg", "that of the frame"]);
    trial.watch("run", &["--json", "run/001.jpg", "--force"]).expect(2, &["that of the frame"]);
    trial.watch("run/0*.jpg", &["--timings", "run/002.jpg"]).expect(2, &["that of the frame"]);
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

#[test]
fn hostile_names_and_headers_and_endless_settings_do_no_harm() {
    let trial = Trial::new(4);
    // A header of 60000 x 60000, and nothing else: 10.8 GB if it were believed.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60, 8, 2, 0, 0, 0]);
    png.extend(0x0FB0_E215u32.to_be_bytes());
    png.extend(b"\0\0\0\0IDAT\x35\xAF\x06\x1E");
    trial.write("run/002.png", &png);
    trial.watch("run", &[]).expect(3, &["002.png) is torn: PNG"]);

    trial.write("large.toml", "# a comment\n".repeat(200_000).as_bytes());
    trial.watch("run", &["--settings", "large.toml"]).expect(2, &["expected at most 1048576 bytes of TOML, got more"]);
    #[cfg(unix)]
    {
        let output = trial.command(&["watch", "run", "--sensor", "/dev/zero"]).output().expect("runs");
        assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for name in ["\u{1b}[31mred\u{1b}[2J", "two words", "\u{3b1}\u{3b2}"] {
        let escaped = name.replace('\u{1b}', "\\u{1b}");
        for arguments in
            [vec!["watch", name], vec!["watch", "run", "--sensor", name], vec!["watch", "run", "--wrong", name]]
        {
            let output = trial.command(&arguments).output().expect("runs");
            let told = [output.stdout, output.stderr].concat();
            assert_eq!(output.status.code(), Some(2), "{arguments:?}");
            assert!(!told.contains(&0x1b), "{}", told.escape_ascii());
            let text = String::from_utf8(told).expect("UTF-8");
            assert!(text.contains(&escaped) || arguments.len() == 4, "{arguments:?}: {text}");
        }
        // And with a folder of that name: it is read.
        fs::create_dir(trial.path(name)).expect("made");
        fs::copy(trial.path("run/000.jpg"), trial.path(name).join("a b\u{1b}[0m.jpg")).expect("copied");
        trial.watch(name, &[]).expect(0, &[]);
    }
}
