//! Sources that are silent from the start, that fail while others go on, and that an older ffmpeg reads: what is said of
//! them, and when.
#![cfg(unix)]

use crate::live::{Trouble, jpeg, serve};
use crate::program::{command, printed, signal, start_in};
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::os::unix::fs::PermissionsExt as _;
use std::process::{Child, Output};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

/// Longest wait for a line, on a machine with other work.
const LONGEST: Duration = Duration::from_secs(30);

/// Waits until these words come on standard error, then sends the program this signal; its output from there on, and
/// whether they came.
fn ended_after(mut child: Child, words: &'static str, by: &str) -> (bool, Output) {
    let mut stderr = BufReader::new(child.stderr.take().expect("piped"));
    let (said, heard) = channel();
    let listener = thread::spawn(move || {
        let mut line = String::new();
        while stderr.read_line(&mut line).is_ok_and(|count| count > 0) {
            if line.contains(words) {
                let _ = said.send(()); // after the longest wait nobody hears it
            }
            line.clear();
        }
        let _ = stderr.read_to_end(&mut Vec::new());
    });
    let came = heard.recv_timeout(LONGEST).is_ok();
    signal(&child, by);
    let ended = child.wait_with_output().expect("ends");
    listener.join().expect("heard to the end");
    (came, ended)
}

#[test]
fn a_camera_that_is_silent_from_the_start_is_told_of() {
    let scratch = tempfile::tempdir().expect("a folder");
    for from in [0, 5] {
        let url = serve(Trouble { silent_from: Some(from), ..Trouble::default() });
        for command in ["watch", "tare"] {
            let child = start_in(scratch.path(), &[command, "--sensor", "gelsight_mini_wide", &url]);
            let (came, ended) = ended_after(child, ": no frame for 0.", "-KILL");
            assert!(came, "{command}, silent from frame {from}: {}", printed(&ended));
        }
    }
}

#[test]
fn a_source_that_fails_is_told_of_while_the_others_are_recorded() {
    let scratch = tempfile::tempdir().expect("a folder");
    fs::create_dir(scratch.path().join("images")).expect("makes a folder");
    fs::write(scratch.path().join("images/0.jpg"), jpeg(0)).expect("writes");
    let url = serve(Trouble::default());
    let child = start_in(scratch.path(), &["record", &url, "images", "-o", "run.mcap", "--for-s", "3600"]);
    let (came, ended) = ended_after(child, "expected frames with times", "-INT");
    assert!(came, "{}", printed(&ended));
    assert_eq!(ended.status.code(), Some(2), "{}", printed(&ended));
}

/// Gives small images, unless it is asked in words that only a later version knows.
const OLDER_FFMPEG: &str = r#"#!/bin/sh
case "$*" in
*-fps_mode*) echo "Unrecognized option 'fps_mode'." >&2; exit 1 ;;
esac
while printf 'P6\n64 48\n255\n' && head -c 9216 /dev/zero; do sleep 0.03; done
"#;

/// It is started twice before the first frame.
#[test]
fn a_stream_that_an_older_ffmpeg_reads_was_never_lost() {
    let scratch = tempfile::tempdir().expect("a folder");
    let program = scratch.path().join("ffmpeg");
    fs::write(&program, OLDER_FFMPEG).expect("writes");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("sets");
    let path = std::env::var("PATH").unwrap_or_default();
    let mut record = command(&["record", "rtsp://127.0.0.1:9/gel", "-o", "run.mcap", "--for-s", "2"]);
    let ended = record
        .env("PATH", format!("{}:{path}", scratch.path().display()))
        .current_dir(scratch.path())
        .output()
        .expect("runs");
    assert_eq!(ended.status.code(), Some(0), "{}", printed(&ended));
    assert!(
        printed(&ended).contains("0 lost by the camera or its driver, 0 times lost and back"),
        "{}",
        printed(&ended)
    );
}
