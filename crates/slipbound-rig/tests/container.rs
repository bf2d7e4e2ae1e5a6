//! Recordings in MCAP files: what is written is read again, judged frames alone, and a file that is cut or damaged as far
//! as it goes.
#![cfg(feature = "mcap")]

use jpeg_encoder::{ColorType, Encoder};
use proptest::prelude::*;
use slipbound::image::SizePx;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat, SourceError};
use slipbound_rig::container::{self, MarkedSource, Recorder, ReportLines, TappedSource};
use slipbound_rig::source;
use std::fs;
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

/// Records so many frames, of which those are judged that `is_judged` says; what was judged.
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

/// All that a file gives, until its end; the last element is why it was cut off.
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

#[test]
fn exactly_the_judged_frames_come_back_with_their_numbers_times_and_pixels() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let judged = record(&path, 40, |seq| seq % 3 != 1);
    let shown = path.to_str().expect("UTF-8");
    let (seen, cut) = drain(shown);
    assert_eq!((seen.len(), cut), (27, None));
    assert_eq!(seen, judged);
    assert_eq!(drain(&format!("{shown}#/left/camera")).0, judged, "by its topic");
    assert_eq!(drain(&format!("{shown}#left")).0, judged, "by the finger");
    let refused = source::open(&format!("{shown}#right")).err().expect("no such finger").to_string();
    assert!(refused.contains("expected a topic right"), "{refused}");
}

#[test]
fn a_recording_without_a_judge_gives_every_frame() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let recorder = Recorder::create(&path, &["left".into(), "right".into()], false).expect("creates");
    for finger in 0..2 {
        let mut tapped = TappedSource::new(Script { seqs: vec![3, 2, 1, 0] }, finger, recorder.inlet(), true);
        let mut frame = FrameBuffer::default();
        while tapped.next(&mut frame).expect("goes on") != Next::End {}
    }
    assert_eq!(recorder.finish().expect("closes").frames_count, 8);
    let shown = path.to_str().expect("UTF-8");
    let refused = source::open(shown).err().expect("two fingers").to_string();
    assert!(refused.contains("/left/camera, /right/camera"), "{refused}");
    let (seen, _) = drain(&format!("{shown}#right"));
    assert_eq!(seen.iter().map(|given| given.0).collect::<Vec<_>>(), [0, 1, 2, 3]);
}

#[test]
fn a_file_that_is_cut_anywhere_gives_what_came_before_and_says_so() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let judged = record(&path, 12, |_| true);
    let whole = fs::read(&path).expect("reads");
    let part = scratch.path().join("part.mcap");
    let mut most_count = 0;
    for cut in (0..whole.len()).step_by(whole.len() / 40) {
        fs::write(&part, &whole[..cut]).expect("writes");
        let shown = part.to_str().expect("UTF-8");
        match source::open(shown) {
            Err(e) => assert!(e.to_string().contains("expected topics with pictures"), "{e}"),
            Ok(_) => {
                let (seen, said) = drain(shown);
                assert!(judged.starts_with(&seen), "cut at {cut}: {seen:?} of {judged:?}");
                assert!(said.is_some() || seen == judged, "cut at {cut}, and nothing said");
                most_count = most_count.max(seen.len());
            }
        }
    }
    assert_eq!(most_count, judged.len(), "the longest parts hold all");
}

/// Readers that look for the end first read nothing of a file without one.
#[test]
fn a_recording_of_ours_has_an_end_whenever_its_program_is_killed_and_says_that_it_was() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (path, killed) = (scratch.path().join("run.mcap"), scratch.path().join("killed.mcap"));
    let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
    recorder.begin();
    let frames = |seqs: &[u64]| {
        let mut tapped = TappedSource::new(Script { seqs: seqs.to_vec() }, 0, recorder.inlet(), true);
        let mut frame = FrameBuffer::default();
        while tapped.next(&mut frame).expect("goes on") != Next::End {}
    };
    for (seqs, expected) in [(&[1, 0][..], &[0, 1][..]), (&[3, 2], &[0, 1, 2, 3])] {
        frames(seqs);
        let seen = (0..200).find_map(|_| {
            std::thread::sleep(std::time::Duration::from_millis(50));
            let bytes = fs::read(&path).expect("reads");
            let ended = bytes.ends_with(mcap::MAGIC) && bytes.len() > 1000;
            fs::write(&killed, bytes).expect("writes");
            let shown = killed.to_str().expect("UTF-8");
            let (seen, told) = source::open(shown).ok().map(|_| drain(shown))?;
            (ended && seen.len() == expected.len()).then_some((seen, told))
        });
        let (seen, told) = seen.expect("a file with an end within 10 s");
        assert_eq!(seen.iter().map(|given| given.0).collect::<Vec<_>>(), expected);
        assert!(told.is_some_and(|told| told.contains("cut off or damaged (its program was killed or has failed)")));
    }
    recorder.finish().expect("closes");
    let (seen, told) = drain(path.to_str().expect("UTF-8"));
    assert_eq!((seen.len(), told), (4, None), "closed as it should be");
}

