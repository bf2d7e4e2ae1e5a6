//! Sweeps from outside: records, tables and page; shards that form the whole; invalid arguments.

mod program;

use program::{Ended, slipbound_in};
use std::fs;
use std::path::Path;

fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let Ended { code, out, err } = Ended::of(slipbound_in(folder, &[&["eval"], arguments].concat()));
    (code, out, err)
}

/// The objects pulled and turned on the ramps.
const OBJECTS: [&str; 10] = [
    "tape_roll",
    "crayons_box",
    "scissors",
    "water_bottle",
    "super_glue",
    "brain_foam",
    "toy_duck",
    "screwdriver",
    "scrub_sponge",
    "blue_tube",
];

/// Slides at 0.5 mm/s come first; three trials are enough for two shards and a page.
const SWEEP: [&str; 7] = ["table1", "--trials", "3", "--detector", "ours", "--detector", "paper"];

#[test]
fn shards_make_the_same_folder_as_the_whole_to_the_byte() {
    let dir = tempfile::tempdir().expect("a folder");
    let sweep = |more: &[&str]| {
        let (code, out, err) = run(dir.path(), &[&SWEEP[..], more].concat());
        assert_eq!((code, err.as_str()), (Some(0), ""), "{out}");
        out
    };
    let said = sweep(&["--jobs", "2", "-o", "whole"]);
    assert!(said.contains("| ours | 3 |") && said.contains("report: whole/report.html"), "{said}");
    sweep(&["--shard", "1/2", "-o", "a"]);
    sweep(&["--shard", "2/2", "-o", "b"]);
    let (code, _, err) = run(dir.path(), &["merge", "a", "b", "-o", "merged"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    for name in ["sweep.json", "trials.jsonl", "table.md", "table.json", "report.html"] {
        let read = |folder: &str| fs::read(dir.path().join(folder).join(name)).expect("a file");
        assert_eq!(read("whole"), read("merged"), "{name}");
    }
    let table: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("whole/table.json")).expect("a file")).expect("JSON");
    let tables_of = |folder: &str| fs::read_to_string(dir.path().join(folder).join("table.md")).expect("a file");
    assert!(tables_of("a").contains(", seed 0, shard 1/2 of 3 trials, "), "{}", tables_of("a"));
    assert!(tables_of("whole").contains(", seed 0, 3 trials, "), "{}", tables_of("whole"));
    assert_eq!((table["sweep"]["seed"].as_u64(), table["tables"][0]["rows"][0][1].as_u64()), (Some(0), Some(3)));

    let (code, _, err) = run(dir.path(), &[&SWEEP[..], &["--seed", "1", "-o", "whole"]].concat());
    assert!(code == Some(2) && err.contains("whole/sweep.json: sweep.seed: expected 1, got 0"), "{code:?} {err}");
    let (code, _, err) = run(dir.path(), &["merge", "a", "-o", "half"]);
    assert!(code == Some(2) && err.contains("a/sweep.json: trials: expected all 3 in the folders together"), "{err}");
}

#[test]
fn arguments_that_cannot_be_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    for (arguments, said) in [
        (&["rumps"][..], "[possible values: table1, ramps, quiet, unseen, slides"),
        (&["ramps", "--shard", "3/2"], "expected I/N with I from 1 to N, as 2/8, got 3/2"),
        (&["ramps", "--detector", "mine"], "[possible values: ours, ours_frames, paper_as_written, paper"),
        (&["ramps", "--detector", "ours,ours"], "--detector ours: expected each detector once, got it twice"),
        (&["ramps", "elsewhere"], "ramps: expected folders with `merge` only, got elsewhere"),
        (&["merge", "nowhere", "-o", "m"], "nowhere/sweep.json"),
        (&["merge", "nowhere"], "merge: expected -o FOLDER"),
        (&["lifts", "--left-out", "trees"], "--left-out: expected with `ramps` only, got lifts"),
        (&["merge", "-o", "m"], "merge: expected the folders of all shards, got none"),
        (&["slides", "--left-out", "trees"], "--left-out: expected with `ramps` only, got slides"),
        (&["ramps", "--left-out", "trees"], "trees/tape_roll.txt: "),
        (&["unseen", "--ramp-s", "8"], "--ramp-s: expected with `ramps` only, got unseen"),
        (&["slides", "--rate-hz", "90"], "--rate-hz: expected with `ramps` only, got slides"),
        (&["ramps", "--ramp-s", "NaN"], "expected 0.05 to 120 s, got NaN"),
    ] {
        let (code, _, err) = run(dir.path(), arguments);
        assert!(code == Some(2) && err.contains(said), "{arguments:?}: {code:?} {err}");
    }
}

