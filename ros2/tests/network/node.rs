//! Images in, reports out.

use crate::process::{LONGEST_WAIT, Process, domain_id, next};
use ros2_client::{Publisher, ServiceMapping, ServiceTypeName};
use slipbound::finger_pipeline::RestFinder;
use slipbound::monitor::Settings;
use slipbound::monitor::{SlipMonitor, SlipState};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::source::decode_image;
use slipbound_ros2::msg::{
    CompressedImage, DiagnosticArray, Empty, GetStateResponse, HandReport, Header, LifecycleState, SlipReport, Time,
    TransitionEvent, TriggerResponse, WrenchStamped,
};
use slipbound_ros2::overlay::MOST_BYTES;
use slipbound_ros2::ros::{Inbox, LATCHED, RELIABLE, Ros, SENSOR_DATA};
use std::path::PathBuf;
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Time between two images.
const PERIOD: Duration = Duration::from_millis(33);

/// The first stamp, ns since 1970; images carry the simulated camera's time relative to it.
const BEGIN_NS: u64 = 1_700_000_000_000_000_000;

const SCENE: &str =
    "shear?distance_mm=3&speed_mm_per_s=10&grid=fast&rest_frames=24&press_s=0.2&settle_s=0.1&jpeg_quality=75";

/// Number of images from which the rest frame is chosen: `rest.window_count`.
pub const REST_COUNT: usize = 20;

/// An image of the simulated camera: JPEG and time.
pub struct Shot {
    pub jpeg: Vec<u8>,
    pub time_ns: u64,
}

/// The simulated finger and its images, made once.
pub fn simulated() -> &'static (Sensor, Vec<Shot>) {
    static SIMULATED: OnceLock<(Sensor, Vec<Shot>)> = OnceLock::new();
    SIMULATED.get_or_init(|| {
        let mut world = World::new(&Trial::parse(SCENE).expect("a scene")).expect("a world");
        let mut frame = FrameBuffer::default();
        let mut shots = Vec::new();
        while world.next(&mut frame).expect("simulates") == Next::Frame {
            shots.push(Shot { jpeg: frame.encoded.clone(), time_ns: BEGIN_NS + frame.time_ns.expect("a time") });
        }
        (world.sensor(), shots)
    })
}

/// The library's reports on these images, by their numbers.
fn said(shots: &[(u64, &Shot)]) -> Vec<slipbound::monitor::SlipReport> {
    let (settings, sensor) = (Settings::default(), &simulated().0);
    let mut finder = None;
    let mut monitor: Option<SlipMonitor> = None;
    let mut reports = Vec::new();
    for (seq, shot) in shots {
        let mut frame = FrameBuffer { encoded: shot.jpeg.clone(), ..FrameBuffer::default() };
        decode_image(&mut frame).expect("whole");
        (frame.seq, frame.time_ns) = (*seq, Some(shot.time_ns));
        if let Some(monitor) = &mut monitor {
            reports.push(monitor.step(&frame.frame().expect("a frame"), None));
            continue;
        }
        let looking = finder.get_or_insert_with(|| RestFinder::new(sensor, &settings, frame.size).expect("fits"));
        looking.see(&frame).expect("seen");
        if looking.is_full() {
            let rest = finder.take().expect("there").find().expect("at rest").rest;
            monitor = Some(SlipMonitor::new(sensor, &settings, rest).expect("a monitor"));
        }
    }
    reports
}

/// The node and its connections.
pub struct Bench {
    pub ros: Ros,
    images: Publisher<CompressedImage>,
    pub reports: Inbox<SlipReport>,
    folder: TempDir,
    pub config: PathBuf,
    pub domain_id: u16,
}

impl Bench {
    pub fn new(test: u16, more: &str) -> Self {
        Bench::with(test, more, "")
    }

