//! `--set KEY=VALUE`, beside options for some of the parameters.

use crate::outcome::Failure;
use anyhow::anyhow;

/// Refuses `--set` of a parameter that has an option of its own. `own`: such parameters, with their options.
pub fn refuse_own(set: &[String], own: &[(&str, &str)]) -> Result<(), Failure> {
    let key = |setting: &str| setting.split_once('=').map_or(String::new(), |(key, _)| key.trim().to_owned());
    let both = set.iter().find_map(|setting| Some((setting, own.iter().find(|(own, _)| *own == key(setting))?)));
    match both {
        None => Ok(()),
        Some((setting, (key, option))) => {
            Err(Failure::Arguments(anyhow!("--set {setting}: expected {option} for {key}, which it would contradict")))
        }
    }
}
