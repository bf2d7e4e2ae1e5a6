//! Weiss WSG-50, text interface (Gripper Control Language), as a state machine.
//!
//! The driver asks for position, force and state in turn and has one question or command on the way at a time.
//! The manual's basic commands know the force only as part of `GRIP`, and `GRIP` is not possible while a part is held:
//! a new force while holding is tried once, and refused from then on if the gripper refuses it. For a force that
//! follows the slip take the binary interface.

use super::config::{Config, ns};
use super::ledger::Ledger;
use super::text::Lines;
use super::wsg50::words::{grasp, status};
use super::{Driver, Error, Request};
use crate::link::Talker;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};

/// What is asked in turn.
const QUESTIONS: [&str; 3] = ["POS", "FORCE", "GRIPSTATE"];

/// What is wanted of the jaws; the newest want counts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Want {
    Nothing,
    Force(f64),
    Open,
    Home,
    Acknowledge,
}

/// What is on the way: a question or a command, by its name.
#[derive(Debug, Clone, Copy)]
struct Awaited {
    name: &'static str,
    force_n: f64,
    since_ns: u64,
}

/// The driver.
#[derive(Debug)]
pub struct Gcl {
    ledger: Ledger,
    lines: Lines,
    question: usize,
    asked_ns: Option<u64>,
    grasp: Option<u8>,
    want: Want,
    awaited: Option<Awaited>,
    running: Option<(&'static str, u64)>,
    gripped_n: Option<f64>,
    is_release_given: bool,
    is_stopped: bool,
    is_link_lost: bool,
    is_regrip_refused: bool,
}

impl Gcl {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str, config: Config) -> Self {
        Gcl {
            ledger: Ledger::new(address, config),
            lines: Lines::default(),
            question: 0,
            asked_ns: None,
            grasp: None,
            want: Want::Nothing,
            awaited: None,
            running: None,
            gripped_n: None,
            is_release_given: false,
            is_stopped: false,
            is_link_lost: false,
            is_regrip_refused: false,
        }
    }

    fn say(&mut self, now_ns: u64, name: &'static str, line: &str) {
        self.ledger.outgoing.extend(line.as_bytes());
        self.ledger.outgoing.push(b'\n');
        self.awaited = Some(Awaited { name, force_n: 0.0, since_ns: now_ns });
    }

    fn advance(&mut self, now_ns: u64) {
        if !self.ledger.is_linked || self.awaited.is_some() {
            return;
        }
        let running = self.running.map(|(name, _)| name);
        match self.want {
            Want::Acknowledge => {
                self.want = Want::Nothing;
                self.say(now_ns, "FSACK", "FSACK()");
            }
            Want::Home if !self.is_stopped => {
                self.want = Want::Nothing;
                self.say(now_ns, "HOME", "HOME()");
            }
            Want::Force(force_n) if !self.is_stopped && self.gripped_n != Some(force_n) => match running {
                Some(_) => self.say(now_ns, "STOP", "STOP()"),
                None => self.grip_with(now_ns, force_n),
            },
            Want::Open if !self.is_stopped && !self.is_release_given => match running {
                Some("GRIP") => self.say(now_ns, "STOP", "STOP()"),
                _ => self.open(now_ns),
            },
            _ => self.ask(now_ns),
        }
    }

    fn grip_with(&mut self, now_ns: u64, force_n: f64) {
        let Config { speed_mm_per_s, part_width_mm, .. } = self.ledger.config;
        let own_n = self.ledger.config.to_own_n(force_n);
        let line = match part_width_mm {
            Some(width_mm) => format!("GRIP({own_n:.2},{width_mm:.2},{speed_mm_per_s:.2})"),
            None => format!("GRIP({own_n:.2})"),
        };
        self.say(now_ns, "GRIP", &line);
        self.awaited = self.awaited.map(|awaited| Awaited { force_n, ..awaited });
    }

    fn open(&mut self, now_ns: u64) {
        let Config { open_mm, speed_mm_per_s, .. } = self.ledger.config;
        self.is_release_given = true;
        self.gripped_n = None;
        let from_mm = self.ledger.state.opening_mm.filter(|_| self.grasp == Some(grasp::HOLDING));
        match from_mm {
            Some(from_mm) => {
                let way_mm = (open_mm - from_mm).max(0.0);
                self.say(now_ns, "RELEASE", &format!("RELEASE({way_mm:.2},{speed_mm_per_s:.2})"));
            }
            None => self.say(now_ns, "MOVE", &format!("MOVE({open_mm:.2},{speed_mm_per_s:.2})")),
        }
    }

