//! The state of any gripper's driver: address and settings, link, newest state of the gripper, faults and events.

use super::config::{Config, Kind, Lowering};
use super::error::Error;
use super::grasp_tracker::GraspTracker;
use crate::link::{LinkHealth, LinkProblem};
use slipbound::port::{DriverEvent, GripperState, Jaws};
use std::collections::VecDeque;

/// Most events kept; the oldest go first.
const EVENTS_COUNT: usize = 64;

/// Time between two reports of garbled bytes, ns.
const GARBLED_NS: u64 = 10_000_000_000;

/// Difference in force that counts as none, N per finger: below the resolution of all these grippers.
const SAME_FORCE_N: f64 = 0.01;

/// How much wider than an object the jaws open, mm.
const RELEASE_ROOM_MM: f64 = 5.0;

/// The state of a [`Driver`](super::Driver), on which its [`Protocol`](super::Protocol) works.
#[derive(Debug)]
pub struct DriverState {
    /// Its settings.
    pub config: Config,
    /// The newest state of the gripper.
    pub gripper: GripperState,
    /// Bytes to be sent.
    pub outgoing: Vec<u8>,
    address: String,
    now_ns: u64,
    link: LinkHealth,
    /// Whether a link has ended that may have latched a fast stop.
    has_lost_link: bool,
    lowering_permitted: bool,
    /// The force of a command that was never answered, N per finger: it may be in effect.
    doubted_n: Option<f64>,
    /// The last requested force outside the range, N per finger: it is reported once.
    clamped_n: Option<f64>,
    grasp: GraspTracker,
    /// Garbled bytes that have not been reported, and the time of the last report, ns.
    garbled_count: usize,
    garbled_ns: Option<u64>,
    /// Bytes that are no message, until the first message.
    unread_count: usize,
    fault: Option<Error>,
    events: VecDeque<DriverEvent>,
}

impl DriverState {
    pub(super) fn new(address: &str, config: Config, needs_link: bool) -> Self {
        DriverState {
            gripper: GripperState {
                time_ns: 0,
                force_n: None,
                force_error_n: None,
                target_n: None,
                opening_mm: None,
                jaws: Jaws::Unknown,
            },
            outgoing: Vec::new(),
            address: address.into(),
            now_ns: 0,
            link: if needs_link { LinkHealth::new(config.silence_ms) } else { LinkHealth::not_needed() },
            has_lost_link: false,
            lowering_permitted: config.lowering == Lowering::Allow,
            doubted_n: None,
            clamped_n: None,
            grasp: GraspTracker::default(),
            garbled_count: 0,
            garbled_ns: None,
            unread_count: 0,
            fault: None,
            events: VecDeque::new(),
            config,
        }
    }

    /// Address of the gripper, for messages.
    pub fn address(&self) -> String {
        self.address.clone()
    }

    /// The time of the call under way, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Whether the link is up.
    pub fn is_linked(&self) -> bool {
        self.link.is_up()
    }

    /// Whether a link of ours has ended since [`DriverState::forget_lost_link`]: some grippers latch a fast stop then.
    pub fn has_lost_link(&self) -> bool {
        self.has_lost_link
    }

    /// The gripper has been acknowledged, or has latched nothing: a later fast stop has another cause.
    pub fn forget_lost_link(&mut self) {
        self.has_lost_link = false;
    }

    /// A valid message was received: the link is alive.
    pub fn heard(&mut self) {
        self.link.heard(self.now_ns);
        self.unread_count = 0;
    }

    /// A question was sent to a gripper that speaks only when it is asked: its silence counts from then.
    pub fn asked(&mut self) {
        self.link.asked(self.now_ns);
    }

    /// Whether an object is, or may soon be, between the jaws.
    pub fn seems_to_hold(&self) -> bool {
        self.grasp.seems_to_hold(&self.gripper, &self.config)
    }

