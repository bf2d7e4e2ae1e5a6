//! A control loop whose gripper and wrist are nodes in other processes, which are killed and restarted.

use crate::process::{LONGEST_WAIT, Process, domain_id};
use slipbound::control::{ControlError, ControlLoop, CycleObserver, CycleView, FaultKind};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::port::{
    FrameBuffer, FrameSource, GripCommand, Gripper, GripperErrorKind, Jaws, Next, SourceError, Wrist, WristError,
    WristErrorKind, WristMotion, WristState,
};
use slipbound::task::{ControllerKind, Phase, TaskKind, TaskSettings};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime;
use slipbound_ros2::gripper::TopicGripper;
use slipbound_ros2::gripper_action::{ActionGripper, ActionGripperConfig};
use slipbound_ros2::msg::{Header, WristState as WristStateMessage};
use slipbound_ros2::ros::{Ros, SENSOR_DATA, stamp};
use slipbound_ros2::wrist::TopicWrist;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

/// The force of the loop, N per finger.
const FORCE_N: f64 = 20.0;

/// Longest time for which a wrist may still move after its loop has a fault: the silence that counts as one, a cycle,
/// its time to live, and some margin for a busy computer.
const WRIST: Duration = Duration::from_millis(900);

/// A finger that feels nothing until the jaws hold, and the same object from then on.
struct Finger {
    frames: Vec<FrameBuffer>,
    /// Frames before the contact.
    open_count: usize,
    holds: Arc<AtomicBool>,
    next: usize,
    seq: u64,
}

impl FrameSource for Finger {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let frame = &self.frames[self.next];
        into.pixels.clone_from(&frame.pixels);
        (into.format, into.size, into.seq, into.time_ns) = (frame.format, frame.size, self.seq, Some(now_ns()));
        self.seq += 1;
        self.next += 1;
        let holds = self.holds.load(Ordering::Relaxed);
        if !holds && self.next >= self.open_count {
            self.next = 0;
        } else if self.next >= self.frames.len() {
            self.next = self.frames.len() - 8; // eight frames of the held object, repeated
        }
        Ok(Next::Frame)
    }
}

fn finger(holds: Arc<AtomicBool>) -> FingerPipeline {
    let mut world = World::new(&Trial::parse("press?grid=fast&rest_frames=24").expect("a scene")).expect("a world");
    let sensor = world.sensor();
    let mut frames = Vec::new();
    let mut frame = FrameBuffer::default();
    while world.next(&mut frame).expect("simulates") == Next::Frame {
        frames.push(frame.clone());
    }
    let source = Finger { frames, open_count: 20, holds, next: 0, seq: 0 };
    FingerPipeline::new("left", Mounting::on(Side::Left), sensor, Settings::default(), Box::new(source))
}

/// Observations of the loop.
#[derive(Clone, Default)]
struct Seen {
    fault: Option<FaultKind>,
    is_lifting: bool,
    commanded_n: Vec<f64>,
    cycles_count: u32,
}

/// An observer that tells the simulated finger whether the jaws hold.
struct Observer {
    seen: Arc<Mutex<Seen>>,
    holds: Arc<AtomicBool>,
}

impl CycleObserver for Observer {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let mut seen = self.seen.lock().expect("whole");
        seen.cycles_count += 1;
        seen.fault = view.fault.map(|fault| fault.kind);
        let Some(cycle) = view.cycle() else { return };
        self.holds.fetch_or(cycle.gripper.jaws == Jaws::Holding, Ordering::Relaxed);
        seen.is_lifting = matches!(cycle.wrist_command.motion, WristMotion::Lower { .. }) && !cycle.fault;
        match cycle.grip_command {
            GripCommand::Hold { force_n } => seen.commanded_n.push(force_n),
            GripCommand::Release => assert!(cycle.phase == Phase::Releasing, "opened"),
        }
    }
}

/// A line of the emulator's log: force_n target_n angle_rad lowered_mm moving.
fn last_line(log: &Path) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(log).ok()?;
    let whole = &text[..text.rfind('\n')?];
    Some(whole.lines().last()?.split(' ').map(str::to_owned).collect())
}