    /// The three questions one after the other, once a period.
    fn ask(&mut self, now_ns: u64) {
        if self.question == 0 {
            let period_ns = ns(self.ledger.config.update_ms);
            if self.asked_ns.is_some_and(|asked_ns| now_ns.saturating_sub(asked_ns) < period_ns) {
                return;
            }
            self.asked_ns = Some(now_ns);
        }
        let name = QUESTIONS[self.question];
        self.question = (self.question + 1) % QUESTIONS.len();
        self.say(now_ns, name, &format!("{name}?"));
    }

    fn take(&mut self, now_ns: u64, line: Option<&str>) {
        let Some(line) = line else {
            return self.ledger.tell(DriverEvent::Garbled { bytes_count: 1 });
        };
        if let Some((name, value)) = line.split_once('=') {
            return self.take_value(now_ns, name, value);
        }
        let mut words = line.split_whitespace();
        let (kind, name) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        match kind {
            "ACK" => self.take_answer(now_ns, name),
            "FIN" => {
                self.ledger.heard_ns = now_ns;
                if self.running.is_some_and(|(running, _)| running == name) {
                    self.running = None;
                }
            }
            "ERR" => {
                // An error without a name is the answer to what is on the way.
                let (name, code) = match words.next() {
                    Some(code) => (name, code),
                    None => (self.awaited.map_or("", |awaited| awaited.name), name),
                };
                self.take_error(now_ns, name, code.parse().unwrap_or(u16::MAX));
            }
            "" | "END" => {}
            _ => self.ledger.tell(DriverEvent::Garbled { bytes_count: line.len() }),
        }
    }

    fn take_value(&mut self, now_ns: u64, name: &str, value: &str) {
        let number = value.parse::<f64>().ok().filter(|value| value.is_finite());
        let Some(number) = number.filter(|_| QUESTIONS.contains(&name)) else {
            return self.ledger.tell(DriverEvent::Garbled { bytes_count: name.len() + value.len() });
        };
        self.ledger.heard_ns = now_ns;
        if self.awaited.is_some_and(|awaited| awaited.name == name) {
            self.awaited = None;
        }
        let state = &mut self.ledger.state;
        state.time_ns = now_ns;
        match name {
            "POS" => state.opening_mm = Some(number).filter(|mm| (-10.0..=1000.0).contains(mm)),
            "FORCE" => state.force_n = self.ledger.config.from_own_n(number),
            _ => self.grasp = (0.0..=7.0).contains(&number).then_some(number as u8),
        }
        self.ledger.state.jaws = self.jaws();
    }

    fn jaws(&self) -> Jaws {
        match self.grasp {
            _ if self.is_stopped => Jaws::Stopped,
            Some(grasp::GRASPING) => Jaws::Closing,
            Some(grasp::NO_PART) => Jaws::Nothing,
            Some(grasp::PART_LOST) => Jaws::Lost,
            Some(grasp::HOLDING) => Jaws::Holding,
            Some(grasp::IDLE | grasp::RELEASING | grasp::POSITIONING) => Jaws::Open,
            _ => Jaws::Unknown,
        }
    }

    fn take_answer(&mut self, now_ns: u64, name: &str) {
        let Some(awaited) = self.awaited.filter(|awaited| awaited.name == name) else { return };
        self.ledger.heard_ns = now_ns;
        self.awaited = None;
        match awaited.name {
            "GRIP" => {
                self.gripped_n = Some(awaited.force_n);
                self.is_release_given = false;
                self.ledger.state.target_n = Some(awaited.force_n);
            }
            "STOP" => (self.running, self.gripped_n, self.is_release_given) = (None, None, false),
            "FSACK" => {
                (self.is_stopped, self.is_link_lost) = (false, false);
                (self.gripped_n, self.is_release_given) = (None, false);
            }
            _ => {}
        }
        if matches!(awaited.name, "HOME" | "MOVE" | "GRIP" | "RELEASE") {
            self.running = Some((awaited.name, now_ns));
        }
    }

    fn take_error(&mut self, now_ns: u64, name: &str, code: u16) {
        self.ledger.heard_ns = now_ns;
        let awaited = self.awaited.filter(|awaited| awaited.name == name);
        let running = self.running.filter(|(running, _)| *running == name);
        let name = match (awaited, running) {
            (Some(awaited), _) => {
                self.awaited = None;
                self.want = Want::Nothing;
                awaited.name
            }
            (None, Some((name, _))) => {
                self.running = None;
                name
            }
            (None, None) => return,
        };
        let holds = self.grasp == Some(grasp::HOLDING);
        match (name, code) {
            (_, status::ABORTED) => {}
            // That no part was found is said by the state.
            ("GRIP", status::FAILED) if awaited.is_none() => {}
            ("GRIP", status::DENIED) if holds => {
                self.is_regrip_refused = true;
                self.ledger.refused("a new force while holding", "a GRIP that is denied; take wsg50://");
            }
            (_, status::DENIED) => {
                self.is_stopped = true;
                let why = self.why_stopped();
                self.ledger.tell(DriverEvent::FastStop { why });
                self.ledger.state.jaws = Jaws::Stopped;
                self.ledger.refused(name, status::in_words(code));
            }
            (_, code) => self.ledger.refused(name, status::in_words(code)),
        }
    }

