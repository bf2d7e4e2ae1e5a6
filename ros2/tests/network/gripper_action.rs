//! State of a gripper behind an action when the server is late, silent, or restarted.

use crate::process::{LONGEST_WAIT, domain_id};
use ros2_client::action::{ActionServer, ActionServerQosPolicies, SendGoalResponse};
use ros2_client::{ActionTypeName, Name};
use slipbound::port::{GripCommand, Gripper, GripperErrorKind, GripperState, Jaws};
use slipbound_ros2::error::Error;
use slipbound_ros2::gripper_action::{ActionGripper, ActionGripperConfig};
use slipbound_ros2::msg::{GripperCommandGoal, GripperCommandResult, Header, JointState};
use slipbound_ros2::ros::{LATCHED, RELIABLE, Ros, SENSOR_DATA, stamp};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

/// Time between two cycles.
const CYCLE: Duration = Duration::from_millis(33);

/// Delay of the answer to a goal of this force, N; None: never.
type Answers = fn(f64) -> Option<Duration>;

/// A server that executes every goal at once and answers after a delay. Its joint is open before the first goal, closes to
/// 28 mm with it, and stands where the test puts it.
pub struct Server {
    stop: Arc<AtomicBool>,
    goals_n: Arc<Mutex<Vec<f64>>>,
    position: Arc<Mutex<f64>>,
    thread: Option<thread::JoinHandle<()>>,
}

impl Server {
    pub fn start(name: &'static str, domain_id: u16, answers: Answers) -> Self {
        let (stop, goals_n) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
        let position = Arc::new(Mutex::new(0.110));
        let (stops, taken_n, stands_at) = (stop.clone(), goals_n.clone(), position.clone());
        let thread = thread::spawn(move || {
            let mut ros = Ros::new("/", &format!("{name}_server"), domain_id).expect("joins");
            let qos = ActionServerQosPolicies {
                goal_service: RELIABLE,
                result_service: RELIABLE,
                cancel_service: RELIABLE,
                feedback_publisher: RELIABLE,
                status_publisher: LATCHED,
            };
            let action = Name::parse(&format!("/{name}/gripper_cmd")).expect("a name");
            let kind = ActionTypeName::new("control_msgs", "GripperCommand");
            let services = ros.services();
            let server: ActionServer<GripperCommandGoal, GripperCommandResult, GripperCommandResult> =
                ros.node().create_action_server(services, &action, &kind, qos).expect("a server");
            let joints = ros.publisher(&format!("/{name}/joint_states"), &SENSOR_DATA).expect("a publisher");
            let mut due = Vec::new();
            while !stops.load(Ordering::Relaxed) {
                while let Ok(Some((id, request))) = server.receive_goal() {
                    let force_n = request.goal.max_effort;
                    let mut taken_n = taken_n.lock().expect("whole");
                    if taken_n.is_empty() {
                        *stands_at.lock().expect("whole") = 0.028;
                    }
                    taken_n.push(force_n);
                    due.extend(answers(force_n).map(|after| (Instant::now() + after, id)));
                }
                due.retain(|(at, id)| {
                    let waits = *at > Instant::now();
                    if !waits {
                        let stamp = ros2_client::builtin_interfaces::Time::now();
                        server.send_goal_response(*id, SendGoalResponse { accepted: true, stamp }).expect("answered");
                    }
                    waits
                });
                let header = Header { stamp: stamp(), frame_id: String::new() };
                let (name, position) = (vec!["finger_joint".into()], vec![*stands_at.lock().expect("whole")]);
                joints.publish(JointState { header, name, position, velocity: vec![], effort: vec![] }).expect("said");
                sleep(Duration::from_millis(10));
            }
        });
        Server { stop, goals_n, position, thread: Some(thread) }
    }

    fn goals_n(&self) -> Vec<f64> {
        self.goals_n.lock().expect("whole").clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("once").join().expect("no panic");
    }
}

fn config(name: &str) -> ActionGripperConfig {
    ActionGripperConfig {
        action: format!("/{name}/gripper_cmd"),
        joint_states: format!("/{name}/joint_states"),
        joint: "finger_joint".into(),
        closed_position: 0.0,
        open_position: 0.110,
        opening_mm: 110.0,
        effort_is_force: false,
    }
}

