//! The `.msg` files, the Rust structs and the JSON report must agree: names, order, types.

use rustdds::serialization::{self, RepresentationIdentifier};
use serde::Deserialize;
use serde_json::Value;
use serde_reflection::{ContainerFormat, Format, Tracer, TracerConfig};
use slipbound::hand::{FINGERS_MOST, Hand, Mounting, Side};
use slipbound::monitor::{
    ContactReport, Estimate, Estimates, EvidenceReport, MarkerCounts, MotionReport, Reason, ShearReport, SlipKind,
    SlipReport as CoreReport, SlipState, SlipSummary,
};
use slipbound::plane::Vec2;
use slipbound_ros2::lifecycle::Lifecycle;
use slipbound_ros2::msg;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Name and type of every field, in order, as a `.msg` file writes them.
type Fields = Vec<(String, String)>;

fn files() -> BTreeMap<String, Fields> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("slipbound_msgs/msg");
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("UTF-8").to_owned();
        let text = std::fs::read_to_string(&path).expect("text");
        files.insert(name, fields(&text));
    }
    files
}

fn fields(text: &str) -> Fields {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    // A name with `=` after it is a constant.
    let of = |line: &str| {
        let (kind, name) = line.split_once(char::is_whitespace)?;
        let is_constant = line.contains('=');
        (!is_constant).then(|| (name.trim().to_owned(), kind.trim_start_matches("std_msgs/").to_owned()))
    };
    lines.filter_map(of).collect()
}

fn kind(format: &Format) -> String {
    match format {
        Format::TypeName(name) => name.clone(),
        Format::Bool => "bool".into(),
        Format::I32 => "int32".into(),
        Format::U8 => "uint8".into(),
        Format::U32 => "uint32".into(),
        Format::U64 => "uint64".into(),
        Format::F64 => "float64".into(),
        Format::Str => "string".into(),
        Format::Seq(content) => format!("{}[]", kind(content)),
        Format::TupleArray { content, size } => format!("{}[{size}]", kind(content)),
        Format::Tuple(parts) if parts.iter().all(|part| part == &parts[0]) => {
            format!("{}[{}]", kind(&parts[0]), parts.len())
        }
        other => panic!("no such field in a .msg file: {other:?}"),
    }
}

fn trace<T: for<'a> Deserialize<'a>>(tracer: &mut Tracer) {
    tracer.trace_simple_type::<T>().expect("a struct");
}

fn structs() -> BTreeMap<String, Fields> {
    let mut structs = structs_of(|tracer| {
        trace::<msg::SlipReport>(tracer);
        trace::<msg::HandReport>(tracer);
        trace::<msg::GripCommand>(tracer);
        trace::<msg::GripperState>(tracer);
        trace::<msg::WristCommand>(tracer);
        trace::<msg::WristState>(tracer);
    });
    for of_others in ["Header", "Time"] {
        structs.remove(of_others).expect("it is used");
    }
    structs
}

/// The traced structs, and those they contain.
fn structs_of(trace_all: impl Fn(&mut Tracer)) -> BTreeMap<String, Fields> {
    let mut tracer = Tracer::new(TracerConfig::default());
    trace_all(&mut tracer);
    let registry = tracer.registry().expect("whole");
    let fields = |format| match format {
        ContainerFormat::Struct(fields) => {
            fields.into_iter().map(|field| (field.name, kind(&field.value))).collect::<Fields>()
        }
        other => panic!("expected a struct, got {other:?}"),
    };
    registry.into_iter().map(|(name, format)| (name, fields(format))).collect()
}

#[test]
fn structs_are_as_their_files() {
    let (files, structs) = (files(), structs());
    let names = |of: &BTreeMap<String, Fields>| of.keys().cloned().collect::<BTreeSet<_>>();
    assert_eq!(names(&files), names(&structs));
    for (name, fields) in &files {
        assert_eq!(fields, &structs[name], "{name}.msg and the struct");
    }
    assert!(files["SlipReport"].contains(&("reference_seq".into(), "uint64".into())), "the files were read");
}