    /// The opening to release to, mm: wider than the object, whatever the settings say, as far as the jaws go. It never
    /// closes them: where neither opening nor width is known, something held is released to the whole stroke.
    pub fn release_mm(&self) -> f64 {
        let Config { kind, open_mm, part_width_mm, .. } = self.config;
        // How far the jaws of a line gripper go is known only from the setting.
        let may_widen = kind != Kind::Line || self.gripper.opening_mm.is_none_or(|mm| mm >= open_mm);
        if !may_widen {
            return open_mm;
        }
        let room_mm = if self.seems_to_hold() { RELEASE_ROOM_MM } else { 0.0 };
        let is_unknown = part_width_mm.is_none() && kind != Kind::Line && self.seems_to_hold();
        let widest_mm = is_unknown.then(|| self.config.stroke_mm());
        let present_mm = self.gripper.opening_mm.map(|mm| mm + room_mm).or(widest_mm);
        let wider_mm = part_width_mm.map(|mm| mm + RELEASE_ROOM_MM).into_iter().chain(present_mm);
        wider_mm.fold(open_mm, f64::max).min(self.config.stroke_mm())
    }

    /// A message was received: records whether the jaws hold something or have released it.
    pub(super) fn track_grasp(&mut self) {
        self.grasp.see(&self.gripper, &self.config);
    }

    /// The gripper has accepted this force, N per finger, or reports that it has it. None: it does not say. A negative
    /// one says nothing either: nobody is told to press with it.
    pub fn settle_target(&mut self, force_n: Option<f64>) {
        let force_n = force_n.filter(|n| *n >= 0.0);
        self.gripper.target_n = force_n;
        if force_n.is_some() {
            self.doubted_n = None;
        }
    }

    /// A command with this force, N per finger, was never answered: the gripper may hold with it or with the force
    /// before.
    pub fn doubt_target(&mut self, force_n: Option<f64>) {
        self.doubted_n = self.doubted_n.into_iter().chain(force_n).reduce(f64::max);
    }

