//! Videos that the program `ffmpeg` decodes. Without it there is nothing to test.

use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, Next, SourceErrorKind};
use slipbound_rig::source;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Ten frames of ffmpeg's own test image; None where there is no ffmpeg.
fn video(dir: &Path, name: &str, codec: &[&str]) -> Option<PathBuf> {
    let path = dir.join(name);
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=20:duration=0.5", "-c:v"])
        .args(codec)
        .arg(&path)
        .status();
    match made {
        Ok(status) => {
            assert!(status.success());
            Some(path)
        }
        Err(_) => {
            eprintln!("no ffmpeg here: not tested");
            None
        }
    }
}

/// Pixels of all whole frames, and the reasons of torn ones.
fn drain(path: &Path) -> (Vec<Vec<u8>>, Vec<String>) {
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("opens");
    let mut frame = FrameBuffer::default();
    let (mut frames, mut torn) = (Vec::new(), Vec::new());
    loop {
        match source.next(&mut frame).expect("no final error") {
            Next::Frame => {
                assert_eq!((frame.seq, frame.size), (frames.len() as u64, SizePx::new(64, 48)));
                assert_eq!((frame.time_ns, frame.clock), (Some(frame.seq * 50_000_000), Clock::Assumed));
                frames.push(frame.pixels.clone());
            }
            Next::Torn { reason } => torn.push(reason),
            Next::Silent => {}
            Next::End => return (frames, torn),
        }
    }
}

#[test]
fn every_frame_comes_once_and_the_same_each_time() {
    let dir = tempfile::tempdir().expect("a folder");
    for (name, codec) in
        [("a.avi", ["mpeg4", "-q:v", "2"]), ("b.mp4", ["mpeg4", "-q:v", "2"]), ("c.mkv", ["ffv1", "-level", "3"])]
    {
        let Some(path) = video(dir.path(), name, &codec) else { return };
        let (frames, torn) = drain(&path);
        assert_eq!((frames.len(), torn.len()), (10, 0), "{name}: {torn:?}");
        assert_eq!(drain(&path).0, frames, "{name}");
    }
}

/// A video of 20 frames per second without frames 5 to 14; None where there is no ffmpeg.
fn uneven(dir: &Path, name: &str) -> Option<PathBuf> {
    let path = dir.join(name);
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=20:duration=1"])
        .args(["-vf", "select='not(between(n,5,14))'", "-vsync", "vfr", "-c:v", "mpeg4"])
        .arg(&path)
        .status();
    let Ok(status) = made else {
        eprintln!("no ffmpeg here: not tested");
        return None;
    };
    assert!(status.success());
    Some(path)
}

/// Number and time of every frame, ms, with this clock.
fn times_ms(path: &Path, clock: Clock) -> Vec<(u64, u64)> {
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("opens");
    let mut frame = FrameBuffer::default();
    let mut times = Vec::new();
    while source.next(&mut frame).expect("no final error") == Next::Frame {
        assert_eq!(frame.clock, clock);
        times.push((frame.seq, frame.time_ns.expect("a time") / 1_000_000));
    }
    times
}

/// A gap of half a second in the recording shows in the frame times: it does not count as ten frames.
#[test]
fn a_video_of_varying_rate_has_the_times_of_its_container() {
    let dir = tempfile::tempdir().expect("a folder");
    let Some(path) = uneven(dir.path(), "uneven.mp4") else { return };
    let expected = [0, 50, 100, 150, 200, 750, 800, 850, 900, 950];
    let times = times_ms(&path, Clock::Container);
    assert_eq!(times, (0..).zip(expected).collect::<Vec<_>>());
}

/// An AVI file has an empty chunk for every frame that its recorder dropped.
#[test]
fn an_avi_s_dropped_frames_count() {
    let dir = tempfile::tempdir().expect("a folder");
    let Some(path) = uneven(dir.path(), "uneven.avi") else { return };
    let expected: Vec<_> = (0..5).chain(15..20).map(|seq| (seq, 50 * seq)).collect();
    assert_eq!(times_ms(&path, Clock::Assumed), expected);
}

#[test]
fn a_cut_avi_gives_what_is_there_and_says_so() {
    let dir = tempfile::tempdir().expect("a folder");
    let Some(path) = video(dir.path(), "a.avi", &["mpeg4"]) else { return };
    let whole = fs::read(&path).expect("reads");
    fs::write(&path, &whole[..whole.len() * 3 / 4]).expect("writes");
    let (frames, torn) = drain(&path);
    assert!((1..10).contains(&frames.len()), "{} frames", frames.len());
    assert_eq!(torn.len(), 1, "{torn:?}");
    assert!(torn[0].contains("the file ends at byte"), "{}", torn[0]);
}

