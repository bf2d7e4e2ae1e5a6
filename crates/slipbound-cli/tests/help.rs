//! Every command's help fits a terminal of 80 columns, its examples are valid, and docs/settings.md has every setting.

use slipbound::monitor::Settings;
use slipbound::task::TaskSettings;
use slipbound_lab::hand::HandScene;
use slipbound_lab::scenes::Trial;
use slipbound_rig::config::{settings_to_toml, task_settings_to_toml};
use slipbound_rig::sensors;
use std::collections::BTreeMap;

/// Every command below this one, and itself, with the path to it.
fn all(command: clap::Command, path: &str) -> Vec<(String, clap::Command)> {
    let below: Vec<clap::Command> = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    let mut found = vec![(path.to_owned(), command)];
    for command in below {
        let path = format!("{path} {}", command.get_name()).trim_start().to_owned();
        found.extend(all(command, &path));
    }
    found
}

/// The help of every command in a terminal of 80 columns.
fn helps() -> Vec<(String, String)> {
    let mut command = slipbound_cli::command().term_width(80);
    command.build();
    all(command, "").into_iter().map(|(path, mut command)| (path, command.render_long_help().to_string())).collect()
}

/// The lines under `Examples:`, each after its `slipbound`, broken ones joined.
fn examples(help: &str) -> Vec<String> {
    let text = help.split("Examples:\n").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap_or_default();
    let text = text.replace("\\\n", " ");
    let lines = text.lines().map(str::trim).filter(|line| !line.starts_with('#'));
    lines
        .map(|line| line.strip_prefix("slipbound ").unwrap_or_else(|| panic!("{line} in\n{help}")).to_owned())
        .collect()
}

/// Words as a shell takes them: single quotes; a redirection or a comment ends them.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut is_quoted) = (Vec::new(), String::new(), false);
    for sign in line.chars() {
        match sign {
            '\'' => is_quoted = !is_quoted,
            ' ' if !is_quoted => words.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty())),
            _ if !is_quoted && word.is_empty() && matches!(sign, '#' | '>') => return words,
            _ if !is_quoted && "?&*;<>|$`".contains(sign) => panic!("{line}: a shell would not leave {sign} alone"),
            _ => word.push(sign),
        }
    }
    assert!(!is_quoted, "{line}: an open quote");
    words.extend(Some(word).filter(|word| !word.is_empty()));
    words
}

#[test]
fn every_help_fits_80_columns_and_has_examples_and_exit_codes() {
    let helps = helps();
    assert!(helps.len() > 25, "{}", helps.len());
    for (path, help) in helps {
        assert!(help.contains("\nExit codes:\n  0  done\n"), "{path:?}:\n{help}");
        let wide = help.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None, "{path:?}");
        let examples = examples(&help);
        assert!((1..=3).contains(&examples.len()), "{path:?}: {} examples in\n{help}", examples.len());
        // An address may stand between the names: `gripper ADDRESS status`.
        let names_it = |line: &String| path.split_whitespace().all(|name| words(line).iter().any(|word| word == name));
        assert!(examples.iter().all(names_it), "{path:?}: {examples:?}");
    }
}

#[test]
fn every_example_is_what_the_program_takes() {
    for line in helps().iter().flat_map(|(_, help)| examples(help)) {
        let words = words(&line);
        let program = std::iter::once("slipbound").chain(words.iter().map(String::as_str));
        slipbound_cli::command().try_get_matches_from(program).unwrap_or_else(|e| panic!("{line}: {e}"));
        for scene in words.iter().filter_map(|word| word.strip_prefix("sim:")) {
            Trial::parse(scene).unwrap_or_else(|e| panic!("{line}: {e}"));
        }
        let after = |name: &str| words.iter().position(|word| word == name).map(|i| words[i + 1].as_str());
        if let Some(sensor) = after("--sensor").filter(|sensor| !sensor.ends_with(".toml")) {
            sensors::load(sensor).unwrap_or_else(|e| panic!("{line}: {e}"));
        }
        match words[0].as_str() {
            "demo" => drop(HandScene::parse(after("--task").unwrap_or("screw")).expect("a scene")),
            "simulate" => drop(Trial::parse(&words[1]).expect("a scene")),
            _ => {}
        }
    }
}

/// A default as docs/settings.md writes it: numbers to four digits.
fn written(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => {
            let digits: f64 = format!("{number:.3e}").parse().expect("a number");
            digits.to_string()
        }
        toml::Value::Array(values) => format!("[{}]", values.iter().map(written).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

/// The settings below a table, by their whole keys.
fn flat(table: &toml::Table, path: &str, into: &mut BTreeMap<String, String>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(below) => flat(below, &format!("{path}{key}."), into),
            value => drop(into.insert(format!("{path}{key}"), written(value))),
        }
    }
}

#[test]
fn the_page_names_the_groups_that_the_udev_rules_give_access() {
    let page = include_str!("../../../docs/install.md");
    let rules = include_str!("../../../packaging/60-slipbound.rules");
    let groups = rules.lines().filter(|rule| !rule.starts_with('#')).map(|rule| {
        let devices = if rule.contains("\"video4linux\"") { "cameras" } else { "USB serial lines" };
        let group = rule.split("GROUP=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a group");
        format!("`{group}` ({devices})")
    });
    let missing: Vec<String> = groups.filter(|words| !page.replace('\n', " ").contains(words)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn every_setting_stands_in_the_docs_with_its_default() {
    let mut settings = BTreeMap::from([("grip.blind_force_n".to_owned(), "-".to_owned())]); // not set by default
    for text in [settings_to_toml(&Settings::default()), task_settings_to_toml(&TaskSettings::default())] {
        flat(&text.expect("TOML").parse().expect("TOML"), "", &mut settings);
    }
    let page = include_str!("../../../docs/settings.md");
    let (mut documented, mut table) = (BTreeMap::new(), String::new());
    for line in page.lines() {
        if let Some((name, _)) = line.strip_prefix("### `[").and_then(|line| line.split_once(']')) {
            table = format!("{name}.");
        } else if let Some((key, rest)) = line.strip_prefix("| `").and_then(|line| line.split_once("` | ")) {
            let key = if key == "controller" { key.to_owned() } else { format!("{table}{key}") };
            documented.insert(key, rest.split(" | ").next().unwrap_or_default().to_owned());
        }
    }
    assert_eq!(documented, settings);
}
