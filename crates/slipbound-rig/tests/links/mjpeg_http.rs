//! Motion JPEG over HTTP against a server that stalls, cuts, tears, and states wrong lengths.

use jpeg_encoder::{ColorType, Encoder};
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource as _, Next, SourceError, SourceErrorKind};
use slipbound_rig::source::{self, Camera};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

const HEAD: &str = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=--cam\r\n\r\n--cam\r\n";

/// What the server does next.
#[derive(Clone)]
enum Step {
    Send(Vec<u8>),
    Wait(u64),
}

/// Serves one script per connection, the last one again and again, and returns the address of the stream.
fn serve(scripts: Vec<Vec<Step>>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}/stream", listener.local_addr().expect("bound"));
    thread::spawn(move || {
        let mut scripts = scripts.into_iter();
        let mut script = Vec::new();
        for socket in listener.incoming().flatten() {
            script = scripts.next().unwrap_or(script);
            let _ = play(socket, &script); // a client may hang up at any time
        }
    });
    url
}

fn play(mut socket: TcpStream, script: &[Step]) -> std::io::Result<()> {
    let mut request = Vec::new();
    while !request.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        socket.read_exact(&mut byte)?;
        request.push(byte[0]);
    }
    assert!(request.starts_with(b"GET /stream HTTP/1.0\r\nHost: "), "{}", String::from_utf8_lossy(&request));
    for step in script {
        match step {
            Step::Send(bytes) => socket.write_all(bytes)?,
            Step::Wait(ms) => thread::sleep(Duration::from_millis(*ms)),
        }
    }
    Ok(())
}

fn jpeg(shift: usize) -> Vec<u8> {
    let pixels: Vec<u8> = (0..64 * 48).map(|i| ((i + 40 * shift) % 256) as u8).collect();
    let mut out = Vec::new();
    Encoder::new(&mut out, 85).encode(&pixels, 64, 48, ColorType::Luma).expect("encodes");
    out
}

/// A part with this length in its head, and the delimiter after it.
fn part_of(jpeg: &[u8], length: Option<usize>, more: &str) -> Step {
    let mut bytes = b"Content-Type: image/jpeg\r\n".to_vec();
    if let Some(length) = length {
        bytes.extend_from_slice(format!("Content-Length: {length}\r\n").as_bytes());
    }
    bytes.extend_from_slice(format!("{more}\r\n").as_bytes());
    bytes.extend_from_slice(jpeg);
    bytes.extend_from_slice(b"\r\n--cam\r\n");
    Step::Send(bytes)
}

fn part(shift: usize) -> Step {
    let jpeg = jpeg(shift);
    part_of(&jpeg, Some(jpeg.len()), "")
}

fn head() -> Step {
    Step::Send(HEAD.as_bytes().to_vec())
}

fn open(scripts: Vec<Vec<Step>>) -> Camera {
    source::open_camera(&serve(scripts)).expect("answers")
}

/// The next frame that is not silence.
fn next(camera: &mut Camera, frame: &mut FrameBuffer) -> Next {
    let from = Instant::now();
    loop {
        match camera.source.next(frame).expect("a stream never fails for good") {
            Next::Silent => assert!(from.elapsed() < Duration::from_secs(20), "nothing came"),
            next => return next,
        }
    }
}

/// The results until this many whole frames have come: first pixel of a frame, or why it is torn.
fn drain(camera: &mut Camera, frames_count: usize) -> Vec<Result<u8, String>> {
    let (mut seen, mut frame): (Vec<Result<u8, String>>, _) = (Vec::new(), FrameBuffer::default());
    while seen.iter().filter(|next| next.is_ok()).count() < frames_count {
        seen.push(match next(camera, &mut frame) {
            Next::Frame => {
                Ok((frame.frame().map(|_| frame.pixels[0]).expect("as many pixels as its size says") + 20) / 40)
            }
            Next::Torn { reason } => Err(reason),
            other => panic!("expected a frame, got {other:?}"),
        });
    }
    seen
}