/// As by `eval table1`, and before anything is drawn.
#[test]
fn the_page_of_the_paper_has_no_more_trials_than_table_1() {
    let dir = tempfile::tempdir().expect("a folder");
    let Ended { code, err, .. } = Ended::of(slipbound_in(dir.path(), &["paper", "--trials", "321", "-o", "page"]));
    assert!(code == Some(2) && err.contains("--trials: expected at most the 320 of table1, got 321"), "{code:?} {err}");
    assert!(!dir.path().join("page").exists());
}

#[test]
fn ramps_take_as_long_as_they_are_told_to() {
    let dir = tempfile::tempdir().expect("a folder");
    let base = ["ramps", "--trials", "1", "--detector", "ours", "--pictures", "0", "--rate-hz", "60", "--ramp-s"];
    let (code, _, err) = run(dir.path(), &[&base[..], &["0.2", "-o", "fast"]].concat());
    assert_eq!((code, err.as_str()), (Some(0), ""));
    let record = fs::read_to_string(dir.path().join("fast/trials.jsonl")).expect("a record");
    let record: serde_json::Value = serde_json::from_str(&record).expect("JSON");
    assert_eq!(record["ramp_s"], 0.2);
    assert!(record["trial"].as_str().is_some_and(|trial| trial.contains("&rate_hz=60&")), "{record}");
    // The duration is a setting of the sweep: others do not go on in its folder, and a merge keeps it.
    let (code, _, err) = run(dir.path(), &[&base[..], &["0.3", "-o", "fast"]].concat());
    assert!(code == Some(2) && err.contains("fast/sweep.json: sweep.settings: expected {"), "{err}");
    let merge =
        |more: &[&str], to: &str| run(dir.path(), &[&["merge", "fast", "--pictures", "0", "-o", to], more].concat());
    let (code, _, err) = merge(&[], "merged");
    assert_eq!((code, err.as_str()), (Some(0), ""));
    let [before, after] =
        ["fast", "merged"].map(|folder| fs::read(dir.path().join(folder).join("table.md")).expect("a table"));
    assert_eq!(before, after);
    let (code, _, err) = merge(&["--ramp-s", "0.3"], "contradicted");
    assert!(code == Some(2) && err.contains("merge --ramp-s: expected that of the sweep or none, got 0.3"), "{err}");
    let (code, _, err) = merge(&["--rate-hz", "30"], "contradicted");
    assert!(code == Some(2) && err.contains("merge --rate-hz: expected that of the sweep or none, got 30"), "{err}");
    // Another build judges otherwise.
    let path = dir.path().join("fast/sweep.json");
    let about = fs::read_to_string(&path).expect("a sweep");
    let method = about.lines().find_map(|line| line.trim().strip_prefix("\"method\": \"")).expect("a method");
    let method = method.trim_end_matches([',', '"']);
    let version = env!("CARGO_PKG_VERSION");
    for (key, now, then) in [("method", method, "0000000000000000"), ("software_version", version, "0.0.7")] {
        fs::write(&path, about.replace(&format!("\"{now}\""), &format!("\"{then}\""))).expect("written");
        let (code, _, err) = merge(&[], "other_build");
        let said = format!("merge: {key}: expected that of the sweep, {then}, got {now}");
        assert!(code == Some(2) && err.contains(&said), "{code:?} {err}");
    }
}

