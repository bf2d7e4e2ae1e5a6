//! The wrist's side of the line protocol as a state machine.

use super::Error;
use crate::gripper::line::{Answer, VERSION, ask, number_of};
use crate::gripper::text::Lines;
use crate::link::Talker;
use slipbound::port::{LONGEST_TIME_TO_LIVE_NS, WristCommand, WristMotion, WristState};

/// Longest wait for an answer, ms.
const REPLY_MS: u64 = 100;

/// Longest time without a sign of life, ms.
const SILENCE_MS: u64 = 300;

/// A command on the way.
#[derive(Debug)]
struct Awaited {
    number: u64,
    words: String,
    since_ns: u64,
}

/// The driver.
#[derive(Debug)]
pub struct LineWrist {
    address: String,
    lines: Lines,
    outgoing: Vec<u8>,
    is_linked: bool,
    unlinked_why: String,
    heard_ns: u64,
    number: u64,
    /// The newest motion, not yet sent.
    wanted: Option<String>,
    awaited: Option<Awaited>,
    state: Option<WristState>,
    fault: Option<Error>,
}

impl LineWrist {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str) -> Self {
        LineWrist {
            address: address.into(),
            lines: Lines::default(),
            outgoing: Vec::new(),
            is_linked: false,
            unlinked_why: "not yet made".into(),
            heard_ns: 0,
            number: 0,
            wanted: None,
            awaited: None,
            state: None,
            fault: None,
        }
    }

    /// Whether the wrist has said where it is.
    pub fn is_stated(&self) -> bool {
        self.state.is_some()
    }

    /// Takes over a motion. An error means that it was not.
    pub fn command(&mut self, now_ns: u64, command: WristCommand) -> Result<(), Error> {
        let time_to_live_ms = command.time_to_live_ns as f64 * 1e-6;
        if command.time_to_live_ns > LONGEST_TIME_TO_LIVE_NS {
            return Err(self.cannot("time_to_live_ms", "at most 200", time_to_live_ms));
        }
        let finite = |key, value: f64| match value.is_finite() {
            true => Ok((key, value)),
            false => Err(self.cannot(key, "a number", value)),
        };
        let bound = |key, value: f64| match value.is_finite() && value >= 0.0 {
            true => Ok((key, value)),
            false => Err(self.cannot(key, "a number not below 0", value)),
        };
        let life = ("time_to_live_ms", time_to_live_ms);
        let words = match command.motion {
            WristMotion::Turn { rate_rad_per_s, most_rad } => {
                ask("TURN", &[finite("rate_rad_per_s", rate_rad_per_s)?, bound("most_rad", most_rad)?, life])
            }
            WristMotion::Lower { rate_mm_per_s, most_mm } => {
                ask("LOWER", &[finite("rate_mm_per_s", rate_mm_per_s)?, bound("most_mm", most_mm)?, life])
            }
            WristMotion::Pause => ask("PAUSE", &[]),
        };
        self.ready(now_ns)?;
        // A pause waits for nothing.
        if command.motion == WristMotion::Pause {
            self.wanted = None;
            self.say(now_ns, words);
        } else {
            self.wanted = Some(words);
            self.advance(now_ns);
        }
        Ok(())
    }

    /// The newest state, or what is wrong; a refusal is told once.
    pub fn report(&mut self, now_ns: u64) -> Result<WristState, Error> {
        self.ready(now_ns)?;
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        let start = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        Ok(self.state.unwrap_or(start))
    }

    fn cannot(&self, key: &'static str, expected: &'static str, got: f64) -> Error {
        Error::Motion { address: self.address.clone(), key, expected, got }
    }

    fn ready(&self, now_ns: u64) -> Result<(), Error> {
        let address = || self.address.clone();
        if !self.is_linked {
            return Err(Error::Lost { address: address(), why: self.unlinked_why.clone() });
        }
        let got_ms = now_ns.saturating_sub(self.heard_ns) / 1_000_000;
        match got_ms > SILENCE_MS {
            true => Err(Error::Silent { address: address(), expected_ms: SILENCE_MS, got_ms }),
            false => Ok(()),
        }
    }

    fn say(&mut self, now_ns: u64, words: String) {
        self.number += 1;
        self.outgoing.extend(format!("{} {words}\n", self.number).into_bytes());
        self.awaited = Some(Awaited { number: self.number, words, since_ns: now_ns });
    }

    fn advance(&mut self, now_ns: u64) {
        if self.is_linked
            && self.awaited.is_none()
            && let Some(words) = self.wanted.take()
        {
            self.say(now_ns, words);
        }
    }

    fn take(&mut self, now_ns: u64, line: Option<&str>) {
        let Some(answer) = line.and_then(Answer::parse) else { return };
        self.heard_ns = now_ns;
        match answer {
            Answer::Hello(VERSION) | Answer::Gripper(_) => {}
            Answer::Hello(version) => self.refuse("HELLO", format!("version {version}, expected {VERSION}")),
            Answer::Wrist(rest) => {
                if let (Some(angle_rad), Some(lowered_mm)) =
                    (number_of(rest, "angle_rad"), number_of(rest, "lowered_mm"))
                {
                    let moving = number_of(rest, "moving") == Some(1.0);
                    self.state = Some(WristState { time_ns: now_ns, angle_rad, lowered_mm, moving });
                }
            }
            Answer::Ack { number, words } => {
                let Some(awaited) = self.awaited.take_if(|awaited| awaited.number == number) else { return };
                if awaited.words != words {
                    // It does something else than it was told: stop that.
                    self.refuse(&awaited.words, format!("`{words}` taken over instead"));
                    self.say(now_ns, "PAUSE".into());
                }
            }
            Answer::Err { number, why } => {
                if let Some(awaited) = self.awaited.take_if(|awaited| awaited.number == number) {
                    self.refuse(&awaited.words, format!("`{why}`"));
                }
            }
        }
    }

    fn refuse(&mut self, expected: &str, got: String) {
        self.wanted = None;
        let refused = Error::Refused { address: self.address.clone(), expected: expected.into(), got };
        self.fault.get_or_insert(refused);
    }
}

impl Talker for LineWrist {
    fn linked(&mut self, now_ns: u64) {
        self.lines.clear();
        self.outgoing.clear();
        (self.is_linked, self.heard_ns) = (true, now_ns);
        (self.wanted, self.awaited, self.state, self.fault) = (None, None, None, None);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.outgoing.clear();
        (self.is_linked, self.unlinked_why) = (false, why.into());
        (self.wanted, self.awaited) = (None, None);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(now_ns, line));
        self.lines = lines;
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        let is_late = |awaited: &mut Awaited| now_ns.saturating_sub(awaited.since_ns) > REPLY_MS * 1_000_000;
        if self.awaited.take_if(is_late).is_some() {
            self.wanted = None;
            let unanswered = Error::Unanswered { address: self.address.clone(), expected_ms: REPLY_MS };
            self.fault.get_or_insert(unanswered);
        }
        self.advance(now_ns);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }
}