#[test]
fn the_package_builds_every_file() {
    let cmake = include_str!("../slipbound_msgs/CMakeLists.txt");
    for name in files().keys() {
        assert!(cmake.contains(&format!("\"msg/{name}.msg\"")), "{name}");
    }
}

/// A report's keys in the JSON and its fields here, in order; what only `--markers` adds is not here.
#[test]
fn fields_are_the_keys_of_the_json_report() {
    let schema: serde_json::Value = serde_json::from_str(include_str!("../../docs/report.schema.json")).expect("JSON");
    let keys = |at: &str| {
        let properties = schema.pointer(at).and_then(|p| p.as_object()).unwrap_or_else(|| panic!("{at}"));
        properties.keys().cloned().collect::<BTreeSet<_>>()
    };
    let files = files();
    let names = |message: &str, apart: &[&str]| {
        let names = files[message].iter().map(|(name, _)| name.clone());
        names.filter(|name| !apart.contains(&name.as_str())).collect::<BTreeSet<_>>()
    };
    let mut report = keys("/$defs/frame/properties");
    for apart in ["field", "lost_ids", "contact_outline_px"] {
        assert!(report.remove(apart));
    }
    assert_eq!(names("SlipReport", &["header"]), report);
    for (message, at) in [
        ("Contact", "/$defs/frame/properties/contact/properties"),
        ("Markers", "/$defs/frame/properties/markers/properties"),
        ("Motion", "/$defs/frame/properties/motion/oneOf/1/properties"),
        ("Shear", "/$defs/frame/properties/shear/oneOf/1/properties"),
        ("Slip", "/$defs/frame/properties/slip/properties"),
        ("Estimate", "/$defs/estimate/oneOf/1/properties"),
        ("Evidence", "/$defs/frame/properties/evidence/oneOf/1/properties"),
    ] {
        assert_eq!(names(message, &[]), keys(at), "{message}");
    }
}

/// Every verdict and kind is a constant of its message.
#[test]
fn words_are_constants_of_their_files() {
    let constants = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("slipbound_msgs/msg/{name}.msg"));
        let text = std::fs::read_to_string(path).expect("text");
        let words = text.lines().filter_map(|line| line.split_once("=\"")?.1.split('"').next().map(str::to_owned));
        words.collect::<BTreeSet<_>>()
    };
    let schema: serde_json::Value = serde_json::from_str(include_str!("../../docs/report.schema.json")).expect("JSON");
    let words = |at: &str| {
        let words = schema.pointer(at).and_then(|words| words.as_array()).expect("an array");
        words.iter().filter_map(|word| word.as_str().map(str::to_owned)).collect::<BTreeSet<_>>()
    };
    assert_eq!(constants("SlipReport"), words("/$defs/frame/properties/state/enum"));
    assert_eq!(constants("Slip"), words("/$defs/frame/properties/slip/properties/kind/enum"));
    let _: fn(msg::Header, &str, u64, &CoreReport) -> msg::SlipReport = msg::SlipReport::of;
}

