//! A simulated hand at addresses of this computer: its cameras are watched and its gripper is queried, like real ones.
#![cfg(unix)]

mod program;

use program::{signal, slipbound_in, start_in};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::Child;

/// A program that is ended with the test, however that ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_hand_on_this_computer_shows_pictures_and_answers_its_gripper() {
    let scratch = tempfile::tempdir().expect("a folder");
    let slipbound = |args: &[&str]| slipbound_in(scratch.path(), args);
    let mut hand = Running(start_in(scratch.path(), &["emulate", "hand", "--task", "lift", "-o", "hand"]));
    let mut said = BufReader::new(hand.0.stdout.take().expect("piped")).lines().map_while(Result::ok);
    let mut address = |name: &str| {
        let line = said.next().expect("a line");
        line.strip_prefix(name).unwrap_or_else(|| panic!("expected {name}, got {line}")).trim().to_owned()
    };
    let (left, right) = (address("left:"), address("right:"));
    let (gripper, wrist) = (address("gripper:"), address("wrist:"));
    assert!(left.starts_with("http://") && gripper.starts_with("wsg50://") && wrist.starts_with("line://"));
    let script = fs::read_to_string(scratch.path().join("hand/try.sh")).expect("a script");
    assert!([&left, &right, &gripper, &wrist].iter().all(|address| script.contains(*address)), "{script}");

    // A busy machine draws few frames a second.
    let watched = ["1.5", "4", "10", "20"].iter().find_map(|seconds| {
        let record = ["record", &left, &right, "-o", "seen.mcap", "--for-s", seconds];
        let recorded = slipbound(&record);
        assert_eq!(recorded.status.code(), Some(0), "{}", String::from_utf8_lossy(&recorded.stderr));
        let watch = ["watch", "seen.mcap#right", "--sensor", "hand/right.sensor.toml", "--json", "seen.jsonl"];
        let watched = slipbound(&watch);
        let lines = fs::read_to_string(scratch.path().join("seen.jsonl")).map_or(0, |text| text.lines().count());
        (lines > 4).then_some(watched)
    });
    let watched = watched.expect("frames of the right camera");
    assert_eq!(watched.status.code(), Some(0), "{}", String::from_utf8_lossy(&watched.stderr));
    let lines = fs::read_to_string(scratch.path().join("seen.jsonl")).expect("a report");
    assert!(lines.lines().count() > 4, "{lines}");
    assert!(lines.contains("\"clock\":\"device\"") && lines.contains("\"no_contact\""), "{lines}");

    let asked = slipbound(&["gripper", "--help"]);
    assert!(asked.status.success());
    let refused = slipbound(&["emulate"]);
    assert_eq!(refused.status.code(), Some(2), "neither a gripper nor a hand");

    signal(&hand.0, "-INT");
    let rest: Vec<String> = said.collect();
    assert!(rest.iter().any(|line| line.contains("at the end: slid 0.00 mm")), "{rest:?}");
    let mut errors = String::new();
    hand.0.stderr.take().expect("piped").read_to_string(&mut errors).expect("UTF-8");
    assert_eq!(hand.0.wait().expect("ends").code(), Some(0), "{errors}");
}
