//! The driver of a wrist by the line protocol, a state machine that receives the time.

use super::error::Error;
use super::zero::{SILENCE_MS, ZeroCheck};
use crate::gripper::line::{Answer, VERSION, ask, number_of};
use crate::link::{Endpoint, InFlight, Lines, LinkHealth, LinkProblem, write_line};
use slipbound::port::{LONGEST_TIME_TO_LIVE_NS, WristCommand, WristMotion, WristState};

/// Longest wait for an answer, ms.
const REPLY_MS: u64 = 100;

/// A command with its number.
#[derive(Debug)]
struct Command {
    number: u64,
    words: String,
}

/// The driver.
#[derive(Debug)]
pub struct LineWrist {
    address: String,
    lines: Lines,
    outgoing: Vec<u8>,
    link: LinkHealth,
    /// Number of the last command sent.
    number: u64,
    /// The newest motion, not yet sent.
    next: Option<String>,
    in_flight: Option<InFlight<Command>>,
    state: Option<WristState>,
    is_greeted: bool,
    /// A greeting of another version: nothing is understood on this link.
    other_version: Option<u32>,
    /// The newest WRIST line and its time, ns, where a number is missing in it.
    incomplete: Option<(u64, String)>,
    zero: ZeroCheck,
    fault: Option<Error>,
}

impl LineWrist {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str) -> Self {
        LineWrist {
            address: address.into(),
            lines: Lines::default(),
            outgoing: Vec::new(),
            link: LinkHealth::new(SILENCE_MS),
            number: 0,
            next: None,
            in_flight: None,
            state: None,
            is_greeted: false,
            other_version: None,
            incomplete: None,
            zero: ZeroCheck::default(),
            fault: None,
        }
    }

    /// Whether the wrist has reported its position.
    pub fn is_stated(&self) -> bool {
        self.state.is_some()
    }

    /// Accepts a motion. An error means that it was not accepted.
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
        self.link.check(now_ns).map_err(|problem| self.link_error(problem))?;
        self.zero.commanded(now_ns, command.motion);
        // A pause waits for nothing.
        if command.motion == WristMotion::Pause {
            self.next = None;
            self.send(now_ns, words);
        } else {
            self.next = Some(words);
            self.advance(now_ns);
        }
        Ok(())
    }

    /// The newest state since the link is up, or what is wrong; a refusal is reported once. A position from before a
    /// new link does not count, but the first one on a new link must continue it; before the first report the position
    /// is 0. Only positions keep the link alive: whatever else comes, without them the wrist is silent.
    pub fn report(&mut self, now_ns: u64) -> Result<WristState, Error> {
        self.check_words(now_ns)?;
        self.link.check_heard(now_ns).map_err(|problem| self.link_error(problem))?;
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        let start = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let known = self.state.or((!self.zero.is_open()).then_some(start));
        let state = known.ok_or_else(|| Error::Unstated { address: self.address.clone() })?;
        if self.state.is_some() {
            self.zero.check(&self.address, &state)?;
        }
        Ok(state)
    }

    /// Fails while the other side speaks another version, or leaves out a number.
    fn check_words(&self, now_ns: u64) -> Result<(), Error> {
        let address = self.address.clone();
        match (self.other_version, &self.incomplete) {
            (Some(got), _) => Err(Error::Version { address, expected: VERSION, got }),
            (None, Some((at_ns, line))) if now_ns.saturating_sub(*at_ns) <= SILENCE_MS * 1_000_000 => {
                Err(Error::Incomplete { address, line: line.clone() })
            }
            (None, _) => Ok(()),
        }
    }

    fn cannot(&self, key: &'static str, expected: &'static str, got: f64) -> Error {
        Error::Motion { address: self.address.clone(), key, expected, got }
    }

    fn link_error(&self, problem: LinkProblem) -> Error {
        let address = self.address.clone();
        match problem {
            LinkProblem::Down { why } => Error::Lost { address, why },
            LinkProblem::Silent { expected_ms, got_ms } => Error::Silent { address, expected_ms, got_ms },
        }
    }

    fn send(&mut self, now_ns: u64, words: String) {
        self.number += 1;
        write_line(&mut self.outgoing, &format!("{} {words}", self.number));
        self.in_flight = Some(InFlight::new(now_ns, Command { number: self.number, words }));
    }

    fn advance(&mut self, now_ns: u64) {
        if self.link.is_up()
            && self.in_flight.is_none()
            && let Some(words) = self.next.take()
        {
            self.send(now_ns, words);
        }
    }

    fn take(&mut self, now_ns: u64, line: Option<&str>) {
        let Some((line, answer)) = line.and_then(|line| Some((line, Answer::parse(line)?))) else { return };
        match answer {
            Answer::Hello(version) => {
                if !std::mem::replace(&mut self.is_greeted, true) {
                    self.link.heard(now_ns);
                }
                self.other_version = Some(version).filter(|version| *version != VERSION);
            }
            Answer::Gripper(_) => {}
            Answer::Wrist(rest) => self.take_state(now_ns, line, rest),
            Answer::Ack { number, words } => {
                let Some(sent) = self.take_in_flight(number) else { return };
                if sent.words != words {
                    // It does not do what was commanded: stop it.
                    self.raise_refused(&sent.words, format!("`{words}` taken over instead"));
                    self.send(now_ns, "PAUSE".into());
                }
            }
            Answer::Err { number, why } => {
                if let Some(sent) = self.take_in_flight(number) {
                    self.raise_refused(&sent.words, format!("`{why}`"));
                }
            }
        }
    }

    fn take_state(&mut self, now_ns: u64, line: &str, rest: &str) {
        let (Some(angle_rad), Some(lowered_mm)) = (number_of(rest, "angle_rad"), number_of(rest, "lowered_mm")) else {
            self.incomplete = Some((now_ns, line.into()));
            return;
        };
        self.link.heard(now_ns);
        self.zero.reported(now_ns);
        self.incomplete = None;
        let moving = number_of(rest, "moving") == Some(1.0);
        self.state = Some(WristState { time_ns: now_ns, angle_rad, lowered_mm, moving });
    }

    fn take_in_flight(&mut self, number: u64) -> Option<Command> {
        self.in_flight.take_if(|sent| sent.message.number == number).map(|sent| sent.message)
    }

    fn raise_refused(&mut self, expected: &str, got: String) {
        self.next = None;
        let refused = Error::Refused { address: self.address.clone(), expected: expected.into(), got };
        self.fault.get_or_insert(refused);
    }
}

impl Endpoint for LineWrist {
    fn linked(&mut self, now_ns: u64) {
        self.lines.clear();
        self.outgoing.clear();
        self.link.up(now_ns);
        self.zero.interrupted(self.state);
        (self.next, self.in_flight, self.state, self.fault) = (None, None, None, None);
        (self.is_greeted, self.other_version, self.incomplete) = (false, None, None);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.outgoing.clear();
        self.link.down(why);
        (self.next, self.in_flight) = (None, None);
        (self.other_version, self.incomplete) = (None, None);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(now_ns, line));
        self.lines = lines;
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        if InFlight::take_overdue(&mut self.in_flight, now_ns, REPLY_MS).is_some() {
            self.next = None;
            let unanswered = Error::Unanswered { address: self.address.clone(), expected_ms: REPLY_MS };
            self.fault.get_or_insert(unanswered);
        }
        self.advance(now_ns);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }
}
