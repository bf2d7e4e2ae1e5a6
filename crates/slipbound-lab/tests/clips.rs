//! Recorded clips that cannot be judged are named, never counted as held.

use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, FrameSource, Next, PixelFormat, SourceError, SourceErrorKind};
use slipbound_lab::eval::clips::Clips;
use slipbound_lab::eval::lifts::Lifts;
use slipbound_lab::eval::wriggles::Wriggles;
use slipbound_lab::eval::{Cell, Protocol, SweepError, TrialRecord, run};
use slipbound_lab::rivals::{Entry, named};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use tempfile::TempDir;

/// A press that lasts for a second.
fn world() -> World {
    let scene = "press?object=bottle_cap&force_n=10&hold_s=1&grid=fast";
    World::new(&Trial::parse(scene).expect("a scene")).expect("a world")
}

/// A clip by its name: `dark*`, `torn*` and `wide*`, of another shape, have no usable frame, `short*` has three frames, `cut*` cannot be read from the
/// tenth on, others show a press.
struct Clip {
    name: String,
    world: World,
    given: u64,
}

impl FrameSource for Clip {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let most = if self.name.starts_with("short") { 3 } else { 25 };
        let is_press = !["dark", "torn", "wide", "short"].iter().any(|kind| self.name.starts_with(kind));
        if self.given == most && !is_press {
            return Ok(Next::End);
        }
        if self.name.starts_with("cut") && self.given == 9 {
            return Err(SourceError::new(SourceErrorKind::Format, "clip: expected a frame, got the end of the file")
                .of_file("clip"));
        }
        let seq = self.given;
        self.given += 1;
        if self.name.starts_with("torn") {
            into.seq = seq;
            return Ok(Next::Torn { reason: "half a file".into() });
        }
        if self.name.starts_with("dark") || self.name.starts_with("wide") {
            let own = self.world.sensor().image_px;
            let size = if self.name.starts_with("wide") { SizePx::new(2 * own.width, own.height) } else { own };
            (into.seq, into.size, into.format) = (seq, size, PixelFormat::Rgb);
            into.pixels = vec![0; 3 * size.area()];
            return Ok(Next::Frame);
        }
        self.world.next(into)
    }
}

fn open(uri: &str) -> Result<Box<dyn FrameSource + Send>, SourceError> {
    let name = Path::new(uri).file_name().expect("a name").to_string_lossy().into_owned();
    let fails = |kind, text: &str| Err(SourceError::new(kind, format!("{uri}: {text}")).of_file(uri));
    match name.as_str() {
        "empty" => return fails(SourceErrorKind::Settings, "expected images, got none"),
        name if name.starts_with('.') => return fails(SourceErrorKind::Unsupported, "no program for it"),
        "locked" => return fails(SourceErrorKind::Unreadable, "permission denied"),
        _ => {}
    }
    Ok(Box::new(Clip { name, world: world(), given: 0 }))
}

/// A folder with these folders, in each of them these files, all labelled as held.
fn folder(clips: &[(&str, &[&str])]) -> TempDir {
    let root = tempfile::tempdir().expect("a folder");
    let labels: String = clips.iter().map(|(clip, _)| format!("{clip},cup,0\n")).collect();
    fs::write(root.path().join("labels.csv"), format!("clip,object,slip\n{labels}")).expect("labels");
    for (clip, files) in clips {
        fs::create_dir(root.path().join(clip)).expect("a folder");
        files.iter().for_each(|file| fs::write(root.path().join(clip).join(file), "").expect("a file"));
    }
    root
}

fn clips(root: &TempDir) -> Clips {
    Clips::open(root.path(), open).expect("clips")
}

fn judge(protocol: &dyn Protocol, root: &TempDir) -> Result<Vec<TrialRecord>, String> {
    judge_by(&["ours"], protocol, root)
}

/// The records of the first trials, or the error without the folder of the clips.
fn judge_by(detectors: &[&str], protocol: &dyn Protocol, root: &TempDir) -> Result<Vec<TrialRecord>, String> {
    let detectors: Vec<&'static Entry> = detectors.iter().map(|name| named(name).expect("there is one")).collect();
    let numbers: Vec<u64> = (0..protocol.trials_count()).collect();
    let mut all = Vec::new();
    let ran = run(protocol, &detectors, &numbers, 1, &|| false, &mut |records| {
        all.extend(records);
        Ok(())
    });
    match ran {
        Ok(()) => Ok(all),
        Err(error) => Err(error.to_string().replace(&format!("{}/", root.path().display()), "")),
    }
}

fn wriggles(of: &[(&str, &[&str])]) -> Result<Vec<TrialRecord>, String> {
    let root = folder(of);
    judge(&Wriggles::new(clips(&root), world().sensor(), 1), &root)
}

