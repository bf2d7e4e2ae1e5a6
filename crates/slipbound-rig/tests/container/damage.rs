//! Files that are cut off, never closed or damaged return their intact part, and an error that says so.

use crate::{Script, drain, jpeg, record};
use proptest::prelude::*;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use slipbound_rig::container::{Recorder, TappedSource};
use slipbound_rig::source;
use std::fs;

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
            Err(e) => assert!(e.to_string().contains("expected topics with images"), "{e}"),
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
    // From the end of the third chunk on: it holds the record of the first frame, and the second frame, but not its
    // record.
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

/// The file of a killed program that writes chunk by chunk: the head of the last chunk does not state its length yet.
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
        killed.truncate(at + 3000); // as far as the disk had got
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

/// The length of the data, and no room for it.
#[test]
fn an_attachment_that_is_shorter_than_it_says_is_an_error_and_no_panic() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    for (body, name_bytes) in [(32, 0u32), (35, 0), (31, 0), (40, 5), (40, u32::MAX), (15, 0)] {
        let mut bytes = mcap::MAGIC.to_vec();
        bytes.push(9);
        bytes.extend((body as u64).to_le_bytes());
        let mut record = vec![0; body];
        if body > 20 {
            record[16..20].copy_from_slice(&name_bytes.to_le_bytes());
        }
        bytes.extend(record);
        fs::write(&path, bytes).expect("writes");
        let said = source::open(path.to_str().expect("UTF-8")).err().expect("no frame").to_string();
        assert!(said.contains("an attachment that is shorter than it says"), "{body}: {said}");
    }
}

#[test]
fn an_attachment_that_is_damaged_costs_nothing_but_itself() {
    let scratch = tempfile::tempdir().expect("a folder");
    let (path, folder) = (scratch.path().join("run.mcap"), scratch.path().join("run"));
    let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
    recorder.attach("page.html", "text/html", b"a page that is damaged below".to_vec());
    recorder.attach("whole.html", "text/html", b"a page".to_vec());
    recorder.begin();
    let mut tapped = TappedSource::new(Script { seqs: vec![2, 1, 0] }, 0, recorder.inlet(), true);
    let mut frame = FrameBuffer::default();
    while tapped.next(&mut frame).expect("goes on") != Next::End {}
    recorder.finish().expect("closes");
    let mut bytes = fs::read(&path).expect("reads");
    let at = bytes.windows(7).position(|window| window == b"damaged").expect("the page");
    bytes[at] ^= 1;
    fs::write(&path, bytes).expect("writes");
    let (seen, told) = drain(path.to_str().expect("UTF-8"));
    assert_eq!((seen.len(), told), (3, None));
    let converted = slipbound_rig::container::to_folder(&path, &folder).expect("the rest is there");
    assert_eq!((converted.files_count, converted.frames_count), (1, 3));
    assert!(converted.left_out.contains(&"1 attachments that are damaged".to_owned()), "{:?}", converted.left_out);
}
