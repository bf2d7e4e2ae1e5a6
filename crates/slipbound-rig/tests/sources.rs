//! Recordings of every kind, whole and damaged.

use jpeg_encoder::{ColorType, Encoder};
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat};
use slipbound_rig::avi_writer::AviWriter;
use slipbound_rig::source::{self, Error};
use std::fs;
use std::path::Path;

/// A grey ramp that differs from frame to frame.
fn jpeg(frame: usize, width: u16, height: u16) -> Vec<u8> {
    let count = usize::from(width) * usize::from(height);
    let pixels: Vec<u8> = (0..count).map(|i| ((i + 40 * frame) % 256) as u8).collect();
    let mut out = Vec::new();
    Encoder::new(&mut out, 85).encode(&pixels, width, height, ColorType::Luma).expect("encodes");
    out
}

fn write_avi(path: &Path, frames_count: usize) {
    let mut avi = AviWriter::create(path, SizePx::new(64, 48), 20).expect("creates");
    for i in 0..frames_count {
        avi.push(&jpeg(i, 64, 48)).expect("writes");
    }
    avi.finish().expect("finishes");
}

/// What a source returns until it ends: `.` for a frame, the reason for a torn one.
fn drain(source: &mut dyn FrameSource) -> Vec<String> {
    let mut frame = FrameBuffer::default();
    let mut seen = Vec::new();
    loop {
        match source.next(&mut frame).expect("no final error") {
            Next::Frame => {
                frame.frame().expect("as many pixels as its size says");
                seen.push(".".to_owned());
            }
            Next::Torn { reason } => seen.push(format!("{}: {reason}", frame.label)),
            Next::Silent => panic!("a file is never silent"),
            Next::End => return seen,
        }
    }
}

fn open(path: &Path) -> Box<dyn FrameSource + Send> {
    source::open(path.to_str().expect("UTF-8")).expect("opens")
}

fn refused(uri: &str) -> Error {
    source::open(uri).err().expect("an error")
}

/// As a phone held upright writes it: the sensor's rows, and a note that a viewer is to turn them.
#[test]
fn images_that_a_viewer_turns_are_told_of() {
    let dir = tempfile::tempdir().expect("a folder");
    let doubt = |orientation: Option<u8>| {
        let mut bytes = jpeg(0, 64, 48);
        if let Some(orientation) = orientation {
            // One entry, of 2 bytes, in the order of a big-endian machine.
            let tiff =
                [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".as_slice(), &[orientation], &[0; 6]].concat();
            let app1 = [b"\xFF\xE1\0\x22Exif\0\0".as_slice(), &tiff].concat();
            bytes.splice(2..2, app1);
        }
        fs::write(dir.path().join("1.jpg"), bytes).expect("writes");
        assert_eq!(drain(open(dir.path()).as_mut()), ["."]);
        source::doubt(dir.path().to_str().expect("UTF-8"))
    };
    assert_eq!(doubt(None), None);
    assert_eq!(doubt(Some(1)), None);
    let told = doubt(Some(6)).expect("told");
    assert!(told.contains("EXIF orientation 6: images are taken as they are stored"), "{told}");
}

#[test]
fn a_folder_is_read_in_natural_order_and_other_files_are_passed_over() {
    let dir = tempfile::tempdir().expect("a folder");
    for name in ["10.jpg", "9.JPEG", "notes.txt", "2.png.bak"] {
        fs::write(dir.path().join(name), jpeg(0, 64, 48)).expect("writes");
    }
    let mut source = open(dir.path());
    assert_eq!(source.frames_count(), Some(2));
    let mut frame = FrameBuffer::default();
    for (seq, label) in [(0, "9.JPEG"), (1, "10.jpg")] {
        assert_eq!(source.next(&mut frame).expect("reads"), Next::Frame);
        assert_eq!((frame.seq, frame.label.as_str()), (seq, label));
        assert_eq!((frame.time_ns, frame.clock), (None, Clock::Unknown));
        assert_eq!((frame.format, frame.size), (PixelFormat::Gray, SizePx::new(64, 48)));
    }
    assert_eq!(source.next(&mut frame).expect("reads"), Next::End);
    assert_eq!(source.next(&mut frame).expect("reads"), Next::End);
}

#[test]
fn damaged_pictures_are_torn_by_name_and_other_sizes_are_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let whole = jpeg(0, 64, 48);
    for (name, bytes) in [
        ("0.jpg", whole.as_slice()),
        ("1.jpg", b"".as_slice()),
        ("2.jpg", &whole[..whole.len() * 2 / 3]),
        ("3.jpg", b"hello"),
        ("4.jpg", &jpeg(0, 32, 32)),
    ] {
        fs::write(dir.path().join(name), bytes).expect("writes");
    }
    let seen = drain(open(dir.path()).as_mut());
    assert_eq!(seen.len(), 5);
    assert_eq!((seen[0].as_str(), seen[4].as_str()), (".", "."));
    assert_eq!(seen[1], "1.jpg: empty: zero bytes");
    assert!(seen[2].starts_with("2.jpg: JPEG cut off"), "{}", seen[2]);
    assert!(seen[3].starts_with("3.jpg: neither JPEG nor PNG"), "{}", seen[3]);
}

