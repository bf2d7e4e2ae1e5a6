//! Texts on a run, its end and its commands, shared by terminal and page.

use super::info::RunInfo;
use crate::printable::without_passwords;
use slipbound::control::Cycle;
use slipbound::port::GripCommand;
use slipbound::task::{Ending, Phase};

/// The settings of a scene that distinguish runs for a reader.
const SHOWN: [&str; 6] = ["object", "mu", "mu_right", "camera", "surroundings", "fault"];

impl RunInfo {
    /// The source in a line: for a scene the settings that distinguish runs; hardware and recordings as they were
    /// named.
    pub fn source_in_words(&self) -> String {
        source_in_words(&without_passwords(&self.source), self.seed)
    }
}

fn source_in_words(source: &str, seed: u64) -> String {
    let Some((task, settings)) = source.split_once('?') else { return source.to_owned() };
    if !settings.split('&').any(|setting| setting.starts_with("seed=")) {
        return source.to_owned(); // the settings of a camera
    }
    let shown = settings.split('&').filter_map(|setting| setting.split_once('=')).filter_map(|(key, value)| {
        let usual = matches!((key, value), ("fault", "none") | ("surroundings", "camera") | (_, "object"));
        let words = value.replace('_', " ");
        (SHOWN.contains(&key) && !usual).then(|| match key {
            "object" | "camera" => words,
            "mu_right" => format!("mu {words} on the right"),
            _ => format!("{key} {words}"),
        })
    });
    let seed = std::iter::once(format!("seed {seed}"));
    std::iter::once(format!("simulated {task}")).chain(shown).chain(seed).collect::<Vec<_>>().join(", ")
}

/// How long a run took, and up to what: `(7.77 s, until it ended)`. `ended_s`: when its task ended; `last_s`: the time of
/// its last cycle.
pub fn duration(ended_s: Option<f64>, last_s: f64, ending: Option<Ending>) -> (String, &'static str) {
    let until = match (ended_s, ending) {
        (Some(_), _) => "until it ended",
        (None, Some(_)) => "in all",
        (None, None) => "until it broke off",
    };
    (format!("{:.2} s", ended_s.unwrap_or(last_s)), until)
}

/// That a loop was left with the blind force ([`ControlLoop::left_with_n`](slipbound::control::ControlLoop::left_with_n)),
/// N per finger.
pub fn left_in_words(force_n: f64) -> String {
    format!("the loop was left: the grip rises to the blind force of {force_n:.1} N")
}

/// What a cycle commanded, and in which phase.
pub(super) fn commanded(cycle: &Cycle) -> String {
    let grip = match cycle.grip_command {
        GripCommand::Hold { force_n } => format!("hold with {force_n} N"),
        GripCommand::Release => "release".to_owned(),
    };
    format!("{grip}, {}, while {}", cycle.wrist_command.motion, phase_name(cycle.phase))
}

/// What a phase is called.
pub(crate) fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Grasping => "grasping",
        Phase::Working => "working",
        Phase::Waiting => "waiting",
        Phase::Releasing => "releasing",
        Phase::Ended(_) => "ended",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulated_source_is_told_in_a_few_words_and_a_real_one_as_it_is() {
        let source =
            "lift?seed=1&object=water_bottle&mu=0.25&mu_right=object&fingers=2&grid=fast&camera=gelslim&fault=none";
        assert_eq!(source_in_words(source, 1), "simulated lift, water bottle, mu 0.25, gelslim, seed 1");
        assert_eq!(source_in_words("screw?seed=7&fault=lost@3&mu=object", 7), "simulated screw, fault lost@3, seed 7");
        for real in ["v4l2:28GM", "v4l2:28GM?size=640x480&rate_hz=30", "clips/run_07"] {
            assert_eq!(source_in_words(real, 0), real);
        }
    }
}
