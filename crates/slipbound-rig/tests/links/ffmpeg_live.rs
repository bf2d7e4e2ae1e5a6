//! Streams that the program `ffmpeg` reads, from an RTSP server that hangs up and falls silent. Without the program
//! there is nothing to test.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource as _, Next};
use slipbound_rig::source::{self, Camera};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

const SIZE: SizePx = SizePx::new(128, 96);
const PERIOD: Duration = Duration::from_millis(33);
/// Longest wait for anything, on a machine with other work.
const LONGEST: Duration = Duration::from_secs(60);

/// What the server does with a client that has requested the images.
#[derive(Clone, Copy)]
enum Then {
    /// Hangs up after this many images.
    HangsUp(usize),
    /// Sends nothing more after this many.
    FallsSilent(usize),
    /// Answers after this long, and then sends images without end.
    AnswersLate(Duration),
}

/// Serves clients one after the other, the last way again and again; returns the address of the stream.
fn serve(ways: Vec<Then>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("rtsp://{}/gel", listener.local_addr().expect("bound"));
    thread::spawn(move || {
        let mut clients = listener.incoming().flatten();
        for n in 0.. {
            let Some(client) = clients.next() else { return };
            let way = ways[n.min(ways.len() - 1)];
            let _ = play(client, way, 60 * n); // a client may hang up at any time
        }
    });
    url
}

/// The four requests of a client (RFC 2326), then images as RTP within the connection.
fn play(mut client: TcpStream, way: Then, first: usize) -> std::io::Result<()> {
    let mut requests = BufReader::new(client.try_clone()?);
    if let Then::AnswersLate(after) = way {
        thread::sleep(after);
    }
    loop {
        let (mut request, mut number) = (String::new(), String::new());
        requests.read_line(&mut request)?;
        loop {
            let mut line = String::new();
            requests.read_line(&mut line)?;
            match line.trim() {
                "" => break,
                line => number = line.strip_prefix("CSeq:").map_or(number, |n| n.trim().to_owned()),
            }
        }
        let sdp = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=gel\r\nt=0 0\r\nm=video 0 RTP/AVP 26\r\na=control:track\r\n";
        let more = match request.split(' ').next() {
            Some("OPTIONS") => "Public: DESCRIBE, SETUP, PLAY\r\n\r\n".into(),
            Some("DESCRIBE") => format!("Content-Type: application/sdp\r\nContent-Length: {}\r\n\r\n{sdp}", sdp.len()),
            Some("SETUP") => "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 7\r\n\r\n".into(),
            Some("PLAY") => "Session: 7\r\n\r\n".into(),
            _ => return Ok(()),
        };
        client.write_all(format!("RTSP/1.0 200 OK\r\nCSeq: {number}\r\n{more}").as_bytes())?;
        if request.starts_with("PLAY") {
            break;
        }
    }
    let count = match way {
        Then::HangsUp(count) | Then::FallsSilent(count) => count,
        Then::AnswersLate(_) => usize::MAX,
    };
    for n in 0..count {
        client.write_all(&interleaved(first + n))?;
        thread::sleep(PERIOD);
    }
    if let Then::FallsSilent(_) = way {
        let mut rest = Vec::new();
        requests.read_until(0, &mut rest)?; // until the client hangs up
    }
    Ok(())
}

/// Brightness of image `n`.
fn level(n: usize) -> u8 {
    (40 + 3 * (n % 60)) as u8
}