#[test]
fn a_pattern_selects_and_a_file_named_like_one_is_itself() {
    let dir = tempfile::tempdir().expect("a folder");
    for name in ["a1.jpg", "a2.jpg", "b1.jpg", "odd[1].jpg"] {
        fs::write(dir.path().join(name), jpeg(0, 64, 48)).expect("writes");
    }
    let count = |pattern: &str| drain(open(&dir.path().join(pattern)).as_mut()).len();
    assert_eq!(count("a*.jpg"), 2);
    assert_eq!(count("[ab]1.jpg"), 2);
    assert_eq!(count("odd[1].jpg"), 1);
    assert_eq!(count("b1.jpg"), 1);
}

#[test]
fn what_is_not_there_is_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name).to_str().expect("UTF-8").to_owned();
    let missing = path("no such thing.avi");
    assert!(matches!(refused(&missing), Error::Missing { .. }));
    assert!(refused(&missing).to_string().contains(&missing));
    // These signs are those of patterns, and of names.
    for name in ["50%.avi", "grasp[2].mp4", "grasp[2.avi", "what?.mkv", "run%20a.mcap", "50%", "50%.png"] {
        assert!(matches!(refused(&path(name)), Error::Missing { .. }), "{name}: {}", refused(&path(name)));
    }
    for name in ["what?.png", "frame_%04d.png", "frame_%d"] {
        assert!(matches!(refused(&path(name)), Error::NoImages { others_count: 0, .. }), "{name}");
    }
    assert!(matches!(refused(&path("*.png")), Error::NoImages { others_count: 0, .. }));
    assert!(matches!(refused(&path("[")), Error::Pattern { .. }));
    fs::write(path("notes.txt"), "no picture").expect("writes");
    let empty = refused(dir.path().to_str().expect("UTF-8"));
    assert!(matches!(empty, Error::NoImages { others_count: 1, .. }), "{empty}");
    // A recorder that died at once leaves such a file.
    fs::write(path("clip.mp4"), "").expect("writes");
    let expected = format!("{}: cannot read: expected a video, got an empty file", path("clip.mp4"));
    assert_eq!(refused(&path("clip.mp4")).to_string(), expected);
}

#[test]
fn an_avi_comes_back_as_it_was_written() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("whole.avi");
    write_avi(&path, 5);
    let mut source = open(&path);
    assert_eq!(source.frames_count(), Some(5));
    let mut frame = FrameBuffer::default();
    for i in 0..5 {
        assert_eq!(source.next(&mut frame).expect("reads"), Next::Frame);
        assert_eq!(frame.encoded, jpeg(i, 64, 48));
        assert_eq!((frame.seq, frame.time_ns, frame.clock), (i as u64, Some(i as u64 * 50_000_000), Clock::Assumed));
    }
    assert_eq!(source.next(&mut frame).expect("reads"), Next::End);
}

#[test]
fn an_avi_cut_anywhere_gives_its_whole_frames_then_says_so_once() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("cut.avi");
    write_avi(&path, 4);
    let whole = fs::read(&path).expect("reads");
    let index = whole.windows(4).rposition(|w| w == b"idx1").expect("an index");
    let mut frames_before = 0;
    for cut in (0..whole.len()).step_by(5) {
        fs::write(&path, &whole[..cut]).expect("writes");
        match source::open(path.to_str().expect("UTF-8")) {
            Err(e) => assert!(cut < 224 && matches!(e, Error::Avi { .. }), "cut at {cut}: {e}"),
            Ok(mut source) => {
                let seen = drain(source.as_mut());
                let frames = seen.iter().take_while(|s| *s == ".").count();
                assert!(frames >= frames_before, "cut at {cut}: fewer frames than in a shorter file");
                frames_before = frames;
                let torn = &seen[frames..];
                assert_eq!(torn.len(), usize::from(cut < index), "cut at {cut}: {seen:?}");
            }
        }
    }
    assert_eq!(frames_before, 4);
}

#[test]
fn a_broken_off_avi_without_an_index_is_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("broken_off.avi");
    let mut avi = AviWriter::create(&path, SizePx::new(64, 48), 20).expect("creates");
    for i in 0..3 {
        avi.push(&jpeg(i, 64, 48)).expect("writes");
    }
    avi.finish().expect("finishes");
    let mut bytes = fs::read(&path).expect("reads");
    bytes.truncate(bytes.windows(4).rposition(|w| w == b"idx1").expect("an index"));
    for at in [4, 216] {
        bytes[at..at + 4].copy_from_slice(&[0xFF; 4]); // the lengths as they are before the end
    }
    for at in [48, 140] {
        bytes[at..at + 4].copy_from_slice(&[0; 4]);
    }
    fs::write(&path, bytes).expect("writes");
    assert_eq!(drain(open(&path).as_mut()), [".", ".", "."]);
}
