//! Weiss WSG-50, binary interface, as a state machine: bytes and time in, bytes and state out.
//!
//! The driver first asks the gripper to send its state by itself, then has at most one command on the way at a time.
//! A command that is overtaken before it was sent is never sent: the newest one counts.
//!
//! ```text
//!   force F:  (stop, if it opens) -> limit F -> grasp, if not yet given since the last release
//!                                       '-> while holding: wait for the measured force to follow, else grasp again
//!   release:  (stop, if it closes) -> release, or move where nothing is held
//! ```

pub mod frame;
pub mod words;

use super::config::{Config, ForceChange, ns};
use super::ledger::Ledger;
use super::{Driver, Error, Request};
use crate::link::Talker;
use frame::{Frame, Parser, number};
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};
use words::{flag, grasp, id, status};

/// How often an unanswered command that may safely come twice is sent again.
const REPEATS_COUNT: u32 = 2;

/// Time after which an update that does not come by itself is asked for again, ms.
const ASK_AGAIN_MS: u64 = 300;

/// Least change of force of which it is seen whether the gripper follows, N per finger: several of its steps.
const FOLLOWS_FROM_N: f64 = 2.0;

/// Bytes waiting to be sent beyond which nothing more is asked for.
const MOST_UNSENT_BYTES: usize = 1024;

/// What the gripper is asked to tell by itself, and how often that is heard.
#[derive(Debug, Clone, Copy)]
struct Update {
    id: u8,
    heard_or_asked_ns: u64,
}

/// What is wanted of the jaws; the newest want counts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Want {
    Nothing,
    Force(f64),
    Open,
    Home,
    Acknowledge,
}

/// A command on the way to its first answer.
#[derive(Debug, Clone, Copy)]
struct Awaited {
    id: u8,
    own_n: f64,
    since_ns: u64,
    sent_count: u32,
}

/// A motion on the way to its end.
#[derive(Debug, Clone, Copy)]
struct Running {
    id: u8,
    since_ns: u64,
}

/// A new force limit that the measured force should follow.
#[derive(Debug, Clone, Copy)]
struct Following {
    from_n: f64,
    to_n: f64,
    until_ns: u64,
}

/// The driver.
#[derive(Debug)]
pub struct Wsg50 {
    ledger: Ledger,
    parser: Parser,
    updates: [Update; 4],
    system: Option<u32>,
    grasp: Option<u8>,
    limit_own_n: Option<f64>,
    limit_asked_ns: u64,
    want: Want,
    awaited: Option<Awaited>,
    running: Option<Running>,
    following: Option<Following>,
    /// Whether a grasp, or a release, has been given and nothing else since.
    is_grasp_given: bool,
    is_release_given: bool,
    /// Whether a link of ours has been lost without a farewell.
    is_link_lost: bool,
    is_leaving: bool,
    told_path: Option<&'static str>,
}

impl Wsg50 {
    /// A driver that is not yet linked. `address` is for messages.
    pub fn new(address: &str, config: Config) -> Self {
        let update = |id| Update { id, heard_or_asked_ns: 0 };
        Wsg50 {
            ledger: Ledger::new(address, config),
            parser: Parser::default(),
            updates: [id::SYSTEM_STATE, id::GRASP_STATE, id::OPENING, id::FORCE].map(update),
            system: None,
            grasp: None,
            limit_own_n: None,
            limit_asked_ns: 0,
            want: Want::Nothing,
            awaited: None,
            running: None,
            following: None,
            is_grasp_given: false,
            is_release_given: false,
            is_link_lost: false,
            is_leaving: false,
            told_path: None,
        }
    }

    fn is_stopped(&self) -> bool {
        self.system.is_some_and(|bits| bits & flag::FAST_STOP != 0)
    }

    fn is_homed(&self) -> bool {
        self.system.is_some_and(|bits| bits & flag::REFERENCED != 0)
    }