fn targets_n(log: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(log).expect("a log");
    let whole = &text[..text.rfind('\n').unwrap_or(0)];
    whole.lines().filter_map(|line| line.split(' ').nth(1)?.parse().ok()).collect()
}

fn moves(log: &Path) -> bool {
    last_line(log).is_some_and(|words| words.last().is_some_and(|moving| moving == "true"))
}

fn await_that(what: &str, longest: Duration, mut is_so: impl FnMut() -> bool) -> Duration {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < longest, "{what}: not within {longest:?}");
        sleep(Duration::from_millis(10));
    }
    began.elapsed()
}

/// A loop that lifts, far and slowly, on a thread.
struct Loop {
    seen: Arc<Mutex<Seen>>,
    stop: Arc<AtomicBool>,
    thread: Option<thread::JoinHandle<Result<(), ControlError>>>,
}

impl Loop {
    fn start(mut gripper: impl Gripper + Send + 'static, mut wrist: TopicWrist) -> Self {
        let mut settings = TaskSettings::default().with_controller(ControllerKind::Constant);
        settings.grip.start_n = FORCE_N;
        (settings.lift.lift_mm, settings.lift.rate_mm_per_s) = (1000.0, 2.0);
        let holds = Arc::new(AtomicBool::new(false));
        let finger = finger(holds.clone());
        let stiffness = finger.sensor().shear_stiffness_mpa_per_mm();
        let task = settings.task(TaskKind::Lift, stiffness).expect("a task");
        let (seen, stop) = (Arc::new(Mutex::new(Seen::default())), Arc::new(AtomicBool::new(false)));
        let (looks, stops) = (seen.clone(), stop.clone());
        let thread = thread::spawn(move || {
            // The nodes are discovered before the loop begins: its patience is for links lost later.
            let began = Instant::now();
            while (gripper.poll().is_err() || wrist.poll().is_err()) && began.elapsed() < LONGEST_WAIT {
                sleep(Duration::from_millis(10));
            }
            let mut control = ControlLoop::new(vec![finger], task).expect("a loop");
            let mut observer = Observer { seen: looks, holds };
            let mut next = Instant::now();
            let mut is_due = || {
                let due = Instant::now() >= next;
                if due {
                    next += Duration::from_millis(33);
                }
                due
            };
            realtime::run(&mut control, &mut gripper, &mut wrist, &stops, &mut is_due, &mut observer)
        });
        Loop { seen, stop, thread: Some(thread) }
    }

    fn seen(&self) -> Seen {
        self.seen.lock().expect("whole").clone()
    }

    fn end(mut self) -> Result<(), ControlError> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("once").join().expect("no panic")
    }
}

/// An emulated gripper and an emulated wrist, each a process, with their logs.
struct Nodes {
    gripper: Option<Process>,
    _wrist: Process,
    gripper_log: PathBuf,
    wrist_log: PathBuf,
    again_log: PathBuf,
    _folder: tempfile::TempDir,
}

impl Nodes {
    fn start(domain_id: u16, more: &[&str]) -> Self {
        Nodes::start_by(more, |args| Process::start(args, domain_id))
    }

    fn start_by(more: &[&str], run: impl Fn(&[&str]) -> Process) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let (gripper_log, wrist_log, again_log) = (path("gripper"), path("wrist"), path("again"));
        let start = |base: &str, log: &Path, more: &[&str]| {
            let log = log.to_str().expect("UTF-8");
            run(&[&["emulate", "--base", base, "--log", log], more].concat())
        };
        Nodes {
            gripper: Some(start("/one", &gripper_log, more)),
            _wrist: start("/two", &wrist_log, &[]),
            gripper_log,
            wrist_log,
            again_log,
            _folder: folder,
        }
    }

    fn kill_gripper(&mut self) {
        self.gripper = None;
    }

    /// Restarts the gripper; its jaws were left holding.
    fn gripper_again(&mut self, domain_id: u16, more: &[&str]) {
        let (log, force) = (self.again_log.to_str().expect("UTF-8"), FORCE_N.to_string());
        let args = ["emulate", "--base", "/one", "--log", log, "--holding-n", &force];
        self.gripper = Some(Process::start(&[&args, more].concat(), domain_id));
    }
}

