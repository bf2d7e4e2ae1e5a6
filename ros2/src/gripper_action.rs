//! A gripper behind a `control_msgs/action/GripperCommand` server, as `ros2_control` has it, with the joint's state beside it.
//!
//! ```text
//!   control loop --command--> goal { position, max_effort: N per finger }   when the force or the direction changes
//!                <--poll----- /joint_states: position, effort               10 Hz or more; 0.3 s of silence is a fault
//! ```
//!
//! The server says nothing between two goals, so the joint's state is the sign of life. A server that takes no goal within
//! half a second, or refuses it, is a fault; the gripper keeps the force it has, and the goal is sent again.

use crate::error::Error;
use crate::gripper::checked_force_n;
use crate::heard::Heard;
use crate::msg::{GripperCommandGoal, GripperCommandResult, JointState};
use crate::ros::{Inbox, RELIABLE, Ros, SENSOR_DATA};
use ros2_client::action::{ActionClient, ActionClientQosPolicies};
use ros2_client::service::RmwRequestId;
use ros2_client::{ActionTypeName, Name};
use serde::Deserialize;
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws};
use slipbound_rig::link::now_ns;

/// Longest wait for a goal to be taken, ns.
const ANSWER_NS: u64 = 500_000_000;

/// Time in which the joint may not move for the jaws to stand still, ns.
const STILL_NS: u64 = 200_000_000;

/// What counts as no motion, and as at the end of the way: a share of the way.
const STILL_FRACTION: f64 = 0.005;
const END_FRACTION: f64 = 0.02;

/// Two efforts closer than this are the same goal, N.
const SAME_N: f64 = 1e-3;

/// Where the gripper is and what its numbers mean.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionGripperConfig {
    /// Name of the action.
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
    /// Whether the effort that the joint reports is N per finger: then it is taken for the force.
    #[serde(default)]
    pub effort_is_force: bool,
}

fn joint_states() -> String {
    "/joint_states".into()
}

/// What the jaws were told.
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
    heard: Heard,
    /// Sent, not yet taken: the request, what it asks for, when it was sent.
    pending: Option<(RmwRequestId, Goal, u64)>,
    taken: Option<Goal>,
    /// The last failure of a goal, told once.
    fault: Option<GripperError>,
    position: f64,
    effort: Option<f64>,
    /// Where it stands, and since when, ns.
    still: Option<(f64, u64)>,
    has_held: bool,
}