    fn why_stopped(&self) -> String {
        let faults = flag::faults(self.system.unwrap_or(0));
        match (faults.is_empty(), self.is_link_lost) {
            (false, _) => faults,
            (true, true) => {
                "our last link to it was cut without a farewell, as by a pulled cable or a killed program".into()
            }
            (true, false) => {
                "no fault is reported: a link of another program was cut, or somebody sent a fast stop".into()
            }
        }
    }

    fn send(&mut self, now_ns: u64, id: u8, payload: &[u8]) {
        frame::write(&mut self.ledger.outgoing, id, payload);
        self.awaited = Some(Awaited { id, own_n: 0.0, since_ns: now_ns, sent_count: 1 });
    }

    fn send_motion(&mut self, now_ns: u64, id: u8, width_mm: f64) {
        let mut payload = Vec::with_capacity(9);
        if id == id::MOVE {
            payload.push(0); // absolute, clamp on block
        }
        payload.extend((width_mm as f32).to_le_bytes());
        payload.extend((self.ledger.config.speed_mm_per_s as f32).to_le_bytes());
        self.send(now_ns, id, &payload);
    }

    fn ask_for_updates(&mut self, now_ns: u64) {
        if self.ledger.outgoing.len() > MOST_UNSENT_BYTES {
            return; // the link does not take them; asking more often would not help
        }
        let period_ms = self.ledger.config.update_ms as u16;
        let [low, high] = period_ms.to_le_bytes();
        for update in &mut self.updates {
            if now_ns.saturating_sub(update.heard_or_asked_ns) > ns(ASK_AGAIN_MS) {
                update.heard_or_asked_ns = now_ns;
                frame::write(&mut self.ledger.outgoing, update.id, &[1, low, high]);
            }
        }
        if self.limit_own_n.is_none() && now_ns.saturating_sub(self.limit_asked_ns) > ns(ASK_AGAIN_MS) {
            self.limit_asked_ns = now_ns;
            frame::write(&mut self.ledger.outgoing, id::GET_LIMIT, &[]);
        }
    }

    /// Sends the next command towards what is wanted, if none is on the way.
    fn advance(&mut self, now_ns: u64) {
        if !self.ledger.is_linked || self.awaited.is_some() || self.is_leaving {
            return;
        }
        let running = self.running.map(|running| running.id);
        match self.want {
            Want::Nothing => {}
            Want::Acknowledge => {
                self.want = Want::Nothing;
                self.send(now_ns, id::ACKNOWLEDGE, b"ack");
            }
            _ if self.is_stopped() => {}
            Want::Home => {
                self.want = Want::Nothing;
                self.send(now_ns, id::HOME, &[0]);
            }
            Want::Force(force_n) => self.towards_force(now_ns, force_n, running),
            Want::Open if self.is_release_given => {}
            Want::Open if running == Some(id::GRASP) => self.send(now_ns, id::STOP, &[]),
            Want::Open => {
                let holds = self.grasp == Some(grasp::HOLDING);
                self.is_release_given = true;
                self.is_grasp_given = false;
                self.following = None;
                self.send_motion(now_ns, if holds { id::RELEASE } else { id::MOVE }, self.ledger.config.open_mm);
            }
        }
    }

    fn towards_force(&mut self, now_ns: u64, force_n: f64, running: Option<u8>) {
        let own_n = f64::from(self.ledger.config.to_own_n(force_n) as f32);
        if running.is_some_and(|id| id != id::GRASP) {
            self.send(now_ns, id::STOP, &[]);
        } else if self.limit_own_n != Some(own_n) {
            self.send(now_ns, id::SET_LIMIT, &(own_n as f32).to_le_bytes());
            self.awaited = self.awaited.map(|awaited| Awaited { own_n, ..awaited });
        } else if !self.is_grasp_given {
            self.give_grasp(now_ns);
        } else if let Some(following) = self.following {
            self.see_whether_it_follows(now_ns, following);
        }
    }

    fn give_grasp(&mut self, now_ns: u64) {
        let Some(width_mm) = self.ledger.config.part_width_mm else { return };
        self.is_grasp_given = true;
        self.is_release_given = false;
        self.following = None;
        self.send_motion(now_ns, id::GRASP, width_mm);
    }