/// Kills the gripper's node while the loop lifts, and restarts it.
fn vanish_and_return(mut nodes: Nodes, control: Loop, domain_id: u16, more: &[&str]) {
    await_that("it lifts", LONGEST_WAIT, || control.seen().is_lifting && moves(&nodes.wrist_log));
    nodes.kill_gripper();
    let stood = await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    let is_gone = |seen: &Seen| seen.fault == Some(FaultKind::Gripper(GripperErrorKind::Link));
    await_that("the loop says why", WRIST, || is_gone(&control.seen()));
    sleep(Duration::from_millis(1500));
    let away = control.seen();
    assert!(is_gone(&away) && !moves(&nodes.wrist_log), "it waits: {:?}", away.fault);
    let before = nodes.gripper_log.clone();
    assert_eq!(targets_n(&before).last(), Some(&FORCE_N));

    nodes.gripper_again(domain_id, more);
    let back = await_that("it lifts again", Duration::from_secs(9), || moves(&nodes.wrist_log));
    println!("gripper killed: wrist stands after {stood:?}; back: it lifts again after {back:?}");
    sleep(Duration::from_millis(300));
    let seen = control.seen();
    assert!(seen.commanded_n.iter().all(|n| *n == FORCE_N) && seen.cycles_count > 50, "{:?}", seen.commanded_n.last());
    assert!(targets_n(&nodes.again_log).iter().all(|n| *n == FORCE_N), "nothing was let go");
    assert!(matches!(control.end(), Err(ControlError::Interrupted)));
    await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    assert_eq!(targets_n(&nodes.again_log).last(), Some(&FORCE_N), "and when the loop has ended, neither");
}

#[test]
fn a_gripper_node_that_vanishes_pauses_the_wrist_and_keeps_the_force() {
    let domain_id = domain_id(3);
    let nodes = Nodes::start(domain_id, &[]);
    let mut ros = Ros::new("/", "test_control", domain_id).expect("joins");
    let gripper = TopicGripper::new(&mut ros, "/one/gripper").expect("topics");
    let wrist = TopicWrist::new(&mut ros, "/two/wrist").expect("topics");
    vanish_and_return(nodes, Loop::start(gripper, wrist), domain_id, &[]);
}

#[test]
fn an_action_gripper_that_vanishes_pauses_the_wrist_and_keeps_the_force() {
    let domain_id = domain_id(7);
    let action = ["--action", "/gripper_controller/gripper_cmd"];
    let nodes = Nodes::start(domain_id, &action);
    let mut ros = Ros::new("/", "test_action", domain_id).expect("joins");
    let config = ActionGripperConfig {
        action: action[1].into(),
        joint_states: "/joint_states".into(),
        joint: "finger_joint".into(),
        closed_position: 0.0,
        open_position: 0.110,
        opening_mm: 110.0,
        effort_is_force: true,
    };
    let gripper = ActionGripper::new(&mut ros, config).expect("an action");
    let wrist = TopicWrist::new(&mut ros, "/two/wrist").expect("topics");
    vanish_and_return(nodes, Loop::start(gripper, wrist), domain_id, &action);
}

#[test]
fn a_missing_gripper_node_is_reported() {
    let mut ros = Ros::new("/", "test_nobody", domain_id(5)).expect("joins");
    let mut gripper = TopicGripper::new(&mut ros, "/nobody").expect("topics");
    let told = gripper.command(GripCommand::Hold { force_n: 10.0 }).expect_err("nobody is there");
    assert_eq!(told.kind, GripperErrorKind::Link);
    assert!(told.to_string().contains("/nobody/state: expected a state every 300 ms"), "{told}");
    let told = gripper.command(GripCommand::Hold { force_n: f64::NAN }).expect_err("no number");
    assert_eq!(told.kind, GripperErrorKind::Value);
}