/// A cycle of a loop that holds with this force: it commands while the gripper has no fault.
fn cycle(gripper: &mut ActionGripper, force_n: f64) -> Result<GripperState, GripperErrorKind> {
    sleep(CYCLE);
    let state = gripper.poll().map_err(|e| e.kind)?;
    gripper.command(GripCommand::Hold { force_n }).map_err(|e| e.kind)?;
    Ok(state)
}

/// Cycles until the gripper reports this target; returns its results up to then.
fn hold(gripper: &mut ActionGripper, force_n: f64) -> Vec<Result<Option<f64>, GripperErrorKind>> {
    let (mut said, until) = (Vec::new(), Instant::now() + LONGEST_WAIT);
    while said.last() != Some(&Ok(Some(force_n))) {
        assert!(Instant::now() < until, "not held with {force_n} N: {said:?}");
        said.push(cycle(gripper, force_n).map(|state| state.target_n));
    }
    said
}

#[test]
fn a_goal_that_may_hold_no_longer_is_sent_again() {
    // The domain of a test that only looks for absent nodes: other names do not interfere with it.
    let (name, domain_id) = ("doubted", domain_id(5));
    let mut ros = Ros::new("/", "test_doubted", domain_id).expect("joins");
    let mut gripper = ActionGripper::new(&mut ros, config(name)).expect("an action");
    let late: Answers = |force_n| Some(Duration::from_millis(if force_n == 15.0 { 700 } else { 0 }));
    let server = Server::start(name, domain_id, late);
    hold(&mut gripper, 20.0);
    // 15 N are executed without an answer: the next command must not rely on the goal before.
    let began = Instant::now();
    let fault = loop {
        match cycle(&mut gripper, 15.0) {
            Ok(state) => assert_eq!(state.target_n, Some(20.0), "as long as the answer may come"),
            Err(kind) => break kind,
        }
        assert!(began.elapsed() < LONGEST_WAIT, "no fault");
    };
    assert_eq!((fault, server.goals_n().last()), (GripperErrorKind::Unanswered, Some(&15.0)));
    let said = hold(&mut gripper, 20.0);
    assert_eq!(said[0], Ok(None), "nobody knows what holds: {said:?}");
    assert_eq!(server.goals_n().last(), Some(&20.0));
    // Another server, without any goal.
    drop(server);
    let began = Instant::now();
    while cycle(&mut gripper, 20.0) != Err(GripperErrorKind::Link) {
        assert!(began.elapsed() < LONGEST_WAIT, "no fault");
    }
    let server = Server::start(name, domain_id, late);
    let said = hold(&mut gripper, 20.0);
    assert!(said[..said.len() - 1].iter().all(|said| !matches!(said, Ok(Some(_)))), "no target: {said:?}");
    assert_eq!(server.goals_n().last(), Some(&20.0));
    // A goal that is certain to hold is not sent again.
    let sent_count = server.goals_n().len();
    (0..15).for_each(|_| assert_eq!(cycle(&mut gripper, 20.0).expect("no fault").target_n, Some(20.0)));
    assert_eq!(server.goals_n().len(), sent_count);
}