    fn see_whether_it_follows(&mut self, now_ns: u64, following: Following) {
        let Following { from_n, to_n, until_ns } = following;
        let measured_n = self.ledger.state.force_n.unwrap_or(from_n);
        if (measured_n - to_n).abs() <= 0.5 * (from_n - to_n).abs() {
            self.following = None;
            self.tell_path("setting the force limit alone");
        } else if now_ns >= until_ns {
            self.tell_path("setting the force limit and giving the grasp again");
            self.give_grasp(now_ns);
        }
    }

    fn tell_path(&mut self, path: &'static str) {
        if self.told_path != Some(path) {
            self.told_path = Some(path);
            self.ledger.tell(DriverEvent::ForcePath { path });
        }
    }

    fn take(&mut self, now_ns: u64, frame: &Frame) {
        let Some((code, rest)) = frame.reply() else { return };
        self.ledger.heard_ns = now_ns;
        if let Some(update) = self.updates.iter_mut().find(|update| update.id == frame.id) {
            update.heard_or_asked_ns = now_ns;
            if code == status::OK {
                self.take_update(now_ns, frame.id, rest);
            }
            return;
        }
        match frame.id {
            id::GET_LIMIT => {
                if let (status::OK, Some(own_n)) = (code, number(rest).map(f64::from).filter(|n| n.is_finite())) {
                    self.took_over(own_n);
                }
            }
            _ if self.awaited.is_some_and(|awaited| awaited.id == frame.id) => self.take_answer(now_ns, code),
            _ if self.running.is_some_and(|running| running.id == frame.id) => self.take_end(code),
            _ => {} // the second answer to a command that was sent twice
        }
    }

    fn take_update(&mut self, now_ns: u64, id: u8, rest: &[u8]) {
        let state = &mut self.ledger.state;
        state.time_ns = now_ns;
        match id {
            id::SYSTEM_STATE => {
                let Some(bits) = rest.first_chunk().map(|bytes| u32::from_le_bytes(*bytes)) else { return };
                let was_stopped = self.is_stopped();
                self.system = Some(bits);
                if self.is_stopped() && !was_stopped {
                    self.meet_fast_stop(bits);
                }
            }
            id::GRASP_STATE => self.grasp = rest.first().copied(),
            id::OPENING => state.opening_mm = number(rest).map(f64::from).filter(|mm| (-10.0..=1000.0).contains(mm)),
            id::FORCE => {
                state.force_n = number(rest).and_then(|own_n| self.ledger.config.from_own_n(f64::from(own_n)));
            }
            _ => {}
        }
        self.ledger.state.jaws = self.jaws();
    }

    fn meet_fast_stop(&mut self, bits: u32) {
        let why = self.why_stopped();
        self.ledger.tell(DriverEvent::FastStop { why });
        (self.want, self.running, self.following) = (Want::Nothing, None, None);
        let is_ours = self.is_link_lost && flag::faults(bits).is_empty();
        if is_ours && self.ledger.config.acknowledge_own_fast_stop {
            self.ledger.tell(DriverEvent::Acknowledged);
            self.want = Want::Acknowledge;
        }
    }

    fn jaws(&self) -> Jaws {
        if self.is_stopped() {
            return Jaws::Stopped;
        }
        if !self.is_homed() {
            return Jaws::Unknown;
        }
        match self.grasp {
            Some(grasp::GRASPING) => Jaws::Closing,
            Some(grasp::NO_PART) => Jaws::Nothing,
            Some(grasp::PART_LOST) => Jaws::Lost,
            Some(grasp::HOLDING) => Jaws::Holding,
            Some(grasp::IDLE | grasp::RELEASING | grasp::POSITIONING) => Jaws::Open,
            _ => Jaws::Unknown,
        }
    }

    /// The gripper has this limit now.
    fn took_over(&mut self, own_n: f64) {
        self.limit_own_n = Some(own_n);
        self.ledger.state.target_n = self.ledger.config.from_own_n(own_n);
    }