    /// With additional parameters of the node and of its finger.
    pub fn with(test: u16, more: &str, of_finger: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let hand =
            "name = \"one\"\n[[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"left.toml\"\n";
        let sensor = slipbound_rig::sensors::to_toml(&simulated().0).expect("TOML");
        std::fs::write(folder.path().join("left.toml"), sensor).expect("writes");
        std::fs::write(folder.path().join("hand.toml"), hand).expect("writes");
        // Reliable, so that every image is judged and the comparison has no gaps.
        let node = format!(
            "hand = \"hand.toml\"\nimage_qos = \"reliable\"\n{more}\n\
             [[fingers]]\nname = \"left\"\nimage_topic = \"/left/image/compressed\"\n{of_finger}\n"
        );
        let config = folder.path().join("node.toml");
        std::fs::write(&config, node).expect("writes");
        let domain_id = domain_id(test);
        let mut ros = Ros::new("/", "test", domain_id).expect("joins");
        let images = ros.publisher("/left/image/compressed", &RELIABLE).expect("a publisher");
        let reports = ros.inbox("/slipbound/left/report", &RELIABLE).expect("an inbox");
        Bench { ros, images, reports, folder, config, domain_id }
    }

    /// Adds a finger to hand and node, whose camera does not exist yet.
    fn add_finger(&self) {
        let add = |path: &std::path::Path, text: &str| {
            let before = std::fs::read_to_string(path).expect("readable");
            std::fs::write(path, before + text).expect("writes");
        };
        let finger = "[[fingers]]\nname = \"right\"\nserial = \"B\"\nside = \"right\"\nsensor = \"left.toml\"\n";
        add(&self.folder.path().join("hand.toml"), finger);
        add(&self.config, "[[fingers]]\nname = \"right\"\nimage_topic = \"/right/image/compressed\"\n");
    }

    pub fn node(&self) -> Process {
        assert!(self.folder.path().exists());
        Process::node(&self.config, self.domain_id)
    }

    pub fn send(&self, shot: &Shot) {
        let header = Header { stamp: Time::from_ns(shot.time_ns), frame_id: "left_gel".into() };
        let image = CompressedImage { header, format: "jpeg".into(), data: shot.jpeg.clone() };
        self.images.publish(image).expect("sent");
    }

    /// Waits for the node to be matched: sends empty images until it counts one.
    pub fn await_node(&mut self) {
        let mut diagnostics: Inbox<DiagnosticArray> = self.ros.inbox("/diagnostics", &RELIABLE).expect("an inbox");
        let until = Instant::now() + LONGEST_WAIT;
        while Instant::now() < until {
            self.send(&Shot { jpeg: Vec::new(), time_ns: BEGIN_NS - 1 });
            let told = next(&mut diagnostics, Duration::from_millis(300));
            let values = told.as_ref().and_then(|array| array.status.first()).map(|status| &status.values);
            let received = values.and_then(|values| values.iter().find(|v| v.key == "received_count"));
            if received.is_some_and(|value| value.value != "0") {
                sleep(Duration::from_millis(300)); // the readers here are matched by then, too
                return;
            }
        }
        panic!("the node was not found");
    }
}

/// All numbers are equal, or NaN in both.
fn same(a: &SlipReport, b: &SlipReport) -> bool {
    format!("{a:?}") == format!("{b:?}")
}

