//! Messages of ROS 2's own packages, as far as they are used here.

use super::topic_types;
use serde::{Deserialize, Serialize};

/// `builtin_interfaces/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds after them.
    pub nanosec: u32,
}

impl Time {
    /// The time as nanoseconds; None for 0, which means "no time" in ROS, and before 1970.
    pub fn ns(self) -> Option<u64> {
        let ns = u64::try_from(self.sec).ok()? * 1_000_000_000 + u64::from(self.nanosec);
        (ns > 0).then_some(ns)
    }

    /// Nanoseconds as a time; after January 2038 the latest representable one.
    pub fn from_ns(ns: u64) -> Self {
        match i32::try_from(ns / 1_000_000_000) {
            Ok(sec) => Time { sec, nanosec: (ns % 1_000_000_000) as u32 },
            Err(_) => Time { sec: i32::MAX, nanosec: 999_999_999 },
        }
    }
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Header {
    /// The time.
    pub stamp: Time,
    /// The frame of reference.
    pub frame_id: String,
}

/// `sensor_msgs/CompressedImage`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Exposure time and frame of the camera.
    pub header: Header,
    /// Compression; the format is detected from the bytes instead.
    pub format: String,
    /// A JPEG or PNG file.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// `sensor_msgs/Image`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Image {
    /// Exposure time and frame of the camera.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Pixels per row.
    pub width: u32,
    /// Layout of a pixel, e.g. `rgb8`.
    pub encoding: String,
    /// Whether multi-byte numbers are big-endian.
    pub is_bigendian: u8,
    /// Bytes per row.
    pub step: u32,
    /// The rows.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// `sensor_msgs/JointState`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointState {
    /// Time.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Positions, m or rad; may be empty.
    pub position: Vec<f64>,
    /// Velocities; may be empty.
    pub velocity: Vec<f64>,
    /// Efforts, N or N m; may be empty.
    pub effort: Vec<f64>,
}

/// `geometry_msgs/Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// `geometry_msgs/Wrench`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Wrench {
    /// N.
    pub force: Vector3,
    /// N m.
    pub torque: Vector3,
}

/// `geometry_msgs/WrenchStamped`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WrenchStamped {
    /// Time and frame.
    pub header: Header,
    /// Force and torque.
    pub wrench: Wrench,
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct KeyValue {
    /// Name.
    pub key: String,
    /// Value.
    pub value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// 0 ok, 1 a warning, 2 an error, 3 stale.
    pub level: u8,
    /// Name of the component.
    pub name: String,
    /// Description.
    pub message: String,
    /// The hardware.
    pub hardware_id: String,
    /// Numbers.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time.
    pub header: Header,
    /// One for each part.
    pub status: Vec<DiagnosticStatus>,
}

/// A message without fields, which still has one byte: the request of a trigger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Empty {
    /// Placeholder that ROS 2 inserts in an empty message.
    pub structure_needs_at_least_one_member: u8,
}

/// The answer of `std_srvs/Trigger`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it succeeded.
    pub success: bool,
    /// Description.
    pub message: String,
}

/// The goal of `control_msgs/action/GripperCommand`: its one field is a `control_msgs/GripperCommand`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct GripperCommandGoal {
    /// Where the jaws should go, m or rad: the unit of the joint.
    pub position: f64,
    /// Maximum effort during the motion and at its end, N.
    pub max_effort: f64,
}

/// Result and feedback of `control_msgs/action/GripperCommand`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct GripperCommandResult {
    /// Where the jaws are, m or rad.
    pub position: f64,
    /// Effort, N.
    pub effort: f64,
    /// Whether they push against something.
    pub stalled: bool,
    /// Whether they have reached the goal.
    pub reached_goal: bool,
}

topic_types! {
    "sensor_msgs" / CompressedImage Image JointState;
    "geometry_msgs" / WrenchStamped;
    "diagnostic_msgs" / DiagnosticArray;
}

impl ros2_client::Message for Empty {}
impl ros2_client::Message for TriggerResponse {}
impl ros2_client::Message for GripperCommandGoal {}
impl ros2_client::Message for GripperCommandResult {}