/// Image `n` in one RTP packet (RFC 2435: quantisation tables first, no Huffman tables), in an interleaved RTSP frame.
fn interleaved(n: usize) -> Vec<u8> {
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, 90);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let pixels = vec![level(n); 3 * SIZE.area()];
    encoder.encode(&pixels, SIZE.width as u16, SIZE.height as u16, ColorType::Rgb).expect("encodes");
    let (mut tables, mut at) = (Vec::new(), 2);
    let scan = loop {
        let length = usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        let body = &jpeg[at + 4..at + 2 + length];
        match jpeg[at + 1] {
            0xDB => body.chunks(65).for_each(|table| tables.extend_from_slice(&table[1..])),
            0xDA => break &jpeg[at + 2 + length..jpeg.len() - 2],
            _ => {}
        }
        at += 2 + length;
    };
    assert_eq!(tables.len(), 128, "one table for grey, one for colour");
    let mut packet = vec![0x80, 0x80 | 26];
    packet.extend_from_slice(&(n as u16).to_be_bytes());
    packet.extend_from_slice(&(3000 * n as u32).to_be_bytes());
    packet.extend_from_slice(&[0, 0, 0, 9]);
    packet.extend_from_slice(&[0, 0, 0, 0, 1, 255, (SIZE.width / 8) as u8, (SIZE.height / 8) as u8, 0, 0, 0, 128]);
    packet.extend_from_slice(&tables);
    packet.extend_from_slice(scan);
    let mut framed = vec![b'$', 0];
    framed.extend_from_slice(&(packet.len() as u16).to_be_bytes());
    framed.extend_from_slice(&packet);
    framed
}

fn has_ffmpeg() -> bool {
    let there = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !there {
        eprintln!("no ffmpeg here: not tested");
    }
    there
}

#[test]
fn a_server_that_hangs_up_or_falls_silent_is_asked_again() {
    if !has_ffmpeg() {
        return;
    }
    let url = serve(vec![Then::HangsUp(60), Then::FallsSilent(60), Then::HangsUp(usize::MAX)]);
    let Camera { mut source, tally, .. } = source::open_camera(&url).expect("opens");
    let mut frame = FrameBuffer::default();
    let (began, mut frames_count, mut last_ns) = (Instant::now(), 0, 0);
    // From each of the first servings the program probes some images, and outputs none of these.
    while tally.counts().returns_count < 2 || frames_count < 60 {
        assert!(began.elapsed() < LONGEST, "{frames_count} frames, {:?}", tally.counts());
        let asked = Instant::now();
        match source.next(&mut frame).expect("no final error") {
            Next::Frame => {
                let middle = frame.pixels[3 * (SIZE.area() / 2 + SIZE.width / 2)];
                let near = (0..60).any(|n| middle.abs_diff(level(n)) <= 2);
                assert!(frame.size == SIZE && near, "{:?} {middle}", frame.size);
                assert_eq!((frame.seq, frame.clock), (frames_count, Clock::Host));
                assert!(frame.time_ns > Some(last_ns), "times grow");
                (last_ns, frames_count) = (frame.time_ns.expect("a time"), frames_count + 1);
            }
            // Never longer than a tenth of a second; restarting a program takes longer on a busy machine.
            Next::Silent => assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed()),
            Next::Torn { reason } => panic!("torn: {reason}"),
            Next::End => panic!("a live source has no end"),
        }
    }
}

/// Every start of the program has the time that connecting takes, not only the first one.
#[test]
fn a_server_that_needs_four_seconds_to_answer_is_back_after_a_break() {
    if !has_ffmpeg() {
        return;
    }
    let url = serve(vec![Then::HangsUp(60), Then::AnswersLate(Duration::from_secs(4))]);
    let Camera { mut source, tally, .. } = source::open_camera(&url).expect("opens");
    let (began, mut frame) = (Instant::now(), FrameBuffer::default());
    while tally.counts().returns_count < 1 {
        assert!(began.elapsed() < LONGEST, "{:?}", tally.counts());
        source.next(&mut frame).expect("no final error");
    }
    assert!(tally.counts().frames_count > 0 && began.elapsed() > Duration::from_secs(4), "{:?}", tally.counts());
}

#[test]
fn an_address_without_a_server_is_an_error_in_ffmpegs_words() {
    if !has_ffmpeg() {
        return;
    }
    let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port").port();
    let mut camera = source::open_camera(&format!("rtsp://me:secret@127.0.0.1:{port}/gel")).expect("opens");
    assert_eq!(camera.facts[0].1, format!("rtsp://me@127.0.0.1:{port}/gel"));
    let (began, mut frame) = (Instant::now(), FrameBuffer::default());
    let error = loop {
        assert!(began.elapsed() < LONGEST, "no error");
        if let Err(error) = camera.source.next(&mut frame) {
            break error.to_string();
        }
    };
    assert!(error.contains(&port.to_string()) && error.contains("refused"), "{error}");
    assert!(error.contains("rtsp://me@127") && !error.contains("secret"), "no password: {error}");
}