#[test]
fn reports_are_field_by_field_what_the_library_says_of_the_same_pictures() {
    let mut bench = Bench::with(0, "overlay = true", "wrench_frame = \"left_pad\"");
    let mut hands: Inbox<HandReport> = bench.ros.inbox("/slipbound/hand/report", &RELIABLE).expect("an inbox");
    let mut wrenches: Inbox<WrenchStamped> = bench.ros.inbox("/slipbound/left/wrench", &SENSOR_DATA).expect("an inbox");
    let mut overlays: Inbox<CompressedImage> =
        bench.ros.inbox("/slipbound/left/overlay/compressed", &SENSOR_DATA).expect("an inbox");
    let mut states: Inbox<LifecycleState> = bench.ros.inbox("/slipbound/state", &LATCHED).expect("an inbox");
    let mut events: Inbox<TransitionEvent> =
        bench.ros.inbox("/slipbound/transition_event", &RELIABLE).expect("an inbox");
    let _node = bench.node();
    bench.await_node();
    assert_eq!(next(&mut states, LONGEST_WAIT).map(|state| state.label).as_deref(), Some("unconfigured"));

    let (_, shots) = simulated();
    let (mut got, mut hand_states, mut wrench_frames) = (Vec::new(), Vec::new(), Vec::new());
    for (i, shot) in shots.iter().enumerate() {
        if i == REST_COUNT {
            // Nothing is published before.
            let state = next(&mut states, LONGEST_WAIT).map(|state| (state.id, state.label));
            assert_eq!(state, Some((3, "active".into())));
        }
        bench.send(shot);
        // The next is sent when this one was judged: nothing is skipped, however busy the computer is.
        match i < REST_COUNT {
            true => sleep(PERIOD),
            false => got.extend(next(&mut bench.reports, LONGEST_WAIT)),
        }
        hand_states.extend(std::iter::from_fn(|| hands.take().expect("readable")).map(|r| r.message.state));
        let wrenches = std::iter::from_fn(|| wrenches.take().expect("readable"));
        wrench_frames.extend(wrenches.map(|received| received.message.header.frame_id));
    }
    let first_seq = got.first().expect("reports").seq - REST_COUNT as u64;
    let numbered: Vec<(u64, &Shot)> = (first_seq..).zip(shots).collect();
    let expected = said(&numbered);
    assert_eq!((got.len(), expected.len()), (shots.len() - REST_COUNT, shots.len() - REST_COUNT));
    for (frame, (got, report)) in got.iter().zip(&expected).enumerate() {
        let header = Header { stamp: Time::from_ns(report.time_ns.expect("a time")), frame_id: "left_gel".into() };
        let expected = SlipReport::of(header, "left", frame as u64, report);
        assert!(same(got, &expected), "frame {frame}:\n{got:?}\n{expected:?}");
    }
    let states_seen: std::collections::BTreeSet<&str> = got.iter().map(|report| report.state.as_str()).collect();
    assert!(states_seen.contains("no_contact") && states_seen.contains("incipient"), "{states_seen:?}");
    assert!(hand_states.iter().any(|state| state == "incipient"), "the hand says what its finger says");
    assert!(wrench_frames.iter().all(|frame| frame == "left_pad"), "{wrench_frames:?}");
    let known_count = got.iter().filter(|r| r.shear_n.value.is_finite() && r.shear.rotation_rad.is_finite()).count();
    assert!(!wrench_frames.is_empty() && wrench_frames.len() <= known_count, "only where the shear force is known");
    let overlay = next(&mut overlays, LONGEST_WAIT).expect("an overlay");
    assert!(overlay.data.len() <= MOST_BYTES && overlay.data.starts_with(&[0xFF, 0xD8]), "{}", overlay.data.len());
    let events = std::iter::from_fn(|| next(&mut events, Duration::ZERO)).map(|event| event.transition.id);
    assert_eq!(events.collect::<Vec<_>>(), [1, 10, 3, 30], "it has configured and activated itself");
}

/// Sends an image at the camera's rate, with a stamp later than all before.
pub fn show(bench: &Bench, shot: &Shot) {
    static BEGAN: OnceLock<Instant> = OnceLock::new();
    let passed = BEGAN.get_or_init(Instant::now).elapsed();
    let time_ns = BEGIN_NS + u64::try_from(passed.as_nanos()).expect("seconds");
    bench.send(&Shot { jpeg: shot.jpeg.clone(), time_ns });
    sleep(PERIOD);
}

#[test]
fn a_tare_is_taken_untouched_and_refused_in_contact() {
    tare_through(1, "enhanced", ServiceMapping::Enhanced);
}