#[test]
fn a_recording_that_is_given_up_keeps_what_it_has_and_is_cut_off() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let shown = path.to_str().expect("UTF-8");
    let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
    recorder.metadata("facts", [("name".into(), "value".into())]);
    recorder.begin();
    let mut tapped = TappedSource::new(Script { seqs: vec![2, 1, 0] }, 0, recorder.inlet(), true);
    let mut frame = FrameBuffer::default();
    while tapped.next(&mut frame).expect("goes on") != Next::End {}
    drop(recorder); // while the camera goes on
    let (seen, told) = drain(shown);
    assert_eq!(seen.iter().map(|given| given.0).collect::<Vec<_>>(), [0, 1, 2]);
    assert!(told.is_some_and(|told| told.contains("its program was killed or has failed")), "and not whole");
}

#[test]
fn what_was_there_stays_until_something_is_recorded() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let begin = || {
        let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
        recorder.attach("left.sensor.toml", "text/toml", b"name = 1".to_vec());
        recorder.metadata("facts", [("name".into(), "value".into())]);
        recorder
    };
    drop(begin()); // as when the source is refused
    assert!(!path.exists(), "nothing was recorded");
    record(&path, 3, |_| true);
    let before = fs::read(&path).expect("reads");
    drop(begin());
    assert!(fs::read(&path).expect("reads") == before, "what was there is lost");
    assert_eq!(begin().finish().expect("closes").frames_count, 0);
    let after = fs::read(&path).expect("reads");
    assert!(after.len() < before.len() && after.ends_with(mcap::MAGIC), "an empty recording, whole");
}

#[test]
fn what_comes_before_a_recording_begins_costs_nothing_and_only_a_camera_loses_it() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    record(&path, 3, |_| true);
    let before = fs::read(&path).expect("reads");
    let read = |recorder: &Recorder, waits: bool| {
        let mut tapped = TappedSource::new(Script { seqs: vec![2, 1, 0] }, 0, recorder.inlet(), waits);
        let mut frame = FrameBuffer::default();
        (0..3).map(|_| tapped.next(&mut frame).expect("goes on")).collect::<Vec<_>>()
    };
    for (waits, expected_count) in [(true, 6), (false, 3)] {
        let create = || Recorder::create(&path, &["left".into()], false).expect("creates");
        let refused = create();
        read(&refused, waits);
        drop(refused);
        assert!(fs::read(&path).expect("reads") == before, "what was there is lost");
        let recorder = create();
        let early = read(&recorder, waits);
        assert!(early.iter().all(|next| *next == if waits { Next::Frame } else { Next::Silent }), "{early:?}");
        recorder.begin();
        read(&recorder, waits);
        assert_eq!(recorder.finish().expect("closes").frames_count, expected_count);
        fs::write(&path, &before).expect("writes");
    }
}

#[test]
fn a_run_that_cannot_be_converted_leaves_the_recording_that_was_there() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (folder, file) = (scratch.path().join("run"), scratch.path().join("run.mcap"));
    fs::create_dir(&folder).expect("a folder");
    fs::write(&file, "from before").expect("writes");
    fs::write(folder.join("run.toml"), "").expect("writes");
    let facts = folder.join("z.metadata.json");
    fs::write(&facts, "{cut").expect("writes");
    container::to_mcap(&folder, &file).expect_err("no JSON");
    assert_eq!(fs::read_to_string(&file).expect("there"), "from before");
    fs::write(&facts, "{}").expect("writes");
    container::to_mcap(&folder, &file).expect("is carried over");
    assert!(fs::read(&file).expect("there").ends_with(mcap::MAGIC));
    assert_eq!(fs::read_dir(scratch.path()).expect("reads").count(), 2, "nothing is left beside it");
}

#[test]
fn a_picture_whose_record_was_cut_off_has_its_own_number_and_time() {
    /// Frames so large that each closes its chunk: the record of it is in the next one.
    struct Large(u64);
    impl FrameSource for Large {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            self.0 += 1;
            into.encoded = jpeg(self.0);
            into.encoded.resize(9 << 20, 0);
            (into.seq, into.time_ns, into.clock) = (100 + self.0, Some(1_000_007 * self.0), Clock::Device);
            Ok(if self.0 > 3 { Next::End } else { Next::Frame })
        }
    }
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
    let mut tapped = TappedSource::new(Large(0), 0, recorder.inlet(), true);
    let mut frame = FrameBuffer::default();
    while tapped.next(&mut frame).expect("goes on") != Next::End {}
    recorder.finish().expect("closes");
    let whole = fs::read(&path).expect("reads");
    // From where the third chunk ends on: in it is the record of the first frame, and the second frame, but not its record.
    let mut lone_count = 0;
    for end in chunks_at(&whole).into_iter().skip(2).chain([whole.len()]) {
        fs::write(&path, &whole[..end]).expect("writes");
        let (seen, _) = drain(path.to_str().expect("UTF-8"));
        for (i, (seq, time_ns, clock, ..)) in (1..).zip(&seen) {
            assert_eq!((*seq, *time_ns), (100 + i, Some(1_000_007 * i)), "cut at {end}: {seen:?}");
            lone_count += u32::from(*clock == Clock::Container);
        }
    }
    assert!(lone_count > 0, "no picture was without its record");
}

