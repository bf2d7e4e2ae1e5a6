//! A gripper behind a `control_msgs/action/GripperCommand` server, as in `ros2_control`, with the joint's state beside
//! it.
//!
//! ```text
//!   control loop --command--> goal { position, max_effort: N per finger }   when the force or the direction changes,
//!                                                                           and when the active goal is unknown
//!                <--poll----- /joint_states: position, effort               10 Hz or more; 0.3 s of silence is a fault
//! ```
//!
//! The server is silent between two goals, so the joint's state is the heartbeat. A server that does not accept a goal
//! within half a second, or rejects it, is a fault; the gripper keeps its force, and the goal is sent again. While a
//! goal waits for its answer only the newest further goal is queued. After a goal without an answer, or a silence, the
//! active goal is unknown: no target is reported, and the goal is sent again whatever was accepted before.

use crate::error::Error;
use crate::gripper::checked_force_n;
use crate::heartbeat::Heartbeat;
use crate::msg::{GripperCommandGoal, GripperCommandResult, JointState};
use crate::ros::{Inbox, RELIABLE, Ros, SENSOR_DATA};
use ros2_client::action::{ActionClient, ActionClientQosPolicies};
use ros2_client::service::RmwRequestId;
use ros2_client::{ActionTypeName, Name};
use serde::Deserialize;
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws};
use slipbound::setting::SettingError;
use slipbound_rig::link::now_ns;

/// Longest wait for a goal to be accepted, ns.
const ANSWER_NS: u64 = 500_000_000;

/// Time after which an unanswered goal is reported again, ns: sooner than the loop clears a fault.
const REPORT_AGAIN_NS: u64 = 250_000_000;

/// Time without motion after which the jaws count as standing still, ns.
const STILL_NS: u64 = 200_000_000;

/// Motion that counts as none, and distance that counts as at the end of travel: a share of the travel.
const STILL_FRACTION: f64 = 0.005;
const END_FRACTION: f64 = 0.02;

/// Effort with which jaws open that have not held anything yet, N. With none, an effort interface would not move.
const OPENING_EFFORT_N: f64 = 10.0;

/// Two efforts closer than this are the same goal, N.
const SAME_N: f64 = 1e-3;

/// Names of the gripper's action and joint, and the meaning of its numbers.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionGripperConfig {
    /// Name of the action: not a key of the table, but part of the gripper's address.
    #[serde(skip)]
    pub action: String,
    /// Topic of the joint's state.
    #[serde(default = "joint_states")]
    pub joint_states: String,
    /// Name of the joint.
    pub joint: String,
    /// Its position with the jaws closed on nothing, m or rad.
    pub closed_position: f64,
    /// Its position with the jaws open, m or rad.
    pub open_position: f64,
    /// Distance between the open fingertips, mm; it is taken to be proportional to the position.
    pub opening_mm: f64,
    /// Whether the effort that the joint reports is N per finger: then it is used as the force.
    #[serde(default)]
    pub effort_is_force: bool,
}

impl ActionGripperConfig {
    /// Rejects invalid numbers, and jaws without travel.
    pub(crate) fn check(&self) -> Result<(), SettingError> {
        let refuse = |key: &str, expected: &str, got: f64| {
            Err(SettingError { key: key.into(), expected: expected.into(), got: got.to_string() })
        };
        let (closed, open) = (self.closed_position, self.open_position);
        if !closed.is_finite() {
            return refuse("closed_position", "a finite number, m or rad", closed);
        }
        if !open.is_finite() || open == closed {
            return refuse("open_position", &format!("a finite number other than closed_position, {closed}"), open);
        }
        if !(self.opening_mm.is_finite() && self.opening_mm > 0.0) {
            return refuse("opening_mm", "a finite number above 0", self.opening_mm);
        }
        Ok(())
    }
}

fn joint_states() -> String {
    "/joint_states".into()
}

/// A command to the jaws.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Goal {
    is_hold: bool,
    effort_n: f64,
}

impl Goal {
    fn is_like(&self, other: &Goal) -> bool {
        self.is_hold == other.is_hold && (self.effort_n - other.effort_n).abs() < SAME_N
    }
}

/// The gripper behind an action server.
pub struct ActionGripper {
    config: ActionGripperConfig,
    client: ActionClient<GripperCommandGoal, GripperCommandResult, GripperCommandResult>,
    joints: Inbox<JointState>,
    heartbeat: Heartbeat,
    /// Sent, not yet accepted: the request, its goal, the time it was sent.
    pending: Option<(RmwRequestId, Goal, u64)>,
    /// The newest goal requested meanwhile.
    next: Option<Goal>,
    taken: Option<Goal>,
    /// Whether the last accepted goal is certain to hold: not after a silence, nor after a goal without an answer.
    is_sure: bool,
    /// When the missing answer was last reported, ns; None once a goal is answered.
    unanswered_ns: Option<u64>,
    /// The last failure of a goal, reported once.
    fault: Option<GripperError>,
    position: f64,
    effort: Option<f64>,
    /// Where the joint stands, and since when, ns.
    still: Option<(f64, u64)>,
    /// Whether the last command was to open.
    opens: bool,
    /// Where the joint stood when the goal to open was accepted.
    opened_from: f64,
    /// The last effort to hold with, N: the jaws open with it, too.
    last_effort_n: f64,
    has_held: bool,
}

