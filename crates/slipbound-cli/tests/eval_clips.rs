//! `slipbound eval lifts` on simulated clips: labels are read for scoring alone. On the shared recordings, where they
//! exist, held-out objects are judged as accurately as those to which a scale was fitted.

mod program;

use program::slipbound;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Runs the command, which must succeed.
fn done(args: &[&str]) {
    let output = slipbound(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Three clips that begin with the object held: one slides, two do not.
fn clips(folder: &Path) {
    for (name, object, distance) in
        [("a_1", "bottle_cap", "4"), ("a_2", "bottle_cap", "0.2"), ("b_1", "scissors", "0.2")]
    {
        let recording = folder.with_extension("made").join(name);
        let scene = format!(
            "shear?object={object}&camera=gelsight_mini&force_n=10&mu=0.5&distance_mm={distance}&speed_mm_per_s=10&grid=fast"
        );
        done(&["simulate", &scene, "-o", &shown(&recording)]);
        fs::create_dir_all(folder.join(name)).expect("a folder");
        // From the frame in which the grip has settled.
        for n in 26..44 {
            let from = recording.join(format!("frame_{n:06}.jpg"));
            if from.exists() {
                fs::copy(from, folder.join(name).join(format!("{:03}.jpg", n - 26))).expect("a frame");
            }
        }
    }
}

/// The records of the clips with these labels, each without its truth.
fn records(folder: &Path, labels: Option<&str>, out: &Path) -> Vec<Value> {
    let file = folder.join("labels.csv");
    match labels {
        Some(text) => fs::write(&file, text).expect("labels"),
        None => fs::remove_file(&file).expect("labels"),
    }
    let (folder, out_shown) = (shown(folder), shown(out));
    done(&["eval", "lifts", "--data", &folder, "--detector", "ours", "--pictures", "0", "-o", &out_shown]);
    let text = fs::read_to_string(out.join("trials.jsonl")).expect("records");
    text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

fn without_truth(records: &[Value]) -> Vec<String> {
    let line = |record: &Value| {
        let mut record = record.clone();
        record.as_object_mut().expect("a record").remove("truth");
        record.to_string()
    };
    records.iter().map(line).collect()
}

#[test]
fn labels_shuffled_or_absent_change_nothing_but_the_truth() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path().join("clips");
    clips(&folder);
    let out = |name: &str| temporary.path().join(name);
    let labelled = records(&folder, Some("clip,object,slip\na_1,a,1\na_2,a,0\nb_1,b,0\n"), &out("labelled"));
    let shuffled = records(&folder, Some("clip,object,slip\nb_1,a,1\na_1,b,0\na_2,b,1\n"), &out("shuffled"));
    let absent = records(&folder, None, &out("absent"));
    assert_eq!(labelled.len(), 3);
    assert_eq!(without_truth(&labelled), without_truth(&shuffled));
    assert_eq!(without_truth(&labelled), without_truth(&absent));
    assert_eq!(
        (&labelled[0]["truth"], &shuffled[0]["truth"], &absent[0]["truth"]),
        (&true.into(), &false.into(), &Value::Null)
    );
    // Each continues with its own settings only.
    let resumes = |out: &Path| {
        let args =
            ["eval", "lifts", "--data", &shown(&folder), "--detector", "ours", "--pictures", "0", "-o", &shown(out)];
        let output = slipbound(&args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() || said.contains("sweep.json: sweep.settings: expected"), "{said}");
        output.status.success()
    };
    assert_eq!(["labelled", "shuffled", "absent"].map(|name| resumes(&out(name))), [false, false, true]);
    fs::write(folder.join("labels.csv"), "clip,object,slip\na_1,a,1\na_2,a,0\nb_1,b,0\n").expect("labels");
    assert_eq!(["labelled", "shuffled", "absent"].map(|name| resumes(&out(name))), [true, false, false]);
    let merge = |from: &str, more: &[&str], to: &str| {
        let (data, from, to) = (shown(&folder), shown(&out(from)), shown(&out(to)));
        let args = [&["eval", "merge", &from, "--data", &data, "--pictures", "0", "-o", &to], more].concat();
        let output = slipbound(&args);
        let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, said, _) = merge("labelled", &[], "merged");
    assert!(code == Some(0) && said.contains("training accuracy"), "{said}");
    let (code, _, err) = merge("labelled", &["--refit"], "refitted");
    assert!(code == Some(2) && err.contains("merge --refit: expected folders of `lifts --refit`"), "{err}");
    assert!(!out("refitted").exists(), "a folder for nothing");
    // For a sweep with --refit, whether the flag is given again or not.
    let refitted = out("labelled").join("sweep.json");
    let about = fs::read_to_string(&refitted).expect("a sweep");
    fs::write(&refitted, about.replace("\"refit\": \"false\"", "\"refit\": \"true\"")).expect("written");
    for (more, to) in [(&[][..], "left_out"), (&["--refit"], "left_out_again")] {
        let (code, said, err) = merge("labelled", more, to);
        assert!(code == Some(0) && said.contains("object left out"), "{said} {err}");
    }
    fs::write(&refitted, about).expect("written");
    let (code, _, err) = merge("absent", &[], "others");
    assert!(code == Some(2) && err.contains("merge: data: expected that of the sweep, 3 clips, "), "{err}");
    fs::copy(folder.join("a_1/000.jpg"), folder.join("a_1/900.jpg")).expect("a frame more");
    assert!(!resumes(&out("labelled")));
    // The comparison detects a leak.
    let leak = |records: &[Value]| {
        let mut records = records.to_vec();
        records
            .iter_mut()
            .for_each(|r| r["score"] = (r["score"].as_f64().unwrap_or(0.0) + f64::from(r["truth"] == true)).into());
        without_truth(&records)
    };
    assert_ne!(leak(&labelled), leak(&shuffled));
    let score = |n: usize| labelled[n]["score"].as_f64().expect("a number");
    assert!(score(0) > score(1) && score(0) > score(2), "{labelled:?}");
}

/// The folder of the shared lifts; None where there is none.
fn shared_lifts() -> Option<PathBuf> {
    let recordings = std::env::var_os("SLIPBOUND_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    let folder = Some(recordings.join("gelsight-lift")).filter(|folder| folder.exists());
    if folder.is_none() {
        println!("SKIPPED: no SLIPBOUND_DATA and no ../shared/data");
    }
    folder
}

#[test]
fn the_shared_lifts_are_judged_with_each_object_left_out() {
    let Some(folder) = shared_lifts() else { return };
    let temporary = tempfile::tempdir().expect("a folder");
    let out = temporary.path().join("out");
    let (data, to) = (shown(&folder), shown(&out));
    done(&["eval", "lifts", "--refit", "--data", &data, "--detector", "ours", "--pictures", "0", "-o", &to]);
    let table: Value = serde_json::from_slice(&fs::read(out.join("table.json")).expect("a table")).expect("JSON");
    let row = &table["tables"][0]["rows"][0];
    assert!(row[2].as_u64().expect("a count") <= 1, "{row}");
    assert!(row[4]["value"].as_f64().expect("an area") >= 0.98, "{row}");
}

/// The states of `watch`, not the score of `eval`: sliding clips give `gross`, held ones do not.
#[test]
fn watch_says_of_the_shared_lifts_which_slide() {
    let Some(folder) = shared_lifts() else { return };
    let labels = fs::read_to_string(folder.join("labels.csv")).expect("labels");
    let clips: Vec<(&str, bool)> = (labels.lines().skip(1))
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|cells| (cells[0], cells[3] == "1"))
        .collect();
    let temporary = tempfile::tempdir().expect("a folder");
    let report = shown(&temporary.path().join("report.jsonl"));
    let sources: Vec<String> = clips.iter().map(|(name, _)| shown(&folder.join(name))).collect();
    for (rest, found_count) in [(&["--rest", "held"][..], 14), (&[], 10)] {
        let args = [&["watch", "--sensor", "gelsight", "--json", &report], rest].concat();
        done(&args.into_iter().chain(sources.iter().map(String::as_str)).collect::<Vec<_>>());
        let says_gross = |name: &str| {
            let report = temporary.path().join(format!("report-{name}.jsonl"));
            fs::read_to_string(report).expect("a report").contains(r#""state":"gross""#)
        };
        let (mut found, mut false_ones) = (0, Vec::new());
        for (name, slips) in &clips {
            match (slips, says_gross(name)) {
                (true, true) => found += 1,
                (false, true) => false_ones.push(name),
                _ => {}
            }
        }
        assert!(found >= found_count && false_ones.is_empty(), "{rest:?}: {found} found, falsely {false_ones:?}");
    }
}
