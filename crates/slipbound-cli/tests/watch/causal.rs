//! No frame is judged by a later one: a report is the same when the recording ends with its frame.

use crate::program::Ended;
use crate::trial::{Trial, encode, states};
use slipbound::image::SizePx;
use std::fs;

/// In place of the number of a frame: a frame that did not arrive, and one without light.
const TORN: usize = 1000;
const DARK: usize = 1001;

/// Lines of the report on frames of the simulated recording `from`, copied to a folder of their own in this order.
fn judged(trial: &Trial, from: &str, frames: &[usize], more: &[&str]) -> Vec<serde_json::Value> {
    let _ = fs::remove_dir_all(trial.path("part"));
    fs::create_dir(trial.path("part")).expect("makes a folder");
    for (place, &frame) in frames.iter().enumerate() {
        let to = format!("part/{place:03}.jpg");
        match frame {
            TORN => trial.write(&to, b""),
            DARK => trial.write(&to, &encode(&[3; 640 * 480], SizePx::new(640, 480))),
            _ => drop(fs::copy(trial.path(&format!("{from}/frame_{frame:06}.jpg")), trial.path(&to)).expect("copies")),
        }
    }
    let arguments = ["watch", "part", "--sensor", "finger.toml", "--json", "part.jsonl", "--markers"];
    Ended::of(trial.command(&arguments).args(more).output().expect("runs"))
        .expect(if frames.contains(&TORN) { 3 } else { 0 }, &[]);
    trial.report("part.jsonl")
}

/// A finger that is pressed from frame 10 on and free again from frame 22 on; frames of `camera`, and its sensor file.
fn pressed_and_released(camera: &str) -> Trial {
    let trial = Trial::new(0);
    let scene = format!("press_release?camera={camera}&rest_frames=10&press_s=0.1&settle_s=0.1&hold_s=0.1");
    let simulated = trial.command(&["simulate", &scene, "--seed", "7", "-o", "whole"]).output().expect("runs");
    Ended::of(simulated).expect(0, &[]);
    fs::rename(trial.path("whole/sensor.toml"), trial.path("finger.toml")).expect("a sensor file");
    trial
}

/// First frames among which the rest frame is chosen.
const WINDOW_COUNT: usize = 20;

/// Checks that a recording of these frames gives the same reports when it ends earlier, and from the end of the window
/// on those that a rest frame known from the beginning gives. Returns the kinds of rest frame
/// of its parts and of the whole, and the states of the whole.
fn check(trial: &Trial, frames: &[usize], ends_count: &[usize]) -> (Vec<String>, Vec<String>) {
    let all = judged(trial, "whole", frames, &[]);
    let kind = |report: &[serde_json::Value]| report[0]["rest"]["kind"].as_str().expect("a word").to_owned();
    let mut kinds = Vec::new();
    for &count in ends_count {
        let part = judged(trial, "whole", &frames[..count], &[]);
        assert_eq!(part.len(), 1 + count);
        for (now, later) in part[1..].iter().zip(&all[1..]) {
            assert_eq!(now, later, "{frames:?}, ended after {count} frames");
        }
        kinds.push(kind(&part));
    }
    kinds.push(kind(&all));
    let rest = &all[0]["rest"]["frames"];
    let known = judged(trial, "whole", frames, &["--rest", &format!("{}..{}", rest[0], rest[1])]);
    assert_eq!(known[1 + WINDOW_COUNT..], all[1 + WINDOW_COUNT..], "{frames:?}, rest frame {rest}");
    (kinds, states(&all).into_iter().map(str::to_owned).collect())
}

#[test]
fn no_report_depends_on_a_later_frame() {
    for camera in ["gelsight_mini", "gelslim"] {
        let trial = pressed_and_released(camera);
        let frames: Vec<usize> = (4..28).collect();
        let (kinds, states) = check(&trial, &frames, &[1, 2, 5, 9, 14, 20]);
        assert!(kinds.iter().all(|kind| kind == "unloaded"), "{camera}: {kinds:?}");
        assert!(states[0] == "no_contact" && states.iter().any(|state| state == "stick"), "{camera}: {states:?}");
        // No rest frame is known before the fourth: the first is torn, and two are dark.
        let mut frames = frames;
        frames[..3].copy_from_slice(&[TORN, DARK, DARK]);
        let (_, states) = check(&trial, &frames, &[4, 5, 9, 14, 20]);
        assert!(states[..4] == ["unjudged", "unjudged", "unjudged", "no_contact"], "{camera}: {states:?}");
        let part = judged(&trial, "whole", &frames[..4], &[]);
        let reasons = [1, 2, 3].map(|n| part[n]["reason"].as_str().expect("a reason"));
        assert!(
            reasons[0] == "torn frame" && reasons[1..].iter().all(|why| why.starts_with("dark frame")),
            "{reasons:?}"
        );
        // It begins in contact; the finger is released within the window, and free from then on.
        let frames: Vec<usize> = (14..28).chain(0..10).collect();
        let (kinds, states) = check(&trial, &frames, &[1, 3, 6, 10, 12, 20]);
        assert_eq!((kinds[0].as_str(), kinds[6].as_str()), ("in_contact", "unloaded"), "{camera}: {kinds:?}");
        assert!(states[0] != "no_contact" && states[23] == "no_contact", "{camera}: {states:?}");
    }
}