/// A wrist node that stands at 20 mm, knows its distance no longer, and is restarted, which counts from 0.
#[test]
fn a_wrist_without_a_position_is_silent_and_one_that_counts_from_a_new_zero_is_a_fault() {
    let domain_id = domain_id(5);
    let mut node = Ros::new("/", "test_wrist_node", domain_id).expect("joins");
    let states = node.publisher("/zero/state", &SENSOR_DATA).expect("a publisher");
    let mut ros = Ros::new("/", "test_wrist", domain_id).expect("joins");
    let mut wrist = TopicWrist::new(&mut ros, "/zero").expect("topics");
    let mut publishes = |lowered_mm: f64, what: &str, is_so: fn(&Result<WristState, WristError>) -> bool| {
        let mut told = wrist.poll();
        let after = await_that(what, LONGEST_WAIT, || {
            let header = Header { stamp: stamp(), frame_id: String::new() };
            states.publish(WristStateMessage { header, angle_rad: 0.5, lowered_mm, moving: false }).expect("said");
            sleep(Duration::from_millis(10));
            told = wrist.poll();
            is_so(&told)
        });
        (told, after)
    };
    publishes(20.0, "a position", Result::is_ok).0.expect("there");
    let (told, after) = publishes(f64::NAN, "silence", Result::is_err);
    let told = told.expect_err("no position");
    assert!(told.kind == WristErrorKind::Link && after < Duration::from_secs(1), "{told} after {after:?}");
    assert!(
        told.to_string().contains("angle_rad and lowered_mm of /zero/state: expected a state every 300 ms"),
        "{told}"
    );
    let is_other = |told: &Result<_, WristError>| !matches!(told, Err(e) if e.kind == WristErrorKind::Link);
    let told = publishes(0.0, "a position", is_other).0.expect_err("20 mm away");
    assert!(told.to_string().contains("/zero/state: expected lowered_mm within 1 of 20"), "{told}");
    assert_eq!(publishes(20.5, "the position of before", Result::is_ok).0.expect("there").lowered_mm, 20.5);
}

/// The namespace and the device made by `ros2/namespaces.sh`.
pub const THERE: &str = "slipbound-there";
const LINK: &str = "finger0";

/// Held by the test that cuts the link: there is only one.
pub static CUTS: Mutex<()> = Mutex::new(());

pub fn set_link(to: &str) {
    let asked = std::process::Command::new("ip").args(["link", "set", LINK, to]).status().expect("iproute2");
    assert!(asked.success(), "ip link set {LINK} {to}");
}

#[test]
#[ignore = "needs another network namespace and a link to it: ros2/namespaces.sh"]
fn a_link_that_is_cut_stops_the_wrist_and_keeps_the_force() {
    let _cuts = CUTS.lock().unwrap_or_else(PoisonError::into_inner);
    let domain_id = domain_id(6);
    let nodes = Nodes::start_by(&[], |args| Process::start_in(THERE, args, domain_id));
    let mut ros = Ros::new("/", "test_link", domain_id).expect("joins");
    let gripper = TopicGripper::new(&mut ros, "/one/gripper").expect("topics");
    let wrist = TopicWrist::new(&mut ros, "/two/wrist").expect("topics");
    let control = Loop::start(gripper, wrist);
    await_that("it lifts", LONGEST_WAIT, || control.seen().is_lifting && moves(&nodes.wrist_log));
    set_link("down");
    let stood = await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    await_that("the loop says why", WRIST, || control.seen().fault.is_some());
    sleep(Duration::from_millis(1500));
    assert!(control.seen().fault.is_some() && !moves(&nodes.wrist_log), "it waits");
    set_link("up");
    let back = await_that("it lifts again", Duration::from_secs(9), || moves(&nodes.wrist_log));
    println!("link cut for 2 s: wrist stands after {stood:?}; up: it lifts again after {back:?}");
    assert!(control.seen().commanded_n.iter().all(|n| *n == FORCE_N));
    assert!(matches!(control.end(), Err(ControlError::Interrupted)));
    let held: Vec<f64> = targets_n(&nodes.gripper_log).into_iter().skip_while(|n| *n != FORCE_N).collect();
    assert!(!held.is_empty() && held.iter().all(|n| *n == FORCE_N), "nothing was let go");
}
