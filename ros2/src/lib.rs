//! Slipbound in ROS 2, without a ROS installation: RustDDS communicates with ROS 2 nodes.
//!
//! | what | where |
//! |---|---|
//! | the node: images in, reports, wrenches, overlays, diagnostics out | [`node`] |
//! | its states and transitions | [`lifecycle`] |
//! | its parameters | [`config`] |
//! | gripper and wrist as separate nodes, for the library's control loop | [`gripper`], [`gripper_action`], [`wrist`] |
//! | that control loop between these topics | [`ros_hand`] |
//! | the messages | [`msg`] |
//! | topics and services by name | [`ros`] |
//!
//! `docs/ros2.md` explains how to use it, what was tested and what is not supported.

pub mod config;
pub mod counters;
pub mod error;
pub mod finger;
mod finger_thread;
mod finger_topics;
pub mod gripper;
pub mod gripper_action;
mod heartbeat;
pub mod image_decode;
mod image_topic;
pub mod lifecycle;
mod managed;
pub mod msg;
pub mod node;
pub mod overlay;
mod reconnect;
pub mod ros;
pub mod ros_hand;
mod tare;
pub mod wrench;
pub mod wrist;