impl ActionGripper {
    /// Joins the action, in the mapping that the node's services have ([`Ros::with_services`]). Waits for nothing.
    pub fn new(ros: &mut Ros, config: ActionGripperConfig) -> Result<Self, Error> {
        config.check()?;
        let name = Name::parse(&config.action).map_err(|e| Error::Name {
            key: "action".into(),
            name: config.action.clone(),
            why: format!("{e:?}"),
        })?;
        let qos = ActionClientQosPolicies {
            goal_service: RELIABLE,
            result_service: RELIABLE,
            cancel_service: RELIABLE,
            feedback_subscription: RELIABLE,
            status_subscription: RELIABLE,
        };
        let kind = ActionTypeName::new("control_msgs", "GripperCommand");
        let services = ros.services();
        let client = ros
            .node()
            .create_action_client(services, &name, &kind, qos)
            .map_err(|e| Error::middleware(format!("action {}", config.action), e))?;
        Ok(ActionGripper {
            client,
            joints: ros.inbox(&config.joint_states, &SENSOR_DATA)?,
            heartbeat: Heartbeat::new(&format!("{} of {}", config.joint, config.joint_states)),
            config,
            pending: None,
            next: None,
            taken: None,
            is_sure: false,
            unanswered_ns: None,
            fault: None,
            position: f64::NAN,
            effort: None,
            still: None,
            opens: false,
            opened_from: f64::NAN,
            last_effort_n: OPENING_EFFORT_N,
            has_held: false,
        })
    }

    fn read_joint(&mut self, now_ns: u64) {
        // A server that returns after a silence may have restarted.
        self.is_sure &= !self.heartbeat.is_silent(now_ns);
        // Several nodes may share the topic: each message may contain other joints.
        while let Ok(Some(received)) = self.joints.take() {
            let joints = received.message;
            let Some(at) = joints.name.iter().position(|name| *name == self.config.joint) else { continue };
            let Some(&position) = joints.position.get(at).filter(|p| p.is_finite()) else { continue };
            self.heartbeat.received(now_ns);
            self.position = position;
            self.effort = joints.effort.get(at).copied().filter(|effort| effort.is_finite());
            let way = (self.config.open_position - self.config.closed_position).abs();
            if self.still.is_none_or(|(at, _)| (at - position).abs() > STILL_FRACTION * way) {
                self.still = Some((position, now_ns));
            }
        }
    }

    fn read_answer(&mut self, now_ns: u64) {
        let Some((id, goal, sent_ns)) = self.pending else { return };
        match self.client.receive_goal_response(id) {
            Ok(Some(answer)) if answer.accepted => {
                self.take(goal, now_ns);
                (self.is_sure, self.unanswered_ns) = (true, None);
            }
            Ok(Some(_)) => {
                let text = format!("{}: expected goal {goal:?} to be taken, got a refusal", self.config.action);
                self.fault = Some(GripperError::new(GripperErrorKind::Refused, text));
                self.unanswered_ns = None;
            }
            Ok(None) if now_ns.saturating_sub(sent_ns) <= ANSWER_NS => return,
            Ok(None) => {
                let fault = self.unanswered();
                self.doubt(goal, fault, now_ns);
            }
            Err(e) => self.doubt(goal, GripperError::new(GripperErrorKind::Link, e.to_string()), now_ns),
        }
        self.pending = None;
        // The server may be gone: then the loop sends the command again.
        if let Some(next) = self.next.take().filter(|next| !self.heartbeat.is_silent(now_ns) && !self.holds(next))
            && let Err(e) = self.send(next, now_ns)
        {
            self.doubt(next, e, now_ns);
        }
    }

    /// The jaws execute this goal from now on.
    fn take(&mut self, goal: Goal, now_ns: u64) {
        // The jaws stood still until now, which says nothing yet about a held object.
        if self.taken.is_none_or(|taken| taken.is_hold != goal.is_hold) {
            self.still = Some((self.position, now_ns));
            self.opened_from = self.position;
        }
        self.taken = Some(goal);
    }

    /// It is unknown whether the jaws execute this goal. If they may be closing, it is assumed: then the loop continues
    /// to ask.
    fn doubt(&mut self, goal: Goal, fault: GripperError, now_ns: u64) {
        if goal.is_hold && self.taken.is_none_or(|taken| !taken.is_hold) {
            self.take(goal, now_ns);
        }
        (self.is_sure, self.fault) = (false, Some(fault));
    }

    fn unanswered(&self) -> GripperError {
        let text = format!("{}: expected an answer within 500 ms, got none", self.config.action);
        GripperError::new(GripperErrorKind::Unanswered, text)
    }

    /// Whether the jaws are known to execute this goal already.
    fn holds(&self, goal: &Goal) -> bool {
        self.is_sure && self.taken.is_some_and(|taken| taken.is_like(goal))
    }

