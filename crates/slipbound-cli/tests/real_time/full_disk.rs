//! A disk that gets full in the middle of a run: the loop continues to the same end, and the loss is reported. The
//! limit on the size of a file stands for the disk: writes beyond it fail in the middle, as on a full one.
#![cfg(target_os = "linux")]

use crate::program::{PROGRAM, printed, signal};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

/// Size limit of a file, in blocks of 512 bytes: enough for every frame, but not for every cycle's line, nor for the
/// page.
const LIMIT_BLOCKS: &str = "160";

/// The command with this limit, or `unlimited`.
fn command(limit_blocks: &str, args: &[&str]) -> Command {
    // Without the trap the limit would end the process instead of failing the write.
    let script = "trap '' XFSZ; ulimit -f \"$0\"; exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", script, limit_blocks, PROGRAM]).args(args);
    command
}

/// Runs it to its end.
fn limited(limit_blocks: &str, args: &[&str]) -> Output {
    command(limit_blocks, args).output().expect("runs")
}

fn row(told: &str, name: &str) -> String {
    let line = told.lines().find_map(|line| line.trim().strip_prefix(name));
    line.unwrap_or_else(|| panic!("no row {name}: {told}")).trim().to_owned()
}

/// Exit code 3, a count and a reason, and only complete lines.
fn check_lost(folder: &Path, output: &Output) {
    assert_eq!(output.status.code(), Some(3), "{}", printed(output));
    assert!(printed(output).contains("times something could not be written, the first: "), "{}", printed(output));
    for name in ["reports.jsonl", "frames.jsonl", "events.jsonl"] {
        let text = fs::read_to_string(folder.join(name)).expect("lines");
        for line in text.lines() {
            assert!(serde_json::from_str::<serde_json::Value>(line).is_ok(), "{name}: {line}");
        }
    }
}

#[test]
fn a_full_disk_changes_nothing_in_the_loop_and_is_told_at_the_end() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    let (whole, cut, held) = (path("whole"), path("cut"), path("held"));
    let unscrew = ["demo", "--fingers", "1", "--task", "unscrew", "--emulated", "wsg50", "--record", "-o"];
    let without = limited("unlimited", &[&unscrew[..], &[&whole]].concat());
    assert!(without.status.success(), "{}", printed(&without));
    let with = limited(LIMIT_BLOCKS, &[&unscrew[..], &[&cut]].concat());
    check_lost(Path::new(&cut), &with);
    assert!(printed(&with).contains("report.html: cannot write"), "{}", printed(&with));
    assert!(!Path::new(&cut).join("report.html").exists(), "half a page is none");
    for name in ["ended", "largest force commanded", "slid in the fingers", "alarms"] {
        assert_eq!(row(&printed(&without), name), row(&printed(&with), name), "{name}");
    }
    // The remaining part replays, up to where it is cut off.
    let again = limited("unlimited", &["replay", &cut]);
    let ends = "frames.jsonl: ends before cycle";
    assert!(again.status.success() || printed(&again).contains(ends), "{}", printed(&again));

    // In real time, behind the queue.
    let frames = format!("{whole}/left");
    let hold = ["hold", &frames, "--sensor", "gelslim", "--gripper", "dry", "--rate-hz", "60", "--record", "-o", &held];
    let held_on = limited(LIMIT_BLOCKS, &hold);
    check_lost(Path::new(&held), &held_on);
    assert!(row(&printed(&held_on), "ended").contains("Held"), "{}", printed(&held_on));
}

#[test]
fn what_watch_writes_ends_with_a_whole_line_on_a_full_disk() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = |name: &str| scratch.path().join(name).to_str().expect("UTF-8").to_owned();
    for (option, name) in [("--json", "run.jsonl"), ("--csv", "run.csv"), ("--timings", "times.jsonl")] {
        let file = path(name);
        // Twelve blocks are 6 kB: a header and a few frames, and not on the end of a line.
        let output = limited("12", &["watch", "sim:press?grid=fast", option, &file]);
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains(&format!("{name}: cannot write: ")), "{}", printed(&output));
        let text = fs::read_to_string(&file).expect("lines");
        assert!(text.ends_with('\n') && text.lines().count() > 2, "{name}: {text}");
    }
    let page = path("page.html");
    let output = limited("12", &["watch", "sim:press?grid=fast", "--report", &page]);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(!Path::new(&page).exists(), "half a page is none");
}