    /// The first answer to the command on the way.
    fn take_answer(&mut self, now_ns: u64, code: u16) {
        let Some(awaited) = self.awaited.take() else { return };
        match (awaited.id, code) {
            (id::SET_LIMIT, status::OK) => self.limit_set(now_ns, awaited.own_n),
            (id::STOP, status::OK) => (self.running, self.is_grasp_given, self.is_release_given) = (None, false, false),
            (id::ACKNOWLEDGE, status::OK) => {
                (self.is_grasp_given, self.is_release_given, self.is_link_lost) = (false, false, false);
            }
            (id::DISCONNECT, _) => {}
            (id @ (id::HOME | id::MOVE | id::GRASP | id::RELEASE), status::PENDING) => {
                self.running = Some(Running { id, since_ns: now_ns });
            }
            (id::HOME | id::MOVE | id::GRASP | id::RELEASE, status::OK | status::ABORTED) => {}
            (id, code) => {
                self.want = Want::Nothing;
                self.ledger.refused(in_words(id), status::in_words(code));
            }
        }
    }

    fn limit_set(&mut self, now_ns: u64, own_n: f64) {
        self.took_over(own_n);
        let is_held = self.is_grasp_given && self.grasp == Some(grasp::HOLDING);
        if !is_held {
            return;
        }
        let Some(from_n) = self.ledger.state.force_n else { return };
        let to_n = self.ledger.config.from_own_n(own_n).unwrap_or(from_n);
        let follow_ms = match self.ledger.config.force_change {
            ForceChange::Limit => return,
            ForceChange::Regrasp => 0,
            // In small steps nobody sees it; they add up until somebody does.
            ForceChange::Auto if (to_n - from_n).abs() < FOLLOWS_FROM_N => return,
            ForceChange::Auto => self.ledger.config.follow_ms,
        };
        self.following = Some(Following { from_n, to_n, until_ns: now_ns + ns(follow_ms) });
    }

    /// The end of the motion under way.
    fn take_end(&mut self, code: u16) {
        let Some(Running { id, .. }) = self.running.take() else { return };
        match code {
            status::OK | status::ABORTED => {}
            // That no part was found is said by the grasp state.
            status::FAILED if id == id::GRASP => {}
            code => self.ledger.refused(in_words(id), status::in_words(code)),
        }
    }

    fn watch_deadlines(&mut self, now_ns: u64) {
        if let Some(mut awaited) = self.awaited
            && now_ns.saturating_sub(awaited.since_ns) > ns(self.ledger.config.reply_ms)
        {
            self.awaited = None;
            if awaited.id == id::SET_LIMIT && awaited.sent_count <= REPEATS_COUNT {
                frame::write(&mut self.ledger.outgoing, awaited.id, &(awaited.own_n as f32).to_le_bytes());
                awaited.since_ns = now_ns;
                awaited.sent_count += 1;
                self.awaited = Some(awaited);
            } else {
                self.want = Want::Nothing;
                self.limit_own_n = None; // it may have come through after all: ask
                self.ledger.unanswered(in_words(awaited.id));
            }
        }
        if let Some(running) = self.running
            && now_ns.saturating_sub(running.since_ns) > ns(self.ledger.config.motion_ms)
        {
            self.running = None;
            let (address, expected_ms) = (self.ledger.address.clone(), self.ledger.config.motion_ms);
            self.ledger.fail(Error::Unanswered { address, command: in_words(running.id), expected_ms });
        }
    }

    fn may_move(&self) -> Result<(), Error> {
        let address = || self.ledger.address.clone();
        if self.system.is_none() {
            return Err(Error::NotReady { address: address(), expected: "its system state" });
        }
        if self.is_stopped() {
            return Err(Error::FastStop { address: address(), why: self.why_stopped() });
        }
        if !self.is_homed() {
            return Err(Error::NotHomed { address: address() });
        }
        if self.grasp.is_none() {
            return Err(Error::NotReady { address: address(), expected: "whether it holds something" });
        }
        Ok(())
    }

