//! The command `latency` from outside.

use crate::program::{command, signal};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn latency(arguments: &[&str]) -> Command {
    command(&[&["latency"], arguments].concat())
}

/// The only camera that blocks delivers nothing to measure from: its row is left out.
#[test]
fn a_single_finger_is_measured_without_the_row_of_a_blocked_camera() {
    let output = latency(&["--frames", "100", "--fingers", "1"]).output().expect("runs");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(0), "{out} {err}");
    let is_row = |line: &&str| line.contains("command bytes in the socket");
    assert_eq!(out.lines().filter(is_row).count(), 4, "{out}");
    assert!(!out.contains("a camera blocks") && err.contains("left out: the row in which a camera blocks"), "{err}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_measurement_says_so() {
    let mut command = latency(&["--frames", "100000", "--fingers", "1"]);
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs");
    let mut out = BufReader::new(process.stdout.take().expect("piped"));
    let mut line = String::new();
    while !line.starts_with("|---") {
        line.clear();
        assert!(out.read_line(&mut line).expect("a line") > 0, "it ended too early");
    }
    let from = Instant::now();
    signal(&process, "-INT");
    let mut err = String::new();
    process.stderr.take().expect("piped").read_to_string(&mut err).expect("text");
    assert_eq!(process.wait().expect("ends").code(), Some(1), "{err}");
    assert!(err.contains("interrupted") && !err.contains("never held"), "{err}");
    assert!(from.elapsed() < Duration::from_secs(10), "it went on for {:?}", from.elapsed());
}
