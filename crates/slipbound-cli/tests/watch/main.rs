//! The command from outside: its messages, files and exit codes, on whole and on damaged recordings.

mod arguments;
mod causal;
mod damaged;
mod files;
#[path = "../program/mod.rs"]
mod program;
mod trial;

use program::Ended;
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

/// All but the markers at the rim; the outlines of holes count negative for the area.
#[test]
fn the_outline_encloses_the_markers_in_contact_and_its_area_is_that_of_the_contact() {
    type Outline = Vec<[f64; 2]>;
    let trial = Trial::new(0);
    let arguments = ["watch", "sim:ramp?object=screwdriver&grid=fast&seed=3", "--json", "report.json", "--markers"];
    Ended::of(trial.command(&arguments).output().expect("runs")).expect(0, &[]);
    let mut in_contact_count = 0;
    for line in &trial.report("report.json")[1..] {
        let outlines = serde_json::from_value(line["contact_outline_px"].clone());
        let outlines: Vec<Outline> = outlines.expect("outlines of points");
        let sides = || outlines.iter().flat_map(|o| o.iter().zip(o.iter().cycle().skip(1)));
        let area_px2 = sides().map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0;
        let expected_px2 = line["contact"]["area_px2"].as_f64().expect("a number");
        assert!((area_px2 - expected_px2).abs() <= 0.03 * expected_px2, "{area_px2} of {expected_px2} px2");
        for marker in line["field"].as_array().expect("a field") {
            let number = |i: usize| marker[i].as_f64().expect("a number");
            let (x, y, is_in) = (number(1), number(2), number(9) == 1.0);
            let cuts = |a: &[f64; 2], b: &[f64; 2]| {
                (a[1] <= y) != (b[1] <= y) && a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) > x
            };
            let off_px = |a: &[f64; 2], b: &[f64; 2]| {
                let (along, to) = ([b[0] - a[0], b[1] - a[1]], [x - a[0], y - a[1]]);
                let share = (along[0] * to[0] + along[1] * to[1]) / (along[0] * along[0] + along[1] * along[1]);
                let share = share.clamp(0.0, 1.0);
                (to[0] - share * along[0]).hypot(to[1] - share * along[1])
            };
            let is_at_the_rim = sides().any(|(a, b)| off_px(a, b) < 2.0);
            let is_inside = sides().filter(|(a, b)| cuts(a, b)).count() % 2 == 1;
            assert!(is_inside == is_in || is_at_the_rim, "{marker} and {outlines:?}");
            in_contact_count += usize::from(is_in);
        }
    }
    assert!(in_contact_count > 500, "{in_contact_count} markers in contact");
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