    fn grip(&mut self, command: GripCommand) -> Result<(), Error> {
        self.may_move()?;
        let GripCommand::Hold { force_n } = command else {
            if self.want != Want::Open {
                (self.want, self.is_release_given) = (Want::Open, false);
            }
            return Ok(());
        };
        let force_n = self.ledger.admit(force_n)?;
        if self.ledger.config.part_width_mm.is_none() && !self.is_grasp_given && self.grasp != Some(grasp::HOLDING) {
            let address = self.ledger.address.clone();
            let why = "a WSG-50 calls contact far from the width it was told a collision";
            return Err(Error::Unset { address, command: "grasp", key: "part_width_mm", why });
        }
        self.want = Want::Force(force_n);
        Ok(())
    }
}

impl Talker for Wsg50 {
    fn linked(&mut self, now_ns: u64) {
        self.ledger.linked(now_ns);
        self.parser.clear();
        (self.system, self.grasp, self.limit_own_n) = (None, None, None);
        (self.want, self.awaited, self.running, self.following) = (Want::Nothing, None, None, None);
        (self.is_grasp_given, self.is_release_given, self.is_leaving) = (false, false, false);
        self.ledger.state.jaws = Jaws::Unknown;
        let long_ago = |update: Update| Update { heard_or_asked_ns: 0, ..update };
        self.updates = self.updates.map(long_ago);
        self.limit_asked_ns = 0;
        self.ask_for_updates(now_ns.max(ns(ASK_AGAIN_MS) + 1));
    }

    fn unlinked(&mut self, _now_ns: u64, why: &str) {
        self.is_link_lost |= self.ledger.is_linked;
        self.ledger.unlinked(why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed(bytes, |frame| self.take(now_ns, &frame));
        let bytes_count = parser.take_passed_over_count();
        if bytes_count > 0 {
            self.ledger.tell(DriverEvent::Garbled { bytes_count });
        }
        self.parser = parser;
        // What holds when the link is made was grasped before: no grasp is to be given anew.
        if self.grasp == Some(grasp::HOLDING) && !self.is_release_given {
            self.is_grasp_given = true;
        }
        self.advance(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        if self.ledger.is_linked {
            self.watch_deadlines(now_ns);
            self.ask_for_updates(now_ns);
            self.advance(now_ns);
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.ledger.outgoing
    }
}

impl Driver for Wsg50 {
    fn order(&mut self, now_ns: u64, order: Request) -> Result<(), Error> {
        self.ledger.ready_for(now_ns, order)?;
        match order {
            Request::Grip(command) => self.grip(command)?,
            Request::Home if self.is_stopped() => self.may_move()?,
            Request::Home if self.is_homed() && self.ledger.seems_to_hold() => {
                return Err(self.ledger.holds_something("home"));
            }
            Request::Home => self.want = Want::Home,
            Request::Acknowledge => self.want = Want::Acknowledge,
            Request::Leave => {
                self.want = Want::Nothing;
                self.send(now_ns, id::DISCONNECT, &[]);
                self.is_leaving = true;
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
            Want::Force(force_n) => {
                let own_n = f64::from(self.ledger.config.to_own_n(force_n) as f32);
                self.limit_own_n != Some(own_n) || !self.is_grasp_given
            }
            Want::Open => !self.is_release_given,
            Want::Home | Want::Acknowledge => true,
        };
        let is_new =
            self.ledger.is_linked && (self.system.is_none() || self.grasp.is_none() || self.limit_own_n.is_none());
        is_new || towards || self.awaited.is_some() || self.running.is_some() || self.following.is_some()
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

fn in_words(id: u8) -> &'static str {
    match id {
        id::HOME => "home",
        id::MOVE => "move",
        id::STOP => "stop",
        id::ACKNOWLEDGE => "acknowledge",
        id::GRASP => "grasp",
        id::RELEASE => "release",
        id::SET_LIMIT => "set force limit",
        _ => "disconnect",
    }
}