#[test]
fn frames_come_with_their_arrival_or_with_the_server_s_own_time() {
    let stamped = part_of(&jpeg(1), None, "X-Timestamp: 12.5\r\n");
    let mut camera = open(vec![vec![head(), part(0), stamped, part(2), Step::Wait(5000)]]);
    let mut frame = FrameBuffer::default();
    let mut seen = Vec::new();
    for _ in 0..3 {
        assert_eq!(next(&mut camera, &mut frame), Next::Frame);
        assert_eq!(frame.size, SizePx::new(64, 48));
        assert!(frame.encoded.starts_with(&[0xFF, 0xD8]), "as it was received");
        seen.push((frame.seq, frame.clock, frame.time_ns == Some(12_500_000_000)));
    }
    assert_eq!(seen, [(0, Clock::Host, false), (1, Clock::Device, true), (2, Clock::Host, false)]);
    assert_eq!(camera.tally.counts().frames_count, 3);
}

#[test]
fn stamps_that_stand_still_are_no_times_of_frames() {
    let script_of = |stamps: [&str; 4]| {
        let stamped = stamps.map(|stamp| part_of(&jpeg(0), None, &format!("X-Timestamp: {stamp}\r\n")));
        let script = [head()].into_iter().chain(stamped.into_iter().flat_map(|part| [part, Step::Wait(20)]));
        script.chain([Step::Wait(5000)]).collect()
    };
    for (stamps, device_count, told) in [
        (["1", "2", "", "4"], 2, true),
        (["0.000000"; 4], 0, false),
        (["1700000000", "1700000000", "1700000000", "1700000001"], 1, true),
        (["1700000000.5", "1700000001", "1700000000.9", "1700000002"], 2, true),
        (["1", "2", "3", "4"], 4, false),
    ] {
        let mut camera = open(vec![script_of(stamps)]);
        let mut frame = FrameBuffer::default();
        let mut seen = Vec::new();
        for _ in stamps {
            assert_eq!(next(&mut camera, &mut frame), Next::Frame);
            seen.push((frame.clock, frame.time_ns.expect("a time")));
        }
        let (device, host) = seen.split_at(device_count);
        assert!(device.iter().all(|(clock, _)| *clock == Clock::Device), "{stamps:?}: {seen:?}");
        assert!(host.iter().all(|(clock, _)| *clock == Clock::Host), "{stamps:?}: {seen:?}");
        assert!(host.windows(2).all(|two| two[1].1 > two[0].1), "times that go on: {seen:?}");
        let counts = camera.tally.counts();
        assert_eq!(
            counts.to_string().ends_with("its time stamps stood still or were missing: the times are those of arrival"),
            told
        );
    }
}

/// A time of our clock among those of the server's would be a jump of days to whatever counts by them.
#[test]
fn a_torn_part_of_a_stamped_stream_has_its_own_stamp_or_no_time() {
    let whole = jpeg(1);
    let cut = &whole[..whole.len() / 2];
    let stamped = |jpeg: &[u8], stamp: &str| part_of(jpeg, Some(jpeg.len()), &format!("X-Timestamp: {stamp}\r\n"));
    let script = vec![
        head(),
        stamped(&whole, "1.5"),
        stamped(cut, "2.5"),
        part_of(cut, Some(cut.len()), ""),
        stamped(&whole, "3.5"),
        Step::Send(b"Content-Length: 5000\r\n\r\n".to_vec()),
        Step::Send(cut.to_vec()),
    ];
    let mut camera = open(vec![script, vec![head(), stamped(&whole, "4.5"), Step::Wait(5000)]]);
    let mut frame = FrameBuffer::default();
    let mut seen = Vec::new();
    for _ in 0..6 {
        let is_whole = next(&mut camera, &mut frame) == Next::Frame;
        seen.push((is_whole, frame.time_ns.map(|ns| ns / 100_000_000), frame.clock));
    }
    let none = (false, None, Clock::Unknown);
    let device = |is_whole, tenths_s| (is_whole, Some(tenths_s), Clock::Device);
    assert_eq!(seen, [device(true, 15), device(false, 25), none, device(true, 35), none, device(true, 45)]);
    assert!(!camera.tally.counts().stamps_are_distrusted);
}

