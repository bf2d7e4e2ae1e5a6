//! Settings of the method and of a task.

use super::error::Error;
use super::layer::{Layer, typed};
use slipbound::monitor::Settings;
use slipbound::setting::SettingError;
use slipbound::task::TaskSettings;
use std::path::Path;

/// The settings for a `--settings` argument: `paper`, or a TOML file whose keys replace the defaults.
pub fn load_settings(name_or_file: &str) -> Result<Settings, Error> {
    if name_or_file == "paper" {
        return Ok(Settings::paper());
    }
    let path = Path::new(name_or_file);
    if path.extension().is_none() && !path.exists() {
        return Err(Error::UnknownSettings { name: name_or_file.into() });
    }
    checked(Layer::read(path)?)
}

/// Settings from the text of a settings file, whose keys replace the defaults; messages call it `what`.
pub fn parse_settings(text: &str, what: &str) -> Result<Settings, Error> {
    checked(Layer::parse(what.to_owned(), text)?)
}

fn checked(layer: Layer) -> Result<Settings, Error> {
    let settings: Settings = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    settings.check().map_err(|source| Error::OutOfRange { file: layer.file, source })?;
    Ok(settings)
}

/// The text of a settings file with every setting in it.
pub fn settings_to_toml(settings: &Settings) -> Result<String, toml::ser::Error> {
    toml::to_string(settings)
}

/// Task settings from the text of a file, whose keys replace the defaults; messages call it `what`.
pub fn parse_task_settings(text: &str, what: &str) -> Result<TaskSettings, Error> {
    task_settings(Layer::parse(what.to_owned(), text)?)
}

/// The text of a task settings file with every setting in it.
pub fn task_settings_to_toml(settings: &TaskSettings) -> Result<String, toml::ser::Error> {
    toml::to_string(settings)
}

/// All settings of a task: the defaults, overridden by the keys of a TOML file if there is one.
pub fn load_task_settings(file: Option<&Path>) -> Result<TaskSettings, Error> {
    let Some(path) = file else { return Ok(TaskSettings::default()) };
    task_settings(Layer::read(path)?)
}

fn task_settings(layer: Layer) -> Result<TaskSettings, Error> {
    let settings: TaskSettings = typed(layer.table.clone(), std::slice::from_ref(&layer))?;
    let checked = settings.check().and_then(|()| step_that_holds(settings.on_slip.step_n));
    checked.map_err(|source| Error::OutOfRange { file: layer.file, source })?;
    Ok(settings)
}

/// Refuses a step that does not raise the force at slip: every task of a file holds something. Only a program that lays
/// something down lowers it, by [`OnSlipSettings::with_step_n`](slipbound::grip::OnSlipSettings::with_step_n).
fn step_that_holds(step_n: f64) -> Result<(), SettingError> {
    match step_n > 0.0 {
        true => Ok(()),
        false => Err(SettingError {
            key: "on_slip.step_n".into(),
            got: step_n.to_string(),
            expected: "a number above 0".into(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn settings(text: &str) -> Result<Settings, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("mine.toml");
        fs::write(&path, text).expect("writes");
        load_settings(path.to_str().expect("UTF-8"))
    }

    #[test]
    fn keys_given_replace_the_defaults() {
        let got = settings("[rest]\nwindow_count = 7\n").expect("valid");
        assert_eq!(got.rest.window_count, 7);
        assert_eq!(got.slip, Settings::default().slip);
        assert_eq!(load_settings("paper").expect("built in"), Settings::paper());
        let text = settings_to_toml(&Settings::paper()).expect("writes");
        assert_eq!(parse_settings(&text, "a text").expect("valid"), Settings::paper());
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (text, parts) in [
            ("[rest]\nwindow_cuont = 7\n", ["mine.toml", "`rest.window_cuont`", "did you mean `window_count`?"]),
            ("[rset]\n", ["mine.toml", "`rset`", "did you mean `rest`?"]),
            ("[banana]\n", ["mine.toml", "`banana`", "expected one of rest, imprint"]),
            (
                "[rest]\nwindow_count = \"many\"\n",
                ["mine.toml: rest.window_count: expected a whole number not below 0, got \"many\"", "", ""],
            ),
            ("[rest]\nwindow_count = -7\n", ["mine.toml: rest.window_count", "expected a whole number", "got -7"]),
            ("[rest]\nwindow_count = 2.5\n", ["mine.toml: rest.window_count", "expected a whole number", "got 2.5"]),
            ("[slip]\nrule = \"mark\"\n", ["mine.toml: slip.rule: expected `margin` or `markers`, got `mark`", "", ""]),
            ("[rest]\nwindow_count = 0\n", ["mine.toml: rest.window_count", "a number from 1", "got 0"]),
            (
                "[evidence.relaxation]\nheld = 1\nslid = 0.5\n",
                ["mine.toml: evidence.relaxation.slid", "a number above held, 1,", "got 0.5"],
            ),
            (
                "[evidence.relaxation]\nheld = -1\nslid = 0.5\n",
                ["mine.toml: evidence.relaxation.held", "a number from 0", "got -1"],
            ),
            ("[rest\n", ["mine.toml", "line 1", "]"]),
        ] {
            let message = settings(text).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
    }

    #[test]
    fn a_step_that_does_not_hold_at_slip_is_refused_in_a_file() {
        for step in ["-10", "0"] {
            let text = format!("[on_slip]\nstep_n = {step}\n");
            let message = parse_task_settings(&text, "mine.toml").expect_err("refused").to_string();
            assert_eq!(message, format!("mine.toml: on_slip.step_n: expected a number above 0, got {step}"));
        }
        assert!(parse_task_settings("[on_slip]\nstep_n = 0.5\n", "mine.toml").is_ok());
    }

    #[test]
    fn what_is_no_settings_file_is_told_apart() {
        let message = load_settings("papr").expect_err("refused").to_string();
        assert!(message.contains("`papr`") && message.contains("expected `paper` or FILE.toml"), "{message}");
        let message = load_settings("papr.toml").expect_err("refused").to_string();
        assert!(message.starts_with("papr.toml: cannot read"), "{message}");
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("picture.toml");
        fs::write(&path, b"\xFF\xD8").expect("writes");
        let message = load_settings(path.to_str().expect("UTF-8")).expect_err("refused").to_string();
        assert!(message.ends_with("picture.toml: expected TOML, got bytes that are no text"), "{message}");
        let message = settings("[slip]\nfoo = 1\n").expect_err("refused").to_string();
        assert!(message.ends_with(", over_min_count"), "{message}");
        let message = settings("[rest]\nwindow_count = 2.5\n").expect_err("refused").to_string();
        assert!(message.contains("2.5") && message.lines().count() == 1, "{message}");
    }
}
