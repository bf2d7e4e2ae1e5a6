//! Faults of gripper and wrist: raised, waited for, cleared.
//!
//! ```text
//!   raise ----------> current: the wrist is paused, the force is kept
//!     | no more fault for 0.5 s: cleared        | 10 s after it began: the loop ends
//! ```

use crate::port::{
    GripCommand, GripperError, GripperErrorKind, GripperState, Jaws, LONGEST_TIME_TO_LIVE_NS, WristError,
    WristErrorKind, WristMotion, WristState,
};
use crate::task::{Phase, TaskStep};
use std::borrow::Cow;
use std::fmt;

/// Longest wait for a gripper or wrist with a fault, ns: enough to plug a cable back in.
const FAULT_TIMEOUT_NS: u64 = 10_000_000_000;

/// Time without a fault after which the wrist may move again, ns.
const CLEAR_AFTER_NS: u64 = 500_000_000;

/// Longest time for a measured force to reach the commanded one, for jaws at work to be without a hold, and for a wrist to
/// begin a motion, ns.
const FOLLOW_NS: u64 = 1_500_000_000;

/// Shortfall that is tolerated then: the largest of this force, N, this share of the command, and the error bound that
/// the driver states.
const SHORTFALL_N: f64 = 2.0;
const SHORTFALL_FRACTION: f64 = 0.2;

/// Share of the motion commanded in that time below which the wrist stands: less than an arm at its lowest speed makes
/// of it, more than the noise of an encoder.
const STANDS_FRACTION: f64 = 0.02;

/// Jaws wider by this than they held have opened, mm; jaws that only report `open`, as after a fast stop, have not, unless
/// they tell no opening and do so for [`FOLLOW_NS`].
const OPENED_MM: f64 = 1.0;

/// Kind of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FaultKind {
    /// Polling or commanding the gripper failed.
    Gripper(GripperErrorKind),
    /// Polling or commanding the wrist failed.
    Wrist(WristErrorKind),
    /// The gripper has stopped itself.
    GripperStopped,
    /// The gripper does not know where its jaws are.
    JawsUnknown,
    /// The measured force stays below the commanded one.
    ForceShortfall,
    /// The jaws held the object and do not report a hold any more.
    HoldEnded,
    /// The wrist accepts motions and does not move.
    WristStands,
    /// One of a recorded run; its events tell which.
    Recorded,
}

/// A fault of gripper or wrist.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The kind, for a caller to match on.
    pub kind: FaultKind,
    /// In words: which device, what was expected, what was got.
    pub text: Cow<'static, str>,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Fault {
    pub(super) fn of_gripper(error: GripperError) -> Self {
        Fault { kind: FaultKind::Gripper(error.kind), text: format!("gripper: {error}").into() }
    }

    pub(super) fn of_wrist(error: WristError) -> Self {
        Fault { kind: FaultKind::Wrist(error.kind), text: format!("wrist: {error}").into() }
    }

    pub(super) fn stopped() -> Self {
        let text = "gripper: it has stopped itself (fast stop); its force stays".into();
        Fault { kind: FaultKind::GripperStopped, text }
    }

    pub(super) fn jaws_unknown() -> Self {
        let text = "gripper: expected jaws that know where they are, got jaws unknown: not heard of yet, switched off \
                    and on (then take the object out and home it), or stopped by contact where none was expected (then \
                    release it)";
        Fault { kind: FaultKind::JawsUnknown, text: text.into() }
    }

    /// Whether it is the same fault, reported again with other numbers.
    pub fn is_like(&self, other: &Fault) -> bool {
        let words = |text: &'_ str| -> String { text.chars().filter(|c| !c.is_ascii_digit()).collect() };
        self.kind == other.kind && words(&self.text) == words(&other.text)
    }
}

/// The present fault.
#[derive(Debug, Default)]
pub(super) struct FaultLog {
    /// The newest fault, when the first of this series was raised, when the last, ns.
    current: Option<(Fault, u64, u64)>,
}

impl FaultLog {
    pub fn current(&self) -> Option<&Fault> {
        self.current.as_ref().map(|(fault, ..)| fault)
    }

    /// In a replay: whether there was a fault before this cycle.
    pub fn assume(&mut self, now_ns: u64, is_present: bool) {
        let fault = || Fault { kind: FaultKind::Recorded, text: "a recorded fault".into() };
        self.current = is_present.then(|| (fault(), now_ns, now_ns));
    }

    /// A fault in this cycle. When faults have lasted too long it is returned with their duration, ns.
    pub fn raise(&mut self, now_ns: u64, fault: Fault) -> Result<(), (Fault, u64)> {
        let since_ns = self.current.as_ref().map_or(now_ns, |(_, since_ns, _)| *since_ns);
        let waited_ns = now_ns.saturating_sub(since_ns);
        if waited_ns >= FAULT_TIMEOUT_NS {
            return Err((fault, waited_ns));
        }
        self.current = Some((fault, since_ns, now_ns));
        Ok(())
    }

    /// No fault in this cycle: a past one is cleared after a while.
    pub fn clear(&mut self, now_ns: u64) {
        self.current = self.current.take().filter(|(.., last_ns)| now_ns < last_ns + CLEAR_AFTER_NS);
    }
}

/// Checks whether the measured force reaches the commanded one.
#[derive(Debug, Default)]
pub(super) struct ForceShortfall {
    since_ns: Option<u64>,
}