#[test]
fn services_answer_in_the_mapping_of_cyclone_too() {
    tare_through(9, "cyclone", ServiceMapping::Cyclone);
}

fn tare_through(test: u16, key: &str, mapping: ServiceMapping) {
    let mut bench = Bench::new(test, &format!("service_mapping = \"{key}\""));
    let service = |name: &str| ros2_client::Name::new("/slipbound", name).expect("a name");
    let tare = bench
        .ros
        .node()
        .create_client::<Empty, TriggerResponse>(
            mapping,
            &service("tare"),
            &ServiceTypeName::new("std_srvs", "Trigger"),
            RELIABLE,
            RELIABLE,
        )
        .expect("a client");
    let get_state = bench
        .ros
        .node()
        .create_client::<Empty, GetStateResponse>(
            mapping,
            &service("get_state"),
            &ServiceTypeName::new("lifecycle_msgs", "GetState"),
            RELIABLE,
            RELIABLE,
        )
        .expect("a client");
    let _node = bench.node();
    bench.await_node();
    let (_, shots) = simulated();
    let at_rest: Vec<&Shot> = shots.iter().take(REST_COUNT).collect();
    let touched = shots.last().expect("shots");
    // Sends the request, and shows images until there is an answer.
    let ask = |bench: &mut Bench, jpegs: &[&Shot]| {
        let id = tare.send_request(Empty::default()).expect("sent");
        let until = Instant::now() + LONGEST_WAIT;
        for shot in jpegs.iter().cycle() {
            show(bench, shot);
            while let Some((answered, response)) = tare.receive_response().expect("readable") {
                if answered == id {
                    return response;
                }
            }
            assert!(Instant::now() < until, "no answer");
        }
        unreachable!("a cycle has no end")
    };
    let early = ask(&mut bench, &[touched]);
    assert!(!early.success && early.message.contains("not known yet"), "{early:?}");
    // The rest frame is found among untouched images: those in contact were too few to fill the window.
    let began = Instant::now();
    for shot in at_rest.iter().cycle() {
        show(&bench, shot);
        if next(&mut bench.reports, Duration::ZERO).is_some() {
            break;
        }
        assert!(began.elapsed() < LONGEST_WAIT, "no rest frame was found");
    }
    let done = ask(&mut bench, &at_rest);
    assert!(done.success && done.message == "left: tared", "{done:?}");
    // A camera that stops in the middle of a tare: a tare answered as failed must not take effect with the next images.
    let id = tare.send_request(Empty::default()).expect("sent");
    at_rest.iter().take(3).for_each(|shot| show(&bench, shot));
    let until = Instant::now() + LONGEST_WAIT;
    let late = loop {
        match tare.receive_response().expect("readable") {
            Some((answered, response)) if answered == id => break response,
            _ => sleep(PERIOD),
        }
        assert!(Instant::now() < until, "no answer");
    };
    assert!(!late.success && late.message.contains("within 4 s, got too few"), "{late:?}");
    let done = ask(&mut bench, &at_rest);
    assert!(done.success && done.message == "left: tared", "nothing of the last one goes on: {done:?}");
    let refused = ask(&mut bench, &[touched]);
    assert!(!refused.success && refused.message.contains("nothing touches"), "{refused:?}");
    let id = get_state.send_request(Empty::default()).expect("sent");
    let until = Instant::now() + LONGEST_WAIT;
    let state = loop {
        match get_state.receive_response().expect("readable") {
            Some((answered, response)) if answered == id => break response.current_state,
            _ => sleep(PERIOD),
        }
        assert!(Instant::now() < until, "no answer");
    };
    assert_eq!((state.id, state.label.as_str()), (3, "active"));
}

