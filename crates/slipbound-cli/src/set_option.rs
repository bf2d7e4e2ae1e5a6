//! `--set KEY=VALUE`, beside options for some of the parameters.

use crate::outcome::Failure;
use anyhow::anyhow;

/// Refuses `--set` of a parameter that has an option of its own, and of several parameters at once. `own`: the parameters
/// that have an option, with these options.
pub fn refuse_own(set: &[String], own: &[(&str, &str)]) -> Result<(), Failure> {
    if let Some(setting) = set.iter().find(|setting| setting.contains('&')) {
        let expected = "expected one KEY=VALUE, got several joined by `&`: give --set once for each";
        return Err(Failure::Arguments(anyhow!("--set {setting}: {expected}")));
    }
    let key = |setting: &str| setting.split_once('=').map_or(String::new(), |(key, _)| key.trim().to_owned());
    let both = set.iter().find_map(|setting| Some((setting, own.iter().find(|(own, _)| *own == key(setting))?)));
    match both {
        None => Ok(()),
        Some((setting, (key, option))) => {
            Err(Failure::Arguments(anyhow!("--set {setting}: expected {option} for {key}, which it would contradict")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_parameter_with_an_option_of_its_own_is_set_alone_or_behind_another() {
        let refused = |set: &str| match refuse_own(&[set.to_owned()], &[("seed", "--seed")]) {
            Err(Failure::Arguments(e)) => e.to_string(),
            other => panic!("{set}: {other:?}"),
        };
        assert!(refused("seed=7").contains("expected --seed for seed"));
        assert!(refused("mu=0.5&seed=7").contains("--set mu=0.5&seed=7: expected one KEY=VALUE, got several"));
        refuse_own(&["mu=0.5".to_owned(), "grid=fast".to_owned()], &[("seed", "--seed")]).expect("neither");
    }
}