#[test]
fn a_force_that_changes_in_every_cycle_waits_for_answers_too() {
    let (name, domain_id) = ("ramped", domain_id(5));
    let mut ros = Ros::new("/", "test_ramped", domain_id).expect("joins");
    let mut gripper = ActionGripper::new(&mut ros, config(name)).expect("an action");
    let server = Server::start(name, domain_id, |force_n| (force_n < 40.0).then_some(Duration::from_millis(60)));
    hold(&mut gripper, 20.0);
    let (mut force_n, mut told_n) = (20.0, Vec::new());
    for _ in 0..60 {
        force_n += 0.1;
        let state = cycle(&mut gripper, force_n).expect("answered in time");
        told_n.extend(state.target_n);
    }
    told_n.dedup();
    assert!(told_n.len() > 5 && told_n.is_sorted(), "the target follows: {told_n:?}");
    hold(&mut gripper, force_n);
    assert!(server.goals_n().len() < 60, "one at a time: {:?}", server.goals_n());
    assert_eq!(server.goals_n().last(), Some(&force_n), "the newest comes last");
    // No answers any more: that is a fault, and it lasts.
    let (mut faults, mut sent_from) = (Vec::new(), 40.0);
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        sent_from += 0.1;
        match cycle(&mut gripper, sent_from) {
            Ok(state) => assert!(faults.is_empty() || state.target_n.is_none(), "nobody knows what holds"),
            Err(kind) => faults.push((kind, began.elapsed())),
        }
    }
    assert!(faults.iter().all(|(kind, _)| *kind == GripperErrorKind::Unanswered), "{faults:?}");
    let first = faults.first().expect("a fault").1;
    assert!(first < Duration::from_millis(1500), "{first:?}");
    // The loop clears a fault half a second after it was last reported.
    let longest = faults.windows(2).map(|two| two[1].1 - two[0].1).max().expect("it is told again");
    assert!(longest < Duration::from_millis(450), "{faults:?}");
}

/// The server accepts the goal to open, but the jaws stand; later they move.
#[test]
fn jaws_are_open_once_they_move_and_are_told_to_with_an_effort() {
    let (name, domain_id) = ("released", domain_id(5));
    let mut ros = Ros::new("/", "test_released", domain_id).expect("joins");
    let mut gripper = ActionGripper::new(&mut ros, config(name)).expect("an action");
    let server = Server::start(name, domain_id, |_| Some(Duration::ZERO));
    hold(&mut gripper, 20.0);
    let release = |gripper: &mut ActionGripper| {
        sleep(CYCLE);
        let state = gripper.poll().expect("no fault");
        gripper.command(GripCommand::Release).expect("taken");
        state.jaws
    };
    let stuck: Vec<Jaws> = (0..40).map(|_| release(&mut gripper)).collect();
    assert_eq!(server.goals_n()[1..], [20.0], "with the effort that held, once");
    assert!(!stuck.contains(&Jaws::Open), "{stuck:?}");
    *server.position.lock().expect("whole") = 0.04;
    let moves: Vec<Jaws> = (0..20).map(|_| release(&mut gripper)).collect();
    assert_eq!(moves.last(), Some(&Jaws::Open), "{moves:?}");
}

#[test]
fn jaws_that_are_not_open_to_begin_with_are_named_with_joint_and_limit() {
    let (name, domain_id) = ("narrow", domain_id(5));
    let mut ros = Ros::new("/", "test_narrow", domain_id).expect("joins");
    let mut gripper = ActionGripper::new(&mut ros, config(name)).expect("an action");
    let server = Server::start(name, domain_id, |_| Some(Duration::ZERO));
    for (position, expected) in [
        (
            0.1,
            Err("finger_joint of /narrow/joint_states: expected 0.1078 or more (control.action.open_position 0.11) \
            to begin with, got 0.1000"),
        ),
        (0.11, Ok(Jaws::Open)),
    ] {
        *server.position.lock().expect("whole") = position;
        let until = Instant::now() + LONGEST_WAIT;
        loop {
            let told = gripper.poll().map(|state| state.jaws).map_err(|e| e.to_string());
            if told == expected.map_err(str::to_owned) {
                break;
            }
            assert!(Instant::now() < until, "{told:?} at {position}");
            sleep(CYCLE);
        }
    }
}

#[test]
fn jaws_without_a_way_are_refused() {
    let mut ros = Ros::new("/", "test_positions", domain_id(5)).expect("joins");
    let good = config("positions");
    for (key, config) in [
        ("open_position", ActionGripperConfig { open_position: 0.0, ..good.clone() }),
        ("open_position", ActionGripperConfig { open_position: f64::NAN, ..good.clone() }),
        ("closed_position", ActionGripperConfig { closed_position: f64::INFINITY, ..good.clone() }),
        ("opening_mm", ActionGripperConfig { opening_mm: 0.0, ..good.clone() }),
    ] {
        match ActionGripper::new(&mut ros, config).err() {
            Some(Error::Setting(e)) => assert_eq!(e.key, key),
            other => panic!("{key}: {other:?}"),
        }
    }
}
