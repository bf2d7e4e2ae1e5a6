//! Recordings in MCAP files: what is written is read again, judged frames only; a cut or damaged file is read as far as
//! possible.
#![cfg(feature = "mcap")]

mod compressed;
mod damage;
mod recording;

use jpeg_encoder::{ColorType, Encoder};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use slipbound_rig::container::{MarkedSource, Recorder, ReportLines, TappedSource};
use slipbound_rig::source;
use std::io::Write as _;
use std::path::Path;

/// Frames as a camera would give them: JPEG, but every fifth grey pixels, and every seventh torn.
#[derive(Clone)]
struct Script {
    seqs: Vec<u64>,
}

fn jpeg(seq: u64) -> Vec<u8> {
    let pixels: Vec<u8> = (0..64 * 48).map(|i| ((i + 40 * seq) % 256) as u8).collect();
    let mut out = Vec::new();
    Encoder::new(&mut out, 85).encode(&pixels, 64, 48, ColorType::Luma).expect("encodes");
    out
}

impl FrameSource for Script {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(seq) = self.seqs.pop() else { return Ok(Next::End) };
        (into.seq, into.time_ns, into.clock) = (seq, Some(1_000_000_007 * seq), Clock::Device);
        into.encoded = jpeg(seq);
        if seq % 7 == 6 {
            into.encoded.truncate(if seq == 6 { 0 } else { 300 });
            return Ok(Next::Torn { reason: "cut".into() });
        }
        source::decode_image(into).expect("decodes");
        if seq % 5 == 4 {
            into.encoded.clear();
        }
        Ok(Next::Frame)
    }
}

/// What was given: number, time, clock, whether it is whole, a sum over the pixels.
type FrameFacts = (u64, Option<u64>, Clock, bool, u64);

fn given(next: &Next, frame: &FrameBuffer) -> FrameFacts {
    let whole = *next == Next::Frame;
    let sum = frame.pixels.iter().fold(0u64, |sum, value| sum.wrapping_mul(31).wrapping_add(u64::from(*value)));
    (frame.seq, frame.time_ns, frame.clock, whole, if whole { sum } else { 0 })
}

/// Records `count` frames, of which those selected by `is_judged` are judged; returns the judged ones.
fn record(path: &Path, count: u64, is_judged: impl Fn(u64) -> bool) -> Vec<FrameFacts> {
    let recorder = Recorder::create(path, &["left".into()], true).expect("creates");
    let seqs: Vec<u64> = (0..count).rev().collect();
    let mut tapped = TappedSource::new(Script { seqs: seqs.clone() }, 0, recorder.inlet(), true);
    let (mut frame, mut judged) = (FrameBuffer::default(), Vec::new());
    let mut report = ReportLines::new(recorder.inlet(), "left", true);
    while tapped.next(&mut frame).expect("goes on") != Next::End {
        let seq = frame.seq;
        if is_judged(seq) {
            let mut marked = MarkedSource::new(Script { seqs: vec![seq] }, 0, recorder.inlet(), true);
            let next = marked.next(&mut frame).expect("goes on");
            judged.push(given(&next, &frame));
            writeln!(report, "{{\"seq\":{seq}}}").and_then(|()| report.flush()).expect("hands in");
        }
        std::thread::sleep(std::time::Duration::from_millis(2)); // as slow as a fast camera, and no queue overflows
    }
    let written = recorder.finish().expect("closes");
    assert_eq!(written.lost_count, 0);
    judged
}

/// All frames of a file; the last element is why it was cut off.
fn drain(path: &str) -> (Vec<FrameFacts>, Option<String>) {
    let mut source = source::open(path).expect("opens");
    let (mut frame, mut seen, mut cut) = (FrameBuffer::default(), Vec::new(), None);
    loop {
        match source.next(&mut frame).expect("goes on") {
            Next::End => return (seen, cut),
            Next::Torn { reason } if reason.contains("cut off or damaged") => cut = Some(reason),
            next => seen.push(given(&next, &frame)),
        }
    }
}