impl ForceShortfall {
    /// The fault, when the force has stayed below the commanded one for too long.
    pub fn check(&mut self, now_ns: u64, state: &GripperState, step: &TaskStep) -> Option<Fault> {
        let short = match step.grip {
            GripCommand::Hold { force_n } => {
                let tolerated_n = SHORTFALL_N.max(SHORTFALL_FRACTION * force_n).max(state.force_error_n.unwrap_or(0.0));
                let least_n = force_n - tolerated_n;
                state.force_n.filter(|n| state.jaws == Jaws::Holding && *n < least_n).map(|got_n| (force_n, got_n))
            }
            GripCommand::Release => None,
        };
        let Some((asked_n, measured_n)) = short else {
            self.since_ns = None;
            return None;
        };
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        let is_late = now_ns.saturating_sub(since_ns) > FOLLOW_NS;
        is_late.then(|| Fault {
            kind: FaultKind::ForceShortfall,
            text: format!("gripper: expected {asked_n:.1} N per finger, measured {measured_n:.1} N for too long")
                .into(),
        })
    }
}

/// Checks whether jaws that are to hold, and held when the work began, hold still.
#[derive(Debug, Default)]
pub(super) struct HoldEnd {
    since_ns: Option<u64>,
    /// Opening with which they held last, mm.
    held_mm: Option<f64>,
    has_opened: bool,
    /// The link was lost since they held last.
    was_away: bool,
    /// The work had begun in the last cycle: at its end the object is still held.
    has_worked: bool,
}

impl HoldEnd {
    /// The fault, at once when the jaws have opened, and else when they have not held for too long.
    pub fn check(&mut self, now_ns: u64, state: &GripperState, step: &TaskStep) -> Option<Fault> {
        self.has_worked = match step.phase {
            Phase::Working | Phase::Waiting => true,
            Phase::Ended(_) => self.has_worked,
            Phase::Grasping | Phase::Releasing => false,
        };
        let is_to_hold = self.has_worked && step.grip != GripCommand::Release;
        if !is_to_hold || !matches!(state.jaws, Jaws::Open | Jaws::Closing) {
            let holds = state.jaws == Jaws::Holding;
            let held_mm = if holds { state.opening_mm } else { self.held_mm };
            let (was_away, has_worked) = (self.was_away && !holds, self.has_worked);
            *self = HoldEnd { held_mm, was_away, has_worked, ..HoldEnd::default() };
            return None;
        }
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        let is_late = now_ns.saturating_sub(since_ns) > FOLLOW_NS;
        let is_wider = match self.held_mm.zip(state.opening_mm) {
            Some((held_mm, mm)) => mm > held_mm + OPENED_MM,
            // A fast stop is over by then; while nobody looked, they may have been opened.
            None => is_late || self.was_away,
        };
        self.has_opened |= is_wider && state.jaws == Jaws::Open;
        (self.has_opened || is_late).then(|| Fault {
            kind: FaultKind::HoldEnded,
            text: format!("gripper: expected jaws that hold, got {}", state.jaws.name()).into(),
        })
    }

    /// The link to the gripper is lost.
    pub fn lose_sight(&mut self) {
        self.was_away = true;
    }

    /// Whether the jaws have opened: a grasp would close them on whatever is between them now.
    pub fn has_opened(&self) -> bool {
        self.has_opened
    }
}

/// Checks whether the wrist carries out the motions that it accepts.
#[derive(Debug, Default)]
pub(super) struct WristStandstill {
    /// Since when it has stood, ns, and where, rad or mm.
    since: Option<(u64, f64)>,
    checked_ns: u64,
    is_fault: bool,
}

impl WristStandstill {
    /// The fault, when it has stood for too long. `commanded`: the motion of the last cycle; `wanted`: that of this
    /// one. The wrist is paused because of the fault, which therefore lasts as long as the task wants to move it.
    pub fn check(
        &mut self,
        now_ns: u64,
        state: &WristState,
        commanded: Option<WristMotion>,
        wanted: WristMotion,
    ) -> Option<Fault> {
        let Some((position, rate_per_s)) = position_and_rate(state, wanted) else {
            *self = WristStandstill::default();
            return None;
        };
        // A motion that was not renewed, as while the gripper was away, has expired.
        let is_renewed =
            now_ns.saturating_sub(std::mem::replace(&mut self.checked_ns, now_ns)) <= LONGEST_TIME_TO_LIVE_NS;
        let was_to_move = is_renewed && commanded.is_some_and(|motion| position_and_rate(state, motion).is_some());
        let (since_ns, from) = self.since.filter(|_| was_to_move || self.is_fault).unwrap_or((now_ns, position));
        let elapsed_ns = now_ns.saturating_sub(since_ns);
        let moves = (position - from).abs() > STANDS_FRACTION * rate_per_s.abs() * FOLLOW_NS as f64 * 1e-9;
        self.since = Some(if moves { (now_ns, position) } else { (since_ns, from) });
        self.is_fault = !moves && elapsed_ns > FOLLOW_NS;
        self.is_fault
            .then(|| Fault { kind: FaultKind::WristStands, text: "wrist: expected a motion, but it stands".into() })
    }
}

/// Where the wrist is on the way of this motion, rad or mm, and the rate; None for a motion that leads nowhere.
fn position_and_rate(state: &WristState, motion: WristMotion) -> Option<(f64, f64)> {
    match motion {
        WristMotion::Turn { rate_rad_per_s, most_rad } if most_rad > 0.0 => Some((state.angle_rad, rate_rad_per_s)),
        WristMotion::Lower { rate_mm_per_s, most_mm } if most_mm > 0.0 => Some((state.lowered_mm, rate_mm_per_s)),
        _ => None,
    }
}