#[test]
fn a_node_that_was_killed_is_found_again_and_a_camera_too() {
    let mut bench = Bench::new(2, "");
    let (_, shots) = simulated();
    let mut at_rest = shots.iter().take(REST_COUNT).cycle();
    let mut report_of = |bench: &mut Bench| {
        let began = Instant::now();
        while began.elapsed() < LONGEST_WAIT {
            show(bench, at_rest.next().expect("a cycle"));
            if let Some(report) = next(&mut bench.reports, Duration::ZERO) {
                return report;
            }
        }
        panic!("no report within {LONGEST_WAIT:?}")
    };
    let first = bench.node();
    assert_eq!(report_of(&mut bench).frame, 0);
    drop(first);
    while next(&mut bench.reports, Duration::from_millis(300)).is_some() {}
    let _second = bench.node();
    let report = report_of(&mut bench);
    assert_eq!(report.frame, 0, "a new node counts anew");
    // A camera that is gone and returns as another writer: numbers continue, and later images are judged.
    let before = report_of(&mut bench);
    bench.images = Ros::new("/", "test_again", bench.domain_id)
        .and_then(|mut ros| ros.publisher("/left/image/compressed", &RELIABLE))
        .expect("a publisher");
    let after = report_of(&mut bench);
    assert!(after.seq > before.seq && after.frame > before.frame, "{} {}", before.seq, after.seq);
    assert_eq!(after.state, serde_json::to_value(SlipState::NoContact).expect("JSON"));
}

#[test]
fn reports_begin_when_the_node_is_active_and_a_camera_that_never_comes_does_not_silence_the_others() {
    let mut bench = Bench::new(10, "");
    bench.add_finger();
    let mut states: Inbox<LifecycleState> = bench.ros.inbox("/slipbound/state", &LATCHED).expect("an inbox");
    let mut hands: Inbox<HandReport> = bench.ros.inbox("/slipbound/hand/report", &RELIABLE).expect("an inbox");
    let _node = bench.node();
    bench.await_node();
    assert_eq!(next(&mut states, LONGEST_WAIT).map(|state| state.label).as_deref(), Some("unconfigured"));
    let mut at_rest = simulated().1.iter().take(REST_COUNT).cycle();
    let (began, mut early_count) = (Instant::now(), 0);
    // The rest frame of the left finger is known after REST_COUNT images; the right one has no camera.
    let active = loop {
        early_count += std::iter::from_fn(|| bench.reports.take().expect("readable")).count();
        if let Some(state) = next(&mut states, Duration::ZERO) {
            break state;
        }
        assert!(began.elapsed() < LONGEST_WAIT, "it is not active");
        show(&bench, at_rest.next().expect("a cycle"));
    };
    assert_eq!((active.id, active.label.as_str()), (3, "active"));
    assert!(began.elapsed() >= Duration::from_secs(4), "it waits for the right finger: {:?}", began.elapsed());
    // A report may overtake the state by an image or two.
    assert!(early_count <= 2, "{early_count} reports of a node that was unconfigured");
    let mut left = None;
    let until = Instant::now() + LONGEST_WAIT;
    while left.is_none() && Instant::now() < until {
        show(&bench, at_rest.next().expect("a cycle"));
        left = next(&mut bench.reports, Duration::ZERO);
    }
    assert!(left.is_some(), "the left finger reports");
    let hand = next(&mut hands, LONGEST_WAIT).expect("a report of the hand");
    assert_eq!(hand.health[1], "blind", "{:?}", hand.health);
    // The camera appears after all.
    let mut reports: Inbox<SlipReport> = bench.ros.inbox("/slipbound/right/report", &RELIABLE).expect("an inbox");
    bench.images = bench.ros.publisher("/right/image/compressed", &RELIABLE).expect("a publisher");
    let until = Instant::now() + LONGEST_WAIT;
    while next(&mut reports, Duration::ZERO).is_none() {
        assert!(Instant::now() < until, "the right finger does not report");
        show(&bench, at_rest.next().expect("a cycle"));
    }
}