#[test]
fn what_is_no_video_is_refused_in_ffmpegs_words() {
    let dir = tempfile::tempdir().expect("a folder");
    let Some(_) = video(dir.path(), "a.avi", &["mpeg4"]) else { return };
    let path = dir.path().join("notes.mp4");
    fs::write(&path, "no video at all, but a good many words of text").expect("writes");
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("ffmpeg starts");
    let error = source.next(&mut FrameBuffer::default()).expect_err("refused");
    assert_eq!(error.kind, SourceErrorKind::Format);
    assert!(error.file.as_ref().is_some_and(|file| file.ends_with("notes.mp4")), "{:?}", error.file);
    let text = error.to_string();
    assert!(text.contains("notes.mp4") && text.contains("Invalid data"), "{text}");
}

#[test]
#[cfg(target_os = "linux")]
fn the_program_is_gone_when_the_source_is() {
    let dir = tempfile::tempdir().expect("a folder");
    let Some(_) = video(dir.path(), "a.avi", &["mpeg4"]) else { return };
    let path = dir.path().join("long.mkv");
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "testsrc=size=640x480:rate=25:duration=20", "-c:v", "mpeg4"])
        .arg(&path)
        .status();
    assert!(made.expect("runs").success());
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("opens");
    assert_eq!(source.next(&mut FrameBuffer::default()).expect("reads"), Next::Frame);
    let children = || {
        let ours = |pid: &str| {
            let command = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            String::from_utf8_lossy(&command).contains("long.mkv")
        };
        let all = fs::read_dir("/proc").expect("a process list");
        all.filter(|e| ours(&e.as_ref().expect("listed").file_name().to_string_lossy())).count()
    };
    assert_eq!(children(), 1);
    drop(source);
    assert_eq!(children(), 0);
}

/// A named pipe is read once, from its beginning to its end.
#[cfg(unix)]
#[test]
fn a_named_pipe_is_read_to_its_end() {
    let dir = tempfile::tempdir().expect("a folder");
    let (video, pipe) = (dir.path().join("a.mp4"), dir.path().join("pipe"));
    let made = Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-f",
            "lavfi",
            "-i",
            "testsrc=size=64x48:rate=10:duration=1",
            "-f",
            "mpegts",
            "-c:v",
            "mpeg2video",
        ])
        .arg(&video)
        .status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: no ffmpeg");
        return;
    }
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    let (from, to) = (video.clone(), pipe.clone());
    let writer = std::thread::spawn(move || std::fs::copy(from, to));
    let mut source = slipbound_rig::source::open(pipe.to_str().expect("UTF-8")).expect("opens");
    let (mut frame, mut frames_count) = (FrameBuffer::default(), 0);
    while source.next(&mut frame).expect("goes on") == Next::Frame {
        assert_eq!((frame.seq, frame.time_ns), (frames_count, None));
        frames_count += 1;
    }
    assert_eq!(frames_count, 10);
    drop(writer.join());
}

/// A key frame every ten frames, half a second longer between the 15th and the 16th, and without its first three packets.
#[test]
fn a_video_that_begins_between_two_key_frames_has_the_times_of_the_frames_that_come() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("whole.ts");
    let made = |once: &str| {
        Command::new("ffmpeg")
            .args(["-v", "error", "-y", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=20:duration=1.5"])
            .args(["-vf", "setpts=(N*0.05+gte(N\\,15)*0.5)/TB", once, "vfr"])
            .args(["-c:v", "mpeg2video", "-g", "10", "-bf", "0", "-sc_threshold", "1000000000"])
            .arg(&path)
            .status()
            .is_ok_and(|status| status.success())
    };
    // The first is for ffmpeg 5.1 and later.
    if !["-fps_mode", "-vsync"].into_iter().any(made) {
        return eprintln!("no ffmpeg here: not tested");
    }
    let asked = Command::new("ffprobe")
        .args(["-v", "quiet", "-show_entries", "packet=pos", "-of", "csv=p=0"])
        .arg(&path)
        .output()
        .expect("comes with ffmpeg");
    let places = String::from_utf8_lossy(&asked.stdout).into_owned();
    let from = places.split_whitespace().nth(3).and_then(|place| place.trim_end_matches(',').parse::<usize>().ok());
    let bytes = fs::read(&path).expect("reads");
    let cut = dir.path().join("cut.ts");
    // What says which streams there are is in the first three packets of 188 bytes.
    fs::write(&cut, [&bytes[..3 * 188], &bytes[from.expect("a place")..]].concat()).expect("writes");
    let mut source = source::open(cut.to_str().expect("UTF-8")).expect("opens");
    let (mut frame, mut times_ms) = (FrameBuffer::default(), Vec::new());
    while let Next::Frame | Next::Silent = source.next(&mut frame).expect("reads") {
        times_ms.push(frame.time_ns.map(|ns| (ns + 500_000) / 1_000_000));
    }
    assert_eq!(times_ms[..7], [0, 50, 100, 150, 200, 750, 800].map(Some));
}
