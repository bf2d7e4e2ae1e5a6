//! AVI files made of a few bytes, whole, cut and damaged.

use super::*;
use proptest::prelude::*;
use std::io::Cursor;

fn walk_to_the_end(bytes: &[u8]) -> Result<(usize, Option<String>), Fault> {
    let mut walk = Walk::open(Cursor::new(bytes))?;
    let survey = walk.survey()?;
    let mut frame = Vec::new();
    let mut frames = 0;
    let mut dropped = VecDeque::new();
    loop {
        match walk.next(&mut frame)? {
            Item::Frame => frames += 1,
            Item::Dropped => {
                dropped.push_back(frames as u64);
                frames += 1;
            }
            Item::Cut(reason) => {
                assert_eq!((survey.frames_count, survey.cut.as_ref()), (frames as u64, Some(&reason)));
                return Ok((frames, Some(reason)));
            }
            Item::End => {
                assert_eq!(survey, Survey { frames_count: frames as u64, dropped, cut: None });
                return Ok((frames, None));
            }
        }
    }
}

fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut out = [name.as_slice(), &(content.len() as u32).to_le_bytes(), content].concat();
    out.resize(out.len().next_multiple_of(2), 0);
    out
}

fn list(name: &[u8; 4], kind: &[u8; 4], parts: &[Vec<u8>]) -> Vec<u8> {
    chunk(name, &[kind.as_slice(), &parts.concat()].concat())
}

/// A recording of a sound stream, then a video stream, with frames in `rec ` lists and one left out.
fn recording() -> Vec<u8> {
    let mut sound = [0; 56];
    sound[..4].copy_from_slice(b"auds");
    let mut header = [0; 56];
    header[..8].copy_from_slice(b"vidsMJPG");
    header[20] = 1;
    header[24] = 25;
    header[32] = 4;
    let mut format = [0; 40];
    (format[4], format[8]) = (64, 48);
    let streams = [
        list(b"LIST", b"strl", &[chunk(b"strh", &sound), chunk(b"strf", &[0; 18])]),
        list(b"LIST", b"strl", &[chunk(b"strh", &header), chunk(b"strf", &format), chunk(b"JUNK", b"abc")]),
    ];
    let movi = [
        chunk(b"00wb", b"hum"),
        list(b"LIST", b"rec ", &[chunk(b"01dc", b"one"), chunk(b"01dc", b"")]),
        chunk(b"01dc", b"three"),
    ];
    let first = [
        list(b"LIST", b"hdrl", &[chunk(b"avih", &[0; 56]), streams.concat()]),
        chunk(b"JUNK", &[0; 11]),
        list(b"LIST", b"movi", &movi),
        chunk(b"idx1", &[7; 16]),
    ];
    let more = list(b"RIFF", b"AVIX", &[list(b"LIST", b"movi", &[chunk(b"01dc", b"four")])]);
    [list(b"RIFF", b"AVI ", &first), more].concat()
}

#[test]
fn follows_lists_other_streams_and_later_parts() {
    let bytes = recording();
    let mut walk = Walk::open(Cursor::new(&bytes)).expect("an AVI file");
    let video = walk.video();
    assert!(video.is_motion_jpeg());
    assert_eq!((video.size, video.rate), (SizePx::new(64, 48), Rate { frames: 25, seconds: 1 }));
    let mut frame = Vec::new();
    let mut seen = Vec::new();
    loop {
        match walk.next(&mut frame).expect("reads") {
            Item::Frame | Item::Dropped => seen.push(String::from_utf8(frame.clone()).expect("text")),
            Item::Cut(reason) => panic!("{reason}"),
            Item::End => break,
        }
    }
    assert_eq!(seen, ["one", "", "three", "four"]);
}

#[test]
fn cut_anywhere_it_gives_the_whole_frames_and_says_so() {
    let bytes = recording();
    let first_frame = bytes.windows(4).position(|w| w == b"01dc").expect("a frame");
    for cut in 0..bytes.len() {
        match walk_to_the_end(&bytes[..cut]) {
            Err(Fault::Shape { got, .. }) => assert!(cut < first_frame, "cut at {cut}: {got}"),
            Err(Fault::Read(e)) => panic!("cut at {cut}: {e}"),
            Ok((frames, reason)) => {
                assert!(frames < 4 && (frames == 3 || reason.is_some()), "cut at {cut}: {frames} {reason:?}")
            }
        }
    }
    assert!(matches!(walk_to_the_end(&bytes), Ok((4, None))));
}

#[test]
fn a_broken_off_recording_without_lengths_is_read_to_its_end() {
    let mut bytes = recording();
    let movi = bytes.windows(4).position(|w| w == b"movi").expect("a list");
    bytes.truncate(bytes.windows(4).position(|w| w == b"idx1").expect("an index"));
    for unwritten in [0, u32::MAX] {
        bytes[movi - 4..movi].copy_from_slice(&u32::to_le_bytes(unwritten));
        let (frames, reason) = walk_to_the_end(&bytes).expect("walks");
        assert_eq!((frames, reason.as_deref()), (3, Some("the file holds 3 of 4 frames")));
    }
}

#[test]
fn zeros_of_a_preallocated_file_end_it() {
    let mut bytes = recording();
    bytes.extend_from_slice(&[0; 64]);
    let (frames, reason) = walk_to_the_end(&bytes).expect("walks");
    assert_eq!(frames, 4);
    assert!(reason.expect("said").contains("no AVI chunk"));
}

#[test]
fn time_is_the_number_over_the_rate() {
    assert_eq!(Rate { frames: 30000, seconds: 1001 }.time_ns(30), Some(1_001_000_000));
    assert_eq!(Rate { frames: 0, seconds: 1 }.time_ns(30), None);
}

/// `PROPTEST_CASES`, or 400.
fn cases_count() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases_count()))]

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = walk_to_the_end(&bytes);
    }

    #[test]
    fn a_damaged_recording_never_panics_and_always_ends(
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let mut bytes = recording();
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok((frames, _)) = walk_to_the_end(&bytes) {
            prop_assert!(frames <= bytes.len() / 8);
        }
    }
}