/// As a program leaves it that writes chunk by chunk and is killed: the head of the last one does not know its length yet.
#[test]
fn a_chunk_that_was_never_closed_ends_the_file_and_is_told_by_its_number() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let judged = record(&path, 300, |_| true);
    let whole = fs::read(&path).expect("reads");
    let chunks = chunks_at(&whole);
    assert!(!chunks.is_empty());
    for (number, &at) in chunks.iter().enumerate() {
        let mut killed = whole.clone();
        killed[at + 1..at + 9].copy_from_slice(&u64::MAX.to_le_bytes());
        killed.truncate(at + 3000); // where the disk had got to
        fs::write(&path, &killed).expect("writes");
        let shown = path.to_str().expect("UTF-8");
        let told = match source::open(shown) {
            Err(e) => e.to_string(),
            Ok(_) => {
                let (seen, told) = drain(shown);
                assert!(judged.starts_with(&seen), "chunk {number}: {seen:?}");
                told.unwrap_or_default()
            }
        };
        assert!(told.contains(&format!("chunk {number} was never closed")), "chunk {number}: {told}");
    }
}

/// Where the chunks of a file begin.
fn chunks_at(whole: &[u8]) -> Vec<usize> {
    let (mut at, mut chunks) = (8, Vec::new());
    while let Some(head) = whole.get(at..at + 9).filter(|head| head[0] != 0x0F) {
        if head[0] == 0x06 {
            chunks.push(at);
        }
        at += 9 + u64::from_le_bytes(head[1..].try_into().expect("8 bytes")) as usize;
    }
    chunks
}

#[test]
fn settings_of_a_run_that_are_too_long_are_not_carried_into_a_recording() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (folder, file) = (scratch.path().join("run"), scratch.path().join("run.mcap"));
    fs::create_dir(&folder).expect("a folder");
    fs::write(&file, "from before").expect("writes");
    let write = |name: &str, bytes: usize| fs::write(folder.join(name), vec![b'#'; bytes]).expect("writes");
    for name in ["run.toml", "left.sensor.toml"] {
        write("run.toml", 1 << 20);
        write(name, (1 << 20) + 7);
        let refused = container::to_mcap(&folder, &file).expect_err("too long").to_string();
        let expected = format!("{name}: cannot read: expected at most 1048576 bytes of TOML, got 1048583");
        assert!(refused.ends_with(&expected), "{refused}");
        assert_eq!(fs::read_to_string(&file).expect("there"), "from before");
    }
    write("left.sensor.toml", 1 << 20);
    write("run.toml", 1 << 20);
    write("page.html", 3 << 20);
    assert_eq!(container::to_mcap(&folder, &file).expect("carried").files_count, 3);
}

/// `PROPTEST_CASES`, or 48: each writes a file.
fn cases_count() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(48)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases_count()))]

    #[test]
    fn damage_never_makes_it_panic_or_run_on(
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..30),
    ) {
        let scratch = tempfile::tempdir().expect("a folder");
        let path = scratch.path().join("run.mcap");
        let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
        let mut tapped = TappedSource::new(Script { seqs: vec![2, 1, 0] }, 0, recorder.inlet(), true);
        let mut frame = FrameBuffer::default();
        while tapped.next(&mut frame).expect("goes on") != Next::End {}
        recorder.finish().expect("closes");
        let mut bytes = fs::read(&path).expect("reads");
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        fs::write(&path, &bytes).expect("writes");
        if let Ok(mut source) = source::open(path.to_str().expect("UTF-8")) {
            let mut steps_count = 0;
            while !matches!(source.next(&mut frame), Ok(Next::End) | Err(_)) {
                steps_count += 1;
                prop_assert!(steps_count < 1000);
            }
        }
    }
}

