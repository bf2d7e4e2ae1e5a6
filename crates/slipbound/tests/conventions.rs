//! Conventions: settings have units, deviations are documented and tested, the core has almost no dependencies.

#![allow(clippy::disallowed_methods)] // it reads the sources

use slipbound::monitor::{Settings, Step};
use slipbound::port::Jaws;
use slipbound::sensor::Skin;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()) {
        if entry.is_dir() {
            found.extend(sources(&entry));
        } else if entry.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&entry).expect("text");
            found.push((entry, text));
        }
    }
    found
}

#[test]
fn every_number_among_the_settings_says_its_unit() {
    let units = ["_px", "_mm", "_pitch", "_levels", "_fraction", "_count", "_rad", "_quality", "_n", "_mu", "_ms"];
    let settings = serde_json::to_value(Settings::default()).expect("data");
    let mut seen = 0;
    for (step, keys) in settings.as_object().expect("a step a table") {
        for (key, value) in keys.as_object().expect("a key a value") {
            if value.is_number() || value.is_array() {
                seen += 1;
                assert!(units.iter().any(|u| key.ends_with(u)), "{step}.{key} has no unit");
            }
        }
    }
    assert!(seen > 20, "only {seen} numbers seen");
}

#[test]
fn every_deviation_is_marked_in_the_code_and_has_its_tests() {
    let page = fs::read_to_string(root().join("docs/deviations.md")).expect("docs/deviations.md");
    let crates = sources(&root().join("crates"));
    let marked: BTreeSet<String> = crates
        .iter()
        .flat_map(|(_, text)| text.lines())
        .filter_map(|line| line.trim().strip_prefix("// Deviation: "))
        .map(|rest| rest.split(' ').next().unwrap_or_default().to_string())
        .collect();
    let rows: Vec<&str> = page.lines().filter(|l| l.starts_with("| D")).collect();
    let written: BTreeSet<String> =
        rows.iter().map(|row| row[2..].split(' ').next().unwrap_or_default().to_string()).collect();
    assert_eq!(marked, written);
    for row in rows {
        let tests = row.rsplit('|').nth(1).expect("a column of tests");
        for name in tests.split('`').skip(1).step_by(2) {
            let test = format!("fn {name}(");
            assert!(crates.iter().any(|(_, text)| text.contains(&test)), "no test {name}, named in docs/deviations.md");
        }
        assert!(tests.contains('`') || tests.contains("bench/"), "no test in: {row}");
    }
}

#[test]
fn the_core_depends_on_serde_and_libm_only() {
    let manifest = fs::read_to_string(root().join("crates/slipbound/Cargo.toml")).expect("a manifest");
    let table = manifest.split("[dependencies]").nth(1).expect("dependencies");
    let table = table.split("\n[").next().expect("a table");
    let names: BTreeSet<&str> =
        table.lines().filter_map(|l| l.split(['.', ' ', '=']).next()).filter(|n| !n.is_empty()).collect();
    assert_eq!(names, BTreeSet::from(["libm", "serde"]));
}

/// What `name` returns is what records and files hold.
#[test]
fn names_of_jaws_steps_and_skins_are_those_of_records() {
    let recorded = |value: serde_json::Value| value.as_str().expect("a text").to_owned();
    for jaws in [Jaws::Unknown, Jaws::Open, Jaws::Closing, Jaws::Holding, Jaws::Nothing, Jaws::Lost, Jaws::Stopped] {
        assert_eq!(jaws.name(), recorded(serde_json::to_value(jaws).expect("JSON")));
    }
    for step in [Step::Imprint, Step::Contact, Step::Markers, Step::Motion, Step::Slip] {
        assert_eq!(step.name(), recorded(serde_json::to_value(step).expect("JSON")));
    }
    for skin in [Skin::Fabric, Skin::Smooth] {
        assert_eq!(skin.name(), recorded(serde_json::to_value(skin).expect("JSON")));
    }
}