    /// Adds an event for the log of a run.
    pub fn push_event(&mut self, event: DriverEvent) {
        let Some(event) = self.gathered(event) else { return };
        if self.events.len() == EVENTS_COUNT {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Garbled bytes are reported at once, later ones together from time to time.
    fn gathered(&mut self, event: DriverEvent) -> Option<DriverEvent> {
        let DriverEvent::Garbled { bytes_count } = event else { return Some(event) };
        self.garbled_count += bytes_count;
        if !self.link.has_heard() {
            self.unread_count += bytes_count;
        }
        let is_quiet = self.garbled_ns.is_some_and(|told_ns| self.now_ns.saturating_sub(told_ns) < GARBLED_NS);
        if is_quiet {
            return None;
        }
        self.garbled_ns = Some(self.now_ns);
        Some(DriverEvent::Garbled { bytes_count: std::mem::take(&mut self.garbled_count) })
    }

    /// An earlier request has failed; the first such failure is reported, once.
    pub fn raise_fault(&mut self, error: Error) {
        self.fault.get_or_insert(error);
    }

    /// A command was not answered in time.
    pub fn raise_unanswered(&mut self, command: &'static str) {
        let (address, expected_ms) = (self.address(), self.config.reply_ms);
        self.raise_fault(Error::Unanswered { address, command, expected_ms });
    }

    /// A motion did not end in time.
    pub fn raise_unfinished(&mut self, command: &'static str) {
        let (address, expected_ms) = (self.address(), self.config.motion_ms);
        self.raise_fault(Error::Unanswered { address, command, expected_ms });
    }

    /// The gripper refused a command, in these words.
    pub fn raise_refused(&mut self, command: &'static str, got: impl Into<String>) {
        let address = self.address();
        self.raise_fault(Error::Refused { address, command, got: got.into() });
    }

    /// The refusal of homing while something is held.
    pub fn home_while_holding(&self) -> Error {
        let got = "something between the jaws; release it first".into();
        Error::Refused { address: self.address(), command: "home", got }
    }

    pub(super) fn set_time(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        if self.garbled_count > 0 {
            self.push_event(DriverEvent::Garbled { bytes_count: 0 }); // what is left, once it is due
        }
    }

    pub(super) fn linked(&mut self) {
        self.outgoing.clear();
        self.link.up(self.now_ns);
        self.fault = None;
        self.push_event(DriverEvent::Linked);
    }

    pub(super) fn unlinked(&mut self, why: &str) {
        self.outgoing.clear();
        if self.link.down(why) {
            self.has_lost_link = true;
            self.push_event(DriverEvent::Unlinked { why: why.into() });
        }
    }

    pub(super) fn leave_link(&mut self) {
        self.link.leave();
    }

    pub(super) fn may_send(&self) -> bool {
        self.link.may_send()
    }

    pub(super) fn check_link(&self) -> Result<(), Error> {
        self.link.check(self.now_ns).map_err(|problem| self.link_error(problem))
    }

    fn link_error(&self, problem: LinkProblem) -> Error {
        let address = self.address();
        match problem {
            LinkProblem::Down { why } => Error::Lost { address, why },
            LinkProblem::Silent { .. } if self.unread_count > 0 => {
                Error::Unread { address, bytes_count: self.unread_count }
            }
            LinkProblem::Silent { expected_ms, got_ms } => Error::Silent { address, expected_ms, got_ms },
        }
    }

    pub(super) fn permit_lowering(&mut self, permitted: bool) {
        self.lowering_permitted = permitted || self.config.lowering == Lowering::Allow;
    }

    /// The force that may be sent, N per finger: a number, within its range and, while something is held and lowering
    /// is not permitted, not below the last force or one on its way. A force that may be in effect is not lowered
    /// either: it is sent again.
    pub(super) fn admit(&mut self, asked_n: f64, on_its_way_n: Option<f64>) -> Result<f64, Error> {
        let Config { least_n, most_n, .. } = self.config;
        let Some(mut given_n) = self.config.admitted_n(asked_n) else {
            return Err(Error::Force { address: self.address(), least_n, most_n, got_n: asked_n });
        };
        if self.seems_to_hold() && !self.lowering_permitted {
            let Some(known_n) = self.gripper.target_n.or(self.gripper.force_n) else {
                let expected = "the force it holds with (or a release, or lowering = \"allow\")";
                return Err(Error::NotReady { address: self.address(), expected });
            };
            let from_n = on_its_way_n.map_or(known_n, |n| self.config.settable_n(n).max(known_n));
            if self.config.settable_n(given_n) < from_n - SAME_FORCE_N {
                return Err(Error::Lowering { address: self.address(), from_n, to_n: given_n });
            }
            // Steps below the resolution must not add up.
            if self.config.settable_n(given_n) < from_n {
                given_n = from_n.min(most_n);
            }
            given_n = self.doubted_n.map_or(given_n, |n| n.max(given_n));
        }
        let is_clamped = (given_n - asked_n).abs() > SAME_FORCE_N;
        if is_clamped && self.clamped_n != Some(asked_n) {
            self.push_event(DriverEvent::Clamped { asked_n, given_n });
        }
        self.clamped_n = is_clamped.then_some(asked_n);
        Ok(given_n)
    }

    /// The newest state, or what is wrong.
    pub(super) fn report(&mut self) -> Result<GripperState, Error> {
        self.link.check_heard(self.now_ns).map_err(|problem| self.link_error(problem))?;
        match self.fault.take() {
            Some(fault) => Err(fault),
            None => {
                let Config { force_error_n, force_error_fraction, .. } = self.config;
                let error_n = |force_n: f64| force_error_n + force_error_fraction * force_n.abs();
                Ok(GripperState { force_error_n: self.gripper.pressed_n().map(error_n), ..self.gripper })
            }
        }
    }

    pub(super) fn next_event(&mut self) -> Option<DriverEvent> {
        self.events.pop_front()
    }
}
