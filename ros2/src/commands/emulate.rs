//! `slipbound-ros2 emulate`: a gripper and a wrist as separate nodes.

use super::{Done, domain_id};
use ros2_client::action::{ActionServer, ActionServerQosPolicies, SendGoalResponse};
use ros2_client::{ActionTypeName, Name, Publisher};
use slipbound::plant::{JawCommand, JawDrive, JawSettings, WristDrive};
use slipbound::port::{WristCommand, WristMotion};
use slipbound::setting::SettingError;
use slipbound_rig::link::now_ns;
use slipbound_ros2::error::Error;
use slipbound_ros2::msg::{
    GripCommand, GripperCommandGoal, GripperCommandResult, GripperState, Header, JointState, WristCommand as WristSaid,
    WristState,
};
use slipbound_ros2::ros::{Inbox, LAST_RELIABLE, LATCHED, RELIABLE, Ros, SENSOR_DATA, ServiceMapping, stamp};
use std::fs::File;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

/// Time between two states: 50 a second.
const PERIOD: Duration = Duration::from_millis(20);

/// Opening of the open jaws, mm.
const OPEN_MM: f64 = 110.0;

/// The arguments of `slipbound-ros2 emulate`.
#[derive(Debug, clap::Args)]
pub struct Emulate {
    /// Base name of the gripper's and the wrist's topics: BASE/gripper/command and so on
    #[arg(long, default_value = "/hand")]
    base: String,
    /// Width of what is between the jaws, mm
    #[arg(long, value_name = "MM", default_value_t = 28.0)]
    width_mm: f64,
    /// Begins holding with this force, N per finger, as jaws that were left so
    #[arg(long, value_name = "N")]
    holding_n: Option<f64>,
    /// Also an action server of this name, with the joint `finger_joint` in /joint_states
    #[arg(long, value_name = "NAME")]
    action: Option<String>,
    /// How the action's services are laid out on DDS: that of the client's middleware
    #[arg(long, value_name = "MAPPING", default_value = "enhanced")]
    service_mapping: ServiceMapping,
    /// A line for every state: force_n target_n angle_rad lowered_mm moving
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

/// The gripper's action, and the joint's state beside it. Positions are openings in m.
struct Action {
    server: ActionServer<GripperCommandGoal, GripperCommandResult, GripperCommandResult>,
    joints: Publisher<JointState>,
}

impl Action {
    fn new(ros: &mut Ros, name: &Name) -> Result<Self, Box<dyn std::error::Error>> {
        let qos = ActionServerQosPolicies {
            goal_service: RELIABLE,
            result_service: RELIABLE,
            cancel_service: RELIABLE,
            feedback_publisher: RELIABLE,
            status_publisher: LATCHED,
        };
        let kind = ActionTypeName::new("control_msgs", "GripperCommand");
        let services = ros.services();
        let server = ros.node().create_action_server(services, name, &kind, qos)?;
        Ok(Action { server, joints: ros.publisher("/joint_states", &SENSOR_DATA)? })
    }

    /// The newest goal, accepted.
    fn goal(&mut self) -> Option<JawCommand> {
        let mut newest = None;
        while let Ok(Some((id, request))) = self.server.receive_goal() {
            let accepted = request.goal.max_effort.is_finite();
            let stamp = ros2_client::builtin_interfaces::Time::now();
            let answered = self.server.send_goal_response(id, SendGoalResponse { accepted, stamp });
            if answered.is_ok() && accepted {
                let force_n = request.goal.max_effort;
                let opens = request.goal.position > 0.5e-3 * OPEN_MM;
                newest = Some(match opens {
                    true => JawCommand::MoveTo { opening_mm: OPEN_MM },
                    false => JawCommand::Grasp { force_n },
                });
            }
        }
        newest
    }
}

/// The node.
struct EmulatedHand {
    jaws: JawDrive,
    wrist: WristDrive,
    commands: Inbox<GripCommand>,
    states: Publisher<GripperState>,
    motions: Inbox<WristSaid>,
    wrist_states: Publisher<WristState>,
    action: Option<Action>,
}

impl Emulate {
    /// Checks the numbers, and the name of the action, which it returns.
    fn check(&self) -> Result<Option<Name>, Error> {
        let wrong = |key: &str, expected: String, got: f64| {
            Err(Error::from(SettingError { key: key.into(), expected, got: got.to_string() }))
        };
        if !(0.0..=OPEN_MM).contains(&self.width_mm) {
            return wrong("--width-mm", format!("0 to {OPEN_MM} mm"), self.width_mm);
        }
        if let Some(force_n) = self.holding_n.filter(|force_n| !(force_n.is_finite() && *force_n > 0.0)) {
            return wrong("--holding-n", "a finite number above 0".into(), force_n);
        }
        let parsed = |name: &String| {
            let refused = |why| Error::Name { key: "--action".into(), name: name.clone(), why };
            Name::parse(name).map_err(|e| refused(format!("{e:?}")))
        };
        self.action.as_ref().map(parsed).transpose()
    }