fn lifts(of: &[(&str, &[&str])]) -> Result<Vec<TrialRecord>, String> {
    let root = folder(of);
    judge(&Lifts::new(clips(&root), world().sensor(), false), &root)
}

/// Why the first trial could not be judged.
fn problem(records: &Result<Vec<TrialRecord>, String>) -> String {
    let first = &records.as_ref().expect("records")[0];
    assert_eq!((first.verdict, first.truth, first.is_right()), (false, None, None), "it counts nowhere");
    first.unjudged().expect("not judged").to_owned()
}

#[test]
fn a_grasp_of_which_no_finger_can_be_judged_is_named_and_not_counted() {
    let of = |videos: &[&str]| problem(&wriggles(&[("a", videos)]));
    assert_eq!(of(&["notes.txt"]), "expected a video of each finger, *.avi, got none");
    let none = "expected a finger that can be judged, got none: ";
    let torn = "torn.avi: expected a whole frame, got none (25 torn)";
    assert_eq!(of(&["torn.avi"]), format!("{none}{torn}"));
    let both = of(&["dark.avi", "torn.avi"]);
    assert!(both.starts_with(&format!("{none}dark.avi: no rest frame among the first 20 frames (20")), "{both}");
    assert!(both.ends_with(torn), "{both}");
}

#[test]
fn a_clip_of_another_shape_leaves_the_others() {
    let judged = lifts(&[("wide", &[]), ("z", &[])]);
    let why = problem(&judged);
    assert!(why.starts_with("image_px: expected "), "{why}");
    let judged = judged.expect("records");
    assert_eq!((judged.len(), judged[1].unjudged()), (2, None));
    let alone = wriggles(&[("a", &["left.avi"])]).expect("a grasp");
    let beside = wriggles(&[("a", &["left.avi", "wide.avi"])]).expect("a grasp");
    assert_eq!((beside[0].score, beside[0].number_of("unjudged_videos")), (alone[0].score, Some(1.0)));
}

#[test]
fn a_hidden_file_of_a_grasp_is_no_video() {
    let alone = wriggles(&[("a", &["left.avi"])]);
    assert_eq!(wriggles(&[("a", &["._left.avi", "left.avi"])]), alone);
}

#[test]
fn a_grasp_that_cannot_be_judged_leaves_the_others_and_their_window() {
    let alone = wriggles(&[("b", &["left.avi"])]).expect("a grasp");
    let of = [("a", &[][..]), ("b", &["left.avi"][..])];
    let both = wriggles(&of).expect("grasps");
    assert_eq!(both.len(), 2);
    assert_eq!(TrialRecord { number: 0, ..both[1].clone() }, alone[0]);
    let root = folder(&of);
    let table = &Wriggles::new(clips(&root), world().sensor(), 1).tables(&both)[0];
    let named = " Not judged, and not counted: a (expected a video of each finger, *.avi, got none).";
    assert!(table.note.ends_with(named), "{}", table.note);
    assert!(table.markdown().contains("| ours | 1 | 0 |"), "{}", table.markdown());
}

#[test]
fn a_finger_that_cannot_be_judged_leaves_the_other_and_its_window() {
    let alone = wriggles(&[("a", &["left.avi"])]).expect("a grasp");
    let beside = wriggles(&[("a", &["dark.avi", "left.avi"])]).expect("a grasp");
    assert!(alone[0].number_of("window_frames").is_some_and(|count| count > 0.0), "{alone:?}");
    assert_eq!(alone[0].number_of("unjudged_videos"), None);
    assert_eq!(beside[0].number_of("unjudged_videos"), Some(1.0));
    assert_eq!(TrialRecord { more: alone[0].more.clone(), ..beside[0].clone() }, alone[0]);
    assert_eq!(beside[0].number_of("window_frames"), alone[0].number_of("window_frames"));

    let root = folder(&[]);
    fs::create_dir(root.path().join("a")).expect("a folder");
    let note = &Wriggles::new(clips(&root), world().sensor(), 1).tables(&beside)[0].note;
    assert!(note.ends_with("Grasps with a video that could not be judged, by the other finger alone: 1."), "{note}");
}

/// The paper's method sees this contact at another time than ours.
#[test]
fn the_window_is_the_same_whoever_is_asked() {
    let root = folder(&[("a", &["left.avi"])]);
    let of = |detectors: &[&str]| {
        let mut records =
            judge_by(detectors, &Wriggles::new(clips(&root), world().sensor(), 1), &root).expect("records");
        records.sort_by(|a, b| a.detector.cmp(&b.detector));
        records
    };
    let both = of(&["ours", "paper_as_written"]);
    assert!(both[0].number_of("window_frames").is_some_and(|count| count > 0.0), "{both:?}");
    assert_eq!(of(&["paper_as_written"]), both[1..]);
}

