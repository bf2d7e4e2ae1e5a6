//! Recordings that are damaged, or not what they seem.

use super::trial::{SENSOR, SIZE, Trial, encode, states, write_avi};
use crate::program::Ended;
use slipbound::image::SizePx;
use std::fs;

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
    ended.expect(3, &[]);
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
fn markers_that_do_not_stand_a_pitch_apart_raise_a_doubt() {
    let trial = Trial::new(3);
    let arguments = ["watch", "run", "--sensor", "gelsight_mini_near", "--json", "report.json"];
    let ended = Ended::of(trial.command(&arguments).output().expect("runs"));
    ended.expect(
        1,
        &[
            "run: markers expected on a grid of 44.0 px (pitch_px of the sensor), got 30.8 px apart",
            "no frame is judged until",
            "run: none of 3 frames could be judged: 3 frames with markers that do not stand a pitch apart",
        ],
    );
    let note = trial.report("report.json")[0]["note"].to_string();
    assert!(note.contains("right sensor file?"), "{note}");
    assert!(states(&trial.report("report.json")).iter().all(|state| *state == "unjudged"));
    // A loop reports it, too, and not that it starts in contact, which is not known.
    let trial = Trial::new(40);
    let arguments = ["hold", "run", "--sensor", "gelsight_mini_near", "--gripper", "dry", "-o", "held"];
    let ended = Ended::of(trial.command(&arguments).output().expect("runs"));
    let said = "left: no frame can be judged: markers expected on a grid of 44.0 px (pitch_px of the sensor), got 30.8 px apart";
    assert!(ended.code == Some(1) && ended.out.contains(said), "{ended:?}");
    let events = std::fs::read_to_string(trial.path("held/events.jsonl")).expect("events");
    assert_eq!(events.matches("no frame can be judged").count(), 1, "{events}");
    assert!(!events.contains("starts in contact"), "{events}");
}

#[test]
fn only_black_frames_are_refused() {
    let trial = Trial::new(0);
    trial.write("run/0.jpg", &encode(&vec![0; SIZE.area()], SIZE));
    trial.watch("run", &[]).expect(1, &["run: no rest frame among the first 1 frames"]);
}

#[test]
fn a_sweep_over_clips_of_which_none_can_be_judged_fails_with_the_reason_of_the_first() {
    let trial = Trial::new(0);
    fs::create_dir_all(trial.path("clips/a")).expect("a folder");
    trial.write("clips/a/0.jpg", &encode(&vec![0; SIZE.area()], SIZE));
    let arguments = ["eval", "lifts", "--data", "clips", "--detector", "ours", "-o", "out"];
    let ended = Ended::of(trial.command(&arguments).output().expect("runs"));
    let said = "lifts: expected trials that can be judged, got none; the first: a: unusable as rest frame: dark frame";
    assert!(ended.code == Some(1) && ended.err.contains(said), "{ended:?}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_clip_whose_name_is_no_text_is_told() {
    use std::os::unix::ffi::OsStrExt as _;
    let trial = Trial::new(0);
    fs::create_dir_all(trial.path("clips").join(std::ffi::OsStr::from_bytes(b"a\xFF"))).expect("a folder");
    let ended = Ended::of(trial.command(&["eval", "lifts", "--data", "clips", "-o", "out"]).output().expect("runs"));
    ended.expect(2, &["\"clips/a\\xFF\": expected the name of a clip in UTF-8"]);
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
fn hostile_names_and_headers_and_endless_settings_do_no_harm() {
    let trial = Trial::new(4);
    // A header of 60000 x 60000, and nothing else: 10.8 GB if it were trusted.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60, 8, 2, 0, 0, 0]);
    png.extend(0x0FB0_E215u32.to_be_bytes());
    png.extend(b"\0\0\0\0IDAT\x35\xAF\x06\x1E");
    trial.write("run/002.png", &png);
    trial.watch("run", &[]).expect(3, &["002.png) is torn: PNG"]);

    trial.write("large.toml", "# a comment\n".repeat(200_000).as_bytes());
    trial
        .watch("run", &["--settings", "large.toml"])
        .expect(2, &["expected at most 1048576 bytes of TOML, got 2400000"]);
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

/// A rate that no camera has gives no times: frames have none, and that is reported once.
#[test]
fn a_rate_that_cannot_be_is_not_believed() {
    let trial = Trial::new(0);
    write_avi(&trial.path("run.avi"), 3);
    let whole = fs::read(trial.path("run.avi")).expect("reads");
    // Frames in this many seconds, as in the stream's header.
    let at = whole.windows(4).position(|bytes| bytes == b"strh").expect("a header") + 8 + 20;
    for (frames, seconds, is_told) in [(1_000_000u32, 1u32, true), (1, 11, true), (1000, 1, false), (0, 1, false)] {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&seconds.to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&frames.to_le_bytes());
        trial.write("run.avi", &bytes);
        let ended = trial.watch("run.avi", &["--json", "report.json", "--rest", "0..2"]);
        ended.expect(0, &[]);
        let said = "run.avi: expected 0.1 to 1000 frames per second in its header";
        assert_eq!(ended.err.matches(said).count(), usize::from(is_told), "{frames}/{seconds}: {ended:?}");
        let (report, has_time) = (trial.report("report.json"), !is_told && frames > 0);
        assert_eq!(report[2]["time_ns"].is_null(), !has_time, "{frames}/{seconds}");
        assert_eq!(report[0]["clock"], if has_time { "assumed" } else { "unknown" });
    }
}

#[cfg(unix)]
#[test]
fn a_picture_that_cannot_be_read_is_torn_and_what_is_no_picture_is_passed_over() {
    let trial = Trial::new(4);
    std::os::unix::fs::symlink("nowhere.jpg", trial.path("run/0015.jpg")).expect("linked");
    trial.write("run/._001.jpg", b"\0\x05\x16\x07");
    let made = std::process::Command::new("mkfifo").arg(trial.path("run/0025.jpg")).status().expect("runs");
    assert!(made.success());
    let ended = trial.watch("run", &["--json", "report.json"]);
    ended.expect(3, &["(0015.jpg) is torn: cannot read: No such file or directory"]);
    assert!(ended.out.contains("5 frames"), "{ended:?}");
}
