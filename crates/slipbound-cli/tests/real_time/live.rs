//! Live sources from outside: a served stream is watched, recorded, killed and judged again; a hand holds with two of
//! them.
#![cfg(unix)]

use crate::program::{printed, signal, slipbound_in, start_in};
use serde_json::Value;
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

const SIZE: (usize, usize) = (320, 240);
const PERIOD: Duration = Duration::from_millis(33);

/// Dots of 11 px on a grid of 30.8 px, a little further to the right from frame to frame.
pub(crate) fn jpeg(frame: usize) -> Vec<u8> {
    let pixels: Vec<u8> = (0..SIZE.0 * SIZE.1)
        .map(|i| {
            let (x, y) = ((i % SIZE.0) as f64 - 20.0 - 0.01 * (frame % 50) as f64, (i / SIZE.0) as f64 - 27.0);
            let off = |v: f64| v - 30.8 * (v / 30.8).round();
            let cover = (6.0 - (off(x) * off(x) + off(y) * off(y)).sqrt()).clamp(0.0, 1.0);
            (140.0 - 110.0 * cover) as u8
        })
        .collect();
    let mut out = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut out, 90);
    encoder.encode(&pixels, SIZE.0 as u16, SIZE.1 as u16, jpeg_encoder::ColorType::Luma).expect("encodes");
    out
}

/// Behaviour of the stream besides giving a frame every 33 ms.
#[derive(Clone, Copy, Default)]
pub(crate) struct Trouble {
    /// Stalls for this long before this frame.
    pub(crate) stall: Option<(usize, Duration)>,
    /// Tears this frame.
    pub(crate) tears: Option<usize>,
    /// Is silent for good from this frame.
    pub(crate) silent_from: Option<usize>,
    /// Answers this long after it was called.
    pub(crate) answers_after: Duration,
}

/// Serves a finger's camera to every client; returns the address.
pub(crate) fn serve(trouble: Trouble) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}/left", listener.local_addr().expect("bound"));
    thread::spawn(move || {
        for socket in listener.incoming().flatten() {
            thread::spawn(move || drop(play(socket, trouble))); // a client may hang up at any time
        }
    });
    url
}