    fn send(&mut self, goal: Goal, now_ns: u64) -> Result<(), GripperError> {
        let position = if goal.is_hold { self.config.closed_position } else { self.config.open_position };
        let sent = self.client.send_goal(GripperCommandGoal { position, max_effort: goal.effort_n });
        let (id, _) = sent.map_err(|e| GripperError::new(GripperErrorKind::Link, e.to_string()))?;
        self.pending = Some((id, goal, now_ns));
        Ok(())
    }

    /// Why no first goal can be sent: the jaws are to be open before it.
    fn not_open(&self) -> String {
        let ActionGripperConfig { joint, joint_states, open_position: open, closed_position: closed, .. } =
            &self.config;
        let limit = open - END_FRACTION * (open - closed);
        let side = if open > closed { "more" } else { "less" };
        format!(
            "{joint} of {joint_states}: expected {limit:.4} or {side} (control.action.open_position {open}) to begin with, \
             got {:.4}",
            self.position
        )
    }

    /// Whether the joint has moved towards its open position since the goal to open was accepted.
    fn has_moved_open(&self) -> bool {
        let way = self.config.open_position - self.config.closed_position;
        (self.position - self.opened_from) / way > END_FRACTION
    }

    fn jaws(&self, now_ns: u64) -> Jaws {
        let (open, closed) = (self.config.open_position, self.config.closed_position);
        let from_closed = (self.position - closed) / (open - closed);
        let stands = self.still.is_some_and(|(_, since_ns)| now_ns.saturating_sub(since_ns) >= STILL_NS);
        match self.taken {
            Some(goal) if goal.is_hold => match () {
                // Open, as commanded, with or without an answer.
                _ if self.opens && from_closed >= 1.0 - END_FRACTION => Jaws::Open,
                // Closed, or wide open without a command: the held object is gone.
                _ if self.has_held && (from_closed <= END_FRACTION || from_closed >= 1.0 - END_FRACTION) => Jaws::Lost,
                _ if from_closed <= END_FRACTION => Jaws::Nothing,
                // It continues to hold while the force changes, also where the joint yields a little.
                _ if self.has_held || (stands && from_closed < 1.0 - END_FRACTION) => Jaws::Holding,
                _ => Jaws::Closing,
            },
            // An accepted goal does not show that the jaws move.
            Some(_) if from_closed >= 1.0 - END_FRACTION || self.has_moved_open() => Jaws::Open,
            Some(_) => Jaws::Holding,
            None if from_closed >= 1.0 - END_FRACTION => Jaws::Open,
            None => Jaws::Unknown,
        }
    }
}

impl Gripper for ActionGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let goal = match command {
            GripCommand::Hold { force_n } => Goal { is_hold: true, effort_n: checked_force_n(force_n)? },
            GripCommand::Release => Goal { is_hold: false, effort_n: self.last_effort_n },
        };
        self.last_effort_n = goal.effort_n;
        self.poll_io();
        let now_ns = now_ns();
        self.heartbeat.check(now_ns).map_err(|why| GripperError::new(GripperErrorKind::Link, why))?;
        (self.opens, self.has_held) = (!goal.is_hold, self.has_held && goal.is_hold);
        match self.pending {
            // One goal at a time: with a new request in every cycle a slow server would never be detected.
            Some((_, pending, _)) => self.next = Some(goal).filter(|goal| !pending.is_like(goal)),
            None if self.holds(&goal) => {}
            None => self.send(goal, now_ns)?,
        }
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        self.poll_io();
        let now_ns = now_ns();
        self.heartbeat.check(now_ns).map_err(|why| GripperError::new(GripperErrorKind::Link, why))?;
        let is_due = |reported_ns: u64| now_ns.saturating_sub(reported_ns) >= REPORT_AGAIN_NS;
        let again = self.unanswered_ns.is_some_and(is_due).then(|| self.unanswered());
        if let Some(fault) = self.fault.take().or(again) {
            let was_answered = fault.kind == GripperErrorKind::Refused;
            self.unanswered_ns = Some(now_ns).filter(|_| !was_answered);
            return Err(fault);
        }
        let jaws = self.jaws(now_ns);
        if jaws == Jaws::Unknown && self.pending.is_none() {
            return Err(GripperError::new(GripperErrorKind::NotReady, self.not_open()));
        }
        self.has_held |= jaws == Jaws::Holding && !self.opens;
        let (open, closed) = (self.config.open_position, self.config.closed_position);
        Ok(GripperState {
            time_ns: now_ns,
            force_n: self.effort.filter(|_| self.config.effort_is_force).map(f64::abs),
            force_error_n: None,
            target_n: self.taken.filter(|goal| goal.is_hold && self.is_sure).map(|goal| goal.effort_n),
            opening_mm: Some(self.config.opening_mm * (self.position - closed) / (open - closed)),
            jaws,
        })
    }

    fn poll_io(&mut self) {
        let now_ns = now_ns();
        self.read_joint(now_ns);
        self.read_answer(now_ns);
    }

    fn is_busy(&self) -> bool {
        self.pending.is_some() || self.next.is_some()
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.heartbeat.next_event()
    }
}
