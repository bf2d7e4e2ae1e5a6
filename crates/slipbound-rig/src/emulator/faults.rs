//! What can be made to go wrong with an emulator, and the wrapper that makes it.

use super::{Emulator, Mishap};
use slipbound::plant::Plant;
use std::collections::VecDeque;
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
    /// What happens when, ns.
    pub mishaps: Vec<(u64, Mishap)>,
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
        let mishap = match what {
            "fast-stop" => Some(Mishap::FastStop),
            "lose-part" => Some(Mishap::LosePart),
            "power-cycle" => Some(Mishap::PowerCycle),
            "refuse-force" => Some(Mishap::RefuseForce),
            "fixed-limit" => Some(Mishap::FixedLimit),
            "allow-regrasp" => Some(Mishap::AllowRegrasp),
            _ => None,
        };
        match (mishap, what.split_once('=')) {
            (Some(mishap), _) => self.mishaps.push((at_ns, mishap)),
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

/// An emulator to which all this happens.
pub struct Faulty {
    inner: Box<dyn Emulator>,
    faults: Faults,
    random: u64,
    from_ns: Option<u64>,
    now_ns: u64,
    late: VecDeque<(u64, Vec<u8>)>,
    unread: Vec<u8>,
    outgoing: Vec<u8>,
    is_hanging_up: bool,
}

impl Faulty {
    /// Wraps an emulator. Times of faults count from the first tick.
    pub fn new(inner: Box<dyn Emulator>, faults: Faults) -> Self {
        let random = faults.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        Faulty {
            inner,
            faults,
            random,
            from_ns: None,
            now_ns: 0,
            late: VecDeque::new(),
            unread: Vec::new(),
            outgoing: Vec::new(),
            is_hanging_up: false,
        }
    }

    /// Whether the connection is to be closed now; asked once, it is forgotten.
    pub fn take_hang_up(&mut self) -> bool {
        std::mem::take(&mut self.is_hanging_up)
    }

    fn is_stalled(&self) -> bool {
        let since_ns = self.now_ns.saturating_sub(self.from_ns.unwrap_or(self.now_ns));
        self.faults.stalls_ns.iter().any(|(from_ns, for_ns)| (*from_ns..from_ns + for_ns).contains(&since_ns))
    }

    /// A number from 0 to 1 (xorshift64*).
    fn draw(&mut self) -> f64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn befall_due(&mut self) {
        let since_ns = self.now_ns - self.from_ns.unwrap_or(self.now_ns);
        let due: Vec<Mishap> = self.faults.mishaps.iter().filter(|(at, _)| *at <= since_ns).map(|m| m.1).collect();
        self.faults.mishaps.retain(|(at_ns, _)| *at_ns > since_ns);
        for mishap in due {
            self.inner.befall(self.now_ns, mishap);
            self.is_hanging_up |= mishap == Mishap::PowerCycle;
        }
        let closes_count = self.faults.closes_ns.len();
        self.faults.closes_ns.retain(|at_ns| *at_ns > since_ns);
        self.is_hanging_up |= self.faults.closes_ns.len() < closes_count;
    }

    fn collect(&mut self) {
        let mut answer = std::mem::take(self.inner.outgoing());
        if answer.is_empty() {
            return;
        }
        if self.faults.corrupt_fraction > 0.0 && self.draw() < self.faults.corrupt_fraction {
            let place = (self.draw() * answer.len() as f64) as usize;
            answer[place] ^= 1 + (self.draw() * 255.0) as u8;
        }
        if self.faults.drop_fraction > 0.0 && self.draw() < self.faults.drop_fraction {
            let place = (self.draw() * answer.len() as f64) as usize;
            answer.remove(place);
        }
        self.late.push_back((self.now_ns + self.faults.late_ns, answer));
    }

    fn release(&mut self) {
        while !self.is_stalled() && self.late.front().is_some_and(|(due_ns, _)| *due_ns <= self.now_ns) {
            if let Some((_, answer)) = self.late.pop_front() {
                self.outgoing.extend(answer);
            }
        }
    }
}

impl Emulator for Faulty {
    fn connected(&mut self, now_ns: u64) {
        self.late.clear();
        self.unread.clear();
        self.outgoing.clear();
        self.inner.connected(now_ns);
    }

    fn disconnected(&mut self, now_ns: u64) {
        // What was sent before the end, a farewell say, is read before it.
        let unread = std::mem::take(&mut self.unread);
        self.inner.receive(now_ns, &unread);
        self.inner.disconnected(now_ns);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        self.now_ns = now_ns;
        if self.is_stalled() {
            self.unread.extend_from_slice(bytes);
        } else {
            self.inner.receive(now_ns, bytes);
            self.collect();
            self.release();
        }
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.from_ns.get_or_insert(now_ns);
        self.now_ns = now_ns;
        self.befall_due();
        if !self.is_stalled() && !self.unread.is_empty() {
            let unread = std::mem::take(&mut self.unread);
            self.inner.receive(now_ns, &unread);
        }
        self.inner.tick(now_ns, plant);
        self.collect();
        self.release();
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn befall(&mut self, now_ns: u64, mishap: Mishap) -> bool {
        self.inner.befall(now_ns, mishap)
    }

    fn force_n(&self) -> f64 {
        self.inner.force_n()
    }

    fn opening_mm(&self) -> f64 {
        self.inner.opening_mm()
    }
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
        assert_eq!(got.mishaps, [(7_000_000, Mishap::LosePart), (0, Mishap::FixedLimit)]);
        assert_eq!("".parse(), Ok(Faults::default()));
        for word in ["banana", "late", "late=-1", "corrupt=1.5", "corrupt=nan", "stall@3", "close=3", "lose-part@x"] {
            let message = word.parse::<Faults>().expect_err(word).to_string();
            assert!(message.contains(&format!("got `{word}`")) && message.contains("stall=MS@MS"), "{message}");
        }
    }
}