#[test]
fn an_object_is_judged_by_the_trees_without_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let shipped = include_str!("../../slipbound/src/monitor/estimate/trees.txt");
    let trees = dir.path().join("trees");
    fs::create_dir(&trees).expect("a folder");
    let write = |object: &str, text: &str| fs::write(trees.join(format!("{object}.txt")), text).expect("written");
    for object in OBJECTS {
        write(object, shipped);
    }
    let ramp = |more: &[&str], folder: &str| {
        let (code, _, err) =
            run(dir.path(), &[&["ramps", "--trials", "1", "--detector", "ours", "-o", folder], more].concat());
        assert_eq!((code, err.as_str()), (Some(0), ""));
        fs::read_to_string(dir.path().join(folder).join("trials.jsonl")).expect("a record")
    };
    let by_shipped = ramp(&[], "shipped");
    // A table that states a larger used fraction than the true one.
    let object = serde_json::from_str::<serde_json::Value>(&by_shipped).expect("JSON")["object"].clone();
    let base = shipped.lines().find(|line| line.starts_with("ensemble used ")).expect("one");
    write(object.as_str().expect("a name"), &shipped.replacen(base, "ensemble used -0.2", 1));
    assert_ne!(ramp(&["--left-out", "trees"], "changed"), by_shipped);

    // Another table, of any object, is another sweep.
    let again = ["ramps", "--trials", "1", "--detector", "ours", "--left-out", "trees", "-o", "changed"];
    let (code, _, err) = run(dir.path(), &again);
    assert_eq!((code, err.as_str()), (Some(0), ""), "the same tables");
    // After merging, its images are drawn with these trees or with none.
    let merge = |more: &[&str], to: &str| run(dir.path(), &[&["merge", "changed", "-o", to], more].concat());
    let (code, _, err) = merge(&[], "merged");
    assert!(code == Some(2) && err.contains("merge: expected --left-out FOLDER"), "{err}");
    for (more, to) in [(&["--left-out", "trees"][..], "with"), (&["--pictures", "0"], "without")] {
        let (code, _, err) = merge(more, to);
        assert_eq!((code, err.as_str()), (Some(0), ""));
    }
    let (code, _, err) = run(dir.path(), &["merge", "shipped", "--left-out", "trees", "-o", "contradicted"]);
    assert!(code == Some(2) && err.contains("merge --left-out: expected folders of `ramps --left-out`"), "{err}");
    write("toy_duck", &shipped.replacen(base, "ensemble used -0.3", 1));
    let (code, _, err) = merge(&["--left-out", "trees"], "others");
    assert!(code == Some(2) && err.contains("merge: trees: expected that of the sweep, "), "{err}");
    let (code, _, err) = run(dir.path(), &again);
    assert!(code == Some(2) && err.contains("changed/sweep.json: sweep.settings: expected {"), "{code:?} {err}");

    // From frames alone other trees judge: those of the shipped table were fitted with every object.
    let alone = ["ramps", "--trials", "1", "--detector", "ours_frames", "--left-out", "trees", "-o", "alone"];
    let refused = |lesson: &str| {
        let (code, _, err) = run(dir.path(), &alone);
        let said = format!(
            "crayons_box.txt: expected trees of {lesson} fitted without crayons_box, for the detector ours_frames"
        );
        assert!(code == Some(2) && err.contains(&said) && err.contains("got those of tape_roll.txt"), "{err}");
    };
    refused("alone_used");
    let line = |lesson: &str| {
        let begin = format!("ensemble {lesson} ");
        shipped.lines().find(|line| line.starts_with(&begin)).expect("one").to_owned()
    };
    let own = |lessons: &[&str]| {
        for (n, object) in OBJECTS.iter().enumerate() {
            let changed =
                |text: String, lesson: &&str| text.replacen(&line(lesson), &format!("ensemble {lesson} 0.4{n}"), 1);
            write(object, &lessons.iter().fold(shipped.to_owned(), changed));
        }
    };
    own(&["alone_used"]);
    refused("alone_stick");
    own(&["alone_used", "alone_stick"]);
    let (code, _, err) = run(dir.path(), &alone);
    assert_eq!((code, err.as_str()), (Some(0), ""));

    write("toy_duck", &shipped[..shipped.len() / 2]);
    let (code, _, err) = run(dir.path(), &["ramps", "--left-out", "trees", "-o", "torn"]);
    assert!(code == Some(2) && err.contains("trees/toy_duck.txt: expected a whole table of trees"), "{err}");
}
