//! Valid and invalid arguments.

use super::trial::{SENSOR, SIZE, Trial, encode, jpeg};
use crate::program::Ended;
use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound_rig::container::{Recorder, TappedSource};
use slipbound_rig::source;
use std::fs;

/// As a shell hands over the pattern `run/*.jpg`.
#[test]
fn images_of_one_folder_are_not_taken_for_recordings() {
    let trial = Trial::new(3);
    let images = ["run/000.jpg", "run/001.jpg", "run/002.jpg"];
    for words in [&[&["watch"], &images[..], &SENSOR].concat(), &[&["record"], &images[..], &["-o", "x.mcap"]].concat()]
    {
        let ended = Ended::of(trial.command(words).output().expect("runs"));
        ended.expect(2, &["got 3 images of ", "name the folder, or quote the pattern"]);
    }
    assert!(!trial.path("x.mcap").exists());
    fs::create_dir(trial.path("other")).expect("made");
    trial.write("other/000.jpg", &jpeg(0));
    trial.watch("run/000.jpg", &["other/000.jpg"]).expect(0, &[]);
}

#[test]
fn every_help_explains_the_exit_codes() {
    let trial = Trial::new(0);
    for arguments in [&["--help"][..], &["-h"], &["watch", "--help"], &["watch", "-h"]] {
        let ended = Ended::of(trial.command(arguments).output().expect("runs"));
        ended.expect(0, &[]);
        for code in ["0  done", "1  failed", "2  invalid request", "3  finished, but frames were torn"] {
            assert!(ended.out.contains(code), "no `{code}` in {arguments:?}: {ended:?}");
        }
    }
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
fn the_rest_that_the_arguments_name_is_used_and_is_in_the_header() {
    let trial = Trial::new(6);
    trial.write("untouched.jpg", &jpeg(0));
    for (rest, frames) in [("2..5", "[2,5]"), ("untouched.jpg", "null")] {
        trial.watch("run", &["--rest", rest, "--json", "report.json"]).expect(0, &[]);
        let report = trial.report("report.json");
        assert_eq!(report[0]["rest"].to_string(), format!(r#"{{"frames":{frames},"kind":"given"}}"#));
        assert_eq!(report.len(), 7, "all frames are judged, those of rest too");
    }
    let ended = trial.watch("run", &["--rest", "held", "--json", "report.json"]);
    ended.expect(0, &[]);
    let report = trial.report("report.json");
    assert_eq!(report[0]["rest"].to_string(), r#"{"frames":[0,6],"kind":"in_contact"}"#, "nothing shows there");
    assert_eq!(report[0]["settings"]["rest"]["held"], true);
    assert!(!ended.err.contains("starts in contact"), "who says it knows it: {ended:?}");
    // The nearer setting counts: that of the arguments, not that of the file.
    trial.write("held.toml", b"[rest]\nheld = true\n");
    let ended = trial.watch("run", &["--rest", "live:6", "--settings", "held.toml", "--json", "report.json"]);
    ended.expect(0, &[]);
    assert_eq!(trial.report("report.json")[0]["rest"]["kind"], "unloaded");
    trial.write("run/000.jpg", &encode(&[128; 64 * 48], SizePx::new(64, 48)));
    let ended = trial.watch("run", &["--rest", "untouched.jpg", "--json", "report.json"]);
    ended.expect(3, &[]);
    assert!(ended.out.contains("1 frame of another size; the first is frame 0"), "{ended:?}");
}

/// Frames of half the resolution of the sensor file, recorded with the finger's file: the rest frame is still its own.
#[test]
fn a_rest_file_fits_its_finger_at_any_resolution() {
    let trial = Trial::new(25);
    let small = slipbound_rig::sensors::load(SENSOR[1]).expect("built in").at_size(SIZE).expect("the same shape");
    let large = small.at_size(SizePx::new(640, 480)).expect("the same shape");
    for (name, sensor) in [("small.toml", &small), ("large.toml", &large)] {
        trial.write(name, slipbound_rig::sensors::to_toml(sensor).expect("writes").as_bytes());
    }
    let report = |words: &[&str]| {
        let words = [&["watch"], words, &["--json", "report.jsonl", "--force"]].concat();
        Ended::of(trial.command(&words).output().expect("runs")).expect(0, &[]);
        trial.report("report.jsonl").split_off(1)
    };
    let tare = |words: &[&str]| Ended::of(trial.command(&[&["tare"], words].concat()).output().expect("runs"));
    tare(&["run", "--sensor", "large.toml", "-o", "a.rest"]).expect(0, &[]);
    let once = report(&["run", "--sensor", "large.toml", "--rest", "a.rest", "--record", "run.mcap"]);
    assert_eq!(report(&["run.mcap", "--rest", "a.rest"]), once);
    // As from a recording with the finger's file at the resolution of the frames.
    assert_eq!(report(&["run", "--sensor", "small.toml", "--rest", "a.rest"]), once);
    tare(&["run", "--sensor", "small.toml", "-o", "b.rest"]).expect(0, &[]);
    assert_eq!(report(&["run.mcap", "--rest", "b.rest"]), once);
    let other = slipbound::sensor::Sensor { pitch_px: 1.01 * large.pitch_px, ..large };
    trial.write("other.toml", slipbound_rig::sensors::to_toml(&other).expect("writes").as_bytes());
    let words = ["watch", "run", "--sensor", "other.toml", "--rest"];
    for rest in ["a.rest", "b.rest"] {
        let ended = Ended::of(trial.command(&[&words[..], &[rest]].concat()).output().expect("runs"));
        ended.expect(2, &["it is another finger's: pitch_px"]);
    }
}

/// A folder of images whose numbers begin at 100, as in a recording that begins while the camera runs.
struct Late(Box<dyn FrameSource + Send>);

impl FrameSource for Late {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.0.next(into);
        into.seq += 100;
        next
    }
}

#[test]
fn numbers_that_no_frame_has_are_no_rest_frame() {
    let trial = Trial::new(4);
    let recorder = Recorder::create(&trial.path("late.mcap"), &["finger".into()], false).expect("creates");
    let run = source::open(trial.path("run").to_str().expect("UTF-8")).expect("opens");
    let mut late = TappedSource::new(Late(run), 0, recorder.inlet(), true);
    while late.next(&mut FrameBuffer::default()).expect("goes on") != Next::End {}
    recorder.finish().expect("closes");
    let refused = "--rest 0..20: late.mcap has no frame there; its first is frame 100";
    trial.watch("late.mcap", &["--rest", "0..20"]).expect(2, &[refused]);
    trial.write("run/001.jpg", b"");
    trial.watch("run", &["--rest", "1..2"]).expect(2, &["--rest 1..2: every frame is torn"]);
}

#[test]
fn frames_of_a_source_that_can_be_read_only_once_are_no_rest_frame() {
    let trial = Trial::new(3);
    let outputs = ["--json", "report.json", "--record", "run.mcap", "--overlay", "drawn"];
    let refused = |sources: &[&str], got: &str| {
        let arguments = [&["watch"], sources, &["--rest", "0..2", "--sensor", "gelslim"], &outputs].concat();
        let mut command = trial.command(&arguments);
        let ended = Ended::of(command.stdin(std::process::Stdio::null()).output().expect("runs"));
        let expected = "--rest 0..2: expected a recording that can be read twice, got ";
        ended.expect(2, &[&format!("{expected}{got}; use --rest live:N")]);
        let written = ["report.json", "run.mcap", "drawn"].map(|name| trial.path(name).exists());
        assert_eq!(written, [false; 3], "{sources:?}");
    };
    refused(&["-"], "standard input");
    refused(&["http://127.0.0.1:9/"], "the camera http://127.0.0.1:9/");
    #[cfg(unix)]
    {
        let made = std::process::Command::new("mkfifo").arg(trial.path("pipe")).status().expect("runs");
        assert!(made.success());
        refused(&["pipe"], "pipe, a pipe or a device");
        refused(&["run", "pipe"], "pipe, a pipe or a device");
    }
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
fn the_built_in_fingers_are_listed() {
    let trial = Trial::new(0);
    let ended = Ended::of(trial.command(&["sensors"]).output().expect("runs"));
    ended.expect(0, &[]);
    let names: Vec<&str> = ended.out.lines().map(|line| line.split(' ').next().expect("a word")).collect();
    assert_eq!(names, ["NAME", "gelsight", "gelsight_mini_near", "gelsight_mini_wide", "gelslim", "gelslim3"]);
    assert!(ended.out.contains("427x320") && ended.out.contains("unknown"));
}