/// The same file with its chunks packed; from the summary on nothing is kept, as in a file that was cut off there.
fn packed(whole: &[u8], name: &str, mut pack: impl FnMut(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let (magic, mut rest) = whole.split_at(8);
    let mut out = magic.to_vec();
    while let Some((head, after)) = rest.split_at_checked(9) {
        let count = u64::from_le_bytes(head[1..].try_into().expect("8 bytes")) as usize;
        let (body, after) = after.split_at(count);
        let record = match head[0] {
            0x0F => break, // the end of the data
            0x06 => {
                let records = pack(&body[40..]);
                let (sizes, name_bytes) = (&body[..28], name.as_bytes());
                let name_count = (name_bytes.len() as u32).to_le_bytes();
                [sizes, &name_count, name_bytes, &(records.len() as u64).to_le_bytes(), &records].concat()
            }
            _ => body.to_vec(),
        };
        out.push(head[0]);
        out.extend_from_slice(&(record.len() as u64).to_le_bytes());
        out.extend_from_slice(&record);
        rest = after;
    }
    out
}

/// A frame of LZ4 of one block, of up to 4 MB.
fn lz4(data: &[u8]) -> Vec<u8> {
    let block = lz4_flex::block::compress(data);
    let size = (block.len() as u32).to_le_bytes();
    [&[0x04, 0x22, 0x4D, 0x18, 0x60, 0x70, 0x73][..], &size, &block, &[0; 4]].concat()
}

fn zstd(data: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(data, ruzstd::encoding::CompressionLevel::Fastest)
}

#[test]
fn compressed_chunks_hold_the_same_and_damage_in_one_is_told() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let judged = record(&path, 300, |_| true);
    let whole = fs::read(&path).expect("reads");
    let part = scratch.path().join("packed.mcap");
    let shown = part.to_str().expect("UTF-8");
    type Pack = fn(&[u8]) -> Vec<u8>;
    for (name, pack) in [("zstd", zstd as Pack), ("lz4", lz4)] {
        let packed = packed(&whole, name, pack);
        fs::write(&part, &packed).expect("writes");
        let (seen, cut) = drain(shown);
        assert!(seen == judged && cut.is_some(), "{name}: {} of {}, {cut:?}", seen.len(), judged.len());
        // A picture in the first chunk gets another byte: the chunk is told of, and those after it are read.
        let mut is_first = true;
        let damaged = self::packed(&whole, name, |data| {
            let mut data = data.to_vec();
            // A slow machine may have closed a chunk without a picture.
            if let Some(at) = data.windows(2).position(|pair| pair == [0xFF, 0xD9]) {
                data[at] ^= u8::from(std::mem::take(&mut is_first));
            }
            pack(&data)
        });
        fs::write(&part, &damaged).expect("writes");
        let mut source = source::open(shown).expect("opens");
        let (mut frame, mut told, mut last_seq) = (FrameBuffer::default(), Vec::new(), 0);
        loop {
            match source.next(&mut frame).expect("goes on") {
                Next::End => break,
                Next::Torn { reason } if reason.contains("checksum") => told.push((frame.seq, reason)),
                Next::Frame => last_seq = frame.seq,
                _ => {}
            }
        }
        let [(seq, reason)] = told.as_slice() else { panic!("{name}: {told:?}") };
        assert!(
            (1..=300).contains(seq)
                && reason.contains("packed.mcap: chunk ")
                && reason.contains(", just before this, is damaged"),
            "{seq} {reason}"
        );
        assert_eq!(last_seq, 299);
    }
    fs::write(&part, self::packed(&whole, "zstd", |data| data.to_vec())).expect("writes");
    let refused = source::open(shown).err().expect("no zstd").to_string();
    assert!(refused.contains("packed.mcap") && refused.contains("chunk 0: expected a frame of zstd"), "{refused}");
    fs::write(&part, self::packed(&whole, "br", |data| data.to_vec())).expect("writes");
    let refused = source::open(shown).err().expect("no such").to_string();
    assert!(refused.contains("chunk 0: expected zstd, lz4 or no compression, got `br`"), "{refused}");
    // What a head claims is checked: more than can be, and more than there is.
    for (claimed, expected) in
        [(u64::MAX, "chunk 0: expected at most 1073741824 bytes unpacked"), (1 << 29, "got its end")]
    {
        let mut claims = self::packed(&whole, "zstd", zstd);
        let chunk = claims.windows(4).position(|name| name == b"zstd").expect("a chunk");
        claims[chunk - 16..chunk - 8].copy_from_slice(&claimed.to_le_bytes());
        fs::write(&part, &claims).expect("writes");
        let told = source::open(shown).err().map_or_else(|| drain(shown).1.unwrap_or_default(), |e| e.to_string());
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn grey_pixels_stay_grey() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    record(&path, 5, |seq| seq == 4);
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("opens");
    let mut frame = FrameBuffer::default();
    assert_eq!(source.next(&mut frame).expect("goes on"), Next::Frame);
    assert_eq!((frame.seq, frame.format, frame.size), (4, PixelFormat::Gray, SizePx::new(64, 48)));
}
