//! Sweeps: the same records with any number of cores, after an interruption, and from shards.

use slipbound_lab::eval::folder::SweepFolder;
use slipbound_lab::eval::shard::Shard;
use slipbound_lab::eval::{Protocol, Sweep, SweepError, TrialRecord, run, simulated};
use slipbound_lab::fit::TRAINING_SEED;
use slipbound_lab::rivals::{DETECTORS, Entry, named};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const SEED: u64 = 5;
const TRIALS: u64 = 4;

fn detectors() -> Vec<&'static Entry> {
    ["ours", "paper", "imprint"].map(|name| named(name).expect("there is one")).to_vec()
}

fn sweep(protocol: &dyn Protocol) -> Sweep {
    Sweep {
        protocol: protocol.name().into(),
        seed: SEED,
        trials_count: protocol.trials_count(),
        software_version: "0".into(),
        settings: BTreeMap::new(),
    }
}

/// Runs the missing trials in a folder, at most `most` of them.
fn run_in(path: &Path, shard: Shard, jobs: usize, most: usize) -> SweepFolder {
    let protocol = simulated("ramps", SEED, Some(TRIALS)).expect("there is one");
    let names: Vec<&str> = detectors().iter().map(|entry| entry.name).collect();
    let mut folder = SweepFolder::open(path, &sweep(&*protocol), &names, shard).expect("a folder");
    let numbers: Vec<u64> = folder.missing().into_iter().take(most).collect();
    run(&*protocol, &detectors(), &numbers, jobs, &|| false, &mut |records| folder.keep(records))
        .expect("sound trials");
    folder
}

fn bytes(path: &Path) -> Vec<u8> {
    fs::read(path.join("trials.jsonl")).expect("records")
}

#[test]
fn the_same_bytes_from_one_core_two_cores_after_a_cut_and_from_shards() {
    let root = tempfile::tempdir().expect("a folder");
    let at = |name: &str| root.path().join(name);
    run_in(&at("one"), Shard::WHOLE, 1, usize::MAX);
    let whole = bytes(&at("one"));
    assert_eq!(whole.iter().filter(|&&byte| byte == b'\n').count(), 12);

    run_in(&at("two"), Shard::WHOLE, 2, usize::MAX);
    assert_eq!(bytes(&at("two")), whole, "two cores");

    // Two trials and a half of the next: one complete line, one truncated line.
    let lines: Vec<&[u8]> = whole.split_inclusive(|&byte| byte == b'\n').collect();
    run_in(&at("cut"), Shard::WHOLE, 1, 0);
    let torn = [&lines[..7].concat(), &lines[7][..lines[7].len() / 2]].concat();
    fs::write(at("cut").join("trials.jsonl"), torn).expect("writes");
    let folder = run_in(&at("cut"), Shard::WHOLE, 1, 0);
    assert_eq!((folder.records().len(), folder.missing()), (6, vec![2, 3]), "half a trial is dropped");
    drop(folder);
    run_in(&at("cut"), Shard::WHOLE, 2, usize::MAX);
    assert_eq!(bytes(&at("cut")), whole, "after a cut");

    // As on two machines: at the same time.
    let shards: Vec<PathBuf> = (1..=2).map(|number| at(&format!("shard{number}"))).collect();
    std::thread::scope(|scope| {
        for (number, path) in (1..).zip(&shards) {
            scope.spawn(move || run_in(path, Shard { number, of: 2 }, 1, usize::MAX));
        }
    });
    let merged = SweepFolder::merge(&shards, &at("merged")).expect("two halves");
    assert_eq!(bytes(merged.path()), whole, "from shards");
    assert_eq!(fs::read(at("merged/sweep.json")).expect("a file"), fs::read(at("one/sweep.json")).expect("a file"));

    let error = SweepFolder::merge(&shards[..1], &at("half")).expect_err("half of it").to_string();
    assert!(error.contains("trials: expected all 4 in the folders together, got none of 1, 3 (2 missing)"), "{error}");
}