    /// Runs until it is stopped.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let domain_id = domain_id()?;
        let action = self.check()?;
        let created = |path: &PathBuf| File::create(path).map_err(|e| format!("{}: cannot write: {e}", path.display()));
        let mut log = self.log.as_ref().map(created).transpose()?;
        let mut ros = Ros::new("/", "slipbound_emulate", domain_id)?.with_services(self.service_mapping);
        let base = &self.base;
        let mut hand = EmulatedHand {
            jaws: JawDrive::new(JawSettings::default()).map_err(Error::from)?,
            wrist: WristDrive::new(),
            commands: ros.inbox(&format!("{base}/gripper/command"), &LAST_RELIABLE)?,
            states: ros.publisher(&format!("{base}/gripper/state"), &SENSOR_DATA)?,
            motions: ros.inbox(&format!("{base}/wrist/command"), &LAST_RELIABLE)?,
            wrist_states: ros.publisher(&format!("{base}/wrist/state"), &SENSOR_DATA)?,
            action: action.map(|name| Action::new(&mut ros, &name)).transpose()?,
        };
        let began_ns = now_ns();
        // Jaws that were left holding have already held for long when the node starts.
        let passed_ns = match self.holding_n {
            Some(force_n) => {
                hand.jaws.command(JawCommand::Grasp { force_n });
                const LONG_NS: u64 = 10_000_000_000;
                hand.jaws.advance_to(LONG_NS, Some(self.width_mm));
                LONG_NS
            }
            None => 0,
        };
        println!("{base}/gripper and {base}/wrist are there; Ctrl-C ends it");
        while !stop.load(Ordering::Relaxed) {
            let line = hand.step(now_ns() - began_ns + passed_ns, self.width_mm)?;
            if let Some(log) = &mut log {
                writeln!(log, "{line}")?;
            }
            sleep(PERIOD);
        }
        Ok(())
    }
}

impl EmulatedHand {
    /// Receives commands, advances the time, publishes the states; returns the line for the log.
    fn step(&mut self, now_ns: u64, width_mm: f64) -> Result<String, Box<dyn std::error::Error>> {
        if let Some(command) = self.commands.newest() {
            match command.jaws.as_str() {
                "hold" => self.jaws.command(JawCommand::Grasp { force_n: command.force_n }),
                "release" => self.jaws.command(JawCommand::MoveTo { opening_mm: OPEN_MM }),
                _ => {} // an unknown command: the jaws stay as they are
            }
        }
        if let Some(command) = self.action.as_mut().and_then(Action::goal) {
            self.jaws.command(command);
        }
        self.jaws.advance_to(now_ns, Some(width_mm));
        self.wrist.advance_to(now_ns);
        if let Some(said) = self.motions.newest() {
            let motion = match said.motion.as_str() {
                "turn" => WristMotion::Turn { rate_rad_per_s: said.rate_rad_per_s, most_rad: said.most_rad },
                "lower" => WristMotion::Lower { rate_mm_per_s: said.rate_mm_per_s, most_mm: said.most_mm },
                _ => WristMotion::Pause,
            };
            self.wrist.command(WristCommand { motion, time_to_live_ns: said.time_to_live_ns });
        }
        let header = || Header { stamp: stamp(), frame_id: String::new() };
        let (touches, target_n, force_n) = (self.jaws.touches(), self.jaws.target_n(), self.jaws.force_n());
        let jaws = match (target_n, touches) {
            (Some(_), true) => "holding",
            (Some(_), false) => "closing",
            (None, _) => "open",
        };
        let opening_mm = self.jaws.opening_mm();
        self.states.publish(GripperState {
            header: header(),
            force_n,
            force_error_n: f64::NAN,
            target_n: target_n.unwrap_or(f64::NAN),
            opening_mm,
            jaws: jaws.into(),
        })?;
        let wrist = self.wrist.state();
        let (angle_rad, lowered_mm, moving) = (wrist.angle_rad, wrist.lowered_mm, wrist.moving);
        self.wrist_states.publish(WristState { header: header(), angle_rad, lowered_mm, moving })?;
        if let Some(action) = &self.action {
            let (name, position) = (vec!["finger_joint".into()], vec![opening_mm * 1e-3]);
            let state = JointState { header: header(), name, position, velocity: vec![0.0], effort: vec![force_n] };
            action.joints.publish(state)?;
        }
        let target_n = target_n.unwrap_or(0.0);
        Ok(format!("{force_n:.3} {target_n:.3} {angle_rad:.4} {lowered_mm:.3} {moving}"))
    }
}