#[test]
fn a_whole_frame_is_given_at_once_and_silence_lasts_a_tenth_of_a_second() {
    let jpeg = jpeg(0);
    let mut bare = format!("Content-Length: {}\r\n\r\n", jpeg.len()).into_bytes();
    bare.extend_from_slice(&jpeg);
    let mut camera = open(vec![vec![head(), Step::Send(bare), Step::Wait(5000)]]);
    let mut frame = FrameBuffer::default();
    let from = Instant::now();
    assert_eq!(next(&mut camera, &mut frame), Next::Frame, "no delimiter after it has come yet");
    assert_eq!(camera.source.next(&mut frame).expect("goes on"), Next::Silent);
    assert!(from.elapsed() < Duration::from_secs(2), "{:?}", from.elapsed());
}

#[test]
fn wrong_lengths_missing_lengths_and_missing_huffman_tables_lose_nothing() {
    let bare = without_huffman_tables(&jpeg(3));
    let script = vec![
        head(),
        part_of(&jpeg(0), Some(jpeg(0).len() - 100), ""),
        part_of(&jpeg(1), Some(jpeg(1).len() + 700), ""),
        part_of(&jpeg(2), None, ""),
        part_of(&bare, Some(bare.len()), ""),
        part_of(&jpeg(4), Some(u32::MAX as usize), ""),
        Step::Wait(5000),
    ];
    assert_eq!(drain(&mut open(vec![script]), 5), [Ok(0), Ok(1), Ok(2), Ok(3), Ok(4)]);
}

#[test]
fn a_stream_in_chunks_is_the_same_wherever_they_are_cut() {
    let chunk = |bytes: &[u8]| [format!("{:x}\r\n", bytes.len()).as_bytes(), bytes, b"\r\n"].concat();
    let Step::Send(parts) = part(0) else { unreachable!() };
    let Step::Send(more) = part(1) else { unreachable!() };
    let bytes = [b"--cam\r\n".to_vec(), parts, more].concat();
    for cut in [bytes.len(), 100, 7] {
        let head = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\nContent-Type: multipart/x-mixed-replace; boundary=cam\r\n\r\n";
        let chunks: Vec<u8> = bytes.chunks(cut).flat_map(chunk).chain(*b"0\r\n\r\n").collect();
        let mut camera = open(vec![vec![Step::Send(head.into()), Step::Send(chunks)]]);
        assert_eq!(drain(&mut camera, 4), [Ok(0), Ok(1), Ok(0), Ok(1)], "chunks of {cut}, and the stream opened again");
        assert_eq!(camera.tally.counts().torn_count, 0);
    }
}

#[test]
fn torn_frames_are_counted_and_never_given_as_frames() {
    let whole = jpeg(1);
    let cut = &whole[..whole.len() * 2 / 3];
    let script = vec![
        head(),
        part(0),
        part_of(cut, Some(cut.len()), ""),
        part_of(b"no picture", None, ""),
        part(2),
        Step::Wait(5000),
    ];
    let mut camera = open(vec![script]);
    let seen = drain(&mut camera, 2);
    assert!(seen[1].as_ref().is_err_and(|why| why.contains("cut off")), "{seen:?}");
    assert!(seen[2].as_ref().is_err_and(|why| why.contains("neither JPEG nor PNG")), "{seen:?}");
    assert_eq!((seen[0].clone(), seen[3].clone(), seen.len()), (Ok(0), Ok(2), 4));
    assert_eq!((camera.tally.counts().frames_count, camera.tally.counts().torn_count), (2, 2));
}

