//! Messages as sent over the wire: each struct has the fields of its `.msg` file in their order, so that serde's CDR is
//! what ROS 2 expects. `tests/messages.rs` compares those of `slipbound_msgs` with the files.

mod device;
mod from_report;
mod lifecycle;
mod report;
mod standard;

pub use device::{GripCommand, GripperState, WristCommand, WristState};
pub use lifecycle::{
    ChangeStateRequest, ChangeStateResponse, GetAvailableStatesResponse, GetAvailableTransitionsResponse,
    GetStateResponse, LifecycleState, LifecycleTransition, TransitionDescription, TransitionEvent,
};
pub use report::{
    Contact, Estimate, Evidence, HandReport, HandSlip, HandVector, Markers, Motion, Shear, Slip, SlipReport,
};
pub use standard::{
    CompressedImage, DiagnosticArray, DiagnosticStatus, Empty, GripperCommandGoal, GripperCommandResult, Header, Image,
    JointState, KeyValue, Time, TriggerResponse, Vector3, Wrench, WrenchStamped,
};

/// A message with a topic type.
pub trait TopicType: ros2_client::Message + Clone + Send + 'static {
    /// The package it is from.
    const PACKAGE: &'static str;
    /// Its name there.
    const NAME: &'static str;
}

/// Defines the topic type of a struct.
macro_rules! topic_types {
    ($($package:literal / $($message:ident)+;)+) => {$($(
        impl ros2_client::Message for $message {}
        impl crate::msg::TopicType for $message {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($message);
        }
    )+)+};
}
pub(crate) use topic_types;