/// A report in which every value is known and different.
fn full() -> CoreReport {
    let v = |x: f64| Vec2::new(x, x + 0.5);
    let estimate = |value: f64, age_frames| Some(Estimate { value, sd: value / 8.0, age_frames });
    CoreReport {
        seq: 7,
        time_ns: Some(1_700_000_000_280_000_001),
        state: SlipState::Incipient,
        reason: Some(Reason::ContactQuality),
        contact: ContactReport { area_px2: 31.0, area_mm2: Some(32.0), quality: 0.1234567890123 },
        markers: MarkerCounts { detected: 65, matched: 64, lost: 1, inner: 20 },
        reference_seq: 3,
        grip_n: Some(10.5),
        motion: Some(MotionReport {
            reference_px: v(1.0),
            translation_px: v(2.0),
            translation_mm: Some(v(3.0)),
            rotation_rad: 0.25,
            icr_px: Some(v(4.0)),
        }),
        shear: Some(ShearReport { translation_px: v(5.0), translation_mm: Some(v(6.0)), rotation_rad: 0.125 }),
        slip: SlipSummary {
            markers_over: 9,
            markers_needed: 8,
            threshold_pitch: 0.29605,
            max_pitch: 0.33336,
            max_mm: Some(0.7),
            kind: Some(SlipKind::Both),
            direction_rad: Some(-1.5),
        },
        estimates: Estimates {
            stick_ratio: estimate(0.1, 1),
            margin: estimate(0.2, 2),
            shear_n: estimate(0.3, 3),
            torque_nmm: estimate(0.4, 4),
            friction: estimate(0.6, 5),
            cut_fraction: 0.0,
        },
        evidence: Some(EvidenceReport {
            reference_seq: 2,
            relaxation: 0.75,
            centre_rim_ratio: Some(0.8),
            imprint_change: Some(0.55),
            imprint_age_frames: 6,
            slide_score: 0.85,
            slide_px: v(8.0),
            slide_rad: 0.01,
            slides: true,
            gross_probability: Some(0.98),
            slide_pitch_per_s: Some(1.5),
            slide_mm_per_s: Some(1.75),
        }),
    }
}

/// The same with every optional value unknown.
fn bare() -> CoreReport {
    let (reason, contact) = (None, ContactReport { area_mm2: None, ..full().contact });
    let slip = SlipSummary { max_mm: None, kind: None, direction_rad: None, ..full().slip };
    let (time_ns, grip_n, motion, shear, evidence) = (None, None, None, None, None);
    let estimates = Estimates::default();
    CoreReport { time_ns, reason, contact, grip_n, motion, shear, slip, estimates, evidence, ..full() }
}

/// Whether a message value means "unknown".
fn says_nothing(message: &Value) -> bool {
    match message {
        Value::Null => true,
        Value::String(word) => word.is_empty(),
        Value::Number(number) => number.as_u64() == Some(0),
        Value::Bool(is_so) => !is_so,
        Value::Array(values) => values.iter().all(says_nothing),
        Value::Object(fields) => fields.values().all(says_nothing),
    }
}

/// Where a message differs from the JSON of the library; NaN is written as null.
fn compare(path: &str, message: &Value, json: &Value) {
    match json {
        Value::Null => assert!(says_nothing(message), "{path}: expected nothing, got {message}"),
        Value::Object(fields) => {
            for (name, value) in fields {
                compare(&format!("{path}.{name}"), &message[name], value);
            }
        }
        _ => assert_eq!(message, json, "{path}"),
    }
}

#[test]
fn values_are_those_of_the_library() {
    for report in [full(), bare()] {
        let message = msg::SlipReport::of(msg::Header::default(), "left", 41, &report);
        assert_eq!((message.finger.as_str(), message.frame), ("left", 41));
        let message = serde_json::to_value(message).expect("JSON");
        compare("report", &message, &serde_json::to_value(report).expect("JSON"));
    }
}

#[test]
fn values_of_a_hand_are_those_of_the_library() {
    let mut hand = Hand::new(&[Mounting::on(Side::Left), Mounting::on(Side::Right)]).expect("a hand");
    for seen in [None, Some(full())] {
        for (finger, report) in seen.iter().cycle().take(2 * usize::from(seen.is_some())).enumerate() {
            hand.see(finger, &CoreReport { reason: None, ..*report });
        }
        let report = hand.report(1_000_000);
        let message = msg::HandReport::of("hand", &report);
        assert_eq!(message.health.len(), FINGERS_MOST);
        assert_eq!(message.header.stamp, msg::Time::from_ns(report.time_ns.unwrap_or(0)));
        let message = serde_json::to_value(message).expect("JSON");
        compare("hand", &message, &serde_json::to_value(report).expect("JSON"));
        assert_eq!(report.slip.is_some(), seen.is_some(), "both cases are there");
    }
}

