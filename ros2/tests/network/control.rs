//! `slipbound-ros2 hold` and `run`, whose gripper and wrist are nodes in other processes, which are killed and restarted.

use crate::gripper_action::Server;
use crate::process::{LONGEST_WAIT, Process, domain_id, next};
use serde_json::Value;
use slipbound::port::{
    FrameBuffer, FrameSource as _, GripCommand, Gripper as _, GripperErrorKind, Next, Wrist as _, WristError,
    WristErrorKind, WristState,
};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::sensors;
use slipbound_ros2::gripper::TopicGripper;
use slipbound_ros2::msg::{
    CompressedImage, GripCommand as GripCommandMessage, GripperState, HandReport, Header, JointState, SlipReport,
    WristCommand, WristState as WristStateMessage,
};
use slipbound_ros2::ros::{LAST_RELIABLE, RELIABLE, Ros, SENSOR_DATA, stamp};
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

const IMAGES: &str = "/left/image/compressed";

/// A camera node whose finger feels nothing until the jaws hold, and the same object from then on.
fn camera(world: &mut World, domain_id: u16, stop: Arc<AtomicBool>) -> thread::JoinHandle<()> {
    /// Frames before the contact.
    const OPEN_COUNT: usize = 20;
    let (mut jpegs, mut frame) = (Vec::new(), FrameBuffer::default());
    while world.next(&mut frame).expect("simulates") == Next::Frame {
        jpegs.push(frame.encoded.clone());
    }
    thread::spawn(move || {
        let mut ros = Ros::new("/", "test_camera", domain_id).expect("joins");
        let images = ros.publisher(IMAGES, &SENSOR_DATA).expect("a publisher");
        let mut jaws = ros.inbox::<GripperState>("/one/gripper/state", &SENSOR_DATA).expect("a subscription");
        let (mut shown, mut holds) = (0, false);
        while !stop.load(Ordering::Relaxed) {
            holds |= jaws.newest().is_some_and(|state| state.jaws == "holding");
            let header = Header { stamp: stamp(), frame_id: "camera".into() };
            let (format, data) = ("jpeg".into(), jpegs[shown].clone());
            images.publish(CompressedImage { header, format, data }).expect("shown");
            shown += 1;
            if !holds && shown >= OPEN_COUNT {
                shown = 0;
            } else if shown >= jpegs.len() {
                shown = jpegs.len() - 8; // eight frames of the held object, repeated
            }
            sleep(Duration::from_millis(33));
        }
    })
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

const TOPICS: &str = "[control]\ngripper = \"ros2:///one/gripper\"\nwrist = \"ros2:///two/wrist\"\n";

const ACTION: &str = "[control]\ngripper = \"ros2+action:///gripper_controller/gripper_cmd\"\n\
    wrist = \"ros2:///two/wrist\"\n[control.action]\njoint = \"finger_joint\"\nclosed_position = 0.0\n\
    open_position = 0.110\nopening_mm = 110.0\neffort_is_force = true\n";

/// The files of a command with one finger that lifts far and slowly, and this table.
fn files(folder: &Path, control: &str) -> World {
    let world =
        World::new(&Trial::parse("press?grid=fast&rest_frames=24&jpeg_quality=75").expect("a scene")).expect("a world");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("writes");
    write("left.toml", &sensors::to_toml(&world.sensor()).expect("a sensor"));
    write(
        "hand.toml",
        "name = \"one\"\n[[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"left.toml\"\n",
    );
    write("task.toml", &format!("[grip]\nstart_n = {FORCE_N}\n[lift]\nlift_mm = 1000.0\nrate_mm_per_s = 2.0\n"));
    let finger = format!("[[fingers]]\nname = \"left\"\nimage_topic = \"{IMAGES}\"\n");
    let control =
        control.replacen("[control]\n", "[control]\ncontroller = \"constant\"\nsettings = \"task.toml\"\n", 1);
    write("node.toml", &format!("hand = \"hand.toml\"\n{finger}{control}"));
    world
}

/// A process with the control loop, and the camera of its finger.
struct Loop {
    process: Option<Process>,
    run: PathBuf,
    stop: Arc<AtomicBool>,
    camera: Option<thread::JoinHandle<()>>,
    _folder: tempfile::TempDir,
}

impl Loop {
    /// Of this command, with arguments beside its file.
    fn start(command: &[&str], control: &str, domain_id: u16) -> Self {
        let (mut begun, mut world) = Loop::start_blind(command, control, domain_id);
        begun.camera = Some(camera(&mut world, domain_id, begun.stop.clone()));
        begun
    }

    /// The same without a camera.
    fn start_blind(command: &[&str], control: &str, domain_id: u16) -> (Self, World) {
        let folder = tempfile::tempdir().expect("a folder");
        let world = files(folder.path(), control);
        let (config, run) = (folder.path().join("node.toml"), folder.path().join("run"));
        let paths = [config.to_str().expect("UTF-8"), "--output", run.to_str().expect("UTF-8")];
        let process = Some(Process::start(&[command, &paths].concat(), domain_id));
        (Loop { process, run, stop: Arc::new(AtomicBool::new(false)), camera: None, _folder: folder }, world)
    }

    fn process(&mut self) -> &mut Process {
        self.process.as_mut().expect("not ended")
    }

    /// As [`Process::ended`].
    fn ended(&mut self, meanwhile: impl FnMut()) -> (Option<i32>, String) {
        self.process.take().expect("not ended").ended(LONGEST_WAIT, meanwhile)
    }

    /// Whether a note of the run says this.
    fn notes(&self, text: &str) -> bool {
        self.lines("events.jsonl").iter().any(|event| event["text"].as_str().is_some_and(|told| told.contains(text)))
    }

    fn lines(&self, file: &str) -> Vec<Value> {
        let text = std::fs::read_to_string(self.run.join(file)).unwrap_or_default();
        let whole = &text[..text.rfind('\n').unwrap_or(0)];
        whole.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    /// Whether the last note that says so says that the loop waits for a node.
    fn waits(&self) -> bool {
        let notes = self.lines("events.jsonl").into_iter().filter_map(|event| Some(event["text"].as_str()?.to_owned()));
        let mut told = notes.filter(|text| text.contains("the wrist pauses") || text.contains("are back"));
        told.next_back().is_some_and(|text| text.contains("expected a state every 300 ms"))
    }

    /// The forces that were commanded, N; the jaws were never to open.
    fn commanded_n(&self) -> Vec<f64> {
        let commands = self.lines("reports.jsonl").into_iter().map(|cycle| cycle["grip_command"].clone());
        commands.map(|command| command["force_n"].as_f64().expect("jaws that hold")).collect()
    }
}

impl Drop for Loop {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.camera.take().map(thread::JoinHandle::join);
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
fn vanish_and_return(nodes: &mut Nodes, control: &Loop, domain_id: u16, more: &[&str]) {
    await_that("it lifts", LONGEST_WAIT, || moves(&nodes.wrist_log));
    nodes.kill_gripper();
    let stood = await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    await_that("the loop says why", WRIST, || control.waits());
    sleep(Duration::from_millis(1500));
    assert!(control.waits() && !moves(&nodes.wrist_log), "it waits");
    assert_eq!(targets_n(&nodes.gripper_log).last(), Some(&FORCE_N));

    nodes.gripper_again(domain_id, more);
    let back = await_that("it lifts again", Duration::from_secs(9), || moves(&nodes.wrist_log));
    println!("gripper killed: wrist stands after {stood:?}; back: it lifts again after {back:?}");
    sleep(Duration::from_millis(300));
    let commanded_n = control.commanded_n();
    assert!(commanded_n.iter().all(|n| *n == FORCE_N) && commanded_n.len() > 50, "{:?}", commanded_n.last());
    assert!(targets_n(&nodes.again_log).iter().all(|n| *n == FORCE_N), "nothing was let go");
}

#[test]
fn a_gripper_node_that_vanishes_pauses_the_wrist_and_keeps_the_force() {
    let domain_id = domain_id(3);
    let mut nodes = Nodes::start(domain_id, &[]);
    let mut control = Loop::start(&["run", "lift"], TOPICS, domain_id);
    await_that("it lifts", LONGEST_WAIT, || moves(&nodes.wrist_log));
    let (code, said) = Loop::start_blind(&["hold"], TOPICS, domain_id).0.ended(|| {});
    let expected = "/one/gripper/command: expected no other node that commands this gripper, got one";
    assert!(code == Some(1) && said.contains(expected), "{code:?}: {said}");
    vanish_and_return(&mut nodes, &control, domain_id, &[]);
    control.process().interrupt();
    assert_eq!(control.process().exit_code(Duration::from_secs(10)), Some(1), "interrupted");
    await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    assert_eq!(targets_n(&nodes.again_log).last(), Some(&FORCE_N), "and when the loop has ended, neither");
}

#[test]
fn an_action_gripper_that_vanishes_pauses_the_wrist_and_keeps_the_force() {
    let domain_id = domain_id(7);
    let action = ["--action", "/gripper_controller/gripper_cmd"];
    let mut nodes = Nodes::start(domain_id, &action);
    let mut control = Loop::start(&["run", "lift"], ACTION, domain_id);
    vanish_and_return(&mut nodes, &control, domain_id, &action);
    nodes.kill_gripper();
    assert_eq!(control.process().exit_code(Duration::from_secs(20)), Some(1), "gone for more than ten seconds");
    assert!(control.waits() && !moves(&nodes.wrist_log));
    assert_eq!(targets_n(&nodes.again_log).last(), Some(&FORCE_N));
}

#[test]
fn hold_commands_the_gripper_alone_and_publishes_what_it_sees() {
    let domain_id = domain_id(11);
    let nodes = Nodes::start(domain_id, &[]);
    let mut ros = Ros::new("/", "test_hold", domain_id).expect("joins");
    let mut reports = ros.inbox::<SlipReport>("/slipbound/left/report", &RELIABLE).expect("a subscription");
    let mut hands = ros.inbox::<HandReport>("/slipbound/hand/report", &RELIABLE).expect("a subscription");
    let _silent = ros.publisher::<GripCommandMessage>("/one/gripper/command", &LAST_RELIABLE).expect("a publisher");
    let mut control = Loop::start(&["hold", "--for-s", "1"], TOPICS, domain_id);
    let report = next(&mut reports, LONGEST_WAIT).expect("a report");
    assert_eq!((report.finger.as_str(), report.header.frame_id.as_str()), ("left", "camera"));
    assert_eq!(report.header.stamp.ns(), Some(report.time_ns));
    assert_eq!(next(&mut hands, LONGEST_WAIT).expect("a report").health[0], "live");
    let (code, said) = control.ended(|| {});
    assert!(code == Some(0) && said.contains("  time until it ended         "), "held to the end of its time: {said}");
    let listens = "waits for /one/gripper/command: another node can publish here; no command of it for 5 s";
    assert!(said.contains(listens), "{said}");
    let held: Vec<f64> = targets_n(&nodes.gripper_log).into_iter().skip_while(|n| *n != FORCE_N).collect();
    assert!(!held.is_empty() && held.iter().all(|n| *n == FORCE_N), "and left holding");
    let lowered = last_line(&nodes.wrist_log).expect("a log");
    assert_eq!(lowered[2..], ["0.0000", "0.000", "false"], "the wrist was left alone");

    let motions = ros.publisher::<WristCommand>("/two/wrist/command", &LAST_RELIABLE).expect("a publisher");
    let (code, said) = Loop::start(&["run", "lift"], TOPICS, domain_id).ended(|| {
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let (rate_rad_per_s, most_rad, rate_mm_per_s, most_mm) = (0.0, 0.0, 0.0, 0.0);
        let motion = "pause".into();
        let pause =
            WristCommand { header, motion, rate_rad_per_s, most_rad, rate_mm_per_s, most_mm, time_to_live_ns: 0 };
        motions.publish(pause).expect("said");
    });
    let expected = "/two/wrist/command: expected no other node that commands this wrist, got one";
    assert!(code == Some(1) && said.contains(expected), "{code:?}: {said}");
}

#[test]
fn images_that_cannot_be_decoded_are_told_of_and_counted() {
    let domain_id = domain_id(12);
    let _nodes = Nodes::start(domain_id, &[]);
    let mut ros = Ros::new("/", "test_torn", domain_id).expect("joins");
    let images = ros.publisher(IMAGES, &SENSOR_DATA).expect("a publisher");
    let (mut control, _) = Loop::start_blind(&["hold"], TOPICS, domain_id);
    await_that("the first one is noted", LONGEST_WAIT, || {
        let header = Header { stamp: stamp(), frame_id: String::new() };
        images.publish(CompressedImage { header, format: "jpeg".into(), data: b"no image".to_vec() }).expect("shown");
        control.notes("left: the first torn frame: ")
    });
    control.process().interrupt();
    let (code, said) = control.ended(|| {});
    assert!(code == Some(1) && said.contains("left: the first torn frame: "), "{said}");
    assert!(said.contains(" torn") && control.notes(" images received, "), "counted, whatever ended it: {said}");
}

#[test]
fn a_finger_without_images_is_named_with_its_topic() {
    let domain_id = domain_id(13);
    let _nodes = Nodes::start(domain_id, &[]);
    let (code, said) = Loop::start_blind(&["hold"], TOPICS, domain_id).0.ended(|| {});
    let expected = "fingers[0].image_topic /left/image/compressed: expected images (compressed, best effort), got none";
    assert!(code == Some(1) && said.contains(expected), "{code:?}: {said}");
}

#[test]
fn who_waits_for_a_gripper_says_so_and_can_be_interrupted() {
    let (mut control, _) = Loop::start_blind(&["hold"], &TOPICS.replace("/one/", "/nobody/"), domain_id(5));
    sleep(Duration::from_secs(3));
    control.process().interrupt();
    let (code, said) = control.ended(|| {});
    assert!(code == Some(1) && said.contains("slipbound-ros2: interrupted"), "{code:?}: {said}");
    assert!(said.contains("waits for gripper: /nobody/gripper/state: expected a state"), "{said}");
}

/// The joint is there, the server is not.
#[test]
fn a_missing_action_server_is_named() {
    let domain_id = domain_id(14);
    let mut ros = Ros::new("/", "test_joint", domain_id).expect("joins");
    let joints = ros.publisher("/joint_states", &SENSOR_DATA).expect("a publisher");
    let (code, said) = Loop::start_blind(&["hold"], ACTION, domain_id).0.ended(|| {
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let (name, position) = (vec!["finger_joint".into()], vec![0.110]);
        joints.publish(JointState { header, name, position, velocity: vec![], effort: vec![] }).expect("said");
    });
    let expected = "gripper: /gripper_controller/gripper_cmd: expected an action server, got none";
    assert!(code == Some(1) && said.contains(expected), "{code:?}: {said}");
}

/// What ended it is the missing answer, not an empty grasp.
#[test]
fn an_action_server_that_never_answers_is_what_a_hold_ends_with() {
    let domain_id = domain_id(14);
    let _server = Server::start("mute", domain_id, |_| None);
    let table = ACTION.replace("/gripper_controller/", "/mute/") + "joint_states = \"/mute/joint_states\"\n";
    let (code, said) = Loop::start(&["hold"], &table, domain_id).ended(|| {});
    let expected = "slipbound-ros2: gripper: /mute/gripper_cmd: expected an answer within 500 ms, got none";
    assert!(code == Some(1) && said.contains(expected), "{code:?}: {said}");
    let ended = said.lines().find(|line| line.starts_with("  ended")).expect("a row");
    assert!(ended.contains("expected an answer") && !said.contains("nothing was found"), "{said}");
}

/// Before any node is looked for.
#[test]
fn wrong_or_missing_keys_are_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = folder.path().join("node.toml");
    let action = "[control]\ngripper = \"ros2+action:///g\"\n[control.action]\njoint = \"j\"\nclosed_position = 0.0\n\
        open_position = 0.0\nopening_mm = 110.0\n";
    let gripper = "gripper = \"ros2:///one/gripper\"\n";
    for (command, table, said) in [
        (&["hold"][..], "", "node.toml: control: expected a table with the gripper"),
        (&["hold"], "[control]\n", "node.toml: control.gripper: expected a value, got none"),
        (&["hold"], "[control]\ngripper = \"wsg50://hand:1000\"\n", "control.gripper: expected ros2:///BASE"),
        (&["hold"], "[control]\ngripper = \"ros2://one/gripper\"\n", "got `ros2://one/gripper`"),
        (&["hold"], "[control]\ngripper = \"ros2+action:///g\"\n", "control.action: expected the joint"),
        (&["hold"], "[control]\ngripper = \"\\u001b[2J\"\n", "got `\\u{1b}[2J`"),
        (&["hold"], action, "control.action.open_position: expected a finite number other than closed_position"),
        (&["hold"], &format!("[control]\n{gripper}wrst = \"\"\n"), "`control.wrst`; did you mean `wrist`?"),
        (&["hold"], &format!("[control]\n{gripper}max_skew_ms = 5000\n"), "control.max_skew_ms: expected at most 1000"),
        (&["hold", "--output", "-"], TOPICS, "--output: expected the name of a folder, got -"),
        (&["hold", "--for-s", "-1"], TOPICS, "--for-s: expected 0 to 1000000 s, got -1"),
        (&["run", "lift"], &format!("[control]\n{gripper}"), "node.toml: control.wrist: expected ros2:///BASE"),
    ] {
        files(folder.path(), table);
        let (code, told) = Process::refused(&[command, &[config.to_str().expect("UTF-8")]].concat());
        assert!(code == Some(2) && told.contains(said), "`{told}` lacks `{said}`, or {code:?} is not 2");
    }
}

/// Files that cannot be written, and numbers and names that cannot be; before a network is joined.
#[test]
fn what_the_tools_cannot_use_is_refused_by_name() {
    let name = "expected a name that ROS takes, got `two words`";
    for (args, code, said) in [
        (&["simulate", "--topic", "/t", "--sensor", "/nowhere/left.toml"][..], 1, "/nowhere/left.toml: cannot write: "),
        (&["emulate", "--log", "/nowhere/log"], 1, "/nowhere/log: cannot write: "),
        (&["emulate", "--action", "two words"], 2, &format!("--action: {name}")),
        (&["emulate", "--holding-n", "nan"], 2, "--holding-n: expected a finite number above 0, got NaN"),
        (&["emulate", "--holding-n=-1"], 2, "--holding-n: expected a finite number above 0, got -1"),
        (&["emulate", "--width-mm", "nan"], 2, "--width-mm: expected 0 to 110 mm, got NaN"),
        (&["emulate", "--width-mm", "200"], 2, "--width-mm: expected 0 to 110 mm, got 200"),
    ] {
        let (got, told) = Process::refused(args);
        assert!(got == Some(code) && told.contains(said), "`{told}` lacks `{said}`, or {got:?} is not {code}");
    }
}

/// As for the node; what is refused here comes after the domain.
#[test]
fn a_domain_that_is_set_to_nothing_is_domain_0_for_tools_too() {
    let emulate = |domain_id: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_slipbound-ros2"));
        let done = command.args(["emulate", "--action", "two words"]).env("ROS_DOMAIN_ID", domain_id).output();
        String::from_utf8_lossy(&done.expect("starts").stderr).into_owned()
    };
    let told = emulate("");
    assert!(told.contains("--action") && !told.contains("ROS_DOMAIN_ID"), "{told}");
    let told = emulate("240");
    assert!(told.contains("ROS_DOMAIN_ID: expected a whole number from 0 to 232, got `240`"), "{told}");
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

/// A wrist that is still on its way while the loop listens for other nodes: it never fell silent.
#[test]
fn a_wrist_that_moves_while_the_loop_listens_has_not_been_away() {
    const RISE_MM_PER_S: f64 = 5.0;
    let domain_id = domain_id(5);
    let _nodes = Nodes::start(domain_id, &[]);
    let mut control = Loop::start(&["run", "lift"], &TOPICS.replace("/two/", "/rising/"), domain_id);
    let (stop, run) = (control.stop.clone(), control.run.clone());
    let wrist = thread::spawn(move || {
        let mut ros = Ros::new("/", "test_rising", domain_id).expect("joins");
        let states = ros.publisher("/rising/wrist/state", &SENSOR_DATA).expect("a publisher");
        let (began, mut lowered_mm) = (Instant::now(), 0.0);
        while !stop.load(Ordering::Relaxed) {
            let moving = !run.exists();
            if moving {
                lowered_mm = began.elapsed().as_secs_f64() * RISE_MM_PER_S;
            }
            let header = Header { stamp: stamp(), frame_id: String::new() };
            states.publish(WristStateMessage { header, angle_rad: 0.0, lowered_mm, moving }).expect("said");
            sleep(Duration::from_millis(20));
        }
    });
    await_that("the run begins", LONGEST_WAIT, || control.run.join("events.jsonl").exists());
    await_that("it commands", Duration::from_secs(5), || !control.commanded_n().is_empty());
    assert!(!control.notes("new zero"), "{:?}", control.lines("events.jsonl"));
    control.process().interrupt();
    assert_eq!(control.process().exit_code(Duration::from_secs(10)), Some(1), "interrupted");
    control.stop.store(true, Ordering::Relaxed);
    wrist.join().expect("published");
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
    let mut control = Loop::start(&["run", "lift"], TOPICS, domain_id);
    await_that("it lifts", LONGEST_WAIT, || moves(&nodes.wrist_log));
    set_link("down");
    let stood = await_that("the wrist stands", WRIST, || !moves(&nodes.wrist_log));
    await_that("the loop says why", WRIST, || control.waits());
    sleep(Duration::from_millis(1500));
    assert!(control.waits() && !moves(&nodes.wrist_log), "it waits");
    set_link("up");
    let back = await_that("it lifts again", Duration::from_secs(9), || moves(&nodes.wrist_log));
    println!("link cut for 2 s: wrist stands after {stood:?}; up: it lifts again after {back:?}");
    assert!(control.commanded_n().iter().all(|n| *n == FORCE_N));
    control.process().interrupt();
    assert_eq!(control.process().exit_code(Duration::from_secs(10)), Some(1), "interrupted");
    let held: Vec<f64> = targets_n(&nodes.gripper_log).into_iter().skip_while(|n| *n != FORCE_N).collect();
    assert!(!held.is_empty() && held.iter().all(|n| *n == FORCE_N), "nothing was let go");
}
