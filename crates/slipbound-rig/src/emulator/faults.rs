//! What goes wrong with an emulator and its link, and when: read from words.

use super::fault::Fault;
use std::fmt;
use std::str::FromStr;

/// Every word that `FromStr` of [`Faults`] takes, with what it means.
pub const WORDS: [(&str, &str); 12] = [
    ("late=MS", "every answer that much later"),
    ("corrupt=SHARE", "one byte changed in that share of the answers"),
    ("drop=SHARE", "one byte lost in that share of the answers"),
    ("seed=N", "what the two above are drawn from"),
    ("stall=MS@MS", "neither reads nor writes for a time, from then on"),
    ("close@MS", "closes the connection"),
    ("fast-stop@MS", "stops itself and must be acknowledged"),
    ("lose-part@MS", "the object is gone"),
    ("power-cycle@MS", "its supply fails and comes back"),
    ("refuse-force@MS", "refuses every new force"),
    ("fixed-limit@MS", "a new force limit has no effect on what is held (wsg50)"),
    ("allow-regrasp@MS", "a grasp may be given again while holding (wsg50, gcl)"),
];

/// What goes wrong, and when. The default is nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Faults {
    /// Every answer comes this much later, ns.
    pub late_ns: u64,
    /// Share of answers with one byte changed.
    pub corrupt_fraction: f64,
    /// Share of answers with one byte lost.
    pub drop_fraction: f64,
    /// What those are drawn from.
    pub seed: u64,
    /// Times without reading or writing: from, for how long, ns.
    pub stalls_ns: Vec<(u64, u64)>,
    /// When the connection is closed, ns.
    pub closes_ns: Vec<u64>,
    /// What happens to the gripper itself, and when, ns.
    pub injections: Vec<(u64, Fault)>,
}

/// A word that is no fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct FaultError {
    word: String,
}

impl fmt::Display for FaultError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<&str> = WORDS.iter().map(|(word, _)| *word).collect();
        write!(f, "expected faults joined by commas, each one of {}; got `{}`", words.join(", "), self.word)
    }
}

impl FromStr for Faults {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let mut faults = Faults::default();
        for word in text.split(',').filter(|word| !word.is_empty()) {
            faults.add(word).ok_or_else(|| FaultError { word: word.into() })?;
        }
        Ok(faults)
    }
}

impl Faults {
    fn add(&mut self, word: &str) -> Option<()> {
        let (what, at_ns) = match word.split_once('@') {
            Some((what, ms)) => (what, ns(ms)?),
            None => (word, 0),
        };
        let fault = match what {
            "fast-stop" => Some(Fault::FastStop),
            "lose-part" => Some(Fault::LosePart),
            "power-cycle" => Some(Fault::PowerCycle),
            "refuse-force" => Some(Fault::RefuseForce),
            "fixed-limit" => Some(Fault::FixedLimit),
            "allow-regrasp" => Some(Fault::AllowRegrasp),
            _ => None,
        };
        match (fault, what.split_once('=')) {
            (Some(fault), _) => self.injections.push((at_ns, fault)),
            (None, None) if what == "close" => self.closes_ns.push(at_ns),
            (None, Some(("stall", ms))) => self.stalls_ns.push((at_ns, ns(ms)?)),
            (None, Some(("late", ms))) => self.late_ns = ns(ms)?,
            (None, Some(("corrupt", share))) => self.corrupt_fraction = fraction(share)?,
            (None, Some(("drop", share))) => self.drop_fraction = fraction(share)?,
            (None, Some(("seed", seed))) => self.seed = seed.parse().ok()?,
            _ => return None,
        }
        Some(())
    }
}

fn ns(ms: &str) -> Option<u64> {
    ms.parse::<u64>().ok()?.checked_mul(1_000_000)
}

fn fraction(text: &str) -> Option<f64> {
    text.parse().ok().filter(|share| (0.0..=1.0).contains(share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_written() {
        let got: Faults = "late=20,corrupt=0.5,stall=5000@1000,close@3,lose-part@7,fixed-limit".parse().expect("valid");
        assert_eq!((got.late_ns, got.corrupt_fraction), (20_000_000, 0.5));
        assert_eq!(got.stalls_ns, [(1_000_000_000, 5_000_000_000)]);
        assert_eq!(got.closes_ns, [3_000_000]);
        assert_eq!(got.injections, [(7_000_000, Fault::LosePart), (0, Fault::FixedLimit)]);
        assert_eq!("".parse(), Ok(Faults::default()));
        for word in ["banana", "late", "late=-1", "corrupt=1.5", "corrupt=nan", "stall@3", "close=3", "lose-part@x"] {
            let message = word.parse::<Faults>().expect_err(word).to_string();
            assert!(message.contains(&format!("got `{word}`")) && message.contains("stall=MS@MS"), "{message}");
        }
    }
}