#[test]
fn a_folder_of_another_sweep_is_refused_by_file_key_expected_and_got() {
    let root = tempfile::tempdir().expect("a folder");
    let protocol = simulated("slides", SEED, Some(2)).expect("there is one");
    let open = |sweep: &Sweep| SweepFolder::open(root.path(), sweep, &["ours"], Shard::WHOLE);
    open(&sweep(&*protocol)).expect("a new folder");
    let twice = SweepFolder::open(&root.path().join("twice"), &sweep(&*protocol), &["ours", "ours"], Shard::WHOLE);
    let error = twice.expect_err("its trials would count twice").to_string();
    assert!(
        error.contains("twice/sweep.json: detectors: expected one or more, each once, got `ours, ours`"),
        "{error}"
    );
    assert!(!root.path().join("twice").exists(), "a folder for nothing");
    let here = Sweep::new(&*protocol, SEED).expect("a sound trial");
    assert_eq!(here, Sweep::new(&*protocol, SEED).expect("a sound trial"));
    let here = Sweep { software_version: "0".into(), ..here };
    let error = open(&here).expect_err("it may judge otherwise").to_string();
    assert!(error.contains("sweep.json: sweep.settings: expected {\"method\": "), "{error}");
    let other = Sweep { seed: 6, ..sweep(&*protocol) };
    let error = open(&other).expect_err("another seed").to_string();
    assert!(error.contains("sweep.json: sweep.seed: expected 6, got 5"), "{error}");
    fs::write(root.path().join("trials.jsonl"), "{\"number\":0}\n{\"number\":1}\n").expect("writes");
    let error = open(&sweep(&*protocol)).expect_err("no records").to_string();
    assert!(error.contains("trials.jsonl: line 1: expected a record with the keys number, trial, object"), "{error}");
    assert_eq!(error.matches("expected").count(), 1, "{error}");
    for name in ["table1", "quiet", "slides"] {
        let error = simulated(name, TRAINING_SEED, Some(1)).map(drop).expect_err("tuned on").to_string();
        assert!(error.contains("seed") && error.contains(&format!("trials of {name} were tuned on")), "{error}");
        assert!(simulated(name, TRAINING_SEED + 1, Some(1)).is_ok());
    }
    for name in ["ramps", "unseen"] {
        assert!(simulated(name, TRAINING_SEED, Some(1)).is_ok(), "{name}");
    }
    assert!(simulated("rumps", 0, None).is_err_and(|error| error.to_string().contains("one of table1, ramps, quiet")));
    assert!(named("mine").is_err_and(|error| error.to_string().contains("one of ours, ours_frames, paper_as_written")));
}