    fn why_stopped(&self) -> String {
        if self.is_link_lost {
            "our last link to it was cut without a farewell, as by a pulled cable or a killed program".into()
        } else {
            "a command was denied; a fast stop is the likely cause (this interface does not tell)".into()
        }
    }

    fn watch_deadlines(&mut self, now_ns: u64) {
        if let Some(awaited) = self.awaited
            && now_ns.saturating_sub(awaited.since_ns) > ns(self.ledger.config.reply_ms)
        {
            self.awaited = None;
            // A question is asked again in its turn; silence is told by itself.
            if !QUESTIONS.contains(&awaited.name) {
                self.want = Want::Nothing;
                self.ledger.unanswered(awaited.name);
            }
        }
        if let Some((name, since_ns)) = self.running
            && now_ns.saturating_sub(since_ns) > ns(self.ledger.config.motion_ms)
        {
            self.running = None;
            let (address, expected_ms) = (self.ledger.address.clone(), self.ledger.config.motion_ms);
            self.ledger.fail(Error::Unanswered { address, command: name, expected_ms });
        }
    }

    fn grip(&mut self, command: GripCommand) -> Result<(), Error> {
        let address = || self.ledger.address.clone();
        if self.is_stopped {
            return Err(Error::FastStop { address: address(), why: self.why_stopped() });
        }
        if self.grasp.is_none() {
            return Err(Error::NotReady { address: address(), expected: "whether it holds something" });
        }
        let GripCommand::Hold { force_n } = command else {
            if self.want != Want::Open {
                (self.want, self.is_release_given, self.is_regrip_refused) = (Want::Open, false, false);
            }
            return Ok(());
        };
        let holds = self.grasp == Some(grasp::HOLDING);
        let force_n = self.ledger.admit(force_n)?;
        if holds && self.is_regrip_refused && self.gripped_n != Some(force_n) {
            let (address, command) = (self.ledger.address.clone(), "a new force while holding");
            return Err(Error::Refused {
                address,
                command,
                got: "a GRIP that was denied before; take wsg50://".into(),
            });
        }
        self.want = Want::Force(force_n);
        Ok(())
    }
}

impl Talker for Gcl {
    fn linked(&mut self, now_ns: u64) {
        self.ledger.linked(now_ns);
        self.lines.clear();
        (self.question, self.asked_ns, self.grasp) = (0, None, None);
        (self.want, self.awaited, self.running) = (Want::Nothing, None, None);
        self.is_release_given = false;
        self.ledger.state.jaws = Jaws::Unknown;
        self.advance(now_ns);
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.is_link_lost |= self.ledger.is_linked;
        self.ledger.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.take(now_ns, line));
        self.lines = lines;
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        if self.ledger.is_linked {
            self.watch_deadlines(now_ns);
            self.advance(now_ns);
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for Gcl {
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error> {
        self.ledger.ready_for(now_ns, order)?;
        match order {
            Request::Grip(command) => self.grip(command)?,
            Request::Home if self.grasp == Some(grasp::HOLDING) => return Err(self.ledger.holds_something("home")),
            Request::Home => self.want = Want::Home,
            Request::Acknowledge => self.want = Want::Acknowledge,
            Request::Leave => {
                self.want = Want::Nothing;
                self.say(now_ns, "BYE", "BYE()");
            }
        }
        self.advance(now_ns);
        Ok(())
    }

    fn state(&mut self, now_ns: u64) -> Result<GripperState, Error> {
        self.ledger.report(now_ns)
    }

    fn is_busy(&self) -> bool {
        let towards = match self.want {
            Want::Nothing => false,
            Want::Force(force_n) => self.gripped_n != Some(force_n),
            Want::Open => !self.is_release_given,
            Want::Home | Want::Acknowledge => true,
        };
        let is_question = |awaited: Awaited| QUESTIONS.contains(&awaited.name);
        let is_new = self.ledger.is_linked && self.grasp.is_none();
        is_new || towards || self.running.is_some() || self.awaited.is_some_and(|awaited| !is_question(awaited))
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.ledger.next_event()
    }

    fn config(&self) -> &Config {
        &self.ledger.config
    }

    fn permit_lowering(&mut self, permitted: bool) {
        self.ledger.permit_lowering(permitted);
    }
}
