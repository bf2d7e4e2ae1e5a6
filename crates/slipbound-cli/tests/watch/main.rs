//! The command from outside: its messages, files and exit codes, on whole and on damaged recordings.

mod arguments;
mod causal;
mod damaged;
mod files;
#[path = "../program/mod.rs"]
mod program;
mod trial;

use std::fs;
use trial::{Trial, states};

#[test]
fn a_whole_recording_is_judged_from_its_first_frame_to_its_last() {
    let trial = Trial::new(6);
    let ended =
        trial.watch("run", &["--json", "report.json", "--markers", "--timings", "times.json", "--finger", "left"]);
    ended.expect(0, &[]);
    assert_eq!(ended.out, "6 frames, 0 slips: 6 no contact\n");
    assert_eq!(ended.err, "", "nothing to complain of");
    let report = trial.report("report.json");
    assert_eq!(states(&report), ["no_contact"; 6]);
    assert_eq!(report[0]["rest"].to_string(), r#"{"frames":[0,6],"kind":"unloaded"}"#);
    assert_eq!((&report[0]["clock"], &report[0]["source"]), (&"unknown".into(), &"run".into()));
    assert_eq!(report[0]["sensor"]["name"], "gelsight_mini_wide");
    assert!(report[0].get("note").is_none());
    for (i, line) in report[1..].iter().enumerate() {
        assert_eq!((&line["frame"], &line["seq"], &line["finger"]), (&i.into(), &i.into(), &"left".into()));
        let matched = line["markers"]["matched"].as_u64().expect("a count");
        assert!(matched >= 60, "{matched} markers");
        assert_eq!(
            line["field"].as_array().expect("a field").len() as u64,
            matched + line["markers"]["lost"].as_u64().expect("a count")
        );
    }
    let times = trial.report("times.json");
    assert_eq!(times.len(), 6);
    let steps = ["imprint_us", "contact_us", "markers_us", "motion_us", "slip_us", "evidence_us", "verdict_us"];
    for key in steps.into_iter().chain(["all_us"]) {
        assert!(times[3][key].as_f64().expect("a number") >= 0.0, "{key}");
    }
}

#[test]
fn the_report_fits_the_published_schema_and_has_nothing_of_our_clock() {
    let trial = Trial::new(4);
    trial.write("run/002.jpg", b"");
    let reports = ["one.json", "two.json"].map(|name| {
        trial.watch("run", &["--json", name, "--markers"]).expect(3, &[]);
        fs::read(trial.path(name)).expect("a report")
    });
    assert!(reports[0] == reports[1], "two runs differ");
    let schema = serde_json::from_str(include_str!("../../../../docs/report.schema.json")).expect("JSON");
    let schema = jsonschema::validator_for(&schema).expect("a schema");
    for line in trial.report("one.json") {
        let faults: Vec<String> = schema.iter_errors(&line).map(|e| e.to_string()).collect();
        assert!(faults.is_empty(), "{line}: {faults:?}");
    }
}

/// The example in the source, which rustdoc shows, has only keys that a report has.
#[test]
fn the_line_that_the_documentation_shows_has_the_keys_of_the_schema() {
    fn keys<'a>(value: &'a serde_json::Value, of: &mut Vec<&'a str>) {
        for (key, value) in value.as_object().into_iter().flatten() {
            of.push(key);
            keys(value, of);
        }
    }
    let source = include_str!("../../../slipbound-rig/src/report_json.rs");
    let shown = source.split("//! ```").nth(1).and_then(|shown| shown.strip_prefix("json")).expect("an example");
    let line: serde_json::Value = serde_json::from_str(&shown.replace("//!", "")).expect("JSON");
    let mut shown = Vec::new();
    keys(&line, &mut shown);
    assert!(shown.contains(&"max_pitch"), "{shown:?}");
    let schema = include_str!("../../../../docs/report.schema.json");
    let unknown: Vec<&&str> = shown.iter().filter(|key| !schema.contains(&format!("\"{key}\""))).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
}
