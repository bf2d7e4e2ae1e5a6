//! Every command's help fits a terminal of 80 columns and its examples are true.

use super::*;
use crate::args::Args;
use clap::{CommandFactory, FromArgMatches};
use slipbound_lab::hand::HandScene;
use slipbound_lab::scenes::Trial;
use slipbound_rig::sensors;

/// Every command with the path to it.
fn all(command: Command, path: &str) -> Vec<(String, Command)> {
    let below: Vec<Command> = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    let mut found = vec![(path.to_owned(), command)];
    for command in below {
        let path = format!("{path} {}", command.get_name()).trim_start().to_owned();
        found.extend(all(command, &path));
    }
    found
}

/// Words as a shell takes them: single quotes, a `\` at the end of a line, a redirection or comment ends them.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut is_quoted) = (Vec::new(), String::new(), false);
    let line = line.replace("\\\n", " ");
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
    let mut command = with_examples(Args::command()).term_width(80);
    command.build();
    let commands = all(command, "");
    assert_eq!(commands.len(), EXAMPLES.len(), "an example of each, and of nothing else");
    for (path, mut command) in commands {
        for text in [command.render_help().to_string(), command.render_long_help().to_string()] {
            for part in ["Examples:\n  slipbound ", "Exit codes:\n  0  done\n"] {
                assert!(text.contains(part), "{path:?}: no {part:?} in\n{text}");
            }
            let examples = EXAMPLES.iter().find(|(of, _)| *of == path).map_or(&[][..], |(_, examples)| examples);
            for line in examples.iter().flat_map(|(line, _)| line.lines()) {
                assert!(text.lines().any(|shown| shown.contains(line)), "{path:?}: {line} is wrapped in\n{text}");
            }
            let wide = text.lines().find(|line| line.chars().count() > 80);
            assert_eq!(wide, None, "{path:?}");
        }
    }
}

#[test]
fn every_example_is_what_the_program_takes() {
    for (path, examples) in EXAMPLES {
        assert!((1..=3).contains(&examples.len()), "{path:?}");
        for (line, _) in examples {
            assert!(line.starts_with(path), "{line}: not of {path:?}");
            let words = words(line);
            let program = std::iter::once("slipbound").chain(words.iter().map(String::as_str));
            let matches = with_examples(Args::command()).try_get_matches_from(program);
            let taken = matches.and_then(|matches| Args::from_arg_matches(&matches));
            taken.unwrap_or_else(|e| panic!("{line}: {e}"));
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
}

#[test]
fn a_shell_s_words() {
    assert_eq!(words("a 'b c' \\\n  d > e # f"), ["a", "b c", "d"]);
}
