//! What is recorded is read back, and no older recording is lost.

use crate::{Script, drain, record};
use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, FrameSource, Next, PixelFormat};
use slipbound_rig::container::{self, MarkedSource, Recorder, TappedSource};
use slipbound_rig::source;
use std::fs;

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
fn what_comes_before_a_recording_begins_costs_nothing_and_only_a_camera_loses_it_unless_its_frames_are_accepted() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    record(&path, 3, |_| true);
    let before = fs::read(&path).expect("reads");
    let read = |recorder: &Recorder, waits: bool| {
        let mut tapped = TappedSource::new(Script { seqs: vec![2, 1, 0] }, 0, recorder.inlet(), waits);
        let mut frame = FrameBuffer::default();
        (0..3).map(|_| tapped.next(&mut frame).expect("goes on")).collect::<Vec<_>>()
    };
    for (waits, accepts, expected_count) in [(true, false, 6), (false, false, 3), (false, true, 6)] {
        let create = || {
            let recorder = Recorder::create(&path, &["left".into()], false).expect("creates");
            if accepts {
                recorder.accept_frames();
            }
            recorder
        };
        let refused = create();
        read(&refused, waits);
        drop(refused);
        assert!(fs::read(&path).expect("reads") == before, "what was there is lost");
        let recorder = create();
        let early = read(&recorder, waits);
        assert!(
            early.iter().all(|next| *next == if waits || accepts { Next::Frame } else { Next::Silent }),
            "{early:?}"
        );
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
fn a_frame_whose_file_is_gone_is_told_of() {
    let scratch = tempfile::tempdir().expect("a folder");
    let [folder, file] = ["run", "run.mcap"].map(|name| scratch.path().join(name));
    record(&file, 4, |_| true);
    container::to_folder(&file, &folder).expect("is unpacked");
    let whole = container::to_mcap(&folder, &file).expect("is packed again");
    assert_eq!((whole.frames_count, whole.left_out.len()), (4, 0));
    fs::remove_file(folder.join("left/000002.jpg")).expect("there");
    let converted = container::to_mcap(&folder, &file).expect("the others are carried over");
    let told = "1 frames without a file, the first left/000002.jpg (lost, or it came as pixels)";
    assert_eq!((converted.frames_count, converted.left_out), (3, vec![told.to_owned()]));
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

/// The disk did not keep up: that the second frame was judged is in the file, but not its bytes.
#[test]
fn a_judged_frame_whose_bytes_were_lost_is_torn_at_its_place() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("run.mcap");
    let recorder = Recorder::create(&path, &["left".into()], true).expect("creates");
    recorder.begin();
    let mut frame = FrameBuffer::default();
    for seq in 0..3 {
        if seq != 1 {
            let mut tapped = TappedSource::new(Script { seqs: vec![seq] }, 0, recorder.inlet(), true);
            tapped.next(&mut frame).expect("goes on");
        }
        let mut marked = MarkedSource::new(Script { seqs: vec![seq] }, 0, recorder.inlet(), true);
        marked.next(&mut frame).expect("goes on");
    }
    recorder.finish().expect("closes");
    let mut source = source::open(path.to_str().expect("UTF-8")).expect("opens");
    let mut next = || (source.next(&mut frame).expect("goes on"), frame.seq);
    let given = [next(), next(), next(), next()];
    assert_eq!([0, 2].map(|i| given[i].clone()), [(Next::Frame, 0), (Next::Frame, 2)]);
    let Next::Torn { reason } = &given[1].0 else { panic!("{given:?}") };
    assert!(reason.contains("were not recorded") && given[1].1 == 1, "{reason}");
    assert_eq!(given[3].0, Next::End);
}

#[test]
fn a_file_that_nothing_could_read_again_is_left_out_and_a_spoilt_line_is_named() {
    let scratch = tempfile::tempdir().expect("a folder");
    let [folder, file] = ["run", "run.mcap"].map(|name| scratch.path().join(name));
    record(&file, 4, |_| true);
    container::to_folder(&file, &folder).expect("is unpacked");
    fs::File::create(folder.join("left.avi")).and_then(|avi| avi.set_len(300 << 20)).expect("a sparse file");
    let converted = container::to_mcap(&folder, &file).expect("the rest is carried over");
    assert!(converted.left_out[0].starts_with("left.avi, which has 314572800 bytes"), "{:?}", converted.left_out);
    assert_eq!(drain(file.to_str().expect("UTF-8")).0.len(), 4);
    let records = folder.join("left.frames.jsonl");
    let lines = fs::read_to_string(&records).expect("lines");
    fs::write(&records, lines.replacen("{\"seq\":2", "{\"seq\":x", 1)).expect("writes");
    let said = container::to_mcap(&folder, &file).expect_err("spoilt").to_string();
    assert!(said.contains("left.frames.jsonl: line 3: expected value"), "{said}");
}

/// A bag of another program, with two topics in turn.
#[test]
fn messages_that_a_folder_cannot_hold_are_told_by_topic_with_their_number() {
    use std::collections::BTreeMap;
    let scratch = tempfile::tempdir().expect("a folder");
    let [folder, path] = ["run", "bag.mcap"].map(|name| scratch.path().join(name));
    let file = std::io::BufWriter::new(fs::File::create(&path).expect("creates"));
    let mut writer = mcap::Writer::new(file).expect("writes");
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").expect("writes");
    let topics = ["/a", "/b"].map(|topic| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("writes"));
    for n in 0..10u32 {
        let header = mcap::records::MessageHeader {
            channel_id: topics[n as usize % 2],
            sequence: n,
            log_time: n.into(),
            publish_time: n.into(),
        };
        writer.write_to_known_channel(&header, &[0; 8]).expect("writes");
    }
    writer.finish().expect("writes");
    let converted = container::to_folder(&path, &folder).expect("is unpacked");
    let told = ["/a", "/b"].map(|topic| format!("5 messages std_msgs/msg/String of {topic}"));
    assert_eq!(converted.left_out, told);
}