#[test]
fn a_lift_without_a_frame_to_score_is_named_and_not_counted() {
    let of = |name: &str| problem(&lifts(&[(name, &[]), ("z", &[])]));
    let dark = of("dark");
    assert!(dark.starts_with("unusable as rest frame: dark frame"), "{dark}");
    assert_eq!(of("torn"), "expected a whole frame, got none (25 torn)");
    assert_eq!(of("short"), "expected frames from number 5 on that can be judged, got none among 3 frames");
    let root = folder(&[("torn", &[]), ("z", &[])]);
    let protocol = Lifts::new(clips(&root), world().sensor(), false);
    let records = judge(&protocol, &root).expect("records");
    assert_eq!((records[1].trial.as_str(), records[1].unjudged()), ("z", None));
    let table = &protocol.tables(&records)[0];
    assert!(table.note.ends_with("not counted: torn (expected a whole frame, got none (25 torn))."), "{}", table.note);
    assert!(table.markdown().contains("| ours | 1 | 0 |"), "{}", table.markdown());
}

/// The reason is without the folder of the clips, so that records are the same on every machine.
#[test]
fn a_clip_without_frames_or_with_broken_ones_leaves_the_others() {
    let of = |name: &str| problem(&lifts(&[(name, &[]), ("z", &[])]));
    assert_eq!(of("empty"), "expected images, got none");
    assert_eq!(of("cut"), "expected a frame, got the end of the file");
    let beside = wriggles(&[("a", &["cut.avi", "left.avi"])]).expect("a grasp");
    assert_eq!((beside[0].unjudged(), beside[0].number_of("unjudged_videos")), (None, Some(1.0)));
    let refused = lifts(&[("locked", &[]), ("z", &[])]).expect_err("it may be read later");
    assert_eq!(refused, "lifts, trial 0, locked: locked: permission denied");
}

#[test]
fn a_clip_without_a_label_is_neither_right_nor_wrong() {
    let root = folder(&[("z", &[])]);
    fs::remove_file(root.path().join("labels.csv")).expect("labels");
    let protocol = Lifts::new(clips(&root), world().sensor(), false);
    let mut records = judge(&protocol, &root).expect("records");
    records.push(TrialRecord { number: 1, truth: Some(false), ..records[0].clone() });
    let row = |records: &[TrialRecord]| {
        let table = &protocol.tables(records)[0];
        (table.note.clone(), table.rows[0][1..3].to_vec())
    };
    let (note, cells) = row(&records);
    assert!(note.ends_with(" Without a label, and not counted: 1."), "{note}");
    assert_eq!(cells, [Cell::Count(1), Cell::Count(0)]);
    assert_eq!(row(&records[..1]).1, [Cell::Count(0), Cell::None]);
}

/// Raised when a recording is opened, and how many were.
static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static OPENED_COUNT: AtomicUsize = AtomicUsize::new(0);

fn open_and_stop(uri: &str) -> Result<Box<dyn FrameSource + Send>, SourceError> {
    OPENED_COUNT.fetch_add(1, Ordering::Relaxed);
    STOP.store(true, Ordering::Relaxed);
    open(uri)
}

#[test]
fn an_interrupt_ends_the_first_look_at_all_clips() {
    let names: Vec<String> = (0..9).map(|n| format!("clip_{n}")).collect();
    let all: Vec<(&str, &[&str])> = names.iter().map(|name| (name.as_str(), &["left.avi", "right.avi"][..])).collect();
    let root = folder(&all);
    let clips = || Clips::open(root.path(), open_and_stop).expect("clips").until(STOP.clone());
    let protocols: [Box<dyn Protocol>; 2] =
        [Box::new(Wriggles::new(clips(), world().sensor(), 1)), Box::new(Lifts::new(clips(), world().sensor(), true))];
    for protocol in protocols {
        STOP.store(false, Ordering::Relaxed);
        OPENED_COUNT.store(0, Ordering::Relaxed);
        let ours = [named("ours").expect("there is one")];
        let ran = run(&*protocol, &ours, &[0, 1, 2], 2, &|| STOP.load(Ordering::Relaxed), &mut |_| Ok(()));
        assert!(matches!(ran, Err(SweepError::Interrupted)), "{}: {ran:?}", protocol.name());
        // Of the first recording: for its rest frame, and to judge it.
        assert_eq!(OPENED_COUNT.load(Ordering::Relaxed), 2, "{}", protocol.name());
    }
}