fn play(mut socket: TcpStream, trouble: Trouble) -> std::io::Result<()> {
    assert!(socket.read(&mut [0; 1000])? > 0, "no request");
    thread::sleep(trouble.answers_after);
    socket.write_all(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=cam\r\n\r\n")?;
    for frame in 0.. {
        if trouble.silent_from == Some(frame) {
            thread::sleep(Duration::from_secs(60));
        }
        match trouble.stall {
            Some((at, long)) if at == frame => thread::sleep(long),
            _ => thread::sleep(PERIOD),
        }
        let mut bytes = jpeg(frame);
        if trouble.tears == Some(frame) {
            bytes.truncate(bytes.len() / 2);
        }
        write!(socket, "--cam\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", bytes.len())?;
        socket.write_all(&bytes)?;
        socket.write_all(b"\r\n")?;
    }
    Ok(())
}

/// Waits until a file has this many lines.
fn until_lines(path: &Path, count: usize) {
    let from = Instant::now();
    while fs::read_to_string(path).map_or(0, |text| text.lines().count()) < count {
        assert!(from.elapsed() < Duration::from_secs(60), "{} never had {count} lines", path.display());
        thread::sleep(Duration::from_millis(20));
    }
}

/// The lines of a report without its header.
fn lines(path: &Path) -> Vec<String> {
    fs::read_to_string(path).expect("a report").lines().skip(1).map(str::to_owned).collect()
}

const WATCH: [&str; 3] = ["watch", "--sensor", "gelsight_mini_wide"];

#[test]
fn what_was_watched_live_is_judged_again_from_its_recording_to_the_same_lines() {
    let scratch = tempfile::tempdir().expect("a folder");
    let trouble = Trouble { stall: Some((30, Duration::from_millis(700))), tears: Some(40), ..Trouble::default() };
    let url = serve(trouble);
    let live = ["--json", "live.jsonl", "--record", "run.mcap", "--rest", "live:20", &url];
    let child = start_in(scratch.path(), &[&WATCH[..], &live].concat());
    until_lines(&scratch.path().join("live.jsonl"), 60);
    signal(&child, "-INT");
    let ended = child.wait_with_output().expect("ends");
    let said = printed(&ended);
    assert_eq!(ended.status.code(), Some(3), "a torn frame: {said}");
    for words in ["no frame for 0.", "frames again after 0.", "camera: ", "1 torn", "format Motion JPEG over HTTP"] {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
    let again = ["--json", "again.jsonl", "--rest", "live:20", "run.mcap"];
    let replayed = slipbound_in(scratch.path(), &[&WATCH[..], &again].concat());
    let (live, again) = (lines(&scratch.path().join("live.jsonl")), lines(&scratch.path().join("again.jsonl")));
    assert!(live.len() >= 59, "{}", live.len());
    assert_eq!(live, again);
    // On a slow machine a newer frame may have replaced the torn one.
    let is_torn_judged = live.iter().any(|line| line.contains("\"torn frame\""));
    assert_eq!(replayed.status.code(), Some(if is_torn_judged { 3 } else { 0 }), "{}", printed(&replayed));
    let time_ns = |line: &String| serde_json::from_str::<Value>(line).expect("JSON")["time_ns"].as_u64();
    assert!(live.iter().all(|line| time_ns(line).is_some()), "times of arrival");
}

#[test]
fn a_recording_that_was_killed_is_readable_to_its_last_chunk() {
    let scratch = tempfile::tempdir().expect("a folder");
    let url = serve(Trouble::default());
    let live = ["--json", "live.jsonl", "--record", "run.mcap", &url];
    let mut child = start_in(scratch.path(), &[&WATCH[..], &live].concat());
    until_lines(&scratch.path().join("live.jsonl"), 80);
    child.kill().expect("kill -9");
    child.wait().expect("ends");
    let again = ["--json", "again.jsonl", "run.mcap"];
    let replayed = slipbound_in(scratch.path(), &[&WATCH[..], &again].concat());
    let said = printed(&replayed);
    assert!(said.contains("cut off"), "{said}");
    // Other readers stop, or fail, at an impossible length.
    let bytes = std::fs::read(scratch.path().join("run.mcap")).expect("the recording");
    assert!(
        !bytes.windows(9).any(|head| *head == [6, 255, 255, 255, 255, 255, 255, 255, 255]),
        "a chunk of 2^64 bytes"
    );
    let (live, mut again) = (lines(&scratch.path().join("live.jsonl")), lines(&scratch.path().join("again.jsonl")));
    assert!(again.pop().is_some_and(|line| line.contains("\"torn frame\"")), "the end is said to be missing");
    assert!(live.starts_with(&again), "what is there is the same");
    let lost_count = live.len() - again.len();
    assert!(lost_count <= 40, "{lost_count} of {} frames were lost, at 30 Hz and chunks of half a second", live.len());
}

#[test]
fn two_cameras_hold_are_recorded_and_a_blocked_one_does_not_keep_ctrl_c_waiting() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (left, right) = (serve(Trouble::default()), serve(Trouble { silent_from: Some(90), ..Trouble::default() }));
    let hold = ["hold", &left, &right, "--sensor", "gelsight_mini_wide", "--gripper", "dry", "--rest", "live:20"];
    let files = ["--record=run.mcap", "-o", "run"];
    let child = start_in(scratch.path(), &[&hold[..], &files].concat());
    until_lines(&scratch.path().join("run/reports.jsonl"), 130);
    let from = Instant::now();
    signal(&child, "-INT");
    let ended = child.wait_with_output().expect("ends");
    assert!(from.elapsed() < Duration::from_secs(8), "{:?}", from.elapsed());
    let said = printed(&ended);
    for words in ["right: no frame for 0.3 s", "left: camera: ", "right: camera: ", "interrupted"] {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
    let again = ["--json", "left.jsonl", "run.mcap#left"];
    let replayed = slipbound_in(scratch.path(), &[&WATCH[..], &again].concat());
    assert_eq!(replayed.status.code(), Some(0), "{}", printed(&replayed));
    assert!(lines(&scratch.path().join("left.jsonl")).len() > 100);
    let run = fs::read_to_string(scratch.path().join("run/run.toml")).expect("what was run");
    assert!(run.contains("Motion JPEG over HTTP"), "{run}");
}

#[test]
fn record_takes_cameras_as_they_come_and_devices_needs_none() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (left, right) = (serve(Trouble::default()), serve(Trouble::default()));
    let record = ["record", &left, &right, "-o", "run.mcap", "--for-s", "1.5", "--sensor", "gelsight_mini_wide"];
    let ended = slipbound_in(scratch.path(), &record);
    assert_eq!(ended.status.code(), Some(0), "{}", printed(&ended));
    assert!(printed(&ended).contains("left: ") && printed(&ended).contains(" Hz"), "{}", printed(&ended));
    let watched = slipbound_in(scratch.path(), &[&WATCH[..], &["run.mcap#right"]].concat());
    assert_eq!(watched.status.code(), Some(0), "{}", printed(&watched));

    let devices = slipbound_in(scratch.path(), &["devices"]);
    assert_eq!(devices.status.code(), Some(0), "{}", printed(&devices));
    assert!(printed(&devices).contains("wsg50://HOST:1000"), "{}", printed(&devices));
    let rules = slipbound_in(scratch.path(), &["devices", "--udev"]);
    assert!(printed(&rules).contains("SUBSYSTEM==\"video4linux\""), "{}", printed(&rules));
}

/// As `| tee log` does on Ctrl-C.
#[test]
fn a_reader_that_leaves_costs_a_recording_nothing() {
    for command in [
        &["record", "-o", "run.mcap", "--sensor", "gelsight_mini_wide"][..],
        &[&WATCH[..], &["--record", "run.mcap"]].concat(),
    ] {
        let scratch = tempfile::tempdir().expect("a folder");
        let url = serve(Trouble::default());
        let mut child = start_in(scratch.path(), &[command, &[&url]].concat());
        let from = Instant::now();
        while fs::metadata(scratch.path().join("run.mcap")).map_or(0, |facts| facts.len()) < 800_000 {
            assert!(from.elapsed() < Duration::from_secs(60), "nothing is recorded");
            thread::sleep(Duration::from_millis(20));
        }
        drop(child.stdout.take());
        signal(&child, "-INT");
        let ended = child.wait_with_output().expect("ends");
        assert_eq!(ended.status.code(), Some(0), "{}", printed(&ended));
        let again = slipbound_in(scratch.path(), &[&WATCH[..], &["run.mcap"]].concat());
        assert_eq!(again.status.code(), Some(0), "{}", printed(&again));
    }
}

#[test]
fn what_is_judged_in_part_is_recorded_as_cut_off() {
    let scratch = tempfile::tempdir().expect("a folder");
    let watch = ["watch", "sim:press?hold_s=1000&grid=fast", "--record", "run.mcap", "--json", "lines.jsonl"];
    let child = start_in(scratch.path(), &watch);
    until_lines(&scratch.path().join("lines.jsonl"), 10);
    signal(&child, "-INT");
    let ended = child.wait_with_output().expect("ends");
    assert_eq!(ended.status.code(), Some(1), "{}", printed(&ended));
    let again = slipbound_in(scratch.path(), &["watch", "run.mcap"]);
    assert!(printed(&again).contains("the recording is cut off"), "{}{}", printed(&ended), printed(&again));
}

/// An image that waited for the other camera would be the first of the recording, and old.
#[test]
fn a_camera_that_is_there_first_is_recorded_from_when_the_last_one_is() {
    let scratch = tempfile::tempdir().expect("a folder");
    // A busy machine sends eleven frames in a second where thirty are due.
    let late = Trouble { answers_after: Duration::from_secs(2), ..Trouble::default() };
    let (left, right) = (serve(Trouble::default()), serve(late));
    let record = ["record", &left, &right, "-o", "run.mcap", "--for-s", "1"];
    let ended = slipbound_in(scratch.path(), &record);
    assert_eq!(ended.status.code(), Some(0), "{}", printed(&ended));
    let again = ["--json", "left.jsonl", "run.mcap#left"];
    let watched = slipbound_in(scratch.path(), &[&WATCH[..], &again].concat());
    let lines = lines(&scratch.path().join("left.jsonl"));
    let first: Value = serde_json::from_str(lines.first().expect("a frame")).expect("JSON");
    assert!(first["seq"].as_u64().is_some_and(|seq| seq > 15), "{first}{}", printed(&watched));
    assert!(lines.len() < 45, "{} frames of one second", lines.len());
}

#[test]
fn doctor_calls_nothing_good_that_a_stream_does_not_tell() {
    let scratch = tempfile::tempdir().expect("a folder");
    let seen = slipbound_in(scratch.path(), &["doctor", &serve(Trouble::default())]);
    assert!(printed(&seen).contains("good  rate: "), "{}", printed(&seen));
    assert!(printed(&seen).contains("look  locked: a stream does not tell\n      lock exposure"), "{}", printed(&seen));
}

#[test]
fn what_cannot_be_a_camera_is_refused() {
    let scratch = tempfile::tempdir().expect("a folder");
    for (uri, code, expected) in [
        ("v4l2:0", 2, "numbers change"),
        ("v4l2:no such camera", 2, "`slipbound devices`"),
        ("v4l2:x?size=9", 2, "size=WIDTHxHEIGHT"),
        ("http://127.0.0.1:1/", 1, "127.0.0.1:1"),
        ("http://", 2, "expected http://HOST"),
    ] {
        let ended = slipbound_in(scratch.path(), &["watch", uri]);
        assert_eq!(ended.status.code(), Some(code), "{uri}: {}", printed(&ended));
        assert!(printed(&ended).contains(expected), "{uri}: {}", printed(&ended));
    }
}

/// Frames of a simulated scene, from a touched one on.
#[test]
fn a_touched_finger_is_refused_where_rest_is_to_be_live() {
    let scratch = tempfile::tempdir().expect("a folder");
    let made = slipbound_in(scratch.path(), &["simulate", "ramp", "--seed", "3", "-o", "all"]);
    assert!(made.status.success(), "{}", printed(&made));
    let mut frames: Vec<_> =
        fs::read_dir(scratch.path().join("all")).expect("a folder").flatten().map(|e| e.path()).collect();
    frames.retain(|path| path.extension().is_some_and(|kind| kind == "jpg" || kind == "png"));
    frames.sort();
    let touched = scratch.path().join("touched");
    fs::create_dir(&touched).expect("makes a folder");
    for frame in &frames[frames.len() / 2..] {
        fs::copy(frame, touched.join(frame.file_name().expect("a name"))).expect("copies");
    }
    for (source, code) in [("all", 0), ("touched", 1)] {
        let watch = ["watch", source, "--sensor", "all/sensor.toml", "--rest", "live:10"];
        let ended = slipbound_in(scratch.path(), &watch);
        assert_eq!(ended.status.code(), Some(code), "{source}: {}", printed(&ended));
        assert_eq!(
            printed(&ended).contains("expected a finger that nothing touches"),
            code == 1,
            "{}",
            printed(&ended)
        );
    }
    let hold = ["hold", "touched", "--sensor", "all/sensor.toml", "--gripper", "dry", "--rest", "live:10", "-o", "run"];
    let ended = slipbound_in(scratch.path(), &hold);
    assert_eq!(ended.status.code(), Some(1), "{}", printed(&ended));
    assert!(printed(&ended).contains("expected a finger that nothing touches"), "{}", printed(&ended));
    let ended = slipbound_in(scratch.path(), &["tare", "touched", "--sensor", "all/sensor.toml"]);
    assert_eq!(ended.status.code(), Some(1), "{}", printed(&ended));
    for words in
        ["tare: touched: expected a finger that nothing touches", "frame 0 (frame_0000", "look like pressed weave"]
    {
        assert!(printed(&ended).contains(words), "no `{words}` in {}", printed(&ended));
    }
    assert!(!scratch.path().join("finger.rest").exists(), "a touched finger is not kept");
}

#[test]
fn a_rest_that_was_kept_judges_as_the_live_one_and_no_other_passes_for_it() {
    let scratch = tempfile::tempdir().expect("a folder");
    let ended = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let output = slipbound_in(scratch.path(), &words);
        (output.status.code(), printed(&output))
    };
    let done = |line: &str| {
        let (code, said) = ended(line);
        assert_eq!(code, Some(0), "{line}: {said}");
        said
    };
    let path = |name: &str| scratch.path().join(name);
    done("simulate ramp --seed 3 -o all");
    let said = done("tare all --frames 10");
    for words in ["419 markers, frames 0 to 9 averaged of 10 looked at", "noise 0.0", "written: finger.rest"] {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
    done("watch all --rest live:10 --json live.jsonl");
    done("watch all --rest finger.rest --json kept.jsonl");
    assert_eq!(lines(&path("live.jsonl")), lines(&path("kept.jsonl")), "to the last bit");
    // At 30 Hz the open hand is seen for a second before the first slip: a busy machine has time to take hold.
    let hold = "hold all --sensor all/sensor.toml --gripper dry --rate-hz 30 --rest finger.rest --record -o run";
    done(hold);
    let said = done("replay run");
    assert!(said.contains("68 cycles, every"), "the first frame is judged, now and in the replay: {said}");

    let kept = fs::read(path("finger.rest")).expect("was written");
    let as_text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("JSON");
    let mut flipped = kept.clone();
    flipped[kept.len() / 2] ^= 1;
    let newer = as_text(&kept).replacen("\"format_version\":1", "\"format_version\":2", 1);
    for (name, bytes) in [("cut", &kept[..kept.len() / 2]), ("flipped", &flipped), ("newer", newer.as_bytes())] {
        fs::write(path(name), bytes).expect("writes");
    }
    fs::create_dir(path("small")).expect("makes a folder");
    fs::write(path("small/000.jpg"), jpeg(0)).expect("writes");
    fs::write(path("other.toml"), "extends = \"all/sensor.toml\"\npitch_px = 15.9\n").expect("writes");
    for (line, expected) in [
        ("watch all --rest cut", "--rest cut: damaged: expected "),
        ("watch all --rest flipped", "--rest flipped: damaged: expected the CRC-32 "),
        (
            "watch all --rest newer",
            "--rest newer: expected a finger at rest of format version 1, got 2, written by slipbound ",
        ),
        ("watch all --sensor other.toml --rest finger.rest", "another finger's: pitch_px: expected 15.9, got "),
        (
            "watch all --settings paper --rest finger.rest",
            "with other settings: imprint.illumination: expected gaussian, got ",
        ),
        (
            "watch small --sensor all/sensor.toml --rest finger.rest",
            "--rest finger.rest: expected 320x240 as the frames of small",
        ),
        ("hold all --sensor other.toml --gripper dry --rest finger.rest", "another finger's: pitch_px"),
        ("hold all --sensor all/sensor.toml --gripper dry --rest live:5 --rest finger.rest", "live:N once or 1 FILE"),
        ("doctor all --rest flipped", "damaged"),
        ("tare all -o other.toml", "or one that slipbound wrote, got other.toml"),
        ("tare small/000.jpg --sensor all/sensor.toml -o small/000.jpg", "expected a place of its own"),
        ("watch all --rest finger.rest --json finger.rest", "that of --rest"),
        ("tare all -o -", "expected the name of a file"),
    ] {
        let (code, said) = ended(line);
        assert_eq!(code, Some(2), "{line}: {said}");
        assert!(said.contains(expected), "{line}: no `{expected}` in {said}");
    }
    assert_eq!(fs::read(path("finger.rest")).expect("is there"), kept);
    assert!(done("tare all --frames 10").contains("written"), "what slipbound wrote is replaced");
    done("tare all --frames 10 -o other.toml --force");
}