/// A byte every 20 ms, 1000 of them, and then the end, after which the frame that was begun is torn.
#[test]
fn a_stream_that_trickles_is_silent_as_one_that_stalls() {
    let trickle = (0..1000).flat_map(|_| [Step::Send(vec![b'x']), Step::Wait(20)]);
    let begun = Step::Send(b"Content-Length: 5000\r\n\r\n".to_vec());
    let mut camera = open(vec![[head(), part(0), begun].into_iter().chain(trickle).collect()]);
    let mut frame = FrameBuffer::default();
    assert_eq!(next(&mut camera, &mut frame), Next::Frame);
    for _ in 0..2 {
        assert_eq!(camera.source.next(&mut frame).expect("goes on"), Next::Silent);
    }
}

#[test]
fn a_stream_that_is_cut_is_opened_again_and_what_was_begun_is_torn() {
    let mut begun = b"Content-Length: 5000\r\n\r\n".to_vec();
    begun.extend_from_slice(&jpeg(1)[..300]);
    let first = vec![head(), part(0), Step::Send(begun)];
    let refuses = vec![Step::Send(b"HTTP/1.0 503 Busy\r\n\r\n".to_vec())];
    let second = vec![head(), part(2), Step::Wait(5000)];
    let mut camera = open(vec![first, refuses, second]);
    let seen = drain(&mut camera, 2);
    assert_eq!(seen, [Ok(0), Err("the connection was closed after 300 bytes of a frame".into()), Ok(2)]);
    assert_eq!(camera.tally.counts().returns_count, 1);
}

#[test]
fn a_stream_that_stalls_is_silent_and_opened_again_after_three_seconds() {
    let mut camera = open(vec![vec![head(), part(0), Step::Wait(4500)], vec![head(), part(1), Step::Wait(9000)]]);
    let from = Instant::now();
    assert_eq!(drain(&mut camera, 2), [Ok(0), Ok(1)]);
    assert!(from.elapsed() > Duration::from_secs(3), "{:?}", from.elapsed());
    assert!(camera.tally.counts().longest_ms() > 3000.0);
}

#[test]
fn heads_without_an_end_are_refused() {
    let endless = vec![b'x'; 100_000];
    let refused = source::open_camera(&serve(vec![vec![
        Step::Send(b"HTTP/1.0 200 OK\r\n".to_vec()),
        Step::Send(endless.clone()),
        Step::Wait(1000),
    ]]));
    let why = refused.err().expect("an error").to_string();
    assert!(why.contains("head of at most 16384 bytes"), "{why}");

    let part_head = vec![head(), part(0), Step::Send(b"X: ".to_vec()), Step::Send(endless), Step::Wait(1000)];
    let mut camera = open(vec![part_head, vec![head(), part(1), Step::Wait(5000)]]);
    let seen = drain(&mut camera, 2);
    assert!(seen[1].as_ref().is_err_and(|why| why.contains("part's head of at most")), "{seen:?}");
    assert_eq!((seen[0].clone(), seen[2].clone()), (Ok(0), Ok(1)), "and the stream is opened again");
}

#[test]
fn what_is_no_stream_is_refused_when_it_is_opened() {
    let refused = |uri: &str| SourceError::from(source::open(uri).err().expect("an error"));
    assert_eq!(refused("http://").kind, SourceErrorKind::Settings);
    let page = serve(vec![vec![Step::Send(b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html>".to_vec())]]);
    let error = refused(&page);
    assert_eq!((error.kind, error.file.as_deref()), (SourceErrorKind::Disconnected, Some(page.as_str())));
    assert!(error.to_string().contains("text/html"), "{error}");
    let nobody = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port that is free again");
    assert_eq!(refused(&format!("http://{nobody}/")).kind, SourceErrorKind::Disconnected);
}

/// The same image as sent by cameras that leave out the standard tables.
fn without_huffman_tables(jpeg: &[u8]) -> Vec<u8> {
    let mut bare = jpeg[..2].to_vec();
    let mut at = 2;
    while jpeg[at + 1] != 0xDA {
        let end = at + 2 + usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        if jpeg[at + 1] != 0xC4 {
            bare.extend_from_slice(&jpeg[at..end]);
        }
        at = end;
    }
    bare.extend_from_slice(&jpeg[at..]);
    bare
}