/// Messages and services of `lifecycle_msgs` as in ROS 2, request and answer separate.
const LIFECYCLE: [(&str, &str); 9] = [
    ("LifecycleState", "uint8 id\nstring label"),
    ("LifecycleTransition", "uint8 id\nstring label"),
    ("TransitionDescription", "Transition transition\nState start_state\nState goal_state"),
    ("TransitionEvent", "uint64 timestamp\nTransition transition\nState start_state\nState goal_state"),
    ("ChangeStateRequest", "Transition transition"),
    ("ChangeStateResponse", "bool success"),
    ("GetStateResponse", "State current_state"),
    ("GetAvailableStatesResponse", "State[] available_states"),
    ("GetAvailableTransitionsResponse", "TransitionDescription[] available_transitions"),
];

#[test]
fn lifecycle_structs_are_as_in_lifecycle_msgs() {
    let structs = structs_of(|tracer| {
        trace::<msg::TransitionEvent>(tracer);
        trace::<msg::ChangeStateRequest>(tracer);
        trace::<msg::ChangeStateResponse>(tracer);
        trace::<msg::GetStateResponse>(tracer);
        trace::<msg::GetAvailableStatesResponse>(tracer);
        trace::<msg::GetAvailableTransitionsResponse>(tracer);
    });
    assert_eq!(structs.len(), LIFECYCLE.len());
    for (name, text) in LIFECYCLE {
        // Two names are longer here, to make clear what they belong to.
        let expected = fields(text).into_iter().map(|(name, kind)| match kind.as_str() {
            "State" | "State[]" | "Transition" => (name, format!("Lifecycle{kind}")),
            _ => (name, kind),
        });
        assert_eq!(structs[name], expected.collect::<Fields>(), "{name}");
    }
}

/// Wire format: little-endian.
const CDR: RepresentationIdentifier = RepresentationIdentifier::CDR_LE;

/// The bytes of XCDR1 written out: numbers aligned to their size, a string with its length, including the final 0.
#[test]
fn lifecycle_messages_are_these_bytes() {
    let mut lifecycle = Lifecycle::default();
    let begun = lifecycle.request(1, "").expect("allowed");
    let configure = b"\x01\0\0\0\x0a\0\0\0configure\0";
    let unconfigured = b"\x01\0\0\0\x0d\0\0\0unconfigured\0";
    let configuring = b"\x0a\0\0\0\x0c\0\0\0configuring\0";
    // A state begins with one byte, wherever the string before it ended.
    let after = |bytes: &mut Vec<u8>, state: &[u8]| {
        bytes.push(state[0]);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes.extend(&state[4..]);
    };
    let mut description = configure.to_vec();
    after(&mut description, unconfigured);
    after(&mut description, configuring);

    let event = to_bytes(&msg::TransitionEvent::of(begun, 0x0102_0304_0506_0708));
    assert_eq!(event, [&[8, 7, 6, 5, 4, 3, 2, 1], &description[..]].concat());
    let available_transitions = vec![begun.into()];
    let graph = to_bytes(&msg::GetAvailableTransitionsResponse { available_transitions });
    assert_eq!(graph, [&[1, 0, 0, 0], &description[..]].concat());
    let state = msg::LifecycleState::from(lifecycle.state());
    let states = to_bytes(&msg::GetAvailableStatesResponse { available_states: vec![state.clone()] });
    assert_eq!(states, [&[1, 0, 0, 0], &configuring[..]].concat());
    assert_eq!(to_bytes(&msg::GetStateResponse { current_state: state }), configuring);
    let transition = msg::LifecycleTransition { id: 1, label: "configure".into() };
    assert_eq!(to_bytes(&msg::ChangeStateRequest { transition: transition.clone() }), configure);
    assert_eq!(to_bytes(&msg::ChangeStateResponse { success: true }), [1]);
    let read = serialization::deserialize_from_cdr_with_rep_id::<msg::ChangeStateRequest>(configure, CDR).expect("CDR");
    assert_eq!(read.0.transition, transition);
}

fn to_bytes(message: &impl serde::Serialize) -> Vec<u8> {
    let mut bytes = Vec::new();
    serialization::to_writer_with_rep_id(&mut bytes, message, CDR).expect("CDR");
    bytes
}