/// Complete records are not rewritten, and unknown ones are not discarded.
#[test]
fn records_in_a_folder_outlive_a_resumed_sweep_that_is_killed() {
    let root = tempfile::tempdir().expect("a folder");
    let protocol = simulated("ramps", SEED, Some(3)).expect("there is one");
    let open = || SweepFolder::open(root.path(), &sweep(&*protocol), &["ours", "paper"], Shard::WHOLE);
    drop(open().expect("a new folder"));
    let lines_path = root.path().join("trials.jsonl");
    let line = |number: u64, detector: &str| {
        let truth = "\"truth\":true,\"verdict\":true,\"score\":1.0,\"first_alarm_frame\":null";
        // Written with spaces, as another program may do: existing bytes must not change.
        format!("{{\"number\": {number}, \"trial\":\"t\",\"object\":\"o\",\"detector\":\"{detector}\",{truth}}}\n")
    };
    let whole = [line(0, "ours"), line(0, "paper"), line(1, "ours"), line(1, "paper")].concat();
    let torn = [whole.as_str(), &line(2, "ours"), "{\"number\":2,\"trial\":\"\u{e9}"].concat();
    fs::write(&lines_path, &torn.as_bytes()[..torn.len() - 1]).expect("writes");
    let folder = open().expect("whole trials and half of one");
    assert_eq!((folder.records().len(), folder.missing()), (4, vec![2]));
    drop(folder);
    assert_eq!(fs::read_to_string(&lines_path).expect("records"), whole);

    let trial = |number: u64| [line(number, "ours"), line(number, "paper")].concat();
    for (broken, expected) in [
        (&[line(0, "ours"), line(1, "ours")].concat(), "line 2: expected the record of paper on trial 0"),
        (&line(0, "paper"), "line 1: expected the record of ours on trial 0"),
        (&[trial(0), trial(0)].concat(), "line 3: expected trial 1, got trial 0"),
        (&[trial(1), trial(0)].concat(), "line 1: expected trial 0, got trial 1"),
        // What is judged is appended: trial 1 would come after trial 2.
        (&[trial(0), trial(2)].concat(), "line 3: expected trial 1, got trial 2"),
        (
            &[trial(0), trial(1), trial(2), trial(3)].concat(),
            "line 7: expected the end, after all trials of shard 1/1 of 3, got trial 3",
        ),
    ] {
        fs::write(&lines_path, broken).expect("writes");
        let error = open().expect_err("not as a sweep writes it").to_string();
        assert!(error.contains(expected), "{error}");
        assert_eq!(&fs::read_to_string(&lines_path).expect("records"), broken, "nothing is thrown away");
    }

    fs::write(&lines_path, &whole).expect("writes");
    let about = root.path().join("sweep.json");
    fs::remove_file(&about).expect("removed");
    let error = open().expect_err("records of what?").to_string();
    assert!(error.contains("sweep.json: expected the one beside trials.jsonl"), "{error}");
    assert_eq!(fs::read_to_string(&lines_path).expect("records"), whole);
    fs::remove_file(&lines_path).expect("removed");
    drop(open().expect("a new folder"));
    let names: Vec<_> =
        fs::read_dir(root.path()).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

/// A sweep.json that was edited by hand is refused by its key.
#[test]
fn a_sweep_that_cannot_be_is_refused_by_file_key_expected_and_got() {
    let root = tempfile::tempdir().expect("a folder");
    let protocol = simulated("ramps", SEED, Some(3)).expect("there is one");
    let (part, merged) = (root.path().join("part"), root.path().join("merged"));
    drop(SweepFolder::open(&part, &sweep(&*protocol), &["ours"], Shard::WHOLE).expect("a new folder"));
    let about = fs::read_to_string(part.join("sweep.json")).expect("a file");
    for (from, to, expected) in [
        ("\"of\": 1", "\"of\": 0", "shard: expected I/N with I from 1 to N, got 1/0"),
        ("\"number\": 1", "\"number\": 0", "shard: expected I/N with I from 1 to N, got 0/1"),
        ("\"ours\"", "", "detectors: expected one or more, each once, got ``"),
        (
            "\"trials_count\": 3",
            "\"trials_count\": 99999999999999",
            "sweep.trials_count: expected 1 to 10000000, got 99999999999999",
        ),
        ("\"trials_count\": 3", "\"trials_count\": 0", "sweep.trials_count: expected 1 to 10000000, got 0"),
    ] {
        assert!(about.contains(from), "{from}: {about}");
        fs::write(part.join("sweep.json"), about.replace(from, to)).expect("writes");
        fs::write(part.join("trials.jsonl"), "{}\n").expect("writes");
        let error = SweepFolder::merge(std::slice::from_ref(&part), &merged).expect_err("no sweep").to_string();
        assert!(error.ends_with(&format!("part/sweep.json: {expected}")), "{error}");
        assert!(!merged.exists(), "a folder for nothing");
    }
}

#[test]
fn a_folder_of_something_else_is_refused_and_stays_as_it_is() {
    let (root, protocol) =
        (tempfile::tempdir().expect("a folder"), simulated("slides", 5, Some(2)).expect("a protocol"));
    let open = |path: &Path| SweepFolder::open(path, &sweep(&*protocol), &["ours"], Shard::WHOLE);
    fs::write(root.path().join("report.html"), "mine").expect("writes");
    let error = open(root.path()).expect_err("mine").to_string();
    let expected = "expected a new or empty folder, or one with sweep.json, got one that holds `report.html`";
    assert!(error.contains(expected), "{error}");
    assert_eq!(fs::read_dir(root.path()).expect("a folder").count(), 1);
    // Killed before it had begun.
    let killed = root.path().join("killed");
    fs::create_dir(&killed).expect("made");
    ["trials.jsonl", "sweep.json.unfinished"].iter().for_each(|name| fs::write(killed.join(name), "").expect("writes"));
    drop(open(&killed).expect("goes on"));
}

#[test]
fn a_sweep_that_is_stopped_says_so_and_keeps_what_it_has() {
    let protocol = simulated("ramps", SEED, Some(3)).expect("there is one");
    let stop = std::sync::atomic::AtomicBool::new(false);
    let mut kept: Vec<TrialRecord> = Vec::new();
    let stopped = run(
        &*protocol,
        &[named("ours").expect("ours")],
        &[0, 1, 2],
        1,
        &|| stop.load(std::sync::atomic::Ordering::SeqCst),
        &mut |records| {
            kept.extend(records);
            stop.store(true, std::sync::atomic::Ordering::SeqCst);
            Ok(())
        },
    );
    assert!(matches!(stopped, Err(SweepError::Interrupted)) && !kept.is_empty() && kept.len() < 3);
}

/// Every protocol makes records of every detector, and tables from them; the tables depend on the records alone.
#[test]
fn every_protocol_judges_a_trial_with_every_detector() {
    let all: Vec<&'static Entry> = DETECTORS.iter().collect();
    for name in ["table1", "unseen", "slides"] {
        let protocol = simulated(name, SEED, Some(1)).expect("there is one");
        let records = protocol.judge(0, &all).unwrap_or_else(|error| panic!("{name}: {error}"));
        let names: Vec<&str> = records.iter().map(|record| record.detector.as_str()).collect();
        assert_eq!(names, DETECTORS.map(|entry| entry.name), "{name}");
        assert!(records.iter().all(|record| record.score.is_finite() && record.truth.is_some()), "{name}");
        let read_back: Vec<TrialRecord> = records
            .iter()
            .map(|record| TrialRecord::parse(&record.line().expect("a line")).expect("a record"))
            .collect();
        let markdown = |records: &[TrialRecord]| {
            let tables = protocol.tables(records);
            assert!(tables.iter().all(|table| table.rows.iter().all(|row| row.len() == table.columns.len())), "{name}");
            tables.iter().map(|table| table.markdown()).collect::<String>()
        };
        assert_eq!(markdown(&records), markdown(&read_back), "{name}");
    }
}

#[test]
fn a_folder_is_written_by_one_sweep_at_a_time() {
    let root = tempfile::tempdir().expect("a folder");
    let protocol = simulated("ramps", SEED, Some(TRIALS)).expect("there is one");
    let open = || SweepFolder::open(root.path(), &sweep(&*protocol), &["ours"], Shard::WHOLE);
    let first = open().expect("new");
    let message = open().expect_err("in use").to_string();
    assert!(message.contains("expected a folder that no other `slipbound eval` writes to"), "{message}");
    drop(first);
    open().expect("free again");
}
