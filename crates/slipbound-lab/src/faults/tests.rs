use super::*;
use crate::jpeg::Codec;
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat, SourceError};

const SIZE: SizePx = SizePx::new(64, 48);

/// Grey frames, with the frame number plus 50 as level and a bright stripe in the middle.
struct Plain {
    next: u64,
    count: u64,
}

impl FrameSource for Plain {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if self.next == self.count {
            return Ok(Next::End);
        }
        into.pixels = vec![50 + (self.next % 100) as u8; 3 * SIZE.area()];
        into.pixels.chunks_exact_mut(3).enumerate().for_each(|(i, pixel)| {
            if i % SIZE.width == SIZE.width / 2 {
                pixel.fill(250);
            }
        });
        (into.size, into.format, into.seq, into.clock) = (SIZE, PixelFormat::Rgb, self.next, Clock::Device);
        into.time_ns = Some(self.next * 33_333_333);
        Codec::new(SIZE, 95).encode(&into.pixels.clone(), &mut into.encoded)?;
        self.next += 1;
        Ok(Next::Frame)
    }
}

/// Results of 400 frames.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    seqs: Vec<u64>,
    torn: Vec<u64>,
    silent_count: u32,
    pixels: Vec<Vec<u8>>,
}

fn run(faults: &str, seed: u64) -> Seen {
    let mut source = Faulty::new(Plain { next: 0, count: 400 }, Faults::parse(faults).expect("sound"), seed);
    let (mut seen, mut frame) = (Seen::default(), FrameBuffer::default());
    loop {
        match source.next(&mut frame).expect("no failure") {
            Next::Frame => {
                seen.seqs.push(frame.seq);
                seen.pixels.push(frame.pixels.clone());
            }
            Next::Torn { .. } => seen.torn.push(frame.seq),
            Next::Silent => seen.silent_count += 1,
            Next::End => return seen,
        }
    }
}

#[test]
fn faults_come_as_often_as_asked_and_the_same_for_the_same_seed() {
    let seen = run("drop=0.2,torn=0.1,late=0.1", 7);
    assert_eq!(seen, run("drop=0.2,torn=0.1,late=0.1", 7));
    assert_ne!(seen.seqs, run("drop=0.2,torn=0.1,late=0.1", 8).seqs);
    let came = seen.seqs.len() + seen.torn.len();
    assert!((290..350).contains(&came), "{came} of 400 came");
    assert!((15..55).contains(&seen.torn.len()), "{} torn", seen.torn.len());
    assert!((30..150).contains(&seen.silent_count), "{} times silent", seen.silent_count);
    assert!(seen.seqs.windows(2).all(|pair| pair[0] < pair[1]), "late frames keep their order");
}

#[test]
fn without_faults_nothing_changes() {
    let seen = run("drop=0", 1);
    assert_eq!(seen.seqs, (0..400).collect::<Vec<_>>());
    assert_eq!((seen.torn.len(), seen.silent_count), (0, 0));
    assert_eq!(seen.pixels[7][0], 57);
}

#[test]
fn a_stale_frame_shows_the_picture_before_under_its_own_number() {
    let seen = run("stale=0.3", 3);
    assert_eq!(seen.seqs, (0..400).collect::<Vec<_>>());
    let stale = (1..100).filter(|&n| seen.pixels[n] == seen.pixels[n - 1]).count();
    assert!((15..50).contains(&stale), "{stale} of 99");
}

#[test]
fn light_and_lens_change_pixels() {
    let stripe = |seen: &Seen, n: usize| seen.pixels[n][3 * (20 * SIZE.width + SIZE.width / 2)];
    let ground = |seen: &Seen, n: usize| f64::from(seen.pixels[n][3 * 20 * SIZE.width]);
    let blurred = run("blur=1", 1);
    assert!(stripe(&blurred, 0) < 100, "the stripe is spread out: {}", stripe(&blurred, 0));
    let drifting = run("drift=3", 1);
    // 90 frames of a thirtieth of a second: 3 s, so 15 % brighter.
    assert!((ground(&drifting, 90) / 140.0 - 1.15).abs() < 0.03, "{}", ground(&drifting, 90));
    let flickering = run("flicker=0.3", 1);
    let gains: Vec<f64> = (0..90).map(|n| ground(&flickering, n) / (50.0 + n as f64)).collect();
    assert!(gains.iter().any(|gain| *gain > 1.2) && gains.iter().any(|gain| *gain < 0.8), "{gains:?}");
    let dead = run("dead=40", 1);
    assert_ne!(dead.pixels[0], run("drop=0", 1).pixels[0]);
}

