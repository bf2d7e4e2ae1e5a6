//! Faults of an emulator and of its link, and their times: parsed from words.

use super::fault::Fault;
use super::force_sensor::SensorFaults;
use std::fmt;
use std::str::FromStr;

/// Every word that `FromStr` of [`Faults`] takes, with what it means.
pub const WORDS: [(&str, &str); 21] = [
    ("late=MS", "every answer that much later"),
    ("late-every=N", "every Nth answer 400 ms later"),
    ("corrupt=SHARE", "one byte changed in that share of the answers"),
    ("drop=SHARE", "one byte lost in that share of the answers"),
    ("seed=N", "what the two above and the noise are drawn from"),
    ("bias=N", "the force reads so many N more"),
    ("gain=X", "the force reads so many times what it is"),
    ("noise=N", "the force flickers by so many N rms"),
    ("step=N", "the force is read in steps of so many N"),
    ("drift=N", "the force reads so many N more every second"),
    ("idle=N", "so many N are read with nothing between the jaws"),
    ("lag=MS", "the reading follows the force with this time constant"),
    ("period=MS", "the force is read anew only every so many ms"),
    ("stall=MS@MS", "neither reads nor writes for a time, from then on"),
    ("close@MS", "closes the connection"),
    ("fast-stop@MS", "stops itself and must be acknowledged"),
    ("lose-part@MS", "the object is gone"),
    ("power-cycle@MS", "its supply fails and comes back"),
    ("refuse-force@MS", "refuses every new force"),
    ("fixed-limit@MS", "a new force limit has no effect on what is held (wsg50)"),
    ("allow-regrasp@MS", "a grasp may be given again while holding (wsg50, gcl)"),
];

/// Delay of an answer that is late by `late_every_count`, ns.
pub const LATE_NS: u64 = 400_000_000;

/// Faults and their times. Default: none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Faults {
    /// Every answer comes this much later, ns.
    pub late_ns: u64,
    /// One in this many answers comes [`LATE_NS`] later; 0 for none.
    pub late_every_count: u32,
    /// Faults of its force sensor.
    pub sensor: SensorFaults,
    /// Share of answers with one byte changed.
    pub corrupt_fraction: f64,
    /// Share of answers with one byte lost.
    pub drop_fraction: f64,
    /// Seed of the random faults.
    pub seed: u64,
    /// Intervals without reading or writing: start, duration, ns.
    pub stalls_ns: Vec<(u64, u64)>,
    /// When the connection is closed, ns.
    pub closes_ns: Vec<u64>,
    /// Faults of the gripper itself and their times, ns.
    pub injections: Vec<(u64, Fault)>,
}

/// A word that names no fault.
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
        Faults::default().joined_by(text, 0)
    }
}

impl Faults {
    /// These and further ones, written as for [`FromStr`], whose times count from `from_ns`. A value that is given
    /// again replaces the old one.
    pub fn joined_by(mut self, text: &str, from_ns: u64) -> Result<Self, FaultError> {
        for word in text.split(',').filter(|word| !word.is_empty()) {
            self.add(word, from_ns).ok_or_else(|| FaultError { word: word.into() })?;
        }
        Ok(self)
    }

    fn add(&mut self, word: &str, from_ns: u64) -> Option<()> {
        let (what, at_ns) = match word.split_once('@') {
            Some((what, ms)) => (what, from_ns.checked_add(ns(ms)?)?),
            None => (word, from_ns),
        };
        // What is not an event holds from the start, or from the line that asks for it: a time would be without effect.
        if word.contains('@') && what.contains('=') && !what.starts_with("stall=") {
            return None;
        }
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
            (None, Some(("late-every", count))) => self.late_every_count = count.parse().ok()?,
            (None, Some(("bias", n))) => self.sensor.bias_n = number(n)?,
            (None, Some(("gain", gain))) => self.sensor.gain = number(gain)?,
            (None, Some(("noise", n))) => self.sensor.noise_n = number(n).filter(|n| *n >= 0.0)?,
            (None, Some(("step", n))) => self.sensor.step_n = number(n).filter(|n| *n >= 0.0)?,
            (None, Some(("drift", n))) => self.sensor.drift_n_per_s = number(n)?,
            (None, Some(("idle", n))) => self.sensor.idle_n = number(n)?,
            (None, Some(("lag", ms))) => self.sensor.lag_s = ns(ms)? as f64 * 1e-9,
            (None, Some(("period", ms))) => self.sensor.period_ns = ns(ms)?,
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

fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|n: &f64| n.abs() <= 1000.0)
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
        let got: Faults =
            "bias=-3,gain=0.85,noise=2,step=0.5,drift=0.1,idle=4,lag=80,period=50,late-every=7".parse().expect("valid");
        let sensor = got.sensor;
        assert_eq!((sensor.bias_n, sensor.gain, sensor.noise_n, sensor.step_n), (-3.0, 0.85, 2.0, 0.5));
        assert_eq!((sensor.drift_n_per_s, sensor.idle_n, sensor.lag_s, got.late_every_count), (0.1, 4.0, 0.08, 7));
        assert_eq!(sensor.period_ns, 50_000_000);
        assert_eq!("".parse(), Ok(Faults::default()));
        let got = got.joined_by("fast-stop,close@3,gain=2", 9_000_000).expect("valid");
        assert_eq!(got.injections, [(9_000_000, Fault::FastStop)]);
        assert_eq!((got.closes_ns, got.sensor.gain, got.sensor.bias_n), (vec![12_000_000], 2.0, -3.0));
        for word in [
            "banana",
            "late",
            "late=-1",
            "corrupt=1.5",
            "corrupt=nan",
            "gain=nan",
            "noise=-1",
            "stall@3",
            "close=3",
            "lose-part@x",
            "late=20@5000",
            "bias=3@1000",
        ] {
            let message = word.parse::<Faults>().expect_err(word).to_string();
            assert!(message.contains(&format!("got `{word}`")) && message.contains("stall=MS@MS"), "{message}");
        }
    }
}
