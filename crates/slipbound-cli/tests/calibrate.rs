//! The command on the paper's finger as simulated, on what cannot be calibrated, and on its own outputs.

use slipbound::plane::Vec2;
use std::path::Path;
use std::process::{Command, Output};

fn slipbound(folder: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_slipbound")).current_dir(folder).args(words).output().expect("runs")
}

/// The grid's corners, 21 columns and 20 rows of it, where the published homography of finger gs1 puts them.
#[test]
fn one_frame_of_the_papers_finger_gives_its_homography_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = slipbound(folder.path(), &["simulate", "twist?seed=3", "-o", "twist"]);
    assert!(done.status.success(), "{done:?}");
    let words = ["calibrate", "twist/frame_000000.jpg", "-o", "gs.toml", "--flip", "vertical", "--skin", "fabric"];
    let done = slipbound(folder.path(), &words);
    assert!(done.status.success(), "{done:?}");
    assert!(folder.path().join("gs.png").exists());
    let path = folder.path().join("gs.toml");
    let ours = slipbound_rig::sensors::load(path.to_str().expect("UTF-8")).expect("valid");
    let paper = slipbound_rig::sensors::load("gelslim").expect("built in").at_size(ours.image_px).expect("same shape");
    assert_eq!(ours.rectification.and_then(|r| r.distortion), None, "the lens is straight");

    let size = paper.rectified_px();
    let middle = Vec2::new((size.width - 1) as f64, (size.height - 1) as f64) * 0.5;
    let margin_px = (0.75 * ours.pitch_px).round();
    for (column, row) in [(0.0, 0.0), (20.0, 0.0), (0.0, 19.0), (20.0, 19.0)] {
        let truth = paper.camera_from_rectified(middle + Vec2::new(column - 10.0, row - 9.5) * paper.pitch_px);
        let found = Vec2::new(margin_px + column * ours.pitch_px, margin_px + row * ours.pitch_px);
        let found = ours.camera_from_rectified(found);
        assert!((found - truth).length() < 1.0, "corner {column}, {row}: {found:?}, expected {truth:?}");
    }
}

#[test]
fn what_cannot_be_done_is_refused_with_the_reason_and_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let even = vec![128u8; 320 * 240];
    let encoder = jpeg_encoder::Encoder::new_file(folder.path().join("even.jpg"), 90).expect("writes");
    encoder.encode(&even, 320, 240, jpeg_encoder::ColorType::Luma).expect("writes");
    for (words, said) in [
        (&["calibrate", "even.jpg", "-o", "a.toml"][..], "no grid of markers: expected at least 16 dots"),
        (&["calibrate", "none.jpg", "-o", "a.toml"], "none.jpg"),
        (&["calibrate", "even.jpg", "-o", "a.json"], "expected a name that ends in .toml, got a.json"),
        (
            &["calibrate", "even.jpg", "-o", "a.toml", "--frames", "5..9"],
            "--frames 5..9: even.jpg has no whole frame there",
        ),
        (&["calibrate", "even.jpg", "-o", "a.toml", "--weight-g", "100"], "--sensor"),
        (
            &["calibrate", "even.jpg", "-o", "a.toml", "--weight-g", "0", "--sensor", "gelslim"],
            "expected grams above 0",
        ),
    ] {
        let done = slipbound(folder.path(), words);
        let message = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{words:?}: {message}");
        assert!(message.contains(said), "{words:?}: `{message}` lacks `{said}`");
        assert!(!folder.path().join("a.toml").exists());
    }
}