#[test]
fn faults_out_of_range_are_refused_by_name() {
    for (text, expected) in [
        ("drop=2", "fault: expected drop= and a number from 0 to 0.9, got drop=2"),
        ("drop", "fault: expected drop= and a number from 0 to 0.9, got drop"),
        ("torn=NaN", "fault: expected torn= and a number from 0 to 0.9, got torn=NaN"),
    ] {
        assert_eq!(Faults::parse(text).expect_err("refused").to_string(), expected);
    }
    assert!(Faults::parse("gremlins=1").expect_err("unknown").to_string().contains("drop, late, stale, torn"));
}

#[test]
fn camera_faults_are_text_and_read_back() {
    for (text, kind, finger) in [
        ("lost@2.5:left", CameraFaultKind::Lost, Some(0)),
        ("frozen@3:right", CameraFaultKind::Frozen, Some(1)),
        ("torn@0", CameraFaultKind::Torn, None),
        ("dark@1", CameraFaultKind::Dark, None),
        ("swapped@0", CameraFaultKind::Swapped, None),
    ] {
        let fault: CameraFault = text.parse().expect(text);
        assert_eq!((fault.to_string().as_str(), fault.kind()), (text, kind));
        assert_eq!(fault.swaps_fingers(), kind == CameraFaultKind::Swapped);
        assert_eq!([0, 1].map(|n| fault.applies_to(n)), [0, 1].map(|n| finger.is_none_or(|hit| hit == n)), "{text}");
    }
    assert_eq!("swapped".parse::<CameraFault>().expect("from the start").to_string(), "swapped@0");
    for text in
        ["fire@2", "lost@-1", "lost@4000", "lost@NaN", "lost@2:middle", "lost@", "swapped@3", "swapped:left", ""]
    {
        let error = text.parse::<CameraFault>().expect_err(text).to_string();
        let expected = "expected lost, frozen, torn or dark with @SECONDS and :left or :right as wanted, or swapped \
                        (from the start on), got";
        assert_eq!(error, format!("{expected} `{text}`"));
    }
}

/// The first 90 frames, 3 s, through a camera fault: the results, then number and pixels of the last frame's buffer.
fn through(fault: Option<&str>) -> Vec<(Next, FrameBuffer)> {
    let fault = fault.map(|text| text.parse().expect("a sound fault"));
    let mut source = CameraFaults::new(Plain { next: 0, count: 90 }, fault);
    let mut frame = FrameBuffer::default();
    (0..90).map(|_| (source.next(&mut frame).expect("no failure"), frame.clone())).collect()
}

#[test]
fn a_camera_fault_begins_at_its_time_and_stays() {
    let sound = through(None);
    for (text, expected) in [("lost@1", Next::Silent), ("torn@1", Next::Torn { reason: "cut off".into() })] {
        let seen = through(Some(text));
        // Frame 30 is just before 1 s: 30 x 33.333333 ms.
        assert!(seen[..=30].iter().all(|(next, _)| *next == Next::Frame), "{text}");
        assert!(seen[31..].iter().all(|(next, _)| *next == expected), "{text}");
    }
    let frozen = through(Some("frozen@1"));
    assert!((31..90).all(|n| frozen[n].1.seq == n as u64 && frozen[n].1.pixels == sound[30].1.pixels));
    assert!((31..90).all(|n| frozen[n].1.encoded == sound[30].1.encoded), "what is recorded is what was seen");
    let dark = through(Some("dark@1"));
    assert!((31..90).all(|n| dark[n].1.pixels.iter().all(|level| *level == 2)), "{:?}", dark[31].1.pixels[0]);
    assert!(dark[31].1.encoded != sound[31].1.encoded, "what is recorded is what was seen");
    assert_eq!(through(Some("swapped"))[50].1.pixels, sound[50].1.pixels, "the pictures themselves are sound");
}

#[test]
fn a_camera_frozen_from_the_start_shows_its_first_picture() {
    let (seen, sound) = (through(Some("frozen")), through(None));
    assert!(seen.iter().all(|(next, frame)| *next == Next::Frame && frame.pixels == sound[0].1.pixels));
}