impl ActionGripper {
    /// Joins the action, in the mapping that the node's services have ([`Ros::with_services`]). Waits for nothing.
    pub fn new(ros: &mut Ros, config: ActionGripperConfig) -> Result<Self, Error> {
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
            heard: Heard::new(&format!("{} of {}", config.joint, config.joint_states)),
            config,
            pending: None,
            taken: None,
            fault: None,
            position: f64::NAN,
            effort: None,
            still: None,
            has_held: false,
        })
    }

    fn hear_joint(&mut self, now_ns: u64) {
        // Several nodes may share the topic: each message may hold other joints.
        while let Ok(Some(received)) = self.joints.take() {
            let joints = received.message;
            let Some(at) = joints.name.iter().position(|name| *name == self.config.joint) else { continue };
            let Some(&position) = joints.position.get(at).filter(|p| p.is_finite()) else { continue };
            self.heard.heard(now_ns);
            self.position = position;
            self.effort = joints.effort.get(at).copied().filter(|effort| effort.is_finite());
            let way = (self.config.open_position - self.config.closed_position).abs();
            if self.still.is_none_or(|(at, _)| (at - position).abs() > STILL_FRACTION * way) {
                self.still = Some((position, now_ns));
            }
        }
    }

    fn hear_answer(&mut self, now_ns: u64) {
        let Some((id, goal, sent_ns)) = self.pending else { return };
        match self.client.receive_goal_response(id) {
            Ok(Some(answer)) if answer.accepted => {
                // The jaws stood until now: that they stand says nothing yet of what they hold.
                if self.taken.is_none_or(|taken| taken.is_hold != goal.is_hold) {
                    self.still = Some((self.position, now_ns));
                }
                (self.pending, self.taken) = (None, Some(goal));
            }
            Ok(Some(_)) => {
                let text = format!("{}: expected goal {goal:?} to be taken, got a refusal", self.config.action);
                (self.pending, self.fault) = (None, Some(GripperError::new(GripperErrorKind::Refused, text)));
            }
            Ok(None) if now_ns.saturating_sub(sent_ns) <= ANSWER_NS => {}
            Ok(None) => {
                let text = format!("{}: expected an answer within 500 ms, got none", self.config.action);
                (self.pending, self.fault) = (None, Some(GripperError::new(GripperErrorKind::Unanswered, text)));
            }
            Err(e) => {
                (self.pending, self.fault) = (None, Some(GripperError::new(GripperErrorKind::Link, e.to_string())));
            }
        }
    }

    fn jaws(&self, now_ns: u64) -> Jaws {
        let (open, closed) = (self.config.open_position, self.config.closed_position);
        let from_closed = (self.position - closed) / (open - closed);
        let stands = self.still.is_some_and(|(_, since_ns)| now_ns.saturating_sub(since_ns) >= STILL_NS);
        match self.taken {
            Some(goal) if goal.is_hold => match () {
                // Shut, or wide open although nobody told it so: what it held is gone.
                _ if self.has_held && (from_closed <= END_FRACTION || from_closed >= 1.0 - END_FRACTION) => Jaws::Lost,
                _ if from_closed <= END_FRACTION => Jaws::Nothing,
                // It goes on holding while the force changes, also where the joint gives a little.
                _ if self.has_held || (stands && from_closed < 1.0 - END_FRACTION) => Jaws::Holding,
                _ => Jaws::Closing,
            },
            Some(_) => Jaws::Open,
            None if from_closed >= 1.0 - END_FRACTION => Jaws::Open,
            None => Jaws::Unknown,
        }
    }
}

impl Gripper for ActionGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let goal = match command {
            GripCommand::Hold { force_n } => Goal { is_hold: true, effort_n: checked_force_n(force_n)? },
            // Nothing is in the way of the jaws: whatever effort they have.
            GripCommand::Release => Goal { is_hold: false, effort_n: 0.0 },
        };
        self.poll_io();
        let lost = |why: String| GripperError::new(GripperErrorKind::Link, why);
        self.heard.check(now_ns()).map_err(lost)?;
        let asked = self.pending.map(|(_, goal, _)| goal).or(self.taken);
        if asked.is_some_and(|asked| asked.is_like(&goal)) {
            return Ok(());
        }
        let position = if goal.is_hold { self.config.closed_position } else { self.config.open_position };
        let sent = self.client.send_goal(GripperCommandGoal { position, max_effort: goal.effort_n });
        let (id, _) = sent.map_err(|e| lost(e.to_string()))?;
        self.pending = Some((id, goal, now_ns()));
        self.has_held &= goal.is_hold;
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        self.poll_io();
        let now_ns = now_ns();
        self.heard.check(now_ns).map_err(|why| GripperError::new(GripperErrorKind::Link, why))?;
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        let jaws = self.jaws(now_ns);
        self.has_held |= jaws == Jaws::Holding;
        let (open, closed) = (self.config.open_position, self.config.closed_position);
        Ok(GripperState {
            time_ns: now_ns,
            force_n: self.effort.filter(|_| self.config.effort_is_force).map(f64::abs),
            force_error_n: None,
            target_n: self.taken.filter(|goal| goal.is_hold).map(|goal| goal.effort_n),
            opening_mm: Some(self.config.opening_mm * (self.position - closed) / (open - closed)),
            jaws,
        })
    }

    fn poll_io(&mut self) {
        let now_ns = now_ns();
        self.hear_joint(now_ns);
        self.hear_answer(now_ns);
    }

    fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.heard.next_event()
    }
}