#[test]
fn a_finger_at_rest_that_cannot_be_written_leaves_the_one_that_was_there() {
    let scratch = tempfile::tempdir().expect("a folder");
    let file = scratch.path().join("left.rest");
    let tare = |limit: &str, count: &str| {
        let file = file.to_str().expect("UTF-8");
        limited(limit, &["tare", "sim:press?grid=fast", "--frames", count, "-o", file])
    };
    assert!(tare("unlimited", "10").status.success());
    let before = fs::read(&file).expect("there");
    let output = tare("4", "6");
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(printed(&output).contains("left.rest: cannot write: "), "{}", printed(&output));
    assert!(fs::read(&file).is_ok_and(|after| after == before), "the good one is lost");
    assert_eq!(fs::read_dir(scratch.path()).expect("reads").count(), 1, "and nothing is left beside it");
}

/// A camera that never ends: after a whole image its images are torn, which are kept, too.
fn camera() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}/", listener.local_addr().expect("bound"));
    thread::spawn(move || {
        let (mut socket, _) = listener.accept()?;
        socket.write_all(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=cam\r\n\r\n--cam")?;
        let mut image = Vec::new();
        let encoder = jpeg_encoder::Encoder::new(&mut image, 90);
        encoder.encode(&[128; 64 * 48], 64, 48, jpeg_encoder::ColorType::Luma).expect("encodes");
        loop {
            socket.write_all(&[b"\r\n\r\n".to_vec(), image, b"\r\n--cam".to_vec()].concat())?;
            image = vec![7; 4000];
            thread::sleep(Duration::from_millis(10));
        }
        #[allow(unreachable_code)]
        Ok::<(), std::io::Error>(())
    });
    url
}

#[test]
fn who_only_records_ends_when_the_disk_is_full() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run.mcap").to_str().expect("UTF-8").to_owned();
    let from = std::time::Instant::now();
    let output = limited(LIMIT_BLOCKS, &["record", &camera(), "-o", &run, "--for-s", "100"]);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    let said = "run.mcap: cannot write on: File too large (os error 27)";
    assert!(printed(&output).trim_end().ends_with(said), "{}", printed(&output));
    assert!(from.elapsed() < Duration::from_secs(50), "it went on for {:?}", from.elapsed());
}

#[test]
fn a_run_without_a_single_cycle_is_not_called_the_same() {
    let scratch = tempfile::tempdir().expect("a folder");
    let run = scratch.path().join("run").to_str().expect("UTF-8").to_owned();
    let short = ["--fingers", "1", "--task", "lift", "--set", "longest_s=0.3", "--record", "-o", &run];
    limited("unlimited", &[&["demo"], &short[..]].concat());
    let again = limited("unlimited", &["replay", &run]);
    assert_eq!(again.status.code(), Some(1), "{}", printed(&again));
    assert!(
        printed(&again).contains("expected cycles in which something was commanded, got none"),
        "{}",
        printed(&again)
    );
}

#[test]
fn an_emulator_whose_log_is_cut_short_serves_on_and_says_so() {
    let scratch = tempfile::tempdir().expect("a folder");
    let log = scratch.path().join("log.jsonl");
    let args = ["emulate", "wsg50", "--log", log.to_str().expect("UTF-8")];
    let mut emulator = command("4", &args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let mut out = BufReader::new(emulator.stdout.take().expect("piped"));
    let mut address = String::new();
    out.read_line(&mut address).expect("its address");
    // Four blocks are 2 kB, a fifth of a second; they begin with the first client.
    for _ in 0..4 {
        let status = limited("unlimited", &["gripper", address.trim(), "status"]);
        assert!(status.status.success(), "{}", printed(&status));
        thread::sleep(Duration::from_millis(300));
    }
    signal(&emulator, "-INT");
    let ended = emulator.wait_with_output().expect("ends");
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    let said = printed(&ended);
    assert!(said.contains("log.jsonl: ") && said.contains(" lines could not be written, the first: "), "{said}");
    let text = fs::read_to_string(&log).expect("lines");
    assert!(text.ends_with("}\n") && text.lines().count() > 5, "{text}");
}
